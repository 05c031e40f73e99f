"""Cards for FEBio."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import starmap
from xml.sax.saxutils import quoteattr

from tissuq.export.code import Card, FECode
from tissuq.export.laws import Constants, Form, LibraryForm, OgdenForm, PolynomialForm
from tissuq.export.projection import MixtureFit, OgdenFit, ReducedFit, reduced_terms
from tissuq.mechanics import Material
from tissuq.mechanics.laws import Gent, MaterialSum, VerondaWestmann

__all__ = ["FEBio"]

MAX_TERMS = 6


@dataclass(frozen=True)
class Mixture(Form):
    """A sum of materials, each as a form writes it."""

    summands: tuple[Form, ...]

    def holds(self, material: Material) -> bool:
        if not isinstance(material, MaterialSum) or len(material.summands) != len(self.summands):
            return False
        return all(form.holds(summand) for form, summand in zip(self.summands, material.summands, strict=True))

    def constants(self, material: Material, values: Sequence[float]) -> Constants:
        assert isinstance(material, MaterialSum)  # noqa: S101 (what it holds)
        constants: Constants = {}
        remaining = list(values)
        for form, summand in zip(self.summands, material.summands, strict=True):
            count = len(summand.parameters)
            numbers, remaining = form.constants(summand, remaining[:count]), remaining[count:]
            constants |= {f"{form.keyword}_{name}": value for name, value in numbers.items()}
        return constants


YEOH = PolynomialForm(
    "Yeoh", "sum of c_i (I1 - 3)^i", reduced_terms(MAX_TERMS), tuple(f"c{n}" for n in range(1, MAX_TERMS + 1))
)
OGDEN = OgdenForm(
    "Ogden", "sum of c_i/m_i^2 (l1^m_i + l2^m_i + l3^m_i - 3)", 1, MAX_TERMS, lambda mu, alpha: 2 * mu, ("c", "m")
)
MIXTURE = Mixture("uncoupled solid mixture", f"{YEOH.formula} (Yeoh) + {OGDEN.formula} (Ogden)", (YEOH, OGDEN))


class FEBio(FECode):
    """``<material>`` of FEBio, always uncoupled: "neo-Hookean" of FEBio is another, coupled law, so it is not used.

    It adds materials in an "uncoupled solid mixture", whose bulk modulus is the sum of those of its solids.
    """

    name = "febio"
    description = "FEBio <Material> include files"
    suffix = ".feb"
    comment = ("<!-- ", " -->")
    checked = "written after the manual, not run in FEBio"
    volumetric = "K/2 (ln J)^2, FEBio's k = K"
    forms = (
        PolynomialForm("Mooney-Rivlin", "c1 (I1 - 3) + c2 (I2 - 3)", ("C10", "C01"), ("c1", "c2")),
        YEOH,
        OGDEN,
        LibraryForm("Gent", "-G Jm/2 ln(1 - (I1 - 3)/Jm)", Gent, lambda mu, Jm: {"G": mu, "Jm": Jm}),
        LibraryForm(
            "Veronda-Westmann",
            "c1 (exp(c2 (I1 - 3)) - 1) - c1 c2/2 (I2 - 3)",
            VerondaWestmann,
            lambda mu, b: {"c1": mu / b, "c2": b},
        ),
        MIXTURE,
    )
    projections = MixtureFit(MAX_TERMS), OgdenFit(MAX_TERMS), ReducedFit(reduced_terms(MAX_TERMS))

    def text(self, card: Card) -> str:
        head = f'    <material id="1" name={quoteattr(card.name)} type="{card.form.keyword}">'
        lines = [head, _element("density", card.water_density)]
        if isinstance(card.form, Mixture):
            for solid_form in card.form.summands:
                prefix = f"{solid_form.keyword}_"
                names = [name for name in card.constants if name.startswith(prefix)]
                numbers = {name.removeprefix(prefix): card.constants[name] for name in names}
                numbers["k"] = card.bulk / len(card.form.summands)  # the mixture's is their sum
                solid = (f"  {_element(name, number)}" for name, number in numbers.items())
                lines += [f'      <solid type="{solid_form.keyword}">', *solid, "      </solid>"]
        else:
            lines += starmap(_element, {**card.constants, "k": card.bulk}.items())
        return "\n".join([*lines, "    </material>", ""])

    def wrapped(self, heading: str, text: str) -> str:
        head = '<?xml version="1.0" encoding="UTF-8"?>\n<febio_spec version="4.0">\n'
        return f"{head}{heading}  <Material>\n{text}  </Material>\n</febio_spec>\n"


def _element(name: str, number: float) -> str:
    return f"      <{name}>{number:.10e}</{name}>"
