"""The data in the directions in which their errors are independent: what a likelihood is computed from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tissuq.inference.lowrank import correlation_spectrum
from tissuq.model import StatisticalModel
from tissuq.statistics import CHUNK, upper_triangle

__all__ = ["Reducer", "Reductions", "divided_columns"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Reduction:
    """B data sets on the same stretches, for one setting of the structure.

    The data matrix of a data set is D = [Q, F, e]: the orthonormal basis of its p linear columns, the columns of
    parameters that are linear but have no Gaussian prior, and the residual of least squares. Along r directions
    its errors are independent, with variances that are simple functions of the nonlinear parameters.

    Attributes
    ----------
    inverse : (p, p) array
        Inverse of the triangle that turns Q into the linear columns.
    log_size : float
        Log of the absolute determinant of that triangle.
    centre : (B, p) array
        The least-squares solutions.
    squares : (B, r, q^2) array
        Sums of squares and products of D's columns along each direction.
    counts : (r,) array
        How many dimensions share a direction's variance.
    values : (r,) array
        Eigenvalues of the correlation of the discrepancy; zero where it has none.
    levels : (r,) array
        Levels of the stress, for noise that depends on them.
    """

    inverse: FloatArray
    log_size: float
    centre: FloatArray
    squares: FloatArray
    counts: FloatArray
    values: FloatArray
    levels: FloatArray


@dataclass(frozen=True, eq=False)
class Reductions:
    """K reductions: all arrays begin with that dimension, and those along directions are padded with zeros."""

    inverse: FloatArray
    log_size: FloatArray
    centre: FloatArray
    squares: FloatArray
    counts: FloatArray
    values: FloatArray
    levels: FloatArray

    @classmethod
    def of(cls, parts: Sequence[Reduction]) -> Reductions:
        """Stack reductions of the same data."""
        rank = max(len(part.counts) for part in parts)
        directions = np.zeros((3, len(parts), rank))
        squares = np.zeros((len(parts), len(parts[0].squares), rank, parts[0].squares.shape[2]))
        for place, part in enumerate(parts):
            own = slice(len(part.counts))
            directions[:, place, own] = part.counts, part.values, part.levels
            squares[place, :, own] = part.squares
        inverse, log_size, centre = (
            np.array([getattr(part, name) for part in parts]) for name in ("inverse", "log_size", "centre")
        )
        return cls(inverse, log_size, centre, squares, *directions)


class Reducer:
    """Reduces the data of models with the same parts and stretches, given the structure; remembers what it did."""

    def __init__(self, models: Sequence[StatisticalModel]) -> None:
        self._models = models
        self._known: dict[tuple[float, ...], Reduction] = {}

    def __call__(self, settings: FloatArray) -> Reductions:
        """Return the reductions at K settings (K, s) of the structure."""
        if not settings.shape[1]:
            return self._only
        return Reductions.of([self._at(tuple(map(float, setting))) for setting in settings])

    @cached_property
    def _only(self) -> Reductions:
        return Reductions.of([self._at(())])

    def _at(self, setting: tuple[float, ...]) -> Reduction:
        if setting not in self._known:
            model = self._models[0]
            is_plain = not model.structure and not model.is_correlated and not model.noise.depends_on_level
            is_alone = len(self._models) == 1 or len(model.experiment) > CHUNK
            reduce = _from_statistics if is_plain and is_alone else _from_rows
            self._known[setting] = reduce(self._models, setting)
        return self._known[setting]


def _from_statistics(models: Sequence[StatisticalModel], setting: tuple[float, ...]) -> Reduction:
    """Reduce by the data's triangles alone, at a cost that does not depend on their number."""
    free, fixed = divided_columns(models[0])
    p = len(free)
    centres, squares = [], []
    for model in models:
        triangle = upper_triangle(model.statistics.triangle[:, [*free, *fixed, -1]])
        inverse = np.asarray(np.linalg.inv(triangle[:p, :p]), dtype=np.float64)
        data = triangle.copy()
        data[:p, :p] = np.eye(p)
        data[:p, -1] = 0.0
        centres.append(inverse @ triangle[:p, -1])
        squares.append((data.T @ data).reshape(1, -1))
    one = np.ones(1)
    return Reduction(
        inverse,
        float(np.log(np.abs(np.diag(triangle)[:p])).sum()),
        np.array(centres),
        np.array(squares),
        len(models[0].experiment) * one,
        0 * one,
        0 * one,
    )


def _from_rows(models: Sequence[StatisticalModel], setting: tuple[float, ...]) -> Reduction:
    """Reduce by all measurements, in the directions in which their errors are independent."""
    model = models[0]
    free, fixed = divided_columns(model)
    bent = len(model.bent_symbols)
    design = model.design if not bent else model.basis(model.experiment.stretch, np.array(setting[:bent]))
    basis, triangle = np.linalg.qr(design[:, free])
    inverse = np.asarray(np.linalg.inv(triangle), dtype=np.float64)
    stresses = np.array([each.experiment.stress for each in models])
    centre = (stresses @ basis) @ inverse.T
    residual = stresses - centre @ design[:, free].T
    shared = np.hstack([basis, design[:, fixed]])
    n, count, q = len(design), len(models), shared.shape[1] + 1
    if model.is_correlated:
        spectrum = correlation_spectrum(model, setting[bent:])
        shared_part, residual_part = spectrum.vectors.T @ shared, residual @ spectrum.vectors
        outside = shared - spectrum.vectors @ shared_part, residual - residual_part @ spectrum.vectors.T
        squares = np.empty((count, len(spectrum.values) + 1, q * q))
        squares[:, :-1] = _products(shared_part, residual_part)
        squares[:, -1] = _products(*outside).sum(axis=1)
        counts = np.append(np.ones(len(spectrum.values)), n - len(spectrum.values))
        values, levels = np.append(spectrum.values, 0.0), np.zeros(len(counts))
    elif model.noise.depends_on_level:
        levels, place, number = np.unique(model.levels, return_inverse=True, return_counts=True)
        by_level = np.zeros((len(levels), count, q * q))
        for start in range(0, n, CHUNK):
            block = slice(start, start + CHUNK)
            np.add.at(by_level, place[block], _products(shared[block], residual[:, block]).swapaxes(0, 1))
        squares = by_level.swapaxes(0, 1)
        counts, values = number.astype(np.float64), np.zeros(len(levels))
    else:
        squares = _products(shared, residual).sum(axis=1, keepdims=True)
        counts, values, levels = np.array([float(n)]), np.zeros(1), np.zeros(1)
    return Reduction(inverse, float(np.log(np.abs(np.diag(triangle))).sum()), centre, squares, counts, values, levels)


def _products(shared: FloatArray, own: FloatArray) -> FloatArray:
    """Return, along r directions, the products (B, r, q^2) of q - 1 shared columns (r, q - 1) and one own (B, r)."""
    columns = np.concatenate([np.broadcast_to(shared, (len(own), *shared.shape)), own[:, :, None]], axis=2)
    return np.asarray((columns[:, :, :, None] * columns[:, :, None, :]).reshape(*own.shape, -1))


def divided_columns(model: StatisticalModel) -> tuple[list[int], list[int]]:
    """Return the places of the columns that are integrated in closed form, and of the others."""
    free = [model.column_symbols.index(symbol) for symbol in model.linear]
    return free, [place for place in range(len(model.column_symbols)) if place not in free]
