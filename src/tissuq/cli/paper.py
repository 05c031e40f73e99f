"""``tissuq paper``: the study of the paper."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from tissuq.cli.options import not_converged, once_each, parse_prior, progress
from tissuq.studies.settings import load_settings

__all__ = ["paper"]


def paper(
    out: Annotated[Path, typer.Option(help="Folder for the run.")] = Path("runs/paper"),
    config: Annotated[Path | None, typer.Option(help="run.toml of an earlier run to repeat.")] = None,
    points: Annotated[int | None, typer.Option(help="Number of measurements [30].")] = None,
    stretch_range: Annotated[str | None, typer.Option(help="Stretches LOW:HIGH [0.5:4.25].")] = None,
    noise_sd: Annotated[
        float | None,
        typer.Option(help="Standard deviation of the noise, MPa [0.5]; 0.7071 if 0.5 is a variance."),
    ] = None,
    prior: Annotated[
        list[str] | None, typer.Option(help="A prior in MPa, such as c=uniform(0,10); repeat for more.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of noise and draws [2021].")] = None,
    sampler: Annotated[str | None, typer.Option(help="exact, nuts or both [exact].")] = None,
    replicates: Annotated[int | None, typer.Option(help="Data sets over which every claim is checked [1].")] = None,
    figures: Annotated[bool, typer.Option(help="Draw the figures, too.")] = True,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing run folder.")] = False,
) -> None:
    """Carry out the study of Zeraatpisheh, Bordas & Beex (2021) and check its claims."""
    from tissuq.cli.tables import print_summary, print_warnings
    from tissuq.report.paper import write_paper_run
    from tissuq.report.run_folder import check_target, run_folder
    from tissuq.studies.paper import PaperSettings, run_paper
    from tissuq.studies.paper.study import steps_of

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
        with run_folder(out, force=force) as folder:
            write_paper_run(study, folder, figures=figures)
    print_summary(out)
    print_warnings(study.warnings)
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
