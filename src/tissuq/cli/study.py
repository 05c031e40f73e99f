"""``tissuq study``: campaigns over many data sets; ``tissuq paper``: the study of the paper."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from tissuq.cli.call import Call, Campaign, Written, check_folder, not_converged, write_campaign_recipe
from tissuq.cli.command import Command, command, settings_of
from tissuq.errors import InputError
from tissuq.studies.campaign_settings import (
    CoverageOptions,
    PaperOptions,
    SbcOptions,
    StructureStudyOptions,
    TissueOptions,
)
from tissuq.studies.option import option
from tissuq.studies.option_texts import range_of

if TYPE_CHECKING:
    from tissuq.report.result import Result
    from tissuq.studies.stream import Campaign as CampaignOfTasks

study = typer.Typer(name="study", no_args_is_help=True, rich_markup_mode=None, help="Campaigns over many data sets.")


class CoverageRunning(Campaign):
    """How a campaign of coverage is carried out."""

    preset: str | None = option(
        None,
        "Instead: paper, panel, random-materials, further-families, small-strains, strength, formulations, transfer, "
        "rivals, or sbc.",
    )


@study.callback()
def _study() -> None:
    """Campaigns over many data sets."""


@study.command("coverage", cls=Command)
@command(CoverageOptions, CoverageRunning, "tissuq.validation.coverage:CoverageSettings")
def coverage(call: Call[CoverageOptions, CoverageRunning]) -> None:
    """Count how often intervals contain the true value; the same command resumes a stopped campaign."""
    from tissuq.report.coverage import coverage_result
    from tissuq.validation.coverage import PRESETS, preset, run_campaign

    name = call.how.preset
    if name == "sbc" and call.config is None:
        _calibrate(replace(call, kind=settings_of("sbc")))  # type: ignore[arg-type]
        return
    if (call.config is None) == (name is None):
        raise InputError(f"give --config FILE.toml, or --preset with one of {', '.join(PRESETS)}, sbc.")
    of_preset: dict[str, Any] = preset(name) if name else {}
    folder = call.how.out or Path("runs") / f"coverage-{name or (call.config or Path()).stem}"
    _carry_out(replace(call, stated=of_preset | call.stated), folder, run_campaign, coverage_result)


@study.command("sbc", cls=Command)
@command(SbcOptions, Campaign, "tissuq.validation.sbc:SbcSettings")
def sbc(call: Call[SbcOptions, Campaign]) -> None:
    """Check by simulation that posteriors are what priors and data make them (simulation-based calibration)."""
    _calibrate(call)


def _calibrate(call: Call[Any, Any]) -> None:
    """Carry out simulation-based calibration."""
    from tissuq.report.sbc import sbc_result
    from tissuq.validation.sbc import run_sbc

    material = call.stated.get("material")
    _carry_out(call, _folder(call, f"sbc-{material}" if material else "sbc"), run_sbc, sbc_result)


@study.command("tissues", cls=Command)
@command(TissueOptions, Campaign, "tissuq.validation.tissues:TissueSettings")
def tissues(call: Call[TissueOptions, Campaign]) -> None:
    """Predict real tests from others, and count how often bands hold; the same command resumes a stopped benchmark."""
    from tissuq.report.tissues import tissue_result
    from tissuq.validation.tissues import run_benchmark

    _carry_out(call, _folder(call, "tissues"), run_benchmark, tissue_result)


@study.command("structures", cls=Command)
@command(StructureStudyOptions, Campaign, "tissuq.validation.structures:StructureStudySettings")
def structures(call: Call[StructureStudyOptions, Campaign]) -> None:
    """Predict forces of structures from simple tests of a known law, and count how often bands hold; resumable."""
    from tissuq.report.structures import structures_result
    from tissuq.validation.structures import run_structures

    _carry_out(call, _folder(call, "structures"), run_structures, structures_result)


def _folder(call: Call[Any, Any], name: str) -> Path:
    """Return the folder of a campaign: that which is named, or one called as its configuration, or else ``name``."""
    return call.how.out or Path("runs") / (call.config.stem if call.config else name)


def _carry_out(
    call: Call[Any, Any],
    folder: Path,
    run: CampaignOfTasks[Any],
    result_of: Callable[[Any, list[dict[str, Any]]], Result],
) -> None:
    """Carry out a campaign in its folder, and put its result there; nothing is written before its workers are there."""
    from tissuq.studies.stream import open_pool

    settings = call.settings
    total = len(run.tasks_of(settings))
    check_folder(folder, settings)
    with open_pool(call.how.workers, call.how.scheduler) as pool, call.campaign_in(folder)(total) as step:
        write_campaign_recipe(folder, settings)
        results = run(settings, folder, pool=pool, step=step)
    call.put_into(folder, result_of(settings, results))


class PaperRunning(Written):
    """How the study is written."""

    stretch_range: tuple[float, float] | None = option(
        None, "Stretches LOW:HIGH [0.5:4.25].", takes=str, parse=range_of("--stretch-range", "0.5:4.25")
    )


@command(PaperOptions, PaperRunning, "tissuq.validation.paper:PaperSettings", out="Folder for the run [runs/paper].")
def paper(call: Call[PaperOptions, PaperRunning]) -> None:
    """Carry out the study of Zeraatpisheh, Bordas & Beex (2021) and check its claims."""
    from tissuq.report.paper import paper_result
    from tissuq.validation.paper import run_paper
    from tissuq.validation.paper.study import steps_of

    low, high = call.how.stretch_range or (None, None)
    settings: Any = call.loaded(stretch_low=low, stretch_high=high)
    target = call.target(Path("runs/paper"))
    study = call.carried_out(target, lambda step: run_paper(settings, step), paper_result, steps_of(settings))
    not_converged(study.not_converged)
