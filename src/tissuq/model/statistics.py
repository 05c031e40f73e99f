"""Data of a linear model as a triangle that measurements can be added to, and very many of them as few rows."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Protocol
from weakref import WeakKeyDictionary

import numpy as np
from numpy.polynomial.chebyshev import chebvander

from tissuq.arrays import FloatArray, IndexArray

CHUNK = 16_384
"""Measurements taken in at once: what bounds the memory."""
NODES_PER_PIECE = 24
"""Points of a piece of the range, between which a polynomial interpolates."""
TEST_POINTS_PER_PIECE = 61
"""Points of a piece at which the interpolation is compared with the functions themselves."""
INTERPOLATION_ERROR = 1e-8
"""Largest error of a block of columns, over its largest size: the digits that features of energies have themselves."""
SIZE_POINTS = 201
"""Points of the whole range from which that size is."""
MIN_RELATIVE_LENGTH = 1 / 64
"""Length of a piece over that of the range, below which pieces are not halved."""
_NODES = -np.cos(np.pi * np.arange(NODES_PER_PIECE) / (NODES_PER_PIECE - 1))
_COEFFICIENTS = np.linalg.inv(chebvander(_NODES, NODES_PER_PIECE - 1))
"""From values at the nodes to coefficients of Chebyshev polynomials."""


@dataclass(frozen=True, eq=False)
class Statistics:
    """The triangular factor R of the rows [X y]: all that a least-squares problem needs of n measurements.

    R'R is the matrix of their sums of squares and products, but R keeps the digits that squaring loses (Golub & Van
    Loan, Matrix Computations, 5.3). Statistics of two sets of measurements join into those of both.

    Attributes
    ----------
    count : int
        Number of measurements.
    triangle : (k + 1, k + 1) array
        R, the last column that of the stress.
    """

    count: int
    triangle: FloatArray

    @classmethod
    def of_rows(cls, blocks: Iterable[FloatArray]) -> Statistics:
        """Return the statistics of rows (m, k + 1), block by block."""
        total: Statistics | None = None
        for block in blocks:
            new = cls(len(block), upper_triangle(block))
            total = new if total is None else total.joined(new)
        if total is None:
            raise ValueError("no measurements")
        return total

    def joined(self, more: Statistics) -> Statistics:
        """Return the statistics of both sets of measurements."""
        return Statistics(self.count + more.count, upper_triangle(np.vstack([self.triangle, more.triangle])))


def upper_triangle(rows: FloatArray) -> FloatArray:
    """Return R of the QR factorisation, square even where there are few rows."""
    factor = np.asarray(np.linalg.qr(rows, mode="r"), dtype=np.float64)
    missing = rows.shape[1] - len(factor)
    return np.vstack([factor, np.zeros((missing, rows.shape[1]))]) if missing else factor


Functions = Callable[[FloatArray], list[FloatArray]]
"""From points (m,) to blocks of columns (m, k) each."""


_condensed_before: WeakKeyDictionary[Measurements, list[Condensed]] = WeakKeyDictionary()


class Measurements(Protocol):
    """Very many stresses (n,) at stretches (n,), which an experiment of one curve holds."""

    @property
    def stretch(self) -> FloatArray: ...

    @property
    def stress(self) -> FloatArray: ...


@dataclass(frozen=True, eq=False)
class Condensed:
    """n measurements of a curve, condensed for all functions of the stretch that are smooth on some pieces.

    On every piece a function is P f, its values f at the piece's Chebyshev points times the interpolation P, and the
    rows [P y] enter least squares by their triangular factor R alone (`tissuq.model.statistics`). So the rows R f stand
    for the n values of the function and the last column of R for the n stresses: every scalar product is the same.

    Attributes
    ----------
    edges : (k + 1,) array
        Of the pieces.
    piece : (n,) array
        The piece of each measurement.
    triangle : (k, q + 1, q + 1) array
        R of every piece, in the coefficients of Chebyshev polynomials.
    stretch : (n,) array
        Of each measurement.
    """

    edges: FloatArray
    piece: IndexArray
    triangle: FloatArray
    stretch: FloatArray

    @classmethod
    def of(cls, stretch: FloatArray, stress: FloatArray, edges: FloatArray) -> Condensed:
        """Condense stresses (n,) at stretches (n,), in one pass."""
        piece = np.clip(np.searchsorted(edges, stretch, side="right") - 1, 0, len(edges) - 2)
        triangle = np.zeros((len(edges) - 1, NODES_PER_PIECE + 1, NODES_PER_PIECE + 1))
        for number in range(len(triangle)):
            mine = np.flatnonzero(piece == number)
            for start in range(0, len(mine), CHUNK):
                block = mine[start : start + CHUNK]
                polynomials = chebvander(_scaled(stretch[block], *edges[number : number + 2]), NODES_PER_PIECE - 1)
                rows = np.column_stack([polynomials, stress[block]])
                triangle[number] = upper_triangle(np.vstack([triangle[number], rows]))
        return cls(edges, piece, triangle, stretch)

    @property
    def count(self) -> int:
        """The number of measurements."""
        return len(self.stretch)

    @cached_property
    def points(self) -> FloatArray:
        """The points (m,) at which a function must be known, piece by piece."""
        return _points(self.edges)

    @cached_property
    def stress(self) -> FloatArray:
        """What stands for the stresses (r,)."""
        return np.asarray(self.triangle[:, :, -1].ravel())

    @cached_property
    def _rows(self) -> FloatArray:
        """The matrix (r, m) from values at the points to rows."""
        pieces, size, nodes = len(self.triangle), NODES_PER_PIECE + 1, NODES_PER_PIECE
        rows = np.zeros((pieces, size, pieces, nodes))
        for number, triangle in enumerate(self.triangle):
            rows[number, :, number] = triangle[:, :-1] @ _COEFFICIENTS
        return rows.reshape(pieces * size, pieces * nodes)

    def __call__(self, values: FloatArray) -> FloatArray:
        """Return the rows (r, k) or (r,) that stand for functions with values (m, k) or (m,) at the points."""
        return self._rows @ values

    def at_measurements(self, values: FloatArray) -> FloatArray:
        """Return functions (n, k) or (n,) at all measurements, given their values (m, k) or (m,) at the points."""
        columns = np.empty((self.count, *values.shape[1:]))
        of_pieces = values.reshape(len(self.triangle), NODES_PER_PIECE, *values.shape[1:])
        for number, at_nodes in enumerate(of_pieces):
            coefficients = _COEFFICIENTS @ at_nodes
            mine = np.flatnonzero(self.piece == number)
            for start in range(0, len(mine), CHUNK):
                block = mine[start : start + CHUNK]
                scaled = _scaled(self.stretch[block], *self.edges[number : number + 2])
                columns[block] = chebvander(scaled, NODES_PER_PIECE - 1) @ coefficients
        return columns


def condensed(measurements: Measurements, reference: float, functions: Functions) -> Condensed | None:
    """Return the measurements of one curve, condensed for some functions; None where these are not smooth enough.

    The range is divided at the reference and then halved wherever interpolation is not accurate. What was condensed
    before serves other functions, too, if it is accurate for them.
    """
    low, high = float(measurements.stretch.min()), float(measurements.stretch.max())
    if not low < high:
        return None
    blocks = functions(np.linspace(low, high, SIZE_POINTS))
    sizes = [np.linalg.norm(columns, axis=1).max(initial=0.0) for columns in blocks]

    def is_accurate(begin: float, end: float) -> bool:
        return _error(functions, sizes, begin, end) <= INTERPOLATION_ERROR

    earlier = _condensed_before.setdefault(measurements, [])
    for condensation in earlier:
        if all(is_accurate(*ends) for ends in pairwise(condensation.edges)):
            return condensation
    edges = [low, *([reference] if low < reference < high else []), high]
    piece = 0
    while piece < len(edges) - 1:
        begin, end = edges[piece : piece + 2]
        if is_accurate(begin, end):
            piece += 1
        elif end - begin < MIN_RELATIVE_LENGTH * (high - low):
            return None
        else:
            edges.insert(piece + 1, 0.5 * (begin + end))
    earlier.append(Condensed.of(measurements.stretch, measurements.stress, np.array(edges)))
    return earlier[-1]


def is_condensed(measurements: Measurements) -> bool:
    """Return whether measurements were condensed before, so that it costs next to nothing."""
    return measurements in _condensed_before


def _error(functions: Functions, sizes: Sequence[float], low: float, high: float) -> float:
    """Return the largest error of the interpolation on a piece, over the size of each block of columns."""
    points = np.linspace(low, high, TEST_POINTS_PER_PIECE)
    interpolation = chebvander(_scaled(points, low, high), NODES_PER_PIECE - 1) @ _COEFFICIENTS
    errors = [0.0]
    for nodes, exact, size in zip(functions(_points(np.array([low, high]))), functions(points), sizes, strict=True):
        difference = np.linalg.norm(interpolation @ nodes - exact, axis=1).max(initial=0.0)
        errors.append(float(difference / size) if size else 0.0)
    return np.inf if np.isnan(errors).any() else max(errors)


def _points(edges: FloatArray) -> FloatArray:
    low, high = edges[:-1, None], edges[1:, None]
    return np.asarray((0.5 * (low + high) + 0.5 * (high - low) * _NODES).ravel())


def _scaled(stretch: FloatArray, low: float, high: float) -> FloatArray:
    return np.asarray((2 * stretch - low - high) / (high - low))
