"""What one fit gave, in numbers that all libraries share, and the loop that fits and prints all seven."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from time import perf_counter
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from peers.problem import FORMULATIONS, Problem

__all__ = ["Chains", "Known", "Weighted", "fit_all"]

Floats = NDArray[np.float64]
Row = dict[str, float | None]


class Outcome(Protocol):
    """Anything that can say what it knows of C10, the first parameter, and how well."""

    def row(self) -> Row:
        """Return mean, sd, ess, ess_C10, rhat, log_evidence and log_evidence_error; None for what it has not."""


@dataclass(frozen=True)
class Known:
    """A posterior in closed form with independent draws."""

    mean: float
    sd: float
    draws: int
    log_evidence: float | None

    def row(self) -> Row:
        ess = float(self.draws)
        return _row(self.mean, self.sd, ess, ess, log_evidence=self.log_evidence, log_evidence_error=0.0)


@dataclass(frozen=True)
class Chains:
    """Markov chains: (chains, draws, d)."""

    values: Floats

    @cached_property
    def quality(self) -> tuple[Floats, Floats]:
        """ESS of each parameter, the lesser of bulk and tail, and R-hat: (d,) each."""
        from arviz_stats.base import array_stats

        axes = {"chain_axis": 0, "draw_axis": 1}
        bulk = array_stats.ess(self.values, method="bulk", **axes)
        tail = array_stats.ess(self.values, method="tail", prob=0.05, **axes)
        return np.minimum(bulk, tail), array_stats.rhat(self.values, **axes)

    def row(self) -> Row:
        ess, rhat = self.quality
        first = self.values[:, :, 0]
        return _row(first.mean(), first.std(), ess.min(), ess[0], rhat=rhat.max())


@dataclass(frozen=True)
class Weighted:
    """Nested samples: (m, d) points with normalised weights, and the evidence."""

    points: Floats
    weights: Floats
    log_evidence: float
    log_evidence_error: float

    def row(self) -> Row:
        mean = self.weights @ self.points[:, 0]
        sd = np.sqrt(self.weights @ (self.points[:, 0] - mean) ** 2)
        ess = 1 / (self.weights**2).sum()
        evidence, error = float(self.log_evidence), float(self.log_evidence_error)
        return _row(mean, sd, ess, ess, log_evidence=evidence, log_evidence_error=error)


def _row(mean: float, sd: float, ess: float, ess_C10: float, **others: float | None) -> Row:
    known = {"mean": mean, "sd": sd, "ess": ess, "ess_C10": ess_C10} | others
    numbers = {name: None if value is None else float(value) for name, value in known.items()}
    return dict.fromkeys(("rhat", "log_evidence", "log_evidence_error")) | numbers


def fit_all(fit: Callable[[Problem], Outcome]) -> None:
    """Fit all seven formulations and print one line of JSON.

    The line holds the row and the seconds of every formulation, and the seconds that the diagnostics took: they are
    the benchmark's, not the library's, and the caller takes them off the wall time.
    """
    outcomes, seconds = {}, {}
    for name in FORMULATIONS:
        start = perf_counter()
        outcomes[name] = fit(Problem(name))
        seconds[name] = perf_counter() - start
    start = perf_counter()
    rows = {name: outcome.row() | {"seconds": seconds[name]} for name, outcome in outcomes.items()}
    print(json.dumps({"fits": rows, "diagnostics_seconds": perf_counter() - start}))
