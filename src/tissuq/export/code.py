"""What a finite-element code knows: its forms, the projections that fit in them, and the text of a card."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from textwrap import wrap
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tissuq.ensemble import Ensemble
from tissuq.errors import InputError
from tissuq.export.cards import CardFormat, Cards, CardSettings
from tissuq.export.forms import Form
from tissuq.export.heading import distances_from_median, draw_row, ensemble_lines, file_name, words_of
from tissuq.export.laws import Law, exact_law
from tissuq.export.projection import Projection, projections
from tissuq.export.states import are_stable, differences, moduli

__all__ = ["Card", "FECode"]

FloatArray = NDArray[np.float64]

MOSTLY = 0.9
"""Share of stable draws from which one projection is no better than another for having more."""
WIDTH = 110
"""Of comments."""


@dataclass(frozen=True)
class Card:
    """One material for a code, in the unit of the model.

    Attributes
    ----------
    form : Form
    constants : mapping of str to float
        In the order of the form.
    shear, bulk : float
        Initial moduli.
    name : str
        Of the material.
    water : float
        The density of water, for codes that need a density.
    """

    form: Form
    constants: Mapping[str, float]
    shear: float
    bulk: float
    name: str
    water: float

    @property
    def poisson(self) -> float:
        """Poisson's ratio at the reference."""
        return (3 * self.bulk - 2 * self.shear) / (2 * (3 * self.bulk + self.shear))


@dataclass(frozen=True, eq=False)
class Told:
    """The law of all cards, how far it is from the draws, and whether it is stable."""

    law: Law
    form: Form
    is_exact: bool
    apart: Mapping[str, FloatArray]
    stable: NDArray[np.bool_]

    @property
    def rank(self) -> tuple[bool, float]:
        """The better the smaller: nearly all draws stable, then nearer ones."""
        return bool(self.stable.mean() < MOSTLY), float(np.sqrt((self.apart["states"] ** 2).mean()))


class FECode(CardFormat):
    """A finite-element code. A new one names its forms and projections and writes the text of a card.

    The energy of a card is W of the isochoric stretches, l / J^(1/3), plus the volumetric energy that it states.
    """

    suffix: ClassVar[str]
    comment: ClassVar[tuple[str, str]]
    """What begins and what ends a line of comment."""
    volumetric: ClassVar[str]
    checked: ClassVar[str]
    """Whether the code itself has judged its cards."""
    forms: ClassVar[tuple[Form, ...]]
    """In order of preference."""
    projections: ClassVar[tuple[Projection, ...]]
    """One of every family that the code has, the best of which is taken where it has not the draws' own law."""

    @abstractmethod
    def text(self, card: Card) -> str:
        """Return the lines of a card, without comments."""

    def check(self, card: Card) -> None:
        """Refuse a card that the code would not read as it is meant."""

    def wrapped(self, heading: str, text: str) -> str:
        """Return a file of comments and a card."""
        return heading + text

    def cards(self, ensemble: Ensemble, settings: CardSettings) -> Cards:
        told = self._told(ensemble, settings)
        shear = moduli(ensemble) * settings.factor
        if not shear.mean() > 0:
            raise InputError(
                "the mean initial shear modulus of the draws is not positive: no card can be made of them."
            )
        values = told.law.scaled(settings.factor).values
        common = [*ensemble_lines(ensemble, settings), *self._law_lines(told, settings)]
        files, index = {}, []
        for place, (own, distance) in enumerate(zip(shear, distances_from_median(ensemble), strict=True)):
            constants = told.form.constants(told.law.material, values[place])
            bulk = settings.bulk(float(own), float(shear.mean()))
            card = Card(told.form, constants, float(own), bulk, settings.name, settings.system.water)
            self.check(card)
            apart = {name: each[place] for name, each in told.apart.items()}
            row = {"file": file_name(ensemble, place, self.suffix), **draw_row(ensemble[place], settings, card.shear)}
            row |= {"bulk_modulus": bulk, "form": told.form.keyword, **_prefixed(constants)}
            row |= _errors(apart) | {"card_is_stable": bool(told.stable[place]), "from_median": float(distance)}
            lines = [f"draw {place + 1} of {len(ensemble)}: {words_of(ensemble[place], settings)}", *common]
            lines += self._error_lines(apart, told.is_exact, bool(told.stable[place]))
            files[str(row["file"])] = self.wrapped(self._commented(lines), self.text(card))
            index.append(row)
        return Cards(files, tuple(index), tuple(self._notes(told)))

    def form_of(self, law: Law) -> Form | None:
        """Return the first form that holds a law, if any."""
        return next((form for form in self.forms if form.holds(law.material)), None)

    def _told(self, ensemble: Ensemble, settings: CardSettings) -> Told:
        own = exact_law(ensemble) if settings.law is None else None
        form = self.form_of(own) if own is not None else None
        if own is not None and form is not None:
            return self._judged(ensemble, own, form, is_exact=True)
        found = [self._projected(ensemble, each) for each in self._asked(settings)]
        return min(found, key=lambda told: told.rank)

    def _projected(self, ensemble: Ensemble, projection: Projection) -> Told:
        law = projection.law(ensemble)
        form = self.form_of(law)
        if form is None:
            raise InputError(f"{self.name} has no form for {law.material.name}; ask for another order.")
        return self._judged(ensemble, law, form, is_exact=False)

    def _judged(self, ensemble: Ensemble, law: Law, form: Form, *, is_exact: bool) -> Told:
        own = law.ensemble(ensemble)
        return Told(law, form, is_exact, differences(own, ensemble), are_stable(own))

    def _asked(self, settings: CardSettings) -> Sequence[Projection]:
        if settings.law is None:
            return self.projections
        kinds = {each.family: each for each in self.projections}
        if settings.law not in kinds:
            known = ", ".join(kinds)
            every = "" if settings.law in projections() else f"there is no law '{settings.law}'; "
            raise InputError(f"{every}cards for {self.name} can be of the laws {known}.")
        own = kinds[settings.law]
        return [own if settings.order is None else type(own).of_order(settings.order)]

    def _law_lines(self, told: Told, settings: CardSettings) -> Iterator[str]:
        yield f"form: {told.form.keyword}, W = {told.form.formula}; I1, I2, l of the isochoric part, l / J^(1/3)"
        yield f"volume: U = {self.volumetric}; K is the bulk modulus"
        yield f"unit of stress: {settings.unit} ({settings.system.others})"
        yield f"checked: {self.checked}"

    def _error_lines(self, apart: Mapping[str, FloatArray], is_exact: bool, is_stable: bool) -> Iterator[str]:
        if is_exact:
            yield "the card's law is the draw's own, exactly"
            return
        yield "PROJECTION: the card is the nearest of its form; relative error of stress, largest and root mean square:"
        for name, each in apart.items():
            yield f"    {_place(name)}: {_percent(np.abs(each).max())}, {_percent(np.sqrt((each**2).mean()))}"
        if not is_stable:
            yield "    CAUTION: the card is NOT stable over the whole calibrated range"

    def _commented(self, lines: Sequence[str]) -> str:
        before, after = self.comment
        plain = (line.replace("--", "-") for line in lines)  # two hyphens end a comment of XML
        folded = (part for line in plain for part in wrap(line, WIDTH, subsequent_indent="    "))
        return "".join(f"{before}{part}{after}\n" for part in folded)

    def _notes(self, told: Told) -> Iterator[str]:
        if told.is_exact:
            yield f"The cards are the draws' own law, exactly: {told.form.keyword}."
            return
        yield (
            f"The draws' own law has no card in {self.name}, so every card is the nearest {told.form.keyword}: its "
            "stresses differ from the draw's in the calibrated range by (root mean square; largest, of all draws) "
            + "; ".join(
                f"{_place(name)} {_percent(np.sqrt((each**2).mean()))}, {_percent(np.abs(each).max())}"
                for name, each in told.apart.items()
            )
            + ". Every file and the index say it draw by draw."
        )
        lost = np.flatnonzero(~told.stable)
        if len(lost):
            places = ", ".join(str(place + 1) for place in lost)
            yield (
                f"NOT stable over the whole calibrated range: the cards of draws {places}. Leave them out, or ask for "
                "another law with --law."
            )


def _prefixed(constants: Mapping[str, float]) -> dict[str, float]:
    """Return constants by names that no parameter of a draw has."""
    return {f"card_{name}": float(value) for name, value in constants.items()}


def _errors(apart: Mapping[str, FloatArray]) -> dict[str, float]:
    """Return largest and root mean square of relative differences, by where they are."""
    found = {}
    for name, each in apart.items():
        found[f"error_{name}_max"] = float(np.abs(each).max())
        found[f"error_{name}_rms"] = float(np.sqrt((each**2).mean()))
    return found


def _place(name: str) -> str:
    return "in any measured state" if name == "states" else name


def _percent(share: float) -> str:
    return f"{100 * share:.3g} %"
