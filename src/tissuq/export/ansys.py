"""Cards for ANSYS Mechanical APDL."""

from __future__ import annotations

from tissuq.export.code import Card, FECode
from tissuq.export.laws import LibraryForm, OgdenForm, PolynomialForm
from tissuq.export.projection import OgdenFit, PolynomialFit, ReducedFit, full_terms, reduced_terms
from tissuq.mechanics.laws import Gent

__all__ = ["Ansys"]

NUMBERS_PER_LINE = 6


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

    def text(self, card: Card) -> str:
        option, _, count = card.form.keyword.partition(", ")
        points = count.split(" ")[0]
        numbers = [*card.constants.values(), 2 / card.bulk]
        if count.endswith("terms"):
            numbers += [0.0] * (int(points) - 1)
        lines = [f"! material {card.name}; MATID 1: change it to that of the model", f"TB,HYPER,1,1,{points},{option}"]
        for start in range(0, len(numbers), NUMBERS_PER_LINE):
            words = ",".join(f"{number:.10e}" for number in numbers[start : start + NUMBERS_PER_LINE])
            lines.append(f"TBDATA,{start + 1},{words}")
        return "".join(f"{line}\n" for line in lines)
