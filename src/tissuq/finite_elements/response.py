"""What a case gives with one material: forces, and the fields at every step; also as a task with plain data."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tissuq.arrays import FloatArray
from tissuq.errors import ConvergenceError, InputError, ModelError
from tissuq.finite_elements.bodies import ClampedBar, Indentation
from tissuq.finite_elements.case import Case
from tissuq.finite_elements.material import distortional_energy
from tissuq.finite_elements.solver import CellFields, Solver
from tissuq.inference.threads import one_thread
from tissuq.mechanics import Material, material_named
from tissuq.posterior.ensemble import EnergyDraw

BULK_RATIO = 2000.0
"""Bulk modulus in initial shear moduli: the volume changes by a thousandth where the pressure is two shear moduli."""


@dataclass(frozen=True)
class Response:
    """What a case gives with one material.

    Attributes
    ----------
    travel : (s,) array, mm
        Depths or elongations that were requested.
    force : (s,) array, N
        Not a number where the solver did not get that far.
    reached : float
        The largest travel that was reached, mm.
    problem : str
        Why the solver stopped early; empty where it reached the end.
    volume_beyond, energy_beyond : (s,) arrays
        The shares of the volume that is strained beyond the given invariants, and of the strain energy that is there.
    fields : CellFields
        Fields at the last requested travel that was reached.
    iterations : int
        Newton iterations, all load steps together.
    """

    travel: FloatArray
    force: FloatArray
    reached: float
    problem: str
    volume_beyond: FloatArray
    energy_beyond: FloatArray
    fields: CellFields
    iterations: int


def respond(
    case: Case,
    material: Material,
    values: ArrayLike | None = None,
    *,
    travel: ArrayLike | None = None,
    steps: int = 8,
    bulk_ratio: float = BULK_RATIO,
    max_invariants: tuple[float, float] = (np.inf, np.inf),
    at_step: Callable[[float, CellFields], None] | None = None,
) -> Response:
    """Return what a case gives with one material.

    Bilinear quadrilaterals with one pressure and one volume each (mean dilatation), which do not lock. A load step for
    which Newton's method fails is halved, up to six times.

    Parameters
    ----------
    case : Case
    material : Material
        A draw of an ensemble, or an isotropic material with values.
    values : (k,) array, optional
        The parameters of a material that is no draw.
    travel : (s,) array, mm, optional
        Increasing depths or elongations; otherwise equal steps of the case's own travel.
    steps : int
        Number of equal steps, where no travel is given.
    bulk_ratio : float
        Bulk modulus in initial shear moduli.
    max_invariants : (float, float)
        I1 - 3 and I2 - 3 beyond which volume is counted as strained too far.
    at_step : callable, optional
        Called with the travel and the fields of every step.

    Raises
    ------
    InputError, ModelError
        When FElupe is not installed, the material is none for finite elements, the travels do not increase, or the
        bulk modulus is too small for a nearly incompressible material.

    References
    ----------
    Simo, Taylor & Pister (1985), Variational and projection methods for the volume constraint.

    Examples
    --------
    >>> import tissuq as tq
    >>> bar = tq.finite_elements.ClampedBar(fineness=0.5)
    >>> found = tq.finite_elements.respond(bar, tq.materials()["neo-hookean"](), [0.0005], steps=2)
    >>> found.problem, found.force.shape, float(found.fields.largest.max().round(1))
    ('', (2,), 1.1)
    """
    travels = case.steps(steps) if travel is None else np.atleast_1d(np.asarray(travel, dtype=np.float64))
    if not np.isfinite(travels).all() or travels[0] <= 0 or (np.diff(travels) <= 0).any():
        raise InputError(
            f"each {case.travel_name} must be a positive number of {case.travel_unit}, and larger than the one before."
        )
    with one_thread():
        return _followed(Solver(case, material, values, bulk_ratio), travels, max_invariants, at_step)


def _followed(
    solver: Solver,
    travels: FloatArray,
    max_invariants: tuple[float, float],
    at_step: Callable[[float, CellFields], None] | None,
) -> Response:
    force, volume_beyond, energy = np.full((3, len(travels)), np.nan)
    fields, problem = solver.fields(), ""
    for step, target in enumerate(travels):
        problem = solver.advance(float(target))
        if problem:
            break
        force[step], fields = solver.force(), solver.fields()
        volume_beyond[step], energy[step] = solver.shares_beyond(max_invariants)
        if at_step is not None:
            at_step(solver.reached, fields)
    return Response(travels, force, solver.reached, problem, volume_beyond, energy, fields, solver.iterations)


def case_forces(
    case: Case,
    material: str | Material,
    values: ArrayLike | None,
    travel: ArrayLike,
    bulk_ratio: float = BULK_RATIO,
) -> FloatArray:
    """Return the forces (n,), N, at increasing depths or elongations (n,), mm.

    Raises
    ------
    ConvergenceError
        When the solver does not reach the last travel; the message names the last one reached.
    InputError, ModelError
        As `respond`.
    """
    kind = material_named(material)
    response = respond(case, kind, values, travel=travel, bulk_ratio=bulk_ratio)
    if response.problem:
        raise ConvergenceError(
            f"case '{case.name}' with material '{kind.name}' ended at a {case.travel_name} of "
            f"{response.reached:.3g} {case.travel_unit}: {response.problem}."
        )
    return response.force


def indentation_force(
    material: str | Material, values: ArrayLike | None, depths: ArrayLike, **sizes: Any
) -> FloatArray:
    """Return the forces (n,), N, of a flat rigid punch at depths (n,), mm, in increasing order.

    Parameters
    ----------
    material : str or Material
        Isotropic, or a draw of an ensemble (then without values).
    values : (k,) array or None
        Its parameters in their order; MPa where they are moduli.
    depths : (n,) array, mm
    **sizes
        Of `Indentation`: punch_radius, height, radius (mm), contact, fineness.

    Raises
    ------
    ConvergenceError, InputError, ModelError
        As `case_forces`.

    Examples
    --------
    >>> import tissuq as tq
    >>> force = tq.finite_elements.indentation_force("neo-hookean", [0.0005], [0.05, 0.1], fineness=0.5)
    >>> [round(1000 * float(each), 3) for each in force]  # mN
    [0.371, 0.74]
    """
    travel = np.atleast_1d(np.asarray(depths, dtype=np.float64))
    return case_forces(Indentation(depth=float(travel[-1]), **sizes), material, values, travel)


def bar_force(material: str | Material, values: ArrayLike | None, elongations: ArrayLike, **sizes: Any) -> FloatArray:
    """Return the forces (n,), N, of a clamped bar at elongations (n,), mm, in increasing order.

    Parameters and exceptions are those of `indentation_force`, with the sizes of `ClampedBar`.
    """
    travel = np.atleast_1d(np.asarray(elongations, dtype=np.float64))
    return case_forces(ClampedBar(elongation=float(travel[-1]), **sizes), material, values, travel)


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
        if draw.discrepancy is not None or not linear or case.response != Case.response:
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
            digest.update(pieces.knots.tobytes() + pieces.coefficients.tobytes())
        if self.draw.continuation is not None:
            digest.update(self.draw.continuation.coefficients.tobytes())
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
