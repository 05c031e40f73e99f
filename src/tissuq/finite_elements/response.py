"""What a case gives with one material: forces, and the fields at every step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tissuq.errors import ConvergenceError, InputError
from tissuq.finite_elements.case import Case
from tissuq.finite_elements.clamped_bar import ClampedBar
from tissuq.finite_elements.indentation import Indentation
from tissuq.finite_elements.solver import CellFields, Solver
from tissuq.inference.threads import one_thread
from tissuq.mechanics import Material, material_named

__all__ = ["BULK_RATIO", "CellFields", "Response", "bar_force", "case_forces", "indentation_force", "respond"]

FloatArray = NDArray[np.float64]

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
        When FElupe is not installed, the material is none for finite elements, or the travels do not increase.

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
        raise InputError(f"each {case.travel_name} must be a positive number of mm, and larger than the one before.")
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
) -> NDArray[np.float64]:
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
            f"{response.reached:.3g} mm: {response.problem}."
        )
    return response.force


def indentation_force(
    material: str | Material, values: ArrayLike | None, depths: ArrayLike, **sizes: Any
) -> NDArray[np.float64]:
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


def bar_force(
    material: str | Material, values: ArrayLike | None, elongations: ArrayLike, **sizes: Any
) -> NDArray[np.float64]:
    """Return the forces (n,), N, of a clamped bar at elongations (n,), mm, in increasing order.

    Parameters and exceptions are those of `indentation_force`, with the sizes of `ClampedBar`.
    """
    travel = np.atleast_1d(np.asarray(elongations, dtype=np.float64))
    return case_forces(ClampedBar(elongation=float(travel[-1]), **sizes), material, values, travel)
