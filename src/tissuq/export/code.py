"""Finite-element codes: their forms, the projections that fit in them, and the text of a card."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from textwrap import wrap
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import InputError
from tissuq.export.cards import (
    NEARLY,
    CardFormat,
    Cards,
    CardSettings,
    draw_row,
    ensemble_lines,
    file_name,
    words_of,
)
from tissuq.export.laws import Form, Law, exact_law
from tissuq.export.projection import Projection, projections
from tissuq.export.states import are_stable, differences, moduli
from tissuq.posterior.ensemble import Ensemble

__all__ = ["Card", "FECode"]

FloatArray = NDArray[np.float64]

MIN_STABLE_SHARE = 0.9
"""Share of stable draws above which projections are compared by their error alone."""
COMMENT_WIDTH = 110
"""Largest number of characters in a line of comment."""


@dataclass(frozen=True)
class Card:
    """One material for a code, in the unit of the model.

    Attributes
    ----------
    form : Form
    constants : mapping of str to float
        Constants by name, in the order of the form.
    shear, bulk : float
        Initial shear and bulk modulus.
    name : str
        Name of the material.
    number : int
        Its number in the model.
    water_density : float
        The density of water, for codes that need a density.
    """

    form: Form
    constants: Mapping[str, float]
    shear: float
    bulk: float
    name: str
    number: int
    water_density: float

    @property
    def poisson(self) -> float:
        """Poisson's ratio at the reference."""
        return (3 * self.bulk - 2 * self.shear) / (2 * (3 * self.bulk + self.shear))


@dataclass(frozen=True, eq=False)
class JudgedLaw:
    """The law of all cards, its relative errors of stress against the draws, and whether each draw's card is stable."""

    law: Law
    form: Form
    is_exact: bool
    errors: Mapping[str, FloatArray]
    stable: NDArray[np.bool_]

    @property
    def rank(self) -> tuple[bool, float]:
        """Sort key, smaller is better: nearly all draws stable first, then the smaller error."""
        return bool(self.stable.mean() < MIN_STABLE_SHARE), float(np.sqrt((self.errors["states"] ** 2).mean()))


class FECode(CardFormat):
    """A finite-element code. A new one names its forms and projections and writes the text of a card.

    The energy of a card is W of the isochoric stretches, l / J^(1/3), plus the volumetric energy that it states.
    """

    suffix: ClassVar[str]
    comment: ClassVar[tuple[str, str]]
    """What begins and what ends a line of comment."""
    volumetric: ClassVar[str]
    checked: ClassVar[str]
    """How the cards of this code were checked."""
    forms: ClassVar[tuple[Form, ...]]
    """In order of preference."""
    projections: ClassVar[tuple[Projection, ...]]
    """One of every family that the code has, the best of which is taken where it has not the draws' own law."""

    @abstractmethod
    def text(self, card: Card) -> str:
        """Return the lines of a material, without comments."""

    def check(self, card: Card) -> None:
        """Refuse a card that the code would not read as it is meant."""

    def wrapped(self, heading: str, text: str) -> str:
        """Return a file of comments and a card."""
        return heading + text

    def cards(self, ensemble: Ensemble, settings: CardSettings) -> Cards:
        judged = self._best_law(ensemble, settings)
        shear = moduli(ensemble) * settings.factor
        if not shear.mean() > 0:
            raise InputError(
                "the mean initial shear modulus of the draws is not positive: no card can be made of them."
            )
        values = judged.law.scaled(settings.factor).values
        common = [*ensemble_lines(ensemble, settings), *self._law_lines(judged, settings)]
        files, index, blocks, bulks = {}, [], [], []
        for draw_index, modulus in enumerate(shear):
            constants = judged.form.constants(judged.law.material, values[draw_index])
            bulk = settings.bulk(float(modulus), float(shear.mean()))
            card = Card(
                judged.form, constants, float(modulus), bulk, settings.name, settings.number,
                settings.system.water_density,
            )  # fmt: skip
            self.check(card)
            bulks.append(bulk)
            blocks.append(self.text(card))
            errors = {name: error[draw_index] for name, error in judged.errors.items()}
            draw = ensemble[draw_index]
            row = {"file": file_name(ensemble, draw_index, self.suffix), **draw_row(draw, settings, card.shear)}
            row |= {"bulk_modulus": bulk, "form": judged.form.keyword, **_prefixed(constants)}
            row |= _errors(errors) | {"card_is_stable": bool(judged.stable[draw_index])}
            lines = [f"draw {draw_index + 1} of {len(ensemble)}: {words_of(draw, settings)}", *common]
            lines += self._error_lines(errors, judged.is_exact, bool(judged.stable[draw_index]))
            files[str(row["file"])] = self.wrapped(self._commented(lines), blocks[-1])
            index.append(row)
        sentences = (*self._warnings(judged), *_softness(np.array(bulks) / shear))
        return Cards(files, tuple(index), sentences, tuple(blocks))

    def form_of(self, law: Law) -> Form | None:
        """Return the first form that holds a law, if any."""
        return next((form for form in self.forms if form.holds(law.material)), None)

    def _best_law(self, ensemble: Ensemble, settings: CardSettings) -> JudgedLaw:
        law = exact_law(ensemble) if settings.law is None else None
        form = self.form_of(law) if law is not None else None
        if law is not None and form is not None:
            return self._judged(ensemble, law, form, is_exact=True)
        candidates = [self._projected(ensemble, projection) for projection in self._requested(settings)]
        return min(candidates, key=lambda judged: judged.rank)

    def _projected(self, ensemble: Ensemble, projection: Projection) -> JudgedLaw:
        law = projection.law(ensemble)
        form = self.form_of(law)
        if form is None:
            raise InputError(f"{self.name} has no form for {law.material.name}; ask for another order.")
        return self._judged(ensemble, law, form, is_exact=False)

    def _judged(self, ensemble: Ensemble, law: Law, form: Form, *, is_exact: bool) -> JudgedLaw:
        card_draws = law.ensemble(ensemble)
        return JudgedLaw(law, form, is_exact, differences(card_draws, ensemble), are_stable(card_draws))

    def _requested(self, settings: CardSettings) -> Sequence[Projection]:
        if settings.law is None:
            return self.projections
        kinds = {projection.family: projection for projection in self.projections}
        if settings.law not in kinds:
            families = ", ".join(kinds)
            unknown = "" if settings.law in projections() else f"there is no law '{settings.law}'; "
            raise InputError(f"{unknown}cards for {self.name} can be of the laws {families}.")
        projection = kinds[settings.law]
        return [projection if settings.order is None else type(projection).of_order(settings.order)]

    def _law_lines(self, judged: JudgedLaw, settings: CardSettings) -> Iterator[str]:
        yield f"form: {judged.form.keyword}, W = {judged.form.formula}; I1, I2, l of the isochoric part, l / J^(1/3)"
        yield f"volume: U = {self.volumetric}; K is the bulk modulus"
        yield f"unit of stress: {settings.unit} ({settings.system.units})"
        yield f"checked: {self.checked}"

    def _error_lines(self, errors: Mapping[str, FloatArray], is_exact: bool, is_stable: bool) -> Iterator[str]:
        if is_exact:
            yield "the card's law is the draw's own, exactly"
            return
        yield "PROJECTION: the card is the nearest of its form; relative error of stress, largest and root mean square:"
        for name, error in errors.items():
            yield f"    {_label(name)}: {_percent(np.abs(error).max())}, {_percent(np.sqrt((error**2).mean()))}"
        if not is_stable:
            yield "    WARNING: the card is NOT stable over the whole calibrated range"

    def _commented(self, lines: Sequence[str]) -> str:
        start, end = self.comment
        plain = (line.replace("--", "-") for line in lines)  # two hyphens end a comment of XML
        folded = (folded_line for line in plain for folded_line in wrap(line, COMMENT_WIDTH, subsequent_indent="    "))
        return "".join(f"{start}{folded_line}{end}\n" for folded_line in folded)

    def _warnings(self, judged: JudgedLaw) -> Iterator[str]:
        if judged.is_exact:
            yield f"The cards are the draws' own law, exactly: {judged.form.keyword}."
            return
        yield (
            f"The draws' own law has no card in {self.name}, so every card is the nearest {judged.form.keyword}: its "
            "stresses differ from the draw's in the calibrated range by (root mean square; largest, of all draws) "
            + "; ".join(
                f"{_label(name)} {_percent(np.sqrt((error**2).mean()))}, {_percent(np.abs(error).max())}"
                for name, error in judged.errors.items()
            )
            + ". Every file and the index give the errors of each draw."
        )
        lost = np.flatnonzero(~judged.stable)
        if len(lost):
            numbers = ", ".join(str(index + 1) for index in lost)
            yield (
                f"The cards of draws {numbers} are NOT stable over the whole calibrated range. Leave them out, or "
                "choose another law with --law."
            )


def _softness(bulk_to_shear: FloatArray) -> Iterator[str]:
    """Return a sentence where the volume would change notably."""
    if bulk_to_shear.min() < NEARLY:
        yield (
            f"The bulk modulus is down to {bulk_to_shear.min():.3g} times the initial shear modulus: the volume "
            "changes, while the measurements were understood as those of an incompressible material."
        )


def _prefixed(constants: Mapping[str, float]) -> dict[str, float]:
    """Return constants by names that no parameter of a draw has."""
    return {f"card_{name}": float(value) for name, value in constants.items()}


def _errors(errors: Mapping[str, FloatArray]) -> dict[str, float]:
    """Return largest and root mean square of relative differences, by where they are."""
    row = {}
    for name, error in errors.items():
        row[f"error_{name}_max"] = float(np.abs(error).max())
        row[f"error_{name}_rms"] = float(np.sqrt((error**2).mean()))
    return row


def _label(name: str) -> str:
    return "in any measured state" if name == "states" else name


def _percent(share: float) -> str:
    return f"{100 * share:.3g} %"
