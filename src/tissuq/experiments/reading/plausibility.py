"""Checks that numbers are what their columns are read as: stretches, strains, and signs, which are never guessed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import InputError
from tissuq.experiments.reading.columns import ColumnChoice
from tissuq.experiments.reading.headings import heading
from tissuq.experiments.reading.measured_rows import MeasuredRows
from tissuq.experiments.reading.recognition import SHEARS
from tissuq.experiments.reading.strain_measures import STRAIN_MEASURES
from tissuq.experiments.reading.table import Column, Table

__all__ = [
    "DOUBTFUL_STRAIN",
    "RATIO_ASSUMED",
    "check_signs",
    "check_strain",
    "check_stretches",
    "with_compression_negative",
]

PLAIN_STRAIN_LIMIT = 10.0
"""A strain without a unit beyond this (1000 %) is taken for percent and asked about."""
DOUBTFUL_STRAIN = 1.0
"""A strain without a unit beyond this (100 %) may be percent; it is taken for a plain ratio with a warning."""
RATIO_ASSUMED = "(a plain ratio assumed: the file states no unit)"
COMPRESSED_LIMIT = 0.5
"""Stretches that all lie below this are taken for strains: a test starts near stretch 1."""
NOTABLE_SHARE = 0.1
"""Share of the largest stretch change and stress that rows must reach for their sign to matter."""
COMPRESSION_WORDS = ("compressive", "stauchung", "druck", "сжима")
"""How names of columns begin whose numbers may be positive in compression."""
NEGLIGIBLE_STRAIN = 0.1
"""Share of the largest strain up to which strains of the other sign are noise or slack."""


def with_compression_negative(
    measured: MeasuredRows, choices: Sequence[ColumnChoice], compression_positive: bool | None, direction: str
) -> MeasuredRows:
    """Return the rows with strain and stress of compression negative.

    The direction is that of the load as names say it: compression, tension or an empty text.

    Where the file counts compression as positive, all stresses change their sign: only those at stretches below 1 where
    those above are positive, too. Strains and displacements do as well where compression is positive there.

    Raises
    ------
    InputError
        When it does but the stretches are all above 1, or a name says compression and nobody says its sign.
    """
    choice = choices[0]
    if choice.measure in SHEARS or choice.load == "pressure":
        if compression_positive:
            what = "pressure" if choice.load == "pressure" else "shear stress"
            raise InputError(f"compression_positive=True (--compression-positive) has no meaning for a {what}.")
        return measured
    if compression_positive is None:
        _check_names(measured, choices, direction)
    strain = measured.stretch - 1
    if compression_positive is False and choice.measure in ("strain", "displacement"):
        is_turned = float((measured.stress * strain).sum()) < 0 and strain.max() < -NEGLIGIBLE_STRAIN * strain.min()
        if is_turned and measured.stress.sum() > 0:
            turned = replace(measured, stretch=_of_other_sign(measured.stretch, choice))
            return turned.with_step(f"sign of {choice.measure} changed: tension is positive")
    if not compression_positive:
        return measured
    says_direction = choice.measure in ("stretch", "length")
    if says_direction and (strain >= 0).all():
        raise InputError(
            f"{measured.table.place(choice.deformation)}: compression_positive=True (--compression-positive) is given, "
            "but no stretch is below 1, so nothing would change; a stretch below 1 is compression. Leave it out."
        )
    if not says_direction and strain.min() > -NEGLIGIBLE_STRAIN * strain.max():
        is_positive = float((measured.stress * strain).sum()) > 0
        stress = -measured.stress if is_positive else measured.stress
        what = f"signs of {choice.measure} and {choice.load}" if is_positive else f"sign of {choice.measure}"
        return replace(measured, stretch=_of_other_sign(measured.stretch, choice), stress=stress).with_step(
            f"{what} changed: compression is positive"
        )
    limit = NEGLIGIBLE_STRAIN * np.abs(strain).max()
    in_tension, in_compression = (
        float((measured.stress * strain)[side].sum()) for side in (strain > limit, strain < -limit)
    )
    if in_tension > 0 and (in_compression < 0 or says_direction):
        stress = np.where(strain < 0, -measured.stress, measured.stress)
        return replace(measured, stress=stress).with_step("sign changed at stretch < 1")
    turned = replace(measured, stress=-measured.stress)
    if in_tension > 0 and not says_direction:
        turned = replace(turned, stretch=_of_other_sign(measured.stretch, choice))
        return turned.with_step(f"signs of {choice.measure} and {choice.load} changed: compression is positive")
    return turned.with_step(f"sign of {choice.load} changed: compression is positive")


def _of_other_sign(stretch: Column, choice: ColumnChoice) -> Column:
    """Return the stretches whose strains have the other sign, in the measure of the file."""
    measure = STRAIN_MEASURES[choice.strain_type]
    if measure.strain is None:
        return stretch
    return measure.converted(-measure.strain(stretch), is_shear=False)[0]


def check_stretches(measured: MeasuredRows, choices: Sequence[ColumnChoice]) -> None:
    """Refuse columns of stretches that are not positive, or that are strains by their size."""
    for choice, stretch in zip(choices, measured.stretch, strict=True):
        if choice.measure not in SHEARS:
            _check_stretch(measured.table, choice, stretch)


def check_signs(measured: MeasuredRows, choices: Sequence[ColumnChoice], compression_positive: bool) -> None:
    """Refuse stresses that do negative work clearly beyond noise: the sign convention must be asked for.

    Of several stresses the rows are looked at where the stretches are all above 1 or all below; of shear the first.
    """
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
    for choice, stretch, stress in zip(choices, clear.stretch, clear.stress, strict=True):
        _check_signs(clear.table, choice, stretch, stress, compression_positive)


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
    table: Table, choice: ColumnChoice, stretch: Column, stress: Column, compression_positive: bool
) -> None:
    row = _wrong_sign(stretch, stress, stretch < 1)
    if row is not None:
        cell = f"{table.place(choice.stress, row)}: at stretch {stretch[row]:g}"
        if compression_positive:
            raise InputError(
                f"{cell} the stress is already negative in the file. Leave out compression_positive=True "
                "(--compression-positive)."
            )
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
        advice = "Change the sign of the stresses in the file, or check which columns are read."
        if choice.measure in ("strain", "displacement"):
            advice = (
                f"If this is compression, whose {choice.measure} the machine counts as positive, give "
                "compression_positive=True (--compression-positive); if it is tension, change the sign of the "
                f"{choice.load} in the file."
            )
        raise InputError(
            f"{table.place(choice.stress, row)}: at stretch {stretch[row]:g} (tension) the stress "
            f"is negative ({stress[row]:g} MPa); tension must be positive. {advice}"
        )


def _check_shear_signs(table: Table, choice: ColumnChoice, shear: Column, stress: Column) -> None:
    row = _wrong_sign(1 + shear, stress, np.ones(len(shear), dtype=bool))
    if row is not None:
        raise InputError(
            f"{table.place(choice.stress, row)}: at an amount of shear of {shear[row]:g} the shear stress is "
            f"{stress[row]:g} MPa; it must have the sign of the shear. Change one of the signs in the file, or check "
            "which columns are read."
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


def _check_names(measured: MeasuredRows, choices: Sequence[ColumnChoice], direction: str) -> None:
    """Refuse positive numbers in columns whose names say compression, and of a test whose name does."""
    for choice, stretch, stress in zip(choices, measured.stretch, measured.stress, strict=True):
        furthest = int(np.argmax(np.abs(stretch - 1)))
        for column, value in ((choice.deformation, stretch[furthest] - 1), (choice.stress, stress[furthest])):
            if heading(measured.table.names[column]).quantity.startswith(COMPRESSION_WORDS) and value > 0:
                raise InputError(
                    f"{measured.table.place(column, furthest)}: the name says compression and the value is positive. "
                    "If the machine counts compression as positive, give compression_positive=True "
                    "(--compression-positive)."
                )
    (choice, *_), strain, stress = choices, measured.stretch[0] - 1, measured.stress[0]
    is_of_sign = choice.measure in ("strain", "displacement")
    is_all_positive = strain.min() > -NEGLIGIBLE_STRAIN * strain.max() and float((strain * stress).sum()) > 0
    if direction == "compression" and is_of_sign and is_all_positive:
        raise InputError(
            f"{measured.table.file}: a name says that this is compression, and strains and loads are positive. If the "
            "machine counts compression as positive, give compression_positive=True (--compression-positive); if it "
            "is tension, compression_positive=False (--tension-positive)."
        )
