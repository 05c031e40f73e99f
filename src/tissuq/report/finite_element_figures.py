"""Figures of draws in finite elements: of a case, and of a user's model; and their fields as files for ParaView."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import redirect_stderr
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree.ElementTree import Element, ElementTree, SubElement, indent

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.decks.calculix_results import CELL_TYPES
from tissuq.decks.fields import FinalFields
from tissuq.decks.model_ensemble import ModelEnsemble
from tissuq.drawing import pieces
from tissuq.drawing.style import ANSWER_WIDTH, BAND, BASE, INK, TRUTH, new_figure
from tissuq.finite_elements.case import ACROSS, AXIAL, Mesh
from tissuq.finite_elements.simulation import MATERIAL_ONLY, WITHOUT, Simulation
from tissuq.report.band_table import LABELS, SHARES, Bands

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MIN_STRAIN, MARGIN = 0.04, 0.5
"""Section shown: cells with this fraction of the largest strain or more, and a margin in fractions of their extent."""


def force_figure(simulation: Simulation, bands: Bands) -> Figure:
    """Return the bands of the force, for the head of a page."""
    with new_figure(ANSWER_WIDTH, 3.9) as figure:
        _draw_forces(figure.subplots(), simulation, bands)
    return figure


def _draw_forces(axis: Axes, simulation: Simulation, bands: Bands) -> None:
    table = bands.of_several
    travel = _from_zero(table[simulation.case.travel_column])
    drawn = [(bands.prefix, "with discrepancy" if MATERIAL_ONLY in simulation.forces else "posterior", BAND, "-", 0.25)]
    if WITHOUT in simulation.forces:
        drawn.append(("without_", "fitted without discrepancy", TRUTH, "--", 0.15))
    for prefix, label, color, line, alpha in drawn:
        factor = bands.factor
        ratio = bands.mesh_ratio(table) if prefix == "without_" else 1.0
        low, mean, high = (_from_zero(table[f"{prefix}{name}"] * ratio) * factor for name in ("low", "mean", "high"))
        pieces.band(axis, travel, low, high, color=color, strength=alpha, label=f"{label}, {bands.percent}")
        pieces.line(axis, travel, mean, style=line, color=color, label="mean")
    axis.set_xlabel(f"{simulation.case.travel_name} [{simulation.case.travel_unit}]")
    axis.set_ylabel(f"{simulation.case.response} [{bands.unit}]")
    axis.set_xlim(0, simulation.case.travel)
    axis.legend(fontsize=9)


def force_and_strain_figure(simulation: Simulation, bands: Bands) -> Figure:
    """Draw the bands of the force, and beside them what of the body is strained beyond the measurements."""
    with new_figure(9.6, 3.9) as figure:
        axis, share_axis = figure.subplots(1, 2, width_ratios=(1.75, 1))
        _draw_forces(axis, simulation, bands)
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


def share_figure(simulation: Simulation, bands: Bands) -> Figure:
    """Draw the shares of the variance, and the standard deviations of the parts that they are made of."""
    with new_figure(9.6, 3.9) as figure:
        axis, sd_axis = figure.subplots(1, 2)
        table = bands.of_several
        travel = table[simulation.case.travel_column].to_numpy()
        _draw_shares(axis, simulation.case.travel_column, table)
        sizes = {
            f"{simulation.case.response} of a draw": (table["sd"], INK, "-"),
            "of its parameters alone": (table["alone_sd"], BAND, "--"),
            "what the discrepancy adds": (table["discrepancy_sd"], TRUTH, "--"),
            "noise": (np.full(len(travel), simulation.noise_sd), BASE, "--"),
        }
        for label, (sd, color, line) in sizes.items():
            sd_axis.plot(travel, bands.factor * np.asarray(sd), line, color=color, lw=1.7, label=label)
        sd_axis.set_title(f"Standard deviation between draws [{bands.unit}]")
        sd_axis.set_ylim(0)
        for panel in (axis, sd_axis):
            panel.set_xlim(0, simulation.case.travel * 1.02)
            panel.set_xlabel(f"{simulation.case.travel_name} [{simulation.case.travel_unit}]")
            panel.legend(fontsize=9)
    return figure


def _draw_shares(axis: Axes, along: str, table: pd.DataFrame) -> None:
    """Draw the shares of a variance, ± their standard errors, over a column: time or travel."""
    axis.axhline(0, color=INK, lw=0.8)
    for name, color in SHARES.items():
        if name not in table:
            continue
        share, error = (100 * table[key].to_numpy() for key in (name, f"{name}_error"))
        pieces.band(axis, table[along], share - error, share + error, color=color, strength=0.2)
        pieces.line(axis, table[along], share, color=color, label=LABELS[name], marker="o", ms=3.5)
    axis.set_title("Share of the variance [%]")
    axis.legend(fontsize=9)


def field_figure(simulation: Simulation) -> Figure:
    """Draw mean and sd of the largest stretch on the mean deformed section."""
    mesh = simulation.case.mesh()
    faces, cells = mesh.section
    largest = simulation.fields["largest"][:, cells]
    deformed = mesh.points + simulation.fields["displacement"].mean(axis=0)
    corners = deformed[faces, :2]
    limits = _limits(corners, largest.mean(axis=0) - 1, mesh.is_half)
    height = 3.8 * min(1.1, max(0.3, limits[3] - limits[2]) / (limits[1] - limits[0])) + 1.3
    with new_figure(10.4, height) as figure:
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


def write_vtu(path: Path, mesh: Mesh, points: Mapping[str, FloatArray], cells: Mapping[str, FloatArray]) -> None:
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


def moments(fields: dict[str, FloatArray]) -> dict[str, FloatArray]:
    """Return mean and standard deviation over the first axis, by labels."""
    moments = {}
    for name, values in fields.items():
        moments[f"mean {name}"] = values.mean(axis=0)
        moments[f"sd of {name}"] = values.std(axis=0, ddof=1)
    return moments


def band_over_time(bands: Bands, name: str) -> Figure:
    """Return the band of a quantity over time, for the head of a page."""
    with new_figure(ANSWER_WIDTH, 3.6) as figure:
        _draw_band(figure.subplots(), bands, name)
    return figure


def _draw_band(axis: Axes, bands: Bands, name: str) -> None:
    """Draw mean and band of a quantity over time; of a single time as an interval."""
    table = bands.of_several
    ways = [(slice(None), len(table) > 1)]
    mean, low, high = (table[f"{bands.prefix}{column}"] for column in ("mean", "low", "high"))
    pieces.band(axis, table["time"], low, high, strength=0.25, label=bands.percent, ways=ways)
    pieces.line(axis, table["time"], mean, label="mean", ways=ways)
    axis.set_xlabel("time")
    axis.set_title(name)
    axis.legend(fontsize=9)


def quantity_figure(ensemble: ModelEnsemble, bands: Bands, name: str) -> Figure:
    """Draw the band of a quantity over time, the last values, and the shares of the variance where there are any."""
    with new_figure(9.6, 3.7) as figure:
        has_shares = bool(bands.shares) and len(ensemble.times[name]) > 1
        axes = figure.subplots(1, 3 if has_shares else 2, width_ratios=(1.5, 1, 1)[: 3 if has_shares else 2])
        _draw_band(axes[0], bands, name)
        last = ensemble.last_values(name) * bands.mesh_ratio(bands.last)
        axes[1].hist(last[np.isfinite(last)], bins="auto", color=BAND, alpha=0.6, lw=0)
        axes[1].set_title(f"{name} at the end")
        axes[1].set_ylabel("draws")
        if has_shares:
            _draw_shares(axes[2], "time", bands.of_several.drop(columns="noise", errors="ignore"))
            axes[2].set_xlabel("time")
    return figure


def state_figure(
    ensemble: ModelEnsemble, fields: Sequence[FinalFields], limits: tuple[tuple[str, tuple[float, float]], ...]
) -> Figure:
    """Draw the states of the elements at the end, draws together, and what was measured of draw material."""
    from matplotlib.patches import Rectangle

    with new_figure(9.6, 3.7) as figure:
        axis, share_axis = figure.subplots(1, 2, width_ratios=(1.4, 1))
        for index, (name, (max_1, max_2)) in enumerate(limits):
            color = (BAND, TRUTH, BASE)[index % 3]
            is_ours = fields[0].materials == name
            states = np.concatenate([draw.invariants[is_ours] for draw in fields])
            axis.plot(*states.T, ".", ms=2, color=color, alpha=0.3, label=name, rasterized=True)
            axis.add_patch(Rectangle((0, 0), max_1, max_2, fill=False, ec=color, lw=1.5))
        axis.set_xlabel("I1 - 3")
        axis.set_ylabel("I2 - 3")
        axis.set_title("Elements at the end; within the frame: measured")
        axis.legend(fontsize=9, markerscale=5)
        if ensemble.beyond is not None:
            times, shares = ensemble.beyond
            shown = np.isfinite(shares).any(axis=0)
            share_axis.plot(times[shown], 100 * np.nanmean(shares[:, shown], axis=0), color=INK)
            share_axis.set_title("Elements beyond it [%]")
            share_axis.set_xlabel("time")
            share_axis.set_ylim(0, 103)
    return figure


def write_fields(path: Path, fields: Sequence[FinalFields]) -> None:
    """Write mean and standard deviation of displacement, von Mises stress and invariants over draws, for ParaView."""
    import meshio

    first_draw = fields[0]
    points = {"displacement": np.stack([draw.displacement for draw in fields])}
    if len(first_draw.von_mises):
        points["von Mises stress"] = np.stack([draw.von_mises for draw in fields])
    cells = {}
    if len(first_draw.invariants):
        cells["I1 - 3"], cells["I2 - 3"] = (np.stack([draw.invariants[:, axis] for draw in fields]) for axis in (0, 1))
    ends = np.cumsum([len(members) for members in first_draw.cells.values()])[:-1]
    blocks = [(CELL_TYPES[kind][0], members) for kind, members in first_draw.cells.items()]
    of_cells = {name: np.split(values, ends) for name, values in moments(cells).items()}
    meshio.Mesh(first_draw.points, blocks, moments(points), of_cells).write(path, file_format="vtu")
