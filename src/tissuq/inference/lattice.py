"""One energy discrepancy on one design: the linear parameters given the ratios of its amplitudes to the noise.

What costs anything, two decompositions for each ratio of the second block, depends on the stretches alone and serves
all data sets; the ratio of the first block and the noise then enter by sums over a few directions.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import log, pi

import numpy as np
from numpy.typing import NDArray

from tissuq.discrepancy import Member
from tissuq.model import StatisticalModel

__all__ = ["STEP", "Lattice"]

FloatArray = NDArray[np.float64]
Places = NDArray[np.intp]

STEP = 0.4
"""Of log g. The posterior of an amplitude that r directions tell has an sd of about 1 / sqrt(2 r) in its logarithm."""
SMALLEST, LARGEST = 1e-3, 1e6
"""Ratios of the discrepancy's stress (root mean square) to the noise between which the lattice lies, at least; and the
probability of the amplitudes' priors below which it may begin."""


class Lattice:
    """The posteriors of B data sets under one member, at every pair of ratios g = c / noise_sd of its amplitudes.

    Points of the lattice are addressed by the places of the second block's ratio and of the first one's, (M,) each. A
    block that is missing has the one ratio zero.

    Attributes
    ----------
    member : Member
    features : list of (n, r) arrays
        The stresses of each block's terms at the measurements.
    ratios : tuple of (G1,) and (G2,) arrays
        Of the first and the second block.
    freedom : int
        Measurements less linear parameters.
    misfit : (G2, G1, B) array, MPa^2
        Sum of squares of the data given the ratios, in units of the noise.
    log_size : (G2, G1) array
        Half the log determinant of everything but the noise.
    """

    def __init__(self, models: Sequence[StatisticalModel], member: Member) -> None:
        model = models[0]
        self.member = member
        self.features = member.stress_features(model.experiment.mode, model.experiment.stretch)
        self._p = model.design.shape[1]
        self.freedom = len(model.experiment) - self._p
        stresses = np.array([each.experiment.stress for each in models]).T
        basis, self._triangle = np.linalg.qr(np.hstack([model.design, *self.features]))
        self._data = basis.T @ stresses
        outside = ((stresses - basis @ self._data) ** 2).sum(axis=0)
        least = float(np.sqrt((model.design**2).mean()))  # a block may have no stress at all in this mode
        sizes = (max(float(np.sqrt((each**2).sum(axis=1).mean())), least) for each in self.features)
        pairs = zip(sizes, _unlikely_ratios(models, member), strict=True)
        grids = [*(_grid(size, unlikely) for size, unlikely in pairs), *[np.zeros(1)] * 2]
        self.ratios = grids[0], grids[1]

        p, r = self._p, self.features[0].shape[1] if self.features else 0
        material, first, second = np.split(self._triangle, [p, p + r], axis=1)
        # White in the second block, for all of its ratios.
        values, vectors = np.linalg.eigh(second @ second.T)
        scale = 1 + self.ratios[1][:, None] ** 2 * np.maximum(values, 0.0)
        material, first, data = (
            (vectors.T @ columns) / np.sqrt(scale)[:, :, None] for columns in (material, first, self._data)
        )
        # Without the material, of which the prior is flat.
        basis, triangle = np.linalg.qr(material)
        project = basis.swapaxes(1, 2)
        on_first, self._on_data = project @ first, project @ data
        rest = data - basis @ self._on_data
        left, self._singular, right = np.linalg.svd(first - basis @ on_first, full_matrices=False)
        self._along = left.swapaxes(1, 2) @ rest
        self._tilt = on_first @ right.swapaxes(1, 2)
        self._inverse = np.linalg.inv(triangle)
        # White in the first block, direction by direction.
        self._variance = 1 + (self.ratios[0][:, None] * self._singular[:, None]) ** 2
        beyond = ((rest - left @ self._along) ** 2).sum(axis=1) + outside
        self.misfit = beyond[:, None] + np.einsum("sfr,srb->sfb", 1 / self._variance, self._along**2)
        size = 0.5 * np.log(scale).sum(axis=1) + np.log(np.abs(np.einsum("sii->si", triangle))).sum(axis=1)
        self.log_size = size[:, None] + 0.5 * np.log(self._variance).sum(axis=2)

    def log_likelihood(self, data_set: int, second: Places, first: Places, noise_sd: FloatArray) -> FloatArray:
        """Return log p(y | ratios, noise_sd) (M,), the linear parameters integrated with density one."""
        exponent = 0.5 * self.misfit[second, first, data_set] / noise_sd**2
        log_noise = np.log(noise_sd) + 0.5 * log(2 * pi)
        return np.asarray(-self.freedom * log_noise - exponent - self.log_size[second, first])

    def linear(self, data_set: int, second: Places, first: Places) -> tuple[FloatArray, FloatArray]:
        """Return means (M, p) of the material's parameters, and roots (M, p, p) of their covariance for unit noise."""
        variance, square = self._variance[second, first], self.ratios[0][first, None] ** 2
        tilt, inverse = self._tilt[second], self._inverse[second]
        weights = square * self._singular[second] / variance * self._along[second, :, data_set]
        mean = self._on_data[second, :, data_set] - np.einsum("mpr,mr->mp", tilt, weights)
        spread = tilt * np.sqrt(square / variance)[:, None]
        eye = np.broadcast_to(np.eye(self._p), (len(second), self._p, self._p))
        wide = inverse @ np.concatenate([eye, spread], axis=2)
        triangle = np.asarray(np.linalg.qr(wide.swapaxes(1, 2), mode="r"), dtype=np.float64)
        return np.einsum("mpq,mq->mp", inverse, mean), triangle.swapaxes(1, 2)

    def everything(self, data_set: int, amplitudes: FloatArray, noise_sd: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return means (M, q) and roots (M, q, q) of the material's parameters and the discrepancy's weights.

        For any amplitudes (M, blocks) and noise (M,); the weights are those of `features`.
        """
        sizes = [each.shape[1] for each in self.features]
        k, q = len(self._triangle), self._p + sum(sizes)
        scale = np.ones((len(noise_sd), q))
        scale[:, self._p :] = np.repeat(amplitudes, sizes, axis=1)
        rows = np.zeros((len(noise_sd), k + q - self._p, q + 1))
        rows[:, :k, :q] = self._triangle * (scale / noise_sd[:, None])[:, None]
        rows[:, :k, q] = self._data[:, data_set] / noise_sd[:, None]
        rows[:, k:, self._p : q] = np.eye(q - self._p)
        triangle = np.asarray(np.linalg.qr(rows, mode="r"), dtype=np.float64)
        root = np.asarray(np.linalg.inv(triangle[:, :q, :q]), dtype=np.float64)
        mean = (root @ triangle[:, :q, q:])[:, :, 0]
        return mean * scale, root * scale[:, :, None]


def _unlikely_ratios(models: Sequence[StatisticalModel], member: Member) -> list[float]:
    """Return for each block a ratio below which its amplitude is not likely to be before the data."""
    found = []
    for place in member.places:
        symbol = models[0].energy_symbols[place]
        noise = (_noise(model) for model in models)
        found.append(min(float(m.priors[symbol].quantile(SMALLEST)) / sd for m, sd in zip(models, noise, strict=True)))
    return found


def _noise(model: StatisticalModel) -> float:
    """Return the noise, or the most that it can be."""
    if not model.noise.parameters:
        return float(model.noise.sd({}, 0.0))
    return float(np.sqrt((model.experiment.stress**2).mean()))


def _grid(size: float, unlikely: float) -> FloatArray:
    """Return the ratios of a block whose terms have a stress of some size (root mean square)."""
    smallest, largest = min(SMALLEST / size, unlikely), LARGEST / size
    return np.asarray(smallest * np.exp(STEP * np.arange(int(log(largest / smallest) / STEP) + 1)))
