"""Stress and tangent of an isotropic energy from its derivatives along the principal stretches."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

__all__ = ["first_piola_kirchhoff", "principal", "tangent", "volumetric_stress", "volumetric_tangent"]

FloatArray = NDArray[np.float64]
Derivatives = Callable[[FloatArray], tuple[FloatArray, FloatArray]]

NEAR = 1e-5
"""Relative difference of stretches below which a quotient of differences gives way to its limit: both have errors of
about 1e-10 there, the quotient that of rounding and the limit that of its next term."""


def principal(F: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the principal stretches (3, n) of gradients (3, 3, n), and their axes n_i and N_i as columns (n, 3, 3).

    They are not numbers where the volume is not positive, so that a solver sees that a step was too large.
    """
    left, stretches, right = np.linalg.svd(np.moveaxis(F, -1, 0))
    inverted = np.linalg.det(np.moveaxis(F, -1, 0)) <= 0
    return np.where(inverted, np.nan, stretches.T), left, np.swapaxes(right, 1, 2)


def first_piola_kirchhoff(derivatives: Derivatives, F: FloatArray) -> FloatArray:
    """Return P = sum_i w_i n_i x N_i, (3, 3, n), with w_i = dW/dl_i."""
    stretches, left, right = principal(F)
    slopes, _ = derivatives(stretches)
    return np.asarray(np.einsum("nai,in,nbi->abn", left, slopes, right, optimize=True))


def tangent(derivatives: Derivatives, F: FloatArray) -> FloatArray:
    """Return dP/dF, (3, 3, 3, 3, n).

    In the principal axes it has the components A_iijj = d2W/dl_i dl_j and, for i not j, A_ijij = (a + b) / 2 and
    A_ijji = (a - b) / 2, where a = (w_i - w_j) / (l_i - l_j), which becomes d2W/dl_i dl_i - d2W/dl_i dl_j for equal
    stretches, and b = (w_i + w_j) / (l_i + l_j).

    References
    ----------
    Ogden (1997), Non-linear elastic deformations, section 6.1.4.
    """
    stretches, left, right = principal(F)
    slopes, curvature = derivatives(stretches)
    components = np.zeros((3, 3, 3, 3, F.shape[-1]))
    for i in range(3):
        components[i, i, i, i] = curvature[i, i]
        for j in range(i):
            a = _quotient(stretches[[i, j]], slopes[[i, j]], curvature[[i, j]][:, [i, j]])
            b = (slopes[i] + slopes[j]) / (stretches[i] + stretches[j])
            components[i, i, j, j] = components[j, j, i, i] = curvature[i, j]
            components[i, j, i, j] = components[j, i, j, i] = (a + b) / 2
            components[i, j, j, i] = components[j, i, i, j] = (a - b) / 2
    axes = np.einsum("nai,nbj->nabij", left, right).reshape(-1, 9, 9)
    full = axes @ np.moveaxis(components.reshape(9, 9, -1), -1, 0) @ np.swapaxes(axes, 1, 2)
    return np.moveaxis(full, 0, -1).reshape(components.shape)


def _quotient(stretches: FloatArray, slopes: FloatArray, curvature: FloatArray) -> FloatArray:
    """Return (w_i - w_j) / (l_i - l_j), and its limit where the stretches are nearly equal."""
    difference = stretches[0] - stretches[1]
    is_near = np.abs(difference) < NEAR * stretches[0]
    limit = (curvature[0, 0] + curvature[1, 1] - 2 * curvature[0, 1]) / 2
    return np.where(is_near, limit, (slopes[0] - slopes[1]) / np.where(is_near, 1.0, difference))


def volumetric_stress(bulk: float, F: FloatArray) -> FloatArray:
    """Return the stress K (J - 1) J F^-T of K/2 (J - 1)^2."""
    J, inverse = _volume(F)
    return np.asarray(bulk * (J - 1) * J * inverse)


def volumetric_tangent(bulk: float, F: FloatArray) -> FloatArray:
    """Return K J ((2 J - 1) F^-T x F^-T - (J - 1) F^-T (il) F^-T), the tangent of K/2 (J - 1)^2."""
    J, inverse = _volume(F)
    outer = np.einsum("ijn,kln->ijkln", inverse, inverse)
    return np.asarray(bulk * J * ((2 * J - 1) * outer - (J - 1) * np.swapaxes(outer, 1, 3)))


def _volume(F: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return J (n,) and F^-T (3, 3, n)."""
    matrices = np.moveaxis(F, -1, 0)
    return np.linalg.det(matrices), np.moveaxis(np.swapaxes(np.linalg.inv(matrices), 1, 2), 0, -1)
