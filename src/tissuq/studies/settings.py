"""Settings of a study from a TOML file, checked, with an explanation of each error."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from math import inf
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

from pydantic import AfterValidator

from tissuq.errors import InputError, TissuqError

if TYPE_CHECKING:
    from pydantic import BaseModel, ValidationError

RECIPE = "run.toml"
"""The file of a run that says how it is repeated."""
DATA = "data.csv"
"""The file of a run with its measurements, converted."""
INPUT = "input"
"""The folder of a run that holds copies of the user's files, so that the run can be repeated."""

DAMAGE = (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError)
"""What readers of damaged files raise: no TOML, JSON or UTF-8, values of other kinds, endless nesting."""

Settings = TypeVar("Settings", bound="BaseModel")
Named = TypeVar("Named")


def load_settings(
    kind: type[Settings],
    config: Path | None,
    options: dict[str, Any],
    rivals: tuple[str, ...] = (),
    typed: Mapping[str, str] = MappingProxyType({}),
) -> Settings:
    """Return validated settings from a TOML file (or nothing) and the options of the command line, which prevail.

    Of ``rivals`` only one can be set: an option for one of them overrides the others in the file. ``typed`` says as
    what an option was typed, for messages.
    """
    from pydantic import ValidationError

    values = _read_toml(config) if config else {}
    if config is not None and config.name == RECIPE:
        with damage_reported(config):
            _check_inside(config, values)
    if any(options.get(name) is not None for name in rivals):
        values = {name: value for name, value in values.items() if name not in rivals}
    for name, value in options.items():
        is_nested = isinstance(value, dict) and isinstance(values.get(name), dict)
        if value is not None:
            values[name] = values[name] | value if is_nested else value
    try:
        return kind.model_validate(values)
    except ValidationError as error:
        prefix = f"{config}: " if config else ""
        raise InputError(prefix + "; ".join(_explanations(error, kind, typed)) + ".") from error


@contextmanager
def damage_reported(file: Path) -> Iterator[None]:
    """Turn what a damaged file of a run does to its reader into one message.

    Raises
    ------
    InputError
        When the file cannot be read, or holds something else than the run wrote.
    """
    try:
        yield
    except OSError as error:
        raise InputError(f"'{file}' cannot be read: {error.strerror or error}.") from error
    except DAMAGE as error:
        raise InputError(f"'{file}' is damaged ({type(error).__name__}). Make the run again.") from error


def setting_of(config: Path, name: str) -> Any:
    """Return one setting of a TOML file, None where it has none; errors as of `load_settings`."""
    return _read_toml(config).get(name)


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise InputError(f"there is no configuration file '{path}'.") from error
    except OSError as error:
        raise InputError(f"configuration file '{path}' cannot be read: {error.strerror}.") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"configuration file '{path}' is not TOML: {error}.") from error


def _check_inside(recipe: Path, settings: Any) -> None:
    """Refuse the recipe of a run that names files outside of the run's folder: a run holds copies of them."""
    folder = recipe.parent.resolve()
    for name, value in settings.items() if isinstance(settings, dict) else ():
        for entry in value if isinstance(value, list) else [value]:
            _check_inside(recipe, entry)
            if name in ("file", "files") and isinstance(entry, str) and not is_inside(folder / entry, folder):
                raise InputError(
                    f"{recipe} names the file '{entry}', which does not lie in the folder of that run. Give the file "
                    f"itself, or call the configuration another name than {RECIPE} if it is your own."
                )


def is_inside(file: Path, folder: Path) -> bool:
    """Return whether a file lies in a folder, which is resolved, with all links followed."""
    try:
        return file.resolve().is_relative_to(folder)
    except (OSError, ValueError, RuntimeError):  # such as a NUL or a circle of links
        return False


def seen_from(folder: Path, path: str | Path) -> str:
    """Return a path as a file in a folder names it: relative, and right where a folder on the way is a symbolic link.

    ``..`` leads from the folder that a link names, not from the one in which the link lies.
    """
    named = Path(path)
    return os.path.relpath(named.parent.resolve() / named.name, folder.resolve())


def _explanations(error: ValidationError, kind: type[BaseModel], typed: Mapping[str, str]) -> list[str]:
    """Return one explanation for each error; all unknown settings share one."""
    items = error.errors()
    unknown = [_place(item) for item in items if item["type"] == "extra_forbidden"]
    explanations = [_explain(item, typed) for item in items if item["type"] != "extra_forbidden"]
    if unknown:
        settings = ", ".join(kind.model_fields)
        explanations.append(f"there is no setting {', '.join(map(repr, unknown))}; the settings are {settings}")
    return explanations


def _explain(item: Any, typed: Mapping[str, str]) -> str:
    location, message = _place(item), str(item["msg"]).removeprefix("Value error, ").rstrip(".")
    message = message.partition(", unable to parse")[0].replace("Input should be", "must be")
    if item["type"] == "missing":
        return f"setting '{location}' is missing"
    is_told = item["type"] == "value_error" or isinstance(item["input"], dict)
    value = "" if is_told else f" (it is {item['input']!r})"
    option = next((typed[name] for name in (location, location.partition(".")[0]) if name in typed), None)
    label = location if option in (None, f"--{location}") else f"{location} ({option})"
    return f"{label}: {message}{value}" if location else f"{message}{value}"


def _place(item: Any) -> str:
    return ".".join(str(key) for key in item["loc"])


def positive_or_unknown(unit: str, reason: str = "") -> Callable[[Any], Any]:
    """Return a validator of a standard deviation, or of several by name: each a positive number, or 'unknown'.

    ``unit`` says in which they are, and ``reason`` why nothing else is possible.
    """

    def check(value: Any) -> Any:
        for sd in value.values() if isinstance(value, dict) else (value,):
            is_number = isinstance(sd, int | float) and not isinstance(sd, bool)
            if sd != "unknown" and not (is_number and 0 < sd < inf):
                raise ValueError(f"must be a positive number in {unit}, or 'unknown', not {sd!r}{reason}")
        return value

    return check


def looked_up(find: Callable[[Any], Named], name: Any) -> Named:
    """Return what a name refers to; a ValueError, which pydantic reports with the setting, where there is nothing."""
    try:
        return find(name)
    except TissuqError as error:
        raise ValueError(str(error)) from error


def there_is(find: Callable[[Any], object] | str) -> Callable[[Any], Any]:
    """Return a validator of a name, or of several, unless it is None: each must be one that ``find`` knows.

    Where that is MODULE:NAME, it is imported when a value is checked.
    """

    def check(value: Any) -> Any:
        known = imported(find) if isinstance(find, str) else find
        for name in value if isinstance(value, tuple) else (value,):
            if name is not None:
                looked_up(known, name)
        return value

    return check


def imported(location: str) -> Any:
    """Return what MODULE:NAME is."""
    module, _, name = location.partition(":")
    return getattr(import_module(module), name)


def _errors_there_are(sizes: dict[str, float] | None) -> dict[str, float] | None:
    from tissuq.model.tolerances import Tolerances

    looked_up(lambda errors: Tolerances(**errors), sizes or {})
    return sizes


SizesOfErrors = Annotated[dict[str, float] | None, AfterValidator(_errors_there_are)]
"""Standard deviations of errors of tests, by the names of these; None for those of what is estimated."""
