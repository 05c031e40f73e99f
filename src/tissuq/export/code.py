"""Finite-element codes: their forms, the projections that fit in them, and the text of a card."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from textwrap import wrap
from typing import ClassVar, NoReturn

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.errors import InputError
from tissuq.export.cards import (
    NEARLY,
    CardFormat,
    Cards,
    CardSettings,
    card_formats,
    draw_row,
    ensemble_lines,
    ensemble_sentences,
    file_name,
    words_of,
)
from tissuq.export.draw_stresses import DrawStresses
from tissuq.export.fibres import FIBRE_AXES, FibreForm, fibre_sentences, initial_stiffness
from tissuq.export.judgement import JudgedLaw
from tissuq.export.laws import (
    Form,
    Law,
    exact_law,
    fibres_among,
    matrix_and_fibres,
    parts_of,
    sum_of,
)
from tissuq.export.projection import Projection, projections
from tissuq.export.states import moduli
from tissuq.mechanics import Material
from tissuq.mechanics.laws import MaterialSum
from tissuq.posterior.ensemble import Ensemble

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
    fibres: ClassVar[str] = "its cards here are of isotropic materials"
    """Which fibres its cards hold, or why none, in words."""
    fibre_volumetric: ClassVar[str] = ""
    """The volumetric energy of its materials with fibres, where it is another."""

    @abstractmethod
    def text(self, card: Card) -> str:
        """Return the lines of a material, without comments."""

    def check(self, card: Card) -> None:
        """Refuse a card that the code would not read as it is meant."""

    def wrapped(self, heading: str, text: str) -> str:
        """Return a file of comments and a card."""
        return heading + text

    def beside(self, card: Card) -> str:
        """Return what a file holds beside the material, and the material refers to."""
        return ""

    def outside(self, cards: Sequence[Card]) -> str:
        """Return what of the draws their blocks do not hold, in a sentence, or nothing."""
        return ""

    def cards(self, ensemble: Ensemble, settings: CardSettings) -> Cards:
        judged, rivals = self._best_law(ensemble, settings)
        shear = moduli(ensemble) * settings.factor
        if not shear.mean() > 0:
            raise InputError(
                "the mean initial shear modulus of the draws is not positive: no card can be made of them."
            )
        values = judged.law.scaled(settings.factor).values
        common = [*ensemble_lines(ensemble, settings), *self._law_lines(judged, settings)]
        all_constants = [judged.form.constants(judged.law.material, row) for row in values]
        stiffness = shear + np.array([initial_stiffness(judged.form, constants) for constants in all_constants])
        files, index, blocks, bulks, all_cards = {}, [], [], [], []
        for draw_index, (modulus, constants) in enumerate(zip(shear, all_constants, strict=True)):
            bulk = settings.bulk(float(stiffness[draw_index]), float(stiffness.mean()))
            card = Card(
                judged.form, constants, float(modulus), bulk, settings.name, settings.number,
                settings.system.water_density,
            )  # fmt: skip
            self.check(card)
            bulks.append(bulk)
            all_cards.append(card)
            blocks.append(self.text(card))
            draw = ensemble[draw_index]
            row = {"file": file_name(ensemble, draw_index, self.suffix), **draw_row(draw, settings, card.shear)}
            row |= {"bulk_modulus": bulk, "form": judged.form.keyword, **_prefixed(constants)}
            row |= judged.row(draw_index)
            lines = [f"draw {draw_index + 1} of {len(ensemble)}: {words_of(draw, settings)}", *common]
            lines += judged.lines(draw_index)
            files[str(row["file"])] = self.wrapped(self._commented(lines), self.beside(card) + blocks[-1])
            index.append(row)
        sentences = (
            *ensemble_sentences(ensemble),
            *judged.sentences(self.name, rivals),
            *fibre_sentences(judged.form, all_constants),
            *_softness(np.array(bulks) / stiffness),
        )
        return Cards(files, tuple(index), sentences, tuple(blocks), self.outside(all_cards))

    def form_of(self, material: Material) -> Form | None:
        """Return the first form that holds a material, if any."""
        return next((form for form in self.forms if form.holds(material)), None)

    def _best_law(self, ensemble: Ensemble, settings: CardSettings) -> tuple[JudgedLaw, Sequence[JudgedLaw]]:
        """Return the law of the cards, and those of the code's other families where some cards are not near."""
        law = exact_law(ensemble)
        form = self.form_of(law.material) if law is not None else None
        if law is not None and form is not None and settings.law is None:
            return JudgedLaw.of_draws(ensemble, law, form), ()
        matrix, fibres = matrix_and_fibres(ensemble)
        families = self._families(fibres)
        if not families:
            if form is not None:
                name = ensemble[0].parts[0][0].name
                raise InputError(f"material '{name}' has fibres, and the laws of --law are isotropic: leave it out.")
            self._refuse_fibres(ensemble, law, fibres)
        draws = DrawStresses(matrix)
        requested = self._requested(settings, families)
        candidates = [self._projected(draws, projection, fibres) for projection in requested]
        best = min(candidates, key=lambda judged: judged.rank)
        rivals = [judged for judged in candidates if judged is not best]
        if settings.law is not None and not best.is_near.all():
            rivals = [self._projected(draws, family, fibres) for family in families if family != best.projection]
        return best, rivals

    def _families(self, fibres: Law | None) -> Sequence[Projection]:
        """Return the projections that the code has, beside fibres where there are some."""
        if fibres is None:
            return self.projections
        sums = {projection: MaterialSum.of(projection.material, fibres.material) for projection in self.projections}
        return [projection for projection, material in sums.items() if self.form_of(material) is not None]

    def check_has_card(self, material: Material) -> None:
        """Refuse a material with fibres that has no card here, whatever its values are.

        Raises
        ------
        InputError
            Which names the codes that have one.
        """
        laws = Law(material, np.ones((1, len(material.parameters)))).summands
        law, fibres = sum_of(laws), fibres_among(laws)
        if not self._has_card(law, fibres):
            raise InputError(self._why_no_card(material.name, law, fibres))

    def _has_card(self, law: Law | None, fibres: Law | None) -> bool:
        """Return whether draws have a card that are a law, or none, and have fibres, or none."""
        return (law is not None and self.form_of(law.material) is not None) or bool(self._families(fibres))

    def _refuse_fibres(self, ensemble: Ensemble, law: Law | None, fibres: Law | None) -> NoReturn:
        """Refuse draws with fibres that have no card here."""
        reason = self._why_no_card(ensemble[0].parts[0][0].name, law, fibres)
        without_energy = sum_of(parts_of(ensemble))
        if without_energy is not None and self.form_of(without_energy.material) is not None:
            reason += (
                " Or fit without the free energy of the discrepancy beside the fibres (--discrepancy none, in Python "
                "discrepancy='none'), or take FElupe, which has all of it (tissuq.finite_elements.FElupeMaterial)."
            )
        raise InputError(reason)

    def _why_no_card(self, name: str, law: Law | None, fibres: Law | None) -> str:
        """Return why draws with fibres, of a law or none, have no card here, and which codes have one."""
        codes = [kind() for kind in card_formats().values()]
        able = sorted(code.name for code in codes if isinstance(code, FECode) and code._has_card(law, fibres))
        advice = (
            f"write cards for {' or '.join(able)}."
            if able
            else "no code here has all of it; a neo-Hookean matrix with one kind of fibres (holzapfel-gasser-ogden, "
            "gasser-ogden-holzapfel, standard-reinforcing) has cards."
        )
        return f"material '{name}' has no card for {self.name} ({self.fibres}): {advice}"

    def _projected(self, draws: DrawStresses, projection: Projection, fibres: Law | None) -> JudgedLaw:
        law = projection.law(draws)
        complete = law if fibres is None else law.plus(fibres)
        form = self.form_of(complete.material)
        if form is None:
            raise InputError(f"{self.name} has no form for {law.material.name}; ask for another order.")
        return JudgedLaw.of_projection(draws, projection, law, complete, form)

    def _requested(self, settings: CardSettings, families: Sequence[Projection]) -> Sequence[Projection]:
        """Return the projections among which that of the cards is chosen."""
        if settings.law is None:
            return families
        kinds = {projection.family: projection for projection in families}
        if settings.law not in kinds:
            unknown = "" if settings.law in projections() else f"there is no law '{settings.law}'; "
            raise InputError(f"{unknown}cards for {self.name} can be of the laws {', '.join(kinds)}.")
        projection = kinds[settings.law]
        return [projection if settings.order is None else type(projection).of_order(settings.order)]

    def _law_lines(self, judged: JudgedLaw, settings: CardSettings) -> Iterator[str]:
        form, has_fibres = judged.form, not judged.law.material.is_isotropic
        of_stretches = "I1, I4" if isinstance(form, FibreForm) else "I1, I2, I4, l" if has_fibres else "I1, I2, l"
        yield f"form: {form.keyword}, W = {form.formula}; {of_stretches} of the isochoric part, l / J^(1/3)"
        volumetric = (isinstance(form, FibreForm) and self.fibre_volumetric) or self.volumetric
        yield f"volume: U = {volumetric}; K is the bulk modulus"
        if has_fibres:
            yield FIBRE_AXES
        yield f"unit of stress: {settings.unit} ({settings.system.units})"
        yield f"checked: {self.checked}"

    def _commented(self, lines: Sequence[str]) -> str:
        start, end = self.comment
        plain = (line.replace("--", "-") for line in lines)  # two hyphens end a comment of XML
        folded = (folded_line for line in plain for folded_line in wrap(line, COMMENT_WIDTH, subsequent_indent="    "))
        return "".join(f"{start}{folded_line}{end}\n" for folded_line in folded)


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
