"""``tissuq simulate``: a case of finite elements with the draws of a posterior."""

from __future__ import annotations

import os
import warnings
from pathlib import Path
from typing import Annotated, Any

import typer

from tissuq.cli.campaign import check_folder, write_campaign_recipe
from tissuq.cli.options import campaign_progress, once_each, own_law, progress
from tissuq.errors import InputError
from tissuq.studies.settings import load_settings

__all__ = ["simulate"]


def simulate(
    run: Annotated[Path | None, typer.Argument(help="Run folder of tissuq fit.")] = None,
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
    discrepancy: Annotated[
        str | None, typer.Option(help="Which of the run's discrepancies [auto, or the only one].")
    ] = None,
    draws: Annotated[int | None, typer.Option(help="Draws of the posterior [64].")] = None,
    steps: Annotated[int | None, typer.Option(help="Steps at which the force is told [8].")] = None,
    force_noise: Annotated[
        float | None,
        typer.Option(help="Sd of a new measurement of the force, N [the share that the test's has in its stress]."),
    ] = None,
    bulk_ratio: Annotated[float | None, typer.Option(help="Bulk modulus in initial shear moduli [2000].")] = None,
    material: Annotated[
        str | None, typer.Option(help="The run's material, where it is a law in a file: law.py:Name.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the draws [0].")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the simulation [runs/RUN-CASE].")] = None,
    config: Annotated[Path | None, typer.Option(help="run.toml of an earlier simulation to repeat.")] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes on this machine [one a core].")] = None,
    scheduler: Annotated[str | None, typer.Option(help="Address of a Dask scheduler to use instead.")] = None,
    figures: Annotated[bool, typer.Option(help="Draw the figures, too.")] = True,
) -> None:
    """Compute the force in a case with draws of a posterior; the same command goes on with one that was stopped."""
    from tissuq.cli.tables import print_rows, print_warnings
    from tissuq.report.run_folder import check_apart
    from tissuq.report.simulation import SOURCE, check_source, copy_source, readable_forces, write_simulation
    from tissuq.studies.simulate import SimulationSettings, load_posteriors, run_simulation
    from tissuq.studies.stream import open_pool

    if bool(run) == bool(config):
        raise InputError("give the RUN folder of a fit, or --config run.toml of an earlier simulation.")
    options: dict[str, Any] = {
        "run": str(run) if run else None, "case": case, "sizes": _sizes(size or []) or None, "discrepancy": discrepancy,
        "draws": draws, "steps": steps, "force_noise": force_noise, "bulk_ratio": bulk_ratio, "seed": seed,
    }  # fmt: skip
    settings = load_settings(SimulationSettings, config, options)
    beside = config.parent if config else Path()
    source = beside / settings.run
    kept = settings.model_copy(update={"run": SOURCE})
    named = settings.sized_case().name
    folder = out or Path("runs") / f"{(run or beside).resolve().name}-{named}"
    law = own_law(material)
    if not config:  # a simulation that is repeated may go on in its own folder, which holds the run
        check_apart(folder, source)
    check_folder(folder, kept)
    check_source(source, folder)
    with progress() as step, warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", UserWarning)
        posteriors = load_posteriors(settings, beside, law, step)

    def prepare() -> None:
        write_campaign_recipe(folder, kept)
        copy_source(source, folder)

    many = 1 if law else workers or os.cpu_count() or 1  # a law in a file is not known to other processes
    with open_pool(many, scheduler) as pool:
        study = run_simulation(settings, posteriors, folder, prepare=prepare, pool=pool, progress=campaign_progress)
    write_simulation(study, folder, figures=figures)
    print_rows(f"Case '{named}' with {settings.draws} draws", *readable_forces(study))
    print_warnings([*dict.fromkeys(str(each.message) for each in told), *study.warnings])
    print(f"Report: {folder / 'report.html'}")


def _sizes(given: list[str]) -> dict[str, float | str]:
    """Return sizes from texts like ``depth=0.4``."""
    pairs = []
    for text in given:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not (name and equals and value):
            raise InputError(f"'{text}' is not a size; write NAME=VALUE, as in depth=0.4.")
        pairs.append((name, _number(value)))
    return once_each("--size", pairs)


def _number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text
