"""Programs and files elsewhere that a recipe names: they are used only if the command line names them, too."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tissuq.errors import InputError
from tissuq.studies.model_settings import ModelSettings
from tissuq.studies.settings import is_inside

__all__ = ["check_named_again"]


def check_named_again(
    config: Path,
    settings: ModelSettings,
    stated: Mapping[str, Any],
    quantities: Mapping[str, str],
    *,
    is_dry: bool = False,
) -> None:
    """Refuse to run programs, or to read files elsewhere, that a recipe names and the command line does not.

    Parameters
    ----------
    config : Path
        The recipe.
    settings : ModelSettings
    stated : mapping of str to object
        What the command line names.
    quantities : mapping of str to str
        Settings with quantities by name, which may be functions in files, and the options that they are typed as.
    is_dry : bool
        Whether nothing is to be run.

    Raises
    ------
    InputError
        When there are some; the message has the options to type.
    """
    from tissuq.mechanics.user_law import UserCode

    missing = []
    if not is_dry:
        if settings.command and not stated.get("command"):
            missing.append(f"--command {shlex.quote(settings.command)}")
        for setting, option in quantities.items():
            for name, text in getattr(settings, setting).items():
                if UserCode.named(text) and name not in stated.get(setting, {}):
                    missing.append(f"{option} {shlex.quote(f'{name}={text}')}")
    inside = config.parent.resolve()
    if "also" not in stated and not all(is_inside(inside / file, inside) for file in settings.also):
        missing += [f"--also {shlex.quote(file)}" for file in settings.also]
    if missing:
        raise InputError(
            f"'{config}' names programs that would be run, or files outside of its folder. They are used only if named "
            f"here, too; if you know them, add {' '.join(missing)}."
        )
