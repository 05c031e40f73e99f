"""Simulation-based calibration: parameters from the prior, data from the parameters, ranks from the posterior.

If data come from the model, the posterior probability below the true value is uniform, whatever the data (Cook, Gelman
& Rubin 2006; Talts et al. 2018, arXiv:1804.06788). Two tests see what may go wrong: Kolmogorov's and Smirnov's, any
shift or change of shape, and the variance of the normal scores, a posterior that is too narrow or too wide.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri
from scipy.stats import chi2, kstest

from dense import TERMS, columns

Array = NDArray[np.float64]


def simulate(
    discrepancy: str, stretch: Array, values: Mapping[str, Array], noise_sd: Any, generator: np.random.Generator
) -> Array:
    """Return stresses (N, n) of the neo-Hookean material, a discrepancy and noise of sd (), (N,) or (N, n)."""
    linear = ("C10", *TERMS[discrepancy])
    count, n = len(values["C10"]), len(stretch)
    stress = np.stack([values[name] for name in linear], axis=1) @ columns(linear, stretch).T
    sd = np.asarray(noise_sd, dtype=float)
    stress = stress + (sd[:, None] if sd.ndim == 1 else sd) * generator.standard_normal((count, n))
    if "S" in values:
        stress = stress + values["S"][:, None] * generator.standard_normal((count, n))
    if "c" in values:
        away = (stretch[:, None] - stretch) / values["psi"][:, None, None]
        root = np.linalg.cholesky(np.exp(-0.5 * away**2) + 1e-12 * np.eye(n))
        stress = stress + values["c"][:, None] * np.einsum("bij,bj->bi", root, generator.standard_normal((count, n)))
    return stress


def probability_below(marginal: Any, value: float) -> float:
    """Return the posterior probability below a value, from a tabulated marginal."""
    return float(np.interp(value, marginal.points, marginal.cumulative))


def p_values(pit: Sequence[float]) -> tuple[float, float]:
    """Return the p values of uniformity (Kolmogorov-Smirnov) and of unit variance of the normal scores (two-sided)."""
    probabilities = np.clip(np.asarray(pit), 1e-9, 1 - 1e-9)
    scores = ndtri(probabilities)
    squares = float(scores @ scores)
    tail = chi2.cdf(squares, len(scores))
    return float(kstest(probabilities, "uniform").pvalue), float(2 * min(tail, 1 - tail))


def narrowed(pit: Sequence[float], factor: float) -> Array:
    """Return what the probabilities would be if every posterior's standard deviation were multiplied by a factor.

    Exact for a Gaussian posterior, and close for others.
    """
    from scipy.special import ndtr

    return np.asarray(ndtr(ndtri(np.clip(np.asarray(pit), 1e-12, 1 - 1e-12)) / factor))
