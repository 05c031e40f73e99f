"""Posterior predictive bands: quantiles of the stress under the whole posterior."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tissuq.errors import InputError
from tissuq.experiments.modes import LoadingMode, loading_mode
from tissuq.inference.solution import Solution
from tissuq.prediction.moments import stress_moments

__all__ = ["Band", "check_mode", "predict_average", "predict_band", "share_inside"]

FloatArray = NDArray[np.float64]

BLOCK = 2000
"""Stretches predicted at once: what bounds the memory."""
MANY, FEW = 1500, 200
"""Components that stand for the posterior at a block of stretches, and at more."""


@dataclass(frozen=True, eq=False)
class Band:
    """Mean and central interval of the stress (MPa) at stretches, all of shape (g,)."""

    stretch: FloatArray
    mean: FloatArray
    low: FloatArray
    high: FloatArray


def predict_band(
    solution: Solution,
    stretch: ArrayLike,
    *,
    discrepancy: bool = True,
    noise: bool = True,
    prob: float = 0.95,
    mode: str | LoadingMode | None = None,
) -> Band:
    """Return the mean stress and the interval that holds ``prob`` of it, at each stretch.

    Parameters
    ----------
    solution : Solution
        The posterior.
    stretch : (g,) array, dimensionless
        Where to predict.
    discrepancy : bool
        With the discrepancy's share (eq. 27), or the model alone (eq. 28).
    noise : bool
        For a new measurement, or for the stress itself.
    prob : float
        Probability between the ends, equal tails.
    mode : str or LoadingMode, optional
        Another loading mode than that of the data.

    Raises
    ------
    InputError
        When a stretch is not positive, prob is not between 0 and 1, or the discrepancy says nothing about the mode.
    """
    return predict_average([(1.0, solution)], stretch, discrepancy=discrepancy, noise=noise, prob=prob, mode=mode)


def predict_average(
    parts: Sequence[tuple[float, Solution]],
    stretch: ArrayLike,
    *,
    discrepancy: bool = True,
    noise: bool = True,
    prob: float = 0.95,
    mode: str | LoadingMode | None = None,
) -> Band:
    """Return the band of a mixture of posteriors of the same data, with weights that sum to one.

    All else is as for `predict_band`.
    """
    points = np.atleast_1d(np.asarray(stretch, dtype=np.float64))
    if points.ndim != 1 or not (np.isfinite(points) & (points > 0)).all():
        raise InputError("stretches to predict at must be a one-dimensional array of positive numbers.")
    if not 0 < prob < 1:
        raise InputError(f"prob must be between 0 and 1, not {prob}.")
    asked = loading_mode(mode) if mode is not None else parts[0][1].model.experiment.mode
    for _, solution in parts if discrepancy else ():
        check_mode(solution, asked)
    count = FEW if len(points) > BLOCK else MANY
    mixture = [(weight, solution.model, solution.components.thinned(count)) for weight, solution in parts]
    weights = np.concatenate([weight * components.weights for weight, _, components in mixture])
    tails = (0.5 * (1 - prob), 0.5 * (1 + prob))
    curves = []
    for block in np.array_split(points, max(1, len(points) // BLOCK)):
        moments = [
            stress_moments(model, components, block, discrepancy=discrepancy, noise=noise, mode=asked)
            for _, model, components in mixture
        ]
        mean, variance = (np.concatenate(each) for each in zip(*moments, strict=True))
        ends = [_mixture_quantile(tail, weights, mean, variance) for tail in tails]
        curves.append([weights @ mean, *ends])
    return Band(points, *np.concatenate(curves, axis=1))


def share_inside(solution: Solution, *, discrepancy: bool, prob: float = 0.95) -> float:
    """Return the share of the measurements inside the predictive band at their own stretches."""
    data = solution.model.experiment
    band = predict_band(solution, data.stretch, discrepancy=discrepancy, prob=prob)
    return float(np.mean((band.low <= data.stress) & (data.stress <= band.high)))


def check_mode(solution: Solution, asked: LoadingMode) -> None:
    """Refuse a loading mode of which a discrepancy says nothing."""
    model = solution.model
    if asked != model.experiment.mode and not model.discrepancy.is_energy:
        raise InputError(
            f"discrepancy '{model.discrepancy.name}' is an error of the {model.experiment.mode.name} "
            f"stress and says nothing about the {asked.name} one: predict without it, or fit with one that is an "
            "energy, such as 'auto'."
        )


def _mixture_quantile(probability: float, weights: FloatArray, mean: FloatArray, variance: FloatArray) -> FloatArray:
    """Return the quantile of a mixture of M Gaussians, at each of g places; safeguarded Newton iteration."""
    from scipy.special import ndtr, ndtri

    centre = weights @ mean
    spread = np.sqrt(weights @ (variance + (mean - centre) ** 2))
    sd = np.sqrt(np.maximum(variance, (0.01 * spread) ** 2))
    sd = np.maximum(sd, 1e-300)
    low, high = (mean - 10 * sd).min(axis=0), (mean + 10 * sd).max(axis=0)
    value = np.clip(centre + ndtri(probability) * spread, low, high)
    for _ in range(60):
        scores = (value - mean) / sd
        excess = weights @ ndtr(scores) - probability
        if np.abs(excess).max() < 1e-9:
            break
        low, high = np.where(excess < 0, value, low), np.where(excess < 0, high, value)
        density = weights @ (np.exp(-0.5 * scores**2) / sd) / np.sqrt(2 * np.pi)
        step = value - excess / np.maximum(density, 1e-300)
        value = np.where((step > low) & (step < high), step, 0.5 * (low + high))
    return np.where(spread > 0, value, centre)
