"""Tables of bands in words: what a row says of an interval, of the sources of its variance and of the mesh."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.drawing.style import BAND, BASE, SERIES, TRUTH
from tissuq.finite_elements.spread import band_probability
from tissuq.report.result import Number
from tissuq.report.tables import significant

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "LABELS",
    "SHARES",
    "band_cells",
    "handy_unit",
    "is_mesh_free",
    "largest_share",
    "last_row",
    "mesh_change",
    "mesh_ratio",
    "of_sources",
    "percent_of",
    "prefix_of",
    "share_cell",
    "shares_in",
]

UNITS = {"N": (("N", 1.0), ("mN", 1e3), ("µN", 1e6)), "mm": (("mm", 1.0), ("µm", 1e3))}
SHARES = {
    "parameters": BAND, "discrepancy": TRUTH, "extrapolation": SERIES[2], "test_scale": SERIES[3], "mesh": SERIES[4],
    "noise": BASE,
}  # fmt: skip
"""Colours of what a variance is due to."""
SIGNIFICANT_ERRORS = 2.0
"""Standard errors by which a share is above the whole before that is said."""
LABELS = {name: name for name in SHARES} | {"test_scale": "scale of tests"}
OF_SOURCES = (
    "What draws differ by independently of these is taken out first: **extrapolation**, how they go on beyond the "
    "measured range, and the **scale of tests**, the factor that all tests have in common (area, load cell; of a "
    "tissue the difference between specimens, too)."
)
IN_THE_OTHERS = (
    "How draws go on beyond the measured range, and the factor that all tests have in common, are within these shares: "
    "it takes more draws to tell them apart."
)


def handy_unit(table: pd.DataFrame, unit: str) -> tuple[str, float]:
    """Return the unit in which the largest mean is a handy number, and how many of it are one of the given ones."""
    largest = float(table["mean"].abs().max())
    return next((pair for pair in UNITS[unit] if largest * pair[1] >= 1), UNITS[unit][-1])


def is_mesh_free(table: Collection[str] | pd.DataFrame) -> bool:
    """Return whether there are bands for cells without size."""
    return "mesh_free_mean" in table


def prefix_of(table: Collection[str] | pd.DataFrame) -> str:
    """Return what the columns of the band begin with that is shown: that for cells without size, where there is one."""
    return "mesh_free_" if is_mesh_free(table) else ""


def mesh_ratio(row: Mapping[str, Any]) -> float:
    """Return what a force on the mesh is multiplied with for cells without size; 1 where that is not known."""
    return float(row["mesh_free_mean"] / row["mean"]) if "mesh_free_mean" in row else 1.0


def shares_in(table: Collection[str] | pd.DataFrame, *, is_shared: bool) -> list[str]:
    """Return the sources of variance that a table, or a row of one, has shares of, where there are several."""
    sources = [name for name in SHARES if name in table and name != "noise"]
    return sources if is_shared or len({*sources} - {"mesh"}) > 2 else []


def of_sources(table: pd.DataFrame) -> str:
    """Return what is said of sources that draws have besides parameters and discrepancy."""
    return IN_THE_OTHERS if {"extrapolation", "test_scale"}.isdisjoint(table.columns) else OF_SOURCES


def last_row(table: pd.DataFrame) -> dict[str, Any]:
    """Return the last row of a table that has a band."""
    return {str(key): value for key, value in table[table["draws"] > 1].iloc[-1].items()}


def percent_of(draws: float) -> str:
    """Return the probability of the band of so many draws, in words."""
    return f"{100 * band_probability(int(draws)):.0f} %"


def band_cells(row: Mapping[str, Any], factor: float = 1.0, prefix: str = "") -> list[str]:
    """Return mean, standard deviation and ends of a band, times a factor, in words."""
    mean, sd, low, high = (
        significant(row.get(f"{prefix}{name}", np.nan) * factor) for name in ("mean", "sd", "low", "high")
    )
    return [mean, sd, f"{low} to {high}"]


def share_cell(row: Mapping[str, Any], name: str) -> str:
    """Return the share of the variance that is due to a source, with its standard error, in words."""
    share, error = row[name], row[f"{name}_error"]
    return "" if np.isnan(share) else f"{100 * share:.0f} ± {100 * error:.0f} %"


def largest_share(row: Mapping[str, Any], names: Collection[str], of: str = "the variance") -> list[Number]:
    """Return the source with the largest share of the variance, where those of several are known."""
    known = [name for name in names if np.isfinite(row[name])]
    if len(known) < 2:
        return []
    largest = max(known, key=lambda name: float(row[name]))
    remark = f"{share_cell(row, largest)} of {of}"
    if row[largest] - SIGNIFICANT_ERRORS * row[f"{largest}_error"] > 1:
        remark = "part of which another source takes back: what they do together is the band"
    return [Number("uncertain mostly by", LABELS[largest], remark=remark)]


def mesh_change(row: Mapping[str, Any]) -> str:
    """Return by how much what is computed changes for cells without size, in words."""
    return f"{100 * (mesh_ratio(row) - 1):+.1f} %"
