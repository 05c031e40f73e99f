"""The population of a few exactly known specimens against a sum over a grid of its spread."""

from __future__ import annotations

import numpy as np
import pytest

from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.population.covariates import covariates_of
from tissuq.population.hierarchy import sample_hierarchy

LOGS, SD = np.array([-0.682, -0.652, -0.676]), np.array([0.004, 0.003, 0.004])
PRIOR_SD, SPREAD = 5.0, 1.0


def spreads_by_grid(probabilities):
    """Return quantiles of tau: theta_i ~ N(m, tau^2), known to SD; m ~ N(0, 5^2) integrated; tau half-normal."""
    tau = np.geomspace(1e-6, 8, 20_000)
    variance = SD**2 + tau[:, None] ** 2
    precision = (1 / variance).sum(axis=1) + PRIOR_SD**-2
    misfit = (LOGS**2 / variance).sum(axis=1) - (LOGS / variance).sum(axis=1) ** 2 / precision
    log_density = -0.5 * (np.log(variance).sum(axis=1) + np.log(precision) + misfit + (tau / SPREAD) ** 2)
    share = np.exp(log_density - log_density.max()) * tau
    return np.interp(probabilities, share.cumsum() / share.sum(), tau)


def test_the_spread_of_few_specimens_that_agree_is_right_in_both_tails(monkeypatch):
    """Where the spread is large the mean is free, where it is small it is known: a factor of a hundred between both."""
    monkeypatch.setattr("tissuq.population.hierarchy.DRAWS_PER_CHAIN", 2500)
    reference = np.array([PRIOR_SD])
    shrunk = 1 / (1 / SD**2 + 1 / PRIOR_SD**2)
    mixtures = [
        GaussianMixture.of_covariances(np.ones(1), np.array([[mean * left / sd**2]]), np.array([[[left]]]))
        for mean, sd, left in zip(LOGS, SD, shrunk, strict=True)
    ]
    hierarchy = sample_hierarchy(mixtures, reference, ["C10"], covariates_of(None, ["a", "b", "c"]), SPREAD, 0)
    probabilities = [0.05, 0.5, 0.9, 0.95]
    assert np.quantile(hierarchy.tau, probabilities) == pytest.approx(spreads_by_grid(probabilities), rel=0.08)
    assert hierarchy.diagnostics.converged
    assert hierarchy.sampled.divergences < 10
