"""``tissuq predict``: the stress in any loading mode, from a fit."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from tissuq.cli.call import Call, not_converged
from tissuq.cli.command import command
from tissuq.cli.running import OfRun
from tissuq.errors import InputError
from tissuq.studies.files_of_tests import resolve
from tissuq.studies.option import option
from tissuq.studies.prediction_settings import PredictionSettings

__all__ = ["predict"]


class PredictOptions(OfRun):
    """How a prediction is written."""

    out: Path | None = option(None, "Folder for the prediction [RUN-MODE, beside the run].")


@command(PredictionSettings, PredictOptions)
def predict(call: Call[PredictionSettings, PredictOptions]) -> None:
    """Predict the stress in any loading mode from a fit, and compare it with measurements."""
    from tissuq.report.prediction import prediction_result
    from tissuq.studies.predict_run import run_prediction

    call.check_source("run", "the RUN folder of a fit", "prediction")
    data = call.stated.get("data", {})
    if data and not ("file" in data or call.config):
        raise InputError(f"{', '.join(data)} can only be used with --data FILE.")
    if "file" in data:
        data["file"] = str(resolve(data["file"]))
    settings, beside, law = call.settings, call.beside, call.law
    source = beside / settings.run
    named = source if source.name.strip(".") else source.resolve()  # "." and ".." have no name of their own
    target = call.target(named.parent / f"{named.name}-{settings.mode_in(beside, law)}", apart_from=source)
    prediction = call.carried_out(
        target,
        lambda step: run_prediction(settings, beside, step, law),
        partial(prediction_result, settings=settings, target=target, beside=beside, law=call.how.user_law),
    )
    not_converged(["the fit"] if prediction.posterior.solution.is_approximate else [])
