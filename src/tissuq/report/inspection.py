"""The folder of an inspection: the curve as recorded and as it would be fitted, the converted data, and the text."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from tissuq.experiments.reading.experiment_file import Reading
from tissuq.experiments.reading.inspection import Inspection
from tissuq.experiments.reading.units import stress_unit
from tissuq.report.figures import BAND, BASE, INK, STYLE
from tissuq.report.run_folder import write_data, write_figures

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["curve_figure", "write_inspection"]


def write_inspection(inspection: Inspection, folder: Path) -> None:
    """Write figure, converted data and text into an empty folder."""
    write_data(folder, inspection.reading.experiment)
    write_figures(folder, {"curve": curve_figure(inspection)})
    (folder / "inspection.txt").write_text(f"{inspection}\n", encoding="utf-8")


def curve_figure(inspection: Inspection) -> Figure:
    """Return two panels: every row of the file with those that are used, and these as they would be fitted.

    Of a loading mode with two stresses, two for each.
    """
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    reading = inspection.reading
    count = len(reading.used.labels)
    with rc_context(STYLE):
        figure = Figure(figsize=(9.2, 3.9 * count))
        for number, (recorded_axis, fitted_axis) in enumerate(figure.subplots(count, 2, squeeze=False)):
            _draw_stress(recorded_axis, fitted_axis, reading, number)
    return figure


def _draw_stress(recorded_axis: Axes, fitted_axis: Axes, reading: Reading, number: int) -> None:
    used, unit = reading.used, stress_unit(reading.experiment.stress_unit)
    stretch, stress = reading.recorded.stretch[number], reading.recorded.stress[number] / unit.to_mpa
    prefix = f"{used.labels[number]}, " if used.labels[number] else ""
    controls = reading.experiment.mode.controls
    name = controls[0].name if len(controls) == 1 else "stretch"
    recorded_axis.plot(stretch, stress, "-", color=BASE, lw=0.8, label="all rows")
    recorded_axis.plot(stretch[used.rows], stress[used.rows], ".", color=BAND, ms=3, label="rows used")
    recorded_axis.set_title(f"{prefix}as recorded")
    recorded_axis.legend(fontsize=9)
    fitted_axis.axhline(0, color=BASE, lw=0.6)
    fitted_axis.axvline(controls[0].reference, color=BASE, lw=0.6)
    fitted_axis.plot(used.stretch[number], used.stress[number] / unit.to_mpa, ".", color=INK, ms=3)
    fitted_axis.set_title(f"{prefix}to be fitted: {len(used)} rows")
    for axis in (recorded_axis, fitted_axis):
        axis.set_xlabel(name)
        axis.set_ylabel(f"engineering stress [{unit.name}]")
