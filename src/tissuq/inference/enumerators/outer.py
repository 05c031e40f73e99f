"""The parameters that no closed form and no lattice integrates, under an energy discrepancy: exponents, noise_share."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import ConvergenceError
from tissuq.inference.enumerators.importance import adapted, effective, log_normal
from tissuq.inference.enumerators.lattice import Rows
from tissuq.inference.kronecker import even_points
from tissuq.model.statistical_model import StatisticalModel

__all__ = ["Outer", "plain_rows", "weighted_settings"]

FloatArray = NDArray[np.float64]

VALUES, LEAST_EFFECTIVE = 64, 20
"""Values taken for each of the parameters, and once more; how many must be effective."""
FARTHEST = 8.0
"""Standard deviations beyond which probabilities round to one."""
RATIO_SPREAD = 3.0
"""Standard deviation of the log of a ratio of noise parameters, in the coordinate that proposes it."""


def plain_rows(models: Sequence[StatisticalModel]) -> Rows:
    """Return the rows of models on the same stretches in which everything is linear or on a lattice."""
    stresses = np.array([model.stress for model in models]).T
    return Rows(models[0].design, stresses, np.ones(len(stresses)), models[0].experiment.size)


class Outer:
    """Those parameters of a model, in coordinates that are standard normal under their priors, or near that.

    A parameter of the noise beside noise_sd enters by its ratio to noise_sd: given the ratio, the noise of all
    measurements is in proportion to noise_sd.

    Attributes
    ----------
    symbols : tuple of str
    of_noise : (d,) array
        Which of them belong to the noise.
    """

    def __init__(self, model: StatisticalModel) -> None:
        self._model = model
        inner = (*model.energy_symbols, "noise_sd")
        self.symbols = tuple(symbol for symbol in model.nonlinear if symbol not in inner)
        self.of_noise = np.isin(self.symbols, [p.symbol for p in model.noise.parameters])
        self._middle = -np.log(np.median(model.levels)) if self.of_noise.any() else 0.0

    def settings(self, point: FloatArray) -> FloatArray:
        """Return the values (d,) at a point (d,); ratios in place of the noise's parameters."""
        from scipy.special import ndtr

        probability = ndtr(np.clip(point, -FARTHEST, FARTHEST))
        quantiles = [
            float(self._model.priors[symbol].quantile(p)) for symbol, p in zip(self.symbols, probability, strict=True)
        ]
        return np.where(self.of_noise, np.exp(self._middle + RATIO_SPREAD * point), quantiles)

    def log_base(self, point: FloatArray) -> float:
        """Return the log density of the priors in the coordinates at a point (d,); of ratios, that of the measure."""
        log_density = log_normal(point[None, ~self.of_noise])[0]
        return float(log_density + (self._middle + RATIO_SPREAD * point + np.log(RATIO_SPREAD))[self.of_noise].sum())

    def ratios(self, settings: FloatArray) -> dict[str, float]:
        """Return those of the noise's parameters to noise_sd, by symbol."""
        pairs = zip(self.symbols, settings, self.of_noise, strict=True)
        return {symbol: float(value) for symbol, value, of_noise in pairs if of_noise}

    def rows(self, settings: FloatArray) -> Rows:
        """Return the measurements with these parameters given."""
        model = self._model
        values = dict(zip(self.symbols, map(float, settings), strict=True))
        scale = np.asarray(model.noise.sd(values | {"noise_sd": 1.0}, model.levels)) if self.of_noise.any() else 1.0
        scale = np.broadcast_to(scale, len(model.stress)).astype(float)
        bent = [values[symbol] for symbol in model.bent_symbols]
        basis = model.design_at(bent) if bent else model.design
        is_linear = np.isin(model.column_symbols, model.linear)
        known_stress = basis[:, ~is_linear] @ [values[symbol] for symbol in np.array(model.column_symbols)[~is_linear]]
        stresses = (model.stress - known_stress) / scale
        return Rows(basis[:, is_linear] / scale[:, None], stresses[:, None], scale, model.experiment.size)


def weighted_settings(outer: Outer, scout: Callable[[FloatArray], float]) -> tuple[FloatArray, FloatArray]:
    """Return values (K, d) of the outer parameters, and the log of prior over proposal (K,) at each, over K.

    Parameters
    ----------
    outer : Outer
    scout : callable
        Log of the likelihood at values (d,), roughly: where it leads is where values are taken.

    Raises
    ------
    ConvergenceError
        When that is far outside the priors.
    """
    d = len(outer.symbols)

    def log_density(points: FloatArray) -> FloatArray:
        return np.array([scout(outer.settings(point)) + outer.log_base(point) for point in points])

    proposal = adapted(log_density, d)
    far = [symbol for symbol, score in zip(outer.symbols, np.abs(proposal.mean), strict=True) if score > FARTHEST - 1]
    if far:
        raise ConvergenceError(
            f"the data put {', '.join(far)} where the prior leaves next to nothing (less than 1e-12): give a prior "
            "that holds what the data say, in MPa where it is a stress."
        )
    points = proposal.points(even_points(d, VALUES * (d + 1)))
    base = np.array([outer.log_base(point) for point in points])
    settings = np.array([outer.settings(point) for point in points])
    return settings, base - proposal.log_density(points) - np.log(len(points))


def relative_error(outer: Outer, log_masses: FloatArray) -> float:
    """Return the relative error of a sum of independent masses, given their logarithms (K,).

    Raises
    ------
    ConvergenceError
        When few of them hold nearly everything.
    """
    count = effective(log_masses)
    if count < LEAST_EFFECTIVE:
        raise ConvergenceError(
            f"the posterior of {', '.join(outer.symbols)} was not found well enough to integrate the discrepancy: "
            f"{count:.0f} of {len(log_masses)} values are effective. Give these parameters narrower priors, or choose "
            "a material with fewer of them."
        )
    return float(np.sqrt(1 / count - 1 / len(log_masses)))
