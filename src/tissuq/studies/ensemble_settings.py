"""What an ensemble of a user's own finite-element model depends on."""

from __future__ import annotations

from math import inf
from pathlib import Path

from tissuq.studies.model_settings import ModelSettings
from tissuq.studies.option import argument, option
from tissuq.studies.option_texts import pairs_of
from tissuq.studies.shared_options import mesh_order, sampling, seed

__all__ = ["EnsembleSettings"]

MESH = "Error of the mesh"


class EnsembleSettings(ModelSettings):
    """Everything that the results of an ensemble depend on.

    ``materials`` has the folder of a run for each material of the model, ``quantities`` what each quantity is.
    """

    model: str = argument(
        ...,
        "Your model: a deck of CalculiX or Abaqus (.inp), FEBio (.feb), LS-DYNA (.k), ANSYS (.cdb).",
        takes=Path,
        parse=str,
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
        takes=Path, parse=str, group=MESH,
    )  # fmt: skip
    cell_ratio: float | None = option(
        None, "How many times smaller its elements are [by their number].", gt=1, lt=inf, group=MESH
    )
    mesh_order: float | None = mesh_order(MESH)
