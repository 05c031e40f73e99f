"""A quantity of an earlier ensemble as what the next test is for."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments.modes import loading_mode
from tissuq.model.statistical_model import StatisticalModel
from tissuq.next_test.quantities import QuantityTarget, quantity_target
from tissuq.posterior.posterior import Posterior
from tissuq.studies.ensemble import drawn_materials
from tissuq.studies.model_settings import EnsembleSettings
from tissuq.studies.settings import RECIPE, damage_reported, load_settings

__all__ = ["ensemble_target", "names_ensemble", "with_folder"]

PREFIX = "ensemble:"
STATES_PER_MODE = 5
"""Stretches, over the measured strains, of every loading mode of which the stresses stand for the material."""


def names_ensemble(text: str) -> bool:
    """Return whether a target is a quantity of an ensemble: ``ensemble:FOLDER`` or ``ensemble:FOLDER:NAME``."""
    return text.startswith(PREFIX)


def with_folder(text: str, changed: Callable[[str], str]) -> str:
    """Return a target with the folder of its ensemble changed; any other as it is."""
    if not names_ensemble(text):
        return text
    folder, name = _parts(text)
    return f"{PREFIX}{changed(folder)}" + (f":{name}" if name else "")


def ensemble_target(text: str, posterior: Posterior, beside: Path) -> QuantityTarget:
    """Return the last value of a quantity of the user's model as a target of the next test.

    Parameters
    ----------
    text : str
        ``ensemble:FOLDER``, or ``ensemble:FOLDER:NAME`` where the ensemble has several quantities.
    posterior : Posterior
        From which one of the ensemble's materials is.
    beside : Path
        Where the folder lies, unless its name is absolute.

    Raises
    ------
    InputError
        When there is no such ensemble or quantity, its materials are of other fits, or too few draws give it.
    """
    import pandas as pd

    folder_name, name = _parts(text)
    folder = beside / folder_name
    recipe, table = folder / RECIPE, folder / "draws.csv"
    if not (recipe.is_file() and table.is_file()):
        raise InputError(
            f"target '{text}': there is no complete ensemble in '{folder}'; write {PREFIX}FOLDER with the folder of "
            "tissuq ensemble."
        )
    with damage_reported(recipe):
        settings = load_settings(EnsembleSettings, recipe, {})
    name = name or (next(iter(settings.quantities)) if len(settings.quantities) == 1 else "")
    if name not in settings.quantities:
        options = ", ".join(f"{PREFIX}{folder_name}:{quantity}" for quantity in settings.quantities)
        raise InputError(f"target '{text}': the ensemble has the quantities of these targets: {options}.")
    with damage_reported(table):
        values = pd.read_csv(table)[name].to_numpy(dtype=np.float64)
    ensembles = drawn_materials(settings, folder).values()
    of_fit = [ensemble for ensemble in ensembles if _account(ensemble.model) == _account(posterior.model)]
    if not of_fit or len(of_fit[0]) != len(values):
        raise InputError(
            f"target '{text}': none of the materials of the ensemble ({', '.join(settings.materials)}) is of this run "
            "and this discrepancy; make the ensemble from it anew (tissuq ensemble RUN MODEL ...)."
        )
    states = [
        (loading_mode(mode), np.array([stretch]))
        for mode, measured in posterior.stable_ranges.items()
        for stretch in np.linspace(measured.low, measured.high, STATES_PER_MODE)
    ]
    stresses = np.concatenate([of_fit[0].stress(mode, stretch) for mode, stretch in states], axis=1)
    text = f"{PREFIX}{folder.resolve().name}:{name}"
    return quantity_target(text, f"{name} of the model {Path(settings.model).name}", states, stresses, values)


def _parts(text: str) -> tuple[str, str]:
    """Return folder and name of the quantity, which may be nothing."""
    address = text.removeprefix(PREFIX)
    folder, _, name = address.rpartition(":")
    return (folder, name) if folder and not {"/", "\\"} & set(name) else (address, "")


def _account(model: StatisticalModel) -> tuple[object, ...]:
    """Return by what two models are seen to be of the same fit."""
    return model.material.name, model.discrepancy.name, model.experiment.measured.tolist()
