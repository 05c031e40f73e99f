"""``tissuq ensemble``: the user's own finite-element model with draws of a posterior as its material."""

from __future__ import annotations

import os
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tissuq.cli.options import (
    Config,
    Figures,
    RunDiscrepancy,
    RunMaterial,
    Scheduler,
    Seed,
    campaign_progress,
    check_folder,
    once_each,
    own_law,
    progress,
    write_campaign_recipe,
)
from tissuq.errors import InputError
from tissuq.studies.settings import is_inside, load_settings

if TYPE_CHECKING:
    from tissuq.studies.ensemble import EnsembleSettings, PreparedEnsemble

__all__ = ["ensemble"]

POSTERIORS = "posteriors"
"""Folder with a copy of every run that draws come from."""


def ensemble(
    run: Annotated[Path | None, typer.Argument(help="Run folder of tissuq fit.")] = None,
    model: Annotated[
        Path | None,
        typer.Argument(
            help="Your model: a deck of CalculiX or Abaqus (.inp), FEBio (.feb), LS-DYNA (.k), ANSYS (.cdb)."
        ),
    ] = None,
    material: Annotated[
        list[str] | None,
        typer.Option(
            help="Name (ANSYS: number) of the material in the model that gets the draws; NAME=RUN takes them from "
            "another run. Repeat for more."
        ),
    ] = None,
    qoi: Annotated[
        list[str] | None,
        typer.Option(
            help="Quantity of interest: NAME=RF3@SET, U1@SET, S11@SET, MISES@SET:max (CalculiX), or "
            "NAME=file.py:function of the folder of a draw. Repeat for more."
        ),
    ] = None,
    solver: Annotated[str | None, typer.Option(help="ccx, febio4 or command [that of the deck].")] = None,
    command: Annotated[
        str | None, typer.Option(help="Command of the solver, such as 'abaqus job={job} ask=off', {deck} with suffix.")
    ] = None,
    deck: Annotated[str | None, typer.Option(help="abaqus, febio, ls-dyna or ansys [what the file is].")] = None,
    card_format: Annotated[str | None, typer.Option("--format", help="Format of cards [that of the solver].")] = None,
    discrepancy: RunDiscrepancy = None,
    draws: Annotated[int | None, typer.Option(help="Draws of the posterior [64].")] = None,
    sampling: Annotated[str | None, typer.Option(help="How draws spread: sobol, latin or random [sobol].")] = None,
    all_draws: Annotated[
        bool, typer.Option("--all-draws", help="Keep draws that are not stable over the measured range.")
    ] = False,
    shares: Annotated[
        bool, typer.Option(help="Run the draws without their discrepancy, too, for the shares of the variance.")
    ] = True,
    law: Annotated[str | None, typer.Option(help="Law of the cards, as of tissuq export.")] = None,
    order: Annotated[int | None, typer.Option(help="Order or number of terms of that law.")] = None,
    unit: Annotated[str | None, typer.Option(help="Unit of stress of the model: MPa, kPa or Pa [MPa].")] = None,
    bulk_modulus: Annotated[
        float | None, typer.Option(help="In that unit, of all draws [1000 times the mean initial shear modulus].")
    ] = None,
    poisson: Annotated[float | None, typer.Option(help="Instead: Poisson's ratio of all draws.")] = None,
    fitted_law: RunMaterial = None,
    also: Annotated[
        list[Path] | None, typer.Option(help="Another file that the solver needs beside the deck; repeat for more.")
    ] = None,
    seed: Seed = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the ensemble [runs/RUN-MODEL].")] = None,
    config: Config = None,
    max_jobs: Annotated[
        int | None, typer.Option(min=1, help="Runs of the solver at a time, as many as licences [one a core].")
    ] = None,
    scheduler: Scheduler = None,
    timeout: Annotated[float | None, typer.Option(min=0, help="Seconds after which a run is stopped [never].")] = None,
    retries: Annotated[int, typer.Option(min=0, help="Times that a failed run is made again, as for a licence.")] = 0,
    again: Annotated[bool, typer.Option("--again", help="Make runs again that failed earlier.")] = False,
    keep: Annotated[bool, typer.Option(help="Keep the solver's files of every draw.")] = True,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Show what changes in the deck, and run nothing.")] = False,
    figures: Figures = True,
) -> None:
    """Run your own finite-element model with draws of a posterior; the same command resumes a stopped ensemble."""
    from tissuq.report.ensemble import ensemble_result
    from tissuq.report.run_folder import check_apart
    from tissuq.report.simulation import check_source
    from tissuq.report.terminal import print_explanations, print_result
    from tissuq.report.writer import write_result
    from tissuq.studies.ensemble import EnsembleSettings, prepare_ensemble, run_ensemble
    from tissuq.studies.ensemble_files import forget_failures
    from tissuq.studies.stream import open_pool

    if run is not None and model is None and run.is_file():
        run, model = None, run  # every material has its own run
    if bool(model) == bool(config) or (run and not model):
        raise InputError("give the RUN folder of a fit and your MODEL, or --config run.toml of an earlier ensemble.")
    options: dict[str, Any] = {
        "model": str(model) if model else None, "materials": _materials(material or [], run) or None,
        "quantities": _pairs("--qoi", qoi or [], "force=RF3@TOP") or None, "solver": solver, "command": command,
        "deck": deck, "card_format": card_format, "discrepancy": discrepancy, "draws": draws, "sampling": sampling,
        "all_draws": all_draws or None, "shares": None if shares else False, "law": law, "order": order, "unit": unit,
        "bulk_modulus": bulk_modulus, "poisson": poisson, "also": [str(file) for file in also or []] or None,
        "seed": seed,
    }  # fmt: skip
    for name, option in (("materials", "--material NAME"), ("quantities", "--qoi NAME=RF3@SET")):
        if config is None and options[name] is None:
            raise InputError(f"give {option}: what the model is asked for.")
    settings = load_settings(EnsembleSettings, config, options)
    beside = config.parent if config else Path()
    if config:
        _check_named_again(config, settings, options, dry_run)
    sources = list(dict.fromkeys(settings.materials.values()))
    named = beside if config else Path(sources[0])
    folder = out or Path("runs") / f"{named.resolve().name}-{Path(settings.model).stem}"
    if not config and not dry_run:
        for source in sources:
            check_apart(folder, beside / source)
    with progress() as step:
        prepared = prepare_ensemble(
            settings, beside, own_law(fitted_law), step, runs_here=not (dry_run or scheduler), is_dry=dry_run
        )
    if dry_run:
        print(prepared.diff())
        print_explanations(prepared.card_warnings)
        return
    stored = _stored(prepared, sources, beside)
    check_folder(folder, stored, free=frozenset({"quantities"}))
    for number, source in enumerate(sources, start=1):
        check_source(beside / source, folder / POSTERIORS / str(number))
    _write_inputs(prepared, stored, sources, beside, folder)
    if again:
        forget_failures(prepared, folder)
    processes = max_jobs or os.cpu_count() or 1
    with open_pool(processes, scheduler) as pool:
        study = run_ensemble(
            prepared, folder, pool=pool, limit=max_jobs if scheduler else None, timeout=timeout, retries=retries,
            keep=keep, progress=campaign_progress,
        )  # fmt: skip
    result = ensemble_result(study, folder)
    write_result(result, folder, figures=figures)
    print_explanations(prepared.card_warnings)
    print_result(result.record(), folder)


def _check_named_again(config: Path, settings: EnsembleSettings, options: dict[str, Any], dry_run: bool) -> None:
    """Refuse to run programs, or to read files elsewhere, that a recipe names and the command line does not."""
    from tissuq.mechanics.user_law import LAW

    missing = []
    if not dry_run:
        if settings.command and not options["command"]:
            missing.append(f"--command {shlex.quote(settings.command)}")
        for name, text in settings.quantities.items():
            if LAW.fullmatch(text) and name not in (options["quantities"] or {}):
                missing.append(f"--qoi {shlex.quote(f'{name}={text}')}")
    inside = config.parent.resolve()
    if options["also"] is None and not all(is_inside(inside / file, inside) for file in settings.also):
        missing += [f"--also {shlex.quote(file)}" for file in settings.also]
    if missing:
        raise InputError(
            f"'{config}' names programs that would be run, or files outside of its folder. They are used only if named "
            f"here, too; if you know them, add {' '.join(missing)}."
        )


def _stored(prepared: PreparedEnsemble, sources: list[str], beside: Path) -> EnsembleSettings:
    """Return the settings with the names that runs and files have in the folder of the ensemble."""
    from tissuq.report.simulation import SOURCE
    from tissuq.studies.ensemble_files import MODEL, stored_place

    settings = prepared.settings
    places = {source: f"{POSTERIORS}/{number}/{SOURCE}" for number, source in enumerate(sources, start=1)}
    changes = {
        "model": f"{MODEL}/{prepared.deck.main}",
        "materials": {name: places[source] for name, source in settings.materials.items()},
        "also": [stored_place(prepared.deck, beside / file) for file in settings.also],
    }
    return settings.model_copy(update=changes)


def _write_inputs(
    prepared: PreparedEnsemble, stored: EnsembleSettings, sources: list[str], beside: Path, folder: Path
) -> None:
    """Write recipe and copies of all that an ensemble starts from, so that it can be repeated."""
    from tissuq.report.ensemble import copy_functions
    from tissuq.report.simulation import copy_source
    from tissuq.studies.ensemble_files import copy_model

    folder.mkdir(parents=True, exist_ok=True)
    copy_model(prepared, beside, folder)
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
    return once_each("--material", pairs)


def _pairs(option: str, texts: list[str], example: str) -> dict[str, str]:
    pairs = []
    for text in texts:
        name, equals, value = (word.strip() for word in text.partition("="))
        if not (name and equals and value):
            raise InputError(f"'{text}' is not understood by {option}; write NAME=WHAT, as in {example}.")
        pairs.append((name, value))
    return once_each(option, pairs)
