"""Settings of a study from a TOML file, checked, with whatever is wrong in sentences."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from tissuq.errors import InputError

if TYPE_CHECKING:
    from pydantic import BaseModel, ValidationError

__all__ = ["RECIPE", "load_settings"]

RECIPE = "run.toml"
"""The file of a run that says how it is repeated."""

Settings = TypeVar("Settings", bound="BaseModel")


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
