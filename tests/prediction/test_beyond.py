"""Predictions beyond the range of the data, against draws as materials, closed forms and other predictions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import t as student_t

import tissuq as tq
from tissuq.experiments.modes import States, loading_mode
from tissuq.mechanics.rays import INNER_SHARE, TRANSITION, share_to_end, with_errors
from tissuq.prediction.bands import Mixtures
from tissuq.prediction.moments import drawn_curves, stress_moments

TRUTH = {"C10": 0.5, "C20": 0.1, "C30": 0.05}
STRETCH = np.linspace(0.8, 1.4, 24)
NOISE_SD = 0.01
BEYOND = {
    "uniaxial": [0.4, 0.55, 0.7, 0.78, 1.41, 1.5, 1.7, 2.0, 3.0],
    "equibiaxial": [0.8, 1.2, 1.3, 1.5, 2.0],
    "planar": [1.4, 1.5, 1.7, 2.2],
    "simple-shear": [0.8, 1.0, 1.2, 1.7],
}
"""Stretches, or amounts of shear, beyond the range of the data of some members of the discrepancy or of all."""
ENDS = {"low": 0.025, "median": 0.5, "high": 0.975}


def fitted(law, values, stretch, seed, discrepancy="auto", noise_sd=NOISE_SD, mode="uniaxial", **options):
    data = tq.simulate(law, values, stretch, noise_sd=noise_sd, seed=seed, mode=mode)
    return tq.fit(data, discrepancy=discrepancy, noise_sd=noise_sd, **options)


def ranges_of(posterior):
    """Return the ranges of the data of the posterior's members, and the components of every one."""
    return list(posterior.model.by_limits(posterior.solution.mixture.member))


def half_width(band):
    return (band["high"] - band["low"]).to_numpy() / 2


@pytest.fixture(scope="module")
def posterior():
    return fitted("yeoh", TRUTH, STRETCH, 3)


@pytest.fixture(scope="module")
def ensemble(posterior):
    return posterior.ensemble(2048, admissible=False)


@pytest.mark.slow
@pytest.mark.parametrize("mode", BEYOND)
def test_predictions_have_the_distribution_of_draws_as_materials(posterior, ensemble, mode):
    # Shares of 2048 quasi-random draws below an end of the band. Both are right within about 0.003 at the ends and
    # 0.01 in the middle, where the posterior is thinned and its parameters drawn.
    points = np.array(BEYOND[mode])
    logs, _ = loading_mode(mode).at(points).log_stretches
    is_beyond = [share_to_end(logs, limits) < 1 for limits, _ in ranges_of(posterior)]
    assert np.any(is_beyond, axis=0).all()
    band = posterior.predict(points, mode=mode, noise=False)
    stress = ensemble.stress(loading_mode(mode), points)
    for end, probability in ENDS.items():
        error = 0.03 if end == "median" else 0.012
        np.testing.assert_allclose((stress < band[end].to_numpy()).mean(axis=0), probability, atol=error)


def test_quantiles_of_draws_with_heavy_tails_are_those_of_the_draws():
    draws = np.exp(0.6 * student_t(2).ppf((np.arange(4000) + 0.5) / 4000).clip(-22, 22))
    mixture = Mixtures(np.full(4000, 1 / 4000), draws[:, None], np.zeros((4000, 1)))
    for probability in ENDS.values():
        assert mixture.quantile(probability)[0] == pytest.approx(np.quantile(draws, probability), rel=0.03)


@pytest.mark.parametrize("mode", ["uniaxial", "planar", "simple-shear"])
def test_the_band_of_the_tests_mode_opens_steadily(posterior, mode):
    ends = {"uniaxial": [(1.4, 2.2), (0.8, 0.45)], "planar": [(1.45, 2.0)], "simple-shear": [(0.75, 1.6)]}
    for first, last in ends[mode]:
        band = posterior.predict(np.linspace(first, last, 15)[1:], mode=mode, noise=False)
        assert (np.diff(half_width(band) / band["median"].abs()) > 0).all()


@pytest.mark.parametrize("end", [0.8, 1.4])
@pytest.mark.parametrize("noise", [True, False])
def test_the_band_is_continuous_at_the_end_of_the_measured_range(posterior, end, noise):
    inside, beyond = (posterior.predict([end * (1 + step)], noise=noise) for step in (-1e-6, 1e-6))
    for column in ENDS:
        assert beyond[column][0] == pytest.approx(inside[column][0], abs=0.06 * 2 * half_width(inside)[0])


@pytest.mark.parametrize("mode", ["planar", "equibiaxial", "simple-shear"])
def test_the_band_of_another_mode_is_continuous_at_the_ends_of_the_ranges_of_all_members(posterior, mode):
    loading, far = loading_mode(mode), 2.0

    def excess(change, limits):
        logs, _ = loading.at(loading.excursion([change])).log_stretches
        return 1 - share_to_end(logs, limits)[0] - 1e-7

    changes = np.array([brentq(excess, 0.01, far, args=(limits,)) for limits, _ in ranges_of(posterior)])
    inside, beyond = (
        posterior.predict(loading.excursion(changes * (1 + step)), mode=mode, noise=False) for step in (-1e-5, 1e-5)
    )
    for column in ENDS:
        np.testing.assert_allclose((beyond[column] - inside[column]) / half_width(inside), 0, atol=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("tolerances", [None, tq.Tolerances(stretch=0.002)])
def test_a_prediction_is_the_same_beside_others_farther_away(tolerances):
    posterior = fitted("yeoh", TRUTH, STRETCH, 3, tolerances=tolerances)
    points = [1.3, 1.395, 1.4, 1.41]  # 1.4 is the last measured stretch
    alone = [posterior.predict([point]).iloc[0] for point in points]
    together = posterior.predict([*points, 1.6])
    for row, single in enumerate(alone):
        for column in ENDS:
            width = single["high"] - single["low"]
            assert together[column][row] == pytest.approx(single[column], abs=0.03 * width)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_a_right_model_is_inside_the_band_to_twice_the_measured_strain(seed):
    # With the discrepancy, whose band of 95 % beyond the data holds more than that of a model that is right.
    posterior = fitted("neo-hookean", {"C10": 0.5}, STRETCH, seed)
    points = {
        "uniaxial": [1.41, 1.5, 1.7, 1.96, 0.78, 0.7, 0.64],
        "planar": [1.4, 1.6, 1.79],
        "equibiaxial": [1.2, 1.3, 1.4],
        "simple-shear": [0.8, 1.2],
    }
    for mode, stretch in points.items():
        band = posterior.predict(stretch, mode=mode, noise=False)
        exact = tq.simulate("neo-hookean", {"C10": 0.5}, stretch, mode=mode).stress
        assert ((band["low"] < exact) & (exact < band["high"])).all()


SMALL = {"uniaxial": 1.1**3, "planar": 1.1 ** (3 * 0.75**0.5), "equibiaxial": 1.1**1.5}
"""Stretches of three times the Hencky strain at the last one, 1.1 in uniaxial tension, of a test."""


@pytest.fixture(scope="module")
def of_small_strains():
    laws = {"neo-hookean": {"C10": 0.5}, "yeoh": TRUTH}
    return {law: fitted(law, values, np.linspace(1.01, 1.1, 20), 1, noise_sd=0.003) for law, values in laws.items()}


@pytest.mark.parametrize("mode", SMALL)
@pytest.mark.parametrize("law", ["neo-hookean", "yeoh"])
def test_three_times_as_far_as_the_data_nothing_is_negative_or_astronomical(of_small_strains, law, mode):
    stretch = 1 + (SMALL[mode] - 1) * np.array([0.4, 0.7, 1.0])
    band = of_small_strains[law].predict(stretch, mode=mode, noise=False)
    assert (band["low"] > 0).all()
    assert (band["high"] < 30 * band["median"]).all()


@pytest.mark.slow
def test_far_beyond_everything_is_finite(posterior, ensemble):
    band = posterior.predict([0.2, 3.0, 6.0], noise=False)
    assert np.isfinite(band.to_numpy()).all()
    assert np.isfinite(ensemble.stress(loading_mode("uniaxial"), np.array([0.2, 3.0, 6.0]))).all()


BIAXIAL = [[1.6, 1.3], [1.5, 1.0], [1.4, 1.2], [1.7, 0.9]]


@pytest.mark.slow
def test_both_stresses_of_draws_in_biaxial_tension_are_derivatives_of_their_energy(ensemble):
    points = np.array([*BIAXIAL, [1.5, 1.5], [1.2, 1.1]])
    for axis, path in enumerate(loading_mode("biaxial").paths):
        stress = ensemble.stresses_at(path.at(points))[:24]
        stretches = points + 1e-30j * np.eye(2)[axis]
        third = 1 / (stretches[:, 0] * stretches[:, 1])
        expected = [draw.energy((stretches[:, 0], stretches[:, 1], third)).imag / 1e-30 for draw in ensemble[:24]]
        np.testing.assert_allclose(stress, expected, rtol=1e-10, atol=1e-13)


def test_biaxial_tension_along_the_rays_of_other_modes_has_their_stress(posterior):
    stretch = np.array([1.3, 1.5])
    equal, single = np.column_stack([stretch, stretch]), np.column_stack([stretch, stretch**-0.5]) * [1.2, 1.2**-0.5]
    for points, mode, stretches in ((equal, "equibiaxial", stretch), (single, "uniaxial", 1.2 * stretch)):
        expected = posterior.predict(stretches, mode=mode, noise=False)
        biaxial = posterior.predict(points, mode="biaxial", noise=False)
        for column in ENDS:
            np.testing.assert_allclose(biaxial[column], expected[column], rtol=1e-6)
    second = posterior.predict(single, mode="biaxial", channel=1, noise=False)
    assert np.abs(second[list(ENDS)].to_numpy()).max() < 1e-8


@pytest.mark.slow
def test_the_median_of_a_transverse_stress_is_near_that_of_the_draws(posterior, ensemble):
    # Across a ray the stress of a band grows as that along it, and that of draws as their energy's.
    for axis, path in enumerate(loading_mode("biaxial").paths):
        stress = ensemble.stresses_at(path.at(np.array(BIAXIAL[:3])))
        low, median, high = np.quantile(stress, list(ENDS.values()), axis=0)
        band = posterior.predict(BIAXIAL[:3], mode="biaxial", channel=axis, noise=False)
        assert (np.abs(band["median"] - median) < 0.2 * (high - low)).all()


@pytest.fixture(scope="module")
def curves(posterior):
    """V = dW/dx (m, 5) and x = I1 - 3 (5,) of drawn curves with one range, at five states along a ray.

    The first two lie before the end of the range and at it. V follows from both stresses of biaxial states.
    """
    factors = np.array([INNER_SHARE, 1.0, 1.3, 1.7, 2.4])
    direction = np.array([1.0, 0.3, -1.3])
    states, rows = [], []
    for limits, components in ranges_of(posterior):
        (end,) = share_to_end(5 * direction[None], limits) * 5
        logs = (end * factors)[:, None] * direction
        states.append(logs)
        rows.append(components)
    logs = np.concatenate(states)
    points = np.exp(logs[:, :2])
    mixture = posterior.solution.mixture
    joined = States.joined([path.at(points) for path in loading_mode("biaxial").paths])
    stress = np.sum(drawn_curves(posterior.model, mixture, joined, seed=4), axis=0)
    first, second = np.split(stress, 2, axis=1)
    work = first * points[:, 0] * direction[0] + second * points[:, 1] * direction[1]
    rate = (2 * direction * np.exp(2 * logs)).sum(axis=1)
    x = np.expm1(2 * logs).sum(axis=1)
    count = len(factors)
    return [(V[components], s) for components, V, s in zip(rows, by(work / rate, count), by(x, count), strict=True)]


def by(values, count):
    """Return arrays (..., count) of neighbours of an array (..., n)."""
    return np.split(values, values.shape[-1] // count, axis=-1)


@pytest.mark.slow
def test_drawn_curves_go_on_by_the_stated_formula_along_every_ray(curves):
    # The error b follows from the stress at one state beyond, and the stresses at two others from it.
    for V, x in curves:
        is_positive = (V[:, :2] > 0).all(axis=1)
        assert is_positive.any()
        V = V[is_positive]
        last = np.log(V[:, 1] / V[:, 0]) / np.log(x[1] / x[0])
        a, s = with_errors(last, np.zeros(len(V)))[0], np.log(x[2:] / x[1])
        error = (np.log(V[:, 2] / V[:, 1]) - a * s[0]) * (s[0] + TRANSITION) / s[0] ** 2
        expected = V[:, [1]] * np.exp(a[:, None] * s + error[:, None] * s**2 / (s + TRANSITION))
        np.testing.assert_allclose(V[:, 2:], expected, rtol=1e-6)


def test_drawn_curves_have_the_distribution_of_the_band(posterior):
    # Weighted shares of 3000 draws below the ends of the band.
    points = np.array([0.7, 1.3, 1.5, 1.8])
    mixture = posterior.solution.mixture
    stress = np.sum(drawn_curves(posterior.model, mixture, loading_mode("uniaxial").at(points), seed=5), axis=0)
    band = posterior.predict(points, noise=False)
    for end, probability in ENDS.items():
        error = 0.04 if end == "median" else 0.015
        np.testing.assert_allclose(mixture.weights @ (stress < band[end].to_numpy()), probability, atol=error)


def test_curves_within_the_range_do_not_depend_on_states_beyond(posterior):
    mixture, mode = posterior.solution.mixture, loading_mode("uniaxial")
    inside = drawn_curves(posterior.model, mixture, mode.at([0.9, 1.3]), seed=6)
    both = drawn_curves(posterior.model, mixture, mode.at([0.9, 1.3, 1.7]), seed=6)
    for alone, beside in zip(inside, both, strict=True):
        np.testing.assert_allclose(beside[:, :2], alone, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("noise", [True, False])
def test_without_a_discrepancy_the_band_is_that_of_c10_everywhere(noise):
    posterior = fitted("yeoh", TRUTH, STRETCH, 3, discrepancy="none")
    points = np.array([0.4, 0.7, 1.5, 3.0])
    unit, measured = (2 * (stretch - stretch**-2) for stretch in (points, STRETCH))
    data = posterior.model.experiment.stress
    mean, sd = measured @ data / (measured @ measured), NOISE_SD / np.sqrt(measured @ measured)
    band = posterior.predict(points, noise=noise)
    np.testing.assert_allclose(band["median"], mean * unit, rtol=1e-6)
    np.testing.assert_allclose(half_width(band), 1.959964 * np.hypot(sd * unit, noise * NOISE_SD), rtol=1e-4)


@pytest.mark.parametrize("discrepancy", ["none", "yeoh", "constant", "quadratic", "gp"])
def test_a_discrepancy_that_is_no_random_energy_goes_on_by_its_own_moments(discrepancy):
    posterior = fitted("yeoh", TRUTH, STRETCH, 3, discrepancy=discrepancy)
    mixture, points = posterior.solution.mixture, np.array([0.5, 0.9, 1.5, 2.5])
    states = posterior.model.experiment.states_at(points, loading_mode("uniaxial"), 0)
    moments = stress_moments(posterior.model, mixture, states)
    band, whole = posterior.predict(points, noise=False), Mixtures(mixture.weights, *moments)
    width = 2 * half_width(band)
    for end, probability in ENDS.items():  # the band's mixture is thinned
        np.testing.assert_allclose((band[end] - whole.quantile(probability)) / width, 0, atol=0.02)
    if discrepancy in ("none", "yeoh"):
        assert all(draw.continuation is None for draw in posterior.ensemble(3, admissible=False))


@pytest.mark.slow
def test_the_model_alone_is_not_continued(posterior, ensemble):
    points = np.array([0.5, 1.3, 2.5])
    band = posterior.predict(points, noise=False, discrepancy=False)
    c10 = posterior.solution.marginals["C10"]
    np.testing.assert_allclose(band["median"] / (2 * (points - points**-2)), c10.quantile(0.5), rtol=1e-3)
    draw = ensemble.alone[0]
    expected = 2 * draw.values["C10"] * (points - points**-2)
    np.testing.assert_allclose(tq.engineering_stress(draw, loading_mode("uniaxial"), points, ()), expected, rtol=1e-9)
