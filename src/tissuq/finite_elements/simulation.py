"""All draws of a posterior in a case: forces, bands, what failed, and warnings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.arrays import BoolArray, FloatArray
from tissuq.errors import ConvergenceError, InputError
from tissuq.finite_elements.case import Case, Mesh
from tissuq.finite_elements.first_order import FirstOrderError, controlled, draws_in_full, first_order_forces
from tissuq.finite_elements.material import distortional_energy
from tissuq.finite_elements.response import BULK_RATIO, Run, Solve, run_in_turn
from tissuq.finite_elements.solver import check_bulk_ratio
from tissuq.finite_elements.spread import force_table, mesh_factor, mesh_free
from tissuq.posterior.draws_in_words import FailedDraw
from tissuq.posterior.ensemble import EnergyDraw, Ensemble
from tissuq.posterior.posterior import Posterior

if TYPE_CHECKING:
    import pandas as pd

COMPLETE, MATERIAL_ONLY, WITHOUT, FINE_MESH = "complete", "alone", "without", "fine"
"""Draws with their discrepancy; the same draws without it; draws of a fit without discrepancy; one on a fine mesh."""

FAMILIES = {
    "complete": "draws",
    "alone": "draws without their discrepancy",
    "without": "draws of the fit without discrepancy",
}
"""The families in words, by their names."""
TWICE = 2.0
"""How many times smaller the cells of the finer mesh of a case are."""
SAME_BODY = 0.02
"""Distance of the ends of a body on two meshes, over its size, from which they are those of two bodies."""
MIN_DRAWS = 2
"""Smallest number of draws that must reach the first step."""


@dataclass(frozen=True)
class Simulation:
    """Forces of draws in a case.

    Attributes
    ----------
    case : Case
    travel : (s,) array, mm
    forces : mapping of str to (N, s) array, N
        By family: ``complete``, ``alone`` (the same draws without discrepancy) and ``without`` (draws of a fit without
        discrepancy); not a number where a draw did not get that far. Families that do not apply are missing.
    failures : tuple of FailedDraw
    volume_beyond, energy_beyond : (N, s) arrays
        Shares of the volume that is strained beyond what was measured, and of the energy that is there; not a number
        where a draw was not computed in full, or not that far.
    max_invariants : (float, float)
        The largest I1 - 3 and I2 - 3 that were measured.
    fields : mapping of str to array
        Fields of the N' draws that reached the end, (N', ...), as in `CellFields`.
    ensembles : mapping of str to Ensemble
    noise_sd : float
        Standard deviation of a new measurement of the force, N.
    seconds : float
        Computing time of all draws on one processor, s.
    mesh_changes : tuple of (float, float)
        Of one draw on a finer mesh: travels (mm), and the relative changes of the force.
    first_order_error : mapping of str to FirstOrderError
        By family of which not all draws were computed in full: relative errors of the force of one that was not, and of
        the mean and the sd of all.
    mesh_ratio : float
        How many times smaller the cells of the finer mesh are.
    mesh_order : float
        Power of their size with which the error falls.
    bulk_ratio : float
        Bulk modulus in initial shear moduli.
    """

    case: Case
    travel: FloatArray
    forces: Mapping[str, FloatArray]
    failures: tuple[FailedDraw, ...]
    volume_beyond: FloatArray
    energy_beyond: FloatArray
    max_invariants: tuple[float, float]
    fields: Mapping[str, FloatArray]
    ensembles: Mapping[str, Ensemble]
    noise_sd: float
    seconds: float
    mesh_changes: tuple[tuple[float, float], ...] = ()
    first_order_error: Mapping[str, FirstOrderError] = field(default_factory=dict)
    mesh_ratio: float = TWICE
    mesh_order: float = 1.0
    bulk_ratio: float = BULK_RATIO

    @property
    def in_full(self) -> BoolArray:
        """Which draws (N,) were computed in full: the others follow to first order."""
        if COMPLETE not in self.first_order_error:
            return np.ones(len(self.forces[COMPLETE]), dtype=bool)
        return np.asarray(np.isfinite(self.volume_beyond).any(axis=1))

    @property
    def mesh_change(self) -> tuple[float, float] | None:
        """The relative change of the force of one draw on a finer mesh, and the last travel (mm) at which."""
        return self.mesh_changes[-1][::-1] if self.mesh_changes else None

    @property
    def mesh_factor(self) -> FloatArray:
        """What forces (s,) are to be multiplied by for cells without size (Richardson).

        Strains are singular at the edge of a punch and at a clamp, so that errors halve with the cells; in a body
        without sharp edges they fall to a quarter (`Case.mesh_order`).
        """
        return mesh_factor(self.travel, self.mesh_changes, self.mesh_ratio**self.mesh_order)

    @property
    def finer_mesh(self) -> str:
        """What the finer mesh is, as in a sentence."""
        return f"a mesh of {'twice' if self.mesh_ratio == TWICE else f'{self.mesh_ratio:.3g} times'} the fineness"

    def table(self) -> pd.DataFrame:
        """Return band and shares of the variance at every step, N: see `tissuq.finite_elements.spread.force_table`.

        Where a finer mesh was computed, also the band for cells without size, and the share of its error: see
        `tissuq.finite_elements.spread.mesh_free`.
        """
        complete = self.forces[COMPLETE]
        material_only, without = self.forces.get(MATERIAL_ONLY, complete), self.forces.get(WITHOUT)
        sources, column = self.ensembles[COMPLETE].sources, self.case.travel_column
        table = force_table(self.travel, complete, material_only, without, self.noise_sd, column, sources)
        return mesh_free(table, self.mesh_factor) if self.mesh_changes else table

    @property
    def median_draw(self) -> EnergyDraw:
        """The draw whose last force is in the middle of those of the last step that any draw got to."""
        forces = self.forces[COMPLETE]
        last = forces[:, np.flatnonzero(np.isfinite(forces).any(axis=0))[-1]]
        is_reached = np.flatnonzero(np.isfinite(last))
        return self.ensembles[COMPLETE][int(is_reached[np.argsort(last[is_reached])[len(is_reached) // 2]])]


def simulate(
    posterior: Posterior,
    case: Case,
    draws: int = 64,
    *,
    without: Posterior | None = None,
    steps: int = 8,
    seed: int = 0,
    force_noise: float | None = None,
    bulk_ratio: float = BULK_RATIO,
    check_mesh: bool = True,
    finer: Case | None = None,
    mesh_order: float | None = None,
    full_runs: int | None = None,
    shares: bool = True,
    run: Run = run_in_turn,
) -> Simulation:
    """Return the forces of draws of a posterior in a case, with the discrepancy and without it.

    Parameters
    ----------
    posterior : Posterior
        Posterior of an isotropic material with an energy discrepancy, or none.
    case : Case
    draws : int
    without : Posterior, optional
        Posterior of the same data without discrepancy, for comparison.
    steps : int
        Number of load steps at which forces are given.
    seed : int
        Seed of the draws.
    force_noise : float, optional
        Standard deviation of a new measurement of the force, N; unless given, the same share of the largest force as
        the noise of the test is of its largest stress.
    bulk_ratio : float
        Bulk modulus in initial shear moduli.
    check_mesh : bool
        Compute one draw on a mesh of twice the fineness, too, where the case has a fineness.
    finer : Case, optional
        The same with smaller cells, on which one draw is computed instead.
    mesh_order : float, optional
        Power of the size of cells with which the error of the mesh falls; unless given, that of the case.
    full_runs : int, optional
        Draws of every family that are computed in full; the others follow from the deformation of the one in the middle
        to first order, corrected by those (`tissuq.finite_elements.first_order`). Unless given, all.
    shares : bool
        Compute the draws without their discrepancy, too, for the shares of the variance.
    run : callable
        Carries out the tasks; `tissuq.studies.structure` has one that uses many processes.

    Raises
    ------
    InputError, ModelError
        When FElupe is not installed, the posterior has no materials for finite elements, or the bulk modulus is too
        small for nearly incompressible ones.
    ConvergenceError
        When fewer than two draws reached the first step.

    Examples
    --------
    >>> import tissuq as tq
    >>> stretch = [0.7, 0.8, 0.9, 0.95, 1.05, 1.1, 1.2, 1.3]
    >>> data = tq.simulate("neo-hookean", {"C10": 0.5}, stretch, noise_sd=0.02, seed=1)
    >>> posterior = tq.fit(data, discrepancy="none", noise_sd=0.02)
    >>> bar = tq.finite_elements.ClampedBar(fineness=0.5)
    >>> found = tq.finite_elements.simulate(posterior, bar, draws=4, steps=2, check_mesh=False)
    >>> found.forces["complete"].shape, found.failures
    ((4, 2), ())
    """
    if draws < MIN_DRAWS or steps < 1:
        raise InputError(f"a simulation has {MIN_DRAWS} draws or more and one step or more, not {draws} and {steps}.")
    check_bulk_ratio(bulk_ratio)
    ensembles = {COMPLETE: posterior.ensemble(draws, seed)}
    if shares and any(draw.discrepancy is not None or len(draw.parts) > 1 for draw in ensembles[COMPLETE]):
        ensembles[MATERIAL_ONLY] = ensembles[COMPLETE].alone
        if without is not None:
            ensembles[WITHOUT] = without.ensemble(draws, seed)
    max_invariants = ensembles[COMPLETE].most
    tasks = {
        name: [Solve.of(case, draw, steps, bulk_ratio, max_invariants) for draw in members]
        for name, members in ensembles.items()
    }
    followed = {
        name: first_order_forces(case, ensembles[name], _median_draw(ensembles[name]), steps, bulk_ratio)
        for name, members in tasks.items()
        if full_runs is not None and full_runs < len({task.key for task in members})
    }
    in_full = {name: draws_in_full(first_order, full_runs or 0) for name, first_order in followed.items()}
    wanted = [members[n] for name, members in tasks.items() for n in in_full.get(name, range(len(members)))]
    mesh_ratio = TWICE if finer is None else _ratio(case.mesh(), finer.mesh())
    if finer is None and check_mesh and hasattr(case, "fineness"):
        finer = replace(case, **{"fineness": TWICE * case.fineness})
    if finer is not None:
        fine_steps = 2 if steps % 2 == 0 else steps
        tasks[FINE_MESH] = [Solve.of(finer, _median_draw(ensembles[COMPLETE]), fine_steps, bulk_ratio, max_invariants)]
    results = _results_by_key([*tasks.get(FINE_MESH, []), *wanted], run)
    fine = tasks.pop(FINE_MESH, None)
    computed = {name: [task for task in members if task.key in results] for name, members in tasks.items()}
    complete = computed[COMPLETE]
    forces = {name: _quantity(tasks[name], results, "force", steps) for name in tasks}
    errors = {}
    for name, first_order in followed.items():
        full = {number: forces[name][number] for number in in_full[name]}
        forces[name], errors[name] = controlled(first_order, full)
    mesh_changes = _mesh_changes(fine[0], results, forces[COMPLETE], case) if fine else ()
    _check_any(case, forces[COMPLETE], [results[task.key]["problem"] for task in complete])
    return Simulation(
        case=case,
        travel=case.steps(steps),
        forces=forces,
        failures=tuple(_failures(computed, results)),
        volume_beyond=_quantity(tasks[COMPLETE], results, "volume_beyond", steps, scaled=False),
        energy_beyond=_quantity(tasks[COMPLETE], results, "energy_beyond", steps, scaled=False),
        max_invariants=max_invariants,
        fields=_fields(complete, results),
        ensembles=ensembles,
        noise_sd=_noise_sd(posterior, forces[COMPLETE]) if force_noise is None else force_noise,
        seconds=sum(result["seconds"] for result in results.values()),
        mesh_changes=mesh_changes,
        first_order_error=errors,
        mesh_ratio=mesh_ratio,
        mesh_order=case.mesh_order if mesh_order is None else mesh_order,
        bulk_ratio=bulk_ratio,
    )


def _ratio(mesh: Mesh, finer: Mesh) -> float:
    """Return how many times smaller the cells of a finer mesh are, by their numbers."""
    counts, dimensions = (len(mesh.cells), len(finer.cells)), mesh.points.shape[1]
    if finer.kind != mesh.kind or counts[1] <= counts[0]:
        raise InputError(
            f"the finer mesh has {counts[1]} {finer.kind.plural}, and the mesh {counts[0]} {mesh.kind.plural}: give "
            "smaller cells of the same kind."
        )
    places = [body.vectors(body.points) for body in (mesh, finer)]
    ends, finer_ends = (np.array([xyz.min(axis=0), xyz.max(axis=0)]) for xyz in places)
    if not np.allclose(ends, finer_ends, rtol=0, atol=SAME_BODY * float(np.ptp(ends, axis=0).max())):
        corners = [", ".join(f"{value:.4g}" for value in corner) for corner in (*finer_ends, *ends)]
        raise InputError(
            f"the finer mesh is of another body: it reaches from {corners[0]} to {corners[1]} (x, y, z, mm), and the "
            f"mesh from {corners[2]} to {corners[3]}. Give the same body, in the same place, with smaller cells."
        )
    return float((counts[1] / counts[0]) ** (1 / dimensions))


def noise_share(posterior: Posterior) -> float:
    """Return the noise of the test in its largest stress: the mean of what is not known of it."""
    model = posterior.model
    largest = float(np.abs(model.experiment.measured).max())
    values = {parameter.symbol: posterior.marginals[parameter.symbol].mean for parameter in model.noise.parameters}
    return float(model.noise.sd(values, largest)) / largest


def _noise_sd(posterior: Posterior, forces: FloatArray) -> float:
    return noise_share(posterior) * float(np.nanmax(np.abs(np.nanmean(forces, axis=0))))


def _results_by_key(tasks: Sequence[Solve], run: Run) -> dict[str, dict[str, Any]]:
    """Return the results of tasks by their keys, each carried out once."""
    different = list({task.key: task for task in tasks}.values())
    return dict(zip((task.key for task in different), run(different), strict=True))


def _quantity(
    tasks: Sequence[Solve], results: Mapping[str, dict[str, Any]], name: str, steps: int, *, scaled: bool = True
) -> FloatArray:
    """Return a quantity (N, s) of tasks, not a number where there is none."""
    missing = [None] * steps
    rows = np.array([results.get(task.key, {}).get(name, missing) for task in tasks], dtype=np.float64)
    return rows * np.array([task.modulus for task in tasks])[:, None] if scaled else rows


def _failures(tasks: Mapping[str, Sequence[Solve]], results: Mapping[str, dict[str, Any]]) -> list[FailedDraw]:
    solves = ((family, task.draw.number, results[task.key]) for family in tasks for task in tasks[family])
    return [
        FailedDraw(family, number, result["reached"], problem)
        for family, number, result in solves
        if (problem := result["problem"])
    ]


def _check_any(case: Case, forces: FloatArray, problems: Sequence[str]) -> None:
    if np.isfinite(forces[:, 0]).sum() < MIN_DRAWS:
        reasons = "; ".join(sorted(set(filter(None, problems))))
        raise ConvergenceError(
            f"of {len(forces)} draws, fewer than {MIN_DRAWS} reached the first {case.travel_name} of "
            f"{case.shown(case.steps(forces.shape[1])[0])} ({reasons}): use more steps, a coarser mesh or another "
            "material."
        )


def _fields(tasks: Sequence[Solve], results: Mapping[str, dict[str, Any]]) -> dict[str, FloatArray]:
    """Return the fields of the draws that reached the end."""
    completed = [(results[task.key]["fields"], task.modulus) for task in tasks if not results[task.key]["problem"]]
    scale = {"von_mises": [modulus for _, modulus in completed]}
    names = completed[0][0] if completed else ()
    stacked = {name: np.array([fields[name] for fields, _ in completed]) for name in names}
    return {name: stacked[name] * np.reshape(scale.get(name, 1.0), (-1, 1)) for name in names}


def _median_draw(ensemble: Ensemble) -> EnergyDraw:
    """Return the draw whose initial shear modulus is in the middle."""
    moduli = [distortional_energy(draw).initial_shear_modulus for draw in ensemble]
    return ensemble[int(np.argsort(moduli)[len(moduli) // 2])]


def _mesh_changes(
    task: Solve, results: Mapping[str, dict[str, Any]], forces: FloatArray, case: Case
) -> tuple[tuple[float, float], ...]:
    """Return the travels that both meshes reached, and the relative changes of the force on the finer one."""
    stride = forces.shape[1] // task.steps
    coarse, travel = forces[task.draw.number, stride - 1 :: stride], case.steps(task.steps)
    (fine,) = _quantity([task], results, "force", task.steps)
    steps = np.flatnonzero(np.isfinite(fine) & np.isfinite(coarse))
    return tuple((float(travel[step]), float(fine[step] / coarse[step] - 1)) for step in steps)
