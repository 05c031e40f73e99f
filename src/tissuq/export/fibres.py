"""Fibres in a neo-Hookean matrix, in the notation of the finite-element codes that have them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import cos, degrees, pi, sin

from tissuq.errors import InputError
from tissuq.export.cards import Cards
from tissuq.export.laws import Constants, Form, MixtureForm, summands
from tissuq.mechanics import FibreMaterial, Material
from tissuq.mechanics.laws import DispersedFibres, ExponentialFibres, Rivlin, StandardFibres

CALCULIX_PREFIX = "ELASTIC_FIBER"
"""What the name of a material begins with that CalculiX takes for one with fibres."""
QUADRATIC_RATE = 1e-6
"""The rate k2 with which exponential fibres are written for quadratic ones: the stress of fibres of strain E = I4 - 1
is larger by a share of k2 E^2."""
FIBRE_AXES = (
    "fibres: at the angles phi and -phi (one family: at phi) from axis 1 towards axis 2 of the test; axis 1 is the "
    "first local axis of the section's orientation (of mat_axis in FEBio), axis 2 the second"
)
WITHIN_UNIT = 1 - 1e-15
"""Factor of the components of a direction, so that rounding leaves no more than unit length, which CalculiX refuses."""


@dataclass(frozen=True)
class FibreForm(Form):
    """W = C10 (I1 - 3) + k1/(2 k2) sum over families of (exp(k2 <E>^2) - 1), E as in `DispersedFibres`.

    Parameters
    ----------
    families : int
        Of the fibres.
    has_dispersion : bool
        Whether the code has kappa.
    only_along_axis : bool
        Whether the fibres must lie along axis 1.
    matrix : (str, float)
        What the code calls the constant of the matrix, and that over C10.
    has_matrix : bool
        Whether the material has a matrix; in a sum with others that constant is zero.
    share : float
        The code's k1 over that of a family.
    """

    families: int
    has_dispersion: bool = True
    only_along_axis: bool = False
    matrix: tuple[str, float] = ("C10", 1.0)
    has_matrix: bool = True
    share: float = 1.0

    def holds(self, material: Material) -> bool:
        *matrix, fibres = summands(material)
        is_neo_hookean = [isinstance(summand, Rivlin) and summand.terms == ("C10",) for summand in matrix]
        if is_neo_hookean != [True] * self.has_matrix or not isinstance(fibres, FibreMaterial):
            return False
        kinds = (StandardFibres, ExponentialFibres, *[DispersedFibres] * self.has_dispersion)
        is_placed = fibres.degrees == 0 or not self.only_along_axis
        return isinstance(fibres, kinds) and fibres.families == self.families and is_placed

    def constants(self, material: Material, values: Sequence[float]) -> Constants:
        fibres = summands(material)[-1]
        assert isinstance(fibres, FibreMaterial)  # noqa: S101 (what it holds)
        of_fibres = values[int(self.has_matrix) :]
        named = dict(zip((parameter.symbol for parameter in fibres.parameters), of_fibres, strict=True))
        name, factor = self.matrix
        constants = {
            name: factor * values[0] if self.has_matrix else 0.0,
            "k1": self.share * named.get("k1", named.get("k", 0.0)),
            "k2": named.get("k2", QUADRATIC_RATE),
        }
        if self.has_dispersion:
            constants["kappa"] = named.get("kappa", 0.0)
        return constants | {"degrees": degrees(named["phi"]) if fibres.degrees is None else fibres.degrees}


def fibres_of_form(form: Form, constants: Constants) -> tuple[FibreForm, Constants] | None:
    """Return what of a form is fibres, with its constants; None where nothing is."""
    if isinstance(form, FibreForm):
        return form, constants
    if not isinstance(form, MixtureForm):
        return None
    fibres = (summand for summand in form.summands if isinstance(summand, FibreForm))
    return next(((summand, form.of_summand(summand, constants)) for summand in fibres), None)


def directions(form: FibreForm, constants: Mapping[str, float]) -> list[tuple[float, float]]:
    """Return the components along axes 1 and 2 of the direction of every family."""
    angle = constants["degrees"] * pi / 180
    return [(WITHIN_UNIT * cos(angle), sign * WITHIN_UNIT * sin(angle)) for sign in (1, -1)[: form.families]]


def initial_stiffness(form: Form, constants: Constants) -> float:
    """Return a third of the stiffness of all fibres along them at rest, 4 k1 a family; nothing of other forms.

    Added to the matrix's shear modulus it is the one on whose scale the bulk modulus is large.
    """
    if (fibres := fibres_of_form(form, constants)) is None:
        return 0.0
    fibre_form, of_fibres = fibres
    return 4 / 3 * of_fibres["k1"] / fibre_form.share * fibre_form.families


def check_fibres(name: str, cards: Cards) -> None:
    """Refuse cards whose fibres a model would not compute as they are meant, in the place of a material of that name.

    Raises
    ------
    InputError
        When the cards do not hold all of the fibres, or CalculiX would not take the material for one with fibres.
    """
    if cards.outside:
        raise InputError(cards.outside)
    if f"NAME={CALCULIX_PREFIX}" in cards.blocks[0] and not name.upper().startswith(CALCULIX_PREFIX):
        raise InputError(
            f"CalculiX knows a material with fibres by its name, which begins with {CALCULIX_PREFIX}: in the model, "
            f"rename '{name}' to '{CALCULIX_PREFIX}_{name}', in *MATERIAL and wherever else it is named, such as "
            f"*SOLID SECTION, and give --replace {CALCULIX_PREFIX}_{name}."
        )


def fibre_sentences(form: Form, constants: Sequence[Constants]) -> Iterator[str]:
    """Return what the user must read of cards with fibres."""
    of_fibres = [fibres[1] for draw in constants if (fibres := fibres_of_form(form, draw))]
    if not of_fibres:
        return
    yield (
        "Fibres lie from axis 1 of the test towards its axis 2, axes of the material's orientation in the model: give "
        "the section one whose first axis is axis 1 of the test. Every file says where its fibres lie."
    )
    if any(draw["k2"] == QUADRATIC_RATE for draw in of_fibres):
        yield (
            f"Quadratic fibres are written as exponential ones with k2 = {QUADRATIC_RATE:g}, whose stress is larger by "
            f"{QUADRATIC_RATE:g} (I4 - 1)^2, relative to it."
        )
