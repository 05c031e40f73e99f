"""The run folder of a calibration: measurements, tables, forward runs, draws, figures and the report."""

from __future__ import annotations

import shutil
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.drawing import pieces
from tissuq.drawing.panels import legend_above
from tissuq.drawing.style import BAND, BASE, INK, new_figure
from tissuq.emulation import Calibration, FileForward
from tissuq.mechanics.user_law import LAW
from tissuq.model.discrepancy import NoDiscrepancy
from tissuq.report.run_folder import INPUT, write_figures, write_page, write_recipe
from tissuq.report.tables import Row, interval, significant, write_csv, write_json
from tissuq.studies.calibration import CalibrationStudy, Measured
from tissuq.studies.earlier_run import POSTERIORS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "HEADERS",
    "band_figure",
    "check_figure",
    "marginals_figure",
    "readable_calibration",
    "write_calibration_run",
]

HEADERS = ["parameter", "mean", "sd", "95 % HPD", "ESS", "by emulator"]
"""Of `readable_calibration`."""


def write_calibration_run(
    study: CalibrationStudy, folder: Path, beside: Path = Path(), *, figures: bool = True
) -> None:
    """Write the results of a calibration into an empty folder.

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
    relocated = _copied(study, folder, beside)
    named = f" --forward {relocated['forward']}" if "forward" in relocated else f" --umbridge {study.settings.umbridge}"
    command = f"calibrate{'' if figures else ' --no-figures'}{named}"
    write_recipe(folder, command, study.settings.model_copy(update=relocated))
    _write_tables(study, folder)
    calibration.save(folder / "calibration.nc")
    if study.posterior is not None:
        (folder / POSTERIORS).mkdir()
        study.posterior.save(folder / POSTERIORS / f"{NoDiscrepancy.name}.nc")
    if figures:
        drawn = {
            "band": band_figure(calibration, study.data),
            "emulator": check_figure(calibration),
            "marginals": marginals_figure(calibration),
        }
        write_figures(folder, drawn)
    write_page(folder, "calibration.html", **_context(study), command=command)


def _copied(study: CalibrationStudy, folder: Path, beside: Path) -> dict[str, Any]:
    """Copy the user's files, so that the run can be repeated, and return the settings that name the copies."""
    source = beside / study.settings.file
    shutil.copyfile(source, folder / INPUT / source.name)
    relocated: dict[str, Any] = {"file": f"{INPUT}/{source.name}"}
    if study.settings.forward is None:
        return relocated
    match, file = LAW.fullmatch(study.settings.forward), FileForward(study.settings.forward).file
    if match and file:
        shutil.copyfile(file, folder / INPUT / file.name)
        return relocated | {"forward": f"{INPUT}/{file.name}:{match['name']}"}
    return relocated | {"forward": study.settings.forward}


def _write_tables(study: CalibrationStudy, folder: Path) -> None:
    calibration, data = study.calibration, study.data
    summary = calibration.summary()
    rows: list[Row] = [
        {"parameter": str(symbol), "prior": str(calibration.problem.priors[str(symbol)])}
        | {str(name): None if np.isnan(value) else float(value) for name, value in estimates.items()}
        for symbol, estimates in summary.iterrows()
    ]
    write_csv(folder / "summary.csv", rows)
    write_json(folder / "summary.json", rows)
    bands = {name: calibration.predict(discrepancy=kind) for name, kind in (("", True), ("_model_alone", False))}
    table: dict[str, Any] = {"control": data.control, "measured": data.measured}
    for suffix, band in bands.items():
        table |= {f"{name}{suffix}": band[name].to_numpy() for name in ("mean", "low", "high")}
    write_csv(folder / "prediction.csv", _rows(table))
    left_out, sensitivity = calibration.leave_one_out, calibration.sensitivity.reset_index()
    for name, frame in (("leave_one_out", left_out), ("sensitivity", sensitivity)):
        write_csv(
            folder / f"{name}.csv",
            [dict(zip(frame.columns, row, strict=True)) for row in frame.itertuples(index=False)],
        )
    runs = calibration.runs
    parameters = dict(zip(runs.symbols, runs.points.T, strict=True))
    outputs = {f"output_{number}": column for number, column in enumerate(runs.outputs.T, 1)}
    write_csv(folder / "forward_runs.csv", [
        {**row, "error": error}
        for row, error in zip(_rows(parameters | {"seconds": runs.seconds} | outputs), runs.errors, strict=True)
    ])  # fmt: skip


WORST_RUNS = 8
"""Rows of the page's table of runs that were left out."""


def _worst_runs(calibration: Calibration) -> list[list[str]]:
    """Return the worst rows of `Calibration.leave_one_out` as text."""
    return [
        [*(f"{value:.4g}" for value in row[:-3]), f"{row[-3]:.2g}", f"{row[-2]:.2g}", f"{row[-1]:.1f}"]
        for row in calibration.leave_one_out.to_numpy()[:WORST_RUNS]
    ]


def _rows(columns: dict[str, Any]) -> list[Row]:
    """Return columns as rows; nothing for nan."""
    lists = [[None if np.isnan(value) else float(value) for value in column] for column in columns.values()]
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


def _context(study: CalibrationStudy) -> dict[str, Any]:
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
        "left_out": _worst_runs(calibration),
        "sensitivity": [
            [str(symbol), f"{100 * first:.0f} %", f"{100 * total:.0f} %"]
            for symbol, first, total in calibration.sensitivity.itertuples()
        ],
        "material": "" if study.posterior is None else study.posterior.model.material.name,
        "runs": len(runs),
        "seconds_a_run": significant(float(np.median(runs.seconds))),
        "seconds": f"{study.seconds:.0f}",
        "directions": emulator.basis.directions.shape[1],
        "is_log": emulator.basis.is_log,
        "logarithms": emulator.logarithms,
        "ratio": f"{calibration.error_ratio:.2g}",
        "failures": failures,
        "failure_summary": runs.failure_summary,
        "symbols": list(runs.symbols),
        "priors": [[symbol, str(prior)] for symbol, prior in calibration.problem.priors.items()],
        "verdict": calibration.posterior.verdict,
        "method": calibration.posterior.method,
        "evidence": "" if calibration.log_evidence is None else f"{calibration.log_evidence:.2f}",
    }


def _lead(study: CalibrationStudy) -> str:
    """Return the finding in two sentences."""
    calibration = study.calibration
    findings = []
    for symbol in calibration.problem.forward_symbols:
        marginal = calibration.marginals[symbol]
        low, high = interval(*marginal.hdi(), marginal.sd)
        findings.append(f"{symbol} is {low} to {high}")
    share = max(calibration.emulator_share[symbol] for symbol in calibration.problem.forward_symbols)
    size = "less than 1 %" if share < 0.01 else f"at most {100 * share:.0f} %"
    return (
        f"With a probability of 95 % each, {', and '.join(findings)}, in the units of the forward model. The error of "
        f"the emulator contributes {size} to their variance."
    )


EXACT = "#D55E00"
MAX_COLUMNS = 3
"""Panels in a row of the figure of marginals."""


def band_figure(calibration: Calibration, data: Measured) -> Figure:
    """Return the 95 % predictive band over the measurements: with the discrepancy, and of the forward model alone."""
    titles = {True: "with the discrepancy", False: "forward model alone"}
    if not calibration.problem.discrepancy.is_correlated:
        titles = {True: "forward model"}
    with new_figure(4.6 * len(titles) + 0.8, 3.9) as figure:
        panels = figure.subplots(1, len(titles), squeeze=False, sharey=True)[0]
        order = np.argsort(data.control, kind="stable")
        for axis, (with_discrepancy, title) in zip(panels, titles.items(), strict=True):
            band = calibration.predict(discrepancy=with_discrepancy).iloc[order]
            pieces.band(axis, band["control"], band["low"], band["high"], label="95 % predictive band")
            pieces.line(axis, band["control"], band["mean"], label="predicted mean")
            pieces.points(axis, data.control, data.measured)
            axis.set_title(f"{title}:  {calibration.predictive_coverage(discrepancy=with_discrepancy):.0%} inside")
            axis.set_xlabel(data.control_label)
        panels[0].set_ylabel(data.measured_label)
        panels[0].legend(fontsize=9)
    return figure


def check_figure(calibration: Calibration) -> Figure:
    """Return the validation of the emulator: every run predicted from the others, and new runs."""
    trials = [(calibration.check, BAND, "o", "left out")]
    trials += [(trial, EXACT, "s", "" if index else "in the posterior, before refinement")
               for index, trial in enumerate(calibration.held_out)]  # fmt: skip
    with new_figure(10.0, 3.9) as figure:
        error_axis, standardised_axis = figure.subplots(1, 2)
        for check, color, mark, label in trials:
            computed, error = check.computed.ravel(), (check.predicted - check.computed).ravel()
            size = np.abs(check.computed).max()
            bars: dict[str, Any] = {"yerr": 1.96 * check.sd.ravel() / size, "ecolor": color, "elinewidth": 0.5}
            error_axis.errorbar(computed, error / size, fmt=mark, ms=2.6, color=color, alpha=0.6, label=label, **bars)
            standardised_axis.plot(computed, check.standardised.ravel(), mark, ms=2.6, color=color, alpha=0.6)
        error_axis.axhline(0, color=INK, lw=0.8)
        error_axis.set_title("Emulator minus model, over the largest output")
        for end in (-1.96, 1.96):
            standardised_axis.axhline(end, color=BASE, lw=1, ls="--")
        standardised_axis.set_title("The same in standard deviations (dashed: 95 %)")
        for axis in (error_axis, standardised_axis):
            axis.set_xlabel("output of the model")
        error_axis.legend(fontsize=9)
    return figure


def marginals_figure(calibration: Calibration) -> Figure:
    """Return the marginal posterior of every parameter with its prior, and as if the emulator were exact."""
    symbols = calibration.problem.symbols
    columns = min(MAX_COLUMNS, len(symbols))
    rows = ceil(len(symbols) / columns)
    with new_figure(3.6 * columns + 0.6, 2.7 * rows + 0.7) as figure:
        panels = figure.subplots(rows, columns, squeeze=False).ravel()
        for axis, symbol in zip(panels, symbols, strict=False):
            _draw_marginal(axis, calibration, symbol)
        for spare in panels[len(symbols) :]:
            spare.set_visible(False)
        legend_above(figure, panels[:1])
    return figure


def _draw_marginal(axis: Axes, calibration: Calibration, symbol: str) -> None:
    posterior, exact = calibration.marginals[symbol], calibration.without_emulator_error.marginals[symbol]
    ends = np.array([marginal.quantile([0.001, 0.999]) for marginal in (posterior, exact)])
    values = np.linspace(ends[:, 0].min(), ends[:, 1].max(), 500)
    pieces.density(axis, values, posterior.pdf(values), label="posterior")
    axis.plot(values, exact.pdf(values), color=EXACT, lw=1.2, ls="--", label="as if the emulator were exact")
    low, high = calibration.problem.priors[symbol].support
    inside = (values > low) & (values < high)
    prior = np.exp(calibration.problem.priors[symbol].log_density(values[inside]))
    axis.plot(values[inside], prior, ":", color=BASE, lw=1.4, label="prior")
    axis.plot(posterior.hdi(), [0, 0], color=BAND, lw=4, solid_capstyle="butt")
    top = max(posterior.density.max(), float(exact.pdf(values).max()))
    axis.set_ylim(-0.02 * top, min(1.08 * top, 4 * float(posterior.density.max())))
    axis.set_title(symbol)
    axis.set_yticks([])
    axis.spines["left"].set_visible(False)
    axis.locator_params(axis="x", nbins=5)
