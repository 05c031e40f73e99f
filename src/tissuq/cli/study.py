"""``tissuq paper`` and ``study``: the study of the paper, and campaigns over many data sets."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tissuq.cli.former_names import Renamed
from tissuq.cli.options import (
    Config,
    Figures,
    Force,
    Scheduler,
    Seed,
    campaign_progress,
    check_folder,
    not_converged,
    once_each,
    parse_prior,
    progress,
    write_campaign_recipe,
)
from tissuq.errors import InputError
from tissuq.studies.settings import load_settings

if TYPE_CHECKING:
    from tissuq.report.result import Result

__all__ = ["paper", "study"]


def paper(
    out: Annotated[Path, typer.Option(help="Folder for the run.")] = Path("runs/paper"),
    config: Config = None,
    points: Annotated[int | None, typer.Option("--measurements", help="Number of measurements [30].")] = None,
    stretch_range: Annotated[str | None, typer.Option(help="Stretches LOW:HIGH [0.5:4.25].")] = None,
    noise_sd: Annotated[
        float | None,
        typer.Option(help="Standard deviation of the noise, MPa [0.5]; 0.7071 if 0.5 is a variance."),
    ] = None,
    prior: Annotated[
        list[str] | None, typer.Option(help="A prior in MPa, such as c=uniform(0,10); repeat for more.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of noise and draws [2021].")] = None,
    sampler: Annotated[str | None, typer.Option("--method", help="exact, nuts or both [exact].")] = None,
    replicates: Annotated[int | None, typer.Option(help="Data sets over which every claim is checked [1].")] = None,
    figures: Figures = True,
    force: Force = False,
) -> None:
    """Carry out the study of Zeraatpisheh, Bordas & Beex (2021) and check its claims."""
    from tissuq.report.paper import paper_result
    from tissuq.report.run_folder import check_target, run_folder
    from tissuq.report.terminal import print_result
    from tissuq.report.writer import write_result
    from tissuq.validation.paper import PaperSettings, run_paper
    from tissuq.validation.paper.study import steps_of

    low, high = _range(stretch_range)
    options: dict[str, Any] = {
        "points": points, "stretch_low": low, "stretch_high": high, "noise_sd": noise_sd, "seed": seed,
        "sampler": sampler, "replicates": replicates,
    }  # fmt: skip
    if prior:
        options["priors"] = once_each("--prior", map(parse_prior, prior))
    settings = load_settings(PaperSettings, config, options)
    check_target(out, force=force)
    with progress(steps_of(settings)) as step:
        study = run_paper(settings, step)
        step("writing")
        result = paper_result(study)
        with run_folder(out, force=force) as folder:
            write_result(result, folder, figures=figures)
    print_result(result.record(), out)
    not_converged(study.not_converged)


def _range(text: str | None) -> tuple[float | None, float | None]:
    from tissuq.errors import InputError

    if text is None:
        return None, None
    try:
        low, high = (float(end) for end in text.split(":"))
    except ValueError as error:
        raise InputError(f"--stretch-range needs LOW:HIGH, such as 0.5:4.25, not '{text}'.") from error
    return low, high


study = typer.Typer(name="study", no_args_is_help=True, rich_markup_mode=None, help="Campaigns over many data sets.")

CampaignConfig = Annotated[Path | None, typer.Option(help="TOML file of the campaign.")]
Out = Annotated[Path | None, typer.Option(help="Folder of the campaign [runs/NAME].")]
Noise = Annotated[str | None, typer.Option("--noise-sd", help="known or unknown to the fits.")]
Workers = Annotated[int, typer.Option(min=1, help="Processes on this machine.")]


@study.callback()
def _study() -> None:
    """Campaigns over many data sets."""


@study.command("coverage", cls=Renamed)
def coverage(
    config: CampaignConfig = None,
    preset: Annotated[
        str | None,
        typer.Option(
            help="Instead: paper, panel, random-materials, further-families, small-strains, strength, formulations, "
            "transfer, rivals, or sbc."
        ),
    ] = None,
    out: Out = None,
    replicates: Annotated[int | None, typer.Option(help="Data sets of every family.")] = None,
    noise: Noise = None,
    seed: Seed = None,
    workers: Workers = 1,
    scheduler: Scheduler = None,
) -> None:
    """Count how often intervals contain the true value; the same command resumes a stopped campaign."""
    from tissuq.report.coverage import coverage_result
    from tissuq.validation.coverage import PRESETS, CoverageSettings, run_campaign
    from tissuq.validation.coverage.campaign import tasks_of

    if preset == "sbc" and config is None:
        sbc(None, out, replicates, noise, seed, workers, scheduler)
        return
    if (config is None) == (preset is None):
        raise InputError(f"give --config FILE.toml, or --preset with one of {', '.join(PRESETS)}, sbc.")
    options: dict[str, Any] = {"replicates": replicates, "noise": noise, "seed": seed}
    settings = load_settings(CoverageSettings, config, _with_preset(preset, options))
    folder = out or Path("runs") / f"coverage-{preset or (config or Path()).stem}"
    results = _carry_out(settings, folder, workers, scheduler, len(tasks_of(settings)), run_campaign)
    _write(coverage_result(settings, results), folder)


@study.command("sbc", cls=Renamed)
def sbc(
    config: CampaignConfig = None,
    out: Out = None,
    replicates: Annotated[int | None, typer.Option(help="Data sets of every formulation.")] = None,
    noise: Noise = None,
    seed: Seed = None,
    workers: Workers = 1,
    scheduler: Scheduler = None,
    material: Annotated[str | None, typer.Option(help="The material that is calibrated [neo-hookean].")] = None,
    formulation: Annotated[
        list[str] | None, typer.Option("--discrepancy", help="Discrepancy; repeat for more [all of them].")
    ] = None,
) -> None:
    """Check by simulation that posteriors are what priors and data make them (simulation-based calibration)."""
    from tissuq.report.sbc import sbc_result
    from tissuq.validation.sbc import SbcSettings, run_sbc, tasks_of

    options = {"replicates": replicates, "noise": noise, "seed": seed, "material": material}
    settings = load_settings(SbcSettings, config, options | {"formulations": formulation or None})
    folder = out or Path("runs") / (config.stem if config else f"sbc-{material}" if material else "sbc")
    results = _carry_out(settings, folder, workers, scheduler, len(tasks_of(settings)), run_sbc)
    _write(sbc_result(settings, results), folder)


@study.command("tissues", cls=Renamed)
def tissues(
    folder: Annotated[
        Path | None, typer.Argument(help="Folder with a CSV file for each set of tests [the sets of tissuq].")
    ] = None,
    config: CampaignConfig = None,
    out: Out = None,
    dataset: Annotated[list[str] | None, typer.Option(help="A set to take; repeat for more [all of them].")] = None,
    protocol: Annotated[
        list[str] | None,
        typer.Option(
            help="What is predicted: tests, modes, specimens, ends, halves; repeat for more [tests, specimens, ends]."
        ),
    ] = None,
    formulation: Annotated[
        list[str] | None, typer.Option("--discrepancy", help="Discrepancy; repeat for more [auto, none].")
    ] = None,
    material: Annotated[str | None, typer.Option(help="The material that is fitted [neo-hookean].")] = None,
    tolerance: Annotated[
        list[str] | None,
        typer.Option(help="Error of a test, as of tissuq fit (stresses in MPa): stress=10%, smooth=2% ...; or none."),
    ] = None,
    predictions: Annotated[int | None, typer.Option(help="Predictions at most of a set and protocol [12].")] = None,
    workers: Workers = 1,
    scheduler: Scheduler = None,
) -> None:
    """Predict real tests from others, and count how often bands hold; the same command resumes a stopped benchmark."""
    from tissuq.cli.reading import tolerances
    from tissuq.report.tissues import tissue_result
    from tissuq.validation.tissues import TissueSettings, run_benchmark
    from tissuq.validation.tissues.benchmark import tasks_of

    options: dict[str, Any] = {
        "folder": None if folder is None else str(folder.resolve()), "sets": dataset or None,
        "protocols": protocol or None, "formulations": formulation or None, "material": material,
        "tolerances": tolerances(tolerance), "predictions": predictions,
    }  # fmt: skip
    settings = load_settings(TissueSettings, config, options)
    target = out or Path("runs") / (config.stem if config else "tissues")
    results = _carry_out(settings, target, workers, scheduler, len(tasks_of(settings)), run_benchmark)
    _write(tissue_result(settings, results), target)


def _write(result: Result, folder: Path) -> None:
    """Write the result of a campaign into its folder, and print it."""
    from tissuq.report.terminal import print_result
    from tissuq.report.writer import write_result

    write_result(result, folder)
    print_result(result.record(), folder)


def _with_preset(name: str | None, options: dict[str, Any]) -> dict[str, Any]:
    from tissuq.validation.coverage import preset

    stated = {key: value for key, value in options.items() if value is not None}
    return dict(preset(name)) | stated if name else stated


def _carry_out(
    settings: Any, folder: Path, workers: int, scheduler: str | None, total: int, run: Any
) -> list[dict[str, Any]]:
    """Carry out a campaign in its folder; nothing is written before its workers are there."""
    from tissuq.studies.stream import open_pool

    check_folder(folder, settings)
    with open_pool(workers, scheduler) as pool, campaign_progress(total) as step:
        write_campaign_recipe(folder, settings)
        results: list[dict[str, Any]] = run(settings, folder, pool=pool, step=step)
    return results
