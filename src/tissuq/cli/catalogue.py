"""``tissuq materials``, ``modes``, ``discrepancies``, ``datasets``, ``schema``: what there is; ``check``: your law."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tissuq.cli.call import Call, Running
from tissuq.cli.command import CONFIGURED, command, settings_of
from tissuq.errors import InputError
from tissuq.experiments.numbers import wrapped
from tissuq.studies.option import Settings, argument, slots_of

if TYPE_CHECKING:
    from tissuq.mechanics import Material
    from tissuq.model.discrepancy import Discrepancy

LONG = 70
"""Characters of a formula from which its source stands on a line of its own."""


def materials(
    markdown: Annotated[bool, typer.Option("--markdown", help="Print the page docs/materials.md instead.")] = False,
) -> None:
    """List the materials: formula, parameters, units and default priors."""
    from tissuq.mechanics.material import materials as known
    from tissuq.mechanics.named import FORMS, plugins
    from tissuq.report.catalogue import materials_page

    if markdown:
        print(materials_page(), end="")
        return
    external = [plugin for plugin in plugins() if plugin.name not in known()]
    _print_kinds("Materials: strain-energy densities W", [*known().values(), *external])
    print("Other names:")
    for form in FORMS:
        print(f"    {form}")


def modes(
    markdown: Annotated[bool, typer.Option("--markdown", help="Print the page docs/modes.md instead.")] = False,
) -> None:
    """List the loading modes: what is set, and the stresses that are measured."""
    from tissuq.experiments.modes import LoadingMode, loading_modes
    from tissuq.registry import plugins
    from tissuq.report.catalogue import modes_page

    if markdown:
        print(modes_page(), end="")
        return
    plugins(LoadingMode)
    print("Loading modes: every stress is the derivative of W by what it does work on\n")
    for kind in loading_modes().values():
        controls = ", ".join(control.name for control in kind.controls)
        print(f"{kind.name}\n    {kind.description}\n    sets {controls}; measures {', '.join(kind.stresses)}\n")


def discrepancies() -> None:
    """List the discrepancies: formula, parameters, units and default priors."""
    from tissuq.model.discrepancy import Discrepancy
    from tissuq.model.discrepancy import discrepancies as known
    from tissuq.registry import plugins

    plugins(Discrepancy)
    _print_kinds("Discrepancies: measured stress = material + discrepancy + noise", known().values())


def datasets(
    copy: Annotated[str | None, typer.Option(help="Name of a data set to copy.")] = None,
    to: Annotated[Path | None, typer.Option(help="Folder to copy it to [the current one].")] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite a file that is there.")] = False,
) -> None:
    """List the built-in measured data sets, or copy one as a CSV file."""
    from tissuq.experiments import datasets as known

    if copy is not None:
        print(known.copy(copy, to or Path(), force=force))
        return
    if to is not None or force:
        raise InputError("--to and --force go with --copy NAME: say which data set to copy.")
    for name in known.names():
        print(f"{name}\n    {known.citation(name)}")


def _print_kinds(title: str, kinds: Iterable[type[Material] | type[Discrepancy] | Material]) -> None:
    from tissuq.report.catalogue import default_in_words

    print(f"{title}\n")
    for kind in kinds:
        gap = "   " if len(kind.formula) < LONG else "\n    "
        print(f"{kind.name}\n    {kind.formula}{gap}({kind.source})")
        for p in kind.parameters:
            print(f"    {p.symbol:<6} {p.unit or '-':<4} {p.description}; prior {default_in_words(p)}")
        if kind.caution:
            print(wrapped(kind.caution, 96, initial_indent="    Note: ", subsequent_indent="    "))
        print()


def check(material: Annotated[str, typer.Argument(help="Your own law.py:Name, or the name of any material.")]) -> None:
    """Check a material: zero at the reference, derivatives, what is linear; status 2 where it fails."""
    from tissuq.mechanics import material_named
    from tissuq.mechanics.user_law import checked

    law = material_named(material, laws=True)
    print(f"{law.name}\n    {law.formula}")
    print(f"    parameters: {', '.join(f'{p.symbol} ({p.unit})' if p.unit else p.symbol for p in law.parameters)}")
    for result in checked(law):
        print(f"    FAILS: {result.claim}: {result.problem}" if result.problem else f"    holds: {result.claim}")


class SchemaOf(Settings):
    """Whose schema."""

    command: str = argument(..., "A command that takes --config, such as fit.")


@command(SchemaOf, Running)
def schema(call: Call[SchemaOf, Running]) -> None:
    """Print the JSON schema of what --config of a command takes: settings, types, units, defaults."""
    print(json.dumps(schema_of(call.settings.command), indent=2))


def schema_of(name: str) -> dict[str, Any]:
    """Return the JSON schema of the settings of a command, with the option of each.

    Raises
    ------
    InputError
        When no such command has settings.
    """
    kind = settings_of(name)
    if kind is None:
        raise InputError(f"no command '{name}' takes --config; choose one of {', '.join(sorted(CONFIGURED))}.")
    json_schema = kind.model_json_schema()
    for slot in slots_of(kind):
        if len(slot.path) == 1:
            json_schema["properties"][slot.path[0]]["option"] = slot.typed
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **json_schema}
