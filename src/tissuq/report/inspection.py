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

    stresses = inspection.reading.stresses
    with rc_context(STYLE):
        figure = Figure(figsize=(9.2, 3.9 * len(stresses)))
        for (recorded_axis, fitted_axis), stress in zip(
            figure.subplots(len(stresses), 2, squeeze=False), stresses, strict=True
        ):
            _draw_stress(recorded_axis, fitted_axis, stress)
    return figure


def _draw_stress(recorded_axis: Axes, fitted_axis: Axes, reading: Reading) -> None:
    recorded, used, unit = reading.recorded, reading.used, stress_unit(reading.experiment.stress_unit)
    prefix = f"{reading.label}, " if reading.label else ""
    controls = reading.experiment.mode.controls
    name = controls[0].name if len(controls) == 1 else "stretch"
    recorded_axis.plot(recorded.stretch, recorded.stress / unit.to_mpa, "-", color=BASE, lw=0.8, label="all rows")
    rows = used.rows
    recorded_axis.plot(
        recorded.stretch[rows], recorded.stress[rows] / unit.to_mpa, ".", color=BAND, ms=3, label="rows used"
    )
    recorded_axis.set_title(f"{prefix}as recorded")
    recorded_axis.legend(fontsize=9)
    fitted_axis.axhline(0, color=BASE, lw=0.6)
    fitted_axis.axvline(controls[0].reference, color=BASE, lw=0.6)
    fitted_axis.plot(used.stretch, used.stress / unit.to_mpa, ".", color=INK, ms=3)
    fitted_axis.set_title(f"{prefix}to be fitted: {len(used)} rows")
    for axis in (recorded_axis, fitted_axis):
        axis.set_xlabel(name)
        axis.set_ylabel(f"engineering stress [{unit.name}]")
