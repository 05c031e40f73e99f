"""What a reader of a calibration must know before using it, in sentences."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tissuq.emulation.calibration import Calibration

__all__ = ["warnings_about"]

NOTABLE_SHARE = 0.1
"""Of the posterior variance that is owed to the emulator."""
SHIFTED = 0.5
"""Posterior standard deviations by which the emulator's error may move a mean without a word."""
TOO_SURE = 1.5
"""Root mean square of the standardised errors above which an emulator is too sure of itself."""
EDGE, MASS_AT_EDGE = 0.01, 0.02
"""Share of the design's width that is its edge, and of the posterior there that is worth a word."""
CAUTIONS = {
    "none": (
        "no error of the forward model is allowed for: where it is wrong, its parameters are over-confident, and the "
        "interval does not show it."
    ),
    "gp": (
        "the discrepancy has initial stiffness of its own, and takes it from the parameters: measured, its intervals "
        "hold the initial modulus far less often than they say (docs/expensive-models.md). Prefer gp-pinned."
    ),
    "gp-pinned": (
        "the initial stiffness is left to the parameters; what the discrepancy has learnt holds for this experiment "
        "alone."
    ),
}
"""What a reader must know of each discrepancy, beside a forward model."""
NEAR_FAILURES = 0.05
"""Share of the posterior nearer to a run that failed than to any other."""


def warnings_about(calibration: Calibration) -> Iterator[str]:
    """Yield the warnings that a calibration carries, the gravest first."""
    if not calibration.converged:
        yield calibration.posterior.verdict
    if calibration.runs.failed.any():
        share = _share_near_failures(calibration)
        near = (
            f"A share of {share:.0%} of the posterior is nearer to a failed run than to any other: there the emulator "
            "is a guess."
            if share > NEAR_FAILURES
            else "The posterior keeps away from them."
        )
        yield f"{calibration.runs.told_failures} {near}"
    yield from _about_emulator(calibration)
    ends = [f"{symbol} ({end})" for symbol, end in _at_edge(calibration)]
    if ends:
        yield (
            f"the posterior reaches the end of what was simulated for {', '.join(ends)}: there the prior, not the "
            "data, decides. Give a wider prior, unless the bound is meant."
        )
    yield CAUTIONS[calibration.problem.discrepancy.name]


def _about_emulator(calibration: Calibration) -> Iterator[str]:
    forward = calibration.problem.forward_symbols
    shares = {symbol: calibration.emulator_share[symbol] for symbol in forward}
    exact = calibration.without_emulator_error.marginals
    moved = {each: abs(exact[each].mean - own.mean) / own.sd for each, own in calibration.marginals.items()}
    worst, farthest = max(shares, key=lambda each: shares[each]), max(forward, key=lambda each: moved[each])
    more = "Give more runs, or let some be placed where the posterior is (refine)."
    if shares[worst] > NOTABLE_SHARE:
        yield (
            f"the emulator's error is large beside the noise: it makes {shares[worst]:.0%} of the posterior variance "
            f"of {worst}. {more}"
        )
    elif moved[farthest] > SHIFTED:
        yield (
            f"the emulator's error is large beside the noise: without it the mean of {farthest} would lie "
            f"{moved[farthest]:.1f} standard deviations elsewhere. {more}"
        )
    tried = calibration.check
    if tried.rms_standardised > TOO_SURE:
        yield (
            "the emulator is too sure of itself: runs predicted from the others are off by "
            f"{tried.rms_standardised:.1f} of its standard deviations (root mean square; 1 is right). Where the model "
            "is not smooth in its parameters, try the kernel matern-5/2; else give more runs."
        )


def _share_near_failures(calibration: Calibration) -> float:
    """Return the share of the posterior whose nearest run failed, in the design's box."""
    runs, coordinates = calibration.runs, calibration.emulator.coordinates
    draws = calibration.draws(400)[:, : len(runs.symbols)]
    places, own = coordinates.of(runs.points), coordinates.of(draws)
    nearest = ((own[:, None] - places[None]) ** 2).sum(axis=2).argmin(axis=1)
    return float(runs.failed[nearest].mean())


def _at_edge(calibration: Calibration) -> Iterator[tuple[str, str]]:
    """Yield the forward parameters with posterior at an end of the design, and which end."""
    points = calibration.runs.points
    for symbol, column in zip(calibration.problem.forward_symbols, points.T, strict=True):
        low, high = calibration.problem.priors[symbol].support
        low, high = max(low, column.min()), min(high, column.max())
        own = calibration.posterior.values[:, calibration.problem.symbols.index(symbol)]
        weights, edge = calibration.posterior.weights, EDGE * (high - low)
        if weights[own < low + edge].sum() > MASS_AT_EDGE:
            yield symbol, "lower"
        if weights[own > high - edge].sum() > MASS_AT_EDGE:
            yield symbol, "upper"
