"""Errors of a test: each is one class, and its size a tolerance."""

import numpy as np
import pytest

import tissuq as tq
from tissuq.experiments.modes import SimpleShear, Uniaxial
from tissuq.model.error_model import whitening
from tissuq.model.measurement_errors import ErrorPoints, MeasurementError
from tissuq.model.tolerances import FittedErrors, Tolerances
from tissuq.registry import variants

STRETCH = np.linspace(1.02, 1.3, 15)


class Drift(MeasurementError):
    """A load cell that drifts in proportion to the place in the test."""

    name = "drift"
    description = "of drift over the test"
    is_stress = True

    def effect(self, points):
        return np.linspace(0.0, 1.0, len(points.stretch)) * np.ones_like(points.stress)


class Misshapen(MeasurementError):
    """An error whose effect does not have the shape of the stresses."""

    name = "misshapen"
    description = "of no shape"

    def effect(self, points):
        return np.ones(3)


class Endless(MeasurementError):
    """An error whose effect is no number."""

    name = "endless"
    description = "of no size"

    def effect(self, points):
        return np.nan * points.stress


def test_an_effect_that_is_not_finite_is_refused():
    data = tq.simulate("neo-hookean", {"C10": 0.5}, STRETCH, noise_sd=0.002, seed=3)
    with pytest.raises(tq.ModelError, match="'endless' has an effect that is not a finite number"):
        tq.fit(data, discrepancy="none", noise_sd=0.002, tolerances=Tolerances(endless=0.2))


def test_an_effect_of_another_shape_is_refused():
    data = tq.simulate("neo-hookean", {"C10": 0.5}, STRETCH, noise_sd=0.002, seed=3)
    with pytest.raises(tq.ModelError, match=r"'misshapen' has an effect of shape \(3,\) on 15 stresses"):
        tq.fit(data, discrepancy="none", noise_sd=0.002, tolerances=Tolerances(misshapen=0.2))


@pytest.mark.parametrize(
    ("mode", "stretch"), [(Uniaxial(), 1 + 1e-3 * np.arange(4)), (SimpleShear(), 0.1 * np.arange(4))]
)
def test_each_error_is_the_difference_that_a_small_one_makes(mode, stretch):
    def stress(at):
        return at**3 - 1.0

    def slope(at):
        return 3 * at**2

    step, reference = 1e-6, mode.reference
    truth = {
        "stress": (1 + step) * stress(stretch),
        "length": stress(reference + (1 + step) * (stretch - reference)),
        "slack": stress(stretch * (1 + step) if reference else stretch + step),
        "zero": stress(stretch) + step,
        "stretch": stress(stretch + step),
        "test": (1 + step) * stress(stretch),
    }
    points = ErrorPoints(mode, stretch, stress(stretch), slope(stretch)[:, None])
    for name, moved in truth.items():
        error = variants(MeasurementError)[name]()
        assert np.allclose(error.effect(points).ravel(), (moved - stress(stretch)) / step, rtol=1e-4, atol=1e-4), name


def test_an_error_of_ones_own_is_integrated_like_the_others():
    drifted = tq.simulate("neo-hookean", {"C10": 0.5}, STRETCH, noise_sd=0.002, seed=3)
    data = tq.Experiment("uniaxial", STRETCH, drifted.stress + 0.2 * np.linspace(0, 1, len(STRETCH)))
    blind = tq.fit(data, discrepancy="none", noise_sd=0.002).marginals["C10"]
    aware = tq.fit(data, discrepancy="none", noise_sd=0.002, tolerances=Tolerances(drift=0.2)).marginals["C10"]
    assert abs(blind.mean - 0.5) > 10 * blind.sd
    # generalised least squares with the error's covariance written out
    basis = 2 * (STRETCH - STRETCH**-2)
    course = np.linspace(0, 1, len(STRETCH))
    precision = np.linalg.inv(0.002**2 * np.eye(len(STRETCH)) + 0.2**2 * np.outer(course, course))
    sd = (basis @ precision @ basis) ** -0.5
    assert aware.mean == pytest.approx(sd**2 * (basis @ precision @ data.stress), rel=1e-6)
    assert aware.sd == pytest.approx(sd, rel=1e-6)
    assert abs(aware.mean - 0.5) < 3 * aware.sd


def test_an_error_that_does_not_exist_is_refused_by_name():
    with pytest.raises(tq.InputError, match=r"there is no error of a test named 'stres'\. Did you mean 'stress'"):
        Tolerances(stres=0.1)
    with pytest.raises(tq.InputError, match="tolerance of the zero must be a number, zero or more"):
        Tolerances(zero=-1.0)


def test_sizes_of_zero_are_no_errors():
    assert not Tolerances(stress=0.0)
    assert Tolerances(stress=0.1, zero=0.0) == Tolerances(stress=0.1)
    assert Tolerances(stress=0.1).with_sizes(stress=0.0, slack=0.01) == Tolerances(slack=0.01)


def smooth_covariance(strain):
    """The covariance of a smooth relative error, written out: squared exponential, a third of the range long."""
    length = (strain.max() - strain.min()) / 3
    return np.exp(-0.5 * ((strain[:, None] - strain) / length) ** 2)


def test_a_smooth_error_is_a_process_along_the_curve():
    data = tq.simulate("neo-hookean", {"C10": 0.5}, STRETCH, noise_sd=0.002, seed=3)
    model = tq.fit(data, discrepancy="none", noise_sd=0.002, tolerances=Tolerances(smooth=0.05)).model
    curve = model.fitted_errors.curve
    errors = smooth_covariance(STRETCH) * np.outer(curve, curve)
    precision = np.linalg.inv(0.002**2 * np.eye(len(STRETCH)) + 0.05**2 * errors)
    basis = 2 * (STRETCH - STRETCH**-2)
    sd = (basis @ precision @ basis) ** -0.5
    posterior = tq.fit(data, discrepancy="none", noise_sd=0.002, tolerances=Tolerances(smooth=0.05)).marginals["C10"]
    assert posterior.mean == pytest.approx(sd**2 * (basis @ precision @ data.stress), rel=1e-5)
    assert posterior.sd == pytest.approx(sd, rel=1e-4)
    assert posterior.sd > 5 * tq.fit(data, discrepancy="none", noise_sd=0.002).marginals["C10"].sd


@pytest.mark.parametrize("mode", ["uniaxial", "simple-shear", "biaxial"])
def test_the_variance_of_a_smooth_error_is_that_of_the_stress_everywhere(mode):
    along = np.linspace(-0.2, 0.4, 37)
    loading = tq.loading_modes()[mode]()
    stretch = loading.reference + (along if mode != "biaxial" else np.column_stack([along, 0.5 * along]))
    stress = np.random.default_rng(1).random((4, 37))
    variance = Tolerances(smooth=0.03).variance(ErrorPoints(loading, stretch, stress))
    assert np.allclose(variance, (0.03 * stress) ** 2, rtol=2e-6)
    alone = Tolerances(smooth=0.03).variance(ErrorPoints(loading, stretch[:1], stress[:, :1]))
    assert np.allclose(alone, (0.03 * stress[:, :1]) ** 2, rtol=1e-12)


def test_every_test_and_every_stress_has_a_smooth_error_of_its_own():
    """Two tests of one specimen, one with two stresses: the covariance of the whitened data is that of blocks."""
    along = np.linspace(0.02, 0.2, 9)
    sheet = np.column_stack([1 + along, 1 + 0.5 * along])
    tests = [
        tq.Experiment("uniaxial", 1 + along, along, specimen="A"),
        tq.Experiment("biaxial", sheet, np.column_stack([2 * along, along]), specimen="A"),
    ]
    curve = np.concatenate([along, 2 * along, along])
    found = whitening(
        tq.Experiment.of(tests), np.full(2, 0.01), 0.01, Tolerances(smooth=0.1), FittedErrors(curve=curve)
    )
    distance = np.linalg.norm(sheet - 1, axis=1)
    block = [smooth_covariance(along), smooth_covariance(distance), smooth_covariance(distance)]
    relative = np.zeros((27, 27))
    for number, correlation in enumerate(block):
        relative[9 * number : 9 * number + 9, 9 * number : 9 * number + 9] = correlation
    covariance = 0.01**2 * np.eye(27) + 0.1**2 * relative * np.outer(curve, curve)
    white = found(np.eye(27))
    assert np.allclose(white @ covariance @ white.T, 0.01**2 * np.eye(27), atol=2e-5 * 0.01**2)


def test_an_estimand_is_a_set_of_sizes_that_single_ones_replace():
    specimen, tissue = Tolerances("specimen"), Tolerances("tissue")
    assert specimen.estimand == "specimen"
    assert tissue.stress > specimen.stress > 0
    assert not Tolerances("as-tested")
    assert Tolerances() == Tolerances("as-tested")
    other = Tolerances("specimen", slack=0, zero=0.1)
    assert "slack" not in other.sizes
    assert (other.sizes["zero"], other.sizes["length"]) == (0.1, specimen.sizes["length"])
    assert other.with_sizes(stress=0.3).sizes == other.sizes | {"stress": 0.3}
    assert eval(repr(other)) == other
    assert (specimen.has_standard_spreads, Tolerances("specimen", test=0.3).has_standard_spreads) == (True, False)
    assert Tolerances("none") == Tolerances("as-tested") == Tolerances()  # as --tolerance none
    with pytest.raises(tq.InputError, match="there is no estimand 'patient'"):
        Tolerances("patient")


def test_one_file_of_one_test_is_as_tested_where_its_errors_are_known_or_taken_up():
    test = tq.simulate("neo-hookean", {"C10": 0.5}, STRETCH, noise_sd=0.002, seed=3)
    assert tq.fit(test, discrepancy="none").model.tolerances == Tolerances("specimen")
    for options in ({"noise_sd": 0.002}, {"noise": "autoregressive"}, {"noise": "proportional"}):
        assert not tq.fit(test, discrepancy="none", **options).model.tolerances
    assert not tq.fit(test, discrepancy="constant").model.tolerances


def test_correlated_noise_beside_an_energy_leaves_errors_of_the_test_in_the_interval():
    test = tq.simulate("neo-hookean", {"C10": 0.5}, STRETCH, noise_sd=0.002, seed=3)
    assert tq.fit(test, discrepancy="taylor", noise="autoregressive").model.tolerances == Tolerances("specimen")


def test_several_controls_have_an_error_of_length_and_slack_each():
    along = np.linspace(0.02, 0.2, 9)
    sheet = np.column_stack([1 + along, 1 + 0.5 * along])
    truth = tq.simulate("neo-hookean", {"C10": 0.5}, sheet, mode="biaxial", noise_sd=0.001, seed=2)
    tolerances = Tolerances(length=0.03, slack=0.01)
    model = tq.fit(truth, discrepancy="none", noise_sd=0.001, tolerances=tolerances).model
    path_1, path_2 = truth.mode.paths
    C10, step = model.fitted_errors.curve @ model.design[:, 0], 1e-6
    columns = []
    for control in range(2):
        moved = sheet + step * (np.arange(2) == control)
        both = [path.at(points) for path in (path_1, path_2) for points in (sheet, moved)]
        first, after_1, second, after_2 = (model.basis(states)[:, 0] for states in both)
        columns.append(np.concatenate([after_1 - first, after_2 - second]) / step)
    basis = np.concatenate([model.basis(path.at(sheet))[:, 0] for path in (path_1, path_2)])
    assert C10 != 0
    scale = (model.fitted_errors.curve @ basis) / (basis @ basis)
    assert np.allclose(model.fitted_errors.slopes, scale * np.column_stack(columns), rtol=1e-3, atol=1e-4)
    errors = []
    for control, slope in enumerate(np.array(columns) * scale):
        stretch = np.concatenate([sheet[:, control]] * 2)
        errors += [0.03 * (stretch - 1) * slope, 0.01 * stretch * slope]
    covariance = 0.001**2 * np.eye(18) + sum(np.outer(error, error) for error in errors)
    white = model.whitening(np.eye(18))
    assert np.allclose(white @ covariance @ white.T, 0.001**2 * np.eye(18), atol=1e-3 * 0.001**2)
