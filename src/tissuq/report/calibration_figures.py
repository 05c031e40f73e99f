"""The figures of a calibration: bands over the measurements, the check of the emulator, marginal posteriors."""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.drawing import pieces
from tissuq.drawing.panels import legend_above
from tissuq.drawing.style import ANSWER_WIDTH, BAND, BASE, INK, new_figure
from tissuq.emulation import Calibration
from tissuq.studies.calibration import CalibrationStudy, Measured

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

EXACT = "#D55E00"
MAX_COLUMNS = 3
"""Panels in a row of the figure of marginals."""


def band_figure(calibration: Calibration, data: Mapping[str, Measured], *, is_narrow: bool = False) -> Figure:
    """Return the 95 % predictive band over the measurements: with the discrepancy, and of the forward model alone.

    Where it is to be narrow, without the latter. Every quantity has a row of panels.
    """
    titles = {True: "with the discrepancy", False: "forward model alone"}
    if not calibration.problem.discrepancy.is_correlated:
        titles = {True: "forward model"}
    elif is_narrow:
        titles = {True: titles[True]}
    bands = {kind: calibration.predict(discrepancy=kind) for kind in titles}
    width, height = ANSWER_WIDTH if is_narrow else 4.6 * len(titles) + 0.8, 0.6 + 3.3 * len(data)
    with new_figure(width, height) as figure:
        panels = figure.subplots(len(data), len(titles), squeeze=False, sharey="row")
        for row, (name, measured) in zip(panels, data.items(), strict=True):
            rows = slice(*calibration.problem.quantities[name])
            order = np.argsort(measured.control, kind="stable")
            for axis, (kind, title) in zip(row, titles.items(), strict=True):
                band = bands[kind].iloc[rows].iloc[order]
                pieces.band(axis, band["control"], band["low"], band["high"], label="95 % predictive band")
                pieces.line(axis, band["control"], band["mean"], label="predicted mean")
                pieces.points(axis, measured.control, measured.measured)
                inside = band["low"].le(measured.measured[order]) & band["high"].ge(measured.measured[order])
                axis.set_title(f"{title}:  {100 * inside.mean():.0f} % inside")
                axis.set_xlabel(measured.control_label)
            row[0].set_ylabel(measured.measured_label)
        panels[0, 0].legend(fontsize=9)
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


def marginals_figure(study: CalibrationStudy) -> Figure:
    """Return the marginal posterior of every parameter with its prior, and as if the emulator were exact."""
    calibration, symbols = study.calibration, study.calibration.problem.symbols
    columns = min(MAX_COLUMNS, len(symbols))
    rows = ceil(len(symbols) / columns)
    with new_figure(3.6 * columns + 0.6, 2.7 * rows + 0.7) as figure:
        panels = figure.subplots(rows, columns, squeeze=False).ravel()
        for axis, symbol in zip(panels, symbols, strict=False):
            _draw_marginal(axis, calibration, symbol)
            axis.set_title(study.label(symbol))
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
    axis.set_yticks([])
    axis.spines["left"].set_visible(False)
    axis.locator_params(axis="x", nbins=5)
