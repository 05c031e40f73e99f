"""Figures of a calibration: predictions over the measurements, the emulator on trial, and marginal posteriors."""

from __future__ import annotations

from math import ceil
from typing import TYPE_CHECKING

import numpy as np

from tissuq.emulation import Calibration
from tissuq.report.figures import BAND, BASE, INK, STYLE
from tissuq.studies.calibration import Measured

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["band_figure", "check_figure", "marginals_figure"]

EXACT = "#D55E00"
COLUMNS = 3


def band_figure(calibration: Calibration, data: Measured) -> Figure:
    """Return the 95 % predictive band over the measurements: with the discrepancy, and of the forward model alone."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    titles = {True: "with the discrepancy", False: "forward model alone"}
    if not calibration.problem.discrepancy.is_correlated:
        titles = {True: "forward model"}
    with rc_context(STYLE):
        figure = Figure(figsize=(4.6 * len(titles) + 0.8, 3.9))
        panels = figure.subplots(1, len(titles), squeeze=False, sharey=True)[0]
        order = np.argsort(data.control, kind="stable")
        for axis, (own, title) in zip(panels, titles.items(), strict=True):
            band = calibration.predict(discrepancy=own).iloc[order]
            axis.fill_between(band["control"], band["low"], band["high"], color=BAND, alpha=0.22, lw=0,
                              label="95 % predictive band")  # fmt: skip
            axis.plot(band["control"], band["mean"], color=BAND, lw=1.6, label="predicted mean")
            axis.plot(data.control, data.measured, "o", color=INK, ms=3.2, label="measured")
            axis.set_title(f"{title}:  {calibration.predictive_coverage(discrepancy=own):.0%} inside")
            axis.set_xlabel(data.control_label)
        panels[0].set_ylabel(data.measured_label)
        panels[0].legend(fontsize=9)
    return figure


def check_figure(calibration: Calibration) -> Figure:
    """Return the emulator on trial: every run predicted from the others, and runs it had not seen."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    trials = [(calibration.check, BAND, "o", "left out")]
    trials += [(each, EXACT, "s", "" if place else "where the posterior is, before they were learnt")
               for place, each in enumerate(calibration.held_out)]  # fmt: skip
    with rc_context(STYLE):
        figure = Figure(figsize=(10.0, 3.9))
        left, right = figure.subplots(1, 2)
        for check, color, mark, label in trials:
            computed, error = check.computed.ravel(), (check.predicted - check.computed).ravel()
            size = np.abs(check.computed).max()
            left.errorbar(computed, error / size, yerr=1.96 * check.sd.ravel() / size, fmt=mark, ms=2.6, color=color,
                          ecolor=color, elinewidth=0.5, alpha=0.6, label=label)  # fmt: skip
            right.plot(computed, check.standardised.ravel(), mark, ms=2.6, color=color, alpha=0.6)
        left.axhline(0, color=INK, lw=0.8)
        left.set_title("Emulator minus model, over the largest output")
        for end in (-1.96, 1.96):
            right.axhline(end, color=BASE, lw=1, ls="--")
        right.set_title("The same in standard deviations (dashed: 95 %)")
        for axis in (left, right):
            axis.set_xlabel("output of the model")
        left.legend(fontsize=9)
    return figure


def marginals_figure(calibration: Calibration) -> Figure:
    """Return the marginal posterior of every parameter with its prior, and as if the emulator were exact."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    symbols = calibration.problem.symbols
    columns = min(COLUMNS, len(symbols))
    rows = ceil(len(symbols) / columns)
    with rc_context(STYLE):
        figure = Figure(figsize=(3.6 * columns + 0.6, 2.7 * rows + 0.7))
        panels = figure.subplots(rows, columns, squeeze=False).ravel()
        for axis, symbol in zip(panels, symbols, strict=False):
            _draw_marginal(axis, calibration, symbol)
        for spare in panels[len(symbols) :]:
            spare.set_visible(False)
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), fontsize=9)
    return figure


def _draw_marginal(axis: Axes, calibration: Calibration, symbol: str) -> None:
    own, exact = calibration.marginals[symbol], calibration.without_emulator_error.marginals[symbol]
    ends = np.array([marginal.quantile([0.001, 0.999]) for marginal in (own, exact)])
    values = np.linspace(ends[:, 0].min(), ends[:, 1].max(), 500)
    axis.fill_between(values, own.pdf(values), color=BAND, alpha=0.3, lw=0, label="posterior")
    axis.plot(values, exact.pdf(values), color=EXACT, lw=1.2, ls="--", label="as if the emulator were exact")
    low, high = calibration.problem.priors[symbol].support
    inside = (values > low) & (values < high)
    prior = np.exp(calibration.problem.priors[symbol].log_density(values[inside]))
    axis.plot(values[inside], prior, ":", color=BASE, lw=1.4, label="prior")
    axis.plot(own.hdi(), [0, 0], color=BAND, lw=4, solid_capstyle="butt")
    top = max(own.density.max(), float(exact.pdf(values).max()))
    axis.set_ylim(-0.02 * top, min(1.08 * top, 4 * float(own.density.max())))
    axis.set_title(symbol)
    axis.set_yticks([])
    axis.spines["left"].set_visible(False)
    axis.locator_params(axis="x", nbins=5)
