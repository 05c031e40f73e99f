"""``tissuq study``: campaigns."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from tissuq.cli.campaign import check_folder, write_campaign_recipe
from tissuq.cli.options import campaign_progress
from tissuq.errors import InputError
from tissuq.studies.settings import load_settings

__all__ = ["study"]

study = typer.Typer(name="study", no_args_is_help=True, rich_markup_mode=None, help="Campaigns over many data sets.")

Config = Annotated[Path | None, typer.Option(help="TOML file of the campaign.")]
Out = Annotated[Path | None, typer.Option(help="Folder of the campaign [runs/NAME].")]
Noise = Annotated[str | None, typer.Option(help="known or unknown.")]
Seed = Annotated[int | None, typer.Option(help="Seed of materials and noise.")]
Workers = Annotated[int, typer.Option(min=1, help="Processes on this machine.")]
Scheduler = Annotated[str | None, typer.Option(help="Address of a Dask scheduler to use instead.")]


@study.callback()
def _study() -> None:
    """Campaigns over many data sets."""


@study.command("coverage")
def coverage(
    config: Config = None,
    preset: Annotated[
        str | None,
        typer.Option(
            help="Instead: paper, panel, random-materials, further-families, strength, formulations, transfer, rivals, "
            "or sbc."
        ),
    ] = None,
    out: Out = None,
    replicates: Annotated[int | None, typer.Option(help="Data sets of every family.")] = None,
    noise: Noise = None,
    seed: Seed = None,
    workers: Workers = 1,
    scheduler: Scheduler = None,
) -> None:
    """Count how often intervals hold the truth; the same command goes on with a campaign that was stopped."""
    from tissuq.cli.tables import print_rows
    from tissuq.report.coverage import readable_coverage, write_campaign
    from tissuq.studies.coverage import PRESETS, CoverageSettings, run_campaign
    from tissuq.studies.coverage.campaign import tasks_of

    if preset == "sbc" and config is None:
        sbc(None, out, replicates, noise, seed, workers, scheduler)
        return
    if (config is None) == (preset is None):
        raise InputError(f"give --config FILE.toml, or --preset with one of {', '.join(PRESETS)}, sbc.")
    options: dict[str, Any] = {"replicates": replicates, "noise": noise, "seed": seed}
    settings = load_settings(CoverageSettings, config, _with_preset(preset, options))
    folder = out or Path("runs") / f"coverage-{preset or (config or Path()).stem}"
    results = _carry_out(settings, folder, workers, scheduler, len(tasks_of(settings)), run_campaign)
    summary = write_campaign(settings, results, folder)
    print_rows("Coverage of C10", *readable_coverage(summary))
    print(f"± are Monte Carlo standard errors. Report: {folder / 'report.html'}")


@study.command("sbc")
def sbc(
    config: Config = None,
    out: Out = None,
    replicates: Annotated[int | None, typer.Option(help="Data sets of every formulation.")] = None,
    noise: Noise = None,
    seed: Seed = None,
    workers: Workers = 1,
    scheduler: Scheduler = None,
    material: Annotated[str | None, typer.Option(help="The material that is calibrated [neo-hookean].")] = None,
    formulation: Annotated[
        list[str] | None, typer.Option(help="A discrepancy that is; repeat for more [all of them].")
    ] = None,
) -> None:
    """Check by simulation that posteriors are what priors and data make them (simulation-based calibration)."""
    from tissuq.cli.tables import print_rows
    from tissuq.report.sbc import readable_ranks, write_sbc
    from tissuq.studies.sbc import SbcSettings, run_sbc
    from tissuq.studies.sbc.campaign import tasks_of

    options = {"replicates": replicates, "noise": noise, "seed": seed, "material": material}
    settings = load_settings(SbcSettings, config, options | {"formulations": formulation or None})
    folder = out or Path("runs") / (config.stem if config else f"sbc-{material}" if material else "sbc")
    results = _carry_out(settings, folder, workers, scheduler, len(tasks_of(settings)), run_sbc)
    table = write_sbc(settings, results, folder)
    print_rows("Ranks of the truth", *readable_ranks(table))
    print(f"Report: {folder / 'report.html'}")


def _with_preset(name: str | None, options: dict[str, Any]) -> dict[str, Any]:
    from tissuq.studies.coverage import preset

    given = {key: value for key, value in options.items() if value is not None}
    return dict(preset(name)) | given if name else given


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
