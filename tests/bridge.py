"""Bridge sampling of the log evidence from draws alone (Meng & Wong 1996), independent of the package."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

Array = NDArray[np.float64]


def bridge_log_evidence(log_density: Callable[[Array], Array], draws: Array, seed: int = 0) -> tuple[float, float]:
    """Return the log of the integral of an unnormalised density on R^d and its standard error.

    A normal proposal is fitted to the first half of the draws; the second half and as many draws from the
    proposal give the optimal bridge estimate. The error (Frühwirth-Schnatter 2004, eq. 14) takes the draws as
    independent: thin them first where they are not.

    Parameters
    ----------
    log_density : callable
        Maps an (n, d) array of points to their (n,) log densities, likelihood times normalised prior.
    draws : (n, d) array
        Draws from the density. In the coordinates of a bounded problem the proposal would lose mass over the
        bounds: give draws and density (with its Jacobian) on the real line.
    seed : int
        Fixes the draws from the proposal.
    """
    fitted, used = np.array_split(np.asarray(draws), 2)
    proposal = multivariate_normal(fitted.mean(0), np.atleast_2d(np.cov(fitted.T)))
    proposed = proposal.rvs(len(used), random_state=np.random.default_rng(seed)).reshape(used.shape)
    # Log ratios of the density to the proposal, at the draws of either.
    at_draws = np.asarray(log_density(used)) - proposal.logpdf(used)
    at_proposed = np.asarray(log_density(proposed)) - proposal.logpdf(proposed)

    estimate = float(np.median(at_draws))
    for _ in range(1000):
        # With equally many draws of both, the optimal bridge is 1 / (density / evidence + proposal).
        above = logsumexp(at_proposed - np.logaddexp(at_proposed, estimate))
        below = logsumexp(-np.logaddexp(at_draws, estimate))
        previous, estimate = estimate, float(above - below)
        if abs(estimate - previous) < 1e-10:
            break
    else:
        raise RuntimeError("the bridge did not settle")
    terms = (np.exp(at_proposed - np.logaddexp(at_proposed, estimate)), np.exp(-np.logaddexp(at_draws, estimate)))
    return estimate, float(np.sqrt(sum(term.var() / term.mean() ** 2 / len(term) for term in terms)))
