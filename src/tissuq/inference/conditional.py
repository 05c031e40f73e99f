"""The linear parameters given the nonlinear ones: Gaussian, integrated in closed form."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import log, pi

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import ConvergenceError
from tissuq.inference.box import Box
from tissuq.inference.lowrank import correlation_spectrum
from tissuq.model import StatisticalModel
from tissuq.priors import Normal, Uniform

__all__ = ["Conditional", "ConditionalGaussian"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Conditional:
    """What N settings h of the nonlinear parameters say about data and p linear parameters.

    Attributes
    ----------
    log_likelihood : (N,) array
        log p(y | h), linear parameters integrated over their priors, bounds included.
    mean : (N, p) array, MPa
        Mean of the linear parameters given y and h, before their bounds.
    root : (N, p, p) array, MPa
        A root of their covariance: covariance = root root'.
    outside : (N,) array
        Upper bound on the Gaussian mass outside the bounds.
    """

    log_likelihood: FloatArray
    mean: FloatArray
    root: FloatArray
    outside: FloatArray


class ConditionalGaussian:
    """p(y | h) and p(b | y, h) for y = X b + discrepancy + noise, over many h at once.

    The work is done on the residual of a least-squares fit, in the orthonormal basis of a QR factorisation of X, so
    that neither the size of the stresses nor nearly dependent columns cost digits; a correlated discrepancy
    enters by the spectrum of its correlation, which is factorised once for every correlation length.
    """

    def __init__(self, model: StatisticalModel) -> None:
        self.model = model
        columns = list(model.column_symbols)
        free = [columns.index(symbol) for symbol in model.linear]
        fixed = [columns.index(symbol) for symbol in columns if symbol not in model.linear]
        self._fixed_places = [model.nonlinear.index(columns[place]) for place in fixed]
        self._orthonormal, self._triangle = np.linalg.qr(model.design[:, free])
        self._inverse = np.linalg.inv(self._triangle)
        self._centre = self._inverse @ (self._orthonormal.T @ model.experiment.stress)
        residual = model.experiment.stress - model.design[:, free] @ self._centre
        self._data = np.column_stack([self._orthonormal, model.design[:, fixed], residual])

    @cached_property
    def box(self) -> Box:
        """The bounds of the linear parameters."""
        supports = [self.model.priors[symbol].support for symbol in self.model.linear]
        return Box(*np.array(supports).reshape(-1, 2).T)

    def __call__(self, h: FloatArray) -> Conditional:
        """Evaluate at settings h (N, d) of the nonlinear parameters."""
        values = dict(zip(self.model.nonlinear, h.T, strict=True))
        moments, log_determinant = self._moments(values, len(h))
        p = len(self.model.linear)
        rest = np.hstack([-h[:, self._fixed_places], np.ones((len(h), 1))])
        precision = moments[:, :p, :p] + self._prior_precision
        pull = np.einsum("nij,nj->ni", moments[:, :p, p:], rest) + self._prior_pull
        misfit = np.einsum("ni,nij,nj->n", rest, moments[:, p:, p:], rest) + self._prior_misfit
        try:
            cholesky = np.linalg.cholesky(precision)
        except np.linalg.LinAlgError as error:
            raise ConvergenceError(
                "the linear parameters cannot be integrated to working precision: the noise is too small beside the "
                "discrepancy. Give the noise, or narrower priors, or use the sampler 'nuts'."
            ) from error
        inverse_root = np.linalg.inv(cholesky)
        whitened = np.einsum("nij,nj->ni", inverse_root, pull)
        root = self._inverse @ inverse_root.swapaxes(1, 2)
        mean = self._centre + np.einsum("nij,nj->ni", root, whitened)
        log_volume = -np.log(np.einsum("nii->ni", cholesky)).sum(1) - np.log(np.abs(np.diag(self._triangle))).sum()
        exponent = misfit - (whitened**2).sum(1) + log_determinant
        n = len(self.model.experiment)
        log_likelihood = -0.5 * (exponent + (n - p) * log(2 * pi)) + log_volume + self._log_prior_constant
        outside, log_inside = self.box.mass(mean, root)
        return Conditional(log_likelihood + log_inside, mean, root, outside)

    def _moments(self, values: dict[str, FloatArray], count: int) -> tuple[FloatArray, FloatArray]:
        """Return D' V^-1 D for the data matrix D, and log |V|, for every setting."""
        white = np.broadcast_to(self.model.white_variance(values), (count,)).astype(float)
        if not self.model.discrepancy.is_correlated:
            gram = self._data.T @ self._data
            return gram / white[:, None, None], len(self._data) * np.log(white)
        moments = np.empty((count, self._data.shape[1], self._data.shape[1]))
        log_determinant = np.empty(count)
        correlated = np.broadcast_to(self.model.discrepancy.correlated_variance(values), (count,))
        shapes = np.column_stack([values[symbol] for symbol in self.model.discrepancy.shape_symbols])
        distinct, group = np.unique(shapes, axis=0, return_inverse=True)
        for index, shape in enumerate(distinct):
            chosen = np.flatnonzero(group.ravel() == index)
            moments[chosen], log_determinant[chosen] = self._correlated_moments(
                tuple(map(float, shape)), white[chosen], correlated[chosen]
            )
        return moments, log_determinant

    def _correlated_moments(
        self, shape: tuple[float, ...], white: FloatArray, correlated: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        factor = correlation_spectrum(self.model.discrepancy, self.model.experiment.stretch, shape)
        inside = factor.vectors.T @ self._data
        outside = self._data - factor.vectors @ inside
        squares = (inside[:, :, None] * inside[:, None, :]).reshape(len(inside), inside.shape[1] ** 2)
        variances = white[:, None] + correlated[:, None] * factor.values
        gram = outside.T @ outside
        moments = ((1 / variances) @ squares).reshape(-1, *gram.shape) + gram / white[:, None, None]
        n, rank = factor.vectors.shape
        return moments, (n - rank) * np.log(white) + np.log(variances).sum(1)

    @cached_property
    def _gaussian(self) -> tuple[FloatArray, FloatArray]:
        """Means and precisions of the Gaussian priors; precision zero where the prior is uniform."""
        priors = [self.model.priors[symbol] for symbol in self.model.linear]
        means = np.array([prior.mean if isinstance(prior, Normal) else 0.0 for prior in priors])
        precisions = np.array([prior.sd**-2 if isinstance(prior, Normal) else 0.0 for prior in priors])
        return means, precisions

    @cached_property
    def _prior_precision(self) -> FloatArray:
        return self._inverse.T @ (self._gaussian[1][:, None] * self._inverse)

    @cached_property
    def _prior_pull(self) -> FloatArray:
        means, precisions = self._gaussian
        return np.asarray(self._inverse.T @ (precisions * (means - self._centre)))

    @cached_property
    def _prior_misfit(self) -> float:
        means, precisions = self._gaussian
        return float(precisions @ (means - self._centre) ** 2)

    @cached_property
    def _log_prior_constant(self) -> float:
        """Log of the priors' normalising constants."""
        constant = 0.0
        for symbol in self.model.linear:
            prior = self.model.priors[symbol]
            if isinstance(prior, Uniform):
                constant -= log(prior.high - prior.low)
            elif isinstance(prior, Normal):
                constant -= prior.log_size
        return constant
