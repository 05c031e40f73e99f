"""What several commands share: repeated options, priors, progress, folders of campaigns and closing lines."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import MISSING, fields
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tissuq.errors import InputError

if TYPE_CHECKING:
    from pydantic import BaseModel

    from tissuq.mechanics import Material

__all__ = [
    "Config",
    "Figures",
    "Force",
    "RunDiscrepancy",
    "RunFolder",
    "RunMaterial",
    "Scheduler",
    "Seed",
    "campaign_progress",
    "check_folder",
    "not_converged",
    "once_each",
    "own_law",
    "parse_prior",
    "progress",
    "write_campaign_recipe",
]

RunFolder = Annotated[Path | None, typer.Argument(help="Run folder of tissuq fit.")]
RunDiscrepancy = Annotated[
    str | None, typer.Option(help="Which of the discrepancies of the run [auto, or the only one].")
]
RunMaterial = Annotated[
    str | None,
    typer.Option(
        "--user-law", help="law.py:Name of the run, if its material is your own law; its code runs only if named here."
    ),
]
Config = Annotated[Path | None, typer.Option(help="run.toml of an earlier run to repeat.")]
Seed = Annotated[int | None, typer.Option(help="Seed of the random numbers [0].")]
Scheduler = Annotated[str | None, typer.Option(help="Address of a Dask scheduler to use instead.")]
Figures = Annotated[bool, typer.Option(help="Draw the figures.")]
Force = Annotated[bool, typer.Option("--force", help="Replace an existing folder of the same kind.")]

NOT_CONVERGED = 3


def once_each(option: str, pairs: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    """Return the pairs of a repeatable option as a dictionary, each name given once."""
    values_by_name: dict[str, Any] = {}
    for name, value in pairs:
        if name in values_by_name:
            raise InputError(f"{option} is given twice for '{name}'; give it once.")
        values_by_name[name] = value
    return values_by_name


def parse_prior(text: str) -> tuple[str, dict[str, Any]]:
    """Return the symbol and the prior of a text like ``C10=uniform(0, 5)``."""
    from tissuq.parameters.priors import Prior
    from tissuq.registry import find

    match = re.fullmatch(r"\s*(\w+)\s*=\s*([\w-]+)\s*\(([^()]*)\)\s*", text)
    if match is None:
        raise InputError(f"'{text}' is not a prior; write PARAMETER=DISTRIBUTION(NUMBERS), as in C10=uniform(0, 5).")
    symbol, distribution, numbers = match.groups()
    arguments = fields(find(Prior, "prior distribution", distribution, InputError))
    try:
        values = [float(number) for number in numbers.split(",")] if numbers.strip() else []
    except ValueError as error:
        raise InputError(f"prior '{text}': the arguments must be numbers, with a decimal point.") from error
    names, needed = [field.name for field in arguments], sum(field.default is MISSING for field in arguments)
    if not needed <= len(values) <= len(names):
        optional = f" (and may have {', '.join(names[needed:])})" if names[needed:] else ""
        raise InputError(f"prior '{text}': {distribution} needs {', '.join(names[:needed])}{optional}.")
    return symbol, {"distribution": distribution, **dict(zip(names, values, strict=False))}


def own_law(material: str | None) -> Material | None:
    """Return the law in a file that ``--user-law`` names for a run whose material is one."""
    from tissuq.mechanics import material_named

    if material is not None and ".py:" not in material:
        raise InputError(
            f"'{material}' is not of the form law.py:Name. --user-law is only needed for a run whose material is a "
            "law in your own file."
        )
    return material_named(material, laws=True) if material else None


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


def not_converged(names: list[str]) -> None:
    """End with status 3 when sampling has not converged anywhere."""
    if names:
        typer.echo(
            f"tissuq: sampling has NOT converged for {', '.join(names)}; do not use these results. "
            "Try another method, narrower priors or another seed.",
            err=True,
        )
        raise typer.Exit(NOT_CONVERGED)


def check_folder(folder: Path, settings: BaseModel, free: frozenset[str] = frozenset()) -> None:
    """Refuse a folder that is not empty, unless it is that of the same campaign.

    Settings that are ``free`` may be others than before.

    Raises
    ------
    InputError
        When it is neither.
    """
    from tissuq.report.run_folder import RECIPE

    recipe = folder / RECIPE
    if not folder.exists() or (folder.is_dir() and {path.name for path in folder.iterdir()} <= {_unfinished(recipe)}):
        return
    if not recipe.exists():
        raise InputError(f"'{folder}' is not the folder of a campaign; choose another with --out.")
    stored, wanted = recipe.read_text(encoding="utf-8"), _recipe(settings)
    if stored != wanted and not (free and _without(stored, free) == _without(wanted, free)):
        raise InputError(f"'{folder}' holds a campaign with other settings; choose another folder with --out.")


def write_campaign_recipe(folder: Path, settings: BaseModel) -> None:
    """Write the recipe atomically, so that a killed campaign can be resumed."""
    from tissuq.report.run_folder import RECIPE

    folder.mkdir(parents=True, exist_ok=True)
    scratch = folder / _unfinished(folder / RECIPE)
    scratch.write_text(_recipe(settings), encoding="utf-8")
    scratch.replace(folder / RECIPE)


def _unfinished(recipe: Path) -> str:
    return f"{recipe.name}.new"


def _without(recipe: str, names: frozenset[str]) -> dict[str, Any] | None:
    """Return the settings of a recipe without some of them, None where it is damaged."""
    import tomllib

    try:
        return {name: value for name, value in tomllib.loads(recipe).items() if name not in names}
    except tomllib.TOMLDecodeError:
        return None


def _recipe(settings: BaseModel) -> str:
    import tomli_w

    return tomli_w.dumps(settings.model_dump(mode="json", exclude_none=True))
