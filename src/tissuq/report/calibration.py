"""The run folder of a calibration: measurements, tables, forward runs, draws, figures and the report."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np

from tissuq.emulation import Calibration, FileForward
from tissuq.mechanics.user_law import LAW
from tissuq.report.calibration_figures import band_figure, check_figure, marginals_figure
from tissuq.report.common import write_figures, write_recipe
from tissuq.report.page import embedded_figure, render
from tissuq.report.rows import interval, significant
from tissuq.report.run_folder import INPUT, RECIPE
from tissuq.report.tables import Row, write_csv, write_json
from tissuq.studies.calibration import CalibrationStudy

__all__ = ["HEADERS", "readable_calibration", "write_calibration_run"]

HEADERS = ["parameter", "mean", "sd", "95 % HPD", "ESS", "by emulator"]
"""Of `readable_calibration`."""


def write_calibration_run(
    study: CalibrationStudy, folder: Path, beside: Path = Path(), *, figures: bool = True
) -> None:
    """Write everything that a calibration leaves behind into an empty folder.

    Parameters
    ----------
    study : CalibrationStudy
    folder : Path
        Exists and is empty.
    beside : Path
        Where the file of the settings lies, unless it is absolute.
    figures : bool
        Draw them, too.
    """
    calibration = study.calibration
    (folder / INPUT).mkdir()
    kept = _copied(study, folder, beside)
    named = f" --forward {kept['forward']}" if "forward" in kept else ""
    command = f"calibrate{'' if figures else ' --no-figures'}{named}"
    write_recipe(folder, command, study.settings.model_copy(update=kept))
    _write_tables(study, folder)
    calibration.save(folder / "calibration.nc")
    if figures:
        drawn = {
            "band": band_figure(calibration, study.data),
            "emulator": check_figure(calibration),
            "marginals": marginals_figure(calibration),
        }
        write_figures(folder, drawn)
    page = render("calibration.html", **_context(study, folder), command=command)
    (folder / "report.html").write_text(page, encoding="utf-8")


def _copied(study: CalibrationStudy, folder: Path, beside: Path) -> dict[str, Any]:
    """Copy the user's files, so that the run can be repeated, and return what names them there."""
    source = beside / study.settings.file
    shutil.copyfile(source, folder / INPUT / source.name)
    kept: dict[str, Any] = {"file": f"{INPUT}/{source.name}"}
    if study.settings.forward is None:
        return kept
    match, file = LAW.fullmatch(study.settings.forward), FileForward(study.settings.forward).file
    if match and file:
        shutil.copyfile(file, folder / INPUT / file.name)
        return kept | {"forward": f"{INPUT}/{file.name}:{match['name']}"}
    return kept | {"forward": study.settings.forward}


def _write_tables(study: CalibrationStudy, folder: Path) -> None:
    calibration, data = study.calibration, study.data
    summary = calibration.summary()
    rows: list[Row] = [
        {"parameter": str(symbol), "prior": str(calibration.problem.priors[str(symbol)])}
        | {str(name): None if np.isnan(value) else float(value) for name, value in own.items()}
        for symbol, own in summary.iterrows()
    ]
    write_csv(folder / "summary.csv", rows)
    write_json(folder / "summary.json", rows)
    bands = {name: calibration.predict(discrepancy=own) for name, own in (("", True), ("_model_alone", False))}
    table: dict[str, Any] = {"control": data.control, "measured": data.measured}
    for suffix, band in bands.items():
        table |= {f"{name}{suffix}": band[name].to_numpy() for name in ("mean", "low", "high")}
    write_csv(folder / "prediction.csv", _rows(table))
    runs = calibration.runs
    own = dict(zip(runs.symbols, runs.points.T, strict=True))
    outputs = {f"output_{place + 1}": column for place, column in enumerate(runs.outputs.T)}
    write_csv(folder / "forward_runs.csv", [
        {**row, "error": error}
        for row, error in zip(_rows(own | {"seconds": runs.seconds} | outputs), runs.errors, strict=True)
    ])  # fmt: skip


def _rows(columns: dict[str, Any]) -> list[Row]:
    """Return columns as rows; nothing for nan."""
    lists = [[None if np.isnan(each) else float(each) for each in column] for column in columns.values()]
    return [dict(zip(columns, row, strict=True)) for row in zip(*lists, strict=True)]


def readable_calibration(calibration: Calibration) -> list[list[str]]:
    """Return the rows of the summary as text, under `HEADERS`, in the units of the forward model."""
    rows = []
    for symbol, marginal in calibration.marginals.items():
        low, high = marginal.hdi()
        mean, sd = interval(marginal.mean, marginal.sd, marginal.sd)
        ends = "[{}, {}]".format(*interval(low, high, marginal.sd))
        share = calibration.emulator_share[symbol]
        rows.append([symbol, mean, sd, ends, f"{calibration.posterior.ess[symbol]:.0f}", f"{share:.0%}"])
    return rows


def _context(study: CalibrationStudy, folder: Path) -> dict[str, Any]:
    calibration = study.calibration
    runs, emulator = calibration.runs, calibration.emulator
    failures = [
        [*(significant(float(value), 4) for value in point), error]
        for point, error in zip(runs.points, runs.errors, strict=True)
        if error
    ]
    return {
        "settings": study.settings,
        "model": study.settings.forward_model.name,
        "lead": _lead(study),
        "warnings": study.warnings,
        "headers": HEADERS,
        "summary": readable_calibration(calibration),
        "inside": calibration.predictive_coverage(),
        "inside_alone": calibration.predictive_coverage(discrepancy=False),
        "has_discrepancy": calibration.problem.discrepancy.is_correlated,
        "measurements": len(study.data.control),
        "check": calibration.check,
        "held_out": calibration.held_out,
        "runs": len(runs),
        "seconds_a_run": significant(float(np.median(runs.seconds))),
        "seconds": f"{study.seconds:.0f}",
        "directions": emulator.basis.directions.shape[1],
        "is_log": emulator.basis.is_log,
        "logarithms": emulator.logarithms,
        "ratio": f"{calibration.error_ratio:.2g}",
        "failures": failures,
        "told_failures": runs.told_failures,
        "symbols": list(runs.symbols),
        "priors": [[symbol, str(prior)] for symbol, prior in calibration.problem.priors.items()],
        "verdict": calibration.posterior.verdict,
        "method": calibration.posterior.method,
        "evidence": "" if calibration.log_evidence is None else f"{calibration.log_evidence:.2f}",
        "recipe": (folder / RECIPE).read_text(encoding="utf-8"),
        "figures": {path.stem: embedded_figure(path) for path in sorted((folder / "figures").glob("*.svg"))},
    }


def _lead(study: CalibrationStudy) -> str:
    """Return the finding in two sentences."""
    calibration = study.calibration
    told = []
    for symbol in calibration.problem.forward_symbols:
        marginal = calibration.marginals[symbol]
        low, high = interval(*marginal.hdi(), marginal.sd)
        told.append(f"{symbol} is {low} to {high}")
    share = max(calibration.emulator_share[symbol] for symbol in calibration.problem.forward_symbols)
    size = "less than 1 %" if share < 0.01 else f"{100 * share:.0f} % at most"
    return (
        f"With a probability of 95 % each, {', and '.join(told)}, in the forward model's units. That an emulator "
        f"stands for the model makes {size} of their variance."
    )
