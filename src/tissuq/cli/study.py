"""``tissuq study``: campaigns."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from tissuq.cli.options import load_settings, progress
from tissuq.errors import InputError

__all__ = ["study"]

study = typer.Typer(name="study", no_args_is_help=True, rich_markup_mode=None, help="Campaigns over many data sets.")


@study.callback()
def _study() -> None:
    """Campaigns over many data sets."""


@study.command("coverage")
def coverage(
    config: Annotated[Path | None, typer.Option(help="TOML file of the campaign.")] = None,
    preset: Annotated[str | None, typer.Option(help="Instead: designs, formulations, strength or rivals.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the campaign [runs/coverage-NAME].")] = None,
    replicates: Annotated[int | None, typer.Option(help="Data sets of every family.")] = None,
    noise: Annotated[str | None, typer.Option(help="known or unknown.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of materials and noise.")] = None,
    workers: Annotated[int, typer.Option(min=1, help="Processes on this machine.")] = 1,
    scheduler: Annotated[str | None, typer.Option(help="Address of a Dask scheduler to use instead.")] = None,
) -> None:
    """Count how often intervals hold the truth; the same command goes on with a campaign that was stopped."""
    from tissuq.cli.tables import print_rows
    from tissuq.report.coverage import COLUMNS, readable_coverage, write_campaign
    from tissuq.studies.coverage import PRESETS, CoverageSettings, run_campaign
    from tissuq.studies.coverage.campaign import tasks_of

    if (config is None) == (preset is None):
        raise InputError(f"give --config FILE.toml, or --preset with one of {', '.join(PRESETS)}.")
    options: dict[str, Any] = {"replicates": replicates, "noise": noise, "seed": seed}
    settings = load_settings(CoverageSettings, config, _with_preset(preset, options))
    folder = out or Path("runs") / f"coverage-{preset or (config or Path()).stem}"
    _check_folder(folder, settings)
    with progress(len(tasks_of(settings))) as step:
        results = run_campaign(settings, folder, workers=workers, scheduler=scheduler, step=step)
    summary = write_campaign(settings, results, folder)
    print_rows("Coverage of C10", COLUMNS, readable_coverage(summary))
    print(f"± are Monte Carlo standard errors. Report: {folder / 'report.html'}")


def _with_preset(name: str | None, options: dict[str, Any]) -> dict[str, Any]:
    from tissuq.studies.coverage import preset

    given = {key: value for key, value in options.items() if value is not None}
    return dict(preset(name)) | given if name else given


def _check_folder(folder: Path, settings: Any) -> None:
    """Make the folder of a campaign, or find that of the same one; refuse any other."""
    import tomli_w

    from tissuq.report.run_folder import RECIPE

    recipe = folder / RECIPE
    text = tomli_w.dumps(settings.model_dump(mode="json"))
    if not folder.exists() or not any(folder.iterdir()):
        folder.mkdir(parents=True, exist_ok=True)
        recipe.write_text(text, encoding="utf-8")
    elif not recipe.exists():
        raise InputError(f"'{folder}' is not the folder of a campaign; choose another with --out.")
    elif recipe.read_text(encoding="utf-8") != text:
        raise InputError(f"'{folder}' holds a campaign with other settings; choose another folder with --out.")
