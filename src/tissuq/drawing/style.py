"""The style of all figures: colours that the colour-blind tell apart, letters, line widths and the sizes of a paper."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INK, BAND, BASE, TRUTH, UNSTABLE = "#222222", "#0072B2", "#8a8a8a", "#D55E00", "#E69F00"
"""What was measured; what is predicted; what is for orientation; what else is compared; where stability is lost."""
SERIES = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Colours of things side by side (Okabe & Ito 2008)."""
MARKERS = "osD^vP*"
"""Marks of things side by side."""
COLUMN, PAGE = 89 / 25.4, 183 / 25.4
"""Widths of a column and of a page of a journal, inches."""
ANSWER_WIDTH = 4.6
"""Width of a figure beside the answer of a page, whose letters can be read on a screen of 400 px; inches."""
BASE_SIZE = 10
"""Size of letters, in points, to which widths of lines and sizes of marks are given."""
STYLE: dict[Any, Any] = {
    "font.size": BASE_SIZE,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#666666",
    "axes.titlesize": 10.5,
    "axes.titlelocation": "left",
    "legend.frameon": False,
    "text.parse_math": False,  # a dollar sign in the name of a file is one
    "svg.fonttype": "path",
    "svg.hashsalt": "tissuq",
    "figure.constrained_layout.use": True,
}
"""Of the figures of reports."""
PAPER: dict[Any, Any] = STYLE | {
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "figure.dpi": 150,
    "savefig.dpi": 300,
}
"""Of figures that fit a column of a paper, as users draw them."""


def relative_size() -> float:
    """Return the size of letters over that to which widths of lines and sizes of marks are given."""
    from matplotlib import rcParams

    return float(rcParams["font.size"]) / BASE_SIZE


@contextmanager
def new_figure(width: float, height: float, style: dict[Any, Any] = STYLE) -> Iterator[Figure]:
    """Give an empty figure, its sizes in inches, to draw on in a style; Matplotlib's windows know nothing of it."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(style):
        yield Figure(figsize=(width, height))


def save_figure(figure: Figure, folder: Path, name: str) -> None:
    """Write a figure as SVG and PNG, the same bytes for the same figure."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    with rc_context(STYLE):
        _write_svg(figure, folder / f"{name}.svg")
        figure.set_layout_engine("none")  # the layout of the first file is that of the second
        figure.dpi = 150
        write_png: Callable[..., None] = FigureCanvasAgg(figure).print_png
        write_png(folder / f"{name}.png", metadata={"Software": None})


def inline_svg(figure: Figure, words: str) -> str:
    """Return a figure as SVG for a page of HTML, with words for those who cannot see it; its letters are text."""
    from matplotlib import rc_context

    written = StringIO()
    with rc_context(STYLE | {"svg.fonttype": "none"}):
        _write_svg(figure, written)
    text = written.getvalue()
    return text[text.index("<svg") :].replace("<svg ", f'<svg role="img" aria-label="{words}" ', 1)


def _write_svg(figure: Figure, target: Path | StringIO) -> None:
    """Write a figure by its canvas, which draws once, where `Figure.savefig` draws twice."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    write: Callable[..., None] = FigureCanvasSVG(figure).print_svg  # to which Matplotlib gives no types
    write(target, metadata={"Date": None, "Creator": None})
