"""Folders of campaigns, which grow and are gone on with: only that of the same campaign, with its recipe first."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from tissuq.errors import InputError
from tissuq.studies.settings import RECIPE

if TYPE_CHECKING:
    from pydantic import BaseModel

__all__ = ["check_folder", "write_campaign_recipe"]

MAX_LETTERS = 300
"""Of what is said of settings that differ."""


def check_folder(folder: Path, settings: BaseModel, free: frozenset[str] = frozenset()) -> None:
    """Refuse a folder that is not empty, unless it is that of the same campaign.

    Settings that are ``free`` may be others than before.

    Raises
    ------
    InputError
        When it is neither.
    """
    from tissuq.studies.stream import unfinished

    recipe = folder / RECIPE
    if not folder.exists() or (
        folder.is_dir() and {path.name for path in folder.iterdir()} <= {unfinished(recipe).name}
    ):
        return
    if not recipe.exists():
        raise InputError(f"'{folder}' is not the folder of a campaign; choose another with --out.")
    stored, wanted = _without(recipe.read_text(encoding="utf-8"), free), _without(_recipe(settings), free)
    if stored != wanted:
        names = [name for name in {**stored, **wanted} if stored.get(name) != wanted.get(name)]
        said = ", ".join(f"{name}: {stored.get(name, 'none')} there, {wanted.get(name, 'none')} here" for name in names)
        raise InputError(
            f"'{folder}' holds a campaign with other settings ({said:.{MAX_LETTERS}}): choose another folder (--out)."
        )


def write_campaign_recipe(folder: Path, settings: BaseModel) -> None:
    """Write the recipe atomically, so that a killed campaign can be resumed."""
    from tissuq.studies.stream import write_whole

    folder.mkdir(parents=True, exist_ok=True)
    write_whole(folder / RECIPE, _recipe(settings))


def _without(recipe: str, names: frozenset[str]) -> dict[str, Any]:
    """Return the settings of a recipe without some of them, none where it is damaged."""
    import tomllib

    try:
        return {name: value for name, value in tomllib.loads(recipe).items() if name not in names}
    except tomllib.TOMLDecodeError:
        return {}


def _recipe(settings: BaseModel) -> str:
    import tomli_w

    return tomli_w.dumps(settings.model_dump(mode="json", exclude_none=True))
