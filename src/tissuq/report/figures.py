"""Figures: predictive checks with and without the discrepancy, and marginal posteriors."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tissuq.assessment.extent import has_energy
from tissuq.assessment.stability import MIN_LOSS_PROBABILITY
from tissuq.experiments.experiment import Curve
from tissuq.experiments.modes import LoadingMode
from tissuq.experiments.units import StressUnit
from tissuq.posterior.posterior import Posterior
from tissuq.prediction.bands import Band, predict_band

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "BAND",
    "BASE",
    "INK",
    "STYLE",
    "legend_above",
    "marginal_figure",
    "new_figure",
    "predictive_figure",
    "save_figure",
]

FloatArray = NDArray[np.float64]

INK, BAND, BASE, TRUTH, UNSTABLE = "#222222", "#0072B2", "#8a8a8a", "#D55E00", "#E69F00"
MAX_POINTS, BINS = 5000, 120
"""Measurements that are drawn one by one, and bins in which more of them are summed up."""
STYLE: dict[Any, Any] = {
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#666666",
    "axes.titlesize": 10.5,
    "axes.titlelocation": "left",
    "legend.frameon": False,
    "text.parse_math": False,  # a dollar sign in the name of a file is one
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
    """Return one panel a formulation, or one for each measured stress: data, 95 % predictive band and mean.

    With the mean of "none" for comparison.

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
        curves = next(iter(posteriors.values())).model.experiment.curves
        panels = [(name, curve) for name in posteriors for curve in curves]
        figure, axes = _panels(len(panels), is_shared=len(curves) == 1)
        bands = [_band_over(posteriors[name], curve, discrepancy) for name, curve in panels]
        base = bands[list(posteriors).index("none") * len(curves) :] if "none" in posteriors else []
        for index, (axis, (name, curve)) in enumerate(zip(axes, panels, strict=False)):
            posterior, band = posteriors[name], bands[index]
            inside = posterior.inside_bands(discrepancy=discrepancy)[index % len(curves)].sum()
            labels = [name] * (len(posteriors) > 1) + [_name_of(curve)] * (len(curves) > 1) or [name]
            axis.set_title(f"{', '.join(labels)}:  {inside} of {len(curve)} inside")
            _draw_band(axis, band, unit)
            if curve.mode.is_curve and (discrepancy == has_energy(posterior.model) or name == "none"):
                _shade_instability(axis, posterior, curve.mode.name, band.stretch)
            if name != "none" and base:
                none = base[index % len(curves)]
                median = none.median / unit.to_mpa
                axis.plot(none.stretch, median, ":", color=BASE, lw=1.4, label="median of the fit 'none'")
            if true_curve is not None:
                axis.plot(true_curve[0], true_curve[1] / unit.to_mpa, "--", color=TRUTH, lw=1.3, label="true curve")
            _draw_measured(axis, curve.abscissa, curve.stress / unit.to_mpa)
            if len(curves) > 1:
                axis.locator_params(axis="x", nbins=6)
                axis.set_xlabel(curve.mode.controls[0].name, fontsize=9)
        if len(curves) == 1:
            limits = _common_limits(curves[0].stress, bands, unit)
            for axis in axes[: len(panels)]:
                axis.set_ylim(limits)
        _label(figure, axes, len(panels), [curve.mode for curve in curves], unit)
    return figure


def _name_of(curve: Curve) -> str:
    return f"{curve.name}, {curve.quantity}" if len(curve.mode.stresses) > 1 else curve.name


def _band_over(posterior: Posterior, curve: Curve, discrepancy: bool) -> Band:
    """Return the band of a stress over the range of its curve, or at its points where the test has several controls."""
    points = curve.points
    if points.ndim > 1:
        points = points[np.argsort(curve.abscissa, kind="stable")]
    else:
        points = np.linspace(points.min(), points.max(), 161)
    return predict_band(posterior.solution, points, discrepancy=discrepancy, mode=curve.mode, channel=curve.channel)


def _draw_measured(axis: Axes, abscissa: FloatArray, stress: FloatArray) -> None:
    """Draw measurements as points, or, if there are many, the mean and central 95 % of bins."""
    if len(abscissa) <= MAX_POINTS:
        axis.plot(abscissa, stress, "o", color=INK, ms=3, label="measured")
        return
    edges = np.linspace(abscissa.min(), abscissa.max(), BINS + 1)
    order = np.argsort(abscissa)
    bins = [rows for rows in np.split(order, np.searchsorted(abscissa[order], edges[1:-1])) if len(rows)]
    centre, mean = (np.array([values[rows].mean() for rows in bins]) for values in (abscissa, stress))
    low, high = np.array([np.quantile(stress[rows], [0.025, 0.975]) for rows in bins]).T
    axis.vlines(centre, low, high, color=INK, lw=0.8)
    axis.plot(centre, mean, "o", color=INK, ms=2.5, label=f"measured ({len(stress)}): mean and central 95 % of bins")


def marginal_figure(
    posteriors: Mapping[str, Posterior], symbol: str, unit: StressUnit, truth: float | None = None
) -> Figure:
    """Return the marginal posteriors of one stress parameter, a row a formulation, with 95 % HPD and true value."""
    with new_figure(8.2, 0.62 * len(posteriors) + 1.1) as figure:
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


@contextmanager
def new_figure(width: float, height: float) -> Iterator[Figure]:
    """Give an empty figure, its sizes in inches, to draw on in the style of all reports."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(STYLE):
        yield Figure(figsize=(width, height))


def legend_above(figure: Figure, axes: Iterable[Axes], columns: int | None = None, *, font_size: float = 9) -> None:
    """Explain above a figure what its panels show, every label once, in at most so many columns."""
    handles: dict[str, Any] = {}
    for axis in axes:
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    count = min(columns or len(handles), len(handles))
    figure.legend(list(handles.values()), list(handles), loc="outside upper center", ncols=count, fontsize=font_size)


def save_figure(figure: Figure, folder: Path, name: str) -> None:
    """Write a figure as SVG and PNG, the same bytes for the same figure."""
    from matplotlib import rc_context

    with rc_context(STYLE):
        figure.savefig(folder / f"{name}.svg", metadata={"Date": None, "Creator": None})
        figure.set_layout_engine("none")  # the layout of the first file is that of the second
        figure.savefig(folder / f"{name}.png", dpi=150, metadata={"Software": None})


def _panels(count: int, is_shared: bool) -> tuple[Figure, list[Axes]]:
    from matplotlib.figure import Figure

    columns = _columns(count)
    rows = ceil(count / columns)
    width = {1: 6.0, 2: 9.2, 3: 11.5}[columns]
    figure = Figure(figsize=(width, 3.3 * rows + 0.5))
    axes = figure.subplots(rows, columns, squeeze=False, sharex=is_shared)
    return figure, list(axes.ravel())


def _columns(count: int) -> int:
    return 1 if count == 1 else 3 if count in (3, 5, 6, 7, 8, 9) else 2


def _draw_band(axis: Axes, band: Band, unit: StressUnit) -> None:
    low, high, median = (values / unit.to_mpa for values in (band.low, band.high, band.median))
    axis.fill_between(band.stretch, low, high, color=BAND, alpha=0.22, lw=0, label="95 % predictive band")
    axis.plot(band.stretch, median, color=BAND, lw=1.6, label="predicted median")


def _shade_instability(axis: Axes, posterior: Posterior, mode: str, stretch: FloatArray) -> None:
    stable_range = posterior.stable_ranges.get(mode)
    if stable_range is None:
        return
    label = f"stability lost (probability > {100 * MIN_LOSS_PROBABILITY:.0f} %)"
    for sure, end in ((stable_range.surely_low, stable_range.low), (stable_range.surely_high, stable_range.high)):
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


def _label(figure: Figure, axes: list[Axes], count: int, modes: Sequence[LoadingMode], unit: StressUnit) -> None:
    for spare, visible in zip(axes[count:], axes[count - _columns(count) :], strict=False):
        spare.set_visible(False)
        visible.tick_params(labelbottom=True)
    if len(modes) == 1:
        figure.supxlabel(modes[0].controls[0].name, fontsize=10.5)
    measured = {stress for mode in modes for stress in mode.stresses}
    figure.supylabel(f"{measured.pop() if len(measured) == 1 else 'engineering stress'} [{unit.name}]", fontsize=10.5)
    legend_above(figure, axes[:count], 2 if count == 1 else None, font_size=9.5)
