"""Proposals around the peaks of a density, to which good points of the prior climb, and along the ridges there."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.inference.box import lower_triangle
from tissuq.inference.enumerators.survey import LEAST_CURVATURE, climb
from tissuq.inference.proposals import Mixture, Proposal
from tissuq.inference.quasi_monte_carlo import even_points

SURVEY_POINTS, CLIMBS, LEAST_DISTANCE = 1024, 8, 0.7
"""Points of the prior among which climbs to peaks begin, how many do, and how far apart."""
COINCIDENT = 0.5
"""Distance of two peaks, in widths of one, below which they are the same."""
MAX_CLIMBS, CLIMBED_HEIGHT = 8, 0.5
"""Climbs one after another, each in steps of the width where the last ended, and what the last gains of log density."""
RIDGE_RATIO = 5.0
"""Width of a proposal along its longest axis over that along the next one, from which it lies on a ridge."""
RIDGE_STEP, MAX_RIDGE_STEPS, RIDGE_LOG_DROP = 0.2, 24, 10.0
"""Length of a step along a ridge, in sds of the prior, how many there are each way, and the log density below the peak
at which they end."""
MIN_STEP_RATIO, MAX_STEP_RATIO = 0.2, 4.0
"""Distance of a climbed place from the last one, over the step, beyond which it is on another ridge or none."""
UNBOUNDED = np.array(np.inf)
"""End of coordinates that are normal under the prior."""
RELEVANT_LOG_DROP = 20.0
"""Logarithm of the mass of a peak below the largest at which it does not count."""


def around_peaks(log_density: Callable[[FloatArray], FloatArray], dimension: int) -> Mixture:
    """Return a mixture with a proposal around each place to which a climb from a good point of the prior has come.

    And with proposals along the ridges on which these lie.

    Parameters
    ----------
    log_density : callable
        (N,) at points (N, d), in coordinates that are normal under the prior.
    dimension : int
        Their number d.
    """
    climbed = list(_climbed(log_density, _feet(log_density, dimension)))
    largest = max(log_mass for log_mass, _ in climbed)
    proposals, on_ridges = list[Proposal](), list[Proposal]()
    for log_mass, proposal in climbed:
        scores = [np.linalg.solve(other.root, proposal.mean - other.mean) for other in proposals]
        if log_mass >= largest - RELEVANT_LOG_DROP and all(np.linalg.norm(score) > COINCIDENT for score in scores):
            proposals.append(proposal)
    for proposal in proposals:
        if all(np.linalg.norm(proposal.mean - other.mean) > RIDGE_STEP for other in on_ridges):
            on_ridges += _along_ridge(log_density, proposal)
    proposals += on_ridges
    return [(1 / len(proposals), proposal) for proposal in proposals]


def _feet(log_density: Callable[[FloatArray], FloatArray], dimension: int) -> FloatArray:
    """Return good points (K, d) of the prior far apart."""
    from scipy.special import ndtri

    points, feet = ndtri(even_points(dimension, SURVEY_POINTS)), list[FloatArray]()
    for index in np.argsort(-log_density(points)):
        if all(np.linalg.norm(points[index] - foot) > LEAST_DISTANCE for foot in feet):
            feet.append(points[index])
        if len(feet) == CLIMBS:
            break
    return np.array(feet)


def _climbed(log_density: Callable[[FloatArray], FloatArray], peaks: FloatArray) -> Iterator[tuple[float, Proposal]]:
    """Yield places to which climbs from points (K, d) come, with Gaussians of the width there and their log masses.

    Along a narrow bent ridge climbs begin again, in steps of the width where the last ended: it has places all along.
    """
    roots, last_heights = np.repeat(np.eye(peaks.shape[1])[None], len(peaks), axis=0), np.full(len(peaks), -np.inf)
    for _ in range(MAX_CLIMBS):
        evaluate, at_peaks = partial(_along, log_density, peaks, roots), np.zeros((1, *peaks.shape))
        steps, heights, curvatures = (ends[0] for ends in climb(evaluate, at_peaks, -UNBOUNDED, UNBOUNDED))
        peaks = peaks + (roots @ steps[:, :, None])[:, :, 0]
        values, vectors = np.linalg.eigh(curvatures)
        roots = lower_triangle(roots @ (vectors / np.sqrt(np.maximum(values, LEAST_CURVATURE))[:, None]))
        log_masses = heights + np.log(np.diagonal(roots, axis1=1, axis2=2)).sum(axis=1)
        yield from zip(log_masses.tolist(), map(Proposal, peaks, roots), strict=True)
        is_relevant = log_masses >= log_masses.max() - RELEVANT_LOG_DROP
        if not (is_relevant & (heights > last_heights + CLIMBED_HEIGHT)).any():
            return
        last_heights = heights


def _along_ridge(log_density: Callable[[FloatArray], FloatArray], proposal: Proposal) -> Iterator[Proposal]:
    """Yield proposals both ways along the ridge on which one lies, if it does: each a step on, then climbed across."""
    values, axes = np.linalg.eigh(proposal.root @ proposal.root.T)
    if len(values) == 1 or values[-1] < RIDGE_RATIO**2 * values[-2]:
        return
    least_height = log_density(proposal.mean[None])[0] - RIDGE_LOG_DROP
    for direction in (axes[:, -1], -axes[:, -1]):
        centre, across = proposal.mean, axes[:, :-1] * np.sqrt(values[:-1])
        for _ in range(MAX_RIDGE_STEPS):
            start = centre + RIDGE_STEP * direction
            on_plane = partial(_across, log_density, start, across)
            *_, (_, peak) = _climbed(on_plane, np.zeros((1, across.shape[1])))
            height, step = on_plane(peak.mean[None])[0], start + across @ peak.mean - centre
            length = np.linalg.norm(step)
            if not (height > least_height and MIN_STEP_RATIO < length / RIDGE_STEP < MAX_STEP_RATIO):
                break
            centre, direction, root = centre + step, step / length, across @ peak.root
            covariance = root @ root.T
            yield Proposal.of_covariance(centre, covariance + np.outer(step, step))
            off_direction = np.eye(len(step)) - np.outer(direction, direction)
            variances, axes_across = np.linalg.eigh(off_direction @ covariance @ off_direction)
            across = axes_across[:, 1:] * np.sqrt(variances[1:])


def _across(
    log_density: Callable[[FloatArray], FloatArray], start: FloatArray, across: FloatArray, steps: FloatArray
) -> FloatArray:
    """Return the log density (N,) at steps (N, d - 1) along directions across a ridge (d, d - 1), from a place (d,)."""
    return log_density(start + steps @ across.T)


def _along(
    log_density: Callable[[FloatArray], FloatArray], centres: FloatArray, roots: FloatArray, steps: FloatArray
) -> FloatArray:
    """Return the log density (1, K, P) at steps (1, K, P, d) from K centres, in units of the roots' widths there."""
    points = centres[:, None] + steps[0] @ roots.swapaxes(1, 2)
    return log_density(points.reshape(-1, centres.shape[1])).reshape(steps.shape[:-1])
