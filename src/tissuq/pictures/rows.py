"""Intervals of one quantity beneath one another."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from tissuq.drawing.pieces import forest, rows
from tissuq.drawing.style import BAND, INK
from tissuq.inference.marginal import Marginal

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["intervals"]


def intervals(axis: Axes, marginals: Mapping[str, Marginal], average: Marginal, label: str, factor: float) -> None:
    """Draw means and 95 % intervals by name, and those of an average in black beneath; ``factor`` is that of a unit.

    Far ones may leave the axis, which shows every mean.
    """
    named = {**marginals, "all, by probability": average}
    levels = rows(axis, list(named))
    ends = np.array([(low, m.mean, high) for m in named.values() for low, high in [m.hdi()]]) / factor
    for number, color in ((slice(-1), BAND), (slice(-1, None), INK)):
        forest(axis, levels[number], *ends[number].T, color=color)
    axis.set_xlabel(label)
