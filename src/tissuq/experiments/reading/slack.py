"""Slack: how far a specimen moves before it carries load, found by whether a curve that starts there fits better."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tissuq.experiments.reading.averages import averaged
from tissuq.experiments.reading.table import Column

__all__ = ["Slack", "find_slack"]

STARTS = np.concatenate([[0.0], np.linspace(0.02, 0.7, 35)])
"""Shares of the way at which the load may begin."""
MOST_POINTS, FEWEST_POINTS = 200, 12
"""Points into which the rows are averaged at most, and rows that are needed."""
RESOLUTION = 5e-4
"""Share of the largest stress to which the family of curves is right."""
EVIDENCE, SHORTEST = 4.0, 0.05
"""Gain in log likelihood (n log of the ratio of mean squares) and share of the way from which slack is said."""
LEAST_SLOPE = 0.01
"""Slope at the start of the stiffest curves of the family, relative to their mean slope."""
ALREADY_LOADED = 0.2
"""Share of the largest stress below which, with the other sign, the rows are of a test through its reference."""
LEAST_PRELOAD, MOST_LOAD = 0.005, 0.1
"""Shares of the largest stress that a proposed preload has at least, and that no slack row reaches."""


@dataclass(frozen=True)
class Slack:
    """Where load begins: the number of rows before, the stretch there, and a stress (MPa) that none of them carries."""

    rows: int
    stretch: float
    preload: float


def find_slack(stretch: Column, stress: Column) -> Slack | None:
    """Return the slack at the beginning of a branch of loading; None where there is none that shows.

    The stress is fitted by sums, with no negative weight, of curves that soften or stiffen from where load begins. If
    they fit clearly better from further on than from the first row, the specimen was slack up to there. Every curve of
    the family has a slope at its start, as every elastic material has, so that stiffening alone is no slack.
    """
    way = np.abs(stretch - stretch[0])
    if len(way) < FEWEST_POINTS or not way.max() > 0 or not np.abs(stress).max() > 0:
        return None
    order = np.argsort(way, kind="stable")
    way, load = way[order], stress[order] / stress[np.argmax(np.abs(stress))]
    if load.min() < -ALREADY_LOADED:
        return None
    _, (share, mean_load) = averaged(MOST_POINTS, way / way[-1], load)
    misfits = [_misfit(share, mean_load, start) for start in STARTS]
    best = int(np.argmin(misfits))
    gain = len(share) * float(np.log(misfits[0] / misfits[best]))
    is_slack = way < STARTS[best] * way[-1]
    largest = float(np.abs(load[is_slack]).max(initial=0.0))
    if gain < EVIDENCE or STARTS[best] < SHORTEST or not is_slack.any() or largest > MOST_LOAD:
        return None
    preload = max(largest, LEAST_PRELOAD) * float(np.abs(stress).max())
    end = stretch[0] + np.sign(stretch[order[-1]] - stretch[0]) * STARTS[best] * way[-1]
    return Slack(int(is_slack.sum()), float(end), preload)


def _misfit(share: Column, load: Column, start: float) -> float:
    """Return the mean square by which curves that begin at a share of the way miss the loads."""
    from scipy.optimize import nnls

    curves = _curves(np.clip((share - start) / (1 - start), 0.0, None))
    _, distance = nnls(curves, 1 + load, maxiter=50 * curves.shape[1])  # the 1 lets the zero of the load be negative
    return float(distance**2 / len(share) + RESOLUTION**2)


def _curves(share: Column) -> Column:
    """Return what loads are sums of (n, k): a constant, and curves that soften, go straight, stiffen or lock."""
    stiffening = [share**power for power in (2, 3, 5, 8)]
    stiffening += [np.expm1(rate * share) / np.expm1(rate) for rate in (4, 8, 16)]
    curves = [np.ones_like(share), share, *(LEAST_SLOPE * share + (1 - LEAST_SLOPE) * curve for curve in stiffening)]
    curves += [-np.expm1(-rate * share) for rate in (2, 6, 20)]
    curves += [(1 - limit) * share / (1 - limit * share) for limit in (0.8, 0.95, 0.99)]
    return np.column_stack(curves)
