"""One energy discrepancy on one design: the linear parameters given the ratios of its amplitudes to the noise.

What costs most, a decomposition of the block with fewer terms for each ratio of the other, depends on the stretches
alone: it serves all data sets and all exponents of the material. The ratio of the decomposed block and the noise enter
by sums over few directions.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import log, pi
from typing import NamedTuple

import numpy as np

from tissuq.arrays import FloatArray, IndexArray
from tissuq.inference.linear import integrated
from tissuq.model.discrepancy import Member, side_by_side

LOG_RATIO_STEP = 0.4
"""Of log g. The posterior of an amplitude that r directions tell has an sd of about 1 / sqrt(2 r) in its logarithm."""
MIN_STRESS_RATIO, MAX_STRESS_RATIO = 1e-3, 1e6
"""Ratios of the discrepancy's stress (root mean square) to the noise between which the lattice lies, at least."""
FACTORS_AT_ONCE = 8
"""Variances that are multiplied before the logarithm is taken: a product that cannot overflow."""


@dataclass(frozen=True, eq=False)
class Rows:
    """Measurements over their relative noise, with everything given but linear parameters, amplitudes and noise_sd.

    Of D designs, which differ by the exponents of the material, with as many data sets each: B = D k in all.

    Attributes
    ----------
    design : (D, n, p) array
        Stresses of unit linear parameters.
    stresses : (D, n, k) array
        Of the data sets.
    scale : (n,) array
        Noise of every measurement over noise_sd; stresses are divided by it already.
    count : int
        How many measurements the rows stand for, n unless these are condensed.
    """

    design: FloatArray
    stresses: FloatArray
    scale: FloatArray
    count: int

    @cached_property
    def fit(self) -> LeastSquares:
        """The least-squares fits of the linear parameters, the same for all members."""
        basis, triangle = np.linalg.qr(self.design)
        centre = basis.swapaxes(1, 2) @ self.stresses
        log_size = np.log(np.abs(np.diagonal(triangle, 0, 1, 2))).sum(axis=1) + np.log(self.scale).sum()
        columns = np.concatenate([basis, self.stresses - basis @ centre], axis=2)
        return LeastSquares(np.linalg.inv(triangle), centre, columns, log_size)


class LeastSquares(NamedTuple):
    """Fits of p linear parameters to the data sets, in an orthonormal basis of the stresses of each design.

    Attributes
    ----------
    inverse : (D, p, p) array
        Inverse of the triangle that turns the basis into the stresses of unit parameters.
    centre : (D, p, k) array
        The fits, in that basis.
    columns : (D, n, p + k) array
        The basis, and what the fit leaves of the data.
    log_size : (D,) array
        Log of the determinants of the triangle and of the scale of the noise.
    """

    inverse: FloatArray
    centre: FloatArray
    columns: FloatArray
    log_size: FloatArray

    @property
    def left(self) -> FloatArray:
        """What is left of the data sets, (D, n, k)."""
        return self.columns[:, :, self.inverse.shape[1] :]


class Reduced:
    """The rows of some designs and the features of one member, as QR triangles.

    Parameters
    ----------
    rows : Rows
        With one data set a design.
    features : list of (n, r) arrays
        The stresses of each block's terms at the measurements.
    """

    def __init__(self, rows: Rows, features: list[FloatArray]) -> None:
        self._parameters = rows.design.shape[2]
        self._sizes = [block.shape[1] for block in features]
        blocks = side_by_side([block / rows.scale[:, None] for block in features], len(rows.scale))
        blocks = np.broadcast_to(blocks, (len(rows.design), *blocks.shape))
        basis, self._triangle = np.linalg.qr(np.concatenate([rows.design, blocks], axis=2))
        self._data = (basis.swapaxes(1, 2) @ rows.stresses)[:, :, 0]

    def linear_and_weights(
        self, designs: IndexArray, amplitudes: FloatArray, noise_sd: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return means (M, q) and roots (M, q, q) of the material's parameters and the discrepancy's weights.

        For any of the designs (M,), amplitudes (M, blocks) and noise (M,).
        """
        p, k, q = self._parameters, self._triangle.shape[1], self._parameters + sum(self._sizes)
        scale = np.ones((len(noise_sd), q))
        scale[:, p:] = np.repeat(amplitudes, self._sizes, axis=1)
        rows = np.zeros((len(noise_sd), k + q - p, q + 1))
        rows[:, :k, :q] = self._triangle[designs] * (scale / noise_sd[:, None])[:, None]
        rows[:, :k, q] = self._data[designs] / noise_sd[:, None]
        rows[:, k:, p:q] = np.eye(q - p)
        triangle = np.asarray(np.linalg.qr(rows, mode="r"), dtype=np.float64)
        root = np.asarray(np.linalg.inv(triangle[:, :q, :q]), dtype=np.float64)
        mean = (root @ triangle[:, :q, q:])[:, :, 0]
        return mean * scale, root * scale[:, :, None]


class Directions:
    """One member on one design: directions in which its errors are independent, for every pair of ratios.

    Parameters
    ----------
    member : Member
    scale : (n,) array
        Noise of every measurement over noise_sd.
    features : list of (n, r) arrays
        The stresses of each block's terms at the measurements.
    count : int
        How many measurements the rows stand for.
    negligible_stress : float
        A stress that counts as that of a block without stress in this mode.
    unlikely : list of float
        For each block, a ratio g = c / noise_sd below which it is not likely to be before the data.
    step, shift : float
        Of log g: between points of the lattice, and from where it would begin.
    largest : float
        Ratio of the discrepancy's stress (root mean square) to the noise at which the lattice ends.

    Attributes
    ----------
    ratios : tuple of (G1,) and (G2,) arrays
        Of the first and the second block; a block that is missing has the one ratio zero.
    step : float
    variance : (Gw, Gd, d) array
        Of the stresses along the directions, in units of the noise: for every ratio of the block that is made white and
        of the one that is decomposed given that.
    log_size : (Gw, Gd) array
        Half the log determinant of the covariance in units of the noise.
    """

    def __init__(
        self,
        member: Member,
        scale: FloatArray,
        features: list[FloatArray],
        count: int,
        negligible_stress: float,
        unlikely: list[float],
        step: float = LOG_RATIO_STEP,
        shift: float = 0.0,
        largest: float = MAX_STRESS_RATIO,
    ) -> None:
        self.member, self.step = member, step
        features = [block / scale[:, None] for block in features]
        sizes = (max(float(np.sqrt((block**2).sum() / count)), negligible_stress) for block in features)
        pairs = zip(sizes, unlikely, strict=True)
        grids = [*(_grid(size, low, step, shift, largest) for size, low in pairs), *[np.zeros(1)] * 2]
        self.ratios = grids[0], grids[1]
        self.basis, triangle = np.linalg.qr(side_by_side(features, len(scale)))
        blocks = np.split(triangle, [features[0].shape[1] if features else 0], axis=1)
        self._decomposed = int(len(features) > 1 and blocks[1].shape[1] < blocks[0].shape[1])
        whitened = 1 - self._decomposed
        # White in one block, for all of its ratios, and then in the one with fewer terms.
        values, vectors = np.linalg.eigh(blocks[whitened] @ blocks[whitened].T)
        variance = 1 + self.ratios[whitened][:, None] ** 2 * np.maximum(values, 0.0)
        self._vectors, self._whitened_sd = vectors, np.sqrt(variance)
        white_block = (vectors.T @ blocks[self._decomposed]) / self._whitened_sd[:, :, None]
        self._left_vectors, singular, _ = np.linalg.svd(white_block, full_matrices=False)
        self.variance = 1 + (self.ratios[self._decomposed][:, None] * singular[:, None]) ** 2
        self.log_size = 0.5 * (np.log(variance).sum(axis=1)[:, None] + _log_product(self.variance))

    def by_second_and_first(self, values: FloatArray) -> FloatArray:
        """Return values (Gw, Gd, ...) by the ratios of the second block and of the first, (G2, G1, ...)."""
        return values.swapaxes(0, 1) if self._decomposed == 1 else values

    def along(self, columns: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return columns (r, k), given in the features' basis, along the directions, and the rest.

        Along the directions (Gw, d, k), for unit noise; the rest (Gw, r, k) is orthogonal to them, of unit variance.
        """
        white = (self._vectors.T @ columns) / self._whitened_sd[:, :, None]
        along = self._left_vectors.swapaxes(1, 2) @ white
        return along, white - self._left_vectors @ along


class Lattice:
    """The posteriors of B data sets under one member, at every pair of ratios of its amplitudes to the noise.

    Points of the lattice are addressed by the places of the second block's ratio and of the first one's, (M,) each;
    data sets by their number, those of one design after another.

    Parameters
    ----------
    directions : Directions
    rows : Rows

    Attributes
    ----------
    parameters : int
        Number of linear parameters.
    freedom : int
        Measurements less linear parameters.
    misfit : (G2, G1, B) array, MPa^2
        Sum of squares of the data given the ratios, in units of the noise.
    log_size : (G2, G1, D) array
        Half the log determinant of everything but the noise.
    """

    def __init__(self, directions: Directions, rows: Rows) -> None:
        self.member, self.ratios, self.step = directions.member, directions.ratios, directions.step
        designs, count, p = rows.design.shape
        k = rows.stresses.shape[2]
        self.parameters, self.freedom, self._per_design = p, rows.count - p, k
        # The material's part of the data and what it leaves, within the span of the features and outside.
        fit = rows.fit
        self._inverse, self._centre = fit.inverse, fit.centre
        columns = fit.columns.swapaxes(0, 1).reshape(count, designs * (p + k))
        inside = directions.basis.T @ columns
        outside = columns - directions.basis @ inside
        projections = (*directions.along(inside), outside)
        along, remaining, outside = (
            projection.reshape(*projection.shape[:-1], designs, p + k) for projection in projections
        )
        # A sum along the directions, for each of their variances, of every product that is needed.
        products = _products(along, p)
        of_unit_variance = _summed_products(remaining, p) + _summed_products(outside, p)
        width = products.shape[3]
        sums = (1 / directions.variance) @ products.reshape(*products.shape[:2], designs * width)
        sums = sums.reshape(*sums.shape[:2], designs, width) + of_unit_variance[:, None]
        of_design, size = np.split(sums, [p * (p + k)], axis=3)
        of_design = of_design.reshape(*of_design.shape[:3], p, p + k)
        precision, pull = np.split(of_design, [p], axis=4)
        tiny = 1e-15 * np.trace(precision, axis1=3, axis2=4)[..., None, None] * np.eye(p)
        gaussian = integrated(precision + tiny, pull, size)
        misfit = np.maximum(gaussian.misfit, 0.0).reshape(*size.shape[:2], designs * k)
        log_size = directions.log_size[:, :, None] - gaussian.log_volume + fit.log_size
        of_ratios = misfit, log_size, gaussian.root, gaussian.scores
        self.misfit, self.log_size, self._root, self._scores = map(directions.by_second_and_first, of_ratios)

    def log_likelihood(
        self, data_set: int, second_index: IndexArray, first_index: IndexArray, noise_sd: FloatArray
    ) -> FloatArray:
        """Return log p(y | ratios, noise_sd) (M,), the linear parameters integrated with density one."""
        exponent = 0.5 * self.misfit[second_index, first_index, data_set] / noise_sd**2
        log_noise, log_size = np.log(noise_sd) + 0.5 * log(2 * pi), self.log_size[:, :, data_set // self._per_design]
        return np.asarray(-self.freedom * log_noise - exponent - log_size[second_index, first_index])

    def log_likelihoods(self, data_sets: slice, noise_sd: float) -> FloatArray:
        """Return `log_likelihood` (G2, G1, b) of some data sets at all points of the lattice, at one noise."""
        log_noise = log(noise_sd) + 0.5 * log(2 * pi)
        log_size = np.repeat(self.log_size, self._per_design, axis=2)[:, :, data_sets]
        return np.asarray(-self.freedom * log_noise - 0.5 / noise_sd**2 * self.misfit[:, :, data_sets] - log_size)

    def scores_and_roots(
        self, data_set: int, second_index: IndexArray, first_index: IndexArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return what `linear` needs (M, p) and (M, p, p) of points of this lattice."""
        design, number = divmod(data_set, self._per_design)
        scores = self._scores[:, :, design, :, number]
        return scores[second_index, first_index], self._root[second_index, first_index, design]

    def linear(self, data_set: int, scores: FloatArray, root: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return means (M, p) of the material's parameters, and roots (M, p, p) of their covariance for unit noise.

        At points of this lattice or of others with the same rows.
        """
        design, number = divmod(data_set, self._per_design)
        inverse = self._inverse[design]
        shift = (root @ scores[:, :, None])[:, :, 0]
        return (self._centre[design, :, number] + shift) @ inverse.T, inverse @ root


def _products(columns: FloatArray, count: int) -> FloatArray:
    """Return products of p columns with all p + k of (..., D, p + k), and squares of the last k, one after another."""
    with_design = columns[..., :count, None] * columns[..., None, :]
    shape = *columns.shape[:-1], count * columns.shape[-1]
    return np.concatenate([with_design.reshape(shape), columns[..., count:] ** 2], axis=-1)


def _summed_products(columns: FloatArray, count: int) -> FloatArray:
    """Return the `_products` of columns (..., m, D, p + k), summed over their m rows."""
    columns = columns.swapaxes(-3, -2)
    with_design = columns[..., :count].swapaxes(-1, -2) @ columns
    shape = *with_design.shape[:-2], count * columns.shape[-1]
    return np.concatenate([with_design.reshape(shape), (columns[..., count:] ** 2).sum(axis=-2)], axis=-1)


def _log_product(variance: FloatArray) -> FloatArray:
    """Return the logarithms (...) of the products of variances (..., r): of several at once, which is quicker."""
    starts = np.arange(0, variance.shape[-1], FACTORS_AT_ONCE)
    if not len(starts):
        return np.zeros(variance.shape[:-1])
    return np.asarray(np.log(np.multiply.reduceat(variance, starts, axis=-1)).sum(axis=-1))


def _grid(size: float, unlikely: float, step: float, shift: float, largest: float) -> FloatArray:
    """Return the ratios of a block whose terms have a stress of some size (root mean square)."""
    smallest, end = min(MIN_STRESS_RATIO / size, unlikely) * np.exp(shift), largest / size
    return np.asarray(smallest * np.exp(step * np.arange(int(log(end / smallest) / step) + 1)))
