"""Least squares under inequalities: against SciPy's general minimiser, and conditions that are added where broken."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from tissuq.export.nearest_law import constrained_least_squares, fit_within, least_squares


def problem(seed, unknowns=4, equations=12, inequalities=6):
    generator = np.random.default_rng(seed)
    columns, wanted = generator.normal(size=(equations, unknowns)), generator.normal(size=equations)
    rows = generator.normal(size=(inequalities, unknowns))
    bounds = rows @ generator.normal(size=unknowns) - 0.1
    return columns, wanted, rows, bounds


@pytest.mark.parametrize("seed", range(6))
def test_the_solution_is_that_of_a_general_minimiser(seed):
    columns, wanted, rows, bounds = problem(seed)
    found = constrained_least_squares(columns, wanted, (rows, bounds))
    assert (rows @ found >= bounds - 1e-9).all()
    best = minimize(
        lambda x: ((columns @ x - wanted) ** 2).sum(),
        np.zeros(columns.shape[1]),
        constraints={"type": "ineq", "fun": lambda x: rows @ x - bounds},
        method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 500},
    )
    assert found == pytest.approx(best.x, abs=1e-5)


def test_columns_of_very_different_sizes_are_no_hindrance():
    columns, wanted, rows, bounds = problem(1)
    sizes = np.array([1e-6, 1.0, 1e4, 1e8])
    scaled = constrained_least_squares(columns * sizes, wanted, (rows * sizes, bounds))
    plain = constrained_least_squares(columns, wanted, (rows, bounds))
    assert scaled * sizes == pytest.approx(plain, rel=1e-6)


def test_conditions_that_contradict_each_other_have_no_solution():
    rows, bounds = np.array([[1.0, 0.0], [-1.0, 0.0]]), np.array([1.0, 1.0])
    assert constrained_least_squares(np.eye(2), np.zeros(2), (rows, bounds)) is None
    assert fit_within(np.eye(2), np.zeros(2), lambda x: (rows, bounds)) is None


def test_what_does_not_converge_has_no_solution(monkeypatch):
    def nnls(*arguments, **options):
        raise RuntimeError("Maximum number of iterations reached.")

    columns, wanted, rows, bounds = problem(1)
    bounds = bounds + 1 - (bounds - rows @ least_squares(columns, wanted)).max()  # one is broken
    assert constrained_least_squares(columns, wanted, (rows, bounds)) is not None
    monkeypatch.setattr("scipy.optimize.nnls", nnls)
    assert constrained_least_squares(columns, wanted, (rows, bounds)) is None


def test_a_convex_condition_is_met_by_its_tangents():
    """The nearest point of the unit disc to (3, 4) is (0.6, 0.8)."""

    def outside(point):
        length = np.linalg.norm(point)
        if length <= 1 + 1e-9:
            return np.zeros((0, 2)), np.zeros(0)
        return -point[None] / length, np.array([-1.0])

    assert fit_within(np.eye(2), np.array([3.0, 4.0]), outside) == pytest.approx([0.6, 0.8], abs=1e-6)


def test_without_a_broken_condition_it_is_the_plain_fit():
    columns, wanted, *_ = problem(2)
    found = fit_within(columns, wanted, lambda x: (np.zeros((0, len(x))), np.zeros(0)))
    assert found == pytest.approx(np.linalg.lstsq(columns, wanted, rcond=None)[0])
    assert found == pytest.approx(least_squares(columns, wanted))
