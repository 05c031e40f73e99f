"""The coordinates in which a population is Gaussian: logarithms of what is positive, the rest in its typical size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tissuq.posterior import Posterior

__all__ = ["Coordinates", "coordinates_of"]

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Coordinates:
    """The map from the pooled parameters to a line on which specimens are Gaussian.

    A parameter that can only be positive is its logarithm: between specimens moduli differ by factors. One that may
    have either sign (C20, C01, an exponent) has no logarithm; it is divided by its typical size and otherwise left as
    it is, so that the population's spread is then an absolute one.

    Attributes
    ----------
    symbols : tuple of str
        The pooled parameters.
    is_log : (d,) array of bool
    scale : (d,) array
        What one unit of the line is, for parameters that are no logarithms; one for the others.
    centre : (d,) array
        The place on the line from which it is counted: the middle of the specimens.
    """

    symbols: tuple[str, ...]
    is_log: BoolArray
    scale: FloatArray
    centre: FloatArray

    def to_line(self, values: FloatArray) -> FloatArray:
        """Return places (..., d) on the line for parameters (..., d); minus infinity for a modulus of zero."""
        with np.errstate(divide="ignore"):
            logs = np.log(np.where(self.is_log, np.maximum(values, 0.0), 1.0))
        return np.asarray(np.where(self.is_log, logs, values / self.scale) - self.centre)

    def from_line(self, places: FloatArray) -> FloatArray:
        """Return parameters (..., d) for places (..., d) on the line."""
        line = places + self.centre
        return np.asarray(np.where(self.is_log, np.exp(np.where(self.is_log, line, 0.0)), line * self.scale))


def coordinates_of(posteriors: Sequence[Posterior], symbols: Sequence[str]) -> Coordinates:
    """Return the coordinates of pooled parameters, their middle and typical size told by the specimens' own fits."""
    parameters = {parameter.symbol: parameter for parameter in posteriors[0].model.material.parameters}
    is_log = np.array([parameters[s].support[0] >= 0 and np.isinf(parameters[s].support[1]) for s in symbols])
    medians = np.array([[float(p.marginals[s].quantile(0.5)) for s in symbols] for p in posteriors])
    sizes = np.array([[np.hypot(p.marginals[s].mean, p.marginals[s].sd) for s in symbols] for p in posteriors])
    scale = np.where(is_log, 1.0, np.median(sizes, axis=0))
    start = Coordinates(tuple(symbols), is_log, scale, np.zeros(len(symbols)))
    return Coordinates(tuple(symbols), is_log, scale, np.median(start.to_line(medians), axis=0))
