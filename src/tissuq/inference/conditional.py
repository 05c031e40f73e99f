"""The linear parameters given the nonlinear ones: Gaussian, integrated in closed form."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import ConvergenceError
from tissuq.inference.algebra import Conditional, Fit, condition
from tissuq.inference.box import Boxes
from tissuq.inference.reduction import Reducer, Reductions
from tissuq.model.statistical_model import StatisticalModel

__all__ = ["ConditionalGaussian"]

FloatArray = NDArray[np.float64]

AT_ONCE = 4_000_000
"""Variances computed at once: what bounds the memory."""


class ConditionalGaussian:
    """p(y | h) and p(b | y, h) for y = X b + discrepancy + noise, over many data sets and many h at once.

    All models have the same parts and stretches; data, priors of linear parameters and nonlinear settings may differ.
    The work is done in the orthonormal basis of a QR factorisation of X, on the residual of a least-squares fit, so
    that neither the size of the stresses nor nearly dependent columns cost digits.
    """

    def __init__(self, models: Sequence[StatisticalModel]) -> None:
        self.models = tuple(models)
        self.model = self.models[0]
        self._reduce = Reducer(self.models)
        gaussians = np.array([[m.priors[s].gaussian for s in m.linear] for m in self.models], dtype=np.float64)
        self._prior_mean, self._prior_precision, constant = np.moveaxis(gaussians.reshape(len(models), -1, 3), 2, 0)
        self._log_constant = constant.sum(axis=1) + self.model.log_whitening
        supports = np.array([[m.priors[s].support for s in m.linear] for m in self.models], dtype=np.float64)
        self.boxes = Boxes(*np.moveaxis(supports.reshape(len(models), -1, 2), 2, 0))

    def __call__(self, h: FloatArray) -> Conditional:
        """Evaluate at settings h (B, N, d) of the nonlinear parameters; all data sets share those of the structure."""
        distinct, group = _grouped(h[0, :, : len(self.model.structure)])
        reduced = self._reduce(distinct)
        moments, log_determinant = self._moments(reduced, group, h)
        group_of_setting = group if len(distinct) > 1 else slice(None)
        fit = Fit(
            reduced.inverse[group_of_setting],
            reduced.log_size[group_of_setting],
            reduced.centre[group_of_setting].swapaxes(0, 1),
        )
        fixed = [self.model.nonlinear.index(s) for s in self.model.column_symbols if s not in self.model.linear]
        multipliers = np.concatenate([-h[:, :, fixed], np.ones((*h.shape[:2], 1))], axis=2)
        prior = self._prior_mean[:, None], self._prior_precision[:, None], self._log_constant[:, None]
        try:
            return condition(moments, log_determinant, fit, multipliers, prior, self.model.experiment.size)
        except np.linalg.LinAlgError as error:
            raise ConvergenceError(
                "the linear parameters cannot be integrated to working precision: the noise is too small beside the "
                "discrepancy. Give the noise, or narrower priors, or use the method 'nuts'."
            ) from error

    def _moments(self, reduced: Reductions, group: NDArray[np.intp], h: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return D' V^-1 D for the data matrix D, and log |V|, for every setting; some settings at a time."""
        q, directions = len(self.model.column_symbols) + 1, reduced.counts.shape[1]
        moments, log_determinant = np.empty((*h.shape[:2], q * q)), np.empty(h.shape[:2])
        for block in np.array_split(np.arange(h.shape[1]), 1 + h.shape[1] * len(h) * directions // AT_ONCE):
            groups = group[block]
            values = {symbol: h[:, block, column, None] for column, symbol in enumerate(self.model.nonlinear)}
            white = self.model.white_variance(values, reduced.levels[groups])
            variances = white + self.model.correlated_variance(values) * reduced.values[groups]
            variances = np.broadcast_to(variances, (len(h), len(block), directions))
            log_determinant[:, block] = (np.log(variances) * reduced.counts[groups]).sum(axis=2)
            precisions = 1 / variances
            for index, squares in enumerate(reduced.squares):
                in_group = np.flatnonzero(groups == index) if len(reduced.squares) > 1 else slice(None)
                moments[:, block[in_group]] = precisions[:, in_group] @ squares
        return moments.reshape(*h.shape[:2], q, q), log_determinant


def _grouped(settings: FloatArray) -> tuple[FloatArray, NDArray[np.intp]]:
    """Return the distinct rows of settings (N, s), and for every row which of them it is."""
    if not settings.shape[1]:
        return settings[:1], np.zeros(len(settings), dtype=np.intp)
    distinct, group = np.unique(settings, axis=0, return_inverse=True)
    return distinct, group.ravel()
