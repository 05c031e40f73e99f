"""``tissuq calibrate``: parameters of an expensive forward model."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from tissuq.cli.call import Call, not_converged
from tissuq.cli.command import command
from tissuq.cli.named_again import check_named_again
from tissuq.cli.running import Written
from tissuq.errors import InputError
from tissuq.studies.calibration_settings import CalibrationSettings
from tissuq.studies.option import option

__all__ = ["calibrate"]


class CalibrateOptions(Written):
    """How the model is run."""

    workers: int = option(1, "Processes that run the model.", ge=1)
    max_jobs: int | None = option(
        None, "With --model: runs of the solver at a time, as many as licences [one a core].", ge=1
    )
    timeout: float | None = option(None, "With --model: seconds after which a run is stopped [never].", unit="s", ge=0)
    retries: int = option(0, "With --model: times that a failed run is made again, as for a licence.", ge=0)
    keep: bool = option(False, "With --model: keep the solver's files of every run.")
    abaqus: str = option("", "With --model: program that opens .odb files, as its 'python' [first word of --command].")
    runs_in: Path | None = option(
        None, "Folder of the runs of the model, which a repeated command reuses [OUT-forward-runs]."
    )


@command(CalibrationSettings, CalibrateOptions)
def calibrate(call: Call[CalibrationSettings, CalibrateOptions]) -> None:
    """Identify the parameters of an expensive model, using an emulator whose error is included."""
    from tissuq.report.calibration import calibration_result
    from tissuq.studies.calibration import run_calibration

    call.check_source("files", "a FILE of controls and measured values", "run")
    if not (call.config or "priors" in call.stated or "prior_run" in call.stated):
        raise InputError("give the --prior of every parameter of the model, as in C10=uniform(0.1, 5), or --prior-run.")
    settings = call.loaded(rivals=("forward", "umbridge"))
    _check_named_again(call, settings)
    target = call.target(Path("runs") / Path(settings.files[0]).stem)
    runs_in = call.how.runs_in or target.with_name(f"{target.name}-forward-runs")
    how, running = call.how, dict[str, Any]()
    workers = how.workers
    if settings.models:
        workers = how.max_jobs or os.cpu_count() or 1
        running = {"timeout": how.timeout, "retries": how.retries, "keep": how.keep, "abaqus": how.abaqus}
    with call.campaign_in(runs_in)(settings.runs + settings.refine) as step:
        study = run_calibration(settings, call.beside, runs_in=runs_in, workers=workers, step=step, **running)
    print(f"Forward runs: {runs_in}")
    call.carried_out(target, lambda step: study, lambda study: calibration_result(study, call.beside))
    not_converged([] if study.calibration.converged else ["the calibration"])


def _check_named_again(call: Call[CalibrationSettings, CalibrateOptions], settings: CalibrationSettings) -> None:
    """Refuse to run code, or to ask a server, that a recipe names and the command line does not."""
    if settings.forward and "forward" not in call.stated:
        raise InputError(
            f"{call.config} names the forward model '{settings.forward}', whose code runs only if you name it: add "
            f"--forward {settings.forward}"
        )
    if settings.umbridge and "umbridge" not in call.stated:
        raise InputError(
            f"{call.config} names the UM-Bridge server {settings.umbridge}, which is asked only when you name it: add "
            f"--umbridge {settings.umbridge}"
        )
    if call.config and settings.models:
        check_named_again(call.config, settings, call.stated, {"quantities": "--qoi", "along": "--along"})
