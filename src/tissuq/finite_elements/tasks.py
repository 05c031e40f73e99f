"""One draw in one case, as a task that travels to a worker and whose result is plain data."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from time import perf_counter
from typing import Any

import numpy as np

from tissuq.errors import ModelError
from tissuq.finite_elements.case import Case
from tissuq.finite_elements.material import distortional_energy
from tissuq.finite_elements.response import Response, respond
from tissuq.posterior.ensemble import EnergyDraw

__all__ = ["Run", "Solve", "run_in_turn", "solved"]

SIGNIFICANT_DIGITS = 12
"""Significant digits of scaled parameters by which equal materials are recognised."""


@dataclass(frozen=True, eq=False)
class Solve:
    """One draw in one case.

    Attributes
    ----------
    draw : EnergyDraw
        Divided by ``modulus`` where the stress is proportional to all parameters, so that materials that differ by a
        factor are one.
    modulus : float
        Factor, MPa, by which parameters and results are to be multiplied.
    """

    case: Case
    draw: EnergyDraw
    modulus: float
    steps: int
    bulk_ratio: float
    max_invariants: tuple[float, float]

    @classmethod
    def of(
        cls,
        case: Case,
        draw: EnergyDraw,
        steps: int,
        bulk_ratio: float,
        max_invariants: tuple[float, float] = (np.inf, np.inf),
    ) -> Solve:
        """Return the task of a draw."""
        linear = all(parameter.is_linear for material, _ in draw.parts for parameter in material.parameters)
        if draw.discrepancy is not None or not linear:
            return cls(case, draw, 1.0, steps, bulk_ratio, max_invariants)
        modulus = distortional_energy(draw).initial_shear_modulus
        if not modulus > 0:  # the solver refuses it with a reason
            return cls(case, draw, 1.0, steps, bulk_ratio, max_invariants)
        scaled = tuple((material, _rounded(np.array(values) / modulus)) for material, values in draw.parts)
        return cls(case, replace(draw, parts=scaled), modulus, steps, bulk_ratio, max_invariants)

    @property
    def key(self) -> str:
        """A digest of all its numbers, which identifies the task."""
        digest = sha256(repr((self.case, self.draw.parts, self.steps, self.bulk_ratio, self.max_invariants)).encode())
        for pieces in self.draw.discrepancy or ():
            digest.update(np.array([pieces.start, pieces.step]).tobytes() + pieces.coefficients.tobytes())
        return digest.hexdigest()[:24]

    @property
    def label(self) -> str:
        """The text shown when the task is done."""
        return f"draw {self.draw.number + 1}"


def _rounded(values: Iterable[float]) -> tuple[float, ...]:
    return tuple(float(f"{value:.{SIGNIFICANT_DIGITS}g}") for value in values)


Run = Callable[[Sequence[Solve]], Sequence[dict[str, Any]]]
"""A function that carries out tasks: here one after another, in a study many at a time."""


def run_in_turn(tasks: Sequence[Solve]) -> Sequence[dict[str, Any]]:
    """Carry out tasks one after another."""
    return [solved(task) for task in tasks]


def solved(task: Solve) -> dict[str, Any]:
    """Return the response of a task as plain data, forces in N per MPa of its modulus; of a failure, its reason."""
    start = perf_counter()
    try:
        response = respond(
            task.case,
            task.draw,
            steps=task.steps,
            bulk_ratio=task.bulk_ratio,
            max_invariants=task.max_invariants,
        )
    except ModelError as error:
        return {"reached": 0.0, "problem": str(error), "force": [None] * task.steps, "seconds": perf_counter() - start}
    return _plain(response) | {"seconds": perf_counter() - start}


def _plain(response: Response) -> dict[str, Any]:
    rows = {name: getattr(response, name) for name in ("force", "volume_beyond", "energy_beyond")}
    fields = {name: np.round(value, 9).tolist() for name, value in vars(response.fields).items()}
    plain = {name: [None if np.isnan(value) else float(value) for value in row] for name, row in rows.items()}
    return plain | {
        "reached": response.reached,
        "problem": response.problem,
        "iterations": response.iterations,
        "fields": fields,
    }
