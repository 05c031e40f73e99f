"""One draw in one case, as a task that travels to a worker and whose result is plain data."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from time import perf_counter
from typing import Any

import numpy as np

from tissuq.ensemble import EnergyDraw
from tissuq.errors import ModelError
from tissuq.finite_elements.case import Case
from tissuq.finite_elements.distortional import distortional_energy
from tissuq.finite_elements.response import Response, respond

__all__ = ["Run", "Solve", "each_in_turn", "solved"]

DIGITS = 12
"""Of scaled parameters, by which equal materials are known."""


@dataclass(frozen=True, eq=False)
class Solve:
    """One draw in one case.

    Attributes
    ----------
    draw : EnergyDraw
        Divided by ``modulus`` where the stress is proportional to all parameters, so that materials that differ by a
        factor are one.
    modulus : float
        MPa.
    """

    case: Case
    draw: EnergyDraw
    modulus: float
    steps: int
    bulk_ratio: float
    most: tuple[float, float]

    @classmethod
    def of(
        cls, case: Case, draw: EnergyDraw, steps: int, bulk_ratio: float, most: tuple[float, float] = (np.inf, np.inf)
    ) -> Solve:
        """Return the task of a draw."""
        linear = all(each.is_linear for part, _ in draw.parts for each in part.parameters)
        if draw.discrepancy is not None or not linear:
            return cls(case, draw, 1.0, steps, bulk_ratio, most)
        modulus = distortional_energy(draw).initial_shear_modulus
        if not modulus > 0:  # the solver says what is wrong with it
            return cls(case, draw, 1.0, steps, bulk_ratio, most)
        scaled = ((part, tuple(float(f"{each / modulus:.{DIGITS}g}") for each in own)) for part, own in draw.parts)
        return cls(case, replace(draw, parts=tuple(scaled)), modulus, steps, bulk_ratio, most)

    @property
    def key(self) -> str:
        """What tells it from every other task: a digest of all its numbers."""
        digest = sha256(repr((self.case, self.draw.parts, self.steps, self.bulk_ratio, self.most)).encode())
        for pieces in self.draw.discrepancy or ():
            digest.update(np.array([pieces.start, pieces.step]).tobytes() + pieces.coefficients.tobytes())
        return digest.hexdigest()[:24]

    @property
    def label(self) -> str:
        """What is shown when it is done."""
        return f"draw {self.draw.number + 1}"


Run = Callable[[Sequence[Solve]], Sequence[dict[str, Any]]]
"""What carries out tasks: here one after another, in a study many at a time."""


def each_in_turn(tasks: Sequence[Solve]) -> Sequence[dict[str, Any]]:
    """Carry out tasks one after another."""
    return [solved(task) for task in tasks]


def solved(task: Solve) -> dict[str, Any]:
    """Return the response of a task as plain data, forces in N per MPa of its modulus; of a failure, its reason."""
    start = perf_counter()
    try:
        found = respond(task.case, task.draw, steps=task.steps, bulk_ratio=task.bulk_ratio, most=task.most)
    except ModelError as error:
        return {"reached": 0.0, "problem": str(error), "force": [None] * task.steps, "seconds": perf_counter() - start}
    return _plain(found) | {"seconds": perf_counter() - start}


def _plain(found: Response) -> dict[str, Any]:
    rows = {name: getattr(found, name) for name in ("force", "beyond", "energy_beyond")}
    fields = {name: np.round(value, 9).tolist() for name, value in vars(found.fields).items()}
    plain = {name: [None if np.isnan(each) else float(each) for each in row] for name, row in rows.items()}
    return plain | {
        "reached": found.reached,
        "problem": found.problem,
        "iterations": found.iterations,
        "fields": fields,
    }
