"""By how much whole tests may be off, and so what the intervals of a study are of."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import field_validator

from tissuq.studies.option import Settings, option
from tissuq.studies.option_texts import tolerances
from tissuq.studies.settings import SizesOfErrors, looked_up

if TYPE_CHECKING:
    from tissuq.experiments.units import StressUnit
    from tissuq.model.tolerances import Tolerances

__all__ = ["ToleranceSettings"]


class ToleranceSettings(Settings):
    """Errors of whole tests, in the files' unit of stress."""

    estimand: str | None = option(
        None,
        "What intervals are of: the specimen as-tested (no errors of the test), the specimen (errors of a careful "
        "laboratory), or the tissue (the mean of its specimens) [specimen; tissue for files of several specimens].",
    )
    tolerances: SizesOfErrors = option(
        None,
        "Error of a whole test (standard deviation) instead of that of the estimand: stress=10%, test=10%, length=2%, "
        "slack=0.01 (of stretch), smooth=2% (along the curve), zero=0.1 (in the stress unit), or of every single "
        "stretch=0.001 or stress, resolution=0.2% (of the largest); or none; repeat.",
        name="tolerance",
        takes=list[str],
        parse=tolerances,
    )

    @field_validator("estimand")
    @classmethod
    def _estimand_there_is(cls, name: str | None) -> str | None:
        from tissuq.model.tolerances import Tolerances

        if name is not None:
            looked_up(Tolerances, name)
        return name

    def tolerances_in(self, unit: StressUnit) -> Tolerances | dict[str, float] | None:
        """Return the tolerances, those of stresses converted from a unit to MPa.

        Where no estimand is given, the sizes that replace those of `tissuq.fit`, or None.
        """
        from tissuq.model.tolerances import Tolerances

        if self.tolerances is None and self.estimand is None:
            return None
        sizes = self.tolerances or {}
        is_stress = {error.name for error, _ in Tolerances(**sizes) if error.is_stress}
        scale = {name: unit.to_mpa if name in is_stress else 1.0 for name in sizes}
        in_mpa = {name: size * scale[name] for name, size in sizes.items()}
        return in_mpa if in_mpa and self.estimand is None else Tolerances(self.estimand or "", **in_mpa)
