"""Forces of all draws from the deformation of one, with the same few draws computed in full to correct the rest.

The force is the rate of the energy along an equilibrium. Where the energy changes from one draw's to another's, so does
the deformation, but that changes the force in second order only: to first order it is the power of the other draw's
stresses on the first one's rates of strain, an integral over its volume that needs no further solution.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import ConvergenceError
from tissuq.finite_elements.case import Case
from tissuq.finite_elements.material import distortional_energy
from tissuq.finite_elements.solver import Solver, StrainPath
from tissuq.inference.threads import one_thread
from tissuq.mechanics.rays import through
from tissuq.posterior.ensemble import EnergyDraw, Ensemble

__all__ = ["FirstOrder", "controlled", "draws_in_full", "first_order_forces"]

FloatArray = NDArray[np.float64]

EXACT = 1e-9
"""Difference of the stiffening from one below which a draw is proportional to the reference."""


@dataclass(frozen=True, eq=False)
class FirstOrder:
    """Forces to first order around a reference draw.

    Attributes
    ----------
    forces : (N, s) array, N
    stiffening : (N, s) array
        The force over the initial shear modulus, relative to that of the reference: one where a draw is proportional
        to the reference, for which the forces are exact.
    """

    forces: FloatArray
    stiffening: FloatArray


def first_order_forces(
    case: Case, ensemble: Ensemble, reference: EnergyDraw, steps: int, bulk_ratio: float
) -> FirstOrder:
    """Return the forces of draws in a case from the equilibria of a reference draw.

    Parameters
    ----------
    case : Case
    ensemble : Ensemble
        N draws.
    reference : EnergyDraw
        Best one in their middle.
    steps : int
        Number of equal steps of the case's travel.
    bulk_ratio : float
        Bulk modulus of every draw in its initial shear modulus.

    Raises
    ------
    ConvergenceError
        When the reference does not reach the end.
    """
    moduli = np.array([distortional_energy(draw).initial_shear_modulus for draw in ensemble])
    columns = []
    with one_thread():
        solver = Solver(case, reference, None, bulk_ratio)
        for target in case.steps(steps):
            problem = solver.advance(float(target))
            if problem:
                raise ConvergenceError(
                    f"case '{case.name}': the draw in the middle ended at a {case.travel_name} of "
                    f"{solver.reached:.3g} mm ({problem}), so that the others cannot follow from it: compute all in "
                    "full (no --full-runs)."
                )
            columns.append(_forces(ensemble, moduli, solver.strain_path()))
    forces = np.stack(columns, axis=1)
    per_modulus = forces / moduli[:, None]
    reference_row = per_modulus[[draw is reference for draw in ensemble].index(True)]
    return FirstOrder(forces, per_modulus / reference_row)


def _forces(ensemble: Ensemble, moduli: FloatArray, path: StrainPath) -> FloatArray:
    """Return the power (N,) of the stresses of draws on the strain rates of a path."""
    power = ensemble.stresses_at(through(path.logs, path.rates)) @ path.volumes
    return np.asarray(power + moduli * path.volumetric_power)


def draws_in_full(first_order: FirstOrder, count: int) -> list[int]:
    """Return the numbers of the draws that are to be computed in full.

    Half of them are those whose last stiffening differs most from one, where first order is least exact; the others are
    spread evenly over the order of all remaining ones.
    """
    order = np.argsort(-np.abs(first_order.stiffening[:, -1] - 1))
    if count >= len(order):
        return sorted(order.tolist())
    far, remaining = order[: (count + 1) // 2], order[(count + 1) // 2 :]
    between = remaining[np.linspace(0, len(remaining) - 1, count - len(far)).round().astype(int)]
    return sorted({*far.tolist(), *between.tolist()})


def controlled(first_order: FirstOrder, full: Mapping[int, Sequence[float]]) -> tuple[FloatArray, FloatArray]:
    """Return the forces (N, s) of all draws, corrected by those in full, and the error (s,) of one that is not in full.

    What first order lacks is of second order in the stiffening: its relative error is c (stiffening - 1)^2, with c from
    the draws in full, of which the farther ones count less. The error is what that leaves of the nearer half of the
    draws in full, each left out of the estimate of c: root mean square, relative to the force. Those that are
    proportional to the reference, for which nothing is lacking, say nothing about others.

    Parameters
    ----------
    first_order : FirstOrder
    full : mapping of int to (s,) array, N
        Forces by the number of the draw; not a number where it did not get that far.
    """
    numbers = np.array(sorted(full))
    wanted = np.array([full[number] for number in numbers], dtype=np.float64)
    lack = wanted / first_order.forces[numbers] - 1
    squares = (first_order.stiffening - 1) ** 2
    near = squares[numbers]
    weights = np.where(np.isfinite(lack), 1 / (near + near.mean(axis=0)), 0.0)
    products, sizes = weights * near * np.nan_to_num(lack), weights * near**2
    with np.errstate(invalid="ignore", divide="ignore"):
        factor = np.nan_to_num(products.sum(axis=0) / sizes.sum(axis=0))
        without_one = np.nan_to_num((products.sum(axis=0) - products) / (sizes.sum(axis=0) - sizes))
    forces = first_order.forces * (1 + factor * squares)
    forces[numbers] = wanted
    left = (lack - without_one * near) * np.where(np.isfinite(lack), 1.0, np.nan)
    return forces, np.sqrt(np.nanmean(_typical(left, near) ** 2, axis=0))


def _typical(left: FloatArray, near: FloatArray) -> FloatArray:
    """Return what is left of the draws in full without the farther half, and those that lack nothing."""
    order = np.argsort(near[:, -1])
    typical = order[: max(1, len(left) // 2)]
    lacking = typical[near[typical, -1] > EXACT**2]
    return left[lacking] if len(lacking) else left[typical]
