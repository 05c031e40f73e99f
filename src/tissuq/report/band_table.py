"""Bands of what draws give, along time or travel: a table of them in words, the sources of its variance, the mesh."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.drawing.style import BAND, BASE, SERIES, TRUTH
from tissuq.finite_elements.spread import band_probability
from tissuq.report.result import Number
from tissuq.report.tables import significant

if TYPE_CHECKING:
    import pandas as pd

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

OF_RANGES = (
    "After ± stands the standard error from the number of draws (bootstrap); a range is the share within one such "
    "error, where few draws put that below 0 or above 100 %."
)


def handy_unit(table: pd.DataFrame, unit: str) -> tuple[str, float]:
    """Return the unit in which the largest mean is a handy number, and how many of it are one of the given ones."""
    largest = float(table["mean"].abs().max())
    return next((pair for pair in UNITS[unit] if largest * pair[1] >= 1), UNITS[unit][-1])


def percent_of(draws: float) -> str:
    """Return the probability of the band of so many draws, in words."""
    return f"{100 * band_probability(int(draws)):.0f} %"


@dataclass(frozen=True)
class Bands:
    """Bands of a quantity, a row for each time or travel.

    Attributes
    ----------
    table : pandas.DataFrame
        Of `ModelEnsemble.table` or `Simulation.table`.
    is_shared : bool
        Whether the shares of parameters and discrepancy were computed.
    unit : str
        In which numbers are given.
    factor : float
        How many of it are one of those of the table.
    """

    table: pd.DataFrame
    is_shared: bool
    unit: str = ""
    factor: float = 1.0

    @property
    def of_several(self) -> pd.DataFrame:
        """The rows that have a band."""
        return self.table[self.table["draws"] > 1]

    @cached_property
    def last(self) -> Mapping[Any, Any]:
        """The last of these."""
        return self.of_several.iloc[-1].to_dict()

    @property
    def is_mesh_free(self) -> bool:
        """Whether there are bands for cells without size."""
        return "mesh_free_mean" in self.table

    @property
    def prefix(self) -> str:
        """What the columns of the band begin with that is shown: that for cells without size, where there is one."""
        return "mesh_free_" if self.is_mesh_free else ""

    def mesh_ratio(self, row: Any) -> Any:
        """Return what a row on the mesh, or all, is multiplied with for cells without size; 1 where not known."""
        return row["mesh_free_mean"] / row["mean"] if self.is_mesh_free else 1.0

    @property
    def mesh_change(self) -> str:
        """By how much the last row changes for cells without size."""
        return f"{100 * (self.mesh_ratio(self.last) - 1):+z.1f} %"

    @property
    def shares(self) -> list[str]:
        """The sources of variance besides noise that the table has shares of, where there are several."""
        sources = [name for name in SHARES if name in self.table and name != "noise"]
        return sources if self.is_shared or len({*sources} - {"mesh"}) > 2 else []

    @property
    def of_sources(self) -> str:
        """What is said of sources that draws have besides parameters and discrepancy."""
        return IN_THE_OTHERS if {"extrapolation", "test_scale"}.isdisjoint(self.table.columns) else OF_SOURCES

    @property
    def percent(self) -> str:
        """The probability of the band where most draws have got."""
        return percent_of(self.table["draws"].max())

    def number(self, name: str) -> Number:
        """Return the last row as a number to take home."""
        mean, low, high = (self.last[f"{self.prefix}{end}"] * self.factor for end in ("mean", "low", "high"))
        return Number(name, mean, low, high, self.unit, f"{percent_of(self.last['draws'])} band")

    def largest_share(self, names: Collection[str], of: str = "the variance") -> list[Number]:
        """Return the source with the largest share of the variance, where those of several are known."""
        row, known = self.last, [name for name in names if np.isfinite(self.last[name])]
        if len(known) < 2:
            return []
        largest = max(known, key=lambda name: float(row[name]))
        remark = f"{_share_cell(row, largest)} of {of}"
        if row[largest] - SIGNIFICANT_ERRORS * row[f"{largest}_error"] > 1:
            remark = "part of which another source takes back: what they do together is the band"
        return [Number("uncertain mostly by", LABELS[largest], remark=remark)]

    def headers(self, along: str, mean: str, percent: str, shares: Sequence[str]) -> list[str]:
        """Return the heads of the columns of `cells`: along what, and what the mean is called."""
        without = ["without discrepancy", percent] * ("without_mean" in self.table)
        labels = [LABELS[name] for name in shares]
        return [along, "draws", mean, "sd", percent, *labels, *without, *["on this mesh"] * self.is_mesh_free]

    def cells(self, row: Mapping[Any, Any], along: str, shares: Sequence[str]) -> list[str]:
        """Return a row in words: along what, number of draws, band, shares, and what else there is of it."""
        cells = [along, str(int(row["draws"])), *self.band(row), *(_share_cell(row, name) for name in shares)]
        if "without_mean" in row:
            mean, _, ends = self.band(row, "without_")
            cells += [mean, ends]
        return [*cells, *[significant(row["mean"] * self.factor)] * self.is_mesh_free]

    def band(self, row: Mapping[Any, Any], prefix: str | None = None) -> list[str]:
        """Return mean, standard deviation and ends of a band in words; of one of the mesh for cells without size."""
        factor = self.factor * (1.0 if prefix is None else self.mesh_ratio(row))
        prefix = self.prefix if prefix is None else prefix
        mean, sd, low, high = (
            significant(row.get(f"{prefix}{name}", np.nan) * factor) for name in ("mean", "sd", "low", "high")
        )
        return [mean, sd, f"{low} to {high}"]


def _share_cell(row: Mapping[Any, Any], name: str) -> str:
    """Return the share of the variance that is due to a source, with its standard error.

    Of few draws the estimate, or one error beside it, may lie below 0 or above 100 %: then a range within these stands,
    unless the share is significantly beyond, as of parts that compensate each other.
    """
    share, error = 100 * row[name], 100 * row[f"{name}_error"]
    if np.isnan(share):
        return ""
    low, high = share - error, share + error
    is_beyond = share - SIGNIFICANT_ERRORS * error > 100 or share + SIGNIFICANT_ERRORS * error < 0
    if is_beyond or not (low < 0 or high > 100):
        return f"{share:.0f} ± {error:.0f} %"
    ends = [f"{min(max(end, 0.0), 100.0):.0f}" for end in (low, high)]
    return f"{' to '.join(dict.fromkeys(ends))} %"
