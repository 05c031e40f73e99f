"""The one picture, of whether the model describes the test and how sure that is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.drawing.panels import Panels, columns_of, limits_of, on_figure, shortened, small_panels, within
from tissuq.drawing.pieces import band, cut_off, line, points
from tissuq.drawing.style import BAND, BASE, INK, MARKERS, STYLE, TRUTH, inline_svg, new_figure, relative_size
from tissuq.experiments.units import StressUnit
from tissuq.inference.solution import Representation, Solution
from tissuq.pictures.curves import Described, has_discrepancy, is_determined, points_along, share_along, ways_of
from tissuq.prediction.bands import predict_band

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PIXELS = 96
"""Of a page, in an inch."""
WIDE, WIDE_ROW = (1000, 480), 330
"""Width and height of the figure of a page in pixels, and what a further row of panels adds to the height."""
NARROW, NARROW_ROW = (400, 480), 300
"""The same on a small screen, where panels stand above one another."""
WIDE_LETTERS, NARROW_LETTERS = 11, 10.5
"""Points; a pixel of a page is three quarters of one."""
SMALL_POINTS, FEW = 31, 100
"""Points of the band of a small figure, and components of the posterior that it takes."""
LONG, SHORT = "engineering stress of", "stress of"
"""Words of the name of one of several stresses, which are long for an axis, and others."""
SHARE_TICKS, MOST_SHARE = 3, 500
"""Ticks of a strip, and percent to which shares are cut: no renderer takes any number."""


def answer(described: Sequence[Described], drawn: Panels, unit: StressUnit) -> None:
    """Draw every measured curve with its bands on a panel of its own, and the discrepancy's share on the strips."""
    solution, prob = described[0].solution, described[0].prob
    curves = solution.model.experiment.curves
    for number, (axis, described_curve) in enumerate(zip(drawn.axes, described, strict=True)):
        curve = described_curve.curve
        _draw(axis, described_curve, unit)
        if drawn.is_new:
            axis.set_title(_title(described_curve, len(described) > 1, drawn.letters))
        if number % drawn.columns == 0 or not _is_one_stress(solution):
            axis.set_ylabel(f"{curve.quantity.replace(LONG, SHORT)} [{unit.name}]")
    if drawn.strips:
        _draw_strips(drawn, solution, prob)
    for axis, curve in zip(drawn.lowest, curves, strict=True):
        axis.set_xlabel(curve.drawn_name)
    drawn.explain()


def answer_on_new_figure(described: Sequence[Described], unit: StressUnit, *, is_narrow: bool = False) -> Figure:
    """Return the picture as a figure of a page: 1000 pixels wide, or 400 with panels above one another.

    A pixel of a page is a 96th of an inch, so that the SVG has these sizes. One row of panels is 480 pixels tall.
    """
    count = len(described)
    columns = 1 if is_narrow else columns_of(count)
    (width, height), row_size = (NARROW, NARROW_ROW) if is_narrow else (WIDE, WIDE_ROW)
    tall = height + row_size * (-(-count // columns) - 1)
    letters = NARROW_LETTERS if is_narrow else WIDE_LETTERS
    style = STYLE | {"font.size": letters, "axes.titlesize": letters, "figure.dpi": PIXELS}
    with new_figure(width / PIXELS, tall / PIXELS, style) as figure:
        drawn = on_figure(figure, count, columns, has_strips=has_discrepancy(described[0].solution))
        answer(described, Panels(drawn.axes, drawn.strips), unit)
    return figure


def discrepancy_shares(solution: Solution, drawn: Panels, prob: float = 0.95) -> None:
    """Draw the share of the stress that the discrepancy carries along every measured curve."""
    curves = solution.model.experiment.curves
    for axis, curve in zip(drawn.axes, curves, strict=True):
        _draw_share(axis, solution, curve, prob)
        if len(curves) > 1:
            axis.set_title(shortened(curve.name, drawn.letters))
        axis.set_xlabel(curve.drawn_name)
    for number, axis in enumerate(drawn.axes):
        if number % drawn.columns == 0:
            axis.set_ylabel("share of the discrepancy [%]")
    drawn.explain()


def small_svg(solution: Solution, unit: StressUnit, words: str) -> str:
    """Return the first measured curve and its band as a small SVG, at little cost: few components make the band."""
    curves = solution.model.experiment.curves
    curve, count = curves[0], f", 1 of {len(curves)}" if len(curves) > 1 else ""
    across = points_along(curve, SMALL_POINTS)
    rough = replace(solution, representation=Representation.of(solution.thinned(FEW)))
    of_curve = predict_band(rough, across, curve=curve)
    low, high, median = (values / unit.to_mpa for values in (of_curve.low, of_curve.high, of_curve.median))
    measured = curve.stress / unit.to_mpa
    limits = limits_of([measured, median], [low, high])
    with small_panels(1) as (figure, drawn):
        (axis,) = drawn.axes
        abscissa = curve.drawn_at(across)
        ways = ways_of(curve.mode, across, abscissa)
        band(axis, abscissa, within(low, limits), within(high, limits), ways=ways)
        line(axis, abscissa, median, ways=ways)
        points(axis, curve.drawn_at(), measured, is_back=curve.is_back)
        axis.set_ylim(limits)
        end = f" [{unit.name}]{count}"
        axis.set_title(f"{shortened(curve.name, drawn.letters - len(end))}{end}")
    return inline_svg(figure, words)


def _draw(axis: Axes, described: Described, unit: StressUnit) -> None:
    """Draw the bands of a curve, the material alone and the measurements; of several paths lines for the latter two."""
    curve, percent, is_one = described.curve, f"{100 * described.prob:.4g} %", len(described.ways) == 1
    has_parts = has_discrepancy(described.solution) and is_determined(described.stress_alone, described.stress)
    material_stress = described.stress_alone if has_parts else None
    measured, error = curve.stress / unit.to_mpa, curve.standard_error / unit.to_mpa
    core = [measured - error, measured + error, described.stress.median / unit.to_mpa]
    limit_values = [
        end / unit.to_mpa for shown in (described.measurements, described.stress) for end in (shown.low, shown.high)
    ]
    limits = limits_of(core, [*limit_values, *([material_stress.median / unit.to_mpa] if material_stress else [])])
    bands = [(described.measurements, 0.18 if is_one else 0.12, BAND, f"{percent} of measurements")]
    bands += [(described.stress, 0.38, BAND, f"{percent} of the stress")] if is_one else []
    bands += [(material_stress, 0.13, TRUTH, "")] if material_stress and is_one else []
    lines = [(described.stress, BAND, "-", "stress, median")]
    material = described.solution.model.material.name
    lines += [(material_stress, TRUTH, "--", f"{material} alone{f', {percent}' * is_one}")] if material_stress else []
    abscissa, ways = described.abscissa, described.ways
    for shown, strength, color, label in bands:
        low, high = (within(end / unit.to_mpa, limits) for end in (shown.low, shown.high))
        band(axis, abscissa, low, high, color=color, strength=strength, ways=ways, label=label)
    for shown, color, style, label in lines:
        median = within(shown.median / unit.to_mpa, limits)
        line(axis, abscissa, median, color=color, style=style, width=1.3, ways=ways, label=label)
    rows_of_ways: list[Any] = [slice(None)] if is_one else described.measured_rows
    for number, rows in enumerate(rows_of_ways):
        points(axis, curve.drawn_at()[rows], measured[rows], error=error[rows], label="" if number else "measured",
               marker=MARKERS[number % len(MARKERS)], is_back=curve.is_back[rows])  # fmt: skip
    axis.set_ylim(limits)
    cut_off(axis, limit_values[0], limit_values[1], unit.name)
    axis.locator_params(axis="x", nbins=6)


def _title(described: Described, is_named: bool, letters: int) -> str:
    """Return how many measurements of a curve are inside its band, beneath its name where there are several."""
    curve, percent = described.curve, f"{100 * described.prob:.4g} %"
    name = f"{shortened(curve.name, letters)}\n" if is_named else ""
    if not described.solution.is_of_data:
        return f"{name}predicted, not fitted to these"
    inside = int(described.inside.sum())
    forms = f"measurements inside their {percent} band", f"inside their {percent} band", f"inside {percent} band"
    texts = [f"{inside} of {len(curve)} {form}" for form in forms]
    return name + next((text for text in texts if len(text) <= letters), texts[-1])


def _is_one_stress(solution: Solution) -> bool:
    return len({curve.quantity for curve in solution.model.experiment.curves}) == 1


def _draw_strips(drawn: Panels, solution: Solution, prob: float) -> None:
    """Draw the shares of the discrepancy on strips of the same scale."""
    for axis, curve in zip(drawn.strips, solution.model.experiment.curves, strict=True):
        _draw_share(axis, solution, curve, prob)
        axis.locator_params(axis="y", nbins=SHARE_TICKS)
        axis.set_title(f"discrepancy, % of the stress: median, {100 * prob:.4g} %", fontsize="small", pad=2)
    ends = np.array([axis.get_ylim() for axis in drawn.strips])
    for axis in drawn.strips:
        axis.set_ylim(ends[:, 0].min(), ends[:, 1].max())


def _draw_share(axis: Axes, solution: Solution, curve: Any, prob: float) -> None:
    """Draw the share of a curve's stress that the discrepancy carries, in percent, within -100 and 100."""
    ways, abscissa, shares = share_along(solution, curve, prob)
    low, median, high = 100 * shares
    axis.axhline(0, color=BASE, lw=0.8 * relative_size(), zorder=0.5)
    axis.set_ylim(_share_limits(low, high))
    low_end, middle, high_end = (np.clip(end, -MOST_SHARE, MOST_SHARE) for end in (low, median, high))
    words = f"{100 * prob:.4g} % of the share"
    band(axis, abscissa, low_end, high_end, color=INK, strength=0.2, ways=ways, label=words)
    line(axis, abscissa, middle, color=INK, width=1.2, ways=ways, label="median")


def _share_limits(low: Any, high: Any) -> tuple[float, float]:
    """Return limits in percent that show zero and the band, as far as a hundred percent."""
    is_finite = np.isfinite(low) & np.isfinite(high)
    if not is_finite.any():
        return -10.0, 10.0
    ends = np.clip([low[is_finite].min(), high[is_finite].max()], -100, 100)
    low_end, high_end = min(ends[0], 0.0), max(ends[1], 0.0)
    air = 0.08 * max(high_end - low_end, 4.0)
    return low_end - air, high_end + air
