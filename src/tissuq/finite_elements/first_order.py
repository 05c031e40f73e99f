"""Forces of all draws from the deformation of one, with the same few draws computed in full to correct the rest.

The force is the rate of the energy along an equilibrium. Where the energy changes from one draw's to another's, so does
the deformation, but that changes the force in second order only: to first order it is the power of the other draw's
stresses on the first one's rates of strain, an integral over its volume that needs no further solution.

That is the force of a body whose strains do not give way where the other draw is softer: the arithmetic mean of how
many times as stiff it is, as in Voigt's bound of a mixture. If they alone gave way, it would be the harmonic mean, as
in Reuss's. What first order lacks is nearly in proportion to the distance of the two.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import ConvergenceError, InputError
from tissuq.finite_elements.case import Case
from tissuq.finite_elements.material import distortional_energy
from tissuq.finite_elements.solver import Solver
from tissuq.inference.threads import one_thread
from tissuq.mechanics.rays import through
from tissuq.posterior.ensemble import EnergyDraw, Ensemble

__all__ = ["FirstOrder", "controlled", "draws_in_full", "first_order_forces"]

FloatArray = NDArray[np.float64]

EXACT = 1e-12
"""Unevenness below which a draw is proportional to the reference."""
LEAST_RATIO, LEAST_POWER = 0.02, 1e-9
"""Smallest ratio of stresses over their mean, and smallest power of a point over the largest, that count."""


@dataclass(frozen=True, eq=False)
class FirstOrder:
    """Forces to first order around a reference draw.

    Attributes
    ----------
    forces : (N, s) array, N
    stiffening : (N, s) array
        The force over the initial shear modulus, relative to that of the reference: one where a draw is proportional
        to the reference.
    unevenness : (N, s) array
        One minus the harmonic over the arithmetic mean, over the power of the reference's stresses, of how many times
        as large the draw's stresses are: zero where a draw is proportional to the reference, whose force is exact.
    """

    forces: FloatArray
    stiffening: FloatArray
    unevenness: FloatArray


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
    InputError
        When the response of the case is no force.
    """
    if case.response != Case.response:
        raise InputError(f"case '{case.name}' answers with a {case.response}: compute all draws in full, not a few.")
    moduli = np.array([distortional_energy(draw).initial_shear_modulus for draw in ensemble])
    number = [draw is reference for draw in ensemble].index(True)
    columns, uneven = [], []
    with one_thread():
        solver = Solver(case, reference, None, bulk_ratio)
        for target in case.steps(steps):
            problem = solver.advance(float(target))
            if problem:
                raise ConvergenceError(
                    f"case '{case.name}': the draw in the middle ended at a {case.travel_name} of "
                    f"{case.shown(solver.reached)} ({problem}), so that the others cannot follow from it: compute all "
                    "in full (no --full-runs)."
                )
            path = solver.strain_path()
            powers = ensemble.stresses_at(through(path.logs, path.rates)) * path.volumes
            columns.append(powers.sum(axis=1) + moduli * path.volumetric_power)
            uneven.append(_unevenness(powers / moduli[:, None], number))
    forces = np.stack(columns, axis=1)
    per_modulus = forces / moduli[:, None]
    return FirstOrder(forces, per_modulus / per_modulus[number], np.stack(uneven, axis=1))


def _unevenness(powers: FloatArray, reference: int) -> FloatArray:
    """Return the unevenness (N,) of draws from the powers (N, n) of their stresses at points, over their moduli."""
    weights = np.abs(powers[reference])
    used = weights > LEAST_POWER * weights.max()
    weights = weights[used] / weights[used].sum()
    ratios = powers[:, used] / powers[reference, used]
    ratios = np.maximum(ratios, LEAST_RATIO * np.abs(ratios @ weights)[:, None])
    return np.asarray(np.maximum(1 - 1 / ((1 / ratios) @ weights) / (ratios @ weights), 0.0))


def draws_in_full(first_order: FirstOrder, count: int) -> list[int]:
    """Return the numbers of the draws that are to be computed in full.

    Half of them are those whose last unevenness is largest, where first order is least exact, of draws that stiffen and
    of draws that soften in turn; the others are spread evenly over the order of all remaining ones.
    """
    order = np.argsort(-first_order.unevenness[:, -1])
    if count >= len(order):
        return sorted(order.tolist())
    is_soft = first_order.stiffening[order, -1] < 1
    in_turn = np.argsort(np.where(is_soft, np.cumsum(is_soft), np.cumsum(~is_soft)), kind="stable")
    far = order[in_turn[: (count + 1) // 2]]
    remaining = order[~np.isin(order, far)]
    between = remaining[np.linspace(0, len(remaining) - 1, count - len(far)).round().astype(int)]
    return sorted({*far.tolist(), *between.tolist()})


def controlled(first_order: FirstOrder, full: Mapping[int, Sequence[float]]) -> tuple[FloatArray, FloatArray]:
    """Return the forces (N, s) of all draws, corrected by those in full, and the error (s,) of one that is not in full.

    What first order lacks is taken as c times the unevenness, relative to the force. Between the draws in full c is
    interpolated over the logarithm of the unevenness, for draws that stiffen and for those that soften apart. The error
    is that of c, from each draw in full left out, times the unevenness of the draws that are not in full, both as root
    mean squares. Draws that are nearly proportional to the reference, for which nothing is lacking, say nothing of
    others.

    Parameters
    ----------
    first_order : FirstOrder
    full : mapping of int to (s,) array, N
        Forces by the number of the draw; not a number where it did not get that far.
    """
    numbers = np.array(sorted(full))
    wanted = np.array([full[number] for number in numbers], dtype=np.float64)
    lack = wanted / first_order.forces[numbers] - 1
    uneven, softens = first_order.unevenness, first_order.stiffening < 1
    forces, errors = first_order.forces.copy(), np.zeros(len(lack.T))
    for step, lack_then in enumerate(lack.T):
        near, side = uneven[numbers, step], softens[numbers, step]
        known = np.flatnonzero(np.isfinite(lack_then) & (near > EXACT))
        factor = _factors(uneven[:, step], softens[:, step], near[known], lack_then[known], side[known])
        forces[:, step] *= np.maximum(1 + factor * uneven[:, step], LEAST_RATIO)
        apart = np.zeros(len(known))
        for place, row in enumerate(known):
            others = np.delete(known, place)
            without = _factors(near[[row]], side[[row]], near[others], lack_then[others], side[others])
            apart[place] = lack_then[row] / near[row] - without[0]
        if len(known):
            followed = np.delete(uneven[:, step], numbers) if len(numbers) < len(uneven) else near
            of_factor = (apart[near[known] >= LEAST_RATIO * near[known].max()] ** 2).mean()
            errors[step] = np.sqrt(of_factor * (followed**2).mean())
    forces[numbers] = wanted
    return forces, errors


def _factors(
    uneven: FloatArray, softens: NDArray[np.bool_], near: FloatArray, lack: FloatArray, side: NDArray[np.bool_]
) -> FloatArray:
    """Return what draws (N,) lack in their unevenness, from that of some (n,); zero where there are none."""
    factors = np.zeros(len(uneven))
    for is_soft in (False, True):
        used = side == is_soft if (side == is_soft).any() else np.ones(len(side), dtype=bool)
        order = np.argsort(near[used])
        if len(order):
            logs = np.log(near[used][order])
            own = np.interp(np.log(np.maximum(uneven, EXACT)), logs, (lack[used] / near[used])[order])
            factors = np.where(softens == is_soft, own, factors)
    return factors
