"""The folder of an inspection: converted data, what was said, and a figure of every test with its regions."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.drawing.style import BAND, BASE, INK, new_figure
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.reading.experiment_file import Reading
from tissuq.experiments.reading.inspection import Inspection
from tissuq.experiments.units import stress_unit
from tissuq.report.run_folder import write_figures
from tissuq.report.tables import write_csv
from tissuq.report.writer import data_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LETTERS = 13
"""Size of letters in the figure of an inspection, which is looked at on small screens, too; points."""
_BROAD: dict[str, Any] = {"ls": "-", "lw": 9, "alpha": 0.45, "solid_capstyle": "round"}
_RING: dict[str, Any] = {"ls": "", "marker": "o", "ms": 14, "mfc": "none", "mew": 2.5}
REGIONS: dict[str, dict[str, Any]] = {
    "slack": _BROAD | {"color": "#E69F00"},
    "rupture": _BROAD | {"color": "#D55E00"},
    "hold": _BROAD | {"color": "#CC79A7"},
    "saturation": _BROAD | {"color": "#009E73"},
    "slip": _RING | {"color": "#D55E00"},
    "outlier": _RING | {"color": "#CC79A7"},
    "copies": _BROAD | {"color": "#56B4E9"},
    "drift": _RING | {"color": "#009E73", "marker": "s"},
}
"""How the regions of a test are marked."""


def write_inspection(inspections: Sequence[Inspection], folder: Path) -> None:
    """Write figures, converted data and text of every test into an empty folder."""
    experiment = Experiment.of([inspection.reading.experiment for inspection in inspections])
    for name, rows in data_file(experiment, stress_unit(experiment.stress_unit)).items():
        write_csv(folder / name, rows)
    numbers = [f"-{number}" for number in range(1, len(inspections) + 1)] if len(inspections) > 1 else [""]
    figures = {f"curve{number}": curve_figure(item) for number, item in zip(numbers, inspections, strict=True)}
    write_figures(folder, figures)
    (folder / "inspection.txt").write_text("\n\n".join(map(str, inspections)) + "\n", encoding="utf-8")


def curve_figure(inspection: Inspection) -> Figure:
    """Return two panels: every row of the file with what happened in the test, and the rows as they would be fitted.

    Of a loading mode with two stresses, two for each.
    """
    reading = inspection.reading
    count = len(reading.used.labels)
    with new_figure(6.4 * count, 8.4) as figure:
        axes = figure.subplots(2, count, squeeze=False)
        for number, (recorded_axis, fitted_axis) in enumerate(axes.T):
            _draw_recorded(recorded_axis, reading, number)
            _draw_fitted(fitted_axis, reading, number)
    return figure


def _draw_recorded(axis: Axes, reading: Reading, number: int) -> None:
    used, unit = reading.used, stress_unit(reading.experiment.stress_unit)
    stretch, stress = reading.recorded.stretch[number], reading.recorded.stress[number] / unit.to_mpa
    axis.plot(stretch, stress, "-", color=BASE, lw=1, label="all rows")
    axis.plot(stretch[used.rows], stress[used.rows], ".", color=BAND, ms=4, label="rows used")
    for region in reading.tested[number].regions:
        if len(region.rows):
            marked = np.full(len(stress), np.nan)  # gaps between runs of rows
            marked[used.rows[region.rows]] = stress[used.rows[region.rows]]
            axis.plot(stretch, marked, label=region.kind, **REGIONS[region.kind])
    _label(axis, reading, number, "as recorded")
    axis.legend(fontsize=LETTERS)


def _draw_fitted(axis: Axes, reading: Reading, number: int) -> None:
    used, unit = reading.used, stress_unit(reading.experiment.stress_unit)
    axis.axhline(0, color=BASE, lw=0.8)
    axis.axvline(reading.experiment.mode.controls[0].reference, color=BASE, lw=0.8)
    axis.plot(used.stretch[number], used.stress[number] / unit.to_mpa, ".", color=INK, ms=4)
    _label(axis, reading, number, f"to be fitted: {len(used)} rows")


def _label(axis: Axes, reading: Reading, number: int, title: str) -> None:
    label, mode = reading.used.labels[number], reading.experiment.mode
    axis.set_title(f"{label}, {title}" if label else title, fontsize=LETTERS + 1)
    axis.set_xlabel(mode.abscissa_control.name, fontsize=LETTERS)
    axis.set_ylabel(f"engineering stress [{reading.experiment.stress_unit}]", fontsize=LETTERS)
    axis.tick_params(labelsize=LETTERS)
