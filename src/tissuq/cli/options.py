"""What several commands share: repeated options, priors, progress, folders of campaigns and closing lines."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tissuq.cli.progress import campaign_progress, progress
from tissuq.errors import InputError
from tissuq.studies.option_texts import once_each

if TYPE_CHECKING:
    from pydantic import BaseModel

    from tissuq.mechanics import Material

__all__ = [
    "Config",
    "Figures",
    "Force",
    "RunDiscrepancy",
    "RunFolder",
    "RunMaterial",
    "Scheduler",
    "Seed",
    "campaign_progress",
    "check_folder",
    "not_converged",
    "once_each",
    "own_law",
    "progress",
    "write_campaign_recipe",
]

RunFolder = Annotated[Path | None, typer.Argument(help="Run folder of tissuq fit.")]
RunDiscrepancy = Annotated[
    str | None, typer.Option(help="Which of the discrepancies of the run [auto, or the only one].")
]
RunMaterial = Annotated[
    str | None,
    typer.Option(
        "--user-law", help="law.py:Name of the run, if its material is your own law; its code runs only if named here."
    ),
]
Config = Annotated[Path | None, typer.Option(help="run.toml of an earlier run to repeat.")]
Seed = Annotated[int | None, typer.Option(help="Seed of the random numbers [0].")]
Scheduler = Annotated[str | None, typer.Option(help="Address of a Dask scheduler to use instead.")]
Figures = Annotated[bool, typer.Option(help="Draw the figures.")]
Force = Annotated[bool, typer.Option("--force", help="Replace an existing folder of the same kind.")]

NOT_CONVERGED = 3


def own_law(material: str | None) -> Material | None:
    """Return the law in a file that ``--user-law`` names for a run whose material is one."""
    from tissuq.mechanics import material_named

    if material is not None and ".py:" not in material:
        raise InputError(
            f"'{material}' is not of the form law.py:Name. --user-law is only needed for a run whose material is a "
            "law in your own file."
        )
    return material_named(material, laws=True) if material else None


def not_converged(names: list[str]) -> None:
    """End with status 3 when sampling has not converged anywhere."""
    if names:
        typer.echo(
            f"tissuq: sampling has NOT converged for {', '.join(names)}; do not use these results. "
            "Try another method, narrower priors or another seed.",
            err=True,
        )
        raise typer.Exit(NOT_CONVERGED)


def check_folder(folder: Path, settings: BaseModel, free: frozenset[str] = frozenset()) -> None:
    """Refuse a folder that is not empty, unless it is that of the same campaign.

    Settings that are ``free`` may be others than before.

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
    stored, wanted = recipe.read_text(encoding="utf-8"), _recipe(settings)
    if stored != wanted and not (free and _without(stored, free) == _without(wanted, free)):
        raise InputError(f"'{folder}' holds a campaign with other settings; choose another folder with --out.")


def write_campaign_recipe(folder: Path, settings: BaseModel) -> None:
    """Write the recipe atomically, so that a killed campaign can be resumed."""
    from tissuq.report.run_folder import RECIPE

    folder.mkdir(parents=True, exist_ok=True)
    scratch = folder / _unfinished(folder / RECIPE)
    scratch.write_text(_recipe(settings), encoding="utf-8")
    scratch.replace(folder / RECIPE)


def _unfinished(recipe: Path) -> str:
    return f"{recipe.name}.new"


def _without(recipe: str, names: frozenset[str]) -> dict[str, Any] | None:
    """Return the settings of a recipe without some of them, None where it is damaged."""
    import tomllib

    try:
        return {name: value for name, value in tomllib.loads(recipe).items() if name not in names}
    except tomllib.TOMLDecodeError:
        return None


def _recipe(settings: BaseModel) -> str:
    import tomli_w

    return tomli_w.dumps(settings.model_dump(mode="json", exclude_none=True))
