"""A parameter: its symbol, unit, support and default prior, stated once."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Literal

from tissuq.parameters.priors import Prior, Uniform


@dataclass(frozen=True)
class Parameter:
    """A parameter of a material, a discrepancy or the noise.

    Attributes
    ----------
    symbol : str
        The name in the papers, for example ``C10``.
    description : str
        Meaning in a few words.
    dimension : str
        ``"stress"`` or ``"modulus"`` (both MPa); ``"stretch"``, ``"number"``, ``"limit"`` (a value of I1 - 3 that no
        measurement may reach) or ``"rate"`` (one over a value of I1 - 3), all dimensionless.
    support : tuple of float
        Smallest and largest meaningful value; a limit also lies beyond the data.
    is_linear : bool
        Whether the stress is proportional to it.
    relative_prior : Prior or None
        The default prior in units of the data: the largest measured stress for a stress, the range of the measured
        stretches for a stretch, for a modulus the typical ratio of the stress to that of a neo-Hookean material with
        C10 = 1, the largest I1 - 3 for a limit and one over it for a rate. Linear parameters have none: theirs is
        uniform over a range around the least-squares solution (`tissuq.model.statistical_model.StatisticalModel`).
    """

    symbol: str
    description: str
    dimension: Literal["stress", "modulus", "stretch", "number", "limit", "rate"] = "stress"
    support: tuple[float, float] = (-inf, inf)
    is_linear: bool = True
    relative_prior: Prior | None = None

    @property
    def unit(self) -> str:
        """The unit of its values: MPa, or nothing."""
        return "MPa" if self.dimension in ("stress", "modulus") else ""

    @classmethod
    def scale(cls, symbol: str, description: str) -> Parameter:
        """Return a positive parameter that sets the size of a random error in stress."""
        return cls(symbol, description, "stress", (0.0, inf), False, Uniform(0.0, 1.0))

    @classmethod
    def shear_modulus(cls, law: str) -> Parameter:
        """Return the initial shear modulus of a law."""
        return cls("mu", f"initial shear modulus of {law}", support=(0.0, inf))
