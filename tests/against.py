"""The same model for tissuq and for the dense oracle, so that a test states it once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

import tissuq as tq
from dense import TERMS, Axis, Dense, Linear, Problem, columns, integrate, problem_of

TRUTH = {"C10": 1.2, "C20": -0.057, "C30": 0.004}
BOXES = {"C10": (0, 10), "C01": (-10, 10), "C20": (-5, 5), "C30": (-5, 5), "m0": (-20, 20), "m1": (-20, 20)}
BOXES |= {"m2": (-20, 20)}
AXES = {"S": Axis(0, 3, 0.01), "c": Axis(0, 5, 0.01), "psi": Axis(0.05, 4, 0.05)}
NONLINEAR = {"none": (), "gp": ("psi", "c")}


def neo_hookean(stretch: Any) -> Any:
    """Return the uniaxial stress of C10 = 1."""
    return 2 * (stretch - stretch**-2)


def parts(
    discrepancy: str,
    boxes: Mapping[str, tuple[float, float]] = BOXES,
    axes: Mapping[str, Axis] = AXES,
    material: Sequence[str] = ("C10",),
) -> tuple[dict[str, Linear], dict[str, Axis]]:
    """Return the linear parameters and the axes that a discrepancy needs, with uniform priors."""
    linear = {symbol: Linear(*boxes[symbol]) for symbol in (*material, *TERMS[discrepancy])}
    return linear, {symbol: axes[symbol] for symbol in NONLINEAR.get(discrepancy, ("S",))}


def columns_of(values: Mapping[str, float], stretch: Any) -> Any:
    """Return the uniaxial stress of named parameters."""
    return columns(list(values), stretch) @ np.array(list(values.values()))


def uniform_priors(linear: Mapping[str, Linear], axes: Mapping[str, Axis]) -> dict[str, tq.Prior]:
    """Return tissuq's priors for the oracle's."""
    priors: dict[str, tq.Prior] = {symbol: tq.Uniform(axis.low, axis.high) for symbol, axis in axes.items()}
    for symbol, p in linear.items():
        priors[symbol] = tq.Uniform(p.low, p.high) if p.sd == np.inf else tq.Normal(p.mean, p.sd, p.low, p.high)
    return priors


def both(
    discrepancy: str,
    stretch: Any,
    stress: Any,
    noise_sd: float | None,
    linear: Mapping[str, Linear],
    axes: Mapping[str, Axis],
    noise: str | None = None,
    method: str = "exact",
    **options: Any,
) -> tuple[tq.Posterior, Problem]:
    """Return tissuq's posterior, and the oracle's problem (``options`` are those of `problem_of`)."""
    posterior = tq.fit(
        tq.Experiment("uniaxial", stretch, stress),
        discrepancy=discrepancy,
        noise_sd=noise_sd,
        noise=noise,
        priors=uniform_priors(linear, axes),
        tolerances="as-tested",
        method=method,
    )
    return posterior, problem_of(discrepancy, stretch, stress, linear, axes, noise_sd, **options)


def assert_agrees(
    posterior: tq.Posterior,
    problem: Problem,
    tolerance: float = 1e-3,
    nodes: int = 0,
    width: float = 0.0,
    refine: float = 1.0,
) -> Dense:
    """Hold evidence (within the stated error, the oracle's own added, and 1e-4), and C10's marginal against the oracle.

    ``tolerance`` is that of mean, sd and the width of the 95 % HDI, in standard deviations, and of what it holds. The
    ends may both move by more: at the shortest interval, its width does not change to first order. ``nodes`` is the
    number of the oracle's panels along each axis, ``refine`` multiplies it and all else in the oracle, and ``width`` is
    another tolerance for the HDI.
    """
    rough, truth = (
        (integrate(problem, nodes=each) for each in (nodes - 1, nodes))
        if nodes
        else (integrate(problem, refine=each * refine) for each in (0.75, 1.0))
    )
    own = 3 * abs(truth.log_evidence - rough.log_evidence) + 1e-10 * (1 + abs(truth.log_evidence))
    assert own < 5e-5, "the oracle itself is not accurate here"
    difference = abs(posterior.log_evidence - truth.log_evidence)
    assert difference <= posterior.log_evidence_error + own
    assert difference <= 1e-4 + own
    c10 = posterior.solution.marginals["C10"]
    assert abs(c10.mean - truth.mean) <= tolerance * truth.sd
    assert abs(c10.sd / truth.sd - 1) <= tolerance
    low, high = c10.hdi()
    assert abs(high - low - (truth.hdi[1] - truth.hdi[0])) <= (width or tolerance) * truth.sd
    assert abs(truth.mass(low, high) - 0.95) <= tolerance
    assert max(abs(low - truth.hdi[0]), abs(high - truth.hdi[1])) <= 10 * tolerance * truth.sd
    return truth
