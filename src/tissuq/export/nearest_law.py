"""The parameters of a law that come nearest to a draw, under the condition that the law is stable."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tissuq.export.constrained_fit import Inequalities, fit_within, least_squares
from tissuq.export.draw_stresses import DrawStresses
from tissuq.export.stability_rows import StabilityRows

__all__ = ["WANTED_ERROR", "Candidate", "nearest_values", "squared_distance"]

FloatArray = NDArray[np.float64]

WEIGHTS_BEYOND = (1.0, 0.3, 0.1, 0.03, 0.01)
"""Weights of states beyond the measured ones, of which the heaviest is taken that costs little inside."""
WANTED_ERROR = 0.01
"""Largest relative error of a stress inside with which a card is content."""
MAX_RMS_RATIO = 1.1
"""Where that is out of reach: the root mean square error inside may be so many times the smallest."""


class Candidate(NamedTuple):
    """Values of the parameters that are not linear, and what unit values of the k others give.

    Attributes
    ----------
    setting : tuple of float
    columns : (n, k) array
        Stresses in the states.
    unit_moduli : (k,) array
        Initial shear moduli.
    """

    setting: tuple[float, ...]
    columns: FloatArray
    unit_moduli: FloatArray


def nearest_values(candidate: Candidate, stability: StabilityRows, draws: DrawStresses, number: int) -> FloatArray:
    """Return the linear parameters (k,) nearest to a draw that have its initial shear modulus.

    They are stable where the draw is. Of what was not measured the heaviest weight is taken that costs little inside.

    Parameters
    ----------
    candidate : Candidate
    stability : StabilityRows
        Of the same material with the same other parameters.
    draws : DrawStresses
    number : int
        Of the draw.
    """
    starts, free = _of_modulus(candidate.unit_moduli, draws.modulus[[number]])
    start = starts[:, 0]
    modulus, is_stable = float(draws.modulus[number]), bool(draws.stable[number])
    stress = draws.of_states.stress[number]
    is_borne = np.isfinite(stress)
    is_beyond, size = draws.shell[is_borne] > 0, draws.size_in_fits[number, is_borne]
    columns, stress = candidate.columns[is_borne] / size[:, None], stress[is_borne] / size

    def broken(solution: FloatArray) -> Inequalities:
        rows, bounds = stability.broken(start + free @ solution, modulus, draws.wanted_stiffness[number])
        return rows @ free, bounds - rows @ start

    def weighted(weight_beyond: float) -> FloatArray:
        weights = np.where(is_beyond, weight_beyond, 1.0)
        weighted_columns, wanted = weights[:, None] * (columns @ free), weights * (stress - columns @ start)
        solution = fit_within(weighted_columns, wanted, broken) if is_stable else None
        if solution is None:  # as near as it gets: that it is not stable is said
            solution = least_squares(weighted_columns, wanted)
        return np.asarray(start + free @ solution)

    candidates = [weighted(weight) for weight in WEIGHTS_BEYOND]
    errors = [np.abs(columns @ values - stress)[~is_beyond] for values in candidates]
    rms = [float(np.sqrt((error**2).mean())) for error in errors]
    is_good = [
        error.max() <= WANTED_ERROR or size <= MAX_RMS_RATIO * min(rms) for error, size in zip(errors, rms, strict=True)
    ]
    return candidates[is_good.index(True)]


def _of_modulus(unit_moduli: FloatArray, modulus: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return linear parameters (k, N) of these initial shear moduli (N,), and what they may change by: (k, k - 1)."""
    pivot = int(np.argmax(np.abs(unit_moduli)))
    start = np.zeros((len(unit_moduli), len(modulus)))
    start[pivot] = modulus / unit_moduli[pivot]
    free = np.delete(np.eye(len(unit_moduli)), pivot, axis=1)
    free[pivot] = -np.delete(unit_moduli, pivot) / unit_moduli[pivot]
    return start, free


def squared_distance(candidate: Candidate, weights: FloatArray, wanted: FloatArray, modulus: FloatArray) -> float:
    """Return the squared distance, by weights (n,), of stresses (n, N) from the nearest that have these moduli (N,)."""
    start, free = _of_modulus(candidate.unit_moduli, modulus)
    columns = weights[:, None] * (candidate.columns @ free)
    residual = weights[:, None] * (wanted - candidate.columns @ start)
    basis = np.linalg.qr(columns / np.maximum(np.abs(columns).max(axis=0, initial=0.0), 1e-300))[0]
    return float((residual**2).sum() - ((basis.T @ residual) ** 2).sum())
