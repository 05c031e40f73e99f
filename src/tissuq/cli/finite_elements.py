"""``tissuq structure`` and ``ensemble``: draws of a posterior in a case, and in the user's own finite-element model."""

from __future__ import annotations

import os
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tissuq.cli.call import SCHEDULER, Call, Configured, LawOfRun, SolverOptions, check_folder, write_campaign_recipe
from tissuq.cli.command import command
from tissuq.errors import InputError
from tissuq.studies.finite_element_settings import EnsembleSettings, SimulationSettings
from tissuq.studies.option import argument, option
from tissuq.studies.option_texts import once_each

if TYPE_CHECKING:
    from tissuq.studies.ensemble import PreparedEnsemble


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
    from tissuq.report.source_run import SOURCE, check_mesh, check_source, copy_source, mesh_files
    from tissuq.report.terminal import print_warnings
    from tissuq.studies.stream import open_pool
    from tissuq.studies.structure import load_posteriors, run_simulation

    call.check_source("run", "the RUN folder of a fit", "simulation")
    settings, beside, law = call.settings, call.beside, call.law
    source = beside / settings.run
    case = settings.sized_case(beside)
    meshes = mesh_files(case, settings.finer_case(beside))
    stored_meshes = {setting: name for setting, (name, _) in meshes.items()}
    stored_settings = settings.model_copy(update={"run": SOURCE, **stored_meshes})
    named = Path(settings.mesh).stem if settings.mesh else case.name
    of_run = beside if call.config else Path(settings.run)
    folder = call.how.out or Path("runs") / f"{of_run.resolve().name}-{named}"
    if not call.config:  # a repeated simulation may continue in its own folder, which holds the run
        check_apart(folder, source)
    check_folder(folder, stored_settings, free=frozenset({"finer_mesh", "mesh_order"}))
    check_source(source, folder)
    if "mesh" in meshes:
        check_mesh(*meshes["mesh"], folder)
    with call.monitor.steps() as step, warnings.catch_warnings(record=True) as raised:
        warnings.simplefilter("always", UserWarning)
        posteriors = load_posteriors(settings, beside, law, step)

    def prepare() -> None:
        write_campaign_recipe(folder, stored_settings)
        copy_source(source, folder)
        for name, content in meshes.values():
            (folder / name).write_bytes(content)

    processes = 1 if law else call.how.workers or os.cpu_count() or 1  # others cannot load a law from a file
    campaign = call.campaign_in(folder)
    with open_pool(processes, call.how.scheduler) as pool:
        study = run_simulation(
            settings, posteriors, folder, beside=beside, prepare=prepare, pool=pool, progress=campaign
        )
    print_warnings(list(dict.fromkeys(str(warning.message) for warning in raised)))
    call.put_into(folder, simulation_result(study, folder, source), figures=call.how.figures)


POSTERIORS = "posteriors"
"""Folder with a copy of every run that draws come from."""

FREE = frozenset({"quantities", "finer_model", "cell_ratio", "mesh_order"})
"""Settings that may be others when an ensemble goes on."""


class EnsembleOptions(LawOfRun, SolverOptions, Configured):
    """Where draws come from, and how the solver is run."""

    run: Path | None = argument(None, "Run folder of tissuq fit.")
    out: Path | None = option(None, "Folder of the ensemble [runs/RUN-MODEL].")
    scheduler: str | None = option(None, SCHEDULER)
    again: bool = option(False, "Make runs again that failed earlier.")
    keep: bool = option(True, "Keep the solver's files of every draw.")
    dry_run: bool = option(False, "Show what changes in the deck, and run nothing.")
    figures: bool = option(True, "Draw the figures.")


@command(EnsembleSettings, EnsembleOptions)
def ensemble(call: Call[EnsembleSettings, EnsembleOptions]) -> None:
    """Run your own finite-element model with draws of a posterior; the same command resumes a stopped ensemble."""
    from tissuq.decks.model_run import SolverRun
    from tissuq.report.ensemble import ensemble_result
    from tissuq.report.run_folder import check_apart
    from tissuq.report.source_run import check_source
    from tissuq.report.terminal import print_explanations
    from tissuq.studies.ensemble import forget_failures, prepare_ensemble, run_ensemble
    from tissuq.studies.stream import open_pool

    how, settings, beside = call.how, _settings(call), call.beside
    sources = list(dict.fromkeys(settings.materials.values()))
    named = beside if call.config else Path(sources[0])
    folder = how.out or Path("runs") / f"{named.resolve().name}-{Path(settings.model).stem}"
    if not (call.config or how.dry_run):
        for source in sources:
            check_apart(folder, beside / source)
    runs_here = not (how.dry_run or how.scheduler)
    with call.monitor.steps() as step:
        prepared = prepare_ensemble(settings, beside, call.law, step, runs_here=runs_here, is_dry=how.dry_run)
    if how.dry_run:
        print(prepared.diff())
        print_explanations(prepared.card_warnings)
        return
    stored = _stored(prepared, sources, beside)
    check_folder(folder, stored, free=FREE)
    for number, source in enumerate(sources, start=1):
        check_source(beside / source, folder / POSTERIORS / str(number))
    _write_inputs(prepared, stored, sources, beside, folder)
    if how.again:
        forget_failures(prepared.tasks(folder), folder)
    with open_pool(how.max_jobs or os.cpu_count() or 1, how.scheduler) as pool:
        study = run_ensemble(
            prepared, folder, pool=pool, limit=how.max_jobs if how.scheduler else None,
            running=SolverRun(how.timeout, how.retries, how.keep, how.abaqus), progress=call.campaign_in(folder),
        )  # fmt: skip
    print_explanations(prepared.card_warnings)
    call.put_into(folder, ensemble_result(study, folder, beside), figures=how.figures)


def _settings(call: Call[EnsembleSettings, EnsembleOptions]) -> EnsembleSettings:
    """Return the settings, with the run of every material."""
    stated, run = call.stated, call.how.run
    model = stated.get("model")
    if run is not None and model is None and run.is_file():
        run, model = None, str(run)  # every material has its own run
    if call.config and (run or model):
        raise InputError(
            f"'{call.config}' names the runs and the model of the ensemble that it repeats: leave out --config, or "
            f"{' '.join(str(source) for source in (run, model) if source)}."
        )
    if not (model or call.config):
        raise InputError("give the RUN folder of a fit and your MODEL, or --config run.toml of an earlier ensemble.")
    materials = _materials(stated.get("materials", []), run)
    for example, value in (("--replace NAME", materials), ("--qoi NAME=RF3@SET", stated.get("quantities"))):
        if call.config is None and not value:
            raise InputError(f"give {example}: what the model is asked for.")
    settings = call.loaded(model=model, materials=materials or None)
    call.check_named_again(settings, is_dry=call.how.dry_run)
    return settings


def _stored(prepared: PreparedEnsemble, sources: list[str], beside: Path) -> EnsembleSettings:
    """Return the settings with the names that runs and files have in the folder of the ensemble."""
    from tissuq.decks.model_files import MODEL, stored_place
    from tissuq.report.source_run import SOURCE
    from tissuq.studies.ensemble import FINER

    settings = prepared.settings
    stored_runs = {source: f"{POSTERIORS}/{number}/{SOURCE}" for number, source in enumerate(sources, start=1)}
    changes: dict[str, Any] = {
        "model": f"{MODEL}/{prepared.deck.main}",
        "materials": {name: stored_runs[source] for name, source in settings.materials.items()},
        "also": [stored_place(prepared.deck, beside / file) for file in settings.also],
    }
    if prepared.finer is not None:
        changes["finer_model"] = f"{FINER}/{MODEL}/{prepared.finer.deck.main}"
    return settings.model_copy(update=changes)


def _write_inputs(
    prepared: PreparedEnsemble, stored: EnsembleSettings, sources: list[str], beside: Path, folder: Path
) -> None:
    """Write recipe and copies of all that an ensemble starts from, so that it can be repeated."""
    from tissuq.decks.model_files import copy_model
    from tissuq.report.ensemble import copy_functions
    from tissuq.report.source_run import copy_source
    from tissuq.studies.ensemble import FINER

    folder.mkdir(parents=True, exist_ok=True)
    copy_model(prepared.deck, prepared.settings.also, beside, folder)
    if prepared.finer is not None:
        copy_model(prepared.finer.deck, prepared.settings.also, beside, folder / FINER, is_replaced=True)
    for number, source in enumerate(sources, start=1):
        copy_source(beside / source, folder / POSTERIORS / str(number))
    quantities = stored.quantities | copy_functions(prepared.quantities, folder)
    write_campaign_recipe(folder, stored.model_copy(update={"quantities": quantities}))


def _materials(texts: list[str], run: Path | None) -> dict[str, str]:
    """Return the runs of materials from texts like ``TISSUE`` and ``FAT=runs/fat``."""
    pairs = []
    for text in texts:
        name, equals, source = (word.strip() for word in text.partition("="))
        if not name or (equals and not source):
            raise InputError(f"'{text}' is not a material of the model; write NAME, or NAME=RUN.")
        if not source and run is None:
            raise InputError(f"material '{name}' has no run: give its RUN before the model, or write {name}=RUN.")
        pairs.append((name, source or str(run)))
    return once_each("--replace", pairs)
