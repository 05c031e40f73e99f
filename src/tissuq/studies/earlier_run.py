"""The posterior of an earlier run, fitted again as its recipe says."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING
from warnings import warn

from tissuq.discrepancy import Auto, NoDiscrepancy
from tissuq.errors import InputError
from tissuq.mechanics import Material, material_named
from tissuq.mechanics.user_law import LAW
from tissuq.posterior import Posterior
from tissuq.studies.settings import RECIPE, load_settings

if TYPE_CHECKING:
    from tissuq.studies.specimen import SpecimenSettings

__all__ = ["load_run", "load_run_without", "recipe_of"]

SUMMARY = "summary.json"
AGREEMENT = 1e-6
"""Relative difference between the headline parameter's means in the run and fitted again that needs no word."""


def load_run(folder: str | Path, discrepancy: str | None = None, material: Material | None = None) -> Posterior:
    """Return a posterior of a run of ``tissuq fit``.

    The run's measurements are fitted again as its ``run.toml`` says, from the copies in the run folder, with the same
    seed: a posterior is more than its draws. A warning tells where the result is not that of the run.

    Parameters
    ----------
    folder : str or Path
        The run folder.
    discrepancy : str, optional
        Which of the run's discrepancies; unless given, ``"auto"`` where the run has it, or the only one.
    material : Material, optional
        The material, where the run's is a law in a file of the user's own, which is not run unasked.

    Raises
    ------
    InputError, ModelError, ConvergenceError
        When the folder is no such run, or the discrepancy is not one of the run's; and as `tissuq.fit`.

    Examples
    --------
    >>> import tissuq as tq
    >>> posterior = tq.load_run("runs/brain", discrepancy="auto")  # doctest: +SKIP
    """
    from tissuq.studies.specimen import fitted

    run = Path(folder)
    settings, rows = recipe_of(run), _summary(run)
    _check_material(settings.material, material, folder)
    names = list(rows)
    name = discrepancy or (Auto.name if Auto.name in names else names[0] if len(names) == 1 else None)
    if name not in names:
        known = ", ".join(names)
        what = f"has no discrepancy '{name}'" if name else "has several discrepancies"
        raise InputError(f"run '{folder}' {what}: choose one of {known}.")
    posterior = fitted(settings, name, run, material)
    headline = posterior.model.headline
    before, now = rows[name].get(f"{headline}_mean"), float(posterior.summary(parameters=[headline])["mean"].iloc[0])
    if before is not None and abs(now - before) > AGREEMENT * abs(before):
        warn(
            f"fitted again, run '{folder}' gives {headline} = {now:.6g} MPa, and it gave {before:.6g} MPa: its files "
            "or tissuq have changed since.",
            stacklevel=2,
        )
    return posterior


def load_run_without(folder: str | Path, material: Material | None = None) -> Posterior:
    """Return the posterior without discrepancy of the measurements of a run, whether the run has one or not.

    Parameters and exceptions are those of `load_run`.
    """
    from tissuq.studies.specimen import fitted

    return fitted(recipe_of(folder), NoDiscrepancy.name, Path(folder), material)


def recipe_of(folder: str | Path) -> SpecimenSettings:
    """Return the settings of a run of ``tissuq fit``.

    Raises
    ------
    InputError
        When the folder is no such run.
    """
    from tissuq.studies.specimen import SpecimenSettings

    run = Path(folder)
    recipe = run / RECIPE
    if not run.is_dir():
        raise InputError(f"there is no run folder '{run}'.")
    if not recipe.is_file() or not (run / SUMMARY).is_file():
        raise InputError(f"folder '{run}' is not a complete run of tissuq fit: it lacks {RECIPE} or {SUMMARY}.")
    if " tissuq fit " not in recipe.read_text(encoding="utf-8").partition("\n")[0]:
        raise InputError(f"run '{run}' is not one of tissuq fit, and only these have a posterior to go on with.")
    return load_settings(SpecimenSettings, recipe, {})


def _summary(run: Path) -> dict[str, dict[str, float]]:
    """Return the rows of a run's summary by discrepancy."""
    try:
        rows = {row["formulation"]: row for row in json.loads((run / SUMMARY).read_text(encoding="utf-8"))}
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"folder '{run}' is not a complete run of tissuq fit: its {SUMMARY} is damaged.") from error
    if not rows:
        raise InputError(f"folder '{run}' is not a complete run of tissuq fit: its {SUMMARY} has no rows.")
    return rows


def _check_material(named: str, given: Material | None, run: str | Path) -> None:
    """Refuse another material than that of the run: what is wanted is the run's posterior, not a new fit."""
    if given is not None and not LAW.search(named) and given != material_named(named):
        raise InputError(
            f"run '{run}' is of the material '{named}', not '{given.name}': leave the material out, or fit anew."
        )
