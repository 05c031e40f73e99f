"""A command of the command line, made from the settings that it declares; its options under former names, too."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext, redirect_stdout
from dataclasses import replace
from inspect import Parameter, Signature
from io import StringIO
from types import MappingProxyType
from typing import Annotated, Any, TypeVar, get_args

import typer
from typer.core import TyperCommand

from tissuq.cli.call import Call, Running, Verbosity
from tissuq.cli.progress import Monitor, stopping
from tissuq.errors import InputError
from tissuq.studies.option import Settings, Slot, slots_of, stated
from tissuq.studies.settings import imported, load_settings

FORMER_NAMES: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        "paper": {"--points": "--measurements", "--sampler": "--method"},
        "predict": {
            "--points": "--grid-points",
            "--stretch": "--at",
            "--stretch2": "--at2",
            "--stress-type": "--stress",
        },
        "population": {"--specimen": "--specimen-column"},
        "design": {"--points": "--measurements", "--specimen": "--next-specimen"},
        "ensemble": {"--material": "--replace"},
        "coverage": {"--noise": "--noise-is", "--noise-sd": "--noise-is"},
        "sbc": {"--noise": "--noise-is", "--noise-sd": "--noise-is", "--formulation": "--discrepancy"},
        "tissues": {"--formulation": "--discrepancy"},
    }
)
"""By command: the name today of every option that had another one, which is still taken and which no help shows."""
OF_RUN = "predict", "design", "export", "structure", "simulate"
"""Commands in which ``--material law.py:Name`` was what ``--user-law`` is; a law by its name is one of the run's."""


def todays_names(command: str, arguments: Sequence[str]) -> list[str]:
    """Return what was typed after a command, with every option under its name today."""
    names = FORMER_NAMES.get(command, {})
    options = [argument.partition("=") for argument in arguments]
    todays = []
    for (option, equals, value), following in zip(options, [*arguments, ""][1:], strict=True):
        is_own_law = command in OF_RUN and option == "--material" and ".py:" in (value if equals else following)
        todays.append(("--user-law" if is_own_law else names.get(option, option)) + equals + value)
    return todays


Kind = TypeVar("Kind", bound=Settings)
How = TypeVar("How", bound=Running)

CONFIGURED: dict[str, tuple[type[Settings], str]] = {}
"""The settings of every command that takes a file of them, by its name, and where the class is that a file is of."""


def command(
    settings: type[Kind], running: type[How], whole: str = "", out: str = ""
) -> Callable[[Callable[[Call[Kind, How]], None]], Any]:
    """Make a command of what carries out a `Call`.

    Parameters
    ----------
    settings : type of Settings
        What its result depends on: its options, and what its ``run.toml`` may hold.
    running : type of Running
        Its other options.
    whole : str
        MODULE:NAME of the class of what its file may hold, where that is more than its options.
    out : str
        The help of ``--out``, where the folder is called or used in another way than runs are.
    """

    def decorate(carry_out: Callable[[Call[Kind, How]], None]) -> Any:
        has_config = "config" in running.model_fields
        of_settings = list(slots_of(settings, is_optional=has_config))
        of_running = [slot.in_group("Running") for slot in slots_of(running)]
        if out:
            of_running = [replace(slot, help=out) if slot.name == "out" else slot for slot in of_running]

        def run(**values: Any) -> None:
            how, typed_how = stated(of_running, values)
            checked = load_settings(running, None, how, typed=typed_how)
            monitor = Monitor(checked.quiet, checked.verbose) if isinstance(checked, Verbosity) else Monitor()
            kind: Any = settings_of(carry_out.__name__) or settings
            call = Call(kind, *stated(of_settings, values), checked, carry_out.__name__, monitor)
            with stopping(monitor), redirect_stdout(StringIO()) if monitor.is_quiet else nullcontext():
                carry_out(call)

        run.__doc__, run.__name__ = carry_out.__doc__, carry_out.__name__
        slots = sorted((*of_running, *of_settings), key=lambda slot: not slot.option.is_argument)
        run.__signature__ = Signature(list(map(_parameter, slots)))  # type: ignore[attr-defined]  # what Typer reads
        if has_config:
            CONFIGURED[carry_out.__name__] = settings, whole
        return run

    return decorate


class Command(TyperCommand):
    """A command that takes its options under their former names, too, and whose help lists options by their group."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Return what Click leaves of the arguments, former names replaced."""
        return super().parse_args(ctx, todays_names(self.name or "", args))

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write arguments, options, and options of a group under its name."""
        records: dict[str, list[tuple[str, str]]] = {"Arguments": [], "Options": []}
        for parameter in self.get_params(ctx):
            is_argument = parameter.param_type_name == "argument"
            group = "Arguments" if is_argument else getattr(parameter, "rich_help_panel", None) or "Options"
            if record := parameter.get_help_record(ctx):
                records.setdefault(group, []).append(record)
        for group, rows in records.items():
            if rows:
                with formatter.section(group):
                    formatter.write_dl(rows)


def settings_of(name: str) -> type[Settings] | None:
    """Return the class of what the file of a command may hold, None where it takes no file."""
    kind, location = CONFIGURED.get(name, (None, ""))
    of_whole_file: type[Settings] | None = imported(location) if location else kind
    return of_whole_file


def _parameter(slot: Slot) -> Parameter:
    """Return what Typer reads of a parameter."""
    number = next((kind for kind in (int, float) if kind in (slot.reads, *get_args(slot.reads))), None)
    parser = _number_of(slot.typed, number) if number else None
    if slot.option.is_argument:
        kind: Any = typer.Argument(help=slot.help)
    else:
        negative = slot.option.negative or ("no-" + slot.name if slot.info.default is True else "")
        names = "/".join(f"--{name.replace('_', '-')}" for name in (slot.name, negative) if name)
        letters = [f"-{slot.option.letter}"] if slot.option.letter else []
        kind = typer.Option(names, *letters, help=slot.help, rich_help_panel=slot.option.group or None, parser=parser)
    reads = slot.reads if slot.is_required else slot.reads | None
    default = Parameter.empty if slot.is_required else None
    return Parameter(slot.name, Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[reads, kind])


def _number_of(typed: str, kind: type) -> Callable[[Any], Any]:
    """Return what makes a number of a text, or says what the option needs; help shows it as the kind of number."""

    def parse(text: Any) -> Any:
        try:
            return kind(text)
        except ValueError:
            needed = "a whole number" if kind is int else "a number, with a decimal point"
            raise InputError(f"{typed} needs {needed}, not '{text}'.") from None

    parse.__name__ = kind.__name__
    return parse
