"""Whether predictions hold the truth: new measurements, and the stress in loading modes that were not measured."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tissuq.assessment import Average
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import LoadingMode
from tissuq.mechanics.path import farthest_stretch, invariants
from tissuq.posterior import Posterior
from tissuq.studies.coverage.truths import Truth

__all__ = ["share_of_new", "stress_unseen", "unseen_stretches"]

FloatArray = NDArray[np.float64]

POINTS = 12
"""Stretches of a loading mode that was not measured."""


def share_of_new(fit: Posterior | Average, data: Experiment, truth: Truth, noise_sd: float, prob: float) -> float:
    """Return the share of new measurements, at the measured stretches, that the predictive band holds on average."""
    from scipy.special import ndtr

    band = fit.predict(data.stretch, prob=prob)
    low, high = ((band[end] - truth.stress(data.mode, data.stretch)) / noise_sd for end in ("low", "high"))
    return float(np.mean(ndtr(high) - ndtr(low)))


def stress_unseen(
    fit: Posterior | Average, data: Experiment, truth: Truth, mode: LoadingMode, prob: float
) -> tuple[float, float]:
    """Return the share of the true stress inside the band of the stress itself, and the error of its mean.

    The error is the root mean square over the stretches, relative to that of the true stress. A discrepancy that is an
    energy is part of the prediction; any other is left out, because it says nothing about another loading mode.
    """
    stretch = unseen_stretches(data.mode, data.stretch, mode)
    is_energy = isinstance(fit, Posterior) and fit.model.discrepancy.is_energy
    band = fit.predict(stretch, discrepancy=is_energy, noise=False, prob=prob, mode=mode)
    stress = truth.stress(mode, stretch)
    share = np.mean((band["low"] <= stress) & (stress <= band["high"]))
    return float(share), float(np.linalg.norm(band["mean"] - stress) / np.linalg.norm(stress))


def unseen_stretches(measured: LoadingMode, stretch: FloatArray, mode: LoadingMode) -> FloatArray:
    """Return stretches above one in a mode, up to where I1 or I2 leaves the range that was measured in another."""
    most = [float(each.max()) for each in invariants(measured, stretch)]
    return np.linspace(1.0, farthest_stretch(mode, most, 1), POINTS + 1)[1:]
