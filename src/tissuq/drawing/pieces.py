"""Pieces that figures are put together from: each draws arrays on axes and knows nothing of where they come from."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from tissuq.arrays import BoolArray, FloatArray, IndexArray
from tissuq.drawing.style import BAND, BASE, INK, relative_size

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap

EDGE = "end of the measured strains"
"""What the dashed line is where a hatched part begins."""
Ways = Sequence[tuple[IndexArray | slice, bool]]
"""Indices of points in the order in which they are drawn, and whether as a curve or by themselves."""
ONE_PATH: Ways = ((slice(None), True),)
MAX_POINTS, BINS = 5000, 120
"""Measurements that are drawn one by one, and bins in which more of them are summed up."""


def band(
    axis: Axes,
    x: ArrayLike,
    low: ArrayLike,
    high: ArrayLike,
    *,
    color: str = BAND,
    strength: float = 0.22,
    label: str = "",
    ways: Ways = ONE_PATH,
) -> None:
    """Draw what lies between two values: as an area along each way, or as bars at points that follow no path."""
    x, low, high = np.asarray(x), np.asarray(low), np.asarray(high)
    for indices, is_path in ways:
        ends = x[indices], low[indices], high[indices]
        if is_path:
            axis.fill_between(*ends, color=color, alpha=strength, lw=0, label=label)
        else:
            axis.vlines(*ends, color=color, alpha=strength, lw=5 * relative_size(), label=label)
        label = ""


def line(
    axis: Axes,
    x: ArrayLike,
    y: ArrayLike,
    *,
    color: str = BAND,
    label: str = "",
    ways: Ways = ONE_PATH,
    style: str = "-",
    width: float = 1.6,
    **options: Any,
) -> None:
    """Draw a curve along each way, or marks at points that follow no path."""
    x, y, size = np.asarray(x), np.asarray(y), relative_size()
    of_path, of_points = {"ls": style, "lw": width * size}, {"ls": "", "marker": "_", "ms": 7 * size}
    for indices, is_path in ways:
        looks: dict[str, Any] = of_path if is_path else of_points
        axis.plot(x[indices], y[indices], color=color, label=label, **looks, **options)
        label = ""


def points(
    axis: Axes,
    x: FloatArray,
    y: FloatArray,
    *,
    error: FloatArray | None = None,
    label: str = "measured",
    marker: str = "o",
    is_back: BoolArray | None = None,
    **looks: Any,
) -> None:
    """Draw measurements, with their standard errors where there are any; of very many the mean and 95 % of bins.

    Those of unloading (``is_back``) are hollow triangles.
    """
    if is_back is not None and is_back.any():
        hollow = {"mfc": "white", "mec": INK, "mew": 0.8 * relative_size(), **looks}
        branches = (~is_back, "loading", marker, looks), (is_back, "unloading", "v", hollow)
        for rows_of_branch, words, sign, look in branches:
            points(axis, x[rows_of_branch], y[rows_of_branch], error=None if error is None else error[rows_of_branch],
                   label=f"{label}, {words}" if label else "", marker=sign, **look)  # fmt: skip
        return
    size = relative_size()
    style: dict[str, Any] = {"color": INK, "ms": 3 * size, "zorder": 4} | looks
    if len(x) > MAX_POINTS:
        edges = np.linspace(x.min(), x.max(), BINS + 1)
        order = np.argsort(x)
        bins = [indices for indices in np.split(order, np.searchsorted(x[order], edges[1:-1])) if len(indices)]
        centre, mean = (np.array([values[indices].mean() for indices in bins]) for values in (x, y))
        low, high = np.array([np.quantile(y[indices], [0.025, 0.975]) for indices in bins]).T
        axis.vlines(centre, low, high, color=INK, lw=0.8 * size)
        label = f"{label} ({len(y)}, in bins)" if label else ""
        axis.plot(centre, mean, "o", color=INK, ms=2.5 * size, label=label)
    elif error is not None and error.any():
        label = f"{label} ± standard error" if label else ""
        axis.errorbar(x, y, yerr=error, fmt=marker, elinewidth=0.9 * size, ecolor=INK, label=label, **style)
    else:
        axis.plot(x, y, marker, label=label, **style)


def forest(
    axis: Axes,
    levels: ArrayLike,
    low: ArrayLike,
    middle: ArrayLike,
    high: ArrayLike,
    *,
    color: str = BAND,
    strength: float = 1.0,
    width: float = 2.4,
    mark: str = "o",
    size: float = 5.0,
    mark_color: str | None = None,
    label: str = "",
) -> None:
    """Draw intervals as bars at levels, with a mark in the middle of each."""
    scale = relative_size()
    for level, start, end in zip(*map(np.atleast_1d, (levels, low, high)), strict=True):
        axis.plot([start, end], [level, level], color=color, alpha=strength, lw=width * scale, label=label,
                  solid_capstyle="butt")  # fmt: skip
        label = ""
    axis.plot(middle, np.asarray(levels), mark, color=mark_color or color, ms=size * scale, zorder=3)


def rows(axis: Axes, names: Sequence[str], *, is_named: bool = True) -> FloatArray:
    """Name rows from top to bottom along the vertical axis, and return their levels."""
    levels = np.arange(len(names), dtype=np.float64)[::-1]
    axis.set_yticks(levels, names if is_named else [""] * len(names))
    axis.tick_params(axis="y", length=0)
    axis.set_ylim(-0.6, len(names) - 0.4)
    return levels


def density(
    axis: Axes,
    x: FloatArray,
    height: FloatArray,
    *,
    level: float = 0.0,
    top: float | None = None,
    color: str = BAND,
    label: str = "",
) -> None:
    """Draw a density as an area above a level; as tall as ``top``, where that is said."""
    scaled = height if top is None else top * height / height.max()
    axis.fill_between(x, level, level + scaled, color=color, alpha=0.35, lw=0, label=label)


def heat(
    axis: Axes, shades: FloatArray, texts: FloatArray, columns: Sequence[str], names: Sequence[str], colors: Colormap
) -> None:
    """Draw a table as colours, for shades from 0 to 1, with the numbers that are known in its cells."""
    axis.imshow(shades, cmap=colors, vmin=0, vmax=1, aspect="auto")
    for (row, column), value in np.ndenumerate(texts):
        if np.isfinite(value):
            axis.text(column, row, f"{value:.0f}", ha="center", va="center", fontsize=8.5 * relative_size())
    axis.tick_params(length=0)
    axis.spines[:].set_visible(False)
    axis.set_yticks(range(len(names)), names)
    axis.set_xticks(range(len(columns)), columns, rotation=90)


def outside(axis: Axes, low: float, high: float, label: str) -> None:
    """Hatch an axis where it goes beyond an interval of its horizontal values, which ends at dashed lines."""
    start_limit, end_limit = axis.get_xlim()
    margin = 0.011 * (end_limit - start_limit)  # that of the axis beyond the last point is no place of its own
    edge_label = EDGE
    for start, end in ((start_limit, min(low, end_limit)), (max(high, start_limit), end_limit)):
        if end - start > 3 * margin:
            axis.axvspan(start, end, facecolor="none", edgecolor=BASE, alpha=0.5, hatch="///", lw=0, zorder=0,
                         label=label)  # fmt: skip
            edge = end if start == start_limit else start
            axis.axvline(edge, color=BASE, lw=1.1 * relative_size(), ls="--", zorder=0.5, label=edge_label)
            label = edge_label = ""


def cut_off(axis: Axes, low: ArrayLike, high: ArrayLike, unit: str) -> None:
    """Say in a corner how far bands go beyond the limits of the vertical axis, where they do."""
    start, end = axis.get_ylim()
    ends = float(np.nanmin(low)), float(np.nanmax(high))
    cut_ends = [value for value, is_beyond in zip(ends, (ends[0] < start, ends[1] > end), strict=True) if is_beyond]
    if cut_ends:
        size = max(map(abs, cut_ends))
        numbers = " and ".join(f"{value:.2g}" if size < 1e6 else f"{value:.0e}" for value in cut_ends)
        axis.text(0.02, 0.98, f"bands go on to {numbers} {unit}", transform=axis.transAxes, va="top",
                  fontsize="small", color=INK)  # fmt: skip
