"""Cards for LS-DYNA."""

from __future__ import annotations

from typing import Any

from tissuq.export.code import Card, FECode
from tissuq.export.laws import OgdenForm, PolynomialForm
from tissuq.export.projection import OgdenFit, PolynomialFit

__all__ = ["LSDyna"]

MAX_OGDEN_TERMS = 8
TERMS = ("C10", "C01", "C11", "C20", "C02", "C30")
Row = list[tuple[str, Any]]
KEYWORDS = {"MAT_077_H": "*MAT_HYPERELASTIC_RUBBER_TITLE", "MAT_077_O": "*MAT_OGDEN_RUBBER_TITLE"}


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
        PolynomialForm("MAT_077_H", "sum of C_ij (I1 - 3)^i (I2 - 3)^j", TERMS),
        OgdenForm(
            "MAT_077_O",
            "sum of mu_i/alpha_i (l1^alpha_i + l2^alpha_i + l3^alpha_i - 3)",
            1,
            MAX_OGDEN_TERMS,
            lambda mu, alpha: 2 * mu / alpha,
        ),
    )
    projections = PolynomialFit(TERMS), OgdenFit(MAX_OGDEN_TERMS)

    def text(self, card: Card) -> str:
        constants: Row = list(card.constants.items())
        rows: list[Row] = [[("mid", "1"), ("ro", card.water_density), ("pr", card.poisson), ("n", "0"), ("nv", "0")]]
        if card.form.keyword == "MAT_077_O":
            rows += [constants[0::2], constants[1::2]]
            rows[1:] = [row + [("", 0.0)] * (MAX_OGDEN_TERMS - len(row)) for row in rows[1:]]
        else:
            rows.append(constants)
        lines = ["*KEYWORD", f"{KEYWORDS[card.form.keyword]} +", card.name]
        for row in rows:
            lines.append("$#" + "".join(f"{name:>20}" for name, _ in row)[2:])
            lines.append("".join(f"{value if isinstance(value, str) else f'{value:.12e}':>20}" for _, value in row))
        return "\n".join([*lines, "*END", ""])
