"""The parameters of commands that settings declare, by the names that a person types."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from tissuq.studies.option import Option, options_of

__all__ = ["Slot", "slots_of", "stated"]


@dataclass(frozen=True)
class Slot:
    """A parameter of a command: where its value belongs, and how it is read.

    ``path`` are the names of the setting and of its entry, if any.
    """

    name: str
    path: tuple[str, ...]
    option: Option
    info: FieldInfo
    help: str
    reads: Any
    is_required: bool = False

    @property
    def typed(self) -> str:
        """The parameter as a person types it."""
        return self.name.upper() if self.option.is_argument else f"--{self.name.replace('_', '-')}"

    def in_group(self, name: str) -> Self:
        """Return the parameter in a group, unless it is in one."""
        return replace(self, option=replace(self.option, group=self.option.group or name))


def slots_of(kind: type[BaseModel], *, is_optional: bool = False) -> Iterator[Slot]:
    """Give the parameters of a command for some settings; with a configuration file all are optional."""
    for name, option, info in options_of(kind):
        if option.help:
            shown = option.name.replace("-", "_") or name
            path = (name, option.entry) if option.entry else (name,)
            is_required = info.is_required() and not is_optional
            yield Slot(shown, path, option, info, option.explained(info), option.read_as(info), is_required)
        for entry, text in option.entries.items():
            yield Slot(entry, (name, entry), Option(text, group=option.group), info, text, str)
        for slot in slots_of(option.of) if option.of is not None else ():
            if shown := option.renamed.get(slot.name, slot.name):
                yield replace(slot, name=shown, path=(name, *slot.path))


def stated(slots: Iterable[Slot], values: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the settings that are typed, and how each was typed."""
    settings: dict[str, Any] = {}
    typed: dict[str, str] = {}
    for slot in slots:
        value = values.get(slot.name)
        if value is None or value == []:
            continue
        inner = settings
        for name in slot.path[:-1]:
            inner = inner.setdefault(name, {})
        inner[slot.path[-1]] = slot.option.parse(value) if slot.option.parse else value
        typed[".".join(slot.path)] = slot.typed
    return settings, typed
