"""The linear parameters given the nonlinear ones: Gaussian, integrated in closed form for NumPy and JAX arrays.

Every model here is y = X b + e with e ~ N(0, V) once its nonlinear parameters are given. All that b, its evidence and
its predictions need of the data is the precision A = X' V^-1 X, the pull r = X' V^-1 y and the size q = y' V^-1 y, to
which a prior adds its own; then b ~ N(A^-1 r, A^-1), and q - r' A^-1 r is what b leaves unexplained. What differs
between the enumerators is only where the three come from: sums along directions in which errors are independent
(`tissuq.inference.reduction`), for every pair of amplitudes of an energy (`tissuq.inference.enumerators.lattice`), or
a dense factor that a sampler differentiates (`tissuq.inference.densities`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import log, pi
from typing import Any, NamedTuple

import numpy as np

from tissuq.arrays import FloatArray, IndexArray
from tissuq.errors import ConvergenceError
from tissuq.inference.box import Boxes
from tissuq.inference.reduction import BasesOf, Reducer, Reduction, Spectrum, bases_of
from tissuq.model.statistical_model import StatisticalModel

MAX_FEW_PARAMETERS = 4
"""Linear parameters up to which NumPy's functions for matrices cost more than the entries one by one."""
MAX_VARIANCES_AT_ONCE = 4_000_000
"""Variances computed at once: what bounds the memory."""


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
    if arrays is np and 0 < precision.shape[-1] <= MAX_FEW_PARAMETERS:
        return _few_integrated(precision, pull, size)
    triangle = arrays.linalg.cholesky(precision)
    root = arrays.linalg.inv(triangle).mT
    scores = root.mT @ pull
    log_volume = -arrays.log(triangle.diagonal(0, -2, -1)).sum(axis=-1)
    return Integrated(log_volume, size - (scores**2).sum(axis=-2), root, scores)


def _few_integrated(precision: FloatArray, pull: FloatArray, size: FloatArray) -> Integrated:
    """Return `integrated` of few parameters, entry by entry: for small matrices the library's overhead is most."""
    p = precision.shape[-1]
    triangle, inverse = dict[tuple[int, int], FloatArray](), dict[tuple[int, int], FloatArray]()
    log_volume, root = np.zeros(precision.shape[:-2]), np.zeros(precision.shape)
    for i in range(p):
        for j in range(i):
            partial_sum = sum(triangle[i, k] * triangle[j, k] for k in range(j))
            triangle[i, j] = (precision[..., i, j] - partial_sum) * inverse[j, j]
        square = precision[..., i, i] - sum(triangle[i, k] ** 2 for k in range(i))
        if (square <= 0).any():  # what is no number stays none, as with the library
            raise np.linalg.LinAlgError("the precision of the linear parameters is not positive")
        inverse[i, i] = root[..., i, i] = 1 / np.sqrt(square)
        log_volume -= 0.5 * np.log(square)
        for j in range(i):
            partial_sum = sum(triangle[i, k] * inverse[k, j] for k in range(j, i))
            inverse[i, j] = root[..., j, i] = -partial_sum * inverse[i, i]
    scores = [sum(inverse[i, k][..., None] * pull[..., k, :] for k in range(i + 1)) for i in range(p)]
    misfit = size - sum(score**2 for score in scores)
    return Integrated(log_volume, misfit, root, np.stack(scores, axis=-2))


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
    multipliers : (..., q - p) array
        Minus the values of those other parameters, and one: the data are [F, e] times this.
    prior : (mean, precision, log constant) of (..., p), (..., p) and (...) arrays
        Of the linear parameters; precision zero for flat and uniform ones.
    count : float
        Number of measurements.
    """
    p = fit.inverse.shape[-1]
    centre, precision, constant = prior
    pull = moments[..., :p, p:] @ multipliers[..., None]
    size = (multipliers[..., None, :] @ moments[..., p:, p:] @ multipliers[..., None])[..., 0]
    gaussian = integrated(moments[..., :p, :p], pull, size)
    root = fit.inverse @ gaussian.root
    mean = fit.centre + (root @ gaussian.scores)[..., 0]
    exponent = gaussian.misfit[..., 0] + log_determinant + (count - p) * log(2 * pi)
    log_likelihood = constant + gaussian.log_volume - fit.log_size - 0.5 * exponent
    for index in range(p):
        if isinstance(precision, np.ndarray) and not precision[..., index].any():
            continue
        mean, root, log_mass = _times_gaussian(mean, root, index, centre[..., index], precision[..., index])
        log_likelihood = log_likelihood + log_mass
    return Conditional(log_likelihood, mean, root)


class ConditionalGaussian:
    """p(y | h) and p(b | y, h) for y = X b + discrepancy + noise, over many data sets and many h at once.

    All models have the same parts and stretches; data, priors of linear parameters and nonlinear settings may differ.
    The work is done in the orthonormal basis of a QR factorisation of X, on the residual of a least-squares fit, so
    that neither the size of the stresses nor nearly dependent columns cost digits.
    """

    def __init__(self, models: Sequence[StatisticalModel], bases: BasesOf = bases_of) -> None:
        self.models = tuple(models)
        self.model = self.models[0]
        self._reduce = Reducer(self.models, bases)
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

    def _moments(self, reduced: Reduction, group: IndexArray, h: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return D' V^-1 D for the data matrix D, and log |V|, for every setting; some settings at a time."""
        q, directions = len(self.model.column_symbols) + 1, reduced.counts.shape[1]
        moments, log_determinant = np.empty((*h.shape[:2], q * q)), np.empty(h.shape[:2])
        blocks = 1 + h.shape[1] * len(h) * directions // MAX_VARIANCES_AT_ONCE
        for block in np.array_split(np.arange(h.shape[1]), blocks):
            groups = group[block]
            values = {symbol: h[:, block, column, None] for column, symbol in enumerate(self.model.nonlinear)}
            white = self.model.white_variance(values, reduced.levels[groups])
            variances = white + self.model.correlated_variance(values) * reduced.values[groups]
            variances = np.broadcast_to(variances, (len(h), len(block), directions))
            log_determinant[:, block] = (np.log(variances) * reduced.counts[groups]).sum(axis=2)
            precisions = 1 / variances
            if directions == 1:
                moments[:, block] = precisions * reduced.squares[groups, :, 0].swapaxes(0, 1)
                continue
            for index, squares in enumerate(reduced.squares):
                in_group = np.flatnonzero(groups == index) if len(reduced.squares) > 1 else slice(None)
                moments[:, block[in_group]] = precisions[:, in_group] @ squares
        return moments.reshape(*h.shape[:2], q, q), log_determinant


def _grouped(settings: FloatArray) -> tuple[FloatArray, IndexArray]:
    """Return the distinct rows of settings (N, s), and for every row which of them it is."""
    if not settings.shape[1]:
        return settings[:1], np.zeros(len(settings), dtype=np.intp)
    distinct, group = np.unique(settings, axis=0, return_inverse=True)
    return distinct, group.ravel()


class LinearPriors:
    """The priors of the parameters that a model integrates in closed form.

    Attributes
    ----------
    supports : (p, 2) array
    box : Boxes
        Their bounds (1, p).
    is_gaussian : bool
        Whether any of them is more than a bound.
    log_height : float
        Log of the product of the uniform densities.
    """

    def __init__(self, model: StatisticalModel) -> None:
        priors = [model.priors[symbol] for symbol in model.linear]
        self._forms = [prior.gaussian or (0.0, 0.0, 0.0) for prior in priors]
        self.supports = np.reshape([prior.support for prior in priors], (-1, 2))
        self.box = Boxes(self.supports[None, :, 0], self.supports[None, :, 1])
        self.is_gaussian = any(precision for _, precision, _ in self._forms)
        self.log_height = float(sum(height for _, precision, height in self._forms if not precision))

    def times(self, mean: FloatArray, root: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Multiply Gaussians of these parameters, and perhaps more, by the priors; flat, uniform ones change nothing.

        Parameters
        ----------
        mean, root : (M, q) and (M, q, q) arrays

        Returns
        -------
        Means (M, q), roots (M, q, q) and the logarithms (M,) of the masses.
        """
        log_mass = np.zeros(len(mean))
        for index, (centre, precision, log_height) in enumerate(self._forms):
            if not precision:
                continue
            mean, root, log_factor = _times_gaussian(mean, root, index, centre, precision)
            log_mass += log_height + log_factor
        return mean, root, log_mass

    def log_mass(self, mean: FloatArray, root: FloatArray) -> FloatArray:
        """Return the log mass (M,) of Gaussians (M, p) times all these priors but uniform densities, within bounds."""
        mean, root, log_mass = self.times(mean, root)
        return log_mass + self.box.repeated(len(mean)).log_mass(mean, root)[0]

    def strain(self, mean: FloatArray, root: FloatArray) -> FloatArray:
        """Return by how much (M,) the sum of squares of the data grows where the parameters obey their priors.

        At most, for means (M, p) and roots (M, p, p) of unit noise: one parameter after another is moved to the
        centre of its prior, or into its bounds.
        """
        variance = np.maximum((root**2).sum(axis=2), 1e-300)
        low, high = self.supports.T
        centre = [mean for mean, _, _ in self._forms]
        is_free = np.array([not precision for _, precision, _ in self._forms], dtype=bool)
        wanted = np.clip(np.where(is_free, mean, centre), low, high)
        return np.asarray(((mean - wanted) ** 2 / variance).sum(axis=1))


def _times_gaussian(mean: Any, root: Any, index: int, centre: Any, precision: Any) -> tuple[Any, Any, Any]:
    """Return means (..., q) and roots (..., q, q) times exp(-precision (b - centre)^2 / 2) of one parameter.

    And the logarithms (...) of the masses. No digits are lost, however narrow that is (Potter's square root).
    """
    arrays = root.__array_namespace__()
    along, miss = root[..., index, :], centre - mean[..., index]
    covariance = (root @ along[..., None])[..., 0]
    growth = 1 + precision * (along**2).sum(axis=-1)
    mean = mean + covariance * (precision * miss / growth)[..., None]
    shrink = precision / (growth + arrays.sqrt(growth))
    root = root - shrink[..., None, None] * covariance[..., :, None] * along[..., None, :]
    return mean, root, -0.5 * (arrays.log(growth) + precision * miss**2 / growth)
