"""The folder of an inspection: the curve as recorded and as it would be fitted, the converted data, and the text."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from tissuq.experiments.inspection import Inspection
from tissuq.experiments.units import stress_unit
from tissuq.report.common import write_data, write_figures
from tissuq.report.figures import BAND, BASE, INK, STYLE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["curve_figure", "write_inspection"]


def write_inspection(inspection: Inspection, folder: Path) -> None:
    """Write figure, converted data and text into an empty folder."""
    write_data(folder, inspection.reading.experiment)
    write_figures(folder, {"curve": curve_figure(inspection)})
    (folder / "inspection.txt").write_text(f"{inspection}\n", encoding="utf-8")


def curve_figure(inspection: Inspection) -> Figure:
    """Return two panels: every row of the file with those that are used, and these as they would be fitted."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    reading = inspection.reading
    recorded, used, unit = reading.recorded, reading.used, stress_unit(reading.experiment.stress_unit)
    with rc_context(STYLE):
        figure = Figure(figsize=(9.2, 3.9))
        left, right = figure.subplots(1, 2)
        left.plot(recorded.stretch, recorded.stress / unit.to_mpa, "-", color=BASE, lw=0.8, label="all rows")
        kept = used.rows
        left.plot(recorded.stretch[kept], recorded.stress[kept] / unit.to_mpa, ".", color=BAND, ms=3, label="rows used")
        left.set_title("as recorded")
        left.legend(fontsize=9)
        right.axhline(0, color=BASE, lw=0.6)
        right.axvline(1, color=BASE, lw=0.6)
        right.plot(used.stretch, used.stress / unit.to_mpa, ".", color=INK, ms=3)
        right.set_title(f"to be fitted: {len(used)} rows")
        for axis in (left, right):
            axis.set_xlabel("stretch")
            axis.set_ylabel(f"engineering stress [{unit.name}]")
    return figure
