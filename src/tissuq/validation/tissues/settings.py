"""What a benchmark on real tissue runs over."""

from __future__ import annotations

from pydantic import Field, field_validator

from tissuq.mechanics import material_named
from tissuq.model.discrepancy import discrepancy_named
from tissuq.studies.campaign_settings import TissueOptions
from tissuq.studies.settings import there_is
from tissuq.validation.tissues.protocols import PROTOCOLS

__all__ = ["RIVALS", "TissueSettings"]

RIVALS = {"embedded": {"discrepancy": "none", "noise_sd": "proportional"}}
"""What is fitted under names that are no discrepancy.

Embedded: the stiffness of the law is random, anew at every measurement. So the stress of a law that is linear in its
stiffness has an independent error in proportion to it, as with proportional noise: the independent normal form of
Sargsyan, Huan & Najm (2019, arXiv:1801.06768), which Andres Arcones et al. (2026, Data-Centric Engineering) extend.
"""


class TissueSettings(TissueOptions):
    """Everything that a benchmark on real tissue depends on, but for the data themselves.

    Attributes
    ----------
    folder : str, optional
        Of the data sets (`tissuq.validation.tissues.read_corpus`); without it those of the package.
    sets : tuple of str
        Names of the sets that are taken; all, where there are none.
    protocols : tuple of str
        Which tests are predicted from which (`PROTOCOLS`).
    formulations : tuple of str
        Discrepancies of the fits, or ``"embedded"`` (`RIVALS`).
    material : str
    tolerances : dict of str to float, optional
        Standard deviations of errors of the tests (`tissuq.Tolerances`, stresses in MPa); without it those of what is
        predicted (`ESTIMAND_OF_PROTOCOL`): of the tissue for a new test, of the specimen for a test of the same one,
        none for a part of the same test.
    points : int
        Number of measurements at most that are taken from a test, evenly along it.
    predictions : int
        Number of predictions at most for each set and protocol, evenly among all.
    """

    points: int = Field(30, ge=4, le=10_000)

    @field_validator("protocols")
    @classmethod
    def _known_protocols(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        for name in names:
            if name not in PROTOCOLS:
                raise ValueError(f"there is no protocol '{name}'; choose from {', '.join(PROTOCOLS)}")
        return names

    _known_formulations = field_validator("formulations")(
        there_is(lambda name: RIVALS.get(name) or discrepancy_named(name))
    )
    _known_material = field_validator("material")(there_is(material_named))

    @field_validator("protocols", "formulations")
    @classmethod
    def _present_once(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        if not names or len(set(names)) < len(names):
            raise ValueError("give one or more names, each once")
        return names
