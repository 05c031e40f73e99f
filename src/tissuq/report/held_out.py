"""How each of several tests is predicted from the others: rows for files, and the table for people."""

from __future__ import annotations

from collections.abc import Sequence

from tissuq.experiments.units import StressUnit
from tissuq.report.result import Table
from tissuq.report.tables import Row, in_unit_of, percent, significant, with_named_units

__all__ = ["held_out_files", "held_out_table"]

OF_HEADLINE = ("median", "hdi_low", "hdi_high")
"""What is said of the headline parameter from the other tests."""
NOTE = (
    "Every test is predicted by a fit of the others alone. Inside: how many of its measurements lie in the predicted "
    "band, 95 % where all is well. Extrapolated: how many lie at strains that the others did not reach. Band ±, the "
    "half width of the band, and off by, how far its middle is off: root mean squares of the measurements that are not "
    "extrapolated, relative to that of their stress; small is good."
)


def held_out_files(rows: Sequence[Row], headline: str, unit: StressUnit) -> dict[str, list[Row]]:
    """Return the rows, whose headline parameter is in MPa, as files in a unit."""
    columns = [f"{headline}_{name}" for name in OF_HEADLINE]
    return {
        "held_out.csv": with_named_units(rows, columns, unit),
        "held_out.json": in_unit_of(rows, columns, unit),
    }


def held_out_table(rows: Sequence[Row], headline: str, unit: StressUnit) -> Table:
    """Return the rows for people."""
    headers = ["discrepancy", "test left out", "measured", "inside band", "extrapolated", "band ±", "off by"]
    cells = []
    for row in rows:
        median, low, high = (significant(row[f"{headline}_{name}"] / unit.to_mpa) for name in OF_HEADLINE)
        shares = [percent(row[name]) for name in ("inside", "beyond", "half_width", "error")]
        cells.append([row["formulation"], row["test"], row["measured"], *shares, f"{median} [{low}, {high}]"])
    headers.append(f"{headline} of the others, {unit.name}")
    return Table(headers, cells, "Each test predicted from the others", (1, 2), NOTE)
