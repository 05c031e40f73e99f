"""Gaussians within bounds of up to three parameters, by nested quadrature: right however deep these cut."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.parameters.normal_interval import interval_quantile, log_interval

LogDensity = Callable[[FloatArray], FloatArray]

MAX_NESTED = 3
"""Parameters whose bounds are integrated so: the effort grows by two hundred with each."""
LOG_DENSITY_DROPS = 26.0, 4.0
"""What lies so far below the largest log density is negligible (e^-26 is 5e-12), or not worth close attention."""
REACH_SDS = 12.0
"""Standard deviations, beyond a point within the bounds, where nothing is left."""
MASS_ROUNDING = 1e-15
"""Rounding error of the closed form for the mass of two parameters within bounds."""
MAX_ROUNDING_ERROR = 1e-7
"""Relative error up to which rounding is borne with."""
MAX_SCORE, CERTAIN_SCORE = 38.0, 9.0
"""Standard deviations beyond which a parameter never is, and below which it is but for 1e-19."""
GRID_POINTS, MAX_ZOOMS, HALVINGS = 16, 12, 12
"""Points of a grid that zooms in on the density, how often at most, and halvings of what is then left."""
PIECES = 4
"""In which the density is smooth enough for a rule."""
TICK_STEP, TICKS_PER_SIDE = 0.15, 20
"""Of the rule's coordinate: what lies beyond the last tick is 1e-13 of a piece."""
POINTS_PER_TICK = 4
"""At which the cumulative probability is tabulated."""


def nested_log_mass(triangle: FloatArray, low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the log mass (M,) of M Gaussians within bounds, and its error (M,).

    One parameter after another is integrated, given those before it; the last in closed form. The integrands are
    log-concave, so where they are not negligible is one interval, which bisection finds; there a double exponential
    rule is insensitive to how sharply bounds cut it off.

    Parameters
    ----------
    triangle : (M, k, k) array
        Lower triangles L of the covariances L L'.
    low, high : (M, k) arrays
        Bounds, from the means.

    References
    ----------
    Prékopa (1973), Acta Sci. Math. 34, 335-343 (marginals of log-concave densities are log-concave); Takahasi & Mori
    (1974), Publ. RIMS 9, 721-741 (the rule); Owen (1956), Ann. Math. Stat. 27, 1075-1090 (two parameters).
    """
    scale = triangle[:, 0, 0]
    if low.shape[1] == 1:
        return log_interval(low[:, 0] / scale, high[:, 0] / scale), np.zeros(len(low))
    if low.shape[1] > 2:
        return _integrated(triangle, low, high)
    mass = _rectangle(triangle, low, high)
    log_mass, error = np.log(np.maximum(mass, MASS_ROUNDING)), MASS_ROUNDING / np.maximum(mass, MASS_ROUNDING)
    deep = mass < MASS_ROUNDING / MAX_ROUNDING_ERROR
    if deep.any():
        log_mass[deep], error[deep] = _integrated(triangle[deep], low[deep], high[deep])
    return log_mass, error


def nested_log_density(
    triangle: FloatArray, low: FloatArray, high: FloatArray, score: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the log density (M, G) of standard scores (M, G) of the first parameter where the others keep to bounds.

    Its integral is the mass within these (so it is not normalised), and its error (M, G) is returned too. Arrays as
    in `nested_log_mass`.
    """
    shift = score[:, :, None] * triangle[:, None, 1:, 0]
    shape = (-1, low.shape[1] - 1)
    inner_triangle = np.repeat(triangle[:, 1:, 1:], score.shape[1], axis=0)
    ends = ((end[:, None, 1:] - shift).reshape(shape) for end in (low, high))
    inner, error = nested_log_mass(inner_triangle, *ends)
    return inner.reshape(score.shape) - 0.5 * score**2 - 0.5 * np.log(2 * np.pi), error.reshape(score.shape)


def nested_points(triangle: FloatArray, low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return ascending scores (M, K) of the first of several parameters, and their log masses (M, K).

    They are the nodes of a rule, so sums over them are integrals within the bounds. Arrays as in `nested_log_mass`.
    """
    score, log_terms, _, _ = _nodes(triangle, low, high)
    return score, log_terms


def nested_draws(triangle: FloatArray, low: FloatArray, high: FloatArray, uniforms: FloatArray) -> FloatArray:
    """Return standard scores (M, R, k) of R draws within bounds from each of M Gaussians, by inverting distributions.

    Parameters
    ----------
    triangle, low, high : arrays
        As in `nested_log_mass`; a draw is the mean plus the triangle times its scores.
    uniforms : (M, R, k) array
        Between zero and one.
    """
    count, draws, k = uniforms.shape
    if k == 1:
        start, stop = (end / triangle[:, 0] for end in (low, high))
        return interval_quantile(uniforms[:, :, 0], start, stop)[0][:, :, None]
    rows = zip(uniforms[:, :, 0], *_distribution(*nested_points(triangle, low, high)), strict=True)
    first_score = np.array([np.interp(uniform, cumulative, scores) for uniform, cumulative, scores in rows])
    shift = first_score[:, :, None] * triangle[:, None, 1:, 0]
    start, stop = ((end[:, None, 1:] - shift).reshape(-1, k - 1) for end in (low, high))
    inner_triangle = np.repeat(triangle[:, 1:, 1:], draws, axis=0)
    inner_scores = nested_draws(inner_triangle, start, stop, uniforms[:, :, 1:].reshape(-1, 1, k - 1))
    return np.concatenate([first_score[:, :, None], inner_scores.reshape(count, draws, k - 1)], axis=2)


def _distribution(score: FloatArray, log_terms: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the cumulative probabilities (M, F) at many scores (M, F), from nodes and their log masses (M, K).

    The rule's partial sums are those of trapezoids in its own coordinate, there corrected (Euler-Maclaurin) and joined
    by cubics that have the masses as slopes.
    """
    terms = np.exp(log_terms - log_terms.max(axis=1, keepdims=True)).reshape(len(score), PIECES, -1)
    mass_of_piece = terms.sum(axis=2, keepdims=True)
    cumulative = np.cumsum(terms, axis=2) - 0.5 * terms - np.gradient(terms, axis=2) / 12
    cumulative += np.cumsum(mass_of_piece, axis=1) - mass_of_piece
    f = np.arange(POINTS_PER_TICK) / POINTS_PER_TICK
    basis = (1 + 2 * f) * (1 - f) ** 2, f**2 * (3 - 2 * f), f * (1 - f) ** 2, f**2 * (f - 1)
    ends = cumulative[:, :, :-1], cumulative[:, :, 1:], terms[:, :, :-1], terms[:, :, 1:]
    between = sum(end[..., None] * weight for end, weight in zip(ends, basis, strict=True))
    nodes = score.reshape(terms.shape)
    start, width = nodes[:, :, :1], nodes[:, :, -1:] - nodes[:, :, :1]
    reach = TICKS_PER_SIDE * POINTS_PER_TICK
    positions = _positions(np.arange(-reach, reach) * TICK_STEP / POINTS_PER_TICK)[0]
    fine = start + width * (positions - positions[0])
    total = mass_of_piece.sum(axis=1)
    return np.maximum.accumulate(between.reshape(len(score), -1) / total, axis=1), fine.reshape(len(score), -1)


def _integrated(triangle: FloatArray, low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return log masses and errors (M,), the first parameter integrated numerically."""
    _, log_terms, half, errors = _nodes(triangle, low, high)
    top = log_terms.max(axis=1, keepdims=True)
    terms = np.exp(log_terms - top)
    mass = terms.sum(axis=1)
    error = np.abs((terms * half).sum(axis=1) / mass - 1) + (terms * errors).sum(axis=1) / mass
    return top[:, 0] + np.log(mass), np.asarray(error + np.exp(-LOG_DENSITY_DROPS[0]))


def _nodes(triangle: FloatArray, low: FloatArray, high: FloatArray) -> tuple[FloatArray, ...]:
    """Return nodes, their log masses, what a coarser rule multiplies these by, and relative errors: (M, K) each."""

    def log_density(score: FloatArray) -> tuple[FloatArray, FloatArray]:
        return nested_log_density(triangle, low, high, score)

    ends = _pieces(lambda score: log_density(score)[0], *_first_range(triangle, low, high))
    position, log_weight, half = _rule()
    start, width = ends[:, :-1, None], np.maximum(np.diff(ends), 1e-300)[:, :, None]
    score = (start + width * position).reshape(len(low), -1)
    values, errors = log_density(score)
    return score, values + (np.log(width) + log_weight).reshape(len(low), -1), half.ravel(), errors


def _rectangle(triangle: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Return the mass (M,) of two parameters within bounds, right to about 1e-15."""
    from scipy.special import ndtr, owens_t

    sd = np.column_stack([triangle[:, 0, 0], np.hypot(triangle[:, 1, 0], triangle[:, 1, 1])])
    correlation, complement = triangle[:, 1].T / sd[:, 1]

    def probability_below(h: FloatArray, k: FloatArray) -> FloatArray:
        value = np.where(h >= CERTAIN_SCORE, ndtr(k), np.where(k >= CERTAIN_SCORE, ndtr(h), 0.0))
        inner = np.flatnonzero(np.maximum(np.abs(h), np.abs(k)) < CERTAIN_SCORE)
        h, k = h[inner], k[inner]
        joint = 0.5 * (ndtr(h) + ndtr(k)) - np.where(h * k < 0, 0.5, 0.0)
        with np.errstate(over="ignore"):
            joint -= owens_t(h, (k - correlation[inner] * h) / (h * complement[inner]))
            joint -= owens_t(k, (h - correlation[inner] * k) / (k * complement[inner]))
        value[inner] = joint
        return np.asarray(value)

    scores = (np.clip(end / sd, -MAX_SCORE, MAX_SCORE) for end in (low, high))
    (a, b), (c, d) = (np.where(score == 0, 1e-99, score).T for score in scores)
    return probability_below(c, d) - probability_below(a, d) - probability_below(c, b) + probability_below(a, b)


def _first_range(triangle: FloatArray, low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return ends of the first score beyond which no mass is: not far beyond the size of some scores within bounds."""
    scores = np.zeros(low.shape)
    for j in range(low.shape[1]):
        shift = np.einsum("mk,mk->m", triangle[:, j, :j], scores[:, :j])
        scores[:, j] = np.clip(0.0, *((end[:, j] - shift) / triangle[:, j, j] for end in (low, high)))
    reach = np.sqrt((scores**2).sum(axis=1)) + REACH_SDS
    first_low, first_high = (end[:, 0] / triangle[:, 0, 0] for end in (low, high))
    return np.maximum(first_low, -reach), np.minimum(first_high, reach)


def _pieces(log_density: LogDensity, start: FloatArray, end: FloatArray) -> FloatArray:
    """Return ends (M, 5) of the pieces in which a log-concave density is smooth enough for a rule.

    They are where it becomes more than negligible, and well more, its mode, and the same beyond. Start and end (M,)
    enclose them.
    """
    rows = np.arange(len(start))
    fractions = np.linspace(0, 1, GRID_POINTS)
    for _ in range(MAX_ZOOMS):
        grid = start[:, None] + (end - start)[:, None] * fractions
        values = log_density(grid)
        best = values.argmax(axis=1)
        seen = values > values.max(axis=1, keepdims=True) - LOG_DENSITY_DROPS[0]
        leftmost, rightmost = seen.argmax(axis=1), GRID_POINTS - 1 - seen[:, ::-1].argmax(axis=1)
        outer_left, outer_right = np.maximum(leftmost - 1, 0), np.minimum(rightmost + 1, GRID_POINTS - 1)
        start, end = grid[rows, outer_left], grid[rows, outer_right]
        if (outer_right - outer_left >= GRID_POINTS // 2).all():
            break
    mode, top, reach = grid[rows, best], values.max(axis=1), grid[:, 1] - grid[:, 0]
    outer = np.column_stack([start, start, end, end])
    inner = np.column_stack([grid[rows, leftmost], mode, mode, grid[rows, rightmost]])
    for _ in range(HALVINGS):
        middle, reach = 0.5 * (outer + inner), 0.5 * reach
        tried = np.column_stack([middle, mode - reach, mode, mode + reach])
        values = log_density(tried)
        best = values.argmax(axis=1)
        mode, top = tried[rows, best], values[rows, best]
        seen = values[:, :4] > top[:, None] - np.array([*LOG_DENSITY_DROPS, *LOG_DENSITY_DROPS[::-1]])
        outer, inner = np.where(seen, outer, middle), np.where(seen, middle, inner)
    return np.sort(np.column_stack([outer, np.clip(mode, outer[:, 0], outer[:, 3])]), axis=1)


@lru_cache
def _rule() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return nodes (4, k) in [0, 1] for each piece, their log weights, and factors for a rule on half of them.

    Double exponential: insensitive to what is steep at the ends of a piece.
    """
    ticks = np.arange(-TICKS_PER_SIDE, TICKS_PER_SIDE + 1.0)
    position, slope = _positions(TICK_STEP * ticks)
    half = np.where(ticks % 2, 0.0, 2.0)
    position, log_weight, half = (np.tile(row, (PIECES, 1)) for row in (position, np.log(TICK_STEP * slope), half))
    return position, log_weight, half


def _positions(t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return where the coordinate of the double exponential rule lies between zero and one, and the slope there."""
    inner = 0.5 * np.pi * np.sinh(t)
    return 0.5 * (1 + np.tanh(inner)), 0.25 * np.pi * np.cosh(t) / np.cosh(inner) ** 2
