"""Settings of material cards, the cards, and the base class of card formats."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import inf
from numbers import Real
from typing import Any, ClassVar, NamedTuple

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.errors import InputError, TissuqError
from tissuq.experiments.units import stress_unit
from tissuq.export.states import SeenStates
from tissuq.parameters.checks import check_count
from tissuq.posterior.ensemble import EnergyDraw, Ensemble
from tissuq.registry import find, variants


class UnitSystem(NamedTuple):
    """The units of a finite-element model that are consistent with one of stress, and the density of water in them."""

    units: str
    water_density: float


UNITS = {
    "MPa": UnitSystem("mm, N, t, s", 1e-9),
    "kPa": UnitSystem("mm, mN, kg, s", 1e-6),
    "Pa": UnitSystem("m, N, kg, s", 1e3),
}
DEFAULT_BULK_TO_SHEAR = 1000.0
"""Default bulk modulus over the mean initial shear modulus: near 0.4995 for Poisson's ratio."""

NEARLY = 20.0
"""Bulk modulus over the initial shear modulus below which the volume changes notably: Poisson's ratio of 0.475."""


def _is_between(value: object, high: float) -> bool:
    """Return whether a value is a number above zero and below another one."""
    return isinstance(value, Real) and 0 < float(value) < high


@dataclass(frozen=True)
class CardSettings:
    """Settings of material cards.

    Parameters
    ----------
    law : str, optional
        The family of materials in which the nearest one is taken: ``"polynomial"``, ``"reduced-polynomial"``,
        ``"ogden"`` or ``"mixture"``. Unless given, the draws' own law where the code has it, else the best of the
        code's projections: nearly all draws stable, then the smallest error.
    order : int, optional
        Order or number of terms of that family; unless given, the highest that the code supports and is worthwhile.
    unit : str
        Unit of stress in the finite-element model: ``"MPa"`` (mm, N, t), ``"kPa"`` (mm, mN, kg) or ``"Pa"`` (m, N, kg).
    bulk_modulus : float, optional
        Bulk modulus of all draws in that unit; unless given, 1000 times the mean initial shear modulus.
    poisson : float, optional
        Poisson's ratio at the reference, in place of a common bulk modulus: each draw then has its own bulk modulus.
    name : str
        Name of the material, the same in all cards so that they can be exchanged.
    number : int
        Number of the material in the model, for codes that ask for one (FEBio, LS-DYNA, ANSYS).
    source : str
        Origin of the draws, for the comments.

    Raises
    ------
    InputError
        When a value has no meaning.
    """

    law: str | None = None
    order: int | None = None
    unit: str = "MPa"
    bulk_modulus: float | None = None
    poisson: float | None = None
    name: str = "TISSUE"
    number: int = 1
    source: str = ""

    def __post_init__(self) -> None:
        if self.unit not in UNITS:
            raise InputError(f"the unit of a model must be one of {', '.join(UNITS)}, not '{self.unit}'.")
        if self.bulk_modulus is not None and self.poisson is not None:
            raise InputError("give the bulk modulus or Poisson's ratio, not both.")
        if self.bulk_modulus is not None and not _is_between(self.bulk_modulus, inf):
            raise InputError(f"a bulk modulus must be positive, not {self.bulk_modulus!r}.")
        if self.poisson is not None and not _is_between(self.poisson, 0.5):
            raise InputError(f"Poisson's ratio must lie between 0 and 0.5, not at {self.poisson!r}.")
        if self.order is not None and self.law is None:
            raise InputError("the order belongs to a law: give the law as well, such as polynomial or ogden.")
        check_count(self.number, "the number of a material in a model is 1 or more")
        if not isinstance(self.name, str) or not re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]{0,39}", self.name):
            raise InputError(
                f"'{self.name}' cannot name a material: use up to 40 letters, digits, _ and -, a letter first."
            )

    @property
    def factor(self) -> float:
        """The number of units of stress in one MPa."""
        return 1 / stress_unit(self.unit).to_mpa

    @property
    def system(self) -> UnitSystem:
        """The consistent units of length, force, mass and time."""
        return UNITS[self.unit]

    def bulk(self, modulus: float, mean: float) -> float:
        """Return the bulk modulus of a draw with this initial shear modulus, in the unit, where all have that mean.

        Raises
        ------
        InputError
            When Poisson's ratio gives none, because the shear modulus is not positive; or when the bulk modulus is so
            small that Poisson's ratio would be negative.
        """
        if self.poisson is not None and not modulus > 0:
            raise InputError(
                "a draw's initial shear modulus is not positive, so that Poisson's ratio gives it no bulk modulus: "
                "give that of all draws (--bulk-modulus), or leave out draws that are not stable."
            )
        if self.poisson is not None:
            return 2 * modulus * (1 + self.poisson) / (3 * (1 - 2 * self.poisson))
        bulk = self.bulk_modulus if self.bulk_modulus is not None else DEFAULT_BULK_TO_SHEAR * mean
        if 3 * bulk <= 2 * modulus:
            raise InputError(
                f"a bulk modulus of {bulk:g} {self.unit} gives a draw with an initial shear modulus of {modulus:.3g} "
                f"{self.unit} a Poisson's ratio that is not positive, and the measurements are taken as those of an "
                f"incompressible material: give {NEARLY * modulus:.2g} {self.unit} or more, or none (--bulk-modulus)."
            )
        return bulk


@dataclass(frozen=True)
class Cards:
    """Draws as files for another program.

    Attributes
    ----------
    files : mapping of str to str
        Texts by the names of the files, one for each draw.
    index : tuple of mappings
        A row for each draw, in the order of the files: parameters, constants, and how far its card is from the draw.
    warnings : tuple of str
        Sentences that the user must read: the law of the cards, its errors, and cards that are not stable.
    blocks : tuple of str
        The material of each draw alone, without comments and what makes a file of it; none of tables.
    outside : str
        What of the draws their blocks do not hold, in a sentence; nothing where they hold all.
    """

    files: Mapping[str, str]
    index: tuple[Mapping[str, Any], ...]
    warnings: tuple[str, ...]
    blocks: tuple[str, ...] = ()
    outside: str = ""

    def __repr__(self) -> str:
        first, *_, last = [*self.files, *self.files]
        return f"<Cards of {len(self.files)} draws: {first} to {last}>"


class CardFormat(ABC):
    """A way to write draws for another program; a new one is one subclass in one file."""

    entry_point_group: ClassVar[str] = "tissuq.card_formats"
    name: ClassVar[str]
    description: ClassVar[str]
    kind: ClassVar[str] = "cards"
    """What its files are."""
    unused: ClassVar[tuple[str, ...]] = ()
    """Settings of cards that its files have no place for."""

    @abstractmethod
    def cards(self, ensemble: Ensemble, settings: CardSettings) -> Cards:
        """Return the draws as files."""

    def checked_cards(self, ensemble: Ensemble, settings: CardSettings) -> Cards:
        """Return `cards`; whatever else a format of another package raises or returns is an error in words.

        Raises
        ------
        TissuqError
            As `cards` does, and when it fails or does not return files with a row of the index for every draw.
        """
        format_name = f"the format of cards '{self.name}' ({type(self).__module__}.{type(self).__qualname__})"
        try:
            cards = self.cards(ensemble, settings)
        except TissuqError:
            raise
        except Exception as error:  # of code that is not from here
            raise InputError(f"{format_name} cannot write the draws: {type(error).__name__}: {error}.") from error
        if not isinstance(cards, Cards):
            raise InputError(f"{format_name} must return tissuq.export.cards.Cards, not {type(cards).__name__}.")
        if len(cards.index) != len(ensemble):
            raise InputError(
                f"{format_name} returns {len(cards.index)} rows of the index for {len(ensemble)} draws: return one for "
                "each."
            )
        return cards


def card_formats() -> dict[str, type[CardFormat]]:
    """Return the formats by name."""
    return variants(CardFormat)


def card_format(name: str) -> CardFormat:
    """Return the format of that name.

    Raises
    ------
    InputError
        When there is none.
    """
    return find(CardFormat, "format of cards", name, InputError)()


def file_name(ensemble: Ensemble, draw_index: int, suffix: str) -> str:
    """Return the name of a draw's file, so that names sort like numbers."""
    return f"draw-{draw_index + 1:0{len(str(len(ensemble)))}d}{suffix}"


def ensemble_lines(ensemble: Ensemble, settings: CardSettings) -> Iterator[str]:
    """Return the sentences that are true of all draws."""
    model = ensemble.model
    names = f"{model.material.name}, discrepancy {model.discrepancy.name}"
    yield f"tissuq: equally probable draws of the posterior of {names}"
    yield from ensemble_sentences(ensemble)
    yield f"source: {settings.source or model.experiment.name}"
    has_discrepancy = ensemble[0].discrepancy is not None or len(ensemble[0].parts) > 1
    yield f"energy of the draws: material{' and discrepancy' * has_discrepancy}"
    if ensemble.admissible_in:
        yield (
            f"admissible: stable over the measured range in {', '.join(ensemble.admissible_in)}; "
            f"{len(ensemble)} of {ensemble.tried} draws that were tried are"
        )
    else:
        yield "admissible: not looked at, draws may be unstable"
    yield calibrated_stretches(ensemble)


def calibrated_stretches(ensemble: Ensemble) -> str:
    """Return in words how far draws are known in every loading mode."""
    ends = (f"{mode} {low:.4g} to {high:.4g}" for mode, (low, high) in ensemble.ranges.items())
    return f"calibrated stretches: {', '.join(ends)}; beyond, the material is an extrapolation"


def ensemble_sentences(ensemble: Ensemble) -> Iterator[str]:
    """Yield that draws are those of no fit of measurements, and what of the fit's stress is in none of them."""
    if ensemble.origin:
        yield f"The draws are those of {ensemble.origin}."
    discrepancy = ensemble.model.discrepancy
    if discrepancy.is_scattered:
        yield (
            f"The scatter S of the discrepancy '{discrepancy.name}' about its mean is in no draw, as it differs from "
            "measurement to measurement and no energy does: what is computed with the draws spreads less than the "
            "stress that the fit predicts."
        )


def draw_row(draw: EnergyDraw, settings: CardSettings, modulus: float) -> dict[str, Any]:
    """Return the row of a draw in the index: its number, parameters (stresses in the unit), and its modulus."""
    parameters = _parameters(draw, settings)
    return {"draw": draw.number + 1, "unit": settings.unit, **parameters, "initial_shear_modulus": modulus}


def words_of(draw: EnergyDraw, settings: CardSettings) -> str:
    """Return the parameters of a draw in words, stresses in the unit."""
    return ", ".join(f"{symbol} = {value:.6g}" for symbol, value in _parameters(draw, settings).items())


def distances_from_median(ensemble: Ensemble) -> FloatArray:
    """Return how far draws (N,) are from the median of all: root mean square difference of stresses in the seen states.

    Relative to the sizes of the medians; the draw with the smallest is the most typical.
    """
    states = SeenStates(ensemble.most)
    stress = ensemble.stress(states, states.points)
    median = np.median(stress, axis=0)
    return np.asarray(np.sqrt((((stress - median) / np.abs(median)) ** 2).mean(axis=1)))


def _parameters(draw: EnergyDraw, settings: CardSettings) -> dict[str, float]:
    values: dict[str, float] = {}
    for number, (material, drawn) in enumerate(draw.parts):
        for parameter, value in zip(material.parameters, drawn, strict=True):
            if number == 0 or value:  # of the material whose terms a discrepancy adds, others are zero
                factor = settings.factor if parameter.unit == "MPa" else 1.0
                values[parameter.symbol] = values.get(parameter.symbol, 0.0) + value * factor
    return values
