"""Draws of a posterior as materials, against its own exact predictions, closed forms and differences."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import tissuq as tq
from marks import slow_but
from tissuq.experiments.modes import loading_mode
from tissuq.mechanics.stress import path_energy
from tissuq.posterior import drawn_materials
from tissuq.posterior.drawn_materials import drawn_ensemble

STRETCH = np.linspace(0.7, 1.8, 24)
TRUTH = {"C10": 0.5, "C20": 0.06, "C30": 0.01}
MODES = ("uniaxial", "equibiaxial", "planar")


def fitted(discrepancy, material="neo-hookean", stretch=STRETCH, **options):
    data = tq.simulate("yeoh", TRUTH, stretch, noise_sd=0.02, seed=3)
    return tq.fit(data, material=material, discrepancy=discrepancy, noise_sd=0.02, **options)


@cache
def many_draws(discrepancy):
    """Return a posterior and 2048 of its draws."""
    posterior = fitted(discrepancy)
    return posterior, drawn_ensemble(posterior.solution, 2048, admissible=False)


@pytest.fixture(scope="module")
def auto():
    return many_draws("auto")[0]


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(
    "discrepancy",
    ["auto", "none", *(pytest.param(name, marks=pytest.mark.slow) for name in ("spline+hencky", "log+zero-modulus"))],
)
def test_draws_are_spread_as_the_exact_predictions_are(discrepancy, mode):
    # 2048 quasi-random draws tell a quantile within about 0.1 sd of the stress, and a mean within 0.03.
    posterior, draws = many_draws(discrepancy)
    points = np.linspace(*draws.ranges[mode], 7)
    points = points[np.abs(points - 1) > 0.02]
    stress = draws.stress(loading_mode(mode), points)
    band = posterior.predict(points, mode=mode, noise=False)
    sd = (band["high"] - band["low"]).to_numpy() / 4
    for end, probability, error in (("median", 0.5, 0.15), ("low", 0.025, 0.35), ("high", 0.975, 0.35)):
        assert (np.abs(np.quantile(stress, probability, axis=0) - band[end]) < error * sd).all()


@pytest.mark.slow
def test_what_is_unknown_beyond_the_measured_stretches_is_in_the_draws():
    # Tension only: within the measured invariants, equibiaxial tension compresses the thickness further than tension
    # of the test did its width, so that a function of single stretches is not known there.
    posterior = fitted("taylor+hencky", stretch=np.linspace(1.0, 2.5, 24))
    draws = drawn_ensemble(posterior.solution, 2048, admissible=False)
    end = draws.ranges["equibiaxial"][1]
    stress = draws.stress(loading_mode("equibiaxial"), [end])[:, 0]
    band = posterior.predict([end], mode="equibiaxial", noise=False)
    width = float((band["high"] - band["low"]).iloc[0])
    assert np.ptp(np.quantile(stress, [0.025, 0.975])) == pytest.approx(width, rel=0.15)


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
def test_a_draw_is_a_material_whose_stress_is_the_derivative_of_its_energy(auto, mode):
    draws, mode = auto.ensemble(4), loading_mode(mode)
    points = np.array([0.85, 0.95, 1.1, 1.3])
    for draw, expected in zip(draws, draws.stress(mode, points), strict=True):
        energy = [path_energy(draw, mode.path, points, (), step) for step in (1e-5, -1e-5)]
        np.testing.assert_allclose(
            (energy[0] - energy[1]) / 2e-5 / mode.path.loaded_axes, expected, rtol=1e-7, atol=1e-9
        )
        np.testing.assert_allclose(tq.engineering_stress(draw, mode, points, ()), expected, rtol=1e-9, atol=1e-12)
        assert path_energy(draw, mode.path, np.ones(1), ())[0] == pytest.approx(0.0, abs=1e-14)


@pytest.mark.slow
def test_draws_differ_though_they_are_materials_without_parameters(auto):
    first, second = auto.ensemble(2)
    assert first != second
    assert len({first, second}) == 2


@pytest.mark.slow
def test_the_initial_modulus_is_the_materials_own(auto):
    for draw in auto.ensemble(3):
        assert tq.initial_shear_modulus(draw, ()) == pytest.approx(2 * draw.values["C10"], rel=1e-6)


def test_further_terms_of_a_material_are_part_of_the_draws():
    posterior = fitted("yeoh")
    for draw in posterior.ensemble(3, admissible=False):
        (_, own), (material, (_, C20, C30)) = draw.parts
        assert (material.name, draw.discrepancy) == ("yeoh", None)
        expected = tq.engineering_stress(material, loading_mode("uniaxial"), [1.5], [own[0], C20, C30])
        np.testing.assert_allclose(tq.engineering_stress(draw, loading_mode("uniaxial"), [1.5], ()), expected)


@pytest.mark.slow
def test_alone_keeps_the_parameters_and_drops_the_discrepancy(auto):
    draws = auto.ensemble(3)
    for draw, own in zip(draws, draws.alone, strict=True):
        assert own.values == draw.values
        np.testing.assert_allclose(
            tq.engineering_stress(own, loading_mode("uniaxial"), [1.4], ()), 2 * own.values["C10"] * (1.4 - 1.4**-2)
        )


@pytest.mark.slow
def test_draws_that_are_not_stable_are_left_out_and_counted():
    # Data of tension only leave the second invariant open, so that many draws are not stable.
    posterior = fitted("auto", stretch=np.linspace(1.05, 1.8, 20))
    draws, whole = posterior.ensemble(64), posterior.ensemble(64, admissible=False)
    assert draws.admissible_share < 0.98
    assert (whole.admissible_share, whole.admissible_in) == (1.0, ())
    assert draws.tried == round(64 / draws.admissible_share)

    def falls(ensemble):
        ends = [ensemble.ranges[mode] for mode in MODES]
        grids = [np.linspace(low, high, 80) for low, high in ends]
        slopes = [np.diff(ensemble.stress(loading_mode(m), g), axis=1) for m, g in zip(MODES, grids, strict=True)]
        return np.hstack(slopes).min(axis=1) < 0

    assert falls(whole).any()
    assert not falls(draws).any()


@pytest.mark.parametrize("sampling", ["sobol", "latin", "random"])
def test_every_way_to_spread_draws_has_the_same_mean_and_its_own_seed(sampling):
    posterior = fitted("none")
    values = [[draw.values["C10"] for draw in posterior.ensemble(256, seed, sampling)] for seed in (1, 1, 2)]
    assert values[0] == values[1] != values[2]
    mean, sd = posterior.summary().loc["C10", ["mean", "sd"]]
    assert abs(np.mean(values[0]) - mean) < 4 * sd / 16  # of independent draws: once in 16 000
    assert np.std(values[0]) == pytest.approx(sd, rel=0.2)


@pytest.mark.parametrize("seeds", slow_but([10], [10, 20]))
def test_few_quasi_random_draws_are_nearer_to_the_mean_than_independent_ones(seeds):
    posterior = fitted("none")
    mean, sd = posterior.summary().loc["C10", ["mean", "sd"]]

    def mean_of(sampling, seed):
        return np.mean([draw.values["C10"] for draw in posterior.ensemble(16, seed, sampling, admissible=False)])

    error = {
        sampling: np.sqrt(np.mean([(mean_of(sampling, seed) - mean) ** 2 for seed in range(seeds)])) / sd
        for sampling in ("sobol", "latin", "random")
    }
    assert max(error["sobol"], error["latin"]) < 0.4 * error["random"]


def test_an_error_that_all_tests_have_in_common_scales_whole_draws():
    tolerances = tq.Tolerances(stress=0.2)
    posterior = fitted("none", tolerances=tolerances)
    values = [draw.values["C10"] for draw in posterior.ensemble(512, admissible=False)]
    assert np.std(values) == pytest.approx(posterior.summary().loc["C10", "sd"], rel=0.1)


def test_what_is_no_energy_is_refused():
    with pytest.raises(tq.ModelError, match="error of the measured stress"):
        fitted("gp").ensemble(4)
    with pytest.raises(tq.ModelError, match="error of the measured stress"):
        fitted("constant").ensemble(4)
    with pytest.raises(tq.InputError, match="one draw or more"):
        fitted("none").ensemble(0)
    with pytest.raises(tq.InputError, match="sobol, latin, random"):
        fitted("none").ensemble(4, sampling="halton")


def test_a_material_that_is_never_stable_says_so():
    data = tq.datasets.load("rubber-treloar-uniaxial")
    posterior = tq.fit(data, material="mooney-rivlin", discrepancy="none")
    with pytest.raises(tq.ModelError, match="draws are stable over the measured range"):
        posterior.ensemble(4)
    assert len(posterior.ensemble(4, admissible=False)) == 4


def sheet(material="neo-hookean+standard-fibres@40", **options):
    """A fit of fibres at a known angle to a simulated sheet."""
    truth = {"C10": 0.02, "k": 0.05}
    points = [
        (1 + a * share, 1 + b * share) for a, b in ((0.3, 0.3), (0.3, 0.1), (0.1, 0.3)) for share in (0.4, 0.7, 1)
    ]
    data = tq.simulate("neo-hookean+standard-fibres@40", truth, points, mode="biaxial", noise_sd=2e-4, seed=1)
    return tq.fit(data, material=material, noise_sd=2e-4, **options)


def test_draws_of_fibres_are_their_law_and_give_its_stresses():
    draws = sheet(discrepancy="none").ensemble(6)
    assert not draws[0].is_isotropic
    assert draws.ranges == {"axis 1": (1.0, pytest.approx(1.3)), "axis 2": (1.0, pytest.approx(1.3))}
    (path, _), point = tq.loading_modes()["biaxial"]().paths, np.array([[1.25, 1.1]])
    for draw, stress in zip(draws, draws.stress(path, point), strict=True):
        matrix, stiffness = 2 * draw.values["C10"], draw.values["k"]
        cosine, sine = np.cos(np.radians(40)) ** 2, np.sin(np.radians(40)) ** 2
        strain = cosine * (1.25**2 - 1) + sine * (1.1**2 - 1)
        wanted = matrix * (1.25 - 1 / (1.25**3 * 1.1**2)) + 2 * stiffness * strain * 2 * cosine * 1.25
        assert stress == pytest.approx([wanted], rel=1e-10)
        assert tq.engineering_stress(draw, path, point, ()) == pytest.approx([wanted], rel=1e-10)


def test_a_matrix_that_is_unstable_is_left_out_with_its_fibres(monkeypatch):
    posterior = sheet("rivlin:C10,C20+standard-fibres@40", discrepancy="none")
    usual = drawn_materials._materials

    def materials(*arguments):
        first, *others = usual(*arguments)
        ((material, values),) = first.parts
        return [replace(first, parts=((material, (-values[0], *values[1:])),)), *others]

    monkeypatch.setattr(drawn_materials, "_materials", materials)
    draws = posterior.ensemble(4)
    assert draws.tried == 6  # two batches, whose first is left out
    assert all(draw.values["C10"] > 0 for draw in draws)
    assert {name[-6:] for name in draws.admissible_in} == {"axis 1", "axis 2"}


def test_draws_of_fibres_with_a_free_energy_spread_as_the_posterior_does():
    posterior = sheet(discrepancy="auto", tolerances=tq.Tolerances("as-tested"))
    draws = posterior.ensemble(256, admissible=False)
    assert all(draw.discrepancy is not None and draw.continuation is None for draw in draws)
    points = np.array([[1.25, 1.1], [1.1, 1.3], [1.2, 1.2]])
    for channel, path in enumerate(tq.loading_modes()["biaxial"]().paths):
        stress = draws.stress(path, points)
        for draw, wanted in zip(draws[:4], stress, strict=False):
            assert tq.engineering_stress(draw, path, points, ()) == pytest.approx(wanted, rel=1e-9)
        band = posterior.predict(points, channel=channel, noise=False, prob=0.8)
        width = (band["high"] - band["low"]).to_numpy().ravel()
        low, median, high = np.quantile(stress, [0.1, 0.5, 0.9], axis=0)
        assert median == pytest.approx(band["median"].to_numpy().ravel(), abs=0.15 * width.max())
        assert high - low == pytest.approx(width, rel=0.25)


def test_draws_of_two_posteriors_are_paired_at_random_once_one_is_shuffled():
    """Sequences of other seeds that are spread alike are correlated row by row."""
    stretch = np.linspace(0.8, 1.3, 9)
    data = tq.simulate("neo-hookean", {"C10": 0.5}, stretch, noise_sd=0.02, seed=1)
    posterior = tq.fit(data, discrepancy="none", noise_sd=0.02)

    def stiffness(draws):
        return [draw.parts[0][1][0] for draw in draws]

    as_drawn, shuffled = [], []
    for seed in range(8):
        first, second = stiffness(posterior.ensemble(128, seed)), posterior.ensemble(128, seed + 1)
        as_drawn.append(np.corrcoef(first, stiffness(second))[0, 1])
        of_second = second.shuffled([seed, 1])
        shuffled.append(np.corrcoef(first, stiffness(of_second))[0, 1])
        assert sorted(stiffness(of_second)) == sorted(stiffness(second))
        assert [draw.number for draw in of_second] == list(range(128))
    assert np.abs(as_drawn).max() > 0.5
    assert np.abs(shuffled).max() < 4 / np.sqrt(128)
