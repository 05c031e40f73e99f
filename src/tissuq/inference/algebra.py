"""Linear parameters with a Gaussian prior, integrated in closed form: one algebra for NumPy and JAX arrays.

Every model here is y = X b + e with e ~ N(0, V) once its nonlinear parameters are given. All that b, its evidence and
its predictions need of the data is the precision A = X' V^-1 X, the pull r = X' V^-1 y and the size q = y' V^-1 y, to
which a prior adds its own; then b ~ N(A^-1 r, A^-1), and q - r' A^-1 r is what b leaves unexplained. What differs
between the enumerators is only where the three come from: sums along directions in which errors are independent
(`tissuq.inference.reduction`), for every pair of amplitudes of an energy (`tissuq.inference.enumerators.lattice`), or
a dense factor that a sampler differentiates (`tissuq.inference.densities`).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log, pi
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tissuq.inference.lowrank import Spectrum

__all__ = ["Conditional", "Fit", "Integrated", "SpectralCovariance", "condition", "integrated"]

FloatArray = NDArray[np.float64]


class Integrated(NamedTuple):
    """Gaussians exp(-(b' A b - 2 r' b + q) / 2) of linear parameters, integrated, for k data sets of one A.

    Attributes
    ----------
    log_volume : (...) array
        Log of |A|^-1/2: half the log determinant of the covariance.
    misfit : (..., k) array
        q - r' A^-1 r.
    root : (..., p, p) array
        A root of A^-1: covariance = root root'.
    scores : (..., p, k) array
        root' r, so that the means A^-1 r are root times them.
    """

    log_volume: Any
    misfit: Any
    root: Any
    scores: Any


class Fit(NamedTuple):
    """A least-squares fit in whose orthonormal basis the algebra is done, so that no digits are lost.

    Attributes
    ----------
    inverse : (..., p, p) array
        Inverse of the triangle that turns the basis into the linear columns.
    log_size : (...) array
        Log of the absolute determinant of that triangle.
    centre : (..., p) array
        The fit.
    """

    inverse: Any
    log_size: Any
    centre: Any


class Conditional(NamedTuple):
    """What nonlinear parameters say about data and p linear parameters, for any number of settings and data sets.

    Attributes
    ----------
    log_likelihood : (...) array
        log of p(y | h), linear parameters integrated over their priors as if these had no bounds.
    mean : (..., p) array, MPa
        Mean of the linear parameters given y and h, before their bounds.
    root : (..., p, p) array, MPa
        A root of their covariance: covariance = root root'.
    """

    log_likelihood: Any
    mean: Any
    root: Any


@dataclass(frozen=True, eq=False)
class SpectralCovariance:
    """N covariances of n errors, of one structure: V = D (white I + amplitude U diag(values) U') D, D = diag(size).

    Factorised once, by the spectrum of a correlation, for all sizes that its white and its correlated part may have.

    Attributes
    ----------
    spectrum : Spectrum
        U (n, r), orthonormal, and values (r,).
    size : (n,) array
    amplitude, white : (N,) arrays
        Variances.
    """

    spectrum: Spectrum
    size: FloatArray
    amplitude: FloatArray
    white: FloatArray

    @property
    def correlated(self) -> FloatArray:
        """Variances (N, r) of the correlated part along the eigenvectors."""
        return self.amplitude[:, None] * self.spectrum.values

    def solved(self, columns: FloatArray) -> FloatArray:
        """Return the inverses of the covariances times columns (N, n, q)."""
        vectors, size = self.spectrum.vectors, self.size[:, None]
        scaled, white = columns / size, self.white[:, None, None]
        inside = vectors.T @ scaled
        return np.asarray(
            (vectors @ (inside / (self.correlated[..., None] + white) - inside / white) + scaled / white) / size
        )

    @property
    def precision(self) -> FloatArray:
        """The diagonals (N, n) of the inverses of the covariances."""
        squares, white = self.spectrum.vectors**2, self.white[:, None]
        outside = np.maximum(1 - squares.sum(axis=1), 0.0)
        return np.asarray(((1 / (self.correlated + white)) @ squares.T + outside / white) / self.size**2)

    @property
    def log_determinant(self) -> FloatArray:
        """Log determinants (N,) of the covariances."""
        n, r = self.spectrum.vectors.shape
        inside = np.log(self.correlated + self.white[:, None]).sum(axis=1)
        return np.asarray(inside + (n - r) * np.log(self.white) + 2 * np.log(self.size).sum())


def integrated(precision: Any, pull: Any, size: Any) -> Integrated:
    """Integrate linear parameters, given A (..., p, p), r (..., p, k) and q (..., k).

    Raises
    ------
    numpy.linalg.LinAlgError
        When A is not positive to working precision; JAX gives nan instead.
    """
    arrays = precision.__array_namespace__()
    triangle = arrays.linalg.cholesky(precision)
    root = arrays.linalg.inv(triangle).mT
    scores = root.mT @ pull
    log_volume = -arrays.log(triangle.diagonal(0, -2, -1)).sum(axis=-1)
    return Integrated(log_volume, size - (scores**2).sum(axis=-2), root, scores)


def condition(
    moments: Any, log_determinant: Any, fit: Fit, multipliers: Any, prior: tuple[Any, Any, Any], count: float
) -> Conditional:
    """Return density, mean and root of linear parameters with Gaussian priors, given the covariance of the data.

    Parameters
    ----------
    moments : (..., q, q) array
        D' V^-1 D of the data matrix D = [Q, F, e]: the orthonormal basis of the p linear columns, the columns of
        parameters that are linear but have another prior, and the residual of least squares.
    log_determinant : (...) array
        log |V|.
    fit : Fit
    others : (..., q - p) array
        Minus the values of those other parameters, and one: the data are [F, e] times this.
    prior : (mean, precision, log constant) of (..., p), (..., p) and (...) arrays
        Of the linear parameters; precision zero for flat and uniform ones.
    count : float
        Number of measurements.
    """
    p = fit.inverse.shape[-1]
    mean, weight, constant = prior
    offset = mean - fit.centre
    precision = moments[..., :p, :p] + fit.inverse.mT @ (weight[..., None] * fit.inverse)
    pull = moments[..., :p, p:] @ multipliers[..., None] + fit.inverse.mT @ (weight * offset)[..., None]
    size = (multipliers[..., None, :] @ moments[..., p:, p:] @ multipliers[..., None])[..., 0]
    gaussian = integrated(precision, pull, size + (weight * offset**2).sum(axis=-1)[..., None])
    exponent = gaussian.misfit[..., 0] + log_determinant + (count - p) * log(2 * pi)
    log_likelihood = constant + gaussian.log_volume - fit.log_size - 0.5 * exponent
    root = fit.inverse @ gaussian.root
    return Conditional(log_likelihood, fit.centre + (root @ gaussian.scores)[..., 0], root)
