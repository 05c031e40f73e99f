"""Coordinates of the nonlinear parameters in which their posterior is nearly flat: what quadrature works in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tissuq.inference.enumerators.survey import REACH, Survey

__all__ = ["Warp", "warp_along"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Warp:
    """A map between the unit cube and d parameters with bounds, through one Cauchy distribution after another.

    Each parameter enters by its logarithm where its support is positive. Given those before it, its coordinate is
    the probability of a Cauchy distribution cut at its bounds, whose centre follows the others along the ridges of
    the posterior. The map is exact whatever centre and scale; good ones only save work. There is one for each of B
    data sets, all arrays but the first beginning with that dimension; they share the coordinates of the structure.

    Attributes
    ----------
    is_log : (d,) array
    lower, upper : (B, d) arrays
        Bounds of the parameters, or of their logarithms.
    anchor, centre, scale : (B, d) arrays
    slope : (B, d, d) array
        Given g before it, parameter j is centred on centre_j + slope_j (g - anchor).
    """

    is_log: NDArray[np.bool_]
    lower: FloatArray
    upper: FloatArray
    anchor: FloatArray
    centre: FloatArray
    slope: FloatArray
    scale: FloatArray

    def __getitem__(self, data_set: int) -> Warp:
        index = slice(data_set, data_set + 1)
        return Warp(self.is_log, *(value[index] for name, value in vars(self).items() if name != "is_log"))

    def parameters(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return parameters (B, N, d) at points (N, d) of the cube, and the log density (B, N) of the map there."""
        g = np.empty((len(self.scale), *u.shape))
        log_density = np.zeros(g.shape[:2])
        for j in range(u.shape[1]):
            centre, scale = self._centre(j, g), self.scale[:, j, None]
            start, mass = self._cut(j, centre)
            tangent = np.tan(np.pi * (start + mass * u[:, j] - 0.5))
            g[:, :, j] = np.clip(centre + scale * tangent, self.lower[:, j, None], self.upper[:, j, None])
            log_density -= np.log(np.pi * scale * (1 + tangent**2) * mass)
        h = np.where(self.is_log, np.exp(np.where(self.is_log, g, 0.0)), g)
        return h, log_density - (g * self.is_log).sum(axis=2)

    def bounds(self, j: int) -> tuple[float, float]:
        """Return the lowest and highest value of parameter j of the first data set."""
        ends = np.array([self.lower[0, j], self.upper[0, j]])
        low, high = np.exp(ends) if self.is_log[j] else ends
        return float(low), float(high)

    def coordinate(self, j: int, value: FloatArray, preceding: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the coordinate u_j (N, k) of values (k,) given those before it (N, j), and du_j/dvalue.

        For the first data set.
        """
        g = np.zeros((1, len(preceding), len(self.is_log)))
        if j:
            padded = np.hstack([preceding, np.full((len(preceding), len(self.is_log) - j), 0.5)])
            h = self[0].parameters(padded)[0]
            g[:, :, :j] = np.where(self.is_log, np.log(np.where(self.is_log, h, 1.0)), h)[:, :, :j]
        centre = self[0]._centre(j, g)
        start, mass = (value.T for value in self[0]._cut(j, centre))
        scale = self.scale[0, j]
        target = np.log(value) if self.is_log[j] else value
        distance = (target - centre.T) / scale
        slope = 1 / (np.pi * scale * (1 + distance**2) * mass)
        coordinate = (0.5 + np.arctan(distance) / np.pi - start) / mass
        return np.clip(coordinate, 0.0, 1.0 - 1e-12), slope / value if self.is_log[j] else slope

    def _centre(self, j: int, g: FloatArray) -> FloatArray:
        along = (g[:, :, :j] - self.anchor[:, None, :j]) @ self.slope[:, j, :j, None]
        return np.asarray(self.centre[:, j, None] + along[:, :, 0])

    def _cut(self, j: int, centre: FloatArray) -> tuple[FloatArray, FloatArray]:
        ends = ((bound[:, j, None] - centre) / self.scale[:, j, None] for bound in (self.lower, self.upper))
        start, end = (0.5 + np.arctan(distance) / np.pi for distance in ends)
        return start, end - start


def warp_along(survey: Survey) -> Warp:
    """Return the warp that follows the posteriors of a survey along their ridges."""
    anchor, covariance = survey.mean, survey.covariance
    centre, scale = anchor.copy(), np.empty_like(anchor)
    slope = np.zeros_like(covariance)
    shared = range(survey.structure) if len(anchor) > 1 else range(0)
    for j in range(anchor.shape[1]):
        covariances = covariance[:, :j, :j], covariance[:, :j, j]
        slope[:, j, :j] = np.linalg.solve(covariances[0], covariances[1][:, :, None])[:, :, 0]
        scale[:, j] = np.sqrt(covariance[:, j, j] - (covariances[1] * slope[:, j, :j]).sum(axis=1))
        if j in shared:
            slope[:, j], centre[:, j] = 0.0, anchor[:, j].mean()
            scale[:, j] = np.sqrt(covariance[:, j, j].mean() + anchor[:, j].var())
    for j in range(survey.structure):
        # Data sets on the same stretches then meet the same settings, whose factorisations are remembered.
        scale[:, j] = 2.0 ** np.round(np.log2(scale[:, j]))
        centre[:, j] = np.round(centre[:, j] / scale[:, j]) * scale[:, j]
    lower = np.where(survey.is_log, np.maximum(survey.lower, centre - REACH), survey.lower)
    if shared:
        lower[:, : survey.structure] = lower[:, : survey.structure].min(axis=0)
    return Warp(survey.is_log, lower, survey.upper, anchor, centre, slope, scale)
