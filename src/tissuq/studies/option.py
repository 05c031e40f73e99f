"""Settings that say how they are given on the command line, once, and the parameters of commands that follow."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from types import NoneType
from typing import Any, Self, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator
from pydantic.fields import FieldInfo

from tissuq.parameters.checks import MAX_SEED
from tissuq.studies.option_texts import pairs_of
from tissuq.studies.settings import imported


class Settings(BaseModel):
    """Settings whose fields are declared by `option` and `argument`, or are for files alone."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)

    @field_validator("*", mode="before")
    @classmethod
    def _paths_as_text(cls, value: Any) -> Any:
        """Take the paths of the command line as files of settings have them."""
        if isinstance(value, list):
            return [str(item) if isinstance(item, Path) else item for item in value]
        return str(value) if isinstance(value, Path) else value

    @field_validator("*")
    @classmethod
    def _one_of_choices(cls, value: Any, info: ValidationInfo) -> Any:
        declared = cls.model_fields[str(info.field_name)].json_schema_extra
        if value is not None and isinstance(declared, Option) and declared.choices:
            choices = get_args(imported(declared.choices))
            if value not in choices:
                listed = ", ".join(map(repr, choices[:-1]))
                raise ValueError(f"must be {listed} or {choices[-1]!r}, not {value!r}")
        return value


@dataclass(frozen=True)
class Option:
    """How a setting is given on the command line.

    Attributes
    ----------
    help : str
        What it means. Its default is added in brackets, unless the text has brackets.
    name : str
        As it is typed, without the dashes, where that is not the name of the setting.
    negative : str
        What a flag is called that says no.
    letter : str
        That stands for its name after one dash.
    unit : str
        Of its number.
    takes : type, optional
        What the command line reads, where that does not follow from the type of the setting.
    parse : callable, optional
        Turns what was read into the value of the setting.
    choices : str
        The literal type of its values, as MODULE:NAME, which is imported when a value is checked.
    entry : str
        The entry of the setting, a dictionary, that the option is.
    entries : mapping of str to str
        Options that are entries of the setting, which is a dictionary, and their helps.
    of : type of BaseModel, optional
        Further settings that the setting, a dictionary, holds: their options are options of the command.
    renamed : mapping of str to str
        Their names, where the command has another use for them; an empty one for an option that it has not.
    group : str
        The heading under which help lists it.
    is_argument : bool
        Whether it is typed without its name.
    """

    help: str
    name: str = ""
    negative: str = ""
    letter: str = ""
    unit: str = ""
    takes: Any = None
    parse: Callable[[Any], Any] | None = None
    choices: str = ""
    entry: str = ""
    entries: Mapping[str, str] = field(default_factory=dict)
    of: type[BaseModel] | None = None
    renamed: Mapping[str, str] = field(default_factory=dict)
    group: str = ""
    is_argument: bool = False

    def __call__(self, schema: dict[str, Any]) -> None:
        """Add to the JSON schema of the setting what pydantic does not know."""
        if self.unit:
            schema["unit"] = self.unit

    def read_as(self, info: FieldInfo) -> Any:
        """Return the type that the command line reads."""
        if self.takes is not None:
            return self.takes
        kinds = [kind for kind in get_args(info.annotation) if kind is not NoneType] or [info.annotation]
        kind = kinds[0] if len(kinds) == 1 and type(None) in get_args(info.annotation) else info.annotation
        if get_origin(kind) in (tuple, list):
            return list[int] if get_args(kind)[0] is int else list[str]
        if get_origin(kind) is dict or kind is dict:
            return list[str]
        return kind if kind in (int, float, bool, str, Path) else str

    def explained(self, info: FieldInfo) -> str:
        """Return the help with the default."""
        default = info.get_default(call_default_factory=False)
        is_shown = isinstance(default, int | float | str) and not isinstance(default, bool) and default != ""
        if not is_shown or not self.help or "[" in self.help:
            return self.help
        shown = f"{default:g}" if isinstance(default, float) else default
        return f"{self.help.removesuffix('.')} [{shown}]."


def option(
    default: Any = None, help: str = "", *, default_factory: Callable[[], Any] | None = None, **more: Any
) -> Any:
    """Declare a setting that is an option of the command line.

    ``more`` are fields of `Option`, and the limits of its values, which are those of pydantic's ``Field``.

    Examples
    --------
    >>> class Throw(Settings):
    ...     draws: int = option(64, "Number of draws.", ge=2)
    >>> Throw().draws, [option.explained(info) for _, option, info in options_of(Throw)]
    (64, ['Number of draws [64].'])
    """
    declared = {name: more.pop(name) for name in [entry.name for entry in fields(Option)] if name in more}
    start = {"default": default} if default_factory is None else {"default_factory": default_factory}
    return Field(**start, description=help or None, json_schema_extra=Option(help, **declared), **more)


def argument(default: Any, help: str, **more: Any) -> Any:
    """Declare a setting that is typed without its name; the arguments are those of `option`."""
    return option(default, help, is_argument=True, **more)


def seed() -> Any:
    """Declare the seed of random numbers."""
    return option(0, "Seed of the random numbers.", ge=0, le=MAX_SEED)


def only_rows(group: str = "") -> Any:
    """Declare the rows of a file that are read: those of one specimen."""
    return option(
        default_factory=dict,
        group=group,
        help="COLUMN=VALUE: the only rows to read, such as Specimen=S1 [all of one specimen]; repeat.",
        parse=pairs_of("--only", "a choice of rows", "COLUMN=VALUE, such as Specimen=S1", divided_last=True),
    )


def table_of_sizes(group: str = "", takes: Any = None) -> Any:
    """Declare the table of a laboratory book with the sizes of specimens."""
    return option(
        None,
        "Table of the undeformed sizes of specimens: in its first column their names, or those of their files, then "
        "'length [mm]', 'width [mm]' and the like.",
        group=group,
        takes=takes,
    )


def sampling() -> Any:
    """Declare how draws spread through a posterior."""
    return option(
        "sobol", "How draws spread: sobol, latin or random.", choices="tissuq.posterior.drawn_materials:Sampling"
    )


def mesh_order(group: str) -> Any:
    """Declare the order with which what is computed on a finer mesh converges."""
    return option(
        None,
        "Power of the size of elements with which the error of the mesh falls: 1 at sharp edges, 2 without [1].",
        gt=0,
        le=8,
        group=group,
    )


def options_of(kind: type[BaseModel]) -> Iterator[tuple[str, Option, FieldInfo]]:
    """Give the settings that are options: the name of each, how it is given, and its type and default."""
    for name, info in kind.model_fields.items():
        if isinstance(info.json_schema_extra, Option):
            yield name, info.json_schema_extra, info


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
