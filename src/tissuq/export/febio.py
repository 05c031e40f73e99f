"""Cards for FEBio."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import starmap
from xml.sax.saxutils import quoteattr

from tissuq.export.code import Card, FECode
from tissuq.export.forms import Constants, Form, OgdenForm, OwnForm, PolynomialForm
from tissuq.export.projection import MixtureFit, OgdenFit, ReducedFit, reduced_terms
from tissuq.mechanics import Material
from tissuq.mechanics.materials import Gent, MaterialSum, VerondaWestmann

__all__ = ["FEBio"]

ORDERS = 6


@dataclass(frozen=True)
class Mixture(Form):
    """A sum of materials, each as a form writes it."""

    parts: tuple[Form, ...]

    def holds(self, material: Material) -> bool:
        if not isinstance(material, MaterialSum) or len(material.parts) != len(self.parts):
            return False
        return all(form.holds(part) for form, part in zip(self.parts, material.parts, strict=True))

    def constants(self, material: Material, values: Sequence[float]) -> Constants:
        assert isinstance(material, MaterialSum)  # noqa: S101 (what it holds)
        found: Constants = {}
        left = list(values)
        for form, part in zip(self.parts, material.parts, strict=True):
            own, left = left[: len(part.parameters)], left[len(part.parameters) :]
            found |= {f"{form.keyword}_{name}": value for name, value in form.constants(part, own).items()}
        return found


YEOH = PolynomialForm(
    "Yeoh", "sum of c_i (I1 - 3)^i", reduced_terms(ORDERS), tuple(f"c{n}" for n in range(1, ORDERS + 1))
)
OGDEN = OgdenForm(
    "Ogden", "sum of c_i/m_i^2 (l1^m_i + l2^m_i + l3^m_i - 3)", 1, ORDERS, lambda mu, alpha: 2 * mu, ("c", "m")
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
        OwnForm("Gent", "-G Jm/2 ln(1 - (I1 - 3)/Jm)", Gent, lambda mu, Jm: {"G": mu, "Jm": Jm}),
        OwnForm(
            "Veronda-Westmann",
            "c1 (exp(c2 (I1 - 3)) - 1) - c1 c2/2 (I2 - 3)",
            VerondaWestmann,
            lambda mu, b: {"c1": mu / b, "c2": b},
        ),
        MIXTURE,
    )
    projections = MixtureFit(ORDERS), OgdenFit(ORDERS), ReducedFit(reduced_terms(ORDERS))

    def text(self, card: Card) -> str:
        head = f'    <material id="1" name={quoteattr(card.name)} type="{card.form.keyword}">'
        lines = [head, _element("density", card.water)]
        if isinstance(card.form, Mixture):
            for part in card.form.parts:
                own = {name: card.constants[name] for name in card.constants if name.startswith(f"{part.keyword}_")}
                inner = {name.removeprefix(f"{part.keyword}_"): value for name, value in own.items()}
                inner["k"] = card.bulk / len(card.form.parts)  # the mixture's is their sum
                solid = (f"  {_element(name, number)}" for name, number in inner.items())
                lines += [f'      <solid type="{part.keyword}">', *solid, "      </solid>"]
        else:
            lines += starmap(_element, {**card.constants, "k": card.bulk}.items())
        return "\n".join([*lines, "    </material>", ""])

    def wrapped(self, heading: str, text: str) -> str:
        head = '<?xml version="1.0" encoding="UTF-8"?>\n<febio_spec version="4.0">\n'
        return f"{head}{heading}  <Material>\n{text}  </Material>\n</febio_spec>\n"


def _element(name: str, number: float) -> str:
    return f"      <{name}>{number:.10e}</{name}>"
