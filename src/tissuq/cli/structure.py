"""``tissuq structure``: a case of finite elements with the draws of a posterior."""

from __future__ import annotations

import os
import warnings
from pathlib import Path
from typing import Annotated, Any

import typer

from tissuq.cli.options import (
    Config,
    Figures,
    RunDiscrepancy,
    RunFolder,
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
from tissuq.studies.settings import load_settings

__all__ = ["structure"]


def structure(
    run: RunFolder = None,
    case: Annotated[
        str | None,
        typer.Option(help="indentation (flat punch, disc) or bar (clamped, in tension) [indentation]."),
    ] = None,
    size: Annotated[
        list[str] | None,
        typer.Option(
            help="Size of the case in mm, NAME=VALUE; repeat for more. Indentation: depth, punch_radius, height, "
            "radius, contact=bonded|frictionless, fineness; bar: elongation, bar_length, bar_radius, fineness."
        ),
    ] = None,
    discrepancy: RunDiscrepancy = None,
    draws: Annotated[int | None, typer.Option(help="Draws of the posterior [64].")] = None,
    steps: Annotated[int | None, typer.Option(help="Steps at which the force is computed [8].")] = None,
    full_runs: Annotated[
        int | None,
        typer.Option(help="Draws computed in full; the others follow to first order, much faster [all]."),
    ] = None,
    force_noise: Annotated[
        float | None,
        typer.Option(help="Sd of a new measurement of the force, N [same share of the force as in the test]."),
    ] = None,
    bulk_ratio: Annotated[float | None, typer.Option(help="Bulk modulus in initial shear moduli [2000].")] = None,
    material: RunMaterial = None,
    seed: Seed = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the simulation [runs/RUN-CASE].")] = None,
    config: Config = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes on this machine [one a core].")] = None,
    scheduler: Scheduler = None,
    figures: Figures = True,
) -> None:
    """Compute the force in a case with draws of a posterior; the same command resumes a stopped simulation."""
    from tissuq.cli.tables import print_rows, print_warnings
    from tissuq.report.run_folder import check_apart
    from tissuq.report.simulation import SOURCE, check_source, copy_source, readable_forces, write_simulation
    from tissuq.studies.stream import open_pool
    from tissuq.studies.structure import SimulationSettings, load_posteriors, run_simulation

    if bool(run) == bool(config):
        raise InputError("give the RUN folder of a fit, or --config run.toml of an earlier simulation.")
    options: dict[str, Any] = {
        "run": str(run) if run else None, "case": case, "sizes": _sizes(size or []) or None, "discrepancy": discrepancy,
        "draws": draws, "steps": steps, "full_runs": full_runs, "force_noise": force_noise, "bulk_ratio": bulk_ratio,
        "seed": seed,
    }  # fmt: skip
    settings = load_settings(SimulationSettings, config, options)
    beside = config.parent if config else Path()
    source = beside / settings.run
    stored_settings = settings.model_copy(update={"run": SOURCE})
    named = settings.sized_case().name
    folder = out or Path("runs") / f"{(run or beside).resolve().name}-{named}"
    law = own_law(material)
    if not config:  # a repeated simulation may continue in its own folder, which holds the run
        check_apart(folder, source)
    check_folder(folder, stored_settings)
    check_source(source, folder)
    with progress() as step, warnings.catch_warnings(record=True) as raised:
        warnings.simplefilter("always", UserWarning)
        posteriors = load_posteriors(settings, beside, law, step)

    def prepare() -> None:
        write_campaign_recipe(folder, stored_settings)
        copy_source(source, folder)

    processes = 1 if law else workers or os.cpu_count() or 1  # other processes cannot load a law from a file
    with open_pool(processes, scheduler) as pool:
        study = run_simulation(settings, posteriors, folder, prepare=prepare, pool=pool, progress=campaign_progress)
    write_simulation(study, folder, figures=figures)
    print_rows(f"Case '{named}' with {settings.draws} draws", *readable_forces(study))
    print_warnings([*dict.fromkeys(str(warning.message) for warning in raised), *study.warnings])
    print(f"Report: {folder / 'report.html'}")


def _sizes(texts: list[str]) -> dict[str, float | str]:
    """Return sizes from texts like ``depth=0.4``."""
    pairs = []
    for text in texts:
        name, equals, value = (word.strip() for word in text.partition("="))
        if not (name and equals and value):
            raise InputError(f"'{text}' is not a size; write NAME=VALUE, as in depth=0.4.")
        pairs.append((name, _number(value)))
    return once_each("--size", pairs)


def _number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text
