"""Warnings about a simulation: draws that failed, strains beyond the measured ones, few draws, a coarse mesh."""

from __future__ import annotations

import numpy as np

from tissuq.export.cards import NEARLY
from tissuq.finite_elements.simulation import COMPLETE, FAMILIES, MATERIAL_ONLY, Simulation
from tissuq.finite_elements.spread import shares_of, too_few_draws
from tissuq.posterior.draws_in_words import failed_draws

MIN_ENERGY_SHARE = 0.05
"""Share of the strain energy beyond the measured invariants from which a warning is given."""

MIN_MESH_CHANGE = 0.03
"""Relative change of the force on a finer mesh from which a warning is given."""

MAX_FIRST_ORDER_ERROR = 0.05
"""Largest error of mean or sd, in sds, by draws that are not computed in full without a warning."""

MIN_IN_FULL = 8
"""Draws in full below which they do not tell the error that the others have: in tests it was up to three times that."""

MAX_NEGATIVE_SHARE = -0.05
"""Share of the variance below which parameters and discrepancy are said to compensate each other."""


def simulation_warnings(simulation: Simulation) -> list[str]:
    """Return all warnings about a simulation."""
    checks = _failed, _softer_in_volume, _extrapolated, _compensated, _too_few_draws, _few_in_full, _coarse_mesh
    return [sentence for check in checks for sentence in check(simulation)]


def _failed(simulation: Simulation) -> list[str]:
    totals = {family: len(forces) for family, forces in simulation.forces.items()}
    return failed_draws(
        simulation.failures,
        totals,
        FAMILIES,
        f"at {{:.3g}} {simulation.case.travel_unit}",
        "failures.csv has all of them.",
    )


def _softer_in_volume(simulation: Simulation) -> list[str]:
    if simulation.bulk_ratio >= NEARLY:
        return []
    return [
        f"The bulk modulus is {simulation.bulk_ratio:.3g} times the initial shear modulus: the volume changes, while "
        "the measurements were understood as those of an incompressible material."
    ]


def _extrapolated(simulation: Simulation) -> list[str]:
    is_reached = np.isfinite(simulation.energy_beyond)
    last = np.flatnonzero(is_reached.any(axis=0))[-1]
    shares = simulation.volume_beyond, simulation.energy_beyond
    volume, energy = (float(rows[is_reached[:, last], last].mean()) for rows in shares)
    if energy < MIN_ENERGY_SHARE:
        return []
    max_1, max_2 = simulation.max_invariants
    travel = simulation.case.shown(simulation.travel[last])
    return [
        f"At {travel}, {100 * volume:.2g} % of the volume, with {100 * energy:.0f} % of the "
        f"strain energy, is strained beyond what was measured (I1 - 3 up to {max_1:.3g}, I2 - 3 up to {max_2:.3g}). "
        "There the energy of every draw goes on as it ends, with an error that grows with the strain."
    ]


def _compensated(simulation: Simulation) -> list[str]:
    if MATERIAL_ONLY not in simulation.forces:
        return []
    complete, material_only = simulation.forces[COMPLETE], simulation.forces[MATERIAL_ONLY]
    is_reached = np.isfinite(complete) & np.isfinite(material_only)
    steps = [step for step in range(is_reached.shape[1]) if is_reached[:, step].sum() > 1]
    smallest = 0.0
    for step in steps:
        rows = is_reached[:, step]
        reached = {name: columns[rows] for name, columns in simulation.ensembles[COMPLETE].sources.items()}
        shares = shares_of(complete[rows, step, None], material_only[rows, step, None], simulation.noise_sd, reached)
        smallest = min(smallest, float(shares.parameters[0]), float(shares.discrepancy[0]))
    if smallest > MAX_NEGATIVE_SHARE:
        return []
    return [
        "A share of the variance is negative: parameters and discrepancy compensate each other, because the "
        "measurements know their sum better than either. Varying only one of them would overstate the uncertainty."
    ]


def _too_few_draws(simulation: Simulation) -> list[str]:
    return too_few_draws(int(np.isfinite(simulation.forces[COMPLETE]).sum(axis=0).max()))


def _few_in_full(simulation: Simulation) -> list[str]:
    if COMPLETE not in simulation.first_order_error:
        return []
    errors, forces = simulation.first_order_error[COMPLETE], simulation.forces[COMPLETE]
    last = np.flatnonzero(np.isfinite(forces).sum(axis=0) > 1)[-1]
    mean, sd = np.nanmean(forces[:, last]), np.nanstd(forces[:, last])
    in_full = int(simulation.in_full.sum())
    if in_full >= MIN_IN_FULL and max(errors.sd[last], errors.mean[last] * abs(mean) / sd) <= MAX_FIRST_ORDER_ERROR:
        return []
    travel, more = simulation.case.shown(simulation.travel[last]), max(MIN_IN_FULL, 2 * in_full)
    caveat = ", or by more than that, which so few do not tell" if in_full < MIN_IN_FULL else ""
    return [
        f"With {in_full} of {len(forces)} draws computed in full, the sd of the {simulation.case.response} at {travel} "
        f"may be off by {100 * errors.sd[last]:.2g} % and its mean by {100 * errors.mean[last]:.2g} %{caveat}: compute "
        f"more in full (--full-runs {more})."
    ]


def _coarse_mesh(simulation: Simulation) -> list[str]:
    if simulation.mesh_change is None or abs(simulation.mesh_change[0]) < MIN_MESH_CHANGE:
        return []
    change, travel = simulation.mesh_change
    return [
        f"On {simulation.finer_mesh} the {simulation.case.response} at {simulation.case.shown(travel)} "
        f"changes by {100 * change:+z.1f} %: the mesh is too coarse for it."
    ]
