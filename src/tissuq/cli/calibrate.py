"""``tissuq calibrate``: parameters of an expensive forward model."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from tissuq.cli.call import Call, not_converged
from tissuq.cli.command import command
from tissuq.cli.running import SolverOptions, Written
from tissuq.errors import InputError
from tissuq.studies.calibration_settings import CalibrationSettings
from tissuq.studies.option import option

__all__ = ["calibrate"]


class CalibrateOptions(SolverOptions, Written):
    """How the model is run."""

    workers: int = option(1, "Processes that run the model.", ge=1)
    keep: bool = option(False, "Keep the solver's files of every run.")
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
    call.check_named_again(settings)
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
