"""The picture of an experiment: every measured stress against what it is drawn against, before any fit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from tissuq.drawing.panels import Panels, shortened, small_panels
from tissuq.drawing.pieces import points
from tissuq.drawing.style import BASE, inline_svg, relative_size
from tissuq.experiments.units import stress_unit

if TYPE_CHECKING:
    from tissuq.experiments.experiment import Curve

__all__ = ["draw_curves", "small_svg"]

MOST_SMALL = 2
"""Curves of a notebook's figure at the most."""


def draw_curves(drawn: Panels, curves: Sequence[Curve], unit_name: str) -> None:
    """Draw every curve on a panel of its own, with its standard errors where there are any."""
    unit, size = stress_unit(unit_name), relative_size()
    for number, (axis, curve) in enumerate(zip(drawn.axes, curves, strict=True)):
        axis.axhline(0, color=BASE, lw=0.6 * size, zorder=0.5)
        axis.axvline(float(curve.path.abscissa(curve.mode.reference)), color=BASE, lw=0.6 * size, zorder=0.5)
        error = curve.standard_error / unit.to_mpa
        points(axis, curve.abscissa, curve.stress / unit.to_mpa, error=error, label="measured")
        axis.set_xlabel(curve.abscissa_name)
        if number % drawn.columns == 0 or len(curve.mode.stresses) > 1:
            axis.set_ylabel(f"{curve.quantity} [{unit.name}]")
        if drawn.is_new:
            axis.set_title(shortened(curve.name, drawn.letters))


def small_svg(curves: Sequence[Curve], unit_name: str) -> str:
    """Return the first curves as a small SVG for a notebook."""
    with small_panels(min(len(curves), MOST_SMALL)) as (figure, drawn):
        draw_curves(drawn, curves[:MOST_SMALL], unit_name)
    return inline_svg(figure, "Measured stresses")
