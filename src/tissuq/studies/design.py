"""The study of which test to make next, after a run of ``tissuq fit``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from tissuq.errors import InputError, ModelError
from tissuq.experiments.units import StressUnit, stress_unit
from tissuq.mechanics import Material
from tissuq.next_test.candidates import Target, target_named
from tissuq.next_test.next_test import NextTest
from tissuq.next_test.quantities import QuantityTarget
from tissuq.next_test.ranking import rank_tests
from tissuq.posterior.posterior import Posterior
from tissuq.studies.design_settings import DesignSettings
from tissuq.studies.earlier_run import load
from tissuq.studies.ensemble_target import ensemble_target, names_ensemble

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["DesignSettings", "DesignStudy", "run_design"]

WELL_EXPLAINED = 0.9
"""Share of the variance of a quantity of a model from which nothing need be said of the rest."""


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
    def unit(self) -> StressUnit:
        """The unit of stress of the data."""
        return stress_unit(self.posterior.model.experiment.stress_unit)

    @property
    def explanations(self) -> list[str]:
        """How to read the table."""
        whose = (
            f"another specimen, whose stresses differ by about {100 * self.error:.0f} % as a whole; standard "
            "deviations, now and after, are of the mean of the tissue's specimens"
            if self.specimen == "other"
            else "the same specimen, without additional test errors; for another specimen use --next-specimen other"
        )
        return [
            "Expected sd: square root of the expected posterior variance, averaged over the possible outcomes of the "
            "test. The error given is that of the simulation: a test is as good as the best where their difference is "
            "less than two standard errors of it, or than 1 % of the sd now.",
            f"The next test is on {whose}. Its noise is that of the data.",
            "The expectations are only as good as the fitted model: material, discrepancy and noise.",
        ]

    @property
    def warnings(self) -> list[str]:
        """Warnings about the numbers in the table."""
        inaccurate = "Numbers marked rough are not reliable: few components of the posterior would remain."
        unexplained = [
            f"{target.words}: the stresses of the material within the measured strains explain "
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
        ensemble_target(name, posterior, folder) if names_ensemble(name) else target_named(name, posterior.model)
        for name in dict.fromkeys(settings.targets)
    )
    if len({target.name for target in targets}) < len(set(targets)):
        raise InputError("two ensembles with quantities of one name are in folders of one name: rename one of these.")
    options = {"points": settings.points, "specimen": settings.specimen, "seed": settings.seed}
    table = rank_tests(posterior.solution, tests, targets, step=step, **options)  # type: ignore[arg-type]
    next_test = NextTest(posterior.solution, targets, settings.specimen)
    return DesignStudy(settings, posterior, targets, table, next_test.specimen, next_test.tolerances.stress)
