"""The study of a case of finite elements with the posterior of a run: many draws at a time, and none done twice."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tissuq.errors import ConvergenceError, ModelError
from tissuq.finite_elements.case import felupe
from tissuq.finite_elements.response import Solve, solved
from tissuq.finite_elements.simulation import Simulation, simulate
from tissuq.finite_elements.warnings import simulation_warnings
from tissuq.mechanics import Material
from tissuq.model.discrepancy import NoDiscrepancy
from tissuq.posterior.posterior import Posterior
from tissuq.studies.earlier_run import load, load_without_discrepancy
from tissuq.studies.finite_element_settings import SimulationSettings
from tissuq.studies.stream import Step, run_tasks, silent


@dataclass(frozen=True)
class Posteriors:
    """The posteriors that a simulation starts from.

    Attributes
    ----------
    fitted : Posterior
        Of the run.
    without : Posterior or None
        Of the same measurements, fitted without discrepancy; None where the run's is without one, or this failed.
    reason : str
        Why it failed.
    """

    fitted: Posterior
    without: Posterior | None = None
    reason: str = ""


@dataclass(frozen=True)
class SimulationStudy:
    """Results of a simulation."""

    settings: SimulationSettings
    posteriors: Posteriors
    simulation: Simulation

    @property
    def warnings(self) -> list[str]:
        """Warnings about the result."""
        return simulation_warnings(self.simulation) + [self.posteriors.reason] * bool(self.posteriors.reason)


def load_posteriors(
    settings: SimulationSettings,
    beside: Path = Path(),
    law: Material | None = None,
    step: Callable[[str], None] = lambda text: None,
) -> Posteriors:
    """Return the posterior of the run, and that of the same measurements without discrepancy.

    Parameters
    ----------
    settings : SimulationSettings
    beside : Path
        Where the run folder lies, unless it is absolute.
    law : Material, optional
        The material, where the run's is a law in a file.
    step : callable
        Told what is being done.

    Raises
    ------
    InputError, ModelError, ConvergenceError
        When the run cannot be used.
    """
    run = beside / settings.run
    step("loading the run")
    fitted = load(run, settings.discrepancy, settings.law_of(law))
    if fitted.model.discrepancy.name == NoDiscrepancy.name:
        return Posteriors(fitted)
    step("the posterior without discrepancy")
    try:
        return Posteriors(fitted, load_without_discrepancy(run, fitted.model.material))
    except (ConvergenceError, ModelError) as error:
        return Posteriors(fitted, reason=f"The run's measurements cannot be fitted without discrepancy: {error}")


def run_simulation(
    settings: SimulationSettings,
    posteriors: Posteriors,
    folder: Path,
    *,
    beside: Path = Path(),
    prepare: Callable[[], None] = lambda: None,
    pool: Executor | None = None,
    progress: Callable[[int], AbstractContextManager[Step]] = lambda total: nullcontext(silent),
) -> SimulationStudy:
    """Compute the case with draws of a posterior; those in ``folder`` are not computed again.

    Parameters
    ----------
    settings : SimulationSettings
    posteriors : Posteriors
    folder : Path
        Exists, or `prepare` makes it; holds the results so far, if any.
    beside : Path
        Where the mesh lies, unless its name is absolute.
    prepare : callable
        Called when it is certain that there is something to compute.
    pool : Executor, optional
        From `tissuq.studies.stream.open_pool`.
    progress : callable
        Gives, for a number of tasks, a context with the function that is told of each.

    Raises
    ------
    InputError, ModelError, ConvergenceError
        When the settings cannot be used, FElupe is not installed, or hardly any draw gets anywhere.
    """
    felupe()

    def carried_out(tasks: Sequence[Solve]) -> Sequence[dict[str, Any]]:
        prepare()
        with progress(len(tasks)) as step:
            return run_tasks(tasks, solved, folder, pool=pool, step=step)

    simulation = simulate(
        posteriors.fitted,
        settings.sized_case(beside),
        settings.draws,
        without=posteriors.without,
        steps=settings.steps,
        seed=settings.seed,
        full_runs=settings.full_runs,
        force_noise=settings.force_noise,
        bulk_ratio=settings.bulk_ratio,
        finer=settings.finer_case(beside),
        mesh_order=settings.mesh_order,
        run=carried_out,
    )
    return SimulationStudy(settings, posteriors, simulation)
