"""Figures of a simulation (force, sources of its variance, deformed body), and its fields as files for ParaView."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from contextlib import redirect_stderr
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree.ElementTree import Element, ElementTree, SubElement, indent

import numpy as np
from numpy.typing import NDArray

from tissuq.drawing import pieces
from tissuq.drawing.style import ANSWER_WIDTH, BAND, BASE, INK, SERIES, STYLE, TRUTH, new_figure
from tissuq.finite_elements.case import ACROSS, AXIAL, Mesh
from tissuq.finite_elements.simulation import MATERIAL_ONLY, WITHOUT, Simulation
from tissuq.finite_elements.spread import band_probability

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "LABELS",
    "SHARES",
    "draw_shares",
    "force_figure",
    "handy_unit",
    "is_mesh_free",
    "mesh_ratio",
    "of_sources",
    "prefix_of",
    "shares_in",
    "simulation_figures",
    "write_collection",
    "write_vtu",
]

FloatArray = NDArray[np.float64]

UNITS = {"N": (("N", 1.0), ("mN", 1e3), ("µN", 1e6)), "mm": (("mm", 1.0), ("µm", 1e3))}
SHARES = {
    "parameters": BAND, "discrepancy": TRUTH, "extrapolation": SERIES[2], "test_scale": SERIES[3], "mesh": SERIES[4],
    "noise": BASE,
}  # fmt: skip
"""Colours of what a variance is due to."""
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
MIN_STRAIN, MARGIN = 0.04, 0.5
"""Section shown: cells with this fraction of the largest strain or more, and a margin in fractions of their extent."""


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


def simulation_figures(simulation: Simulation, table: pd.DataFrame) -> dict[str, Figure]:
    """Return the figures by name; that of the shares where there is a discrepancy, that of fields where any draw ended.

    Parameters
    ----------
    found : Simulation
    table : pandas.DataFrame
        Of `Simulation.table`.
    """
    from matplotlib import rc_context

    table_of_bands = table[table["draws"] > 1]
    with rc_context(STYLE):
        figures = {"forces": _forces(simulation, table_of_bands)}
        if MATERIAL_ONLY in simulation.forces:
            figures["shares"] = _shares(simulation, table_of_bands)
        if len(simulation.fields.get("largest", ())) > 1 and len(simulation.case.mesh().section[0]):
            figures["fields"] = _fields(simulation)
    return figures


def force_figure(simulation: Simulation, table: pd.DataFrame) -> Figure:
    """Return the bands of the force, for the head of a page."""
    with new_figure(ANSWER_WIDTH, 3.9) as figure:
        _draw_forces(figure.subplots(), simulation, table[table["draws"] > 1])
    return figure


def _draw_forces(axis: Axes, simulation: Simulation, table: pd.DataFrame) -> None:
    unit, factor = handy_unit(table, simulation.case.response_unit)
    travel = _from_zero(table[simulation.case.travel_column])
    percent = f"{100 * band_probability(int(table['draws'].max())):.0f} %"
    bands = [
        (prefix_of(table), "with discrepancy" if MATERIAL_ONLY in simulation.forces else "posterior", BAND, "-", 0.25)
    ]
    if WITHOUT in simulation.forces:
        bands.append(("without_", "fitted without discrepancy", TRUTH, "--", 0.15))
    ratio = table["mesh_free_mean"] / table["mean"] if is_mesh_free(table) else 1.0
    for prefix, label, color, line, alpha in bands:
        times = ratio if prefix == "without_" else 1.0
        low, mean, high = (_from_zero(table[f"{prefix}{name}"] * times) * factor for name in ("low", "mean", "high"))
        pieces.band(axis, travel, low, high, color=color, strength=alpha, label=f"{label}, {percent}")
        pieces.line(axis, travel, mean, style=line, color=color, label="mean")
    axis.set_xlabel(f"{simulation.case.travel_name} [{simulation.case.travel_unit}]")
    axis.set_ylabel(f"{simulation.case.response} [{unit}]")
    axis.set_xlim(0, simulation.case.travel)
    axis.legend(fontsize=9)


def _forces(simulation: Simulation, table: pd.DataFrame) -> Figure:
    """Draw the bands of the force, and beside them what of the body is strained beyond the measurements."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.6, 3.9))
    axis, share_axis = figure.subplots(1, 2, width_ratios=(1.75, 1))
    _draw_forces(axis, simulation, table)
    for rows, label, color in (
        (simulation.energy_beyond, "of the strain energy", INK), (simulation.volume_beyond, "of the volume", BASE),
    ):  # fmt: skip
        shown = np.isfinite(rows).any(axis=0)
        share_axis.plot(
            _from_zero(simulation.travel[shown]),
            100 * _from_zero(np.nanmean(rows[:, shown], axis=0)),
            color=color,
            label=label,
        )
    share_axis.set_title("Strained beyond the measured range")
    share_axis.set_ylabel("mean share [%]")
    share_axis.set_xlabel(f"{simulation.case.travel_name} [{simulation.case.travel_unit}]")
    share_axis.set_xlim(0, simulation.case.travel)
    share_axis.set_ylim(0, 103)
    share_axis.legend(fontsize=9)
    return figure


def _from_zero(values: Any) -> FloatArray:
    return np.concatenate([[0.0], np.asarray(values, dtype=np.float64)])


def _shares(simulation: Simulation, table: pd.DataFrame) -> Figure:
    """Draw the shares of the variance, and the standard deviations of the parts that they are made of."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.6, 3.9))
    axis, sd_axis = figure.subplots(1, 2)
    travel = table[simulation.case.travel_column].to_numpy()
    draw_shares(axis, travel, table, SHARES)
    unit, factor = handy_unit(table, simulation.case.response_unit)
    sizes = {
        f"{simulation.case.response} of a draw": (table["sd"], INK, "-"),
        "of its parameters alone": (table["alone_sd"], BAND, "--"),
        "what the discrepancy adds": (table["discrepancy_sd"], TRUTH, "--"),
        "noise": (np.full(len(travel), simulation.noise_sd), BASE, "--"),
    }
    for label, (sd, color, line) in sizes.items():
        sd_axis.plot(travel, factor * np.asarray(sd), line, color=color, lw=1.7, label=label)
    sd_axis.set_title(f"Standard deviation between draws [{unit}]")
    sd_axis.set_ylim(0)
    for panel in (axis, sd_axis):
        panel.set_xlim(0, simulation.case.travel * 1.02)
        panel.set_xlabel(f"{simulation.case.travel_name} [{simulation.case.travel_unit}]")
        panel.legend(fontsize=9)
    return figure


def draw_shares(axis: Axes, along: Any, table: pd.DataFrame, colors: Mapping[str, str]) -> None:
    """Draw the shares of a variance, ± their standard errors, over time or travel."""
    axis.axhline(0, color=INK, lw=0.8)
    for name, color in colors.items():
        if name not in table:
            continue
        share, error = (100 * table[key].to_numpy() for key in (name, f"{name}_error"))
        pieces.band(axis, along, share - error, share + error, color=color, strength=0.2)
        pieces.line(axis, along, share, color=color, label=LABELS[name], marker="o", ms=3.5)
    axis.set_title("Share of the variance [%]")
    axis.legend(fontsize=9)


def _fields(simulation: Simulation) -> Figure:
    """Draw mean and sd of the largest stretch on the mean deformed section."""
    from matplotlib.figure import Figure

    mesh = simulation.case.mesh()
    faces, cells = mesh.section
    largest = simulation.fields["largest"][:, cells]
    deformed = mesh.points + simulation.fields["displacement"].mean(axis=0)
    corners = deformed[faces, :2]
    limits = _limits(corners, largest.mean(axis=0) - 1, mesh.is_half)
    height = 3.8 * min(1.1, max(0.3, limits[3] - limits[2]) / (limits[1] - limits[0])) + 1.3
    figure = Figure(figsize=(10.4, height))
    for axis, values, title, colors in zip(
        figure.subplots(1, 2), (largest.mean(axis=0), largest.std(axis=0, ddof=1)),
        ("Largest principal stretch: mean of the draws", "and its standard deviation between draws"),
        ("viridis", "magma"), strict=True,
    ):  # fmt: skip
        _draw_section(axis, corners, values, colors, figure, mesh.is_half)
        axis.set_title(title)
        axis.set_xlim(limits[0], limits[1])
        axis.set_ylim(limits[2], limits[3])
        axis.set_xlabel("distance from the axis [mm]" if mesh.is_half else "across the axis [mm]")
    figure.axes[0].set_ylabel("along the axis [mm]")
    return figure


def _limits(corners: FloatArray, strain: FloatArray, is_half: bool) -> tuple[float, float, float, float]:
    """Return the part of the section that is shown: where it is strained, with some of the rest."""
    body = corners.reshape(-1, 2)
    shown = corners[strain > MIN_STRAIN * strain.max()].reshape(-1, 2)
    low, high = shown.min(axis=0), shown.max(axis=0)
    margin = MARGIN * (high - low)[AXIAL], MARGIN * (high[ACROSS] if is_half else (high - low)[ACROSS])
    right = min(high[ACROSS] + margin[1], body[:, ACROSS].max())
    left = -right if is_half else max(low[ACROSS] - margin[1], body[:, ACROSS].min())
    bottom, top = max(low[AXIAL] - margin[0], body[:, AXIAL].min()), min(high[AXIAL] + margin[0], body[:, AXIAL].max())
    air, aside = 0.03 * (top - bottom), 0.01 * (right - left)
    return left - aside, right + aside, bottom - air, top + air


def _draw_section(
    axis: Axes, corners: FloatArray, values: FloatArray, colors: str, figure: Figure, is_half: bool
) -> None:
    """Draw a section, or both of its halves."""
    from matplotlib.collections import PolyCollection

    section = corners[:, :, [ACROSS, AXIAL]]
    if is_half:
        section, values = np.concatenate([section, section * [-1, 1]]), np.tile(values, 2)
    drawn = PolyCollection(list(section), array=values, cmap=colors, edgecolors=(0, 0, 0, 0.25), linewidths=0.3)
    axis.add_collection(drawn)
    axis.set_aspect("equal")
    figure.colorbar(drawn, ax=axis, shrink=0.85)


def write_vtu(
    path: Path, mesh: Mesh, points: Mapping[str, NDArray[np.float64]], cells: Mapping[str, NDArray[np.float64]]
) -> None:
    """Write a mesh with fields of its points and its cells; unless it has axes of its own, y is along the axis.

    Fields of points with several columns are displacements with the axes of the mesh, and become vectors.
    """
    import meshio

    fields = {name: mesh.vectors(values) if values.ndim > 1 else values for name, values in points.items()}
    blocks = {name: [values] for name, values in cells.items()}
    written = meshio.Mesh(mesh.vectors(mesh.points), [(mesh.kind.meshio, mesh.cells)], fields, blocks)
    with redirect_stderr(StringIO()):  # meshio warns that text takes more room
        written.write(path, file_format="vtu", binary=False)


def write_collection(path: Path, files: Sequence[tuple[float, str]]) -> None:
    """Write what ParaView opens as one series: times, and files relative to this one."""
    file = Element("VTKFile", type="Collection", version="0.1", byte_order="LittleEndian")
    collection = SubElement(file, "Collection")
    for time, name in files:
        SubElement(collection, "DataSet", timestep=f"{time:.12g}", part="0", file=name)
    indent(file)
    ElementTree(file).write(path, encoding="utf-8", xml_declaration=True)
