"""Figures of a simulation: the band of the force, what its variance is due to, and the deformed body."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tissuq.finite_elements.case import AXIAL, RADIAL
from tissuq.finite_elements.simulation import ALONE, WITHOUT, Simulation
from tissuq.finite_elements.spread import held_probability
from tissuq.report.figures import BAND, BASE, INK, STYLE, TRUTH

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["force_unit", "simulation_figures"]

FloatArray = NDArray[np.float64]

UNITS = (("N", 1.0), ("mN", 1e3), ("µN", 1e6))
SHARES = {"parameters": BAND, "discrepancy": TRUTH, "noise": BASE}
STRAINED, MARGIN = 0.04, 0.5
"""What is shown of the body: cells with this share of the largest strain, and this much of their extent around them."""


def force_unit(table: pd.DataFrame) -> tuple[str, float]:
    """Return the unit in which the largest mean force is a handy number, and how many of it are a newton."""
    largest = float(table["mean"].abs().max())
    return next((pair for pair in UNITS if largest * pair[1] >= 1), UNITS[-1])


def simulation_figures(found: Simulation, table: pd.DataFrame) -> dict[str, Figure]:
    """Return the figures by name; that of the shares where there is a discrepancy, that of fields where any draw ended.

    Parameters
    ----------
    found : Simulation
    table : pandas.DataFrame
        Of `Simulation.table`.
    """
    from matplotlib import rc_context

    known = table[table["draws"] > 1]
    with rc_context(STYLE):
        figures = {"forces": _forces(found, known)}
        if ALONE in found.forces:
            figures["shares"] = _shares(found, known)
        if len(found.fields.get("largest", ())) > 1:
            figures["fields"] = _fields(found)
    return figures


def _forces(found: Simulation, table: pd.DataFrame) -> Figure:
    """Draw the bands of the force, and beside them what of the body is strained beyond the measurements."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.6, 3.9))
    axis, beyond = figure.subplots(1, 2, width_ratios=(1.75, 1))
    unit, factor = force_unit(table)
    at = _from_zero(table[f"{found.case.travel_name}_mm"])
    percent = f"{100 * held_probability(int(table['draws'].max())):.0f} %"
    bands = [("", "with discrepancy" if ALONE in found.forces else "posterior", BAND, "-", 0.25)]
    if WITHOUT in found.forces:
        bands.append(("without_", "fitted without discrepancy", TRUTH, "--", 0.15))
    for prefix, label, color, line, alpha in bands:
        low, mean, high = (_from_zero(table[f"{prefix}{name}"]) * factor for name in ("low", "mean", "high"))
        axis.fill_between(at, low, high, color=color, alpha=alpha, lw=0, label=f"{label}, {percent}")
        axis.plot(at, mean, line, color=color, lw=1.7, label="mean")
    axis.set_xlabel(f"{found.case.travel_name} [mm]")
    axis.set_ylabel(f"force [{unit}]")
    axis.set_xlim(0, found.case.travel)
    axis.legend(fontsize=9)
    for rows, label, color in (
        (found.energy_beyond, "of the strain energy", INK), (found.beyond, "of the volume", BASE),
    ):  # fmt: skip
        shown = np.isfinite(rows).any(axis=0)
        beyond.plot(
            _from_zero(found.travel[shown]),
            100 * _from_zero(np.nanmean(rows[:, shown], axis=0)),
            color=color,
            label=label,
        )
    beyond.set_title("Strained beyond what was measured")
    beyond.set_ylabel("mean share [%]")
    beyond.set_xlabel(f"{found.case.travel_name} [mm]")
    beyond.set_xlim(0, found.case.travel)
    beyond.set_ylim(0, 103)
    beyond.legend(fontsize=9)
    return figure


def _from_zero(values: Any) -> FloatArray:
    return np.concatenate([[0.0], np.asarray(values, dtype=np.float64)])


def _shares(found: Simulation, table: pd.DataFrame) -> Figure:
    """Draw the shares of the variance, and the standard deviations of the parts that they are made of."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.6, 3.9))
    axis, parts = figure.subplots(1, 2)
    at = table[f"{found.case.travel_name}_mm"].to_numpy()
    axis.axhline(0, color=INK, lw=0.8)
    for name, color in SHARES.items():
        share, error = (100 * table[key].to_numpy() for key in (name, f"{name}_error"))
        axis.fill_between(at, share - error, share + error, color=color, alpha=0.2, lw=0)
        axis.plot(at, share, "o-", color=color, lw=1.6, ms=3.5, label=name)
    axis.set_title("Share of the variance [%]")
    unit, factor = force_unit(table)
    sizes = {
        "force of a draw": (table["sd"], INK, "-"),
        "of its parameters alone": (table["alone_sd"], BAND, "--"),
        "what the discrepancy adds": (table["discrepancy_sd"], TRUTH, "--"),
        "noise": (np.full(len(at), found.noise_sd), BASE, "--"),
    }
    for label, (sd, color, line) in sizes.items():
        parts.plot(at, factor * np.asarray(sd), line, color=color, lw=1.7, label=label)
    parts.set_title(f"Standard deviation between draws [{unit}]")
    parts.set_ylim(0)
    for panel in (axis, parts):
        panel.set_xlim(0, found.case.travel * 1.02)
        panel.set_xlabel(f"{found.case.travel_name} [mm]")
        panel.legend(fontsize=9)
    return figure


def _fields(found: Simulation) -> Figure:
    """Draw mean and sd of the largest stretch on the mean deformed section."""
    from matplotlib.figure import Figure

    mesh, largest = found.case.mesh(), found.fields["largest"]
    deformed = mesh.points + found.fields["displacement"].mean(axis=0)
    corners = deformed[mesh.cells]
    limits = _limits(corners, largest.mean(axis=0) - 1)
    height = 3.8 * min(1.1, max(0.3, limits[3] - limits[2]) / (limits[1] - limits[0])) + 1.3
    figure = Figure(figsize=(10.4, height))
    for axis, values, title, colors in zip(
        figure.subplots(1, 2), (largest.mean(axis=0), largest.std(axis=0, ddof=1)),
        ("Largest principal stretch: mean of the draws", "and its standard deviation between draws"),
        ("viridis", "magma"), strict=True,
    ):  # fmt: skip
        _draw_section(axis, corners, values, colors, figure)
        axis.set_title(title)
        axis.set_xlim(limits[0], limits[1])
        axis.set_ylim(limits[2], limits[3])
        axis.set_xlabel("distance from the axis [mm]")
    figure.axes[0].set_ylabel("along the axis [mm]")
    return figure


def _limits(corners: FloatArray, strain: FloatArray) -> tuple[float, float, float, float]:
    """Return the part of the section that is shown: where it is strained, with some of the rest."""
    body = corners.reshape(-1, 2)
    shown = corners[strain > STRAINED * strain.max()].reshape(-1, 2)
    low, high = shown.min(axis=0), shown.max(axis=0)
    margin = MARGIN * (high - low)[AXIAL], MARGIN * high[RADIAL]
    right = min(high[RADIAL] + margin[1], body[:, RADIAL].max())
    bottom, top = max(low[AXIAL] - margin[0], body[:, AXIAL].min()), min(high[AXIAL] + margin[0], body[:, AXIAL].max())
    air = 0.03 * (top - bottom)
    return -1.02 * right, 1.02 * right, bottom - air, top + air


def _draw_section(axis: Axes, corners: FloatArray, values: FloatArray, colors: str, figure: Figure) -> None:
    """Draw both halves of a section through the axis."""
    from matplotlib.collections import PolyCollection

    half = corners[:, :, [RADIAL, AXIAL]]
    whole = np.concatenate([half, half * [-1, 1]])
    drawn = PolyCollection(
        list(whole), array=np.tile(values, 2), cmap=colors, edgecolors=(0, 0, 0, 0.25), linewidths=0.3
    )
    axis.add_collection(drawn)
    axis.set_aspect("equal")
    figure.colorbar(drawn, ax=axis, shrink=0.85)
