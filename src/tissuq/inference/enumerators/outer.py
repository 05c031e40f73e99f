"""The parameters that no closed form and no lattice integrates, under an energy discrepancy: exponents, noise_share."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tissuq.arrays import FloatArray, IndexArray
from tissuq.inference.enumerators.lattice import Rows
from tissuq.inference.enumerators.line import Line
from tissuq.inference.marginal import Marginal, marginal_of_table
from tissuq.inference.quasi_monte_carlo import log_normal
from tissuq.model.scales import at_scores
from tissuq.model.statistical_model import StatisticalModel

LOG_RATIO_SD = 3.0
"""Standard deviation of the log of a ratio of noise parameters, in the coordinate that proposes it."""
TINY = 1e-300
"""The smallest number of which there is a logarithm."""


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

    def settings(self, points: FloatArray) -> FloatArray:
        """Return the values (N, d) at points (N, d); ratios in place of the noise's parameters."""
        quantiles = at_scores([self._model.priors[symbol] for symbol in self.symbols], points)
        return np.where(self.of_noise, np.exp(self._middle + LOG_RATIO_SD * points), quantiles)

    def log_base(self, point: FloatArray) -> float:
        """Return the log density of the priors in the coordinates at a point (d,); of ratios, that of the measure."""
        log_density = log_normal(point[None, ~self.of_noise])[0]
        return float(log_density + (self._middle + LOG_RATIO_SD * point + np.log(LOG_RATIO_SD))[self.of_noise].sum())

    def marginal(self, places: FloatArray, widths: FloatArray, shares: FloatArray) -> Marginal:
        """Return the marginal of the one parameter, no ratio, from places (K,) with shares, which stand for widths."""
        from scipy.special import ndtr

        points, density, _ = Line(places, np.log(np.maximum(shares / widths, TINY))).distribution
        values = self._model.priors[self.symbols[0]].quantile(ndtr(points))
        is_new = np.concatenate([[True], np.diff(values) > 0])
        values, points, density = values[is_new], points[is_new], density[is_new]
        return marginal_of_table(values, density * np.gradient(points) / np.gradient(values))

    def ratios(self, settings: FloatArray) -> dict[str, float]:
        """Return those of the noise's parameters to noise_sd, by symbol."""
        pairs = zip(self.symbols, settings, self.of_noise, strict=True)
        return {symbol: float(value) for symbol, value, of_noise in pairs if of_noise}

    def alike(self, settings: FloatArray, count: int) -> Iterator[IndexArray]:
        """Yield the rows of settings (N, d), so many at once at the most, of which the relative noise is the same."""
        count = 1 if self.of_noise.any() else count
        return iter(np.split(np.arange(len(settings)), range(count, len(settings), count)))

    def rows(self, settings: FloatArray) -> Rows:
        """Return the measurements with these parameters given, (D, d), of which the relative noise is the same."""
        model = self._model
        values = dict(zip(self.symbols, settings.T, strict=True))
        of_noise = {symbol: float(values[symbol][0]) for symbol in np.array(self.symbols)[self.of_noise]}
        scale = np.asarray(model.noise.sd(of_noise | {"noise_sd": 1.0}, model.levels)) if of_noise else 1.0
        scale = np.broadcast_to(scale, len(model.stress)).astype(float)
        bent = [values[symbol] for symbol in model.bent_symbols]
        basis = (
            model.designs_at(np.column_stack(bent)) if bent else np.repeat(model.design[None], len(settings), axis=0)
        )
        is_linear = np.isin(model.column_symbols, model.linear)
        fixed = [values[symbol] for symbol in np.array(model.column_symbols)[~is_linear]]
        stresses = np.repeat(model.stress[None, :, None], len(settings), axis=0)
        if fixed:
            stresses = stresses - basis[:, :, ~is_linear] @ np.column_stack(fixed)[:, :, None]
        return Rows(basis[:, :, is_linear] / scale[:, None], stresses / scale[:, None], scale, model.experiment.size)
