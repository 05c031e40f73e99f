"""The energy of a preferred direction, against matrices and Taylor series, and what `auto` makes of sheets."""

from __future__ import annotations

from math import factorial

import numpy as np
import pytest

import tissuq as tq
from loading import MEASURED
from tissuq.errors import ModelError
from tissuq.experiments.modes import Biaxial
from tissuq.model.discrepancy import discrepancy_named
from tissuq.model.discrepancy.blocks import DirectionBlock

DISPERSIONS = pytest.mark.parametrize("dispersion", [0.0, 0.2])
STEP = 1e-5
TERMS = 60


def gradient(first, second, shear=0.0):
    return np.array([[first, shear, 0], [0, second, 0], [0, 0, 1 / (first * second)]])


MOVED = {  # F a step further than at a point, for every stress; the number of axes that carry it
    "uniaxial-1-1": (lambda x, step: gradient(x + step, (x + step) ** -0.5), 1),
    "equibiaxial-1-1": (lambda x, step: gradient(x + step, x + step), 2),
    "planar-1-1": (lambda x, step: gradient(x + step, 1.0), 1),
    "constrained-uniaxial-1-1": (lambda x, step: gradient(x + step, 1.0), 1),
    "constrained-uniaxial-2-2": (lambda x, step: gradient(x, 1.0 + step), 1),
    "biaxial-1-1": (lambda x, step: gradient(x[0] + step, x[1]), 1),
    "biaxial-2-2": (lambda x, step: gradient(x[0], x[1] + step), 1),
    "thin-tube-1-1": (lambda x, step: gradient(x[0] + step, x[1]), 1),
    "thin-tube-2-2": (lambda x, step: gradient(x[0], x[1] + step), 1),
    "inflated-tube-1-1": (lambda x, step: gradient(x[0] + step, x[1]), 1),
    "simple-shear-1-2": (lambda x, step: gradient(1.0, 1.0, x + step), 1),
    "simple-shear-normal-1-2": (lambda x, step: gradient(1.0, 1.0, x + step), 1),
    "simple-shear-normal-2-2": (lambda x, step: gradient(1.0, 1.0 + step, x), 1),
}


def energies(F, dispersion, scale):
    """The terms of both axes: independent Taylor coefficients of G', less their mean modulus."""
    C = F.T @ F
    terms = []
    for axis in np.eye(3)[:2]:
        z = np.trace((dispersion * np.eye(3) + (1 - 3 * dispersion) * np.outer(axis, axis)) @ C) - 1
        series = [z ** (n + 1) / (n + 1) / scale**n / np.sqrt(float(factorial(n))) for n in range(1, TERMS)]
        series[0] -= 2 / 15 * (1 - 3 * dispersion) ** 2 / scale * (np.trace(C) - 3)
        terms += series
    return np.array(terms)


@DISPERSIONS
@pytest.mark.parametrize("measured", MEASURED, ids=str)
def test_stresses_are_derivatives_of_an_energy_of_structure_tensors(measured, dispersion):
    block, points = DirectionBlock(dispersion), measured.points
    moved, loaded_axes = MOVED[str(measured)]
    states = measured.path.at(points)
    reach = block.reach(states)
    for length in block.lengths[1:]:
        features = block.stress_features(states, reach, length)
        scale = length * (reach[1] - reach[0])
        expected = np.array(
            [
                np.subtract(*(energies(moved(point, step), dispersion, scale) for step in (STEP, -STEP)))
                / (2 * STEP * loaded_axes)
                for point in points
            ]
        )
        covariance, wanted = features @ features.T, expected @ expected.T
        assert np.allclose(covariance, wanted, rtol=1e-5, atol=1e-6 * np.abs(wanted).max())
        assert np.allclose(np.diag(wanted), block.stress_variance(states, reach, length), rtol=1e-5, atol=1e-9)


@DISPERSIONS
def test_the_mean_modulus_over_all_directions_is_zero(dispersion):
    block, small = DirectionBlock(dispersion), 1e-5
    states = Biaxial().paths[0].at([[1.1, 1.0]])
    of_first_axis = slice(0, block.stress_features(states, (0.0, 1.0), 1.0).shape[1] // 2)
    # Stresses along strains (2, -1, -1) and (0, 1, -1): work on both axes, half of it times the strain is the energy.
    energies_of_first = []
    for strain in ((2.0, -1.0), (0.0, 1.0)):
        at = np.exp(small * np.array([strain]))
        work = sum(
            strain[axis] * block.stress_features(Biaxial().paths[axis].at(at), (0.0, 1.0), 1.0)[0, of_first_axis]
            for axis in range(2)
        )
        energies_of_first.append(0.5 * work / small)
    # W = A (n.e.n)^2 + B |e|^2 about the axis n, whose mean over n is A <(n.e.n)^2> + B |e|^2.
    B = energies_of_first[1] / 2
    A = (energies_of_first[0] - 6 * B) / 4
    nodes, weights = np.polynomial.legendre.leggauss(12)
    angle = 2 * np.pi * np.arange(24) / 24
    across = np.sqrt(1 - nodes**2)[:, None]
    along = 2 * (across * np.cos(angle)) ** 2 - (across * np.sin(angle)) ** 2 - nodes[:, None] ** 2
    mean = 0.5 * weights @ (along**2).mean(axis=1)
    size = np.abs(A * mean).max()
    assert size > 0.01
    assert np.abs(A * mean + 6 * B).max() < 1e-3 * size


def sheet(sd, stiffness, ratios=((1, 0.5), (0.5, 1)), largest=0.2, count=14):
    """Biaxial tests of a neo-Hookean sheet with exponential fibres along axis 1."""
    law = tq.materials()["neo-hookean"]() + tq.mechanics.material_named("exponential-fibres:one@0")
    tests = []
    for number, ratio in enumerate(ratios):
        points = 1 + largest * np.outer(np.linspace(0, 1, count + 1)[1:], ratio)
        clean = np.column_stack(
            [tq.mechanics.engineering_stress(law, path, points, [0.01, stiffness, 2.0]) for path in Biaxial().paths]
        )
        noise = sd * np.random.default_rng(number).standard_normal(clean.shape)
        tests.append(tq.Experiment("biaxial", points, clean + noise, name=f"test {number}", specimen="S"))
    return tests


@pytest.fixture(scope="module")
def directed():
    return tq.fit(sheet(2e-4, 0.02), tolerances="specimen")


@pytest.mark.slow
def test_a_stiffer_axis_is_found_and_other_protocols_are_predicted(directed):
    assert directed.assess().direction > 0.95
    assert "preferred direction with a probability of" in " ".join(directed.assess().sentences)
    (equibiaxial, strip) = sheet(0.0, 0.02, ratios=((0.9, 0.9), (0, 1)), largest=0.18)
    isotropic = tq.fit(sheet(2e-4, 0.02), tolerances="specimen", discrepancy="auto-isotropic")
    for test in (equibiaxial, strip):
        errors = {}
        for name, posterior in (("directed", directed), ("isotropic", isotropic)):
            bands = [posterior.predict(test.stretch, mode=test.mode, channel=channel) for channel in range(2)]
            low, high, median = (
                np.column_stack([band[end].to_numpy() for band in bands]) for end in ("low", "high", "median")
            )
            errors[name] = np.sqrt(((median - test.stress) ** 2).mean())
            if name == "directed":
                assert ((low <= test.stress) & (test.stress <= high)).mean() > 0.9
        assert errors["directed"] < 0.4 * errors["isotropic"]


@pytest.mark.slow
def test_a_sheet_that_is_the_same_along_both_axes_has_hardly_a_direction():
    posterior = tq.fit(sheet(2e-4, 0.0), tolerances="specimen")
    assert posterior.assess().direction < 0.3
    low, high = posterior.marginals["C10"].hdi()
    assert low < 0.01 < high
    assert len(posterior.ensemble(4)) == 4  # of the energies without direction


def test_draws_of_a_material_with_a_direction_are_refused(directed):
    with pytest.raises(ModelError, match="auto-isotropic"):
        directed.ensemble(4)


@pytest.mark.slow
def test_a_saved_fit_keeps_its_direction(directed, tmp_path):
    directed.save(tmp_path / "fit.nc")
    assert tq.Posterior.load(tmp_path / "fit.nc").assess().direction == pytest.approx(directed.assess().direction)


def test_predictions_far_beyond_the_data_stay_finite_and_open(directed):
    points = np.array([[1.2, 1.2], [1.3, 1.3], [1.5, 1.5], [2.0, 2.0]])
    band = directed.predict(points, mode="biaxial", noise=False)
    width = (band["high"] - band["low"]).to_numpy() / band["median"].to_numpy()
    assert (np.diff(band["median"]) > 0).all()
    assert (np.diff(width) > 0).all()
    assert width[-1] < 100


@pytest.mark.slow
def test_stability_does_not_ask_a_directed_material_for_greater_stress_along_greater_stretch(directed):
    assert min(directed.assess().stable.values()) > 0.9


def test_only_tests_of_two_axes_show_a_direction():
    (first, second), line = sheet(2e-4, 0.02), np.linspace(1.02, 1.2, 8)
    uniaxial = tq.Experiment("uniaxial", line, line - 1)
    sheared = tq.Experiment("simple-shear-normal", line - 1, np.column_stack([line - 1, 1 - line]))
    held = tq.Experiment("constrained-uniaxial", line, np.column_stack([line - 1, line - 1]))
    for tests, expected in (
        ([first, second], True),
        ([held], True),
        ([uniaxial], False),
        ([sheared], False),
        ([first, uniaxial], False),
    ):
        experiment = tq.Experiment.of(tests)
        assert experiment.shows_direction is expected
        adapted = discrepancy_named("auto").adapted_to(tq.materials()["neo-hookean"](), experiment)
        assert adapted.has_direction is expected
    fibres = tq.mechanics.material_named("neo-hookean+exponential-fibres")
    assert not discrepancy_named("auto").adapted_to(fibres, first).has_direction
    assert not discrepancy_named("auto-isotropic").adapted_to(tq.materials()["neo-hookean"](), first).has_direction


def test_odds_of_a_direction_are_even():
    model = discrepancy_named("auto").adapted_to(tq.materials()["neo-hookean"](), tq.Experiment.of(sheet(2e-4, 0.02)))
    members = model.members(tq.Experiment.of(sheet(2e-4, 0.02)).states)
    assert sum(member.probability for member in members if member.is_isotropic) == pytest.approx(0.5)
    assert sum(member.probability for member in members) == pytest.approx(1.0)


def test_tension_leaves_compression_open(directed):
    law = tq.mechanics.material_named("neo-hookean+exponential-fibres:one@0")
    points = np.array([[0.93, 0.95], [0.9, 0.9], [0.85, 0.95]])
    for channel, path in enumerate(Biaxial().paths):
        stress = tq.mechanics.engineering_stress(law, path, points, [0.01, 0.02, 2.0])  # fibres bear no compression
        band = directed.predict(points, mode="biaxial", channel=channel, noise=False)
        assert (band["low"] <= stress).all()
        assert (stress <= band["high"]).all()


def test_modes_of_one_stress_say_what_they_predict_of_a_directed_material(directed):
    from tissuq.studies.predict_run import predicted

    for mode, words in (("uniaxial", "along axis 1"), ("equibiaxial", "mean of those of axes 1 and 2")):
        warnings = predicted(directed, mode=mode, stretch=[1.05, 1.1]).warnings
        assert any("preferred direction" in warning and words in warning for warning in warnings)
    assert not any("preferred" in warning for warning in predicted(directed, mode="planar", stretch=[1.05]).warnings)


def test_a_test_of_one_axis_among_sheets_hides_their_direction_and_says_so():
    from tissuq.assessment.measurements import measurement_warnings

    line = np.linspace(1.02, 1.2, 12)
    tests = [*sheet(2e-4, 0.02), tq.Experiment("uniaxial", line, 0.06 * (line - line**-2))]
    assert any("preferred direction" in text for text in measurement_warnings(tq.Experiment.of(tests)))
    assert not any("preferred direction" in text for text in measurement_warnings(tq.Experiment.of(tests[:2])))
