"""Adaptive quadrature of positive functions on the unit cube, and whether they have mass where it did not look."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, reduce
from itertools import product

import numpy as np
from numpy.polynomial import legendre

from tissuq.arrays import BoolArray, FloatArray, IndexArray
from tissuq.errors import ConvergenceError
from tissuq.inference.enumerators.line import FINE

LogFunction = Callable[[FloatArray], FloatArray]

MAX_DIMENSION = 3
ORDERS = {1: 10, 2: 10, 3: 7}
"""Gauss-Legendre points along each side of a cell, by dimension."""
FIRST_CELLS_PER_SIDE = 2
"""Cells along each side to begin with."""
MAX_CELLS = 20_000
MIN_RIDGE_SHARE, MAX_RIDGE_DROP, MAX_WIDTH_RATIO = 1e-5, 4.0, 2.0
"""Share of a cell from which a ridge in it may go on in the next one; log density below the largest where they meet,
above which it does, unless the next one's is lower by as much; and how many times wider that is, at the least."""


START_PROBABILITIES = np.array([0.15, 0.5, 0.85])
"""Of the priors, from which climbs start."""
MAX_EVALUATIONS = 300
"""Evaluations that a climb may take."""
MAX_LOG_DROP_OUTSIDE, MAX_LOG_GAIN = 3.0, 5.0
"""Log density below the quadrature's best point from which a place outside its range has mass that counts, and above
it that no place may have."""
HEAVIEST_POINTS = 500
"""Points, the heaviest, among which the best one is."""
MIN_WEIGHT_IN_RANGE = 1e-6
"""Weight of a point that is in no range."""


@dataclass(frozen=True, eq=False)
class Cells:
    """C boxes in the unit cube of dimension d, with the logarithms (B, C, m^d) of B functions at their Gauss points."""

    lower: FloatArray
    width: FloatArray
    log_values: FloatArray

    def __getitem__(self, index: BoolArray) -> Cells:
        return Cells(self.lower[index], self.width[index], self.log_values[:, index])

    def joined(self, more: Cells) -> Cells:
        """Return these cells followed by others."""
        return Cells(
            np.concatenate([self.lower, more.lower]),
            np.concatenate([self.width, more.width]),
            np.concatenate([self.log_values, more.log_values], axis=1),
        )


@dataclass(frozen=True, eq=False)
class Lines:
    """The normalised function along one side of the cube, later sides integrated: K polynomials on intervals.

    Attributes
    ----------
    preceding : (K, j) array
        The coordinates before side j at which each line lies.
    start, width : (K,) arrays
        Its interval along side j.
    series : (K, m) array
        Its Legendre coefficients, times its weight: all lines together integrate to one.
    """

    preceding: FloatArray
    start: FloatArray
    width: FloatArray
    series: FloatArray

    def integrate_to(self, coordinates: FloatArray) -> FloatArray:
        """Return the sum over lines of their integrals up to the coordinates (K, k) of each: (k,)."""
        full_integral = self.series[:, 0] * self.width
        passed = coordinates >= (self.start + self.width)[:, None]
        line, column, t = self._inside(coordinates)
        integral = np.asarray(legendre.legint(self.series.T, lbnd=-1).T, dtype=np.float64)[line]
        partial = 0.5 * self.width[line] * _row_values(integral, t)
        return full_integral @ passed.astype(np.float64) + _summed(column, partial, coordinates.shape[1])

    def evaluate(self, coordinates: FloatArray, factor: FloatArray) -> FloatArray:
        """Return the sum over lines of their values at the coordinates (K, k) of each, times factors (K, k)."""
        line, column, t = self._inside(coordinates)
        values = _row_values(self.series[line], t) * factor[line, column]
        return _summed(column, values, coordinates.shape[1])

    def _inside(self, coordinates: FloatArray) -> tuple[IndexArray, IndexArray, FloatArray]:
        t = 2 * (coordinates - self.start[:, None]) / self.width[:, None] - 1
        line, column = np.nonzero((t >= -1) & (t < 1))
        return line, column, t[line, column]


@dataclass(frozen=True, eq=False)
class Quadrature:
    """The integrals of B functions exp(log f), and each f normalised, as weighted points and as polynomials.

    Attributes
    ----------
    log_integral : (B,) array
    log_error : (B,) array
        Estimated error of log_integral. In every cell the Legendre coefficients of the interpolant fall by some factor
        from the first to the last; Gauss quadrature of that order leaves out coefficients that are smaller by
        that factor once more.
    points : (M, d) array
    weights : (B, M) array
        Non-negative, sum one.
    """

    cells: Cells
    log_integral: FloatArray
    log_error: FloatArray
    points: FloatArray
    weights: FloatArray

    def lines(self, side: int, index: int = 0) -> Lines:
        """Return one of the functions along one side, the sides after it integrated."""
        dimension = self.cells.lower.shape[1]
        order = ORDERS[dimension]
        values = np.exp(self.cells.log_values[index] - self.log_integral[index])
        values = values.reshape(-1, order**side, order, order ** (dimension - side - 1))
        cross_section = np.prod(np.delete(self.cells.width, side, axis=1), axis=1)
        weighted = (values @ _rule(order, dimension - side - 1)) * _rule(order, side)[:, None]
        series = (weighted * cross_section[:, None, None]) @ _to_legendre(order).T
        preceding = _cell_points(self.cells.lower[:, :side], self.cells.width[:, :side], order)
        repeat = preceding.shape[1]
        return Lines(
            preceding.reshape(len(preceding) * repeat, side),
            np.repeat(self.cells.lower[:, side], repeat),
            np.repeat(self.cells.width[:, side], repeat),
            series.reshape(-1, order),
        )


def integrate(
    log_function: LogFunction, dimension: int, tolerance: float = FINE.tolerance, start: Cells | None = None
) -> Quadrature:
    """Integrate exp(log_function) over the unit cube of one to three dimensions, for B functions at once.

    Cells are halved along the side in which a function is worst resolved until the interpolation error of every
    function is below a share of its integral, the tolerance. With a thousandth the integral itself is right to about a
    millionth.

    Parameters
    ----------
    log_function : callable
        Maps (N, d) points to (B, N) values; -inf where a function vanishes.
    dimension : int
        One to three.
    tolerance : float
    start : Cells, optional
        Those of similar functions, whose boxes are the first.

    Raises
    ------
    ConvergenceError
        When the tolerance is not reached with the largest number of cells, or a function vanishes everywhere.
    """
    cells = _evaluated(log_function, start.lower, start.width) if start else _first_cells(log_function, dimension)
    while True:
        top = cells.log_values.max(axis=(1, 2))
        if not np.isfinite(top).all():
            raise ConvergenceError(
                "the posterior density is not finite or zero at every point tried: data and priors contradict "
                "each other, or a prior is far too wide."
            )
        integrals, errors = _resolve(cells, top)
        total = integrals.sum(axis=1, keepdims=True)
        error = errors.max(axis=2) / total
        if (error.sum(axis=1) > tolerance).any():
            halved, sides = _unresolved(error, errors)
        else:
            halved, sides = _beside_ridges(cells, top, integrals / total)
            if not len(halved):
                return _finish(cells, top, integrals, error)
        if cells.log_values.shape[1] > MAX_CELLS:
            raise ConvergenceError(
                f"quadrature over {dimension} nonlinear parameters did not reach its tolerance "
                f"(relative error {error.sum(axis=1).max():.1g}); use the method 'nuts' or narrower priors."
            )
        cells = _halved(log_function, cells, halved, sides)


def _first_cells(log_function: LogFunction, dimension: int) -> Cells:
    corners = np.indices([FIRST_CELLS_PER_SIDE] * dimension).reshape(dimension, -1).T / FIRST_CELLS_PER_SIDE
    return _evaluated(log_function, corners, np.full(corners.shape, 1 / FIRST_CELLS_PER_SIDE))


def _evaluated(log_function: LogFunction, lower: FloatArray, width: FloatArray) -> Cells:
    points = _cell_points(lower, width, ORDERS[lower.shape[1]])
    values = log_function(points.reshape(-1, lower.shape[1]))
    return Cells(lower, width, np.where(np.isnan(values), -np.inf, values).reshape(-1, *points.shape[:2]))


def _cell_points(lower: FloatArray, width: FloatArray, order: int) -> FloatArray:
    """Return the Gauss points (C, order^d, d) of C cells; the last side varies fastest."""
    nodes, dimension = gauss_rule(order)[0], lower.shape[1]
    grid = nodes[np.indices([order] * dimension).reshape(dimension, order**dimension).T]
    return np.asarray(lower[:, None, :] + width[:, None, :] * grid)


def _resolve(cells: Cells, top: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return every cell's integrals (B, C), relative to the largest values, and their errors (B, C, d) by side."""
    dimension = cells.lower.shape[1]
    order = ORDERS[dimension]
    values = np.exp(cells.log_values - top[:, None, None])
    volume = np.prod(cells.width, axis=1)
    integrals = volume * (values @ _rule(order, dimension))
    errors = np.empty((*values.shape[:2], dimension))
    across = _rule(order, dimension - 1)
    grid = values.reshape(*values.shape[:2], *[order] * dimension)
    for side in range(dimension):
        lines = np.moveaxis(grid, side + 2, 2).reshape(*values.shape[:2], order, -1)
        tail = np.abs(_to_legendre(order)[-2:] @ lines).sum(axis=2)
        errors[:, :, side] = volume * (tail @ across)
    return integrals, errors


def _unresolved(error: FloatArray, errors: FloatArray) -> tuple[IndexArray, IndexArray]:
    """Return the worst cells that together hold nine tenths of the error, and the side of each along which it is."""
    worst, cell = error.argmax(axis=0), np.arange(error.shape[1])
    largest = error[worst, cell]
    order = np.argsort(largest)[::-1]
    count = int(np.searchsorted(np.cumsum(largest[order]), 0.9 * largest.sum())) + 1
    rows = np.sort(order[:count])
    return rows, errors[worst, cell].argmax(axis=1)[rows]


def _beside_ridges(cells: Cells, top: FloatArray, shares: FloatArray) -> tuple[IndexArray, IndexArray]:
    """Return cells that a thin ridge may enter between their points, from one beside, and a wider side of each.

    The density of that one is large where it meets them, and theirs is negligible there.
    """
    dimension = cells.lower.shape[1]
    order, upper = ORDERS[dimension], cells.lower + cells.width
    logs = (cells.log_values - top[:, None, None]).max(axis=0).reshape(-1, *[order] * dimension)
    nodes, sides_of_cell = gauss_rule(order)[0], dict[int, int]()
    heavy = np.flatnonzero(shares.max(axis=0) > MIN_RIDGE_SHARE)
    for row, side, is_upper in product(heavy, range(dimension), (True, False)):
        layer = np.take(logs[row], -1 if is_upper else 0, axis=side)
        if layer.max() < -MAX_RIDGE_DROP:
            continue
        largest = np.unravel_index(layer.argmax(), layer.shape)
        crossing = cells.lower[row] + np.insert(nodes[list(largest)], side, float(is_upper)) * cells.width[row]
        is_touching = (cells.lower if is_upper else upper)[:, side] == crossing[side]
        is_transverse = np.arange(dimension) != side
        has_crossing = ((cells.lower <= crossing) & (crossing < upper))[:, is_transverse].all(axis=1)
        for neighbour in np.flatnonzero(is_touching & has_crossing):  # one, or none where the cube ends
            ratios = np.where(is_transverse, cells.width[neighbour] / cells.width[row], 0.0)
            drop = layer.max() - np.take(logs[neighbour], 0 if is_upper else -1, axis=side).max()
            if drop > MAX_RIDGE_DROP and ratios.max() > MAX_WIDTH_RATIO:
                sides_of_cell[int(neighbour)] = int(ratios.argmax())
    rows = np.array(sorted(sides_of_cell), dtype=np.intp)
    return rows, np.array([sides_of_cell[row] for row in rows], dtype=np.intp)


def _halved(log_function: LogFunction, cells: Cells, rows: IndexArray, sides: IndexArray) -> Cells:
    """Halve cells along a side of each."""
    is_halved = np.zeros(len(cells.lower), dtype=bool)
    is_halved[rows] = True
    halved = (np.arange(cells.lower.shape[1]) == sides[:, None]) * 0.5
    width = cells.width[rows] * (1 - halved)
    upper_half = cells.lower[rows] + cells.width[rows] * halved
    lower = np.concatenate([cells.lower[rows], upper_half])
    return cells[~is_halved].joined(_evaluated(log_function, lower, np.concatenate([width, width])))


def _finish(cells: Cells, top: FloatArray, integrals: FloatArray, error: FloatArray) -> Quadrature:
    dimension = cells.lower.shape[1]
    rule = _rule(ORDERS[dimension], dimension)
    total = integrals.sum(axis=1, keepdims=True)
    masses = np.prod(cells.width, axis=1)[:, None] * np.exp(cells.log_values - top[:, None, None]) * rule
    weights = (masses / total[:, :, None]).reshape(len(top), -1)
    significant = np.flatnonzero((weights > 1e-12 * weights.max(axis=1, keepdims=True)).any(axis=0))
    points = _cell_points(cells.lower, cells.width, ORDERS[dimension]).reshape(-1, dimension)[significant]
    weights = weights[:, significant] / weights[:, significant].sum(axis=1, keepdims=True)
    fall = np.minimum(error / np.maximum(integrals / total, 1e-300), 1.0)
    return Quadrature(cells, top + np.log(total[:, 0]), (error * fall).sum(axis=1), points, weights)


def _summed(column: IndexArray, values: FloatArray, count: int) -> FloatArray:
    """Return the sums of the values that belong to each of ``count`` places."""
    return np.asarray(np.bincount(column, values, minlength=count), dtype=np.float64)


def _row_values(series: FloatArray, t: FloatArray) -> FloatArray:
    """Return the value of every Legendre series (N, m) at its own argument (N,)."""
    return np.asarray((legendre.legvander(t, series.shape[1] - 1) * series).sum(axis=1))


@lru_cache
def gauss_rule(order: int) -> tuple[FloatArray, FloatArray]:
    """Return Gauss-Legendre nodes and weights on [0, 1]."""
    nodes, weights = legendre.leggauss(order)
    return 0.5 * (nodes + 1), 0.5 * weights


@lru_cache
def _to_legendre(order: int) -> FloatArray:
    """Return the matrix that takes values at the Gauss nodes to Legendre coefficients."""
    nodes, weights = legendre.leggauss(order)
    degrees = np.arange(order)
    return (degrees + 0.5)[:, None] * legendre.legvander(nodes, order - 1).T * weights


@lru_cache
def _rule(order: int, dimension: int) -> FloatArray:
    """Return the weights of the tensor Gauss rule on the unit cube, flattened."""
    return np.asarray(reduce(np.multiply.outer, [gauss_rule(order)[1]] * dimension, np.array(1.0)).ravel())


def has_missed(
    log_density: Callable[[FloatArray], FloatArray],
    bounds: FloatArray,
    points: FloatArray,
    weights: FloatArray,
    starts: FloatArray,
) -> bool:
    """Return whether climbs end where the points of a quadrature have no weight.

    Parameters
    ----------
    log_density : callable
        Of places (N, d).
    bounds : (d, 2) array
        Of the places, infinite where there is none.
    points : (M, d) array
        Of the quadrature.
    weights : (M,) array
        Their shares of the mass.
    starts : (s, k) array
        Values of the first s coordinates from which to climb; the others start at the best point.
    """
    from scipy.optimize import minimize

    heaviest = points[np.argsort(weights)[-HEAVIEST_POINTS:]]
    heights = log_density(heaviest)
    best, best_height = heaviest[heights.argmax()], float(heights.max())
    heavy, sd = points[weights > MIN_WEIGHT_IN_RANGE], np.sqrt(weights @ (points - weights @ points) ** 2)
    low, high = heavy.min(axis=0) - sd, heavy.max(axis=0) + sd
    for structure_start in [best[: len(starts)], *product(*starts)]:
        start = np.concatenate([structure_start, best[len(starts) :]])
        climb = minimize(
            _depth, start, (log_density,), "Nelder-Mead", bounds=bounds, options={"maxfev": MAX_EVALUATIONS}
        )
        gained, is_outside = -float(climb.fun) - best_height, bool(((climb.x < low) | (climb.x > high)).any())
        if gained > MAX_LOG_GAIN or (is_outside and gained > -MAX_LOG_DROP_OUTSIDE):
            return True
    return False


def _depth(point: FloatArray, log_density: Callable[[FloatArray], FloatArray]) -> float:
    return -float(log_density(point[None])[0])
