"""``tissuq fit``: the user's own measurements."""

from __future__ import annotations

from filecmp import cmp
from pathlib import Path
from typing import Annotated, Any

import typer

from tissuq.cli.options import (
    load_settings,
    noise_given,
    not_converged,
    once_each,
    parse_prior,
    progress,
    role_given,
)
from tissuq.errors import InputError

__all__ = ["fit"]


def fit(
    file: Annotated[
        Path | None, typer.Argument(help="CSV file, or the name of a built-in data set (tissuq datasets).")
    ] = None,
    material: Annotated[
        str | None,
        typer.Option(
            help="Material, a sum (gent+mooney-rivlin), or your own law.py:Name [neo-hookean]; see tissuq materials."
        ),
    ] = None,
    discrepancy: Annotated[
        list[str] | None,
        typer.Option(help="Discrepancy; repeat for more; 'all' fits the paper's seven and auto [auto]."),
    ] = None,
    noise_sd: Annotated[
        str | None,
        typer.Option(
            help="Sd of the noise of the engineering stress, in the file's stress unit, or unknown [unknown]."
        ),
    ] = None,
    noise: Annotated[
        str | None,
        typer.Option(help="Instead: unknown, proportional (grows with the stress) or repeats (same stretch again)."),
    ] = None,
    prior: Annotated[
        list[str] | None,
        typer.Option(help="A prior in the file's stress unit, such as C10=uniform(0,5); repeat for more."),
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
        bool | None, typer.Option("--compression-positive", help="The file counts compression as positive.")
    ] = None,
    skip_rows: Annotated[int | None, typer.Option(help="Lines to skip at the top of the file.")] = None,
    method: Annotated[str | None, typer.Option(help="auto, exact, nuts, smc or joint [auto].")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the draws [0].")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for the run [runs/NAME].")] = None,
    config: Annotated[Path | None, typer.Option(help="run.toml of an earlier run to repeat.")] = None,
    figures: Annotated[bool, typer.Option(help="Draw the figures, too.")] = True,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing run folder.")] = False,
) -> None:
    """Identify a material's parameters from a file of stretches and stresses."""
    from tissuq.cli.tables import print_summary, print_warnings
    from tissuq.mechanics import material_named
    from tissuq.report.run_folder import check_target, run_folder
    from tissuq.report.specimen import write_specimen_run
    from tissuq.studies.specimen import SpecimenSettings, run_specimen

    options: dict[str, Any] = {
        "file": str(_resolve(file)) if file and not config else None, "material": material, "mode": mode,
        "discrepancies": discrepancy or None, "noise_sd": noise_given(noise_sd), "stress_unit": stress_unit,
        "stress_type": stress_type, "strain_unit": strain_unit, "compression_positive": compression_positive,
        "skip_rows": skip_rows, "noise": noise, "method": method, "seed": seed,
    }  # fmt: skip
    if prior:
        options["priors"] = once_each("--prior", map(parse_prior, prior))
    if column:
        options["columns"] = once_each("--column", map(role_given, column))
    if not file and not config:
        raise InputError("give a FILE of measurements, the name of a built-in data set, or --config run.toml.")
    law = material_named(material, laws=True) if material else None
    settings = load_settings(SpecimenSettings, config, options, rivals=("noise", "noise_sd"))
    beside = config.parent if config else Path()
    source = beside / settings.file
    if file and config:
        _check_same(_resolve(file), source, config)
    target = out or Path("runs") / source.stem
    check_target(target, force=force)
    with progress() as step:
        study = run_specimen(settings, beside, step, law)
        step("writing")
        with run_folder(target, force=force) as folder:
            write_specimen_run(study, source, folder, figures=figures)
    print_summary(target)
    print_warnings(study.warnings)
    for name, reason in study.skipped.items():
        print(f"Not fitted: {name}: {reason}")
    not_converged(study.not_converged)


def _resolve(file: Path) -> Path:
    """Return the user's file, or the built-in data set of that name, which must be one that can be fitted."""
    from tissuq.experiments import datasets

    if file.exists() or str(file) not in datasets.names():
        return file
    datasets.load(str(file))
    return datasets.path(str(file))


def _check_same(file: Path, named: Path, config: Path) -> None:
    """Refuse a FILE that is not what the configuration names."""
    try:
        same = cmp(file, named, shallow=False)
    except OSError:
        same = False
    if not same:
        raise InputError(
            f"FILE '{file}' is not the file that '{config}' names, '{named}'. Leave FILE out to repeat that run, or "
            "leave --config out to fit FILE."
        )
