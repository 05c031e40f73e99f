"""What several commands share: configuration files, priors, progress and the closing lines."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import MISSING, fields
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any, TypeVar

from tissuq.errors import InputError
from tissuq.priors import Prior
from tissuq.registry import find

if TYPE_CHECKING:
    from pydantic import BaseModel, ValidationError

__all__ = [
    "campaign_progress",
    "load_settings",
    "noise_given",
    "not_converged",
    "once_each",
    "parse_prior",
    "progress",
    "role_given",
]

Settings = TypeVar("Settings", bound="BaseModel")

NOT_CONVERGED = 3


def load_settings(
    kind: type[Settings], config: Path | None, options: dict[str, Any], rivals: tuple[str, ...] = ()
) -> Settings:
    """Return validated settings from a TOML file (or nothing) and the options of the command line, which prevail.

    Of ``rivals`` only one can be set: an option for one of them puts the others in the file out of force.
    """
    from pydantic import ValidationError

    given = _read_toml(config) if config else {}
    if any(options.get(name) is not None for name in rivals):
        given = {name: value for name, value in given.items() if name not in rivals}
    for name, value in options.items():
        both = isinstance(value, dict) and isinstance(given.get(name), dict)
        if value is not None:
            given[name] = given[name] | value if both else value
    try:
        return kind.model_validate(given)
    except ValidationError as error:
        place = f"{config}: " if config else ""
        raise InputError(place + "; ".join(_explanations(error, kind)) + ".") from error


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


def noise_given(text: str | None) -> float | str | None:
    """Return the standard deviation of the noise: a number, or 'unknown'."""
    if text is None or text == "unknown":
        return text
    try:
        return float(text)
    except ValueError as error:
        raise InputError(f"--noise-sd needs a number in the file's stress unit, or 'unknown', not '{text}'.") from error


def role_given(text: str) -> tuple[str, str | int]:
    """Return the role and the column of a text like ``stress=Force``, a column's number as a number."""
    role, _, name = text.partition("=")
    if not name:
        raise InputError(f"--column needs ROLE=COLUMN, such as stress='Stress (kPa)', not '{text}'.")
    return role.strip(), int(name) if name.strip().isdecimal() else name.strip()


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


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise InputError(f"there is no configuration file '{path}'.") from error
    except OSError as error:
        raise InputError(f"configuration file '{path}' cannot be read: {error.strerror}.") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"configuration file '{path}' is not TOML: {error}.") from error


def _explanations(error: ValidationError, kind: type[BaseModel]) -> list[str]:
    """Return one sentence for each thing that is wrong; all unknown settings together are one."""
    items = error.errors()
    unknown = [_place(item) for item in items if item["type"] == "extra_forbidden"]
    sentences = [_explain(item) for item in items if item["type"] != "extra_forbidden"]
    if unknown:
        settings = ", ".join(kind.model_fields)
        sentences.append(f"there is no setting {', '.join(map(repr, unknown))}; the settings are {settings}")
    return sentences


def _explain(item: Any) -> str:
    place, message = _place(item), str(item["msg"]).removeprefix("Value error, ").rstrip(".")
    if item["type"] == "missing":
        return f"setting '{place}' is missing"
    is_told = item["type"] == "value_error" or isinstance(item["input"], dict)
    found = "" if is_told else f" (it is {item['input']!r})"
    return f"{place}: {message}{found}" if place else f"{message}{found}"


def _place(item: Any) -> str:
    return ".".join(str(part) for part in item["loc"])
