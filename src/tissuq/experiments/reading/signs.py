"""The sign of compression: never guessed, asked for where a name or a value leaves it open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments.reading.columns import ColumnChoice, heading
from tissuq.experiments.reading.table_rows import Curve

__all__ = ["with_compression_negative"]

COMPRESSION_WORDS = ("compressive", "stauchung", "druck")
NEGLIGIBLE = 0.1
"""Share of the largest strain up to which strains of the other sign are noise or slack."""


def with_compression_negative(curve: Curve, choice: ColumnChoice, compression_positive: bool) -> Curve:
    """Return the curve with strain and stress of compression negative.

    Where the file counts compression as positive, stresses at stretches below 1 change their sign. Where its strains
    or displacements are positive, too, they do as well.

    Raises
    ------
    InputError
        When it does but the stretches are all above 1, or a column's name says compression and nobody says its sign.
    """
    if choice.measure == "shear":
        if compression_positive:
            raise InputError("compression_positive=True (--compression-positive) has no meaning for a shear stress.")
        return curve
    strain = curve.stretch - 1
    if not compression_positive:
        _check_names(curve, choice)
        return curve
    if choice.measure == "stretch" and (strain >= 0).all():
        raise InputError(
            f"{curve.table.place(choice.deformation)}: compression_positive=True (--compression-positive) is given, "
            "but no stretch is below 1, so nothing would change; a stretch below 1 is compression. Leave it out."
        )
    if choice.measure != "stretch" and strain.min() > -NEGLIGIBLE * strain.max():
        is_positive = float(curve.stress @ strain) > 0
        stress = -curve.stress if is_positive else curve.stress
        what = f"signs of {choice.measure} and {choice.load}" if is_positive else f"sign of {choice.measure}"
        return replace(curve, stretch=1 - strain, stress=stress).told(f"{what} changed: compression is positive")
    stress = np.where(strain < 0, -curve.stress, curve.stress)
    return replace(curve, stress=stress).told("sign changed at stretch < 1")


def _check_names(curve: Curve, choice: ColumnChoice) -> None:
    furthest = int(np.argmax(np.abs(curve.stretch - 1)))
    for column, value in ((choice.deformation, curve.stretch[furthest] - 1), (choice.stress, curve.stress[furthest])):
        if heading(curve.table.names[column]).quantity.startswith(COMPRESSION_WORDS) and value > 0:
            raise InputError(
                f"{curve.table.place(column, furthest)}: the name says compression and the value is positive. If the "
                "machine counts compression as positive, give compression_positive=True (--compression-positive)."
            )
