"""``tissuq design``: which test to make next."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Any

import typer

from tissuq.cli.options import Config, Figures, Force, RunDiscrepancy, RunFolder, RunMaterial, Seed, own_law, progress
from tissuq.errors import InputError
from tissuq.studies.settings import load_settings

__all__ = ["design"]


def design(
    run: RunFolder = None,
    target: Annotated[
        list[str] | None,
        typer.Option(
            help="Quantity to become less uncertain: modulus (initial shear modulus), a parameter, or a stress as "
            "MODE:STRETCH, such as planar:1.5; repeat for more [modulus]."
        ),
    ] = None,
    candidate: Annotated[
        list[str] | None,
        typer.Option(
            help="A test as 'MODE LOW:HIGH POINTS', such as 'planar 1:1.5 20'; repeat for more [every mode of one "
            "stretch, in several ranges]."
        ),
    ] = None,
    points: Annotated[
        list[int] | None,
        typer.Option(help="Measurements of every default test; repeat for more [as many as the data, 10 to 40]."),
    ] = None,
    specimen: Annotated[
        str | None,
        typer.Option(help="The next test is of the same specimen or of another one [same, unless there are several]."),
    ] = None,
    discrepancy: RunDiscrepancy = None,
    material: RunMaterial = None,
    seed: Seed = None,
    out: Annotated[Path | None, typer.Option(help="Folder for the ranking [runs/RUN-design].")] = None,
    config: Config = None,
    figures: Figures = True,
    force: Force = False,
) -> None:
    """Rank tests that could be made next by how much less uncertain they make a parameter or a prediction."""
    from tissuq.cli.tables import print_explanations, print_rows, print_warnings
    from tissuq.report.design import HEADERS, heading, readable_design, write_design
    from tissuq.report.run_folder import check_apart, check_target, run_folder
    from tissuq.studies.design import DesignSettings, run_design

    if run is None and config is None:
        raise InputError("give the RUN folder of a fit, or --config run.toml.")
    options: dict[str, Any] = {
        "run": str(run.absolute()) if run else None, "targets": target or None, "candidates": candidate or None,
        "points": points or None, "specimen": specimen, "discrepancy": discrepancy, "seed": seed,
    }  # fmt: skip
    law = own_law(material)
    settings = load_settings(DesignSettings, config, options)
    beside = config.parent if config else Path()
    run_path = (beside / settings.run).resolve()
    folder = out or Path("runs") / f"{run_path.name}-design"
    check_apart(folder, run_path)
    check_target(folder, force=force)
    with progress() as step:
        study = run_design(settings, beside, step, law)
        step("writing")
        recipe = settings.model_copy(update={"run": os.path.relpath(run_path, folder.resolve())})
        with run_folder(folder, force=force) as scratch:
            write_design(study, recipe, scratch, figures=figures)
    for aim in study.targets:
        print_rows(
            heading(study, aim)[0].upper() + heading(study, aim)[1:],
            HEADERS,
            readable_design(study, aim),
        )
    print_explanations(study.explanations)
    print_warnings(study.warnings)
    print(f"Report: {folder / 'report.html'}")
