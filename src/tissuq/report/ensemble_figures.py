"""Figures of an ensemble of a user's model (bands, last values, shares of the variance, states), and its fields."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tissuq.decks.calculix_results import CELL_TYPES
from tissuq.decks.fields import FinalFields
from tissuq.decks.model_ensemble import ModelEnsemble
from tissuq.drawing import pieces
from tissuq.drawing.style import ANSWER_WIDTH, BAND, BASE, INK, TRUTH, new_figure
from tissuq.report.band_table import Bands
from tissuq.report.simulation_figures import draw_shares, moments

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["band_over_time", "quantity_figure", "state_figure", "write_fields"]


def band_over_time(bands: Bands, name: str) -> Figure:
    """Return the band of a quantity over time, for the head of a page."""
    with new_figure(ANSWER_WIDTH, 3.6) as figure:
        _draw_band(figure.subplots(), bands, name)
    return figure


def _draw_band(axis: Axes, bands: Bands, name: str) -> None:
    """Draw mean and band of a quantity over time; of a single time as an interval."""
    table = bands.of_several
    is_path = len(table) > 1
    mean, low, high = (table[f"{bands.prefix}{column}"] for column in ("mean", "low", "high"))
    pieces.band(axis, table["time"], low, high, strength=0.25, label=bands.percent, is_path=is_path)
    pieces.line(axis, table["time"], mean, label="mean", is_path=is_path)
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
            draw_shares(axes[2], "time", bands.of_several.drop(columns="noise", errors="ignore"))
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
