"""The seven formulations as PyMC models, for both of its samplers."""

from __future__ import annotations

import numpy as np
import pymc as pm
import pytensor.tensor as pt

from peers.outcome import Chains
from peers.problem import BOUNDS, NOISE_SD, STRESS, STRETCH, Problem

__all__ = ["chains_of", "model_of"]


def model_of(problem: Problem) -> pm.Model:
    """State one formulation."""
    with pm.Model() as model:
        values = {symbol: pm.Uniform(symbol, *BOUNDS[symbol]) for symbol in problem.symbols}
        mean = pm.math.dot(problem.design, pt.stack([values[symbol] for symbol in problem.linear]))
        if problem.name == "gp":
            squares = (STRETCH[:, None] - STRETCH) ** 2
            process = values["c"] ** 2 * pt.exp(-0.5 * squares / values["psi"] ** 2)
            pm.MvNormal("stress", mean, cov=process + NOISE_SD**2 * np.eye(len(STRETCH)), observed=STRESS)
        else:
            sd = pt.sqrt(NOISE_SD**2 + values["S"] ** 2) if "S" in values else NOISE_SD
            pm.Normal("stress", mean, sd, observed=STRESS)
    return model


def chains_of(trace: object, symbols: tuple[str, ...]) -> Chains:
    """Return the draws of what PyMC and nutpie return."""
    return Chains(np.stack([np.asarray(trace.posterior[symbol]) for symbol in symbols], axis=-1))
