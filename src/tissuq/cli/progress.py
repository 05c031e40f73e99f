"""What is shown while a command works: its steps on a terminal, and how long a campaign will still take."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic

__all__ = ["campaign_progress", "progress"]


@contextmanager
def progress(total: int | None = None) -> Iterator[Callable[[str], None]]:
    """Show the steps of a long run on a terminal; give the function that announces the next step."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("starting", total=total)
        started = 0

        def step(text: str) -> None:
            nonlocal started
            bar.update(task, description=text, completed=started)
            started += 1

        yield step


@contextmanager
def campaign_progress(total: int) -> Iterator[Callable[[str, bool], None]]:
    """Show how much of a campaign is done and how long it will still take; give the function to call after each task.

    Tasks that an earlier run had done count as done, but not in the estimate of the time.
    """
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("{task.description}", markup=False))
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        shown = bar.add_task("", total=total)
        start, finished, computed = monotonic(), 0, 0

        def step(text: str, is_new: bool) -> None:
            nonlocal finished, computed
            finished, computed = finished + 1, computed + is_new
            seconds_left = (monotonic() - start) / computed * (total - finished) if computed else None
            bar.update(shown, description=f"{_duration(seconds_left)}{text}", completed=finished)

        yield step


def _duration(seconds: float | None) -> str:
    if seconds is None:
        return ""
    minutes, remaining = divmod(round(seconds), 60)
    return f"{minutes // 60} h {minutes % 60:02d} min left, " if minutes >= 60 else f"{minutes}:{remaining:02d} left, "
