"""The linear parameters given the nonlinear ones: Gaussian, integrated in closed form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import log, pi

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import ConvergenceError
from tissuq.inference.box import Boxes
from tissuq.inference.reduction import Reducer, Reductions
from tissuq.model import StatisticalModel

__all__ = ["Conditional", "ConditionalGaussian"]

FloatArray = NDArray[np.float64]

AT_ONCE = 4_000_000
"""Variances computed at once: what bounds the memory."""


@dataclass(frozen=True, eq=False)
class Conditional:
    """What N settings h of the nonlinear parameters say about each of B data sets and p linear parameters.

    Attributes
    ----------
    log_likelihood : (B, N) array
        log of p(y | h), linear parameters integrated over their priors as if these had no bounds.
    mean : (B, N, p) array, MPa
        Mean of the linear parameters given y and h, before their bounds.
    root : (B, N, p, p) array, MPa
        A root of their covariance: covariance = root root'.
    """

    log_likelihood: FloatArray
    mean: FloatArray
    root: FloatArray


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
        self._log_prior_constant = constant.sum(axis=1)
        supports = np.array([[m.priors[s].support for s in m.linear] for m in self.models], dtype=np.float64)
        self.boxes = Boxes(*np.moveaxis(supports.reshape(len(models), -1, 2), 2, 0))

    def __call__(self, h: FloatArray) -> Conditional:
        """Evaluate at settings h (B, N, d) of the nonlinear parameters; all data sets share those of the structure."""
        distinct, group = _grouped(h[0, :, : len(self.model.structure)])
        reduced = self._reduce(distinct)
        moments, log_determinant = self._moments(reduced, group, h)
        p, each = len(self.model.linear), group if len(distinct) > 1 else slice(None)
        inverse, centre = reduced.inverse[each], reduced.centre[each].swapaxes(0, 1)
        fixed = [self.model.nonlinear.index(s) for s in self.model.column_symbols if s not in self.model.linear]
        rest = np.concatenate([-h[:, :, fixed], np.ones((*h.shape[:2], 1))], axis=2)
        offset, weight = self._prior_mean[:, None] - centre, self._prior_precision[:, None]
        precision = moments[..., :p, :p] + inverse.swapaxes(-1, -2) @ (weight[..., None] * inverse)
        pull = (moments[..., :p, p:] @ rest[..., None])[..., 0]
        pull += ((weight * offset)[..., None, :] @ inverse)[..., 0, :]
        misfit = (rest[..., None, :] @ moments[..., p:, p:] @ rest[..., None])[..., 0, 0]
        misfit += (weight * offset**2).sum(axis=2)
        try:
            cholesky = np.linalg.cholesky(precision)
        except np.linalg.LinAlgError as error:
            raise ConvergenceError(
                "the linear parameters cannot be integrated to working precision: the noise is too small beside the "
                "discrepancy. Give the noise, or narrower priors, or use the method 'nuts'."
            ) from error
        inverse_root = np.linalg.inv(cholesky)
        whitened = (inverse_root @ pull[..., None])[..., 0]
        root = inverse @ inverse_root.swapaxes(-1, -2)
        mean = centre + (root @ whitened[..., None])[..., 0]
        log_volume = -np.log(np.einsum("bnii->bni", cholesky)).sum(axis=2) - reduced.log_size[each]
        exponent = misfit - (whitened**2).sum(axis=2) + log_determinant
        constant = self._log_prior_constant[:, None] - 0.5 * (len(self.model.experiment) - p) * log(2 * pi)
        constant += self.model.log_whitening
        return Conditional(log_volume - 0.5 * exponent + constant, mean, root)

    def _moments(self, reduced: Reductions, group: NDArray[np.intp], h: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return D' V^-1 D for the data matrix D, and log |V|, for every setting; some settings at a time."""
        q, directions = len(self.model.column_symbols) + 1, reduced.counts.shape[1]
        moments, log_determinant = np.empty((*h.shape[:2], q * q)), np.empty(h.shape[:2])
        for block in np.array_split(np.arange(h.shape[1]), 1 + h.shape[1] * len(h) * directions // AT_ONCE):
            own = group[block]
            values = {symbol: h[:, block, place, None] for place, symbol in enumerate(self.model.nonlinear)}
            white = self.model.white_variance(values, reduced.levels[own])
            variances = white + self.model.correlated_variance(values) * reduced.values[own]
            variances = np.broadcast_to(variances, (len(h), len(block), directions))
            log_determinant[:, block] = (np.log(variances) * reduced.counts[own]).sum(axis=2)
            precisions = 1 / variances
            for index, squares in enumerate(reduced.squares):
                chosen = np.flatnonzero(own == index) if len(reduced.squares) > 1 else slice(None)
                moments[:, block[chosen]] = precisions[:, chosen] @ squares
        return moments.reshape(*h.shape[:2], q, q), log_determinant


def _grouped(settings: FloatArray) -> tuple[FloatArray, NDArray[np.intp]]:
    """Return the distinct rows of settings (N, s), and for every row which of them it is."""
    if not settings.shape[1]:
        return settings[:1], np.zeros(len(settings), dtype=np.intp)
    distinct, group = np.unique(settings, axis=0, return_inverse=True)
    return distinct, group.ravel()
