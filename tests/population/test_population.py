"""The population of specimens against quadrature that shares no code with it, its limits, and its messages."""

from __future__ import annotations

from functools import reduce
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from scipy.special import logsumexp
from scipy.stats import norm, truncnorm

import tissuq as tq
from tissuq.assessment.uses import COMPUTING, Use, Verdict
from tissuq.population import answer
from tissuq.population.answer import use_of_law_alone
from tissuq.population.covariates import covariates_of
from tissuq.population.next_step import STEPS_OF_POPULATIONS, next_step
from tissuq.population.uses import CONTRADICTING, DEPARTING, NOT_PREDICTED, PREDICTING
from tissuq.population.warnings import _far_specimens, far_specimens
from tissuq.result_warning import ResultWarning, Severity

STRETCH = np.array([0.8, 0.9, 1.1, 1.2, 1.3])
MODULI = [0.15, 0.4, 0.5, 0.6, 0.9, 0.3]
NOISE_SD = 0.05


def specimens_of(moduli, noise_sd=NOISE_SD, seed=100):
    return {
        f"s{place}": tq.simulate("neo-hookean", {"C10": modulus}, STRETCH, noise_sd=noise_sd, seed=seed + place)
        for place, modulus in enumerate(moduli)
    }


def neo_hookean(specimens, noise_sd=NOISE_SD, **options):
    return tq.fit_population(specimens, discrepancy="none", noise_sd=noise_sd, **options)


@pytest.fixture(scope="module")
def found():
    return neo_hookean(specimens_of(MODULI))


def by_quadrature(specimens, noise_sd, spread):
    """Return mean and sd of m, tau and each theta by sums over grids: least squares, and nothing of tissuq's.

    The noise is the same for all specimens, or that of each of them.
    """
    basis = 2 * (STRETCH - STRETCH**-2)
    estimates = np.array([basis @ each.stress / (basis @ basis) for each in specimens.values()])
    sd = np.broadcast_to(noise_sd, len(estimates)) / np.sqrt(basis @ basis)
    middle = np.median(np.log(truncnorm(-estimates / sd, np.inf, estimates, sd).median()))
    m, tau = middle + np.linspace(-4, 4, 81), np.exp(np.linspace(np.log(1e-3), np.log(5), 40))
    score = np.linspace(-7, 7, 241)
    theta = m[:, None, None] + tau[:, None] * score
    log_terms = norm.logpdf(score) + norm.logpdf(estimates[:, None, None, None], np.exp(theta), sd[:, None, None, None])
    log_total = logsumexp(log_terms, axis=3)
    shares = np.exp(log_terms - log_total[..., None])
    first, second = (np.einsum("ijks,jks->ijk", shares, each) for each in (theta, theta**2))
    log_post = norm.logpdf(m[:, None], middle, 5) + norm.logpdf(tau, 0, spread) + np.log(tau) + log_total.sum(axis=0)
    weights = np.exp(log_post - log_post.max())
    weights /= weights.sum()
    mean = np.array([weights.sum(1) @ m, weights.sum(0) @ tau, *np.einsum("jk,ijk->i", weights, first)])
    square = np.array([weights.sum(1) @ m**2, weights.sum(0) @ tau**2, *np.einsum("jk,ijk->i", weights, second)])
    return mean, np.sqrt(square - mean**2)


def hold_against_quadrature(own, specimens, noise_sd):
    """Hold m, tau and each theta against `by_quadrature`.

    With 1000 effective draws or more, means within four standard errors and sds within 15 %: each of 16 numbers fails
    by chance once in ten thousand times.
    """
    mean, sd = by_quadrature(specimens, noise_sd, 1.0)
    line = own.coordinates.centre[0]
    draws = [own.hierarchy.mean[..., 0] + line, own.hierarchy.tau[..., 0]]
    draws += [own.hierarchy.specimens[..., place, 0] + line for place in range(len(MODULI))]
    for of_quantity, expected, scale in zip(draws, mean, sd, strict=True):
        assert abs(of_quantity.mean() - expected) < 4 * scale / np.sqrt(1000)
        assert abs(of_quantity.std() / scale - 1) < 0.15


@pytest.mark.parametrize("noise_sd", [NOISE_SD, pytest.param(0.4, marks=pytest.mark.slow)])
def test_one_parameter_agrees_with_quadrature(found, noise_sd):
    """The second noise is such that some moduli may be zero."""
    specimens = specimens_of(MODULI, noise_sd)
    own = found if noise_sd == NOISE_SD else neo_hookean(specimens, noise_sd)
    hold_against_quadrature(own, specimens, noise_sd)
    assert own.converged
    assert own.hierarchy.effective > 0.9


NOISES = dict(zip(["s0", "s1", "s2", "s3", "s4", "s5"], [0.02, 0.3, 0.05, 0.1, 0.02, 0.2], strict=True))


@pytest.fixture(scope="module")
def of_several_noises():
    specimens = {}
    for place, (name, sd) in enumerate(NOISES.items()):
        specimens[name] = tq.simulate("neo-hookean", {"C10": MODULI[place]}, STRETCH, noise_sd=sd, seed=place)
    return specimens, neo_hookean(specimens, NOISES)


def test_every_specimen_may_have_a_noise_of_its_own(of_several_noises):
    """Complete pooling is weighted least squares."""
    specimens, own = of_several_noises
    hold_against_quadrature(own, specimens, np.array(list(NOISES.values())))
    basis, precision = 2 * (STRETCH - STRETCH**-2), np.array(list(NOISES.values())) ** -2.0
    estimates = np.array([basis @ specimen.stress / (basis @ basis) for specimen in specimens.values()])
    pooled = own.complete.marginals["C10"]
    assert pooled.mean == pytest.approx(precision @ estimates / precision.sum(), rel=1e-6)
    assert pooled.sd == pytest.approx(1 / np.sqrt(precision.sum() * (basis @ basis)), rel=1e-6)


@pytest.mark.slow
def test_tests_of_one_specimen_may_have_noises_of_their_own_and_others_unknown_ones(of_several_noises):
    specimens, _ = of_several_noises
    tests = specimens | {"s0": [specimens["s0"], specimens["s1"]]}
    found = neo_hookean(tests, {"s0": [0.02, 0.3], "s2": 0.05})
    basis, precision = 2 * (STRETCH - STRETCH**-2), np.array([0.02, 0.3]) ** -2.0
    assert found.posteriors["s0"].marginals["C10"].sd == pytest.approx(1 / np.sqrt(precision.sum() * (basis @ basis)))
    names = {name: posterior.model.noise.name for name, posterior in found.posteriors.items()}
    assert names["s2"] == "known"
    assert names["s3"] == found.complete.model.noise.name == "unknown"
    with pytest.raises(tq.InputError, match=r"there is a noise of s9, but the specimens are s0, s1"):
        neo_hookean(specimens, {"s9": 0.1})
    with pytest.raises(tq.InputError):
        neo_hookean(specimens, {"s1": [0.1, 0.2]})


def test_complete_pooling_is_the_fit_of_all_measurements_together(found):
    joined = tq.fit(reduce(tq.Experiment.joined, specimens_of(MODULI).values()), discrepancy="none", noise_sd=NOISE_SD)
    assert found.complete.marginals["C10"].hdi() == pytest.approx(joined.marginals["C10"].hdi(), rel=1e-6)


@pytest.mark.slow
def test_without_a_spread_it_is_complete_pooling():
    """On the line the mean's prior replaces the modulus' flat one, which is nothing beside these data."""
    specimens = specimens_of([0.5] * 6)
    found = neo_hookean(specimens, spread=1e-4)
    assert np.median(found.median) == pytest.approx(found.complete.marginals["C10"].mean, rel=2e-3)
    assert found.median.std() == pytest.approx(found.complete.marginals["C10"].sd, rel=0.15)
    joined = tq.fit(reduce(tq.Experiment.joined, specimens.values()), discrepancy="none", noise_sd=NOISE_SD)
    assert found.complete.marginals["C10"].hdi() == pytest.approx(joined.marginals["C10"].hdi(), rel=1e-6)


@pytest.mark.slow
def test_specimens_that_differ_widely_keep_their_own_posteriors():
    specimens = specimens_of([0.2, 0.5, 1.2, 3.0, 8.0, 20.0], noise_sd=0.005)
    table = neo_hookean(specimens, noise_sd=0.005, spread=3.0).specimen_summary()
    for pooled, alone in zip(("median", "hdi_low", "hdi_high"), ("alone_median", "alone_hdi_low", "alone_hdi_high"),
                             strict=True):  # fmt: skip
        assert table[pooled].to_numpy() == pytest.approx(table[alone].to_numpy(), rel=3e-3)


@pytest.mark.slow
def test_specimens_move_towards_the_population_and_the_poorly_measured_ones_most():
    good, poor = specimens_of([0.4, 0.45, 0.5, 0.55], 0.01), specimens_of([0.9, 0.2], 0.3, seed=7)
    weak = {f"poor {name}": tq.Experiment("uniaxial", each.stretch, each.stress) for name, each in poor.items()}
    table = tq.fit_population(good | weak, discrepancy="none").specimen_summary().droplevel("parameter")
    middle = table.loc[list(good), "median"].median()
    moved = (table["alone_median"] - table["median"]) * np.sign(table["alone_median"] - middle)
    assert (moved[list(weak)] > 0.02).all()
    assert (moved[list(good)].abs() < 0.02).all()


@pytest.mark.statistical
def test_the_truth_is_recovered():
    """Six populations of 20: of 12 central 99 % intervals at most one may miss; two do by chance in 0.6 % of cases."""
    missed = 0
    for seed in range(6):
        theta = np.log(0.5) + 0.4 * np.random.default_rng(seed).standard_normal(20)
        found = neo_hookean(specimens_of(np.exp(theta), seed=1000 * seed), seed=seed)
        for draws, truth in ((found.median, 0.5), (found.spread, 0.4)):
            low, high = np.quantile(draws, [0.005, 0.995])
            missed += not low < truth < high
        assert found.diagnostics.rhat.max() < 1.01
    assert missed <= 1


@pytest.mark.slow
def test_a_correlation_is_found():
    """C10 and C01 of 20 specimens, a logarithm and not, that go together with 0.9 in the sample."""
    generator = np.random.default_rng(2)
    first = generator.standard_normal(20)
    second = 0.95 * first + 0.3 * generator.standard_normal(20)
    stretch = np.linspace(0.6, 2.0, 15)
    specimens = {
        f"s{k}": tq.simulate("mooney-rivlin", {"C10": 0.5 * np.exp(0.3 * a), "C01": 0.1 + 0.05 * b}, stretch, 0.005, k)
        for k, (a, b) in enumerate(zip(first, second, strict=True))
    }
    found = tq.fit_population(specimens, material="mooney-rivlin", discrepancy="none", noise_sd=0.005)
    row = found.correlations().loc["C10, C01"]
    assert row["hdi_low"] > 0.5
    assert row["hdi_low"] < np.corrcoef(first, second)[0, 1] < row["hdi_high"]
    median = found.summary().loc[("C01", "median")]
    assert median["hdi_low"] < 0.1 < median["hdi_high"]
    spread = found.summary().loc[("C01", "spread")]
    assert spread["hdi_low"] < 0.05 * second.std() < spread["hdi_high"]


def test_a_new_patient_is_as_different_as_the_specimens(found):
    table = found.summary().loc["C10"]
    new, complete = table.loc["new specimen"], table.loc["complete pooling"]
    assert new["hdi_low"] < 0.15
    assert new["hdi_high"] > 0.9
    assert complete["hdi_high"] - complete["hdi_low"] < 0.1
    band = found.new_patient(STRETCH, discrepancy=False)
    expected = np.quantile(found.new, [0.5, 0.025, 0.975])[:, None] * 2 * (STRETCH - STRETCH**-2)
    ends = np.sort(expected[1:], axis=0)
    assert band["median"].to_numpy() == pytest.approx(expected[0], rel=1e-6)
    assert pytest.approx(ends, rel=1e-6) == band[["low", "high"]].to_numpy().T
    other = found.new_patient([1.1], mode="equibiaxial", discrepancy=False)
    assert other["median"][0] == pytest.approx(np.median(found.new) * 2 * (1.1 - 1.1**-5), rel=1e-6)


@pytest.mark.slow
def test_where_few_specimens_were_measured_all_draws_are_of_these():
    """Without a discrepancy it is the law at all draws of C10; of one specimen in six it had a sixth of them."""
    specimens = {
        f"s{place}": tq.simulate(
            "neo-hookean", {"C10": C10}, np.linspace(0.8, 1.6 if place == 2 else 1.2, 9), noise_sd=0.01, seed=place
        )
        for place, C10 in enumerate((0.3, 0.5, 0.4, 0.6, 0.45, 0.7))
    }
    found = tq.fit_population(specimens, discrepancy="none", noise_sd=0.01)
    stretch = np.array([1.1, 1.5])
    C10 = np.quantile(found.data["new_patient"]["parameters"], [0.5, 0.025, 0.975])
    for discrepancy in (True, False):
        band = found.new_patient(stretch, discrepancy=discrepancy)[["median", "low", "high"]].to_numpy()
        np.testing.assert_allclose(band, np.outer(2 * (stretch - stretch**-2), C10), rtol=1e-9)
    with pytest.raises(tq.InputError, match=r"no specimen was measured at stretch 1\.8"):
        found.new_patient([1.5, 1.8])


@pytest.mark.slow
def test_a_new_patient_has_the_model_error_that_specimens_have():
    """Yeoh specimens that are alike but for a factor: neo-Hookean with the error in proportion is the curve itself."""
    stretch = np.linspace(0.8, 1.6, 12)
    factors = [0.7, 0.85, 1.0, 1.15, 1.3, 1.0]
    truths = [{"C10": 0.5 * f, "C20": 0.3 * f, "C30": 0.0} for f in factors]
    specimens = {f"s{k}": tq.simulate("yeoh", each, stretch, 0.004, seed=k) for k, each in enumerate(truths)}
    found = tq.fit_population(specimens, noise_sd=0.004)
    middle = tq.simulate("yeoh", {"C10": 0.5, "C20": 0.3, "C30": 0.0}, [1.2, 1.6]).stress
    band, alone = (found.new_patient([1.2, 1.6], discrepancy=which) for which in (True, False))
    assert band["median"].to_numpy() == pytest.approx(middle, rel=0.2)
    assert alone["median"][1] < 0.7 * middle[1]
    for each in specimens.values():
        assert band["low"][1] < each.stress[-1] < band["high"][1]
    with pytest.raises(tq.InputError, match="no specimen was measured at stretch 1\\.8"):
        found.new_patient([1.2, 1.8])


@pytest.mark.slow
def test_some_parameters_may_be_pooled_and_others_not():
    stretch = np.linspace(0.7, 1.8, 15)
    specimens = {
        f"s{k}": tq.simulate("mooney-rivlin", {"C10": 0.5 + 0.1 * k, "C01": 0.1}, stretch, 0.01, seed=k)
        for k in range(6)
    }
    options = {"material": "mooney-rivlin", "discrepancy": "none", "noise_sd": 0.01}
    found = tq.fit_population(specimens, parameters=["C01"], **options)
    assert found.symbols == ("C01",)
    assert list(found.summary().index.get_level_values("parameter").unique()) == ["C01"]
    assert np.isfinite(found.new_patient([1.5])["median"]).all()


def test_it_is_saved_with_names(found, tmp_path):
    found.save(tmp_path / "population.nc")
    tree = xr.open_datatree(tmp_path / "population.nc", engine="h5netcdf").load()
    assert list(tree["posterior"]["specimen"].values) == [f"s{k}" for k in range(6)]
    assert tree["posterior"]["specimens"].sel(parameter="C10", specimen="s4").median() == pytest.approx(0.9, abs=0.1)
    assert tree["no_pooling"]["specimens"].shape == tree["posterior"]["specimens"].shape
    assert tree["new_patient"]["parameters"].dims == ("chain", "draw", "parameter")
    assert len(tree["observed_data"]["stress"]) == 30
    assert tree.attrs["converged"] == "True"


@pytest.mark.slow
def test_tests_of_one_specimen_are_joined():
    named = [
        tq.Experiment("uniaxial", each.stretch, each.stress, name)
        for seed in (1, 2)
        for name, each in specimens_of(MODULI, seed=seed).items()
    ]
    found = neo_hookean(named)
    assert found.names == tuple(f"s{k}" for k in range(6))
    assert [len(each.model.experiment) for each in found.posteriors.values()] == [10] * 6


def in_modes(moduli, modes, noise_sd=NOISE_SD):
    """Return tests of specimens, the modes of each in turn."""
    points = {"uniaxial": STRETCH, "planar": STRETCH, "simple-shear": STRETCH - 0.7}
    return {
        f"s{k}": [
            tq.simulate("neo-hookean", {"C10": modulus}, points[mode], noise_sd, mode=mode, seed=10 * k + place)
            for place, mode in enumerate(modes[k % len(modes)])
        ]
        for k, modulus in enumerate(moduli)
    }


@pytest.mark.slow
def test_tests_of_a_specimen_in_several_modes_are_fitted_together():
    """Neo-Hookean stresses are C10 times a known curve: least squares over all of a specimen's tests."""
    tests = in_modes(MODULI, [("uniaxial", "planar"), ("simple-shear",), ("planar", "planar", "uniaxial")], 0.01)
    found = neo_hookean(tests, 0.01)
    curves = {
        "uniaxial": lambda x: 2 * (x - x**-2),
        "planar": lambda x: 2 * (x - x**-3),
        "simple-shear": lambda x: 2 * x,
    }
    for name, own in tests.items():
        basis = np.concatenate([curves[test.mode.name](test.stretch) for test in own])
        stress = np.concatenate([test.stress for test in own])
        alone = found.posteriors[name].marginals["C10"]
        assert alone.mean == pytest.approx(basis @ stress / (basis @ basis), rel=1e-3)
        assert alone.sd == pytest.approx(0.01 / np.sqrt(basis @ basis), rel=1e-2)
        assert not found.posteriors[name].model.tolerances
    assert not found.complete.model.tolerances
    assert len(found.complete.model.experiment) == sum(len(test) for own in tests.values() for test in own)
    assert found.converged
    with pytest.raises(tq.InputError, match="say which one to predict"):
        found.new_patient([1.1])
    band = found.new_patient([0.2], mode="simple-shear")
    assert band["median"][0] == pytest.approx(0.4 * np.median(found.new), rel=0.02)
    modes = found.data["constant_data"]["mode"].values
    assert sorted(set(modes)) == ["planar", "simple-shear", "uniaxial"]


@pytest.mark.slow
def test_tests_in_one_mode_give_what_the_joined_test_gives_and_specimens_may_be_named():
    tests = in_modes(MODULI[:4], [("uniaxial", "uniaxial")])
    found = neo_hookean(tests)
    named = [
        tq.Experiment(t.mode, t.stretch, t.stress, "a test", specimen=name) for name, own in tests.items() for t in own
    ]
    joined = {name: own[0].joined(own[1]) for name, own in tests.items()}
    for other in (neo_hookean(named), neo_hookean(joined)):
        assert other.names == found.names
        assert (other.specimens == found.specimens).all()


@pytest.mark.slow
def test_a_new_patient_has_the_model_error_of_those_who_were_tested_in_the_mode():
    """Under an error in stress, which says nothing of another mode: only planar tests give that of a planar one."""
    tests = in_modes(MODULI[:4], [("uniaxial",), ("uniaxial", "planar")])
    found = tq.fit_population(tests, discrepancy="linear", noise_sd=NOISE_SD)
    band = found.new_patient([1.1, 1.3], mode="planar")
    assert np.isfinite(band).all(axis=None)
    with pytest.raises(tq.InputError, match="says nothing about the equibiaxial one"):
        found.new_patient([1.1], mode="equibiaxial")


@pytest.mark.slow
def test_a_new_patient_under_an_energy_is_predicted_in_every_mode():
    tests = in_modes([0.4, 0.5, 0.6], [("uniaxial", "planar"), ("simple-shear",)], 0.01)
    found = tq.fit_population(tests, noise_sd=0.01)
    for mode, at, basis in (("planar", 1.1, 2 * (1.1 - 1.1**-3)), ("simple-shear", 0.3, 0.6)):
        band = found.new_patient([at], mode=mode)
        assert band["low"][0] < 0.5 * basis < band["high"][0]
    with pytest.raises(tq.InputError, match="loading modes with one control, and 'biaxial' has stretch of axis 1"):
        found.new_patient([[1.1, 1.1]], mode="biaxial")


@pytest.mark.slow
@pytest.mark.parametrize("error", [0.1, 0.25])
def test_errors_of_the_specimens_tests_are_no_spread_between_them(error):
    """Well measured but for a share of the stress as a whole, against a sum over m and tau for Gaussians."""
    moduli = np.array([0.4, 0.5, 0.6, 0.45, 0.55, 0.48])
    found = neo_hookean(specimens_of(moduli, 0.002), 0.002, tolerances=tq.Tolerances(stress=error))
    y = np.log(moduli)
    m, tau = np.median(y) + np.linspace(-1, 1, 401)[:, None], np.geomspace(1e-3, 5, 400)
    log_post = norm.logpdf(tau) + np.log(tau)
    for each in y:
        log_post = log_post + norm.logpdf(each, m, np.hypot(tau, error))
    weights = np.exp(log_post - log_post.max())
    weights /= weights.sum()
    line = found.coordinates.centre[0]
    for draws, grid in ((found.hierarchy.mean[..., 0] + line, m), (found.hierarchy.tau[..., 0], tau)):
        mean = (weights * grid).sum()
        scale = np.sqrt((weights * (grid - mean) ** 2).sum())
        assert abs(draws.mean() - mean) < 4 * scale / np.sqrt(1000)
        assert abs(draws.std() / scale - 1) < 0.15
    own = found.posteriors["s0"].marginals["C10"]
    assert own.sd / own.mean == pytest.approx(error, rel=0.02)
    assert not found.complete.model.tolerances


def test_the_specimens_may_stand_in_one_table(found):
    table = pd.concat(
        pd.DataFrame({"stretch": test.stretch, "stress (MPa)": test.stress, "specimen": name})
        for name, test in specimens_of(MODULI).items()
    )
    pooled = neo_hookean(table)
    assert list(pooled.posteriors) == list(found.posteriors)
    assert pooled.summary().equals(found.summary())


def test_few_specimens_are_warned_about(found):
    few = dict(list(found.posteriors.items())[:4])
    rest = found.complete, found.coordinates, found.hierarchy, found.spread_prior, found.seed
    assert any("4 specimens determine the spread poorly" in text for text in tq.Population(few, *rest).warnings)
    assert not found.warnings


@pytest.mark.parametrize(
    ("change", "options", "words"),
    [
        (lambda s: dict(list(s.items())[:2]), {}, "needs 3 specimens or more; there are 2 \\(s0, s1\\)"),
        (lambda s: list(s.values()), {}, "there are 1 \\(synthetic neo-hookean\\)"),
        (lambda s: [7, *s.values()], {}, "measurements are needed: a file"),
        (lambda s: [], {}, "needs 3 specimens or more; there are 0"),
        (lambda s: s, {"noise_sd": "3%"}, "noise '3%': '%' is not a unit of stress.*is 'proportional'"),
        (lambda s: s | {"empty": []}, {}, "there is no experiment to fit"),
        (lambda s: s, {"parameters": ["C01"]}, "must be a list of C10; found: C01"),
        (lambda s: s, {"parameters": "C10"}, "must be a list of C10"),
        (lambda s: s, {"tolerances": "tissue"}, "which a population finds itself: take 'specimen'"),
        (lambda s: s, {"tolerances": "nobody"}, "there is no estimand 'nobody'"),
        (lambda s: s, {"spread": 0}, "spread must be a positive number, not 0"),
    ],
)
def test_what_cannot_be_pooled_is_refused_in_one_message(change, options, words):
    with pytest.raises(tq.InputError, match=words):
        neo_hookean(change(specimens_of(MODULI)), **options)


def test_a_new_patient_is_a_posterior_that_is_saved_predicts_and_becomes_materials(found, tmp_path):
    patient, new = found.patient, found.new[..., 0]
    np.testing.assert_array_equal(patient.solution.draws["C10"], new)
    band = patient.predict([1.2], noise=False, prob=0.5)
    exact = 2 * (1.2 - 1.2**-2) * np.quantile(new, [0.25, 0.75])
    np.testing.assert_allclose(band[["low", "high"]].to_numpy()[0], exact, rtol=0.1)
    moduli = np.array([draw.values["C10"] for draw in patient.ensemble(64)])
    np.testing.assert_allclose(np.quantile(moduli, [0.25, 0.5, 0.75]), np.quantile(new, [0.25, 0.5, 0.75]), rtol=0.1)
    patient.save(tmp_path / "patient.nc")
    loaded = tq.load(tmp_path / "patient.nc")
    np.testing.assert_array_equal(loaded.solution.draws["C10"], new)
    assert loaded.warnings == patient.warnings
    assert loaded.summary().equals(patient.summary())
    assert "log_likelihood" not in loaded.data.children  # of other specimens' measurements


@pytest.mark.slow
def test_copies_and_a_specimen_in_another_unit_are_told():
    specimens = specimens_of(MODULI)
    first, second, third, *_ = specimens
    copied = tq.Experiment("uniaxial", STRETCH, specimens[first].stress)
    thousandth = tq.Experiment("uniaxial", STRETCH, specimens[third].stress / 1000)
    warnings = neo_hookean(specimens | {second: copied, third: thousandth}).warnings
    assert any(f"the measurements of {first} and {second} are equal, as copies are" in text for text in warnings)
    assert any(f"the initial modulus of {third} is 0.0" in text and "unit" in text for text in warnings)
    assert not any("equal" in text or "unit" in text for text in neo_hookean(specimens).warnings)


def test_tables_stand_for_the_tests_of_specimens():
    tables = {
        name: {"stretch": STRETCH, "stress [MPa]": experiment.stress}
        for name, experiment in specimens_of(MODULI).items()
    }
    pairs = zip(neo_hookean(tables).median.ravel(), neo_hookean(specimens_of(MODULI)).median.ravel(), strict=True)
    assert all(abs(of_table / of_experiment - 1) < 1e-6 for of_table, of_experiment in pairs)


def test_specimens_that_were_hardly_deformed_are_refused_by_name():
    specimens = {name: tq.simulate("neo-hookean", {"C10": 0.4}, [1.1, 1.2, 1.3], 0.01, seed=0) for name in "abcd"}
    specimens["still"] = tq.simulate("neo-hookean", {"C10": 0.4}, [0.999996, 0.999998], 0.01, seed=0)
    with pytest.raises(tq.InputError, match=r"still \(by 4e-06 at the most\).*--without still"):
        tq.fit_population(specimens)


def model_of_tests(*warnings):
    """Return a model of tests with these warnings."""
    return SimpleNamespace(experiment=SimpleNamespace(warnings=warnings))


def test_a_specimen_far_from_the_others_is_a_problem_to_look_at_next():
    moduli = {"a": 1.0, "b": 1.2, "c": 0.9, "soft": 0.005}
    fits = {
        name: SimpleNamespace(initial_shear_modulus=SimpleNamespace(mean=value), model=model_of_tests())
        for name, value in moduli.items()
    }
    population = SimpleNamespace(
        posteriors=fits, converged=True, symbols=("C10",), coordinates=SimpleNamespace(is_log=[True]),
        covariates=covariates_of(None, tuple(fits)),
        summary=lambda: {"median": {("C10", "spread"): 0.3}},
        complete=SimpleNamespace(model=SimpleNamespace(discrepancy=SimpleNamespace(is_best_fit=False, parameters=()))),
    )  # fmt: skip
    assert list(far_specimens(population)) == ["soft"]
    (warning,) = _far_specimens(population)
    assert warning.severity == Severity.PROBLEM
    assert "the initial modulus of soft is 0.0053 times that of the other specimens" in warning
    population.hierarchy = SimpleNamespace(effective=1.0, diagnostics=SimpleNamespace(converged=True))
    for fit in (*fits.values(), population.complete):
        fit.solution = SimpleNamespace(is_approximate=False)

    def said_next(uses, without=(), share=0.0, **aim):
        return next_step(population, uses, share, without, **aim).shell

    assert said_next(()).startswith("look at soft first")
    without_unit = ResultWarning("the unit of the stress is not stated.", "doubtful-reading", Severity.PROBLEM)
    fits["soft"].model = model_of_tests(without_unit)
    assert said_next(()).startswith("say what the files do not")
    population.posteriors.pop("soft")
    assert "finite elements" in said_next((), share=0.2)
    assert said_next((), share=0.3).startswith("fit another law (--material) before you compute")
    useless = [Use(PREDICTING, Verdict.NO, "known to no better than ± 100 %")]
    assert "--aim 20%" in said_next(useless)
    assert said_next(useless, has_aim=True).startswith("find out what sets the specimens apart (--covariates); how")
    specimens = [f"s{number}" for number in range(8)]
    population.covariates = covariates_of({name: {"age": float(name[1])} for name in specimens}, specimens)
    assert "find out what sets the specimens apart (--covariates beside age); how" in said_next(useless, has_aim=True)
    assert "sets them apart (covariates beside age)" in next_step(population, useless, 0.0).python
    assert said_next(useless, has_aim=True, share=0.3).startswith("fit another law")
    not_predicted = [Use(PREDICTING, Verdict.NO, NOT_PREDICTED)]
    assert "finite elements" in said_next(not_predicted)
    at_rest = ResultWarning("there is stress.", "stress-at-rest")
    fits["a"].model = model_of_tests(at_rest)
    said = said_next(useless, ["d"])
    assert said.startswith("take off what the load cell shows at rest in a, as the warning about it says")
    assert said.endswith("or leave it out: --without d --without a")
    fits["b"].model = model_of_tests(at_rest)
    assert said_next(useless).startswith("take off what the load cell shows at rest, as the warning")
    fits["a"].model = fits["b"].model = model_of_tests()
    apart, departing = ([Use(PREDICTING, Verdict.NO, reason)] for reason in (CONTRADICTING, DEPARTING))
    assert said_next(apart).startswith("find out why the tests of a specimen contradict")
    assert said_next(departing).endswith("--discrepancy auto")
    population.complete.model.discrepancy.is_best_fit = True
    assert said_next(useless).endswith("--discrepancy auto")
    population.complete.model.discrepancy.is_best_fit = False
    assert said_next(useless, share=0.3).startswith("fit another law")
    population.summary = lambda: {"median": {("C10", "spread"): 1.5}}
    assert said_next(()).startswith("find out why the specimens differ so much")


def test_the_steps_in_python_name_no_option_of_the_shell():
    for step in STEPS_OF_POPULATIONS.values():
        assert "--" not in step.python
        assert "tissuq " not in step.python
    answer = neo_hookean(specimens_of(MODULI)).answer
    assert str(answer).splitlines()[-1] == f"Next: {answer.next_step.python}"


def test_what_leaves_the_discrepancy_out_serves_where_that_carries_little():
    predicting = Use(PREDICTING, Verdict.CARE, "known to ± 30 %")
    assert use_of_law_alone(0.2, predicting) == predicting._replace(purpose=COMPUTING)
    verdict, reason = use_of_law_alone(0.95, predicting)[1:]
    assert verdict is Verdict.NO
    assert "which carries 95 % of the stress" in reason
    assert use_of_law_alone(0.1, Use(PREDICTING, Verdict.NO, NOT_PREDICTED)).verdict is Verdict.CARE


def test_the_modulus_of_a_law_that_is_wrong_is_that_at_rest_where_the_law_carries_it(monkeypatch):
    def said(initial, share=0.9, words="initial shear modulus"):
        monkeypatch.setattr(answer, "share_of_initial_stiffness", lambda _: initial)
        return answer.about_modulus(None, share, words)

    assert said(0.03) == " The modulus is that at rest, of which the discrepancy carries 3 %."
    assert said(0.03, share=0.1) == said(0.03, words="C10") == said(0.3) == said(float("nan")) == ""


def test_a_population_says_how_far_the_law_alone_is_from_its_specimens_where_that_is_known(monkeypatch):
    monkeypatch.setattr(answer, "has_energy", lambda model: True)
    monkeypatch.setattr(answer, "shares_of_discrepancy", lambda share: (share, None))
    at_rest = ResultWarning("there is stress.", "stress-at-rest")

    def said(shares, warnings=()):
        fits = {
            name: SimpleNamespace(
                solution=Share(share), model=model_of_tests(*warnings) if name == "a" else model_of_tests()
            )
            for name, share in zip("abc", shares, strict=True)
        }
        law = SimpleNamespace(model=SimpleNamespace(material=SimpleNamespace(name="demiray")))
        pooled = SimpleNamespace(posteriors=fits, complete=law)
        return answer.about_law(pooled, answer.share_of_discrepancy(pooled))

    class Share(tuple):
        model = None

    clear = [(0.1, 0.0, 0.2), (0.4, 0.3, 0.5), (0.6, 0.4, 0.8)]
    assert "demiray alone is wrong here: the discrepancy carries 40 % of the stress" in said(clear)
    assert said(clear).endswith("cards of a new specimen are of demiray alone.")
    assert "carries 50 % of the stress" in said(clear, [at_rest])
    assert said([(0.1, 0.0, 0.2)] * 2 + clear[2:]) == ""
    assert said([(0.9, 0.3, 1.5)] * 2 + clear[2:]) == ""
