"""Estimates that are plugged in are visible, and say what they cost."""

from types import SimpleNamespace

import numpy as np
import pytest

import tissuq as tq
from autoregression import autoregressive_errors
from tissuq.experiments.modes import loading_mode
from tissuq.model.tolerances import CONTRADICTION_SPREAD
from tissuq.posterior.plug_in import FACTORS, LAG_GRID, ErrorEstimates
from tissuq.posterior.solver import Solver

STRETCH = np.linspace(0.8, 1.3, 9)


def specimens(count, spread=0.1):
    """Neo-Hookean specimens a tenth apart."""
    moduli = 0.5 * np.linspace(1 - spread, 1 + spread, count)
    return [
        tq.simulate("neo-hookean", {"C10": modulus}, STRETCH, noise_sd=0.01, seed=number)
        for number, modulus in enumerate(moduli)
    ]


def test_one_test_with_independent_noise_needs_no_estimate():
    posterior = tq.fit(specimens(1)[0], discrepancy="none", noise_sd=0.01)
    assert posterior.model.fitted_errors.fits == 0
    assert "taken as known" not in posterior.how


def test_two_specimens_need_their_mean_curve():
    errors = tq.fit(specimens(2), discrepancy="none", noise_sd=0.01, tolerances=tq.Tolerances(stress=0.18))
    assert errors.model.fitted_errors.fits == 3
    assert errors.how.endswith(
        "the mean curve along which whole tests err estimated by 3 further fits and then taken as known"
    )


def test_specimens_tell_how_far_they_are_apart():
    posterior = tq.fit(specimens(4), discrepancy="none", noise_sd=0.01)
    errors, tolerances = posterior.model.fitted_errors, posterior.model.tolerances
    assert errors.fits == 3 + len(FACTORS)
    standard = tq.estimands()["tissue"].sizes
    assert tolerances.stress == pytest.approx(errors.factor * standard["stress"])
    assert tolerances.test == pytest.approx(errors.factor * standard["test"])
    assert 0.03 < np.hypot(tolerances.stress, tolerances.test) < 0.2
    assert f"the spread between tests ({errors.factor:.3g} times the stated one)" in posterior.how


@pytest.mark.parametrize("spread", [0.0, 0.02])
def test_more_specimens_that_agree_narrow_the_interval(spread):
    widths = []
    for count in (1, 2, 3, 5):
        moduli = 0.5 * (1 + spread * np.linspace(-1, 1, count))
        tests = [
            tq.simulate("neo-hookean", {"C10": modulus}, STRETCH, noise_sd=0.01, seed=number)
            for number, modulus in enumerate(moduli)
        ]
        low, high = tq.fit(tests, discrepancy="none", noise_sd=0.01, tolerances="tissue").marginals["C10"].hdi()
        assert low < 0.5 < high
        widths.append(high - low)
    assert np.all(np.diff(widths) < 0)


def test_tests_in_different_modes_do_not_tell_how_far_they_are_apart():
    other = tq.simulate("neo-hookean", {"C10": 0.5}, STRETCH, mode="planar", noise_sd=0.01, seed=9)
    model = tq.fit([specimens(1)[0], other], discrepancy="none", noise_sd=0.01).model
    assert model.fitted_errors.factor is None
    assert model.tolerances == tq.Tolerances("tissue")


def test_consecutive_noise_needs_its_lag():
    posterior = tq.fit(specimens(1)[0], discrepancy="none", noise="autoregressive", tolerances="as-tested")
    errors = posterior.model.fitted_errors
    assert errors.fits == 6
    assert f"the lag-1 correlation of {errors.lag:.3g} estimated by 6 further fits" in posterior.how


def test_no_lag_is_taken_from_fits_without_an_evidence():
    """Such as those of the sampler, to which models with known noise are left where quadrature does not serve."""
    model = tq.fit(specimens(1)[0], discrepancy="none", noise="autoregressive", tolerances="as-tested").model

    def without_evidence(_):
        return SimpleNamespace(log_evidence=None)

    estimates = ErrorEstimates(without_evidence, lambda _: True, lambda _: True, lambda: without_evidence)
    with pytest.raises(tq.ModelError, match="needs the evidence"):
        estimates.of(model.with_errors(lag=None))


@pytest.mark.parametrize("tolerances", ["as-tested", tq.Tolerances("as-tested", length=0.01, slack=0.005)], ids=str)
@pytest.mark.parametrize("lag", [0.0, 0.5, 0.97])
def test_the_lag_is_that_of_the_largest_evidence_of_all(lag, tolerances):
    stretch = np.linspace(1.02, 1.5, 40)
    errors = 0.01 * autoregressive_errors(40, lag, seed=3)
    experiment = tq.Experiment("uniaxial", stretch, 0.1 * (stretch - stretch**-2) + errors)
    posterior = tq.fit(experiment, discrepancy="none", noise="autoregressive", tolerances=tolerances)
    models = [posterior.model.with_errors(lag=other) for other in LAG_GRID]
    evidences = [Solver().solve([model])[0].log_evidence for model in models]
    best = int(np.argmax(evidences))
    assert LAG_GRID[max(best - 1, 0)] <= posterior.model.fitted_errors.lag <= LAG_GRID[min(best + 1, len(LAG_GRID) - 1)]
    assert posterior.log_evidence > max(evidences) - 0.05


def test_tolerances_of_the_user_leave_the_spread_alone():
    posterior = tq.fit(specimens(4), discrepancy="none", noise_sd=0.01, tolerances=tq.Tolerances(stress=0.1))
    assert posterior.model.fitted_errors.factor is None
    assert posterior.model.fitted_errors.fits == 3


def compressed_and_sheared(softening):
    """Compression of a neo-Hookean tissue, and shear of one as stiff at first that softens with the amount of shear."""
    stretch, shear = np.linspace(0.9, 0.99, 12), np.linspace(0.008, 0.1, 12)
    generator = np.random.default_rng(0)
    compressed, sheared = 0.11 * (stretch - stretch**-2), 0.11 * shear / (1 + softening * shear)
    return [
        tq.Experiment("uniaxial", stretch, compressed + 1e-5 * generator.standard_normal(12), name="compression"),
        tq.Experiment("simple-shear", shear, sheared + 1e-5 * generator.standard_normal(12), name="shear"),
    ]


@pytest.fixture(scope="module")
def contradictory():
    return tq.fit(compressed_and_sheared(8.0))


def test_tests_that_no_stable_energy_reconciles_are_fitted_by_simpler_ones_and_spread(contradictory):
    model = contradictory.model
    assert model.discrepancy.name == "auto-first"
    assert model.fitted_errors.reconciling_stability < 0.05
    standard = tq.estimands()["tissue"].sizes
    assert np.hypot(model.tolerances.stress, model.tolerances.test) == pytest.approx(CONTRADICTION_SPREAD)
    assert {**model.tolerances.sizes, "test": standard["test"]} == dict(standard)
    assert "the tests contradict each other" in contradictory.warnings[0]
    assert "spread" not in contradictory.how  # which was not estimated
    low, high = contradictory.marginals["C10"].hdi()
    assert low < 0.055 < high


@pytest.mark.slow
def test_tests_of_one_stable_material_do_not_contradict():
    posterior = tq.fit(compressed_and_sheared(0.0))
    assert posterior.model.fitted_errors.reconciling_stability is None
    assert posterior.model.discrepancy.name == "auto"
    assert not any("contradict" in warning for warning in posterior.warnings)


@pytest.mark.slow
@pytest.mark.parametrize(("law", "values"), [("ogden-1", [0.02, -12.0]), ("yeoh", [0.01, 0.02, 0.1])])
def test_laws_of_tension_and_compression_that_differ_do_not_contradict(law, values):
    material = tq.materials()[law]()
    points = {"uniaxial": np.linspace(0.82, 1.22, 14), "simple-shear": np.linspace(0.03, 0.35, 12)}
    tests = [
        tq.Experiment(mode, at, factor * tq.mechanics.engineering_stress(material, loading_mode(mode), at, values))
        for (mode, at), factor in zip(points.items(), (1.15, 0.85), strict=True)
    ]
    assert tq.fit(tests).model.fitted_errors.reconciling_stability is None


@pytest.mark.slow
def test_a_discrepancy_by_name_and_tolerances_of_the_user_are_kept_where_tests_contradict():
    tests = compressed_and_sheared(8.0)
    assert tq.fit(tests, discrepancy="log+hencky").model.discrepancy.name == "log+hencky"
    stated = tq.fit(tests, tolerances=tq.Tolerances(stress=0.1)).model
    assert (stated.discrepancy.name, stated.tolerances.stress) == ("auto", 0.1)


def test_a_saved_fit_still_says_that_its_tests_contradict(contradictory, tmp_path):
    contradictory.save(tmp_path / "fit.nc")
    loaded = tq.Posterior.load(tmp_path / "fit.nc")
    assert loaded.model.discrepancy.name == "auto-first"
    assert loaded.warnings[0] == contradictory.warnings[0]


@pytest.mark.slow
def test_what_was_asked_for_is_kept_in_contradictory_tests_of_one_specimen():
    tests = [test.labelled(specimen="S") for test in compressed_and_sheared(8.0)]
    priors = {"c1": tq.HalfNormal(0.05), "c2": tq.HalfNormal(0.05)}
    model = tq.fit(tests, priors=priors).model
    assert model.tolerances.test == CONTRADICTION_SPREAD  # all that they do not share
    assert model.tolerances.stress == tq.estimands()["specimen"].sizes["stress"]
    assert model.priors["c1"] == priors["c1"]
    assert "c2" not in model.symbols


@pytest.mark.slow
def test_each_contradictory_test_is_predicted_by_the_model_of_all(monkeypatch):
    used = []

    def spy(tests, **options):
        used.append(posterior := tq.fit(tests, **options))
        return posterior

    monkeypatch.setattr("tissuq.studies.specimen.fit", spy)
    third = compressed_and_sheared(8.0)[0].labelled(name="second compression")
    shifted = tq.Experiment("uniaxial", third.stretch, 1.1 * third.stress, name="second compression")
    tq.held_out_tests([*compressed_and_sheared(8.0), shifted])
    assert [posterior.model.discrepancy.name for posterior in used] == ["auto-first"] * 4


def drifting(lag, count=80, sd=0.02, seed=4):
    """One test whose errors are those of first-order autoregression."""
    stretch, errors = np.linspace(0.8, 1.5, count), autoregressive_errors(count, lag, seed)
    return tq.Experiment("uniaxial", stretch, 1.2 * (stretch - stretch**-2) + sd * errors)


@pytest.mark.slow
def test_unknown_noise_is_autoregressive_where_the_data_are_more_probable_so():
    data = drifting(0.7)
    tolerances = tq.Tolerances("as-tested", length=0.01, slack=0.005)
    model = tq.fit(data, discrepancy="zero-modulus", tolerances=tolerances).model
    assert model.noise.name == "autoregressive"
    # Dense covariances, C10 integrated and its amplitude summed, each at the best level of the noise.
    errors, x = model.fitted_errors, 2 * (data.stretch - data.stretch**-2)
    energy = 2 * (1 - data.stretch**-3) - x
    length, slack = errors.slopes[:, 0] * (data.stretch - 1), errors.slopes[:, 0] * data.stretch
    fixed = 0.01**2 * np.outer(length, length) + 0.005**2 * np.outer(slack, slack)
    apart = np.abs(np.subtract.outer(np.arange(len(x)), np.arange(len(x))))
    scale = model.priors["c1"].quantile(0.5)
    amplitudes = scale * np.geomspace(1e-4, 1e3, 60)
    prior = np.log(amplitudes / (1 + (amplitudes / scale) ** 2))

    def log_density(covariance):
        inverse, logdet = np.linalg.inv(covariance), np.linalg.slogdet(covariance)[1]
        precision = x @ inverse @ x
        rest = data.stress - x * (x @ inverse @ data.stress / precision)
        return -0.5 * (rest @ inverse @ rest + logdet + np.log(precision))

    def log_evidence(lag):
        of_levels = [level**2 * lag**apart + fixed for level in np.geomspace(0.005, 0.1, 30)]
        return max(
            np.logaddexp.reduce([log_density(base + c**2 * np.outer(energy, energy)) for c in amplitudes] + prior)
            for base in of_levels
        )

    best = max(map(log_evidence, np.linspace(0.1, 0.9, 9)))
    assert best > log_evidence(0.0) + 3
    assert log_evidence(errors.lag) > best - 0.3


@pytest.mark.slow
def test_independent_errors_stay_so():
    models = [tq.fit(drifting(0.0, seed=seed)).model for seed in range(3)]
    assert [model.noise.name for model in models] == ["unknown"] * 3
    assert all(model.fitted_errors.fits <= 5 for model in models)  # a curve, and few of the five lags


@pytest.mark.slow
@pytest.mark.parametrize(("noise", "count"), [("independent", 80), ("unknown", 11)])
def test_noise_stays_independent_where_it_is_asked_for_or_points_are_few(noise, count):
    posterior = tq.fit(drifting(0.8, count), noise=noise)
    assert posterior.model.noise.name == noise
    assert posterior.model.fitted_errors.lag is None


def test_no_correlation_is_longer_than_a_tenth_of_the_curve():
    smooth = drifting(0.0, sd=1e-4)
    bumps = 0.01 * np.sin(40 * smooth.stretch)
    wavy = tq.Experiment("uniaxial", smooth.stretch, smooth.stress + bumps)
    assert 0.5 < tq.fit(wavy, discrepancy="taylor").model.fitted_errors.lag <= np.exp(-1 / 8)


@pytest.mark.parametrize("seed", range(2))
def test_independent_errors_below_the_resolution_that_is_assumed_stay_so(seed):
    fine = drifting(0.0, seed=seed, sd=1e-4)  # the resolution is 0.002 of the largest stress
    assert fine.stress.max() > 1
    assert tq.fit(fine, discrepancy="taylor").model.noise.name == "unknown"


@pytest.mark.parametrize("count", [2, 6])
def test_repeated_tests_of_one_specimen_do_not_tell_the_error_of_its_area(count):
    tests = [test.labelled(specimen="one") for test in specimens(count, spread=0.0)]
    model = tq.fit(tests, discrepancy="none").model
    standard = tq.estimands()["specimen"].sizes
    assert model.tolerances.stress == standard["stress"]
    assert model.tolerances.test == pytest.approx(model.fitted_errors.factor * standard["test"])
    assert model.fitted_errors.factor < 1
    for off in (0.94, 1.06):  # by one standard deviation, and a little
        of_area = [
            tq.Experiment("uniaxial", STRETCH, off * test.stress, test.name).labelled(specimen="one") for test in tests
        ]
        low, high = tq.fit(of_area, discrepancy="none").marginals["C10"].hdi()
        assert low < 0.5 < high


def test_tests_of_several_specimens_tell_both_spreads():
    moduli, rng = 0.5 * np.exp(0.15 * np.array([-1.2, -0.3, 0.4, 1.1])), np.random.default_rng(2)
    tests = [
        tq.simulate("neo-hookean", {"C10": modulus * (1 + 0.005 * rng.normal())}, STRETCH, noise_sd=0.002, seed=k)
        .labelled(specimen=str(k))
        for k, modulus in enumerate(moduli)
        for _ in range(3)
    ]  # fmt: skip
    tolerances = tq.fit(tests, discrepancy="none").model.tolerances
    assert tolerances.test < 0.04
    assert 0.08 < tolerances.stress < 0.3


def test_spreads_that_are_stated_are_kept_whatever_their_size():
    standard = tq.estimands()["tissue"].sizes
    for size in (standard["stress"], 1.01 * standard["stress"]):
        tolerances = tq.Tolerances("tissue", stress=size)
        model = tq.fit(specimens(4), discrepancy="none", noise_sd=0.01, tolerances=tolerances).model
        assert model.tolerances.stress == size
        assert model.fitted_errors.factor is None


def test_sizes_alone_replace_those_of_the_default_one_by_one():
    for tests, estimand in ((specimens(1)[0], "specimen"), (specimens(2), "tissue")):
        model = tq.fit(tests, discrepancy="none", tolerances={"slack": 0.01, "stress": 0.07}).model
        assert model.tolerances == tq.Tolerances(estimand, slack=0.01, stress=0.07)
    model = tq.fit(specimens(1)[0], discrepancy="none", noise_sd=0.01, tolerances={"slack": 0.01}).model
    assert model.tolerances == tq.Tolerances(slack=0.01)
    with pytest.raises(tq.InputError, match="there is no error of a test named 'slak'"):
        tq.fit(specimens(1)[0], tolerances={"slak": 0.01})
