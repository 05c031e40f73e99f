"""Figures: the answer, predictive checks with and without the discrepancy, and marginal posteriors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from tissuq.arrays import FloatArray
from tissuq.assessment.extent import has_energy
from tissuq.drawing.panels import columns_of, legend_above, limits_of, on_figure, shortened
from tissuq.drawing.pieces import band, line, points
from tissuq.drawing.style import BASE, TRUTH, new_figure
from tissuq.experiments.curve import Curve
from tissuq.experiments.units import StressUnit
from tissuq.pictures.curves import Described, described
from tissuq.pictures.parameters import ridges
from tissuq.pictures.stability import shade_instability
from tissuq.posterior.posterior import Posterior

if TYPE_CHECKING:
    from matplotlib.figure import Figure


WIDTHS = {1: 6.0, 2: 9.2, 3: 11.5}
"""Of figures with so many panels side by side, inches."""


def described_curves(posterior: Posterior) -> list[Described]:
    """Return what a posterior says of its curves; what is inside the bands it knows already."""
    inside = posterior.inside_bands() if posterior.solution.is_of_data else None
    return described(posterior.solution, inside=inside)


def predictive_figure(
    posteriors: Mapping[str, Posterior],
    *,
    discrepancy: bool,
    unit: StressUnit,
    true_curve: tuple[FloatArray, FloatArray] | None = None,
    computed: Mapping[str, Sequence[Described]] | None = None,
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
    computed : mapping of str to sequence of Described, optional
        What the posteriors say of their curves, of which nothing is computed anew.
    """
    described = computed or {name: described_curves(posterior) for name, posterior in posteriors.items()}
    curves = next(iter(posteriors.values())).model.experiment.curves
    panels = [(name, described_curve) for name in posteriors for described_curve in described[name]]
    columns = columns_of(len(panels))
    with new_figure(WIDTHS[columns], 3.3 * -(-len(panels) // columns) + 0.5) as figure:
        drawn = on_figure(figure, len(panels), columns)
        bands = [
            described_curve.measurements if discrepancy else described_curve.measurements_alone
            for _, described_curve in panels
        ]
        base = bands[list(posteriors).index("none") * len(curves) :] if "none" in posteriors else []
        for index, (axis, (name, of_curve)) in enumerate(zip(drawn.axes, panels, strict=True)):
            posterior, curve, of_panel = posteriors[name], of_curve.curve, bands[index]
            inside = posterior.inside_bands(discrepancy=discrepancy)[index % len(curves)].sum()
            axis.set_title(f"{_label(posteriors, name, curve, drawn.letters)}{inside} of {len(curve)} inside")
            low, high, median = (values / unit.to_mpa for values in (of_panel.low, of_panel.high, of_panel.median))
            band(axis, of_curve.abscissa, low, high, ways=of_curve.ways, label="95 % predictive band")
            line(axis, of_curve.abscissa, median, ways=of_curve.ways, label="predicted median")
            if name != "none" and base:
                line(axis, of_curve.abscissa, base[index % len(curves)].median / unit.to_mpa, color=BASE, style=":",
                     width=1.4, ways=of_curve.ways, label="median of the fit 'none'")  # fmt: skip
            if curve.mode.is_curve and (discrepancy == has_energy(posterior.model) or name == "none"):
                ends = float(of_panel.stretch[0]), float(of_panel.stretch[-1])
                shade_instability(axis, posterior.stable_ranges.get(curve.mode.name), *ends)
            if true_curve is not None:
                axis.plot(true_curve[0], true_curve[1] / unit.to_mpa, "--", color=TRUTH, lw=1.3, label="true curve")
            points(axis, curve.drawn_at(), curve.stress / unit.to_mpa, is_back=curve.is_back)
            axis.locator_params(axis="x", nbins=6)
            if len(curves) > 1:
                axis.set_xlabel(curve.drawn_name, fontsize=9)
        if len(curves) == 1:
            shown = [end / unit.to_mpa for of_panel in bands for end in (of_panel.low, of_panel.high)]
            for number, axis in enumerate(drawn.axes):  # numbers beneath the lowest panel of a column alone
                axis.sharex(drawn.axes[0]) if number else None
                axis.set_ylim(limits_of([curves[0].stress / unit.to_mpa, *shown], []))
                axis.tick_params(labelbottom=number + columns >= len(drawn.axes))
            figure.supxlabel(curves[0].drawn_name, fontsize=10.5)
        measured = {stress for curve in curves for stress in curve.mode.stresses}
        quantity = measured.pop() if len(measured) == 1 else "engineering stress"
        figure.supylabel(f"{quantity} [{unit.name}]", fontsize=10.5)
        drawn.explain(2 if len(panels) == 1 else len(panels) + 3)
    return figure


def marginal_figure(
    posteriors: Mapping[str, Posterior], symbol: str, unit: StressUnit, truth: float | None = None, width: float = 8.2
) -> Figure:
    """Return the marginal posteriors of one stress parameter, a row a formulation, with interval and true value."""
    with new_figure(width, 0.62 * len(posteriors) + 1.4) as figure:
        solutions = {name: posterior.solution for name, posterior in posteriors.items()}
        axis = figure.subplots()
        ridges(axis, solutions, symbol, unit, truth=truth)
        legend_above(figure, [axis])
    return figure


def _label(posteriors: Mapping[str, Posterior], name: str, curve: Curve, letters: int) -> str:
    """Return what tells a panel from the others: its fit, and its curve, which then has a line of its own."""
    several = len(posteriors[name].model.experiment.curves) > 1
    if not several:
        return f"{name}:  "
    stress = f", {curve.quantity.replace('engineering stress of ', '')}" if len(curve.mode.stresses) > 1 else ""
    words = [name] * (len(posteriors) > 1) + [f"{curve.name}{stress}"]
    return f"{shortened(', '.join(words), letters)}\n"
