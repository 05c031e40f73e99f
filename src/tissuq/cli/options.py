"""What several commands share: priors, progress and the closing lines."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import MISSING, fields
from time import monotonic
from typing import TYPE_CHECKING, Any

from tissuq.errors import InputError
from tissuq.priors import Prior
from tissuq.registry import find

if TYPE_CHECKING:
    from tissuq.mechanics import Material

__all__ = ["campaign_progress", "not_converged", "once_each", "own_law", "parse_prior", "progress"]

NOT_CONVERGED = 3


def once_each(option: str, pairs: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    """Return the pairs of a repeatable option as a dictionary, each name given once."""
    found: dict[str, Any] = {}
    for name, value in pairs:
        if name in found:
            raise InputError(f"{option} is given twice for '{name}'; give it once.")
        found[name] = value
    return found


def parse_prior(text: str) -> tuple[str, dict[str, Any]]:
    """Return the symbol and the prior of a text like ``C10=uniform(0, 5)``."""
    match = re.fullmatch(r"\s*(\w+)\s*=\s*([\w-]+)\s*\(([^()]*)\)\s*", text)
    if match is None:
        raise InputError(f"'{text}' is not a prior; write PARAMETER=DISTRIBUTION(NUMBERS), as in C10=uniform(0, 5).")
    symbol, distribution, numbers = match.groups()
    known = fields(find(Prior, "prior distribution", distribution, InputError))
    try:
        values = [float(number) for number in numbers.split(",")] if numbers.strip() else []
    except ValueError as error:
        raise InputError(f"prior '{text}': its arguments must be numbers with a decimal point.") from error
    names, needed = [field.name for field in known], sum(field.default is MISSING for field in known)
    if not needed <= len(values) <= len(names):
        optional = f" (and may have {', '.join(names[needed:])})" if names[needed:] else ""
        raise InputError(f"prior '{text}': {distribution} needs {', '.join(names[:needed])}{optional}.")
    return symbol, {"distribution": distribution, **dict(zip(names, values, strict=False))}


def own_law(material: str | None) -> Material | None:
    """Return the law in a file that ``--material`` names for a run whose material is one."""
    from tissuq.mechanics import material_named

    if material is not None and ".py:" not in material:
        raise InputError(
            f"--material names the law in a file of a run whose material is one, as law.py:Name, and '{material}' is "
            "none; the run knows every other material."
        )
    return material_named(material, laws=True) if material else None


@contextmanager
def progress(total: int | None = None) -> Iterator[Callable[[str], None]]:
    """Show the steps of a long run on a terminal; give the function that announces the next one."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
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
    """Show how much of a campaign is done and how long the rest will take; give the function that is told of each task.

    Tasks that an earlier run had done count as done, but not for the time.
    """
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("{task.description}"))
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        shown = bar.add_task("", total=total)
        start, found, own = monotonic(), 0, 0

        def step(text: str, is_new: bool) -> None:
            nonlocal found, own
            found, own = found + 1, own + is_new
            left = (monotonic() - start) / own * (total - found) if own else None
            bar.update(shown, description=f"{_duration(left)}{text}", completed=found)

        yield step


def _duration(seconds: float | None) -> str:
    if seconds is None:
        return ""
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60} h {minutes % 60:02d} min left, " if minutes >= 60 else f"{minutes}:{rest:02d} left, "


def not_converged(names: list[str]) -> None:
    """End with status 3 when sampling has not converged anywhere."""
    import typer

    if names:
        typer.echo(
            f"tissuq: sampling has NOT converged for {', '.join(names)}; do not use these results. "
            "Try another method, narrower priors or another seed.",
            err=True,
        )
        raise typer.Exit(NOT_CONVERGED)
