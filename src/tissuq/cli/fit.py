"""``tissuq fit`` and ``population``: the own measurements of a user, of one specimen or of many."""

from __future__ import annotations

from filecmp import cmp
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from tissuq.cli import reading
from tissuq.cli.options import Config, Figures, Force, Seed, not_converged, once_each, parse_prior, progress
from tissuq.cli.reading import one_noise
from tissuq.errors import InputError
from tissuq.studies.settings import load_settings, setting_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from tissuq.experiments.reading.experiment_file import Reading
    from tissuq.mechanics import Material
    from tissuq.studies.laws import LawStudy
    from tissuq.studies.specimen import SpecimenStudy

    Study = TypeVar("Study", SpecimenStudy, LawStudy)

__all__ = ["fit", "population"]


@reading.reads_files
def fit(
    file: Annotated[
        list[Path] | None,
        typer.Argument(
            help="CSV, Excel or other file, or the name of a built-in data set (tissuq datasets); several files, a "
            "folder of them, or several tests in a file are fitted together; FILE#NAME is one of these. Or STUDY.toml, "
            "as tissuq inspect --write makes it."
        ),
    ] = None,
    material: Annotated[
        list[str] | None,
        typer.Option(
            help="Material, a sum (gent+mooney-rivlin), or your own law.py:Name [neo-hookean]; see tissuq materials. "
            "Repeat for more, or 'all', to compare laws."
        ),
    ] = None,
    discrepancy: Annotated[
        list[str] | None,
        typer.Option(help="Discrepancy; repeat for more; 'all' fits the paper's seven and auto [auto]."),
    ] = None,
    noise_sd: Annotated[
        str | None,
        typer.Option(
            help="Sd of the noise of the engineering stress, in the file's stress unit, or unknown [unknown]; for "
            "several files also one for each, with commas."
        ),
    ] = None,
    noise: Annotated[
        str | None,
        typer.Option(
            help="Instead: unknown (errors of consecutive measurements correlated where the data say so), independent, "
            "autoregressive (correlated), proportional (grows with the stress) or repeats (same stretch again)."
        ),
    ] = None,
    prior: Annotated[
        list[str] | None,
        typer.Option(help="A prior in the file's stress unit, such as C10=uniform(0,5); repeat for more."),
    ] = None,
    estimand: Annotated[
        str | None,
        typer.Option(
            help="What intervals are of: the specimen as-tested (no errors of the test), the specimen (errors of a "
            "careful laboratory), or the tissue (another specimen) [specimen; tissue for files of several specimens]."
        ),
    ] = None,
    tolerance: Annotated[
        list[str] | None,
        typer.Option(
            help="Error of a whole test (standard deviation) instead of that of the estimand: stress=10%, test=10%, "
            "length=2%, slack=0.01 (of stretch), smooth=2% (along the curve), zero=0.1 (in the stress unit), or of "
            "every single stretch=0.001 or stress, resolution=0.2% (of the largest); or none; repeat."
        ),
    ] = None,
    specimen: Annotated[
        list[str] | None,
        typer.Option(help="Name of the specimen, once for each of several files [each its own]."),
    ] = None,
    mode: Annotated[
        list[str] | None,
        typer.Option(help="Loading mode [uniaxial]; once for each of several files [as they or their names say]."),
    ] = None,
    *,
    read_as: dict[str, Any],
    method: Annotated[str | None, typer.Option(help="auto, exact, nuts, smc or joint [auto].")] = None,
    stable_in: Annotated[
        list[str] | None,
        typer.Option(help="Require stability in this loading mode, or in all; repeat for more."),
    ] = None,
    held_out: Annotated[
        bool | None, typer.Option("--held-out", help="Also predict each of several tests from the others.")
    ] = None,
    seed: Seed = None,
    out: Annotated[Path | None, typer.Option(help="Folder for the run [runs/NAME].")] = None,
    config: Config = None,
    figures: Figures = True,
    force: Force = False,
) -> None:
    """Identify a material's parameters from files of stretches and stresses."""
    from tissuq.mechanics import material_named
    from tissuq.posterior.laws import ALL_LAWS
    from tissuq.report.run_folder import check_target
    from tissuq.studies.laws import LawSettings
    from tissuq.studies.specimen import SpecimenSettings

    if config is None and file and [path.suffix for path in file] == [".toml"]:
        config, file = file[0], None
    files = reading.files_of(file or [])
    options: dict[str, Any] = {
        "discrepancies": discrepancy or None, "noise": noise, "method": method, "seed": seed,
        "estimand": estimand, "tolerances": reading.tolerances(tolerance), "stable_in": stable_in or None,
        "held_out": held_out,
    }  # fmt: skip
    measured, found = reading.measured([] if config else files, read_as, mode, specimen, noise_sd)
    options |= measured
    if prior:
        options["priors"] = once_each("--prior", map(parse_prior, prior))
    if not file and not config:
        raise InputError("give a FILE of measurements, the name of a built-in data set, or --config run.toml.")
    if config and len(files) > 1:
        raise InputError("give FILES or --config, not both.")
    names = material or []
    is_comparison = len(names) > 1 or names == [ALL_LAWS]
    if config and not names:
        is_comparison = setting_of(config, "laws") is not None
    options |= {"laws": tuple(names) or None} if is_comparison else {"material": names[0] if names else None}
    own = {name: material_named(name, laws=True) for name in names if name != ALL_LAWS}
    kind: type[SpecimenSettings] = LawSettings if is_comparison else SpecimenSettings
    settings = load_settings(kind, config, options, rivals=("noise", "noise_sd"))
    beside = config.parent if config else Path()
    sources = [beside / test.file for test in settings.tests or (settings,)]
    if files and config:
        _check_same(files[0], sources[0], config)
    target = out or Path("runs") / reading.run_name(file or [], config, sources)
    check_target(target, force=force)
    fit_all = _compare_laws if is_comparison else _fit_one
    fit_all(settings, beside, own, found, sources, target, figures=figures, force=force)


def _fit_one(
    settings: Any,
    beside: Path,
    own: dict[str, Material],
    found: list[Reading | None],
    sources: list[Path],
    target: Path,
    **options: bool,
) -> None:
    """Fit one material, write the run and print its summary."""
    from tissuq.cli.tables import print_summary
    from tissuq.report.specimen import write_specimen_run
    from tissuq.studies.specimen import run_specimen

    run = partial(run_specimen, settings, beside, law=next(iter(own.values()), None), found=found)
    study = _written(run, write_specimen_run, sources, target, **options)
    print_summary(target, study.experiment)
    _print_omissions(study)


def _compare_laws(
    settings: Any,
    beside: Path,
    own: dict[str, Material],
    found: list[Reading | None],
    sources: list[Path],
    target: Path,
    **options: bool,
) -> None:
    """Fit several laws, write the run and print their table."""
    from tissuq.report.laws import law_result
    from tissuq.report.terminal import print_result
    from tissuq.report.writer import write_result
    from tissuq.studies.laws import run_laws

    def write(study: LawStudy, sources: list[Path], folder: Path, *, figures: bool) -> None:
        write_result(law_result(study, sources), folder, figures=figures)

    study = _written(partial(run_laws, settings, beside, own=own, found=found), write, sources, target, **options)
    print_result(law_result(study, sources).record(), target)
    _print_omissions(study)


def _written(
    run: Callable[..., Study],
    write: Callable[..., None],
    sources: list[Path],
    target: Path,
    *,
    figures: bool,
    force: bool,
) -> Study:
    """Return what comes of a run, when it is written into its folder."""
    from tissuq.report.run_folder import run_folder

    with progress() as step:
        study = run(step=step)
        step("writing")
        with run_folder(target, force=force) as folder:
            write(study, sources, folder, figures=figures)
    return study


def _print_omissions(study: SpecimenStudy | LawStudy) -> None:
    """Print what could not be fitted; say what has not converged."""
    for name, reason in study.skipped.items():
        print(f"Not fitted: {name}: {reason}")
    not_converged(study.not_converged)


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


@reading.reads_files
def population(
    files: Annotated[
        list[Path] | None,
        typer.Argument(
            help="Files, a specimen each; or folders of them, in which a folder is a specimen with a file a test."
        ),
    ] = None,
    specimen: Annotated[
        str | None, typer.Option("--specimen-column", help="Column of a single file that names the specimens.")
    ] = None,
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
        str | None, typer.Option(help="Instead: unknown, proportional, repeats or another one, as for tissuq fit.")
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
    from tissuq.mechanics import material_named
    from tissuq.report.population import population_result
    from tissuq.report.run_folder import check_target, run_folder
    from tissuq.report.terminal import print_result
    from tissuq.report.writer import write_result
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
        result = population_result(study, beside)
        with run_folder(target, force=force) as folder:
            write_result(result, folder, figures=figures)
    print_result(result.record(), target)
    not_converged([] if study.population.converged else ["the population"])
