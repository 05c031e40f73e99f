"""Cards for FEBio."""

from __future__ import annotations

from xml.sax.saxutils import quoteattr

from tissuq.export.code import Card, FECode
from tissuq.export.forms import OgdenForm, OwnForm, PolynomialForm
from tissuq.export.projection import OgdenFit, ReducedFit, reduced_terms
from tissuq.mechanics.materials import Gent, VerondaWestmann

__all__ = ["FEBio"]

ORDERS = 6


class FEBio(FECode):
    """``<material>`` of FEBio, always uncoupled: "neo-Hookean" of FEBio is another, coupled law, so it is not used."""

    name = "febio"
    description = "FEBio <Material> include files"
    suffix = ".feb"
    comment = ("<!-- ", " -->")
    checked = "written after the manual, not run in FEBio"
    volumetric = "K/2 (ln J)^2, FEBio's k = K"
    forms = (
        PolynomialForm("Mooney-Rivlin", "c1 (I1 - 3) + c2 (I2 - 3)", ("C10", "C01"), ("c1", "c2")),
        PolynomialForm(
            "Yeoh", "sum of c_i (I1 - 3)^i", reduced_terms(ORDERS), tuple(f"c{n}" for n in range(1, ORDERS + 1))
        ),
        OgdenForm(
            "Ogden",
            "sum of c_i/m_i^2 (l1^m_i + l2^m_i + l3^m_i - 3)",
            1,
            ORDERS,
            lambda mu, alpha: 2 * mu,
            ("c", "m"),
        ),
        OwnForm("Gent", "-G Jm/2 ln(1 - (I1 - 3)/Jm)", Gent, lambda mu, Jm: {"G": mu, "Jm": Jm}),
        OwnForm(
            "Veronda-Westmann",
            "c1 (exp(c2 (I1 - 3)) - 1) - c1 c2/2 (I2 - 3)",
            VerondaWestmann,
            lambda mu, b: {"c1": mu / b, "c2": b},
        ),
    )
    projections = OgdenFit(ORDERS), ReducedFit(reduced_terms(ORDERS))

    def text(self, card: Card) -> str:
        numbers = {"density": card.water, **card.constants, "k": card.bulk}
        lines = [f"      <{name}>{number:.10e}</{name}>" for name, number in numbers.items()]
        head = f'    <material id="1" name={quoteattr(card.name)} type="{card.form.keyword}">'
        return "\n".join([head, *lines, "    </material>", ""])

    def wrapped(self, heading: str, text: str) -> str:
        head = '<?xml version="1.0" encoding="UTF-8"?>\n<febio_spec version="4.0">\n'
        return f"{head}{heading}  <Material>\n{text}  </Material>\n</febio_spec>\n"
