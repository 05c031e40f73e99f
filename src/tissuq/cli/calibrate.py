"""``tissuq calibrate``: parameters of an expensive forward model."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from tissuq.cli.options import Config, Figures, Force, Seed, campaign_progress, not_converged, once_each, parse_prior
from tissuq.errors import InputError
from tissuq.studies.settings import load_settings

__all__ = ["calibrate"]


def calibrate(
    file: Annotated[
        Path | None, typer.Argument(help="CSV or Excel file with a column of controls and one of measured values.")
    ] = None,
    forward: Annotated[
        str | None,
        typer.Option(help="Function of the model: file.py:function or package.module:function. Its code is run."),
    ] = None,
    umbridge: Annotated[
        str | None, typer.Option(help="Instead: address of an UM-Bridge server, such as http://localhost:4242.")
    ] = None,
    model: Annotated[str | None, typer.Option(help="Name of the model on that server [forward].")] = None,
    prior: Annotated[
        list[str] | None,
        typer.Option(help="Prior of a parameter in the model's units, such as C10=uniform(0.1,5); repeat for each."),
    ] = None,
    control: Annotated[str | None, typer.Option(help="Column of the control [the first of two].")] = None,
    measured: Annotated[str | None, typer.Option(help="Column of the measured values [the second of two].")] = None,
    discrepancy: Annotated[
        str | None, typer.Option(help="none, gp, or gp-pinned (zero with its slope at zero load) [none].")
    ] = None,
    noise_sd: Annotated[
        str | None, typer.Option(help="Sd of the noise, in the unit of the measured values, or unknown [unknown].")
    ] = None,
    zero_load: Annotated[float | None, typer.Option(help="Control at zero load [0].")] = None,
    runs: Annotated[int | None, typer.Option(help="Runs of the model over the priors [40].")] = None,
    refine: Annotated[
        int | None, typer.Option(help="Further runs at most, where the posterior is and the emulator unsure [0].")
    ] = None,
    design: Annotated[str | None, typer.Option(help="sobol or latin [sobol].")] = None,
    kernel: Annotated[str | None, typer.Option(help="squared-exponential or matern-5/2.")] = None,
    trend: Annotated[str | None, typer.Option(help="Mean: constant, linear or quadratic [linear].")] = None,
    method: Annotated[str | None, typer.Option(help="auto, importance or nuts [auto].")] = None,
    material: Annotated[
        str | None,
        typer.Option(help="Law in the model with all its parameters: predict, export and structure then take the run."),
    ] = None,
    stretches: Annotated[
        str | None, typer.Option("--range", help="With --material: smallest and largest stretch, such as 0.7:1.3.")
    ] = None,
    mode: Annotated[str | None, typer.Option(help="With --material: loading mode of the range [uniaxial].")] = None,
    unit: Annotated[str | None, typer.Option(help="With --material: the model's unit of stress [MPa].")] = None,
    every: Annotated[int | None, typer.Option(help="Use only every N-th row [1].")] = None,
    sheet: Annotated[str | None, typer.Option(help="Sheet of an Excel workbook, by name or number.")] = None,
    skip_rows: Annotated[int | None, typer.Option(help="Lines to skip at the top of the file.")] = None,
    seed: Seed = None,
    workers: Annotated[int, typer.Option(min=1, help="Processes that run the model.")] = 1,
    runs_in: Annotated[
        Path | None,
        typer.Option(help="Folder of the runs of the model, which a repeated command reuses [OUT-forward-runs]."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for the run [runs/NAME].")] = None,
    config: Config = None,
    figures: Figures = True,
    force: Force = False,
) -> None:
    """Identify the parameters of an expensive model, using an emulator whose error is included."""
    from tissuq.report.calibration import calibration_result
    from tissuq.report.run_folder import check_target, run_folder
    from tissuq.report.terminal import print_result
    from tissuq.report.writer import write_result
    from tissuq.studies.calibration import CalibrationSettings, run_calibration

    if bool(file) == bool(config):
        raise InputError("give a FILE of controls and measured values, or --config run.toml.")
    options: dict[str, Any] = {
        "file": str(file) if file else None, "forward": forward, "umbridge": umbridge, "model": model,
        "control": _column(control), "measured": _column(measured), "discrepancy": discrepancy,
        "noise_sd": _noise(noise_sd), "zero_load": zero_load, "runs": runs, "refine": refine, "design": design,
        "kernel": kernel, "trend": trend, "method": method, "material": material,
        "range": stretches, "mode": mode, "unit": unit, "every": every, "sheet": _column(sheet),
        "skip_rows": skip_rows, "seed": seed, "priors": once_each("--prior", map(parse_prior, prior or [])) or None,
    }  # fmt: skip
    if not (prior or config):
        raise InputError("give the --prior of every parameter of the model, as in C10=uniform(0.1, 5).")
    settings = load_settings(CalibrationSettings, config, options, rivals=("forward", "umbridge"))
    if settings.forward and not forward:
        raise InputError(
            f"{config} names the forward model '{settings.forward}', whose code runs only if you name it: add "
            f"--forward {settings.forward}"
        )
    if settings.umbridge and not umbridge:
        raise InputError(
            f"{config} names the UM-Bridge server {settings.umbridge}, which is asked only when you name it: add "
            f"--umbridge {settings.umbridge}"
        )
    beside = config.parent if config else Path()
    target = out or Path("runs") / Path(settings.file).stem
    check_target(target, force=force)
    runs_folder = runs_in or target.with_name(f"{target.name}-forward-runs")
    with campaign_progress(settings.runs + settings.refine) as step:
        study = run_calibration(settings, beside, runs_in=runs_folder, workers=workers, step=step)
    result = calibration_result(study, beside)
    with run_folder(target, force=force) as folder:
        write_result(result, folder, figures=figures)
    print(f"Forward runs: {runs_folder}")
    print_result(result.record(), target)
    not_converged([] if study.calibration.converged else ["the calibration"])


def _column(text: str | None) -> str | int | None:
    return int(text) if text is not None and text.isdecimal() else text


def _noise(text: str | None) -> float | str | None:
    if text is None or text == "unknown":
        return text
    try:
        return float(text)
    except ValueError as error:
        raise InputError(f"--noise-sd must be a number or unknown, not '{text}'.") from error
