"""Cards for Abaqus and for CalculiX, which reads the same keyword."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import ClassVar

from tissuq.errors import InputError
from tissuq.export.code import Card, FECode
from tissuq.export.laws import Form, LibraryForm, OgdenForm, PolynomialForm
from tissuq.export.projection import OgdenFit, PolynomialFit, Projection, ReducedFit, full_terms, reduced_terms
from tissuq.mechanics.laws import VanDerWaals

__all__ = ["Abaqus", "CalculiX"]

POLYNOMIAL = "sum of C_ij (I1 - 3)^i (I2 - 3)^j"
OGDEN = "sum of 2 mu_i/alpha_i^2 (l1^alpha_i + l2^alpha_i + l3^alpha_i - 3)"
NUMBERS_PER_LINE = 8


def _forms(max_order: int, max_ogden_terms: int) -> tuple[Form, ...]:
    """Return the forms of polynomials up to an order and of Ogden sums up to a number of terms."""
    orders = range(2, max_order + 1)
    reduced = [PolynomialForm(f"REDUCED POLYNOMIAL, N={n}", "sum of C_i0 (I1 - 3)^i", reduced_terms(n)) for n in orders]
    reduced[1] = PolynomialForm("YEOH", "C10 (I1 - 3) + C20 (I1 - 3)^2 + C30 (I1 - 3)^3", reduced_terms(3))
    return (
        PolynomialForm("NEO HOOKE", "C10 (I1 - 3)", ("C10",)),
        PolynomialForm("MOONEY-RIVLIN", "C10 (I1 - 3) + C01 (I2 - 3)", ("C10", "C01")),
        *reduced,
        *(PolynomialForm(f"POLYNOMIAL, N={n}", POLYNOMIAL, full_terms(n)) for n in orders),
        *(OgdenForm(f"OGDEN, N={n}", OGDEN, n, n, lambda mu, alpha: mu) for n in range(1, max_ogden_terms + 1)),
    )


class Abaqus(FECode):
    """``*HYPERELASTIC`` of Abaqus: D1 = 2/K, further D are zero (no such term)."""

    name = "abaqus"
    description = "Abaqus *HYPERELASTIC include files"
    suffix = ".inp"
    comment = ("** ", "")
    checked = "written after the manual of Abaqus, not run there; CalculiX, which reads the same keyword, was run"
    volumetric = "(J - 1)^2 / D1, D1 = 2/K (VAN DER WAALS: ((J^2 - 1)/2 - ln J) / D)"
    forms = (
        *_forms(6, 6),
        LibraryForm(
            "VAN DER WAALS",
            "mu (-(lambda_m^2 - 3) (ln(1 - h) + h) - 2/3 a ((I - 3)/2)^(3/2)), h^2 = (I - 3)/(lambda_m^2 - 3), I = I1",
            VanDerWaals,
            lambda mu, A, Jm: {"mu": mu, "lambda_m": sqrt(Jm + 3), "a": A / mu, "beta": 0.0},
        ),
    )
    projections: ClassVar[tuple[Projection, ...]] = (
        PolynomialFit(full_terms(4)),
        OgdenFit(6),
        ReducedFit(reduced_terms(5)),
    )
    absent_d: ClassVar[float] = 0.0
    """Value of D2 and D3 with which their volumetric terms vanish."""

    def text(self, card: Card) -> str:
        numbers = [*card.constants.values(), 2 / card.bulk, *[self.absent_d] * (_orders(card.form) - 1)]
        lines = [f"*MATERIAL, NAME={card.name}", f"*HYPERELASTIC, {card.form.keyword}", *_data_lines(numbers)]
        return "".join(f"{line}\n" for line in lines)


class CalculiX(Abaqus):
    """``*HYPERELASTIC`` of CalculiX, for up to three terms.

    It replaces every D below 1e-10 by its own default, so that D2 and D3 are so large that their terms vanish. Whether
    CalculiX computes what tissuq means is tested by running it on one element.
    """

    name = "calculix"
    description = "CalculiX *HYPERELASTIC include files"
    checked = "cards of this form were run in CalculiX on one element, and gave tissuq's stresses"
    volumetric = "(J - 1)^2 / D1, D1 = 2/K"
    forms = _forms(3, 3)
    projections = PolynomialFit(full_terms(3)), OgdenFit(3), ReducedFit(reduced_terms(3))
    absent_d = 1e20
    min_d1: ClassVar[float] = 1e-10
    """Smallest D1; below it CalculiX takes a Poisson's ratio of 0.475 instead."""

    def check(self, card: Card) -> None:
        if 2 / card.bulk < self.min_d1:
            raise InputError(
                f"D1 = 2/K = {2 / card.bulk:.3g} is too small for CalculiX, which replaces what is below "
                f"{self.min_d1:g} by a Poisson's ratio of 0.475: choose a larger unit of stress, or a smaller bulk "
                "modulus."
            )


def _orders(form: Form) -> int:
    """Return the number of D that a form has: one for each order of a polynomial, and for each Ogden term."""
    if isinstance(form, PolynomialForm):
        return max(int(symbol[1]) + int(symbol[2]) for symbol in form.symbols)
    return form.max_terms if isinstance(form, OgdenForm) else 1


def _data_lines(numbers: Sequence[float]) -> list[str]:
    """Return lines of eight numbers with eleven digits, which need no more than the 20 places that CalculiX reads."""
    words = [f"{number:.10e}" for number in numbers]
    return [", ".join(words[start : start + NUMBERS_PER_LINE]) for start in range(0, len(words), NUMBERS_PER_LINE)]
