"""The seven posteriors that every library fits: data, bounds of the uniform priors, likelihood. No tissuq in here."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import log, pi

import numpy as np
from numpy.typing import NDArray

__all__ = ["FORMULATIONS", "NOISE_SD", "STRESS", "STRETCH", "Problem"]

Floats = NDArray[np.float64]

NOISE_SD = 0.5
STRETCH = np.linspace(0.5, 4.25, 30)

SLOPE = 2 * (STRETCH - STRETCH**-2)
"""Derivative of I1 along uniaxial loading: the engineering stress of W(I1) is W'(I1) times this."""
X = STRETCH**2 + 2 / STRETCH - 3
"""I1 - 3 in uniaxial loading."""
STRESS = SLOPE * (1.2 + X * (2 * -0.057 + X * 3 * 0.004)) + NOISE_SD * np.random.default_rng(1).standard_normal(30)
"""Measured engineering stress (MPa): a Yeoh material with C10 = 1.2, C20 = -0.057, C30 = 0.004 MPa."""

COLUMNS = {
    "C10": SLOPE,
    "m0": STRETCH**0,
    "m1": STRETCH,
    "m2": STRETCH**2,
    "C01": 2 * (1 - STRETCH**-3),
    "C20": 2 * X * SLOPE,
    "C30": 3 * X**2 * SLOPE,
}
"""Stress of each linear parameter when it is one."""

BOUNDS = {
    **dict.fromkeys(("m0", "m1", "m2", "C01", "C20", "C30"), (-50.0, 50.0)),
    "C10": (0.0, 10.0),
    "S": (0.0, 10.0),
    "c": (0.0, 1.0),
    "psi": (0.05, 10.0),
}

FORMULATIONS = {
    "none": ("C10",),
    "constant": ("C10", "m0", "S"),
    "linear": ("C10", "m0", "m1", "S"),
    "quadratic": ("C10", "m0", "m1", "m2", "S"),
    "mooney-rivlin": ("C10", "C01", "S"),
    "yeoh": ("C10", "C20", "C30", "S"),
    "gp": ("C10", "c", "psi"),
}
"""The parameters of each formulation of model uncertainty, C10 first."""


@dataclass(frozen=True)
class Problem:
    """One formulation: stress ~ N(design @ linear parameters, (0.5^2 + S^2) I), or with a Gaussian process added."""

    name: str

    @cached_property
    def symbols(self) -> tuple[str, ...]:
        """The parameters, those in which the stress is linear first."""
        return FORMULATIONS[self.name]

    @cached_property
    def linear(self) -> tuple[str, ...]:
        """The parameters that belong to the columns of `design`."""
        return tuple(symbol for symbol in self.symbols if symbol in COLUMNS)

    @cached_property
    def design(self) -> Floats:
        """The (n, k) stresses of unit linear parameters."""
        return np.column_stack([COLUMNS[symbol] for symbol in self.linear])

    @cached_property
    def bounds(self) -> tuple[Floats, Floats]:
        """Lower and upper bounds of the uniform priors, (d,) each."""
        lower, upper = np.array([BOUNDS[symbol] for symbol in self.symbols]).T
        return lower, upper

    def from_cube(self, cube: Floats) -> Floats:
        """Return the (..., d) parameters at prior quantiles ``cube``."""
        lower, upper = self.bounds
        return lower + (upper - lower) * cube

    def log_prior(self, points: Floats) -> Floats:
        """Return the log prior density at (m, d) points; minus infinity outside the bounds."""
        lower, upper = self.bounds
        inside = ((points >= lower) & (points <= upper)).all(1)
        return np.where(inside, -np.log(upper - lower).sum(), -np.inf)

    def log_likelihood(self, points: Floats) -> Floats:
        """Return log p(stress | parameters) at (m, d) points."""
        k = len(self.linear)
        residual = STRESS - points[:, :k] @ self.design.T
        if self.name == "gp":
            return _correlated(residual, points[:, k], points[:, k + 1])
        variance = NOISE_SD**2 + (points[:, k] ** 2 if "S" in self.symbols else np.zeros(len(points)))
        return -0.5 * ((residual**2).sum(1) / variance + len(STRESS) * np.log(2 * pi * variance))


def _correlated(residual: Floats, c: Floats, psi: Floats) -> Floats:
    squares = (STRETCH[:, None] - STRETCH) ** 2
    process = (c**2)[:, None, None] * np.exp(-0.5 * squares / (psi**2)[:, None, None])
    root = np.linalg.cholesky(process + NOISE_SD**2 * np.eye(len(STRETCH)))
    whitened = np.linalg.solve(root, residual[:, :, None])[:, :, 0]
    log_root = np.log(np.diagonal(root, axis1=1, axis2=2)).sum(1)
    return -0.5 * ((whitened**2).sum(1) + len(STRESS) * log(2 * pi)) - log_root
