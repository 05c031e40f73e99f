"""The study of which test to make next, after a run of ``tissuq fit``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pydantic import BaseModel, ConfigDict, Field

from tissuq.assessment.candidates import Candidate, candidate_named
from tissuq.assessment.next_test import NextTest
from tissuq.assessment.ranking import rank_tests
from tissuq.assessment.targets import MODULUS, Target, target_named
from tissuq.errors import InputError
from tissuq.experiments.units import StressUnit, stress_unit
from tissuq.mechanics import Material
from tissuq.posterior import Posterior
from tissuq.studies.earlier_run import load_run

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["CandidateSettings", "DesignSettings", "DesignStudy", "run_design"]


class CandidateSettings(BaseModel):
    """A test that could be made, at any stretches."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    mode: str
    stretch: tuple[float, ...] = Field(min_length=1)
    name: str = ""


class DesignSettings(BaseModel):
    """Everything that a ranking of tests depends on."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    run: str
    discrepancy: str | None = None
    candidates: tuple[str | CandidateSettings, ...] = ()
    targets: tuple[str, ...] = Field((MODULUS,), min_length=1)
    points: tuple[int, ...] = ()
    specimen: Literal["same", "other"] | None = None
    seed: int = Field(0, ge=0)

    @property
    def tests(self) -> list[Candidate]:
        """The candidates; none where these are the usual ones."""
        return [
            candidate_named(each) if isinstance(each, str) else Candidate(each.mode, each.stretch, each.name)
            for each in self.candidates
        ]


@dataclass(frozen=True)
class DesignStudy:
    """What was found.

    Attributes
    ----------
    settings : DesignSettings
    posterior : Posterior
    targets : tuple of Target
    table : pandas.DataFrame
        Of `tissuq.assessment.rank_tests`.
    specimen : str
        Of which specimen a test to come was taken to be, and by how much, relative, its stress may be off by itself.
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
    def notes(self) -> list[str]:
        """What a reader must know."""
        whose = (
            f"of another specimen, whose stresses are off by {self.error:.0%} or so as a whole"
            if self.specimen == "other"
            else "of the same specimen, without errors of its own; ask for one of another (--specimen other) otherwise"
        )
        rough = ["Rough: few components of the posterior would be left, and the number is not to be trusted."]
        return [
            "Expected sd: root of the expected posterior variance, over all that the test may show. Its error is that "
            "of a simulation; differences of the order of it say nothing.",
            f"A test to come is one {whose}. Its noise is that of the data.",
            "What is expected holds as far as the fitted model does: material, discrepancy and noise.",
            *rough * bool(self.table["is_rough"].any()),
        ]


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
        raise InputError("numbers of points are those of the usual tests; a candidate says its own: give only one.")
    step("the earlier run")
    posterior = load_run(folder / settings.run, settings.discrepancy, law)
    targets = tuple(dict.fromkeys(target_named(each, posterior.model) for each in settings.targets))
    options = {"points": settings.points, "specimen": settings.specimen, "seed": settings.seed}
    table = rank_tests(posterior.solution, tests, targets, step=step, **options)  # type: ignore[arg-type]
    asked = NextTest(posterior.solution, targets, settings.specimen)
    return DesignStudy(settings, posterior, targets, table, asked.specimen, asked.tolerances.stress)
