"""Checks that numbers are what their columns are said to be: stretches, strains, signs of stress."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import InputError
from tissuq.experiments.reading.columns import ColumnChoice
from tissuq.experiments.reading.table import Table

__all__ = ["check_shear_signs", "check_signs", "check_strain", "check_stretch"]

Column = NDArray[np.float64]

PLAIN_STRAIN_LIMIT = 10.0
"""A strain without a unit beyond this (1000 %) is taken for percent and asked about."""
COMPRESSED_LIMIT = 0.5
"""Stretches that all lie below this are taken for strains: a test starts near stretch 1."""
NOTABLE = 0.1
"""Share of the largest stretch change and stress that rows must reach for their sign to matter."""


def check_stretch(table: Table, choice: ColumnChoice, stretch: Column) -> None:
    """Refuse a column of stretches that are not positive, or that are strains by their size."""
    name = table.names[choice.deformation] or str(choice.deformation + 1)
    if choice.is_strain:
        advice = "A strain must be larger than -1 (-100 %); correct its values or its unit."
    else:
        advice = (
            "A stretch is deformed over undeformed length. If the column holds strain (stretch - 1), say so: "
            f'columns={{"strain": "{name}"}} or --column strain={_quoted(name)}.'
        )
    row = int(np.argmin(stretch))
    if stretch[row] <= 0:
        row = int(np.flatnonzero(stretch <= 0)[0])
        raise InputError(f"{table.place(choice.deformation, row)}: stretch {stretch[row]:g} is not positive. {advice}")
    if stretch.max() < COMPRESSED_LIMIT and not choice.is_strain:
        raise InputError(
            f"{table.place(choice.deformation)}: its values ({stretch.min():g} to "
            f"{stretch.max():g}) look like strain, not stretch. {advice}"
        )


def check_strain(table: Table, choice: ColumnChoice, strain: Column, stress: Column, has_unit: bool) -> None:
    """Refuse a column of strains that are stretches by their values, or percent without saying so."""
    column = choice.deformation
    if not has_unit and np.abs(strain).max() > PLAIN_STRAIN_LIMIT:
        row = int(np.argmax(np.abs(strain)))
        raise InputError(
            f"{table.place(column, row)}: strain {strain[row]:g} without a unit would be {strain[row]:.0%}. "
            'Give strain_unit="%" (--strain-unit %) if it is percent, strain_unit="1" if it is a plain ratio.'
        )
    start = int(np.argmin(np.abs(strain - 1.0)))
    starts_at_one = abs(strain[start] - 1.0) < 0.02 and abs(stress[start]) <= 0.02 * np.abs(stress).max()
    if starts_at_one and np.abs(strain).min() > 0.2:
        name = table.names[column] or str(column + 1)
        raise InputError(
            f"{table.place(column, start)}: at strain {strain[start]:g} there is no stress, and the column "
            f'never comes near 0: it looks like a stretch. Say so: columns={{"stretch": "{name}"}} or '
            f"--column stretch={_quoted(name)}."
        )


def check_signs(
    table: Table, choice: ColumnChoice, stretch: Column, stress: Column, compression_positive: bool
) -> None:
    """Refuse stresses that do negative work clearly beyond noise: the sign convention must be asked for."""
    row = _wrong_sign(stretch, stress, stretch < 1)
    if row is not None:
        found = f"{table.place(choice.stress, row)}: at stretch {stretch[row]:g}"
        if compression_positive:
            raise InputError(
                f"{found} the stress is already negative in the file. Leave out compression_positive=True "
                "(--compression-positive)."
            )
        raise InputError(
            f"{found} (compression) the stress is positive ({stress[row]:g} MPa). If the machine "
            "counts compression as positive, give compression_positive=True (--compression-positive); if the "
            "column of stretches holds strain, give it as strain."
        )
    row = _wrong_sign(stretch, stress, stretch > 1)
    if row is not None:
        raise InputError(
            f"{table.place(choice.stress, row)}: at stretch {stretch[row]:g} (tension) the stress "
            f"is negative ({stress[row]:g} MPa); tension must be positive. Change the sign of the stresses "
            "in the file, or of the strains if this is compression, or check which columns are read."
        )


def check_shear_signs(table: Table, choice: ColumnChoice, shear: Column, stress: Column) -> None:
    """Refuse shear stresses that do negative work clearly beyond noise."""
    row = _wrong_sign(1 + shear, stress, np.ones(len(shear), dtype=bool))
    if row is not None:
        raise InputError(
            f"{table.place(choice.stress, row)}: at an amount of shear of {shear[row]:g} the shear stress is "
            f"{stress[row]:g} MPa; it must have the sign of the shear. Change one of the signs in the file, or check "
            "which columns are read."
        )


def _wrong_sign(stretch: Column, stress: Column, rows: NDArray[np.bool_]) -> int | None:
    """Return the row with the most negative work if the rows as a whole, beyond noise, do negative work."""
    change = stretch - 1
    work = np.where(rows, stress * change, 0.0)
    notable = (
        np.abs(change[rows]).max(initial=0.0) >= NOTABLE * np.abs(change).max()
        and np.abs(stress[rows]).max(initial=0.0) >= NOTABLE * np.abs(stress).max()
    )
    return int(np.argmin(work)) if notable and work.sum() < -0.5 * np.abs(work).sum() else None


def _quoted(name: str) -> str:
    return f"'{name}'" if " " in name else name
