"""From a posterior to the uncertainty of the force in a case of finite elements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tissuq.ensemble import EnergyDraw, Ensemble
from tissuq.errors import ConvergenceError, InputError
from tissuq.finite_elements.case import Case
from tissuq.finite_elements.distortional import distortional_energy
from tissuq.finite_elements.response import BULK_RATIO
from tissuq.finite_elements.table import force_table
from tissuq.finite_elements.tasks import Run, Solve, each_in_turn
from tissuq.posterior import Posterior

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["ALONE", "COMPLETE", "WITHOUT", "Failure", "Simulation", "noise_share", "simulate"]

FloatArray = NDArray[np.float64]

COMPLETE, ALONE, WITHOUT, FINE = "complete", "alone", "without", "fine"
"""Draws with their discrepancy; the same draws without it; draws of a fit without discrepancy; one on a fine mesh."""
LEAST = 2
"""Draws that must get anywhere."""


@dataclass(frozen=True)
class Failure:
    """A draw that did not get to the end: of which family, its number, how far it got (mm), and why no further."""

    family: str
    number: int
    reached: float
    problem: str


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
    failures : tuple of Failure
    beyond, energy_beyond : (N, s) arrays
        Shares of the volume that is strained beyond what was measured, and of the energy that is there.
    most : (float, float)
        The largest I1 - 3 and I2 - 3 that were measured.
    fields : mapping of str to array
        Those of the draws that got to the end, (N', ...): as `CellFields`.
    ensembles : mapping of str to Ensemble
    noise_sd : float
        Of a new measurement of the force, N.
    mesh_change : (float, float) or None
        By how much of itself the force of one draw changes on a mesh of twice the fineness, and at which travel (mm).
    seconds : float
        Of one processor, all draws.
    """

    case: Case
    travel: FloatArray
    forces: Mapping[str, FloatArray]
    failures: tuple[Failure, ...]
    beyond: FloatArray
    energy_beyond: FloatArray
    most: tuple[float, float]
    fields: Mapping[str, FloatArray]
    ensembles: Mapping[str, Ensemble]
    noise_sd: float
    mesh_change: tuple[float, float] | None
    seconds: float

    def table(self) -> pd.DataFrame:
        """Return band and shares of the variance at every step, N: see `tissuq.finite_elements.table.force_table`."""
        complete = self.forces[COMPLETE]
        alone, without = self.forces.get(ALONE, complete), self.forces.get(WITHOUT)
        return force_table(self.travel, complete, alone, without, self.noise_sd, self.case.travel_name)

    @property
    def middle(self) -> EnergyDraw:
        """The draw whose last force is in the middle of those of the last step that any draw got to."""
        forces = self.forces[COMPLETE]
        last = forces[:, np.flatnonzero(np.isfinite(forces).any(axis=0))[-1]]
        there = np.flatnonzero(np.isfinite(last))
        return self.ensembles[COMPLETE][int(there[np.argsort(last[there])[len(there) // 2]])]


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
    run: Run = each_in_turn,
) -> Simulation:
    """Return the forces of draws of a posterior in a case, with the discrepancy and without it.

    Parameters
    ----------
    posterior : Posterior
        Of an isotropic material, and a discrepancy that is an energy (or none).
    case : Case
    draws : int
    without : Posterior, optional
        Of the same data, fitted without discrepancy, to compare with.
    steps : int
        Load steps at which forces are told.
    seed : int
        From which the draws follow.
    force_noise : float, optional
        Standard deviation of a new measurement of the force, N; unless given, the same share of the largest force as
        the noise of the test is of its largest stress.
    bulk_ratio : float
        Bulk modulus in initial shear moduli.
    check_mesh : bool
        Compute one draw on a mesh of twice the fineness, too, where the case has a fineness.
    run : callable
        Carries out the tasks; `tissuq.studies.simulate` has one that uses many processes.

    Raises
    ------
    InputError, ModelError
        When FElupe is not installed, or the posterior has no materials for finite elements.
    ConvergenceError
        When hardly any draw got anywhere.

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
    if draws < LEAST or steps < 1:
        raise InputError(f"a simulation has {LEAST} draws or more and one step or more, not {draws} and {steps}.")
    ensembles = {COMPLETE: posterior.ensemble(draws, seed)}
    if any(each.discrepancy is not None or len(each.parts) > 1 for each in ensembles[COMPLETE]):
        ensembles[ALONE] = ensembles[COMPLETE].alone
        if without is not None:
            ensembles[WITHOUT] = without.ensemble(draws, seed)
    most = ensembles[COMPLETE].most
    tasks = {name: [Solve.of(case, draw, steps, bulk_ratio, most) for draw in own] for name, own in ensembles.items()}
    if check_mesh and hasattr(case, "fineness"):
        finer = replace(case, **{"fineness": 2 * case.fineness})
        tasks[FINE] = [Solve.of(finer, _middle(ensembles[COMPLETE]), steps, bulk_ratio, most)]
    known = _carried_out([task for own in tasks.values() for task in own], run)
    complete, fine = tasks[COMPLETE], tasks.pop(FINE, None)
    forces = {name: _rows(own, known, "force", steps) for name, own in tasks.items()}
    _check_any(case, forces[COMPLETE], [known[task.key]["problem"] for task in complete])
    return Simulation(
        case=case,
        travel=case.steps(steps),
        forces=forces,
        failures=tuple(_failures(tasks, known)),
        beyond=_rows(complete, known, "beyond", steps, scaled=False),
        energy_beyond=_rows(complete, known, "energy_beyond", steps, scaled=False),
        most=most,
        fields=_fields(complete, known),
        ensembles=ensembles,
        noise_sd=_noise_sd(posterior, forces[COMPLETE]) if force_noise is None else force_noise,
        mesh_change=_mesh_change(case, fine[0], _rows(fine, known, "force", steps), forces[COMPLETE]) if fine else None,
        seconds=sum(each["seconds"] for each in known.values()),
    )


def noise_share(posterior: Posterior) -> float:
    """Return the noise of the test in its largest stress: the mean of what is not known of it."""
    model = posterior.model
    largest = float(np.abs(model.experiment.stress).max())
    values = {each.symbol: posterior.marginals[each.symbol].mean for each in model.noise.parameters}
    return float(model.noise.sd(values, largest)) / largest


def _noise_sd(posterior: Posterior, forces: FloatArray) -> float:
    return noise_share(posterior) * float(np.nanmax(np.abs(np.nanmean(forces, axis=0))))


def _carried_out(tasks: Sequence[Solve], run: Run) -> dict[str, dict[str, Any]]:
    """Return the results of tasks by their keys, each carried out once."""
    different = list({task.key: task for task in tasks}.values())
    return dict(zip((task.key for task in different), run(different), strict=True))


def _rows(
    tasks: Sequence[Solve], known: Mapping[str, dict[str, Any]], name: str, steps: int, *, scaled: bool = True
) -> FloatArray:
    """Return a quantity (N, s) of tasks, not a number where there is none."""
    missing = [None] * steps
    rows = np.array([known[task.key].get(name, missing) for task in tasks], dtype=np.float64)
    return rows * np.array([task.modulus for task in tasks])[:, None] if scaled else rows


def _failures(tasks: Mapping[str, Sequence[Solve]], known: Mapping[str, dict[str, Any]]) -> list[Failure]:
    every = ((family, task.draw.number, known[task.key]) for family, own in tasks.items() for task in own)
    return [
        Failure(family, number, each["reached"], each["problem"]) for family, number, each in every if each["problem"]
    ]


def _check_any(case: Case, forces: FloatArray, problems: Sequence[str]) -> None:
    if np.isfinite(forces[:, 0]).sum() < LEAST:
        reasons = "; ".join(sorted(set(filter(None, problems))))
        raise ConvergenceError(
            f"of {len(forces)} draws hardly any got to the first {case.travel_name} of "
            f"{case.steps(forces.shape[1])[0]:.3g} mm ({reasons}): take more steps, a coarser mesh or another material."
        )


def _fields(tasks: Sequence[Solve], known: Mapping[str, dict[str, Any]]) -> dict[str, FloatArray]:
    """Return the fields of the draws that got to the end."""
    there = [(known[task.key]["fields"], task.modulus) for task in tasks if not known[task.key]["problem"]]
    scale = {"von_mises": [modulus for _, modulus in there]}
    stacked = {name: np.array([fields[name] for fields, _ in there]) for name in (there[0][0] if there else ())}
    return {name: each * np.reshape(scale[name], (-1, 1)) if name in scale else each for name, each in stacked.items()}


def _middle(ensemble: Ensemble) -> EnergyDraw:
    """Return the draw whose initial shear modulus is in the middle."""
    moduli = [distortional_energy(draw).initial_shear_modulus for draw in ensemble]
    return ensemble[int(np.argsort(moduli)[len(moduli) // 2])]


def _mesh_change(case: Case, task: Solve, fine: FloatArray, forces: FloatArray) -> tuple[float, float] | None:
    """Return by how much of itself the last force that both meshes have changes, and where that is."""
    coarse = forces[task.draw.number]
    both = np.flatnonzero(np.isfinite(fine[0]) & np.isfinite(coarse))
    if not len(both):
        return None
    last = both[-1]
    return float(fine[0, last] / coarse[last] - 1), float(case.steps(len(coarse))[last])
