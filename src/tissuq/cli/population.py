"""``tissuq population``: several specimens together."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from tissuq.cli.options import load_settings, noise_given, not_converged, once_each, progress, role_given
from tissuq.errors import InputError

__all__ = ["population"]


def population(
    files: Annotated[
        list[Path] | None,
        typer.Argument(
            help="Files, a specimen each; or folders of them, in which a folder is a specimen with a file a test."
        ),
    ] = None,
    specimen: Annotated[str | None, typer.Option(help="Column of a single file that names the specimens.")] = None,
    material: Annotated[
        str | None, typer.Option(help="Material, as for tissuq fit [neo-hookean]; see tissuq materials.")
    ] = None,
    parameter: Annotated[
        list[str] | None, typer.Option(help="Parameter to pool; repeat for more [all of the material].")
    ] = None,
    spread: Annotated[
        float | None, typer.Option(help="Sd of the half-normal prior of the spread of the logarithms [1].")
    ] = None,
    discrepancy: Annotated[str | None, typer.Option(help="Discrepancy of every specimen [auto].")] = None,
    noise_sd: Annotated[
        str | None, typer.Option(help="Sd of the noise, in the files' stress unit, or unknown [unknown].")
    ] = None,
    noise: Annotated[
        str | None, typer.Option(help="Instead: unknown, proportional, or repeats (same stretch again).")
    ] = None,
    mode: Annotated[str | None, typer.Option(help="Loading mode [uniaxial].")] = None,
    column: Annotated[
        list[str] | None,
        typer.Option(help="ROLE=COLUMN for stretch, strain or stress, such as stretch=Strain; repeat."),
    ] = None,
    stress_unit: Annotated[str | None, typer.Option(help="Unit of the stress column [the file's, or MPa].")] = None,
    stress_type: Annotated[str | None, typer.Option(help="engineering or cauchy [engineering].")] = None,
    strain_unit: Annotated[str | None, typer.Option(help="Unit of a strain column: 1 or percent.")] = None,
    compression_positive: Annotated[
        bool | None, typer.Option("--compression-positive", help="The files count compression as positive.")
    ] = None,
    skip_rows: Annotated[int | None, typer.Option(help="Lines to skip at the top of every file.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the draws [0].")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for the run [runs/population].")] = None,
    config: Annotated[Path | None, typer.Option(help="run.toml of an earlier run to repeat.")] = None,
    figures: Annotated[bool, typer.Option(help="Draw the figures, too.")] = True,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing run folder.")] = False,
) -> None:
    """Identify a population from its specimens, every specimen within it, and what to expect of a new patient."""
    from tissuq.cli.tables import print_rows, print_warnings
    from tissuq.mechanics import material_named
    from tissuq.report.population import HEADERS, readable_population, write_population_run
    from tissuq.report.run_folder import check_target, run_folder
    from tissuq.studies.population import PopulationSettings, run_population

    if bool(files) == bool(config):
        raise InputError("give the FILES of several specimens or folders of them, or --config run.toml.")
    options: dict[str, Any] = {
        "files": tuple(map(str, files)) if files else None, "specimen": specimen, "material": material,
        "parameters": tuple(parameter) if parameter else None, "spread": spread, "discrepancy": discrepancy,
        "noise_sd": noise_given(noise_sd), "noise": noise, "mode": mode, "stress_unit": stress_unit,
        "stress_type": stress_type, "strain_unit": strain_unit, "compression_positive": compression_positive,
        "skip_rows": skip_rows, "seed": seed,
    }  # fmt: skip
    if column:
        options["columns"] = once_each("--column", map(role_given, column))
    law = material_named(material, laws=True) if material else None
    settings = load_settings(PopulationSettings, config, options, rivals=("noise", "noise_sd"))
    beside = config.parent if config else Path()
    target = out or Path("runs") / "population"
    check_target(target, force=force)
    with progress() as step:
        study = run_population(settings, beside, step, law)
        step("writing")
        with run_folder(target, force=force) as folder:
            write_population_run(study, folder, beside, figures=figures)
    print_rows(f"A population of {len(study.experiments)} specimens", HEADERS, readable_population(study))
    print("Complete pooling takes all specimens for one: its interval is no range of patients.")
    print_warnings(study.warnings)
    print(f"Report: {target / 'report.html'}")
    not_converged([] if study.population.converged else ["the population"])
