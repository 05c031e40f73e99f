"""Figures of a population: its specimens by parameter, and the stress of a new specimen over measured curves."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from tissuq.drawing import pieces
from tissuq.drawing.panels import on_figure
from tissuq.drawing.style import ANSWER_WIDTH, BASE, TRUTH, new_figure
from tissuq.experiments.units import StressUnit
from tissuq.population.answer import Measured, headline, patient_in_words
from tissuq.population.picture import draw_specimens, height_of
from tissuq.prediction.bands import Band

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tissuq.population import Population

Bands: TypeAlias = tuple[Band, ...]
"""Stress of a new specimen with the model error, and of the material alone."""


def headline_figure(population: Population, unit: StressUnit) -> Figure:
    """Return the panel of the headline, for the head of a page."""
    symbol, (words, ratio) = population.symbols[0], headline(population)
    summary, specimens = (
        ratio * summary_of(unit=unit.name) for summary_of in (population.summary, population.specimen_summary)
    )
    unit_name = population.unit_of(symbol, unit).name
    with new_figure(ANSWER_WIDTH, height_of(len(population.names)) + 1.0) as figure:
        drawn = on_figure(figure, 1, 1)
        whose = patient_in_words(population), patient_in_words(population, {})
        draw_specimens(drawn, summary, specimens, {symbol: unit_name}, whose)
        drawn.axes[0].set_xlabel(f"{words} [{unit_name}]" if unit_name else words)
    return figure


def specimens_figure(population: Population, unit: StressUnit) -> Figure:
    """Return `Population.plot` as a figure of the report, its panels side by side."""
    count = len(population.symbols)
    with new_figure(
        6.4 if count == 1 else min(3.6 * count + 0.6, 12.0), height_of(len(population.names)) + 0.7
    ) as figure:
        population.draw(on_figure(figure, count, count), unit)
    return figure


def patient_figure(population: Population, bands: Mapping[Measured, Bands], unit: StressUnit) -> Figure:
    """Return the stress of a new specimen, with and without the model error, over the curves of the specimens.

    Parameters
    ----------
    population : Population
    bands : mapping of LoadingMode and number of a stress to two of Band
        Of `stresses_where_measured`, with the discrepancy and without; a panel each.
    unit : StressUnit
    """
    with new_figure(6.6 if len(bands) == 1 else min(4.6 * len(bands), 13.8), 4.2) as figure:
        panels = figure.subplots(1, len(bands), squeeze=False)[0]
        for axis, (measured, bands_of_stress) in zip(panels, bands.items(), strict=True):
            _draw_patient(axis, population, measured, bands_of_stress, unit)
        panels[0].legend(fontsize=9)
        if len(bands) == 1:
            panels[0].set_title(f"Expected for a new specimen: {next(iter(bands))[0].name}")
        else:
            figure.suptitle("Expected for a new specimen")
    return figure


def _draw_patient(axis: Axes, population: Population, measured: Measured, bands: Bands, unit: StressUnit) -> None:
    mode, channel = measured
    curves = [curve for posterior in population.posteriors.values() for curve in posterior.model.experiment.curves]
    for index, curve in enumerate(curve for curve in curves if (curve.mode, curve.channel) == measured):
        order = np.argsort(curve.points, kind="stable")
        axis.plot(curve.points[order], curve.stress[order] / unit.to_mpa, color=BASE, lw=0.7, alpha=0.7,
                  label="" if index else "measured specimens")  # fmt: skip
    band, material_alone = bands
    pieces.band(axis, band.stretch, band.low / unit.to_mpa, band.high / unit.to_mpa, label="a new specimen, 95 %")
    pieces.line(axis, band.stretch, band.median / unit.to_mpa, width=1.8, label="median")
    for end, label in ((material_alone.low, "95 % of the material alone"), (material_alone.high, "")):
        axis.plot(material_alone.stretch, end / unit.to_mpa, ":", color=TRUTH, lw=1.4, label=label)
    axis.set_xlabel(mode.controls[0].name)
    axis.set_ylabel(f"{mode.stresses[channel]} [{unit.name}]")
    axis.set_title(mode.name)
