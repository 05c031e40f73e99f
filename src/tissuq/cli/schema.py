"""``tissuq schema``: what a settings file of a command may hold, for editors and programs."""

from __future__ import annotations

import json
from typing import Any

from tissuq.cli.call import Call
from tissuq.cli.command import CONFIGURED, command, settings_of
from tissuq.cli.running import Running
from tissuq.errors import InputError
from tissuq.studies.option import Settings, argument, slots_of

__all__ = ["schema", "schema_of"]


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
