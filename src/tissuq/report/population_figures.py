"""Figures of a population: every specimen by itself and within it, and what is to be expected of a new patient."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tissuq.experiments.modes import LoadingMode
from tissuq.experiments.reading.units import StressUnit
from tissuq.report.figures import BAND, BASE, INK, STYLE

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tissuq.population import Population

__all__ = ["Bands", "numbers_of", "patient_figure", "specimens_figure"]

FloatArray = NDArray[np.float64]
Bands: TypeAlias = "tuple[pd.DataFrame, pd.DataFrame]"
"""Stress of a new patient with the model error, and of the material alone."""

ALONE, TOGETHER = "#b8b8b8", "#D55E00"
ENDS = ("hdi_low", "hdi_high")
COLUMNS = [f"{prefix}{name}" for prefix in ("", "alone_") for name in ("median", *ENDS)]
SMALL_MARKS_ABOVE = 25
"""Number of specimens above which names and marks are smaller."""


def specimens_figure(population: Population, unit: StressUnit) -> Figure:
    """Return a caterpillar plot, a panel a parameter: specimens alone and within the population, in order."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    symbols, summary = population.symbols, numbers_of(population.summary())
    table = numbers_of(population.specimen_summary())
    order = sorted(population.names, key=lambda name: table[name, symbols[0]]["median"])
    small = len(order) > SMALL_MARKS_ABOVE
    with rc_context(STYLE):
        height = 1.9 + (0.15 if small else 0.27) * len(order)
        figure = Figure(figsize=(min(6.4 if len(symbols) == 1 else 3.6 * len(symbols) + 0.6, 12.0), height))
        panels = figure.subplots(1, len(symbols), sharey=True, squeeze=False)[0]
        for panel, symbol in zip(panels, symbols, strict=True):
            parameter = next(p for p in population.complete.model.parameters if p.symbol == symbol)
            factor = unit.to_mpa if parameter.unit else 1.0
            estimates = {key: np.array([table[name, symbol][key] for name in order]) / factor for key in COLUMNS}
            new, median, complete = (
                [summary[symbol, name][end] / factor for end in ENDS]
                for name in ("new patient", "median", "complete pooling")
            )
            panel.axvspan(*new, color=BAND, alpha=0.10, lw=0, label="a new patient, 95 %")
            panel.axvspan(*median, color=BAND, alpha=0.28, lw=0, label="median of the population")
            panel.hlines(-0.55, *complete, color=TOGETHER, lw=4, label="complete pooling")
            _draw_specimens(panel, estimates, small)
            panel.set_xlim(*_limits([*new, *estimates["hdi_low"], *estimates["hdi_high"]], estimates))
            panel.set_xlabel(f"{symbol} [{unit.name}]" if parameter.unit else symbol)
            panel.tick_params(axis="y", length=0)
        panels[0].set_yticks(range(len(order)), order, fontsize=6.5 if small else 9)
        panels[0].set_ylim(-0.8, len(order) - 0.2)
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=2, fontsize=9)
    return figure


def numbers_of(table: pd.DataFrame) -> dict[Any, dict[str, float]]:
    """Return the rows of a table by what they are indexed by."""
    return {index: {str(name): float(value) for name, value in row.items()} for index, row in table.T.to_dict().items()}


def _limits(shown: list[float], estimates: dict[str, FloatArray]) -> tuple[float, float]:
    """Return the ends of an axis on which new patients and specimens within the population fit; others may run out."""
    low, high = min(shown), max(shown)
    width = high - low
    ends = float(estimates["alone_hdi_low"].min()), float(estimates["alone_hdi_high"].max())
    return max(min(low, ends[0]), low - width) - 0.04 * width, min(max(high, ends[1]), high + width) + 0.04 * width


def _draw_specimens(axis: Axes, estimates: dict[str, FloatArray], small: bool) -> None:
    heights = np.arange(len(estimates["median"]))
    gap, width, size = (0.18, 1.6, 2.5) if small else (0.16, 2.6, 3.5)
    for prefix, side, color, dot, label in (
        ("alone_", gap, ALONE, BASE, "specimen by itself, 95 % HPD"),
        ("", -gap, BAND, INK, "within the population, 95 % HPD"),
    ):
        ends = estimates[f"{prefix}hdi_low"], estimates[f"{prefix}hdi_high"]
        axis.hlines(heights + side, *ends, color=color, lw=width, label=label)
        axis.plot(estimates[f"{prefix}median"], heights + side, "o", color=dot, ms=size)


def patient_figure(population: Population, bands: Mapping[LoadingMode, Bands], unit: StressUnit) -> Figure:
    """Return the stress of a new patient, with and without the model error, over the curves of the specimens.

    Parameters
    ----------
    population : Population
    bands : mapping of LoadingMode to two pandas.DataFrame
        From `Population.new_patient`, with the discrepancy and without; a panel each.
    unit : StressUnit
    """
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(STYLE):
        figure = Figure(figsize=(6.6 if len(bands) == 1 else min(4.6 * len(bands), 13.8), 4.2))
        panels = figure.subplots(1, len(bands), squeeze=False)[0]
        for axis, (mode, mode_bands) in zip(panels, bands.items(), strict=True):
            _draw_patient(axis, population, mode, mode_bands, unit)
        panels[0].set_ylabel(f"engineering stress [{unit.name}]")
        panels[0].legend(fontsize=9)
        if len(bands) == 1:
            panels[0].set_title(f"Expected for a new patient: {next(iter(bands)).name}")
        else:
            figure.suptitle("Expected for a new patient")
    return figure


def _draw_patient(axis: Axes, population: Population, mode: LoadingMode, bands: Bands, unit: StressUnit) -> None:
    tests = [test for posterior in population.posteriors.values() for test in posterior.model.experiment.tests]
    for index, data in enumerate(test for test in tests if test.mode == mode):
        order = np.argsort(data.stretch, kind="stable")
        axis.plot(data.stretch[order], data.stress[order] / unit.to_mpa, color=BASE, lw=0.7, alpha=0.7,
                  label="" if index else "measured specimens")  # fmt: skip
    band, material_alone = bands
    low, high = band["low"] / unit.to_mpa, band["high"] / unit.to_mpa
    axis.fill_between(band["stretch"], low, high, color=BAND, alpha=0.22, lw=0, label="a new patient, 95 %")
    axis.plot(band["stretch"], band["median"] / unit.to_mpa, color=BAND, lw=1.8, label="median")
    for end in ("low", "high"):
        axis.plot(material_alone["stretch"], material_alone[end] / unit.to_mpa, ":", color=TOGETHER, lw=1.4,
                  label="" if end == "high" else "95 % of the material alone")  # fmt: skip
    axis.set_xlabel(mode.controls[0].name)
    axis.set_title(mode.name)
