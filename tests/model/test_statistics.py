"""Sufficient statistics: sums over any split of the measurements, and digits that normal equations lose."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from oracle import stress_per_unit
from tissuq.model.statistics import CHUNK, Statistics

EPS = np.finfo(float).eps


def exact_solution(columns, target):
    """Solve the normal equations in exact rational arithmetic."""
    X = [[Fraction(float(value)) for value in row] for row in columns]
    y = [Fraction(float(value)) for value in target]
    p = len(X[0])
    A = [[sum(row[i] * row[j] for row in X) for j in range(p)] for i in range(p)]
    b = [sum(row[i] * value for row, value in zip(X, y, strict=True)) for i in range(p)]
    for i in range(p):
        for k in range(i + 1, p):
            factor = A[k][i] / A[i][i]
            A[k] = [upper - factor * pivot for upper, pivot in zip(A[k], A[i], strict=True)]
            b[k] -= factor * b[i]
    for i in reversed(range(p)):
        b[i] = (b[i] - sum(A[i][j] * b[j] for j in range(i + 1, p))) / A[i][i]
    residual = [value - sum(x * c for x, c in zip(row, b, strict=True)) for row, value in zip(X, y, strict=True)]
    return np.array([float(value) for value in b]), float(sum(value**2 for value in residual))


def solution(statistics):
    triangle = statistics.triangle
    return np.linalg.solve(triangle[:-1, :-1], triangle[:-1, -1]), triangle[-1, -1] ** 2


@given(st.integers(0, 2**32 - 1), st.integers(1, 30), st.integers(1, 4), st.lists(st.integers(1, 29), max_size=4))
@settings(max_examples=100, deadline=None, derandomize=True)
def test_any_split_of_the_rows_has_the_same_sums_of_squares_and_products(seed, count, columns, cuts):
    rows = np.random.default_rng(seed).standard_normal((count, columns + 1))
    edges = [0, *sorted({cut for cut in cuts if cut < count}), count]
    blocks = [rows[start:end] for start, end in pairwise(edges)]
    found = Statistics.of_rows(blocks)
    joined = Statistics.of_rows(blocks[:1])
    for block in blocks[1:]:
        joined = joined.joined(Statistics.of_rows([block]))
    for each in (found, joined):
        assert each.count == count
        assert each.triangle.shape == (columns + 1, columns + 1)
        np.testing.assert_allclose(each.triangle.T @ each.triangle, rows.T @ rows, rtol=0, atol=1e-12 * count)
        assert (np.tril(each.triangle, -1) == 0).all()


def test_no_rows_are_an_error():
    with pytest.raises(ValueError, match="no measurements"):
        Statistics.of_rows([])


@pytest.mark.parametrize(("low", "high"), [(0.98, 1.02), (0.3, 8.0)])
def test_yeoh_columns_keep_the_residual_that_normal_equations_lose(low, high):
    stretch = np.linspace(low, high, 41)
    X = np.stack([stress_per_unit(name, stretch) for name in ("C10", "C20", "C30")], axis=1)
    y = X @ [1.2, -0.057, 0.004] + 1e-7 * np.sin(1e3 * stretch)
    truth, residual = exact_solution(X, y)
    found, left = solution(of(X, y))
    # Backward stability: an error of eps cond, the columns scaled alike, for each coefficient.
    lengths = np.linalg.norm(X, axis=0)
    error = np.abs(found - truth) * lengths
    assert error.max() <= 200 * EPS * np.linalg.cond(X / lengths) * (np.abs(truth) * lengths).max()
    assert abs(left / residual - 1) < 1e-6
    naive = np.linalg.solve(X.T @ X, X.T @ y)
    squares = y @ y - (X.T @ y) @ naive
    assert abs(squares / residual - 1) > 1e-5, "the naive residual must lose digits to compare with"


def test_nearly_dependent_columns_keep_the_coefficients_that_normal_equations_lose():
    stretch = np.linspace(0.98, 1.02, 41)
    X = np.stack([stress_per_unit(name, stretch) for name in ("C10", "m0", "m1", "m2")], axis=1)
    y = X @ [1.2, 0.1, -0.2, 0.3] + 1e-6 * np.sin(1e3 * stretch)
    truth, _ = exact_solution(X, y)
    found, _ = solution(of(X, y))
    naive = np.linalg.solve(X.T @ X, X.T @ y)
    size = np.linalg.norm(truth)
    assert np.linalg.norm(found - truth) <= 200 * EPS * np.linalg.cond(X) * size
    assert np.linalg.norm(naive - truth) > 200 * EPS * np.linalg.cond(X) * size


def of(X, y):
    rows = np.column_stack([X, y])
    return Statistics.of_rows(rows[start : start + 10] for start in range(0, len(rows), 10))


def test_a_million_measurements_by_chunks_are_those_of_their_replicated_stretches():
    # m replicates of k stretches: the rows are the same but for the errors, so all sums follow from k means.
    generator = np.random.default_rng(0)
    stretch = np.linspace(0.6, 2.0, 50)
    X = np.stack([stress_per_unit(name, stretch) for name in ("C10", "C20", "C30")], axis=1)
    replicates = 20_000
    errors = generator.standard_normal((replicates, 50))
    y = X @ [1.2, -0.057, 0.004] + 0.1 * errors

    def blocks():
        rows = np.column_stack([np.tile(X, (replicates, 1)), y.ravel()])
        yield from (rows[start : start + CHUNK] for start in range(0, len(rows), CHUNK))

    found = Statistics.of_rows(blocks())
    mean = y.mean(axis=0)
    weighted = of(np.sqrt(replicates) * X, np.sqrt(replicates) * mean)
    within = float(((y - mean) ** 2).sum())
    assert found.count == 1_000_000
    solved, left = solution(found)
    expected, part = solution(weighted)
    np.testing.assert_allclose(solved, expected, rtol=1e-10)
    assert left == pytest.approx(part + within, rel=1e-10)
    signs = np.sign(np.diag(found.triangle)) * np.sign(np.diag(weighted.triangle))
    np.testing.assert_allclose(found.triangle[:3, :3], (signs[:, None] * weighted.triangle)[:3, :3], rtol=1e-9)
