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
from typing import NamedTuple

import numpy as np

from tissuq.arrays import BoolArray, FloatArray, IndexArray
from tissuq.errors import ConvergenceError, InputError
from tissuq.finite_elements.case import Case
from tissuq.finite_elements.material import distortional_energy
from tissuq.finite_elements.solver import Solver
from tissuq.inference.threads import one_thread
from tissuq.mechanics.rays import through
from tissuq.posterior.ensemble import EnergyDraw, Ensemble

EXACT = 1e-12
"""Unevenness below which a draw is proportional to the reference."""
FAR = 3.0
"""How far a draw is, in logarithms of the unevenness, from those in full where none is on its side."""
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


class FirstOrderError(NamedTuple):
    """Relative errors of what is not computed in full: arrays (s,).

    Attributes
    ----------
    force : (s,) array
        Of the force of one draw that is not in full.
    mean, sd : (s,) arrays
        Of the mean and the standard deviation of all draws.
    """

    force: FloatArray
    mean: FloatArray
    sd: FloatArray


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
    """Return the numbers of the draws that are to be computed in full, each where least is known beside those before.

    That is the largest unevenness, times how far its logarithm is from that of the nearest draw in full on its side: of
    draws that stiffen, or of draws that soften. The reference, for which nothing is lacking, comes last.
    """
    uneven, softens = first_order.unevenness[:, -1], first_order.stiffening[:, -1] < 1
    logs, distances = np.log(np.maximum(uneven, EXACT)), np.full(len(uneven), FAR)
    numbers: list[int] = []
    for _ in range(min(count, len(uneven))):
        unknown = uneven * distances
        unknown[numbers] = -1.0
        number = int(np.argmax(unknown))
        numbers.append(number)
        distances = np.where(softens == softens[number], np.minimum(distances, np.abs(logs - logs[number])), distances)
    return sorted(numbers)


def controlled(first_order: FirstOrder, full: Mapping[int, Sequence[float]]) -> tuple[FloatArray, FirstOrderError]:
    """Return the forces (N, s) of all draws, corrected by those in full, and their errors.

    What first order lacks is taken as c times the unevenness, relative to the force. Between the draws in full c is
    interpolated over the logarithm of the unevenness, for draws that stiffen and for those that soften apart.

    The errors are found from each draw in full left out: that of a force from the errors of c, between which it is
    interpolated as c itself; those of mean and sd from how far these change, half the root of the sum of squares, as
    without a draw c is interpolated over twice the distance, and from the errors of forces, as if these were
    independent. Draws that are nearly proportional to the reference, for which nothing is lacking, say nothing of
    others.

    Parameters
    ----------
    first_order : FirstOrder
    full : mapping of int to (s,) array, N
        Forces by the number of the draw; not a number where it did not get that far.
    """
    numbers = np.array(sorted(full))
    wanted = np.full(first_order.forces.shape, np.nan)
    wanted[numbers] = [full[number] for number in numbers]
    steps = zip(first_order.forces.T, first_order.unevenness.T, first_order.stiffening.T < 1, wanted.T, strict=True)
    columns = [_at_step(plain, uneven, softens, full_then, numbers) for plain, uneven, softens, full_then in steps]
    forces, errors = zip(*columns, strict=True)
    return np.stack(forces, axis=1), FirstOrderError(*np.transpose(errors))


def _at_step(
    plain: FloatArray, uneven: FloatArray, softens: BoolArray, full: FloatArray, numbers: IndexArray
) -> tuple[FloatArray, tuple[float, float, float]]:
    """Return the forces (N,) at a step, and the errors of one that is not in full, of their mean and of their sd."""

    def factors(usable: IndexArray) -> FloatArray:
        lack = full[usable] / plain[usable] - 1
        return _factors(uneven, softens, uneven[usable], lack, softens[usable])

    def corrected(factors: FloatArray) -> FloatArray:
        return np.asarray(plain * np.maximum(1 + factors * uneven, LEAST_RATIO))

    usable = numbers[np.isfinite(full[numbers]) & (uneven[numbers] > EXACT)]
    factor = factors(usable)
    forces = corrected(factor)
    per_factor = plain * uneven / forces
    forces[numbers] = full[numbers]
    if not len(usable):
        return forces, (0.0, 0.0, 0.0)
    is_there, is_followed = np.isfinite(forces), ~np.isin(np.arange(len(plain)), numbers)
    mean, sd = forces[is_there].mean(), forces[is_there].std()
    telling, changes = usable[uneven[usable] >= LEAST_RATIO * uneven[usable].max()], []
    for number in telling:
        without = factors(usable[usable != number])
        then = corrected(without)[is_there]
        changes.append((abs(without[number] - factor[number]), then.mean() / mean - 1, then.std() / sd - 1))
    of_factor, *of_band = np.transpose(changes)
    force_errors = (
        _factors(uneven, softens, uneven[telling], of_factor * uneven[telling], softens[telling]) * per_factor
    )
    of_force = np.sqrt((force_errors[is_followed if is_followed.any() else telling] ** 2).mean())
    of_mean, of_sd = 0.5 * np.sqrt(np.square(of_band).sum(axis=1))
    independent = of_force * np.sqrt(is_followed.sum()) / len(plain)
    return forces, (
        float(of_force),
        float(np.hypot(of_mean, independent)),
        float(np.hypot(of_sd, independent * abs(mean) / sd)),
    )


def _factors(uneven: FloatArray, softens: BoolArray, near: FloatArray, lack: FloatArray, side: BoolArray) -> FloatArray:
    """Return what draws (N,) lack in their unevenness, from that of some (n,); zero where there are none."""
    factors = np.zeros(len(uneven))
    for is_soft in (False, True):
        used = side == is_soft if (side == is_soft).any() else np.ones(len(side), dtype=bool)
        order = np.argsort(near[used])
        if len(order):
            logs = np.log(near[used][order])
            interpolated = np.interp(np.log(np.maximum(uneven, EXACT)), logs, (lack[used] / near[used])[order])
            factors = np.where(softens == is_soft, interpolated, factors)
    return factors
