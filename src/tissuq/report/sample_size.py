"""How many specimens are needed, as a table for people."""

from __future__ import annotations

from math import isnan
from typing import TYPE_CHECKING

from tissuq.population.sample_size import MAX_SPECIMENS
from tissuq.report.result import Table
from tissuq.report.tables import percent
from tissuq.studies.population import PopulationStudy

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["needed_of", "needed_table_of"]

HEADERS = ["parameter", "quantity", "now", "with any number", "specimens in all", "more"]
QUANTITIES = {"median": "median of the population", "new patient": "a new patient"}


def needed_of(study: PopulationStudy) -> pd.DataFrame | None:
    """Return `Population.specimens_needed` for the aim of the settings, if there is one."""
    aim = study.settings.aim
    return None if aim is None else study.population.specimens_needed(aim)


def needed_table_of(study: PopulationStudy, needed: pd.DataFrame | None) -> tuple[Table, ...]:
    """Return the table of how many specimens are needed; none without an aim."""
    if needed is None:
        return ()
    aim, rows = float(study.settings.aim or 0.0), []
    for row in needed.reset_index().to_dict("records"):
        total, floor = float(row["specimens"]), float(row["floor"])
        none = "not reached: patients differ more" if floor else f"more than {MAX_SPECIMENS}"
        cells = [none, ""] if isnan(total) else [f"{total:.0f}", f"{row['more']:.0f}"]
        shown = [f"± {percent(row['now'])}", f"± {percent(floor)}" if floor else ""]
        rows.append([str(row["parameter"]), QUANTITIES[str(row["quantity"])], *shown, *cells])
    return (
        Table(
            HEADERS, rows, f"Specimens like these for ± {percent(aim)} (95 %)", (1, 4),
            "Half the interval over the median. With so many specimens four of five populations reach the aim. However "
            "many there are, patients differ as much as they do. By how much is not known well from few specimens, so "
            "that the interval of a new patient with any number, which holds in four of five, may be wider than now.",
        ),
    )  # fmt: skip
