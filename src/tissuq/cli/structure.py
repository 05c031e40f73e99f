"""``tissuq structure``: a case of finite elements with the draws of a posterior."""

from __future__ import annotations

import os
import warnings
from pathlib import Path

from tissuq.cli.call import Call
from tissuq.cli.campaign import check_folder, write_campaign_recipe
from tissuq.cli.command import command
from tissuq.cli.running import SCHEDULER, Configured, LawOfRun
from tissuq.studies.option import option
from tissuq.studies.simulation_settings import SimulationSettings

__all__ = ["structure"]

FINER = "finer-mesh"
"""What the copy of a finer mesh is called."""


class StructureOptions(LawOfRun, Configured):
    """How a simulation is carried out."""

    out: Path | None = option(None, "Folder of the simulation [runs/RUN-CASE].")
    workers: int | None = option(None, "Processes on this machine [one a core].", ge=1)
    scheduler: str | None = option(None, SCHEDULER)
    figures: bool = option(True, "Draw the figures.")


@command(SimulationSettings, StructureOptions)
def structure(call: Call[SimulationSettings, StructureOptions]) -> None:
    """Compute the force in a case with draws of a posterior; the same command resumes a stopped simulation."""
    from tissuq.report.run_folder import check_apart
    from tissuq.report.simulation import simulation_result
    from tissuq.report.source_run import SOURCE, check_mesh, check_source, copy_mesh, copy_source, stored_mesh
    from tissuq.report.terminal import print_warnings
    from tissuq.studies.stream import open_pool
    from tissuq.studies.structure import load_posteriors, run_simulation

    call.check_source("run", "the RUN folder of a fit", "simulation")
    settings, beside, law = call.settings, call.beside, call.law
    source = beside / settings.run
    case = settings.sized_case(beside)
    finer = settings.finer_case(beside)
    stored = {"mesh": stored_mesh(settings.mesh), "finer_mesh": stored_mesh(settings.finer_mesh, FINER)}
    stored_settings = settings.model_copy(update={"run": SOURCE, **stored})
    named = Path(settings.mesh).stem if settings.mesh else case.name
    of_run = beside if call.config else Path(settings.run)
    folder = call.how.out or Path("runs") / f"{of_run.resolve().name}-{named}"
    if not call.config:  # a repeated simulation may continue in its own folder, which holds the run
        check_apart(folder, source)
    check_folder(folder, stored_settings, free=frozenset({"finer_mesh", "mesh_order"}))
    check_source(source, folder)
    check_mesh(case, folder)
    with call.monitor.steps() as step, warnings.catch_warnings(record=True) as raised:
        warnings.simplefilter("always", UserWarning)
        posteriors = load_posteriors(settings, beside, law, step)

    def prepare() -> None:
        write_campaign_recipe(folder, stored_settings)
        copy_source(source, folder)
        copy_mesh(case, folder)
        copy_mesh(finer, folder, FINER)

    processes = 1 if law else call.how.workers or os.cpu_count() or 1  # others cannot load a law from a file
    campaign = call.campaign_in(folder)
    with open_pool(processes, call.how.scheduler) as pool:
        study = run_simulation(
            settings, posteriors, folder, beside=beside, prepare=prepare, pool=pool, progress=campaign
        )
    print_warnings(list(dict.fromkeys(str(warning.message) for warning in raised)))
    call.put_into(folder, simulation_result(study, folder, source), figures=call.how.figures)
