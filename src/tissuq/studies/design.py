"""The study of which test to make next, after a run of ``tissuq fit``, for its parameters or an ensemble's quantity."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tissuq.errors import InputError, ModelError
from tissuq.experiments.modes import loading_mode
from tissuq.mechanics import Material
from tissuq.model.statistical_model import StatisticalModel
from tissuq.next_test.next_test import NextTest
from tissuq.next_test.ranking import rank_tests
from tissuq.next_test.targets import QuantityTarget, Target, quantity_target, target_named
from tissuq.posterior.posterior import Posterior
from tissuq.studies.earlier_run import load
from tissuq.studies.ensemble import drawn_materials
from tissuq.studies.finite_element_settings import EnsembleSettings
from tissuq.studies.run_settings import DesignSettings
from tissuq.studies.settings import RECIPE, damage_reported, load_settings

if TYPE_CHECKING:
    import pandas as pd

WELL_EXPLAINED = 0.9
"""Share of the variance of a quantity of a model from which nothing need be said of the rest."""
PREFIX = "ensemble:"
"""Of a target that is a quantity of an ensemble: ``ensemble:FOLDER`` or ``ensemble:FOLDER:NAME``."""
STATES_PER_MODE = 5
"""Stretches, over the measured strains, of every loading mode of which the stresses stand for the material."""


@dataclass(frozen=True)
class DesignStudy:
    """Results of a ranking of tests.

    Attributes
    ----------
    settings : DesignSettings
    posterior : Posterior
    targets : tuple of Target
    table : pandas.DataFrame
        Of `tissuq.next_test.rank_tests`.
    specimen : str
        Whether the next test is on the same specimen or another one, and the relative error of its stress as a whole.
    error : float
    """

    settings: DesignSettings
    posterior: Posterior
    targets: tuple[Target, ...]
    table: pd.DataFrame
    specimen: str
    error: float

    @property
    def explanations(self) -> list[str]:
        """How to read the table."""
        whose = (
            f"another specimen (three more of the same: each on one of its own), whose stresses differ by about "
            f"{100 * self.error:.0f} % as a whole; standard deviations, now and after, are of the mean of the tissue's "
            "specimens"
            if self.specimen == "other"
            else "the same specimen, without additional test errors; for another specimen use --next-specimen other"
        )
        rows = self.posterior.model.experiment
        points = f", and its points, as those of the fit, are {rows.rows_name}"
        return [
            "Expected sd: square root of the expected posterior variance, averaged over the possible outcomes of the "
            "test. The error given is that of the simulation: a test is as good as the best where their difference is "
            "less than two standard errors of it, or than 1 % of the sd now.",
            f"The next test is on {whose}. Its noise is that of the data{points * (rows.averaged_at_most > 1)}.",
            "The expectations are only as good as the fitted model: material, discrepancy and noise.",
        ]

    @property
    def warnings(self) -> list[str]:
        """Warnings about the numbers in the table."""
        inaccurate = "Numbers marked rough are not reliable: few components of the posterior would remain."
        unexplained = [
            f"{target.title}: the stresses of the material within the measured strains explain "
            f"{100 * target.explained:.0f} % of its variance over the draws of the ensemble. The rest (strains beyond, "
            "other materials, what is not linear) stays in every expected sd."
            for target in self.targets
            if isinstance(target, QuantityTarget) and target.explained < WELL_EXPLAINED
        ]
        return [inaccurate] * bool(self.table["is_rough"].any()) + unexplained


def run_design(
    settings: DesignSettings,
    folder: Path = Path(),
    step: Callable[[str], None] = lambda text: None,
    law: Material | None = None,
) -> DesignStudy:
    """Take up a run, which lies in ``folder`` where it is relative, and rank tests.

    Raises
    ------
    InputError, ModelError, ConvergenceError
        When the run or the settings cannot be used.
    """
    tests = settings.tests
    if tests and settings.points:
        raise InputError(
            "--measurements is for the default tests and a candidate states its own points: give only one of them."
        )
    step("loading the run")
    posterior = load(folder / settings.run, settings.discrepancy, settings.law_of(law))
    if not posterior.solution.is_of_data:
        raise ModelError(
            f"of run '{settings.run}' no stress was measured, it gives {posterior.solution.reason}: what a further "
            "test would tell beside it is not known. Take a run of tissuq fit."
        )
    targets = tuple(
        _ensemble_target(name, posterior, folder) if name.startswith(PREFIX) else target_named(name, posterior.model)
        for name in dict.fromkeys(settings.targets)
    )
    if len({target.name for target in targets}) < len(set(targets)):
        raise InputError("two ensembles with quantities of one name are in folders of one name: rename one of these.")
    options = {"points": settings.points, "specimen": settings.specimen, "seed": settings.seed}
    table = rank_tests(posterior.solution, tests, targets, step=step, **options)  # type: ignore[arg-type]
    next_test = NextTest(posterior.solution, targets, settings.specimen)
    return DesignStudy(settings, posterior, targets, table, next_test.specimen, next_test.tolerances.stress)


def with_folder(text: str, changed: Callable[[str], str]) -> str:
    """Return a target with the folder of its ensemble changed; any other as it is."""
    if not text.startswith(PREFIX):
        return text
    folder, name = _parts(text)
    return f"{PREFIX}{changed(folder)}" + (f":{name}" if name else "")


def _ensemble_target(text: str, posterior: Posterior, beside: Path) -> QuantityTarget:
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
