"""What a case gives with one material: forces, and the fields at every step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tissuq.errors import InputError
from tissuq.finite_elements.case import Case
from tissuq.finite_elements.solver import CellFields, Solver
from tissuq.inference.threads import one_thread
from tissuq.mechanics import Material

__all__ = ["BULK_RATIO", "CellFields", "Response", "respond"]

FloatArray = NDArray[np.float64]

BULK_RATIO = 2000.0
"""Bulk modulus in initial shear moduli: the volume changes by a thousandth where the pressure is two shear moduli."""


@dataclass(frozen=True)
class Response:
    """What a case gives with one material.

    Attributes
    ----------
    travel : (s,) array, mm
        Depths or elongations that were asked for.
    force : (s,) array, N
        Not a number where the solver did not get that far.
    reached : float
        The largest travel that was reached, mm.
    problem : str
        Why not all of it was; empty where it was.
    beyond, energy_beyond : (s,) arrays
        The shares of the volume that is strained beyond the given invariants, and of the strain energy that is there.
    fields : CellFields
        At the last travel that was reached and asked for.
    iterations : int
        Newton iterations, all load steps together.
    """

    travel: FloatArray
    force: FloatArray
    reached: float
    problem: str
    beyond: FloatArray
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
    most: tuple[float, float] = (np.inf, np.inf),
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
        How many, where they are not given.
    bulk_ratio : float
        Bulk modulus in initial shear moduli.
    most : (float, float)
        I1 - 3 and I2 - 3 beyond which volume is counted as strained too far.
    at_step : callable, optional
        Told of the travel and the fields of every step.

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
    asked = case.steps(steps) if travel is None else np.atleast_1d(np.asarray(travel, dtype=np.float64))
    if not np.isfinite(asked).all() or asked[0] <= 0 or (np.diff(asked) <= 0).any():
        raise InputError(f"each {case.travel_name} must be a positive number of mm, and larger than the one before.")
    with one_thread():
        return _followed(Solver(case, material, values, bulk_ratio), asked, most, at_step)


def _followed(
    solver: Solver,
    asked: FloatArray,
    most: tuple[float, float],
    at_step: Callable[[float, CellFields], None] | None,
) -> Response:
    force, beyond, energy = np.full((3, len(asked)), np.nan)
    fields, problem = solver.fields(), ""
    for place, target in enumerate(asked):
        problem = solver.advance(float(target))
        if problem:
            break
        force[place], fields = solver.force(), solver.fields()
        beyond[place], energy[place] = solver.shares_beyond(most)
        if at_step is not None:
            at_step(solver.reached, fields)
    return Response(asked, force, solver.reached, problem, beyond, energy, fields, solver.iterations)
