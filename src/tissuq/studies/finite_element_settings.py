"""How a user's own finite-element model is run, with what cards, and what an ensemble of it depends on."""

from __future__ import annotations

from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tissuq.studies.option import Settings, argument, mesh_order, option, sampling, seed
from tissuq.studies.option_texts import pairs_of

if TYPE_CHECKING:
    from tissuq.export import CardSettings

__all__ = ["CardOptions", "EnsembleSettings", "ModelSettings"]

SOLVER, CARDS = "Solver", "Cards"
MESH = "Error of the mesh"


class CardOptions(Settings):
    """What material cards are."""

    law: str | None = option(
        None,
        "Write the nearest polynomial, reduced-polynomial, ogden or (FEBio) mixture [the draws' own law where the code "
        "has it, else the best of these].",
        group=CARDS,
    )
    order: int | None = option(None, "Order or number of terms of that law.", group=CARDS)
    unit: str = option("MPa", "Unit of stress of the model: MPa, kPa or Pa.", group=CARDS)
    bulk_modulus: float | None = option(
        None, "In that unit, of all draws [1000 times the mean initial shear modulus].", gt=0, lt=inf, group=CARDS
    )
    poisson: float | None = option(None, "Instead: Poisson's ratio of all draws.", group=CARDS)

    def card_settings(self, **changes: Any) -> CardSettings:
        """Return the settings of the cards.

        Raises
        ------
        InputError
            When they have no meaning.
        """
        from tissuq.export import CardSettings

        return CardSettings(**{name: getattr(self, name) for name in CardOptions.model_fields}, **changes)


class ModelSettings(CardOptions):
    """The solver of a deck, and the cards in it."""

    solver: str | None = option(None, "ccx, febio4 or command [that of the deck].", group=SOLVER)
    command: str = option(
        "", "Command of the solver, such as 'abaqus job={job} ask=off', {deck} with suffix.", group=SOLVER
    )
    deck: str | None = option(None, "abaqus, febio, ls-dyna or ansys [what the file is].", group=SOLVER)
    card_format: str | None = option(None, "Format of cards [that of the solver].", name="format", group=CARDS)
    also: list[str] = option(
        default_factory=list,
        help="Another file that the solver needs beside the deck; repeat for more.",
        takes=list[Path],
        group=SOLVER,
    )


class EnsembleSettings(ModelSettings):
    """Everything that the results of an ensemble depend on.

    ``materials`` has the folder of a run for each material of the model, ``quantities`` what each quantity is.
    """

    model: str = argument(
        ...,
        "Your model: a deck of CalculiX or Abaqus (.inp), FEBio (.feb), LS-DYNA (.k), ANSYS (.cdb).",
        takes=Path,
    )
    materials: dict[str, str] = option(
        ...,
        "Name (ANSYS: number) of the material in the model that the draws replace; NAME=RUN takes them from another "
        "run. Repeat for more.",
        name="replace",
        min_length=1,
    )
    quantities: dict[str, str] = option(
        ...,
        "Quantity of interest: NAME=RF3@SET, U1@SET, S11@SET, MISES@SET:max (CalculiX), or NAME=file.py:function of "
        "the folder of a draw. Repeat for more.",
        name="qoi",
        parse=pairs_of("--qoi", "a quantity of interest", "NAME=WHAT, as in force=RF3@TOP"),
        min_length=1,
    )
    discrepancy: str | None = option(None, "Which of the discrepancies of the run [auto, or the only one].")
    draws: int = option(64, "Draws of the posterior.", ge=2)
    sampling: str = sampling()
    all_draws: bool = option(False, "Keep draws that are not stable over the measured range.")
    shares: bool = option(True, "Run the draws without their discrepancy, too, for the shares of the variance.")
    seed: int = seed()
    finer_model: str | None = option(
        None, "The same model with a finer mesh: one draw is run on it, too, for the error of the mesh.",
        takes=Path, group=MESH,
    )  # fmt: skip
    cell_ratio: float | None = option(
        None, "How many times smaller its elements are [by their number].", gt=1, lt=inf, group=MESH
    )
    mesh_order: float | None = mesh_order(MESH)
