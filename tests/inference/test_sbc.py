"""Simulation-based calibration: over data sets drawn from the prior, posteriors hold the truth as often as they say.

Fourteen tests of size 2e-5 for single models, two for all of them together, and a dozen for noise and samplers: under
the hypothesis that all is right, the file fails with a chance below 1e-3 over the choice of seeds (they are fixed).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from scipy.stats import chisquare, norm, truncnorm, uniform

import tissuq as tq
from dense import TERMS
from sbc import narrowed, p_values, probability_below, simulate

STRETCH = np.linspace(0.7, 1.6, 12)
NOISE_SD = 0.1
SIZE = 2e-5
COUNTS = dict.fromkeys(TERMS, 2000) | {"gp": 1000}
TRUE = {
    "C10": truncnorm(-1 / 0.3, np.inf, 1, 0.3),
    **{symbol: norm(0, 0.3) for symbol in ("m0", "m1", "m2", "C01")},
    "C20": norm(0, 0.2),
    "C30": norm(0, 0.1),
    "S": uniform(0, 0.5),
    "c": uniform(0, 1),
    "psi": uniform(0.2, 1.8),
    "noise_sd": uniform(0.02, 0.28),
    "noise_share": uniform(0, 0.2),
}
PRIORS = {
    "C10": tq.Normal(1, 0.3, 0),
    **{symbol: tq.Normal(0, 0.3) for symbol in ("m0", "m1", "m2", "C01")},
    "C20": tq.Normal(0, 0.2),
    "C30": tq.Normal(0, 0.1),
    "S": tq.Uniform(0, 0.5),
    "c": tq.Uniform(0, 1),
    "psi": tq.Uniform(0.2, 2),
    "noise_sd": tq.Uniform(0.02, 0.3),
    "noise_share": tq.Uniform(0, 0.2),
}
NONLINEAR = {"none": (), "gp": ("c", "psi")}


def truths(discrepancy, count, seed, noise=()):
    symbols = ("C10", *TERMS[discrepancy], *NONLINEAR.get(discrepancy, ("S",)), *noise)
    generator = np.random.default_rng(seed)
    values = {symbol: TRUE[symbol].rvs(count, random_state=generator) for symbol in symbols}
    return values, {symbol: PRIORS[symbol] for symbol in symbols}, generator


def experiments(stresses, stretch=STRETCH):
    return [tq.Experiment("uniaxial", stretch, row) for row in stresses]


@lru_cache
def below(discrepancy, count):
    """Return the posterior probabilities below the true C10, one for each simulated data set."""
    values, priors, generator = truths(discrepancy, count, seed=1)
    stresses = simulate(discrepancy, STRETCH, values, NOISE_SD, generator)
    options = {"discrepancy": discrepancy, "noise_sd": NOISE_SD, "priors": priors, "method": "exact"}
    posteriors = tq.fit_many(experiments(stresses), **options)
    return np.array(
        [
            probability_below(p.solution.marginals["C10"], value)
            for p, value in zip(posteriors, values["C10"], strict=True)
        ]
    )


@pytest.mark.statistical
@pytest.mark.parametrize("discrepancy", list(COUNTS))
def test_the_exact_posterior_of_c10_is_calibrated(discrepancy):
    assert min(p_values(below(discrepancy, COUNTS[discrepancy]))) > SIZE


@pytest.mark.statistical
def test_all_together_are_calibrated_and_a_fault_of_five_percent_is_caught():
    pit = np.concatenate([below(discrepancy, count) for discrepancy, count in COUNTS.items()])
    assert min(p_values(pit)) > SIZE
    # A standard deviation 5 % too small changes the variance of 13000 scores by 8 of its standard errors.
    for factor in (0.95, 1.05):
        assert p_values(narrowed(pit, factor))[1] < SIZE


@pytest.mark.statistical
@pytest.mark.parametrize("discrepancy", list(COUNTS))
def test_one_model_alone_catches_a_fault_of_fifteen_percent(discrepancy):
    # At 1000 to 2000 data sets 5 % is 2.2 to 3.2 standard errors, 15 % is 8 or more: it takes all models to see 5 %.
    assert p_values(narrowed(below(discrepancy, COUNTS[discrepancy]), 0.85))[1] < SIZE


@pytest.mark.parametrize(("count", "fault"), [(100, 0.6), pytest.param(2000, 0.9, marks=pytest.mark.statistical)])
def test_unknown_noise_is_calibrated_and_a_fault_is_caught(count, fault):
    """100 data sets see a standard deviation that is 40 % too small, 2000 one that is 10 %."""
    values, priors, generator = truths("none", count, seed=2, noise=("noise_sd",))
    stresses = simulate("none", STRETCH, values, values["noise_sd"], generator)
    options = {"discrepancy": "none", "priors": priors, "tolerances": "as-tested"}
    posteriors = tq.fit_many(experiments(stresses), method="exact", **options)
    for symbol in ("C10", "noise_sd"):
        pit = [
            probability_below(p.solution.marginals[symbol], v) for p, v in zip(posteriors, values[symbol], strict=True)
        ]
        assert min(p_values(pit)) > SIZE
        assert p_values(narrowed(pit, fault))[1] < SIZE


@pytest.mark.parametrize("count", [30, pytest.param(200, marks=pytest.mark.statistical)])
def test_noise_told_by_repeats_is_calibrated_together_with_what_it_is_told_from(count):
    """30 data sets see posteriors half as wide as they should be, 200 those that are 30 % too narrow."""
    stretch = np.repeat(np.linspace(0.7, 1.6, 6), 2)
    values, priors, generator = truths("constant", count, seed=3, noise=("noise_sd",))
    shared = {symbol: value for symbol, value in values.items() if symbol != "S"}
    stresses = simulate("constant", stretch, shared, values["noise_sd"], generator)
    stresses += np.repeat(values["S"][:, None] * generator.standard_normal((count, 6)), 2, axis=1)
    posteriors = tq.fit_many(experiments(stresses, stretch), discrepancy="constant", noise="repeats", priors=priors)
    for symbol in ("C10", "S", "noise_sd"):
        pit = [
            probability_below(p.solution.marginals[symbol], v) for p, v in zip(posteriors, values[symbol], strict=True)
        ]
        assert min(p_values(pit)) > SIZE
        assert p_values(narrowed(pit, 0.5 if count < 200 else 0.7))[1] < SIZE


@pytest.mark.statistical
def test_noise_that_grows_with_a_level_taken_from_the_data_is_calibrated_but_for_a_few_percent():
    # The likelihood takes the level from a smoothing spline through the same data: not a probability of the data, so
    # not exactly calibrated. With the true stress as level it would be. 95 % intervals may hold a few percent less.
    values, priors, generator = truths("none", 300, seed=4, noise=("noise_sd", "noise_share"))
    level = np.abs(values["C10"][:, None] * 2 * (STRETCH - STRETCH**-2))
    noise_sd = values["noise_sd"][:, None] + values["noise_share"][:, None] * level
    stresses = simulate("none", STRETCH, values, noise_sd, generator)
    posteriors = tq.fit_many(experiments(stresses), discrepancy="none", noise="proportional", priors=priors)
    pit = np.array(
        [
            probability_below(p.solution.marginals["C10"], value)
            for p, value in zip(posteriors, values["C10"], strict=True)
        ]
    )
    held = np.mean(np.abs(pit - 0.5) < 0.475)
    chance = 4.3 * np.sqrt(0.95 * 0.05 / 300)  # two-sided 2e-5
    assert 0.95 - 0.05 - chance < held < 0.95 + 0.03 + chance


@pytest.mark.statistical
@pytest.mark.parametrize(("method", "count"), [("nuts", 60), ("smc", 60)])
def test_sampled_posteriors_are_calibrated(method, count):
    # Ranks of the truth among 19 thinned draws, which are all but independent; C10 by its mixture of Gaussians, too.
    values, priors, generator = truths("constant", count, seed=5)
    stresses = simulate("constant", STRETCH, values, NOISE_SD, generator)
    options = {"discrepancy": "constant", "noise_sd": NOISE_SD, "priors": priors, "method": method}
    posteriors = tq.fit_many(experiments(stresses), **options)
    pit = [
        probability_below(each.solution.marginals["C10"], value)
        for each, value in zip(posteriors, values["C10"], strict=True)
    ]
    assert min(p_values(pit)) > SIZE
    for symbol in ("C10", "S"):
        ranks = np.array([_rank(p, symbol, v) for p, v in zip(posteriors, values[symbol], strict=True)])
        assert chisquare(np.bincount(ranks // 4, minlength=5)).pvalue > SIZE


def _rank(posterior, symbol, value):
    drawn = posterior.solution.draws[symbol].ravel()
    return int((drawn[np.linspace(0, drawn.size - 1, 19).astype(int)] < value).sum())
