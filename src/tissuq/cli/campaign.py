"""Folders of campaigns: the same command goes on where it was stopped, and another one is refused."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from tissuq.errors import InputError

if TYPE_CHECKING:
    from pydantic import BaseModel

__all__ = ["check_folder", "write_campaign_recipe"]


def check_folder(folder: Path, settings: BaseModel) -> None:
    """Refuse a folder that is not empty, unless it is that of the same campaign.

    Raises
    ------
    InputError
        When it is neither.
    """
    from tissuq.report.run_folder import RECIPE

    recipe = folder / RECIPE
    if not folder.exists() or (folder.is_dir() and {path.name for path in folder.iterdir()} <= {_unfinished(recipe)}):
        return
    if not recipe.exists():
        raise InputError(f"'{folder}' is not the folder of a campaign; choose another with --out.")
    if recipe.read_text(encoding="utf-8") != _recipe(settings):
        raise InputError(f"'{folder}' holds a campaign with other settings; choose another folder with --out.")


def write_campaign_recipe(folder: Path, settings: BaseModel) -> None:
    """Write it whole or not at all, so that a campaign goes on from a kill at any point."""
    from tissuq.report.run_folder import RECIPE

    folder.mkdir(parents=True, exist_ok=True)
    scratch = folder / _unfinished(folder / RECIPE)
    scratch.write_text(_recipe(settings), encoding="utf-8")
    scratch.replace(folder / RECIPE)


def _unfinished(recipe: Path) -> str:
    return f"{recipe.name}.new"


def _recipe(settings: BaseModel) -> str:
    import tomli_w

    return tomli_w.dumps(settings.model_dump(mode="json", exclude_none=True))
