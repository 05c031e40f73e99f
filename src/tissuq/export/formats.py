"""Card formats of finite-element codes: Abaqus, CalculiX, ANSYS, FEBio and LS-DYNA, each after its manual."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import starmap
from math import sqrt
from typing import Any, ClassVar
from xml.sax.saxutils import quoteattr

from tissuq.errors import InputError
from tissuq.export.code import Card, FECode
from tissuq.export.fibres import CALCULIX_PREFIX, FibreForm, directions
from tissuq.export.laws import Form, LibraryForm, MixtureForm, OgdenForm, PolynomialForm
from tissuq.export.projection import (
    MixtureFit,
    OgdenFit,
    PolynomialFit,
    Projection,
    ReducedFit,
    full_terms,
    reduced_terms,
)
from tissuq.mechanics.laws import Gent, VanDerWaals, VerondaWestmann

ABAQUS_POLYNOMIAL = "sum of C_ij (I1 - 3)^i (I2 - 3)^j"
ABAQUS_OGDEN = "sum of 2 mu_i/alpha_i^2 (l1^alpha_i + l2^alpha_i + l3^alpha_i - 3)"
ABAQUS_LINE = 8
ANSYS_LINE = 6
"""Numbers on a line of data."""
FEBIO_TERMS = 6
"""Terms of a polynomial of I1, and of an Ogden sum, that FEBio takes at most."""
FIBRES = "k1/(2 k2) sum over families of (exp(k2 <I4 - 1>^2) - 1)"
DISPERSED = FIBRES.replace("I4 - 1", "kappa (I1 - 3) + (1 - 3 kappa) (I4 - 1)")
"""Energies of fibres, <x> being x where positive, else 0."""
LS_DYNA_OGDEN_TERMS = 8
LS_DYNA_TERMS = ("C10", "C01", "C11", "C20", "C02", "C30")
LS_DYNA_KEYWORDS = {"MAT_077_H": "*MAT_HYPERELASTIC_RUBBER_TITLE", "MAT_077_O": "*MAT_OGDEN_RUBBER_TITLE"}


def _abaqus_forms(max_order: int, max_ogden_terms: int) -> tuple[Form, ...]:
    """Return the forms of polynomials up to an order and of Ogden sums up to a number of terms."""
    orders = range(2, max_order + 1)
    reduced = [PolynomialForm(f"REDUCED POLYNOMIAL, N={n}", "sum of C_i0 (I1 - 3)^i", reduced_terms(n)) for n in orders]
    reduced[1] = PolynomialForm("YEOH", "C10 (I1 - 3) + C20 (I1 - 3)^2 + C30 (I1 - 3)^3", reduced_terms(3))
    return (
        PolynomialForm("NEO HOOKE", "C10 (I1 - 3)", ("C10",)),
        PolynomialForm("MOONEY-RIVLIN", "C10 (I1 - 3) + C01 (I2 - 3)", ("C10", "C01")),
        *reduced,
        *(PolynomialForm(f"POLYNOMIAL, N={n}", ABAQUS_POLYNOMIAL, full_terms(n)) for n in orders),
        *(OgdenForm(f"OGDEN, N={n}", ABAQUS_OGDEN, n, n, lambda mu, alpha: mu) for n in range(1, max_ogden_terms + 1)),
    )


class Abaqus(FECode):
    """``*HYPERELASTIC`` of Abaqus: D1 = 2/K, further D are zero (no such term)."""

    name = "abaqus"
    description = "Abaqus *HYPERELASTIC include files"
    unused = ("number",)
    suffix = ".inp"
    comment = ("** ", "")
    checked = "written after the manual of Abaqus, not run there; CalculiX, which reads the same keyword, was run"
    volumetric = "(J - 1)^2 / D1, D1 = 2/K (VAN DER WAALS: ((J^2 - 1)/2 - ln J) / D)"
    forms = (
        *_abaqus_forms(6, 6),
        LibraryForm(
            "VAN DER WAALS",
            "mu (-(lambda_m^2 - 3) (ln(1 - h) + h) - 2/3 a ((I - 3)/2)^(3/2)), h^2 = (I - 3)/(lambda_m^2 - 3), I = I1",
            VanDerWaals,
            lambda mu, A, Jm: {"mu": mu, "lambda_m": sqrt(Jm + 3), "a": A / mu, "beta": 0.0},
        ),
        *(FibreForm(f"HOLZAPFEL, LOCAL DIRECTIONS={n}", f"C10 (I1 - 3) + {DISPERSED}", n) for n in (1, 2)),
    )
    fibres = "it has fibres of one kind in a neo-Hookean matrix, with nothing beside"
    fibre_volumetric = "((J^2 - 1)/2 - ln J) / D, D = 2/K"
    projections: ClassVar[tuple[Projection, ...]] = (
        PolynomialFit(full_terms(4)),
        OgdenFit(6),
        ReducedFit(reduced_terms(5)),
    )
    absent_d: ClassVar[float] = 0.0
    """Value of D2 and D3 with which their volumetric terms vanish."""

    def text(self, card: Card) -> str:
        if isinstance(card.form, FibreForm):
            names, bulk = ("k1", "k2", "kappa"), 2 / card.bulk
            data = _abaqus_lines([card.constants["C10"], bulk, *(card.constants[name] for name in names)])
            head = [f"*MATERIAL, NAME={card.name}", f"*ANISOTROPIC HYPERELASTIC, {card.form.keyword}"]
            return "".join(f"{line}\n" for line in [*head, *data])
        numbers = [*card.constants.values(), 2 / card.bulk, *[self.absent_d] * (_volumetric_terms(card.form) - 1)]
        lines = [f"*MATERIAL, NAME={card.name}", f"*HYPERELASTIC, {card.form.keyword}", *_abaqus_lines(numbers)]
        return "".join(f"{line}\n" for line in lines)

    def beside(self, card: Card) -> str:
        """Return the orientation that holds the directions of fibres, which Abaqus keeps apart from the material."""
        if not isinstance(card.form, FibreForm):
            return ""
        rows = [f"{along:.15f}, {across:.15f}, 0." for along, across in directions(card.form, card.constants)]
        head = f"*ORIENTATION, NAME={card.name}-AXES, LOCAL DIRECTIONS={card.form.families}"
        return "".join(f"{line}\n" for line in [head, "1., 0., 0., 0., 1., 0.", "3, 0.", *rows])

    def outside(self, cards: Sequence[Card]) -> str:
        if not isinstance(cards[0].form, FibreForm) or len({card.constants["degrees"] for card in cards}) == 1:
            return ""
        return (
            "Abaqus takes the directions of fibres from the *ORIENTATION of the section, not from the material, and "
            "here the angle differs from draw to draw: run the cards of tissuq export, each with its orientation, take "
            "CalculiX (--solver ccx), or fit fibres at a known angle (such as exponential-fibres@30)."
        )


class CalculiX(Abaqus):
    """``*HYPERELASTIC`` of CalculiX, for up to three terms; fibres as its user material ELASTIC_FIBER.

    It replaces every D below 1e-10 by its own default, so that D2 and D3 are so large that their terms vanish. Whether
    CalculiX computes what tissuq means is tested by running it on one element.
    """

    name = "calculix"
    description = "CalculiX *HYPERELASTIC include files"
    checked = "cards of this form were run in CalculiX on one element, and gave tissuq's stresses"
    volumetric = "(J - 1)^2 / D1, D1 = 2/K"
    forms = (
        *_abaqus_forms(3, 3),
        *(FibreForm(f"{CALCULIX_PREFIX}, {n} of them", f"C10 (I1 - 3) + {FIBRES}", n, False) for n in (1, 2)),
    )
    fibres = "it has fibres without dispersion in a neo-Hookean matrix, with nothing beside"
    fibre_volumetric = volumetric
    projections = PolynomialFit(full_terms(3)), OgdenFit(3), ReducedFit(reduced_terms(3))
    absent_d = 1e20
    min_d1: ClassVar[float] = 1e-10
    """Smallest D1; below it CalculiX takes a Poisson's ratio of 0.475 instead."""

    def text(self, card: Card) -> str:
        if not isinstance(card.form, FibreForm):
            return super().text(card)
        is_named = card.name.upper().startswith(CALCULIX_PREFIX)
        name = card.name if is_named else f"{CALCULIX_PREFIX}_{card.name}"
        constants, numbers = card.constants, _abaqus_lines([card.constants["C10"], 2 / card.bulk])[0].split(", ")
        for along, across in directions(card.form, constants):
            numbers += [f"{along:.16f}", f"{across:.16f}", f"{constants['k1']:.10e}", f"{constants['k2']:.10e}"]
        head = [f"*MATERIAL, NAME={name}", f"*USER MATERIAL, CONSTANTS={len(numbers)}"]
        rows = [", ".join(numbers[start : start + ABAQUS_LINE]) for start in range(0, len(numbers), ABAQUS_LINE)]
        return "".join(f"{line}\n" for line in [*head, *rows])

    def beside(self, card: Card) -> str:
        return ""

    def outside(self, cards: Sequence[Card]) -> str:
        return ""

    def check(self, card: Card) -> None:
        if 2 / card.bulk < self.min_d1:
            raise InputError(
                f"D1 = 2/K = {2 / card.bulk:.3g} is too small for CalculiX, which replaces what is below "
                f"{self.min_d1:g} by a Poisson's ratio of 0.475: choose a larger unit of stress, or a smaller bulk "
                "modulus."
            )


def _volumetric_terms(form: Form) -> int:
    """Return the number of D that a form has: one for each order of a polynomial, and for each Ogden term."""
    if isinstance(form, PolynomialForm):
        return max(int(symbol[1]) + int(symbol[2]) for symbol in form.symbols)
    return form.max_terms if isinstance(form, OgdenForm) else 1


def _abaqus_lines(numbers: Sequence[float]) -> list[str]:
    """Return lines of eight numbers with eleven digits, which need no more than the 20 places that CalculiX reads."""
    words = [f"{number:.10e}" for number in numbers]
    return [", ".join(words[start : start + ABAQUS_LINE]) for start in range(0, len(words), ABAQUS_LINE)]


class Ansys(FECode):
    """``TB,HYPER`` with ``TBDATA``: d = 2/K, further d are zero; Ogden with factors mu/alpha."""

    name = "ansys"
    description = "ANSYS TB,HYPER command files"
    suffix = ".inp"
    comment = ("! ", "")
    checked = "written after the manual, not run in ANSYS"
    volumetric = "(J - 1)^2 / d1, d1 = 2/K (GENT: ((J^2 - 1)/2 - ln J) / d1)"
    forms = (
        PolynomialForm("NEO", "mu/2 (I1 - 3)", ("C10",), ("mu",), 2.0),
        PolynomialForm("MOONEY, 2 constants", "C10 (I1 - 3) + C01 (I2 - 3)", ("C10", "C01")),
        *(PolynomialForm(f"YEOH, {n} terms", "sum of C_i0 (I1 - 3)^i", reduced_terms(n)) for n in (2, 3, 4, 5, 6)),
        *(
            PolynomialForm(f"MOONEY, {len(terms)} constants", "sum of C_ij (I1 - 3)^i (I2 - 3)^j", terms)
            for terms in (full_terms(2), full_terms(3))
        ),
        *(
            OgdenForm(
                f"OGDEN, {n} terms",
                "sum of mu_i/alpha_i (l1^alpha_i + l2^alpha_i + l3^alpha_i - 3)",
                n,
                n,
                lambda mu, alpha: 2 * mu / alpha,
            )
            for n in range(1, 9)
        ),
        LibraryForm("GENT", "-mu Jm/2 ln(1 - (I1 - 3)/Jm)", Gent, lambda mu, Jm: {"mu": mu, "Jm": Jm}),
    )
    projections = PolynomialFit(full_terms(3)), OgdenFit(6), ReducedFit(reduced_terms(5))
    fibres = "the published formula of its TB,AHYPER does not say that compressed fibres bear no load"

    def text(self, card: Card) -> str:
        option, _, count = card.form.keyword.partition(", ")
        points = count.split(" ")[0]
        numbers = [*card.constants.values(), 2 / card.bulk]
        if count.endswith("terms"):
            numbers += [0.0] * (int(points) - 1)
        lines = [f"! material {card.name}, MATID {card.number}", f"TB,HYPER,{card.number},1,{points},{option}"]
        for start in range(0, len(numbers), ANSYS_LINE):
            words = ",".join(f"{number:.10e}" for number in numbers[start : start + ANSYS_LINE])
            lines.append(f"TBDATA,{start + 1},{words}")
        return "".join(f"{line}\n" for line in lines)


FEBIO_YEOH = PolynomialForm(
    "Yeoh", "sum of c_i (I1 - 3)^i", reduced_terms(FEBIO_TERMS), tuple(f"c{n}" for n in range(1, FEBIO_TERMS + 1))
)
FEBIO_OGDEN = OgdenForm(
    "Ogden", "sum of c_i/m_i^2 (l1^m_i + l2^m_i + l3^m_i - 3)", 1, FEBIO_TERMS, lambda mu, alpha: 2 * mu, ("c", "m")
)


def _febio_fibres(*, has_matrix: bool) -> tuple[FibreForm, FibreForm]:
    """Return two families of fibres, and one as two at no angle, with a neo-Hookean matrix or without."""
    name, formula = "Holzapfel-Gasser-Ogden", f"c/2 (I1 - 3) + {DISPERSED}" if has_matrix else DISPERSED
    two_families = FibreForm(name, formula, 2, matrix=("c", 2.0), has_matrix=has_matrix)
    halved = f"{formula}, two families at no angle, each with half of k1"
    return two_families, replace(two_families, formula=halved, families=1, only_along_axis=True, share=0.5)


def _febio_mixture(*fibres: FibreForm) -> MixtureForm:
    """Return a polynomial of I1 and an Ogden sum added, with fibres or without."""
    summands = FEBIO_YEOH, FEBIO_OGDEN, *fibres
    formula = " + ".join(f"{form.formula} ({form.keyword})" for form in summands)
    return MixtureForm("uncoupled solid mixture", formula, summands)


class FEBio(FECode):
    """``<material>`` of FEBio, always uncoupled: "neo-Hookean" of FEBio is another, coupled law, so it is not used.

    It adds materials in an "uncoupled solid mixture", which has a bulk modulus of its own: since 2020 FEBio sets those
    of its solids to zero (FEUncoupledElasticMixture::Init).
    """

    name = "febio"
    description = "FEBio <Material> include files"
    suffix = ".feb"
    comment = ("<!-- ", " -->")
    checked = "written after the manual, not run in FEBio"
    volumetric = "K/2 (ln J)^2, FEBio's k = K"
    forms = (
        PolynomialForm("Mooney-Rivlin", "c1 (I1 - 3) + c2 (I2 - 3)", ("C10", "C01"), ("c1", "c2")),
        FEBIO_YEOH,
        FEBIO_OGDEN,
        LibraryForm("Gent", "-G Jm/2 ln(1 - (I1 - 3)/Jm)", Gent, lambda mu, Jm: {"G": mu, "Jm": Jm}),
        LibraryForm(
            "Veronda-Westmann",
            "c1 (exp(c2 (I1 - 3)) - 1) - c1 c2/2 (I2 - 3)",
            VerondaWestmann,
            lambda mu, b: {"c1": mu / b, "c2": b},
        ),
        _febio_mixture(),
        *_febio_fibres(has_matrix=True),
        *(_febio_mixture(fibres) for fibres in _febio_fibres(has_matrix=False)),
    )
    fibres = "it has two families of one kind, or one along axis 1 (:one@0)"
    fibre_volumetric = "((J^2 - 1)/2 - ln J) K/2"
    projections = MixtureFit(FEBIO_TERMS), OgdenFit(FEBIO_TERMS), ReducedFit(reduced_terms(FEBIO_TERMS))

    def text(self, card: Card) -> str:
        head = f'    <material id="{card.number}" name={quoteattr(card.name)} type="{card.form.keyword}">'
        lines = [head, _element("density", card.water_density)]
        if isinstance(card.form, MixtureForm):
            lines.append(_element("k", card.bulk))
            for solid_form in card.form.summands:
                constants = card.form.of_summand(solid_form, card.constants)
                solid = (f"  {element}" for element in starmap(_element, constants.items()))
                lines += [f'      <solid type="{solid_form.keyword}">', *solid, "      </solid>"]
        else:
            lines += starmap(_element, {**card.constants, "k": card.bulk}.items())
        return "\n".join([*lines, "    </material>", ""])

    def wrapped(self, heading: str, text: str) -> str:
        head = '<?xml version="1.0" encoding="UTF-8"?>\n<febio_spec version="4.0">\n'
        return f"{head}{heading}  <Material>\n{text}  </Material>\n</febio_spec>\n"


def _element(name: str, number: float) -> str:
    tag = "gamma" if name == "degrees" else name
    return f"      <{tag}>{number:.10e}</{tag}>"


class LSDyna(FECode):
    """``*MAT_HYPERELASTIC_RUBBER`` (077_H) and ``*MAT_OGDEN_RUBBER`` (077_O), in the long format of 20 columns.

    Fields of ten columns would leave four to six digits, too few for Ogden terms that cancel. Mooney and Rivlin's
    material 027 is not used, because its volumetric part is not split off; 077_H holds the same law.
    """

    name = "ls-dyna"
    description = "LS-DYNA keyword files, materials 077"
    suffix = ".k"
    comment = ("$ ", "")
    checked = "written after the manual, not run in LS-DYNA"
    volumetric = "that of LS-DYNA, with K = 2 G (1 + PR) / (3 (1 - 2 PR)), G the initial shear modulus"
    forms = (
        PolynomialForm("MAT_077_H", "sum of C_ij (I1 - 3)^i (I2 - 3)^j", LS_DYNA_TERMS),
        OgdenForm(
            "MAT_077_O",
            "sum of mu_i/alpha_i (l1^alpha_i + l2^alpha_i + l3^alpha_i - 3)",
            1,
            LS_DYNA_OGDEN_TERMS,
            lambda mu, alpha: 2 * mu / alpha,
        ),
    )
    projections = PolynomialFit(LS_DYNA_TERMS), OgdenFit(LS_DYNA_OGDEN_TERMS)
    # PyDyna's class mat_295 lists the fields of every card, and for their formulas points to remarks of the manual.
    fibres = (
        "the sources used here give the fields of its *MAT_295, but neither its energies nor whether compressed fibres "
        "bear no load"
    )

    def text(self, card: Card) -> str:
        constants: list[tuple[str, Any]] = list(card.constants.items())
        rows: list[list[tuple[str, Any]]] = [
            [("mid", str(card.number)), ("ro", card.water_density), ("pr", card.poisson), ("n", "0"), ("nv", "0")]
        ]
        if card.form.keyword == "MAT_077_O":
            rows += [constants[0::2], constants[1::2]]
            rows[1:] = [row + [("", 0.0)] * (LS_DYNA_OGDEN_TERMS - len(row)) for row in rows[1:]]
        else:
            rows.append(constants)
        lines = [f"{LS_DYNA_KEYWORDS[card.form.keyword]} +", card.name]
        for row in rows:
            lines.append("$#" + "".join(f"{name:>20}" for name, _ in row)[2:])
            lines.append("".join(f"{value if isinstance(value, str) else f'{value:.12e}':>20}" for _, value in row))
        return "\n".join([*lines, ""])

    def wrapped(self, heading: str, text: str) -> str:
        return f"{heading}*KEYWORD\n{text}*END\n"
