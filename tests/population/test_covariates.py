"""Covariates of a population: against quadrature that shares no code with it, what follows them, and messages."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
import xarray as xr
from scipy.special import logsumexp
from scipy.stats import norm

import tissuq as tq
from tissuq.population.covariates import covariates_of

from .test_population import MODULI, NOISE_SD, STRETCH, neo_hookean, specimens_of

AGES = [20.0, 45.0, 50.0, 62.0, 70.0, 41.0]
COVARIATES = {f"s{place}": {"age [year]": age} for place, age in enumerate(AGES)}
NAMES = [f"s{place}" for place in range(6)]


@pytest.fixture(scope="module")
def found():
    return neo_hookean(specimens_of(MODULI), covariates=COVARIATES)


def by_quadrature(specimens):
    """Return means and sds of m, the effect of a sd of the age, tau, and log C10 of the first specimen at 80 years.

    Sums over grids of m, effect, tau and every log C10 near the specimen's own least squares.
    """
    basis = 2 * (STRETCH - STRETCH**-2)
    estimates = np.array([basis @ each.stress / (basis @ basis) for each in specimens.values()])
    sd = NOISE_SD / np.sqrt(basis @ basis)
    middle = np.median(np.log(estimates))
    x = (np.array(AGES) - np.mean(AGES)) / np.std(AGES)
    m, b, tau = middle + np.linspace(-2, 2, 61), np.linspace(-2, 2.5, 61), np.geomspace(0.02, 4, 30)
    log_post = norm.logpdf(m[:, None, None], middle, 5) + norm.logpdf(b[:, None], 0, 1) + norm.logpdf(tau) + np.log(tau)
    for estimate, age in zip(estimates, x, strict=True):
        theta = np.log(np.linspace(max(estimate - 6 * sd, 1e-3), estimate + 6 * sd, 61))
        step = np.gradient(theta)
        at = (m[:, None] + b * age)[:, :, None, None]
        log_terms = norm.logpdf(theta, at, tau[:, None]) + norm.logpdf(estimate, np.exp(theta), sd) + np.log(step)
        log_post += logsumexp(log_terms, axis=3)
    weights = np.exp(log_post - log_post.max())
    weights /= weights.sum()
    grids = np.meshgrid(m, b, tau, indexing="ij")
    patient = grids[0] + grids[1] * (80 - np.mean(AGES)) / np.std(AGES)
    means = [(weights * grid).sum() for grid in (*grids, patient)]
    squares = [(weights * grid**2).sum() for grid in (*grids, patient)]
    squares[3] += (weights * grids[2] ** 2).sum()
    return np.array(means), np.sqrt(np.array(squares) - np.square(means))


@pytest.mark.slow
def test_an_effect_agrees_with_quadrature(found):
    """Means within four standard errors of 1000 draws and sds within 15 %: by chance once in some ten thousand runs."""
    mean, sd = by_quadrature(specimens_of(MODULI))
    line = found.coordinates.centre[0]
    draws = [found.hierarchy.mean[..., 0] + line, found.hierarchy.effects[..., 0, 0], found.hierarchy.tau[..., 0]]
    draws += [np.log(found.given({"age": 80}).new[..., 0])]
    for each, expected, scale in zip(draws, mean, sd, strict=True):
        assert abs(each.mean() - expected) < 4 * scale / np.sqrt(1000)
        assert abs(each.std() / scale - 1) < 0.15
    assert found.converged
    assert found.hierarchy.effective > 0.9


@pytest.mark.slow
def test_effects_are_factors_per_unit(found):
    table = found.effects()
    row = table.loc[("C10", "age")]
    per_year = np.exp(found.hierarchy.effects[..., 0, 0] / np.std(AGES))
    assert row["median"] == pytest.approx(np.median(per_year), rel=1e-12)
    assert (row["kind"], row["per"]) == ("factor", "per year")
    assert row["positive"] == pytest.approx((per_year > 1).mean())
    slope = np.polyfit(AGES, np.log(MODULI), 1)[0]  # of the truth, which the data have to some 5 %
    assert row["hdi_low"] < np.exp(slope) < row["hdi_high"]
    share = table.loc[("C10", "all covariates")]
    assert 0 < share["hdi_low"] < share["median"] < share["hdi_high"] < 1
    explained = found.hierarchy.effects[..., 0, 0] ** 2  # the column has variance one
    expected = np.median(explained / (explained + found.hierarchy.tau[..., 0] ** 2))
    assert share["median"] == pytest.approx(expected, rel=1e-9)


@pytest.mark.slow
def test_a_new_patient_has_the_covariates_that_are_given(found, tmp_path):
    old, young = found.given({"age": 65}), found.given({"age": 25})
    assert np.median(old.new) > 1.5 * np.median(young.new)
    factor = np.exp(found.hierarchy.effects[..., 0, 0] * 40 / np.std(AGES))
    np.testing.assert_allclose((old.new / young.new)[..., 0], factor, rtol=1e-9)
    np.testing.assert_array_equal(found.given({"age": float(np.mean(AGES))}).new, found.new)
    np.testing.assert_array_equal(old.median, found.median)
    described = found.covariates.described({})
    assert f"median of the population ({described})" in str(old.answer)
    assert "new specimen (age 65 year)" in str(old.answer)
    figure, axis = plt.subplots()
    labels = old.plot(axis).get_legend_handles_labels()[1]
    plt.close(figure)
    assert {"a new specimen (age 65 year), 95 %", f"median of the population ({described}), 95 %"} <= {*labels}
    band = found.new_patient([1.2], covariates={"age": 65}, discrepancy=False)
    assert band["median"][0] == pytest.approx(2 * (1.2 - 1.2**-2) * np.median(old.new), rel=1e-6)
    old.patient.save(tmp_path / "patient.nc")
    loaded = tq.load(tmp_path / "patient.nc")
    np.testing.assert_array_equal(loaded.solution.draws["C10"], old.new[..., 0])
    assert "the patient: age 65 year" in loaded.how
    assert not any("beyond" in text for text in old.warnings)
    assert any("age 90 year (theirs: 20 to 70)" in text for text in found.given({"age": 90}).warnings)
    for values, words in (({"sex": "f"}, "there is no covariate 'sex'"), ({"age": "old"}, "'age' must be a number")):
        with pytest.raises(tq.InputError, match=words):
            found.given(values)


@pytest.mark.slow
def test_effects_are_saved_with_their_names(found, tmp_path):
    found.save(tmp_path / "population.nc")
    tree = xr.open_datatree(tmp_path / "population.nc", engine="h5netcdf").load()
    effect = tree["posterior"]["effect"].sel(covariate="age", parameter="C10")
    np.testing.assert_allclose(effect, found.hierarchy.effects[..., 0, 0] / np.std(AGES), rtol=1e-12)
    np.testing.assert_allclose(tree["covariates"]["design"].sel(covariate="age"), found.covariates.design[:, 0])


def planted(seed, per_year=0.012, spread=0.2):
    """Return how the posterior of an effect, and of a new patient of 60 years, see a truth that was drawn: ranks."""
    generator = np.random.default_rng(seed)
    age = np.array(AGES)
    line = np.log(0.5) + per_year * (age - 48) + spread * generator.standard_normal(7)[:6]
    found = neo_hookean(specimens_of(np.exp(line), seed=1000 * seed), covariates=COVARIATES, seed=seed)
    patient = np.log(0.5) + per_year * (60 - 48) + spread * generator.standard_normal()
    rank_of_effect = (found.hierarchy.effects[..., 0, 0] / age.std() < per_year).mean()
    return rank_of_effect, (np.log(found.given({"age": 60}).new[..., 0]) < patient).mean()


@pytest.mark.slow
@pytest.mark.statistical
def test_a_planted_slope_and_a_new_patient_are_covered():
    """Of 20 populations, central 95 % intervals of the slope and of a new patient: five misses by chance in 0.3 %."""
    ranks = np.array([planted(seed) for seed in range(1, 21)])
    assert (((ranks < 0.025) | (ranks > 0.975)).sum(axis=0) < 5).all()


def test_words_are_columns_against_the_most_frequent_one():
    frame = pd.DataFrame({"region": ["base", "apex", "apex", "mid", "base", "apex"], "n": [1, 2, 3, 4, 5, 7]}, NAMES)
    found = covariates_of(frame, NAMES)
    assert found.effects == (("region base", "against apex"), ("region mid", "against apex"), ("n", "per unit"))
    numbers = (frame["n"] - frame["n"].mean()) / frame["n"].std(ddof=0)
    expected = np.column_stack([frame["region"] == "base", frame["region"] == "mid", numbers])
    np.testing.assert_allclose(found.design, expected)
    np.testing.assert_allclose(found.row({"region": "mid", "n": "5"}), [0, 1, numbers.iloc[4]])
    np.testing.assert_allclose(found.row({}), 0)
    assert found.described({"n": 5}) == "region apex, n 5"
    with pytest.raises(tq.InputError, match="'region' must be one of apex, base, mid, not 'top'"):
        found.row({"region": "top"})


def with_column(name, values):
    return {specimen: {**COVARIATES[specimen], name: value} for specimen, value in zip(NAMES, values, strict=True)}


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (COVARIATES | {"s9": {"age [year]": 3}}, "specimen 's9': there is no specimen 's9'; the specimens are 's0'"),
        ({name: COVARIATES[name] for name in NAMES[1:]}, "the covariates of specimen 's0' are missing"),
        (with_column("sex", ["f", "m", "", "f", "m", "f"]), "specimen 's2', 'sex': the value of 'sex' is missing"),
        (with_column("n", [1, 2, np.nan, 4, 5, 6]), "specimen 's2', 'n': the value of 'n' is missing"),
        (with_column("n", [1, 2, "three", 4, 5, 6]), "specimen 's2', 'n': 'three' is no number, as others"),
        (with_column("sex", ["f"] * 6), "'sex': all specimens have the same value, 'f': leave it out"),
        (with_column("n", [2.0] * 6), "'n': all specimens have the same value, 2"),
        (
            with_column("birth", [2000 - age for age in AGES]),
            "'birth': the covariates before it \\('age \\[year\\]'\\) determine it",
        ),
        (with_column("site", "abcadb"), "have 4 effects on every parameter, and 6 specimens allow 3"),
        ({name: {} for name in NAMES}, "there is no covariate"),
        ([1, 2], "must be a table with a row for each specimen"),
        (pd.DataFrame({"age": [1, 2]}, ["s0", "s0"]), "specimen 's0' has several rows"),
    ],
)
def test_covariates_that_cannot_be_used_are_refused_in_one_message(given, words):
    with pytest.raises(tq.InputError, match=words):
        covariates_of(given, NAMES)


def test_levels_that_differ_in_capitals_only_are_refused():
    sexes = {name: {"sex": sex} for name, sex in zip(NAMES, ("f", "m", "F", "m", "f", "f"), strict=True)}
    with pytest.raises(tq.InputError, match="'F' and 'f' differ in capitals only"):
        covariates_of(sexes, NAMES)
