"""Figures: predictive checks with and without the discrepancy, and marginal posteriors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tissuq.assessment.extent import has_energy
from tissuq.assessment.stability import LOST
from tissuq.experiments.units import StressUnit
from tissuq.posterior import Posterior
from tissuq.prediction.bands import Band, predict_band, share_inside

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["BAND", "BASE", "INK", "STYLE", "marginal_figure", "predictive_figure", "save_figure"]

FloatArray = NDArray[np.float64]

INK, BAND, BASE, TRUTH, UNSTABLE = "#222222", "#0072B2", "#8a8a8a", "#D55E00", "#E69F00"
STYLE: dict[Any, Any] = {
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#666666",
    "axes.titlesize": 10.5,
    "axes.titlelocation": "left",
    "legend.frameon": False,
    "svg.fonttype": "path",
    "svg.hashsalt": "tissuq",
    "figure.constrained_layout.use": True,
}


def predictive_figure(
    posteriors: Mapping[str, Posterior],
    *,
    discrepancy: bool,
    unit: StressUnit,
    true_curve: tuple[FloatArray, FloatArray] | None = None,
) -> Figure:
    """Return one panel a formulation: data, 95 % predictive band and mean, the band of "none" for comparison.

    Stretches at which what is drawn has lost its stability with a probability above 5 % are shaded; a discrepancy that
    is no energy has none to lose, so that its panels are shaded for the model alone only.

    Parameters
    ----------
    posteriors : mapping of str to Posterior
        On one experiment; the first panel's title is its key.
    discrepancy : bool
        The band with the discrepancy's share (eq. 27), or of the model alone (eq. 28).
    unit : StressUnit
        Unit of the stress axis.
    true_curve : (stretch, stress) arrays, MPa
        Drawn where it is known.
    """
    from matplotlib import rc_context

    with rc_context(STYLE):
        figure, axes = _panels(len(posteriors))
        experiment = next(iter(posteriors.values())).model.experiment
        stretch = np.linspace(experiment.stretch.min(), experiment.stretch.max(), 161)
        bands = {
            name: predict_band(posterior.solution, stretch, discrepancy=discrepancy)
            for name, posterior in posteriors.items()
        }
        for axis, (name, posterior) in zip(axes, posteriors.items(), strict=False):
            share = share_inside(posterior.solution, discrepancy=discrepancy)
            inside = f"{round(share * len(experiment))} of {len(experiment)} inside"
            axis.set_title(f"{name}:  {inside}")
            _draw_band(axis, bands[name], unit)
            if discrepancy == has_energy(posterior.model) or name == "none":
                _shade_instability(axis, posterior, stretch)
            if name != "none" and "none" in bands:
                axis.plot(
                    stretch,
                    bands["none"].mean / unit.to_mpa,
                    ":",
                    color=BASE,
                    lw=1.4,
                    label="mean of the fit 'none'",
                )
            if true_curve is not None:
                axis.plot(true_curve[0], true_curve[1] / unit.to_mpa, "--", color=TRUTH, lw=1.3, label="true curve")
            axis.plot(experiment.stretch, experiment.stress / unit.to_mpa, "o", color=INK, ms=3, label="measured")
        limits = _common_limits(experiment.stress, [*bands.values()], unit)
        for axis in axes[: len(posteriors)]:
            axis.set_ylim(limits)
        _label(figure, axes, len(posteriors), unit)
    return figure


def marginal_figure(
    posteriors: Mapping[str, Posterior], symbol: str, unit: StressUnit, truth: float | None = None
) -> Figure:
    """Return the marginal posteriors of one stress parameter, a row a formulation, with 95 % HPD and true value."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(STYLE):
        figure = Figure(figsize=(8.2, 0.62 * len(posteriors) + 1.1))
        axis = figure.subplots()
        for row, posterior in enumerate(reversed(list(posteriors.values()))):
            _draw_marginal(axis, row, posterior, symbol, unit, truth)
        if truth is not None:
            axis.axvline(truth / unit.to_mpa, color=TRUTH, ls="--", lw=1.3, zorder=0)
            axis.text(
                truth / unit.to_mpa, len(posteriors) - 0.12, f"true value {truth / unit.to_mpa:g}",
                color=TRUTH, ha="center", va="bottom", fontsize=9, bbox={"color": "white", "pad": 1.5},
            )  # fmt: skip
        axis.set_yticks(range(len(posteriors)), list(reversed(list(posteriors))))
        axis.tick_params(axis="y", length=0)
        axis.spines["left"].set_visible(False)
        axis.set_xlabel(f"{symbol} [{unit.name}]")
        axis.set_ylim(-0.35, len(posteriors) + 0.1)
    return figure


def save_figure(figure: Figure, folder: Path, name: str) -> None:
    """Write a figure as SVG and PNG, the same bytes for the same figure."""
    from matplotlib import rc_context

    with rc_context(STYLE):
        figure.savefig(folder / f"{name}.svg", metadata={"Date": None, "Creator": None})
        figure.savefig(folder / f"{name}.png", dpi=150, metadata={"Software": None})


def _panels(count: int) -> tuple[Figure, list[Axes]]:
    from matplotlib.figure import Figure

    columns = _columns(count)
    rows = ceil(count / columns)
    width = {1: 6.0, 2: 9.2, 3: 11.5}[columns]
    figure = Figure(figsize=(width, 3.3 * rows + 0.5))
    axes = figure.subplots(rows, columns, squeeze=False, sharex=True)
    return figure, list(axes.ravel())


def _columns(count: int) -> int:
    return 1 if count == 1 else 3 if count in (3, 5, 6, 7, 8, 9) else 2


def _draw_band(axis: Axes, band: Band, unit: StressUnit) -> None:
    low, high, mean = band.low / unit.to_mpa, band.high / unit.to_mpa, band.mean / unit.to_mpa
    axis.fill_between(band.stretch, low, high, color=BAND, alpha=0.22, lw=0, label="95 % predictive band")
    axis.plot(band.stretch, mean, color=BAND, lw=1.6, label="predicted mean")


def _shade_instability(axis: Axes, posterior: Posterior, stretch: FloatArray) -> None:
    found = posterior.stable_ranges.get(posterior.model.experiment.mode.name)
    if found is None:
        return
    label = f"stability lost (probability > {100 * LOST:.0f} %)"
    for sure, end in ((found.surely_low, found.low), (found.surely_high, found.high)):
        sure, end = np.clip([sure, end], stretch[0], stretch[-1])
        if sure != end:
            axis.axvspan(sure, end, facecolor=UNSTABLE, alpha=0.16, lw=0, zorder=0, label=label)
            axis.axvline(sure, color=UNSTABLE, lw=1.2, ls="-.", zorder=0.5)


def _draw_marginal(
    axis: Axes, row: int, posterior: Posterior, symbol: str, unit: StressUnit, truth: float | None
) -> None:
    marginal = posterior.solution.marginals[symbol]
    low, high = marginal.hdi()
    edges = marginal.quantile([0.0005, 0.9995])
    values = np.linspace(edges[0], edges[1], 400)
    height = marginal.pdf(values)
    holds = truth is None or low <= truth <= high
    color = BAND if holds else BASE
    axis.fill_between(values / unit.to_mpa, row, row + 0.8 * height / height.max(), color=color, alpha=0.35, lw=0)
    axis.plot([low / unit.to_mpa, high / unit.to_mpa], [row, row], color=color, lw=4, solid_capstyle="butt")
    axis.plot(marginal.mean / unit.to_mpa, row, "o", color="white", mec=INK, ms=5, zorder=3)


def _common_limits(stress: FloatArray, bands: Sequence[Band], unit: StressUnit) -> tuple[float, float]:
    low = min([float(stress.min()), *(float(np.min(band.low)) for band in bands)])
    high = max([float(stress.max()), *(float(np.max(band.high)) for band in bands)])
    margin = 0.04 * (high - low)
    return (low - margin) / unit.to_mpa, (high + margin) / unit.to_mpa


def _label(figure: Figure, axes: list[Axes], count: int, unit: StressUnit) -> None:
    for spare, above in zip(axes[count:], axes[count - _columns(count) :], strict=False):
        spare.set_visible(False)
        above.tick_params(labelbottom=True)
    figure.supxlabel("stretch", fontsize=10.5)
    figure.supylabel(f"engineering stress [{unit.name}]", fontsize=10.5)
    handles: dict[str, Any] = {}
    for axis in axes[:count]:
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    shown = 2 if count == 1 else len(handles)
    figure.legend(list(handles.values()), list(handles), loc="outside upper center", ncols=shown, fontsize=9.5)
