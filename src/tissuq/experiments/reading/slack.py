"""Slack: how far a specimen moves before it carries load, found by whether a curve that starts there fits better."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tissuq.experiments.reading.disturbances import averaged
from tissuq.experiments.reading.table import Column

STARTS = np.concatenate([[0.0], np.linspace(0.02, 0.7, 35)])
"""Shares of the way at which the load may begin."""
FINER = np.linspace(-0.03, 0.03, 25)
"""Further shares of the way, about the best of those."""
MOST_POINTS, FEWEST_POINTS, FEWEST_SLACK = 200, 12, 3
"""Points into which the rows are averaged at most, rows that are needed, and rows without load among them."""
FITTED = 6
"""About how many numbers the curves fit."""
RESOLUTION = 5e-4
"""Share of the largest stress to which the family of curves is right."""
EVIDENCE, SHORTEST = 5.0, 0.03
"""Gain in log likelihood (n log of the ratio of mean squares) and share of the way from which slack is said."""
LEAST_SLOPE = 0.02
"""Slope at the start of the stiffest curves of the family, relative to their mean slope."""
LEAST_FIRST_STRETCH = 0.5
"""Stretch at which a test that shortens the specimen begins at least; amounts of shear begin near zero."""
ALREADY_LOADED = 0.2
"""Share of the largest stress below which, with the other sign, the rows are of a test through its reference."""
LEAST_PRELOAD, MOST_LOAD = 0.005, 0.1
"""Shares of the largest stress that a proposed preload has at least, and that no slack row reaches."""


@dataclass(frozen=True)
class Slack:
    """Where load begins: the number of rows before it, and the stretch there with its standard deviation.

    ``preload`` is a stress (MPa) that none of those rows carries.
    """

    rows: int
    stretch: float
    sd: float
    preload: float


def find_slack(stretch: Column, stress: Column) -> Slack | None:
    """Return the slack at the beginning of a branch of loading; None where there is none that shows.

    The stress is fitted by sums, with no negative weight, of curves that soften or stiffen from where load begins. If
    they fit clearly better from further on than from the first row, the specimen was slack up to there. Every curve of
    the family has a slope at its start, as every elastic material has, so that stiffening alone is no slack; in
    compression there are those times (l^-2 - l)/(1 - l), too, by which the neo-Hookean material stiffens. How well they
    fit from every other place is how probable it is that load begins there.

    With noise of 0.3 % of the largest stress slack over a tenth of the way is found in all curves but J-shaped ones (86
    of 100), with 1 % in 92 (41): there the rows after it carry as little as those before (docs/what-is-looked-for.md).
    """
    way = np.abs(stretch - stretch[0])
    if len(way) < FEWEST_POINTS or not way.max() > 0 or not np.abs(stress).max() > 0:
        return None
    order = np.argsort(way, kind="stable")
    way, load = way[order], stress[order] / stress[np.argmax(np.abs(stress))]
    if load.min() < -ALREADY_LOADED or np.abs(load[:FEWEST_SLACK]).max() > MOST_LOAD:
        return None
    _, (share, mean_load) = averaged(MOST_POINTS, way / way[-1], load)
    last = float(stretch[order[-1]])
    is_compressed = 0 < last < stretch[0] > LEAST_FIRST_STRETCH and stress.sum() < 0
    shortest = last / float(stretch[0]) if is_compressed else 1.0
    starts, gains = _gains(share, mean_load, shortest)
    if gains.max() < EVIDENCE or starts[np.argmax(gains)] < SHORTEST:
        return None
    weights = np.exp((gains - gains.max()) / 2) * np.gradient(starts)
    start = float(weights @ starts / weights.sum())
    spread = np.sqrt(weights @ (starts - start) ** 2 / weights.sum() + 0.25 * len(share) ** -2.0)
    is_slack = way < start * way[-1]
    largest = float(np.abs(load[is_slack]).max(initial=0.0))
    if is_slack.sum() < FEWEST_SLACK or largest > MOST_LOAD:
        return None
    preload = max(largest, LEAST_PRELOAD) * float(np.abs(stress).max())
    end = stretch[0] + np.sign(stretch[order[-1]] - stretch[0]) * start * way[-1]
    return Slack(int(is_slack.sum()), float(end), float(spread * way[-1]), preload)


def _gains(share: Column, load: Column, shortest: float) -> tuple[Column, Column]:
    """Return shares of the way, and twice the log likelihood that load begins there, less that of the first row.

    Residuals that neighbours have in common count once.
    """
    fits = _fits(share, load, STARTS, shortest)
    best = min(fits, key=lambda start: fits[start][0])
    if best > 0:
        finer = best + FINER
        fits |= _fits(share, load, finer[finer > 0], shortest)
    starts = sorted(fits)
    misfits = np.array([fits[start][0] for start in starts])
    residual = fits[starts[int(np.argmin(misfits))]][1]
    correlation = max(float(residual[1:] @ residual[:-1]) / (len(load) * float(misfits.min())), 0.0)
    independent = (len(load) - FITTED) * (1 - correlation) / (1 + correlation)
    return np.array(starts), independent * np.log(misfits[0] / misfits)


def _fits(share: Column, load: Column, starts: Column, shortest: float) -> dict[float, tuple[float, Column]]:
    """Return, of curves that begin at shares of the way, the mean square by which they miss the loads, and the misses.

    The stretch at the end of the way, counted from its beginning, is ``shortest`` in compression, or one.
    """
    from scipy.optimize import nnls

    begin = starts[:, None]
    share_from_start = np.clip((share - begin) / (1 - begin), 0.0, None)
    families, shifted = _curves(share_from_start), 1 + load  # shifted: the load may begin below zero
    if shortest < 1:
        end = shortest / (1 + begin * (shortest - 1))
        stiffening = _stiffening(1 + share_from_start * (end - 1)) / _stiffening(end)
        families = np.concatenate([families, families[..., 1:] * stiffening[..., None]], axis=-1)
    fits = {}
    for start, curves in zip(starts.tolist(), families, strict=True):
        weights, distance = nnls(curves, shifted, maxiter=50 * curves.shape[1])
        fits[start] = float(distance**2 / len(share) + RESOLUTION**2), shifted - curves @ weights
    return fits


def _stiffening(stretch: Any) -> Any:
    """Return the stress of a neo-Hookean material over its strain, relative to that of small strains."""
    return (1 + 1 / stretch + 1 / stretch**2) / 3


def _curves(share: Column) -> Column:
    """Return what loads are sums of (..., n, k): a constant, and curves that soften, go straight, stiffen or lock."""
    stiffening = [share**power for power in (1.5, 2, 2.5, 3, 4, 5, 7, 10)]
    stiffening += [np.expm1(rate * share) / np.expm1(rate) for rate in (1, 2, 3, 4, 5, 6, 8, 11, 16)]
    stiffening += [share * np.exp(rate * (share**2 - 1)) for rate in (1, 2, 4)]
    stiffening += [(1 - limit) * share / (1 - limit * share) for limit in (0.5, 0.7, 0.8, 0.9, 0.95, 0.99)]
    curves = [np.ones_like(share), share, *(LEAST_SLOPE * share + (1 - LEAST_SLOPE) * curve for curve in stiffening)]
    curves += [-np.expm1(-rate * share) for rate in (1, 2, 4, 8, 20)]
    return np.stack(curves, axis=-1)
