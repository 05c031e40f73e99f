"""``tissuq predict``: the stress in a loading mode from an earlier fit, beside measurements of it."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from tissuq.cli import reading
from tissuq.cli.options import (
    Config,
    Figures,
    Force,
    RunDiscrepancy,
    RunFolder,
    RunMaterial,
    not_converged,
    own_law,
    progress,
)
from tissuq.errors import InputError
from tissuq.studies.settings import load_settings

__all__ = ["predict"]


@partial(reading.reads_files, names={"stress_type": "data_stress_type"})
def predict(
    run: RunFolder = None,
    mode: Annotated[
        str | None, typer.Option(help="Loading mode to predict [that of the data, or of the run]; see tissuq modes.")
    ] = None,
    stretch: Annotated[
        str | None,
        typer.Option(help="Stretches (amounts of shear): a range 0.7:2.0, or a list 1.1,1.2,1.5 [where calibrated]."),
    ] = None,
    stretch2: Annotated[
        str | None,
        typer.Option(help="Of the second control of a mode with two, such as biaxial; one number where it is held."),
    ] = None,
    points: Annotated[int | None, typer.Option(help="Stretches in a range [101].")] = None,
    discrepancy: RunDiscrepancy = None,
    prob: Annotated[float | None, typer.Option(help="Probability of the bands [0.95].")] = None,
    stress_type: Annotated[str | None, typer.Option(help="Predict engineering or cauchy stress [engineering].")] = None,
    material: RunMaterial = None,
    data: Annotated[
        Path | None,
        typer.Option(
            help="Measurements of that mode to compare with: a file or a built-in data set. The options below, and "
            "--data-stress-type, say how to read it."
        ),
    ] = None,
    *,
    read_as: dict[str, Any],
    out: Annotated[Path | None, typer.Option(help="Folder for the prediction [RUN-MODE, beside the run].")] = None,
    config: Config = None,
    figures: Figures = True,
    force: Force = False,
) -> None:
    """Predict the stress in any loading mode from a fit, and compare it with measurements."""
    from tissuq.cli.tables import print_rows, print_warnings
    from tissuq.report.prediction import (
        band_headers,
        readable_bands,
        readable_scores,
        score_headers,
        write_prediction_run,
    )
    from tissuq.report.run_folder import check_apart, check_target, run_folder
    from tissuq.studies.prediction_settings import PredictionSettings, run_prediction

    if bool(run) == bool(config):
        raise InputError("give the RUN folder of a fit, or --config run.toml of an earlier prediction.")
    stated = {name: value for name, value in read_as.items() if value is not None}
    if stated and not (data or config):
        raise InputError(f"{', '.join(stated)} can only be used with --data FILE.")
    file = {"file": str(reading.resolve(data))} if data else {}
    options: dict[str, Any] = {
        "run": str(run) if run else None, "mode": mode, "stretch": stretch, "stretch2": stretch2, "points": points,
        "discrepancy": discrepancy, "prob": prob, "stress_type": stress_type, "data": file | stated or None,
    }  # fmt: skip
    settings = load_settings(PredictionSettings, config, options)
    beside = config.parent if config else Path()
    law = own_law(material)
    source = beside / settings.run
    named = source if source.name.strip(".") else source.resolve()  # "." and ".." have no name of their own
    target = out or named.parent / f"{named.name}-{settings.mode_in(beside)}"
    check_apart(target, source)
    check_target(target, force=force)
    with progress() as step:
        prediction = run_prediction(settings, beside, step, law)
        step("writing")
        with run_folder(target, force=force) as folder:
            write_prediction_run(prediction, settings, folder, target, beside, law=material, figures=figures)
    print_rows(
        f"Stress in mode {prediction.mode.name}, {prediction.unit.name}",
        band_headers(prediction),
        readable_bands(prediction),
    )
    if prediction.scores is not None and prediction.data is not None:
        print_rows(f"Measurements of {prediction.data.name}", score_headers(prediction), readable_scores(prediction))
    print_warnings(prediction.warnings)
    print(f"Report: {target / 'report.html'}")
    not_converged(["the fit"] if prediction.posterior.solution.is_approximate else [])
