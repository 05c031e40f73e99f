"""``tissuq population``: several specimens together."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from tissuq.cli import reading
from tissuq.cli.options import Config, Figures, Force, Seed, not_converged, progress
from tissuq.cli.reading import one_noise
from tissuq.errors import InputError
from tissuq.studies.settings import load_settings

__all__ = ["population"]


@reading.reads_files
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
        str | None, typer.Option(help="Instead: unknown, proportional, repeats or autoregressive, as for tissuq fit.")
    ] = None,
    mode: Annotated[
        str | None, typer.Option(help="Loading mode of all files [as they or their names say, or uniaxial].")
    ] = None,
    *,
    read_as: dict[str, Any],
    method: Annotated[
        str | None, typer.Option(help="Of every specimen's fit: auto, exact, nuts, smc or joint [auto].")
    ] = None,
    seed: Seed = None,
    out: Annotated[Path | None, typer.Option(help="Folder for the run [runs/population].")] = None,
    config: Config = None,
    figures: Figures = True,
    force: Force = False,
) -> None:
    """Identify a population from its specimens, every specimen within it, and what to expect for a new patient."""
    from tissuq.cli.tables import print_rows, print_warnings
    from tissuq.mechanics import material_named
    from tissuq.report.population import HEADERS, readable_population, write_population_run
    from tissuq.report.run_folder import check_target, run_folder
    from tissuq.studies.population import PopulationSettings, run_population

    if bool(files) == bool(config):
        raise InputError("give the FILES of several specimens, folders of them, or --config run.toml.")
    options: dict[str, Any] = read_as | {
        "files": tuple(map(str, files)) if files else None, "specimen": specimen, "material": material,
        "parameters": tuple(parameter) if parameter else None, "spread": spread, "discrepancy": discrepancy,
        "noise_sd": one_noise(noise_sd), "noise": noise, "mode": mode, "method": method, "seed": seed,
    }  # fmt: skip
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
    print_rows(f"A population of {len(study.tests)} specimens", HEADERS, readable_population(study))
    print("Complete pooling treats all specimens as one: its interval does not describe the range of patients.")
    print_warnings(study.warnings)
    print(f"Report: {target / 'report.html'}")
    not_converged([] if study.population.converged else ["the population"])
