"""What a ranking of tests depends on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from pydantic import Field

from tissuq.studies.option import Settings, option
from tissuq.studies.shared_options import RunSettings, seed

if TYPE_CHECKING:
    from tissuq.next_test.candidates import Candidate

__all__ = ["CandidateSettings", "DesignSettings"]


class CandidateSettings(Settings):
    """A test that could be made, at any stretches."""

    mode: str
    stretch: tuple[float, ...] = Field(min_length=1)
    name: str = ""


class DesignSettings(RunSettings):
    """Everything that a ranking of tests depends on."""

    targets: tuple[str, ...] = option(
        ("modulus",),
        "Quantity to become less uncertain: modulus (initial shear modulus), a parameter, a stress as MODE:STRETCH, "
        "such as planar:1.5, or a quantity of your model as ensemble:FOLDER:NAME; repeat for more [modulus].",
        name="target",
        min_length=1,
    )
    candidates: tuple[str | CandidateSettings, ...] = option(
        (),
        "A test as 'MODE LOW:HIGH POINTS', such as 'planar 1:1.5 20'; repeat for more [every mode of one stretch, in "
        "several ranges].",
        name="candidate",
    )
    points: tuple[int, ...] = option(
        (),
        "Measurements of every default test; repeat for more [as many as the data, 10 to 40].",
        name="measurements",
    )
    specimen: Literal["same", "other"] | None = option(
        None,
        "The next test is of the same specimen or of another one [other where the fit has errors of tests, else same].",
        name="next-specimen",
    )
    seed: int = seed()

    @property
    def tests(self) -> list[Candidate]:
        """The candidates; empty for the default ones."""
        from tissuq.next_test.candidates import Candidate, candidate_named

        return [
            candidate_named(candidate)
            if isinstance(candidate, str)
            else Candidate(candidate.mode, candidate.stretch, candidate.name)
            for candidate in self.candidates
        ]
