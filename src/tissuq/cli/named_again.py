"""Programs and files elsewhere that a recipe names: they are used only if the command line names them, too."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tissuq.errors import InputError
from tissuq.studies.model_settings import ModelSettings
from tissuq.studies.settings import is_inside

__all__ = ["check_named_again", "is_function"]


def is_function(text: str) -> bool:
    """Return whether a quantity is a function in a file, which would be run."""
    from tissuq.mechanics.user_law import LAW

    return LAW.fullmatch(text) is not None


def check_named_again(
    config: Path, settings: ModelSettings, stated: Mapping[str, Any], functions: Sequence[str], *, is_dry: bool = False
) -> None:
    """Refuse to run programs, or to read files elsewhere, that a recipe names and the command line does not.

    Parameters
    ----------
    config : Path
        The recipe.
    settings : ModelSettings
    stated : mapping of str to object
        What the command line names.
    functions : sequence of str
        Options with functions of the user's that it does not name.
    is_dry : bool
        Whether nothing is to be run.

    Raises
    ------
    InputError
        When there are some; the message has the options to type.
    """
    missing = []
    if not is_dry:
        if settings.command and not stated.get("command"):
            missing.append(f"--command {shlex.quote(settings.command)}")
        missing += functions
    inside = config.parent.resolve()
    if "also" not in stated and not all(is_inside(inside / file, inside) for file in settings.also):
        missing += [f"--also {shlex.quote(file)}" for file in settings.also]
    if missing:
        raise InputError(
            f"'{config}' names programs that would be run, or files outside of its folder. They are used only if named "
            f"here, too; if you know them, add {' '.join(missing)}."
        )
