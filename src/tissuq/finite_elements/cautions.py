"""What a reader of a simulation must know, in sentences."""

from __future__ import annotations

from collections import Counter

import numpy as np

from tissuq.finite_elements.simulation import ALONE, COMPLETE, Simulation
from tissuq.finite_elements.spread import PROBABILITY, held_probability, shares_of

__all__ = ["FAMILIES", "simulation_warnings"]

MOST_NAMED = 6
"""Draws that are named; all of them are in the table of failures."""
MUCH_ENERGY = 0.05
"""Share of the strain energy beyond what was measured that needs a word."""
COARSE = 0.03
"""Change of the force on a finer mesh that needs a word."""
NEGATIVE = -0.05
"""Share of the variance below which a compensation is told."""
FAMILIES = {
    "complete": "draws",
    "alone": "draws without their discrepancy",
    "without": "draws of the fit without discrepancy",
}


def simulation_warnings(found: Simulation) -> list[str]:
    """Return what a reader must know."""
    return [*_failed(found), *_strained_too_far(found), *_compensated(found), *_few(found), *_coarse(found)]


def _failed(found: Simulation) -> list[str]:
    """Return a sentence for each family of draws of which some did not get to the end."""
    name, texts = found.case.travel_name, []
    for family, count in Counter(each.family for each in found.failures).items():
        own = sorted((each for each in found.failures if each.family == family), key=lambda each: each.reached)
        named = "; ".join(f"draw {each.number + 1} at {each.reached:.3g} mm" for each in own[:MOST_NAMED])
        more = f"; and {count - MOST_NAMED} more, see failures.csv" if count > MOST_NAMED else ""
        texts.append(
            f"{count} of {len(found.forces[family])} {FAMILIES[family]} did not get to the full {name} of "
            f"{found.case.travel:.3g} mm ({named}{more}; first reason: {own[0].problem}). Every step is told of the "
            "draws that got there, which may no longer be a fair sample."
        )
    return texts


def _strained_too_far(found: Simulation) -> list[str]:
    is_there = np.isfinite(found.energy_beyond)
    last = np.flatnonzero(is_there.any(axis=0))[-1]
    volume, energy = (float(rows[is_there[:, last], last].mean()) for rows in (found.beyond, found.energy_beyond))
    if energy < MUCH_ENERGY:
        return []
    first, second = found.most
    return [
        f"At {found.travel[last]:.3g} mm {100 * volume:.2g} % of the volume, with {100 * energy:.0f} % of the strain "
        f"energy, is strained beyond what was measured (I1 - 3 up to {first:.3g}, I2 - 3 up to {second:.3g}). There "
        "the material's law goes on and the discrepancy keeps the slopes it ends with: the band does not hold what the "
        "tissue may do there."
    ]


def _compensated(found: Simulation) -> list[str]:
    if ALONE not in found.forces:
        return []
    complete, alone = found.forces[COMPLETE], found.forces[ALONE]
    there = np.isfinite(complete) & np.isfinite(alone)
    steps = [place for place in range(there.shape[1]) if there[:, place].sum() > 1]
    least = 0.0
    for place in steps:
        own = there[:, place]
        shares = shares_of(complete[own, place, None], alone[own, place, None], found.noise_sd)
        least = min(least, float(shares.parameters[0]), float(shares.discrepancy[0]))
    if least > NEGATIVE:
        return []
    return [
        "A share of the variance is negative: parameters and discrepancy compensate each other, because the "
        "measurements know their sum better than either. Varying only one of them would overstate the uncertainty."
    ]


def _few(found: Simulation) -> list[str]:
    count = int(np.isfinite(found.forces[COMPLETE]).sum(axis=0).max())
    held = held_probability(count)
    if held >= PROBABILITY:
        return []
    return [f"{count} draws are too few for a band of 95 %: it is their range, which holds {100 * held:.0f} %."]


def _coarse(found: Simulation) -> list[str]:
    if found.mesh_change is None or abs(found.mesh_change[0]) < COARSE:
        return []
    change, travel = found.mesh_change
    return [
        f"On a mesh of twice the fineness the force at {travel:.3g} mm changes by {100 * change:+.1f} %: the mesh is "
        "coarse for it."
    ]
