"""The shares that the discrepancy carries: computed once for each posterior, and of all tests whatever their order."""

from __future__ import annotations

import gc

import pytest

import tissuq as tq
from tissuq.assessment import shares


class Posterior:
    """Stands for a solution."""


def test_shares_are_computed_once_for_each_posterior_and_forgotten_with_it(monkeypatch):
    computed = []
    monkeypatch.setattr(shares, "_computed", lambda solution: computed.append(solution) or len(computed))
    solutions = [Posterior() for _ in range(30)]
    first = [shares.shares_of_discrepancy(solution) for solution in solutions]
    assert [shares.shares_of_discrepancy(solution) for solution in solutions] == first == list(range(1, 31))
    gc.collect()  # of what other tests left
    before = len(shares._SHARES)
    computed.clear()
    solutions.clear()
    gc.collect()
    assert len(shares._SHARES) == before - 30


def test_the_share_of_the_initial_stiffness_is_that_of_all_tests_in_any_order():
    """It had been that of the first one: 25 % if this was in tension, next to none if it was equibiaxial."""
    truth, stretch = {"C10": 0.5, "C20": 0.1, "C30": 0.02}, [0.85, 0.9, 0.95, 1.05, 1.1, 1.15, 1.2, 1.3]
    tests = [tq.simulate("yeoh", truth, part, 0.01, mode=mode, seed=seed) for seed, (mode, part) in
             enumerate([("uniaxial", stretch), ("planar", stretch[:5]), ("equibiaxial", stretch[3:])])]  # fmt: skip
    found = [
        shares.shares_of_discrepancy(tq.fit(order, discrepancy="gp", noise_sd=0.01).solution)[1]
        for order in (tests, tests[::-1])
    ]
    assert found[0] == pytest.approx(found[1], abs=0.1)  # 2000 draws
    assert abs(found[0][0]) > 0.15
