"""Panels of a figure: axes that a user gives, or new ones of a size, with a strip beneath each where wanted."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import ceil
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from tissuq.arrays import FloatArray
from tissuq.drawing.style import COLUMN, PAGE, PAPER, STYLE, new_figure
from tissuq.errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

MAX_COLUMNS = 3
"""Panels side by side."""
PANEL_HEIGHT, STRIP_HEIGHT, LEGEND_HEIGHT = 2.1, 0.75, 0.5
"""Inches of a figure, as users draw them."""
LABEL_LETTERS, LETTER_WIDTH = 11, 0.56
"""Letters that would fit beside the axes of a panel, and width of a letter over its size."""
SMALL = (3.8, 2.3)
"""Inches of a small figure of one panel."""
SMALLER, LEGEND_MARK = 0.833, 7
"""Size of small letters over the usual one, and letters that stand for a mark of the legend and the gap beside it."""
STRIP_SHARE = 0.3
"""Height of a strip over that of its panel."""
MARGIN = 0.5
"""Of what is beyond measurements and medians, over their range: how much of it an axis shows at the most."""


@dataclass(frozen=True, eq=False)
class Panels:
    """Axes to draw on.

    Attributes
    ----------
    axes : list of Axes
    strips : list of Axes
        One beneath each of the axes, or none.
    is_new : bool
        Whether the figure was made for them.
    """

    axes: list[Axes]
    strips: list[Axes] = field(default_factory=list)
    is_new: bool = True

    @property
    def result(self) -> Any:
        """The axes as a user gets them: one by itself, several as an array."""
        if len(self.axes) == 1:
            return self.axes[0]
        several = np.empty(len(self.axes), dtype=object)
        several[:] = self.axes
        return several

    @property
    def letters(self) -> int:
        """How many letters of a title fit above a panel of a new figure."""
        return int(self._letters_across / self.columns - LABEL_LETTERS)

    @property
    def _letters_across(self) -> float:
        """How many letters fit across a new figure."""
        from matplotlib import rcParams

        inches = self.axes[0].figure.get_figwidth()  # type: ignore[union-attr]
        return float(72 * inches / (LETTER_WIDTH * rcParams["font.size"]))

    @property
    def columns(self) -> int:
        """How many panels of a new figure stand side by side; one of axes that are a user's."""
        grid = self.axes[0].get_gridspec() if self.is_new else None
        return grid.ncols if grid else 1

    @property
    def lowest(self) -> list[Axes]:
        """The axes or strips whose horizontal axes are labelled."""
        return self.strips or self.axes

    def explain(self, columns: int | None = None) -> None:
        """Say what the panels show: above a new figure, and where there is room within a user's first axes."""
        labels = [label for axis in self.axes for label in axis.get_legend_handles_labels()[1]]
        if not labels:
            return
        if self.is_new:
            fitting = int(self._letters_across / (SMALLER * (max(map(len, labels)) + LEGEND_MARK)))
            across = max(1, min(columns or (2 if self.columns == 1 else 4), fitting))
            legend_above(self.axes[0].figure, self.axes, across, font_size="small")
        else:
            self.axes[0].legend(loc="best", fontsize="small")


def shortened(text: str, letters: int) -> str:
    """Return a text that has at most so many letters, without some in its middle where it is longer.

    Examples
    --------
    >>> shortened("rubber-treloar-equibiaxial", 12)
    'rubber…axial'
    """
    half = max(letters - 1, 2) // 2
    return text if len(text) <= letters else f"{text[: max(letters, 3) - 1 - half]}…{text[-half:]}"


def columns_of(count: int) -> int:
    """Return how many of so many panels stand side by side."""
    return 1 if count == 1 else 2 if count in (2, 4) else MAX_COLUMNS


def on_figure(figure: Figure, count: int, columns: int, *, has_strips: bool = False) -> Panels:
    """Return panels on an empty figure, row by row."""
    down = ceil(count / columns)
    heights = [1.0, STRIP_SHARE] if has_strips else [1.0]
    grid = figure.add_gridspec(len(heights) * down, columns, height_ratios=heights * down)
    axes, strips = list[Any](), list[Any]()
    for number in range(count):
        row, column = divmod(number, columns)
        axes.append(figure.add_subplot(grid[len(heights) * row, column]))
        if has_strips:
            strips.append(figure.add_subplot(grid[2 * row + 1, column], sharex=axes[-1]))
            axes[-1].tick_params(labelbottom=False)
    return Panels(axes, strips)


@contextmanager
def panels(ax: Any, count: int, *, has_strips: bool = False, height: float = PANEL_HEIGHT) -> Iterator[Panels]:
    """Give a user's axes, or those of a new figure in the style of a paper, which `matplotlib.pyplot` shows.

    Parameters
    ----------
    ax : Axes, or array or sequence of Axes, or None
    count : int
        Number of panels.
    has_strips : bool
        Whether a new figure has a strip beneath each panel.
    height : float
        Of a panel of a new figure, inches, which is as wide as a column of a paper for one panel, else as a page.

    Raises
    ------
    InputError
        When the user gives fewer axes than there are panels, or something else.
    """
    if ax is not None:
        axes = list(np.ravel(np.asarray(ax, dtype=object)))
        if not all(hasattr(axis, "fill_between") for axis in axes):
            raise InputError(f"ax must be Matplotlib's axes, such as plt.subplots()[1], not {ax!r:.60}.")
        if len(axes) < count:
            raise InputError(
                f"this is drawn in {count} panels, and ax holds {len(axes)}: give ax=plt.subplots(1, {count})[1], or "
                "leave ax out."
            )
        yield Panels(axes[:count], is_new=False)
        return
    from matplotlib import pyplot as plt
    from matplotlib import rc_context

    columns = columns_of(count)
    down = ceil(count / columns)
    tall = down * (height + STRIP_HEIGHT * has_strips) + LEGEND_HEIGHT
    with rc_context(PAPER):
        figure = plt.figure(figsize=(COLUMN if columns == 1 else PAGE, tall))
        try:
            yield on_figure(figure, count, columns, has_strips=has_strips)
        except BaseException:
            plt.close(figure)  # an empty one would be shown
            raise


@contextmanager
def small_panels(count: int) -> Iterator[tuple[Figure, Panels]]:
    """Give panels side by side on a small figure for a table in a notebook, which no layout engine spends time on."""
    width, height = SMALL[0] * (1 + 0.7 * (count - 1)), SMALL[1]
    style = STYLE | {"font.size": 9, "axes.titlesize": 9, "figure.constrained_layout.use": False}
    with new_figure(width, height, style) as figure:
        figure.subplots_adjust(0.62 / width, 0.46 / height, 1 - 0.1 / width, 1 - 0.26 / height, wspace=0.28)
        yield figure, Panels(list(figure.subplots(1, count, squeeze=False)[0]))


def legend_above(
    figure: Figure | SubFigure | Any,
    axes: Iterable[Axes],
    columns: int | None = None,
    *,
    font_size: float | str = 9,
) -> None:
    """Explain above a figure what its panels show, every label once, in at most so many columns."""
    handles: dict[str, Any] = {}
    for axis in axes:
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    count = min(columns or len(handles), len(handles))
    figure.legend(list(handles.values()), list(handles), loc="outside upper center", ncols=count, fontsize=font_size)


def limits_of(core: Sequence[ArrayLike], beyond: Sequence[ArrayLike], margin: float = MARGIN) -> tuple[float, float]:
    """Return the ends of an axis that shows all of its core, and what is beyond as far as a margin allows.

    Parameters
    ----------
    core : sequence of array
        Such as measurements and medians.
    beyond : sequence of array
        Such as the ends of bands, which may be anywhere.
    margin : float
        Over the range of the core.

    Examples
    --------
    >>> low, high = limits_of([[0.0, 1.0]], [[-0.2], [1e6]])
    >>> round(low, 3), round(high, 3)
    (-0.268, 1.568)
    """
    values = np.concatenate([np.ravel(array) for array in core]).astype(np.float64)
    values = values[np.isfinite(values)]
    low, high = float(values.min()), float(values.max())
    allowed = margin * ((high - low) or abs(high) or 1.0)
    ends = np.concatenate([np.ravel(array) for array in beyond] or [values]).astype(np.float64)
    ends = np.clip(ends[np.isfinite(ends)], low - allowed, high + allowed)
    low, high = min(low, float(ends.min(initial=low))), max(high, float(ends.max(initial=high)))
    air = 0.04 * ((high - low) or 1.0)
    return low - air, high + air


def within(values: ArrayLike, limits: tuple[float, float]) -> FloatArray:
    """Return values cut where they have long left an axis: no renderer takes any number."""
    low, high = limits
    return np.clip(np.asarray(values, dtype=np.float64), low - 5 * (high - low), high + 5 * (high - low))
