"""Checks that numbers are what their columns are read as: stretches and strains, and loads of their signs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import InputError
from tissuq.experiments.reading.measured_rows import MeasuredRows
from tissuq.experiments.reading.recognition import SHEARS, ColumnChoice
from tissuq.experiments.reading.table import Column, Table

__all__ = [
    "DOUBTFUL_STRAIN",
    "RATIO_ASSUMED",
    "check_signs",
    "check_strain",
    "check_stretches",
]

PLAIN_STRAIN_LIMIT = 10.0
"""A strain without a unit beyond this (1000 %) is taken for percent and asked about."""
DOUBTFUL_STRAIN = 1.0
"""A strain without a unit beyond this (100 %) may be percent; it is taken for a plain ratio with a warning."""
RATIO_ASSUMED = "(a plain ratio assumed: the file states no unit)"
COMPRESSED_LIMIT = 0.5
"""Stretches that all lie below this are taken for strains: a test starts near stretch 1."""
TURN_ALL = (
    "If the machine counts so, give turn='load' (--turn load); if the deformations have the wrong sign, "
    "turn='deformation' (--turn deformation). Or check which columns are read."
)
TURN_ONE = "The other axis has the right sign: change that of this column in the file, or check which columns are read."
"""What to do about wrong signs on both axes, and on one."""
NOTABLE_SHARE = 0.1
"""Share of the largest stretch change and stress that rows must reach for their sign to matter."""


def check_stretches(measured: MeasuredRows, choices: Sequence[ColumnChoice]) -> None:
    """Refuse columns of stretches that are not positive, or that are strains by their size."""
    for choice, stretch in zip(choices, measured.stretch, strict=True):
        if choice.measure not in SHEARS:
            _check_stretch(measured.table, choice, stretch)


def check_signs(
    measured: MeasuredRows, choices: Sequence[ColumnChoice], compression_positive: bool, turn: str | None = None
) -> None:
    """Refuse stresses that do negative work clearly beyond noise: the sign convention must be asked for.

    Of several stresses the rows are looked at where the stretches are all above 1 or all below; of shear the first.
    """
    try:
        _check_work(measured, choices, compression_positive)
    except InputError as error:
        if turn is None:
            raise
        raise InputError(
            f"{error} (Signs are turned as asked, --turn {turn}: turn others, or leave it out.)"
        ) from error


def _check_work(measured: MeasuredRows, choices: Sequence[ColumnChoice], compression_positive: bool) -> None:
    if choices[0].measure in SHEARS:
        _check_shear_signs(measured.table, choices[0], measured.stretch[0], measured.stress[0])
        return
    if choices[0].load == "pressure":
        _check_inflation(measured.table, choices[0], measured.stretch[0], measured.stress[0])
        return
    change = measured.stretch - 1
    alike = np.flatnonzero((change >= 0).all(axis=0) | (change <= 0).all(axis=0))
    if not len(alike):
        return
    clear = measured.taken(alike)
    axes = list(zip(choices, clear.stretch, clear.stress, strict=True))
    are_wrong = [_wrong_sign(stretch, stress, stretch != 1) is not None for _, stretch, stress in axes]
    advice = "" if len(axes) == 1 else TURN_ALL if all(are_wrong) else TURN_ONE
    for axis in axes:
        _check_signs(clear.table, *axis, compression_positive, advice)


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
        name = table.key(column)
        raise InputError(
            f"{table.place(column, start)}: at strain {strain[start]:g} there is no stress, and the column "
            f'never comes near 0: it looks like a stretch. Say so: columns={{"stretch": "{name}"}} or '
            f"--column stretch={_quoted(name)}."
        )


def _check_stretch(table: Table, choice: ColumnChoice, stretch: Column) -> None:
    is_positive, is_strain = bool(stretch.min() > 0), choice.measure == "strain"
    if is_positive and (is_strain or stretch.max() >= COMPRESSED_LIMIT):
        return
    name = table.key(choice.deformation)
    if is_strain:
        advice = "A strain must be larger than -1 (-100 %); correct its values or its unit."
    else:
        advice = (
            "A stretch is deformed over undeformed length. If the column holds strain (stretch - 1), say so: "
            f'columns={{"strain": "{name}"}} or --column strain={_quoted(name)}.'
        )
    if is_positive:
        raise InputError(
            f"{table.place(choice.deformation)}: its values ({stretch.min():g} to "
            f"{stretch.max():g}) look like strain, not stretch. {advice}"
        )
    row = int(np.flatnonzero(stretch <= 0)[0])
    raise InputError(f"{table.place(choice.deformation, row)}: stretch {stretch[row]:g} is not positive. {advice}")


def _check_signs(
    table: Table, choice: ColumnChoice, stretch: Column, stress: Column, compression_positive: bool, advice: str
) -> None:
    row = _wrong_sign(stretch, stress, stretch < 1)
    if row is not None:
        cell = f"{table.place(choice.stress, row)}: at stretch {stretch[row]:g}"
        if compression_positive:
            raise InputError(
                f"{cell} the stress is already negative in the file. Leave out compression_positive=True "
                "(--compression-positive)."
            )
        if advice:
            raise InputError(f"{cell} (compression) the stress is positive ({stress[row]:g} MPa). {advice}")
        other = "; if the column of stretches holds strain, give it as strain"
        if choice.measure in ("strain", "displacement"):
            other = (
                f"; if this is tension, in which the {choice.measure} falls, give compression_positive=False "
                "(--tension-positive)"
            )
        raise InputError(
            f"{cell} (compression) the stress is positive ({stress[row]:g} MPa). If the machine "
            "counts compression as positive, give compression_positive=True (--compression-positive)"
            f"{other}."
        )
    row = _wrong_sign(stretch, stress, stretch > 1)
    if row is not None:
        if not advice and choice.measure in ("strain", "displacement"):
            advice = (
                f"If this is compression, whose {choice.measure} the machine counts as positive, give "
                "compression_positive=True (--compression-positive); if it is tension, turn the sign of "
                f"the {choice.load}: turn='load' (--turn load)."
            )
        advice = advice or "If the machine counts so, give turn='load' (--turn load), or check which columns are read."
        raise InputError(
            f"{table.place(choice.stress, row)}: at stretch {stretch[row]:g} (tension) the stress "
            f"is negative ({stress[row]:g} MPa); tension must be positive. {advice}"
        )


def _check_shear_signs(table: Table, choice: ColumnChoice, shear: Column, stress: Column) -> None:
    row = _wrong_sign(1 + shear, stress, np.ones(len(shear), dtype=bool))
    if row is not None:
        raise InputError(
            f"{table.place(choice.stress, row)}: at an amount of shear of {shear[row]:g} the shear stress is "
            f"{stress[row]:g} MPa; it must have the sign of the shear. Turn one of them, turn='load' (--turn load), "
            "or check which columns are read."
        )


def _check_inflation(table: Table, choice: ColumnChoice, stretch: Column, stress: Column) -> None:
    row = _wrong_sign(stretch, stress, stretch < 1)
    if row is not None:
        raise InputError(
            f"{table.place(choice.deformation, row)}: the tube is under pressure and narrower than undeformed (stretch "
            f"{stretch[row]:g} in the middle of the wall). Give the outer diameter that it has without pressure "
            "(--diameter), or check which columns are read."
        )


def _wrong_sign(stretch: Column, stress: Column, rows: NDArray[np.bool_]) -> int | None:
    """Return the row with the most negative work if the rows as a whole, beyond noise, do negative work."""
    change = stretch - 1
    work = np.where(rows, stress * change, 0.0)
    notable = (
        np.abs(change[rows]).max(initial=0.0) >= NOTABLE_SHARE * np.abs(change).max()
        and np.abs(stress[rows]).max(initial=0.0) >= NOTABLE_SHARE * np.abs(stress).max()
    )
    return int(np.argmin(work)) if notable and work.sum() < -0.5 * np.abs(work).sum() else None


def _quoted(name: str) -> str:
    return f"'{name}'" if " " in name else name
