"""What the material cards of a run depend on."""

from __future__ import annotations

from tissuq.studies.option import option
from tissuq.studies.shared_options import RunSettings, sampling

__all__ = ["ExportSettings"]


class ExportSettings(RunSettings):
    """Everything that material cards depend on."""

    format: str = option("abaqus", "abaqus, calculix, ansys, febio, ls-dyna, or table (W1 and W2 as CSV).")
    draws: int = option(20, "Number of draws, a card each.")
    sampling: str = sampling()
    all_draws: bool = option(False, "Keep draws that are not stable over the measured range.")
    law: str | None = option(
        None,
        "Write the nearest polynomial, reduced-polynomial, ogden or (FEBio) mixture [the draws' own law where the code "
        "has it, else the best of these].",
    )
    order: int | None = option(None, "Order or number of terms of that law.")
    unit: str = option("MPa", "Unit of stress of the model: MPa, kPa or Pa.")
    bulk_modulus: float | None = option(None, "In that unit, of all draws [1000 times the mean initial shear modulus].")
    poisson: float | None = option(None, "Instead: Poisson's ratio of all draws.")
    name: str = option("TISSUE", "Name of the material in the cards.")
    number: int = option(1, "Number of the material in the model (FEBio, LS-DYNA, ANSYS).")
    seed: int = option(0, "Seed of the draws.")
