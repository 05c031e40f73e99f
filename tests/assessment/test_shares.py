"""The share of the stress that the discrepancy carries is computed once for each posterior, however many there are."""

from __future__ import annotations

import gc

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
