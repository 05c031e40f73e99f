"""Signs of deformation and load: whatever the file counts as positive, lengthening and tension are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tissuq.arrays import BoolArray
from tissuq.errors import InputError
from tissuq.experiments.reading.measured_rows import MeasuredRows
from tissuq.experiments.reading.measures import STRAIN_MEASURES
from tissuq.experiments.reading.options import TURNS, ReadingOptions
from tissuq.experiments.reading.recognition import SHEARS, ColumnChoice
from tissuq.experiments.reading.stated_mode import direction_of
from tissuq.experiments.reading.table import Column, Table
from tissuq.experiments.units import StressUnit

SIGNED = ("strain", "displacement", *SHEARS)
"""Deformations that may be counted the other way round."""
NEGLIGIBLE_STRAIN = 0.1
"""Share of the largest strain up to which strains of the other sign are noise or slack."""
TURN_ALL = (
    "If the machine counts so, give turn='load' (--turn load); if the deformations have the wrong sign, "
    "turn='deformation' (--turn deformation). Or check which columns are read."
)
TURN_ONE = "The other axis has the right sign: change that of this column in the file, or check which columns are read."
"""What to do about wrong signs on both axes, and on one."""
NOTABLE_SHARE = 0.1
"""Share of the largest stretch change and stress that rows must reach for their sign to matter."""


def with_signs(
    measured: MeasuredRows, choices: Sequence[ColumnChoice], options: ReadingOptions, direction: str, shape: str = ""
) -> MeasuredRows:
    """Return the rows with lengthening and tension positive: some signs of the file turned.

    An option says whether the file counts compression as positive, and then the rows tell what is turned; or another
    one what is, whatever the rows tell. The direction is that of the load as names say it: compression, tension or an
    empty text. The shape is that of a specimen which is rather compressed than pulled, in words, or an empty text.

    Raises
    ------
    InputError
        When what is asked for has no meaning for the columns, or would change nothing, or a name or the shape of the
        specimen says compression and nobody says its sign.
    """
    compression_positive, turn = options.get("compression_positive"), options.get("turn")
    if turn is not None:
        return _turned(measured, choices, TURNS[turn], "as asked")
    if choices[0].measure in SHEARS or choices[0].load == "pressure":
        if compression_positive:
            what = "pressure" if choices[0].load == "pressure" else "shear stress"
            raise InputError(f"compression_positive=True (--compression-positive) has no meaning for a {what}.")
        return measured
    if compression_positive is None:
        _check_names(measured, choices, direction, shape)
        return measured
    if not compression_positive:
        strain, stress = measured.stretch - 1, measured.stress
        falls = float((stress * strain).sum()) < 0 and strain.max() < -NEGLIGIBLE_STRAIN * strain.min()
        is_turned = choices[0].measure in ("strain", "displacement") and falls and stress.sum() > 0
        return _turned(measured, choices, ("deformation",), "tension is positive") if is_turned else measured
    return _with_compression_negative(measured, choices)


def _with_compression_negative(measured: MeasuredRows, choices: Sequence[ColumnChoice]) -> MeasuredRows:
    """Return rows of one stress whose file counts compression as positive with the signs turned that show it.

    That of the load everywhere, or only at stretches below 1 where above it is positive, too; and that of strains and
    displacements where compression is positive there.
    """
    choice, strain = choices[0], measured.stretch - 1
    why = "compression is positive"
    says_direction = choice.measure in ("stretch", "length")
    if says_direction and (strain >= 0).all():
        raise InputError(
            f"{measured.table.place(choice.deformation)}: compression_positive=True (--compression-positive) is given, "
            "but no stretch is below 1, so nothing would change; a stretch below 1 is compression. Leave it out."
        )
    if not says_direction and strain.min() > -NEGLIGIBLE_STRAIN * strain.max():
        is_positive = float((measured.stress * strain).sum()) > 0
        return _turned(measured, choices, TURNS["both" if is_positive else "deformation"], why)
    limit = NEGLIGIBLE_STRAIN * np.abs(strain).max()
    in_tension, in_compression = (
        float((measured.stress * strain)[side].sum()) for side in (strain > limit, strain < -limit)
    )
    if in_tension > 0 and (in_compression < 0 or says_direction):
        stress = np.where(strain < 0, -measured.stress, measured.stress)
        return replace(measured, stress=stress).with_step("sign changed at stretch < 1")
    return _turned(measured, choices, TURNS["both" if in_tension > 0 and not says_direction else "load"], why)


def _turned(measured: MeasuredRows, choices: Sequence[ColumnChoice], what: Sequence[str], why: str) -> MeasuredRows:
    """Return rows with the other sign of deformations, loads or both, and a step that says so."""
    if unfit := next((choice for choice in choices if choice.measure not in SIGNED and "deformation" in what), None):
        raise InputError(
            f"{measured.table.place(unfit.deformation)} is read as {unfit.measure.replace('_', ' ')}, which has no "
            "other sign: turn the load alone (--turn load), or leave turn (--turn) out."
        )
    names = {"deformation": choices[0].measure, "load": choices[-1].load.replace("_", " ")}
    if "deformation" in what:
        turned = map(_of_other_sign, measured.stretch, choices)
        measured = replace(measured, stretch=np.stack(list(turned)))
    if "load" in what:
        is_turned = [len(choices) == 1 or choice.load != "pressure" for choice in choices]
        measured = replace(measured, stress=np.where(np.array(is_turned)[:, None], -measured.stress, measured.stress))
    signs = "signs" if len(what) > 1 else "sign"
    return measured.with_step(f"{signs} of {' and '.join(names[name] for name in what)} changed: {why}")


def _of_other_sign(stretch: Column, choice: ColumnChoice) -> Column:
    """Return the stretches whose strains, or amounts of shear, have the other sign, in the measure of the file."""
    if choice.measure in SHEARS:
        return -stretch
    measure = STRAIN_MEASURES[choice.strain_type]
    return stretch if measure.strain is None else measure.converted(-measure.strain(stretch), is_shear=False)[0]


def _check_names(measured: MeasuredRows, choices: Sequence[ColumnChoice], direction: str, shape: str) -> None:
    """Refuse positive numbers in columns whose names say compression, and of a test whose name or specimen does."""
    for choice, stretch, stress in zip(choices, measured.stretch, measured.stress, strict=True):
        furthest = int(np.argmax(np.abs(stretch - 1)))
        for column, value in ((choice.deformation, stretch[furthest] - 1), (choice.stress, stress[furthest])):
            if direction_of(measured.table.names[column]) == "compression" and value > 0:
                raise InputError(
                    f"{measured.table.place(column, furthest)}: the name says compression and the value is positive. "
                    "If the machine counts compression as positive, give compression_positive=True "
                    "(--compression-positive)."
                )
    (choice, *_), strain, stress = choices, measured.stretch[0] - 1, measured.stress[0]
    is_of_sign = choice.measure in ("strain", "displacement")
    is_all_positive = strain.min() > -NEGLIGIBLE_STRAIN * strain.max() and float((strain * stress).sum()) > 0
    why = {"compression": "a name says that this is compression", "": shape}.get(direction, "")
    if why and is_of_sign and is_all_positive:
        raise InputError(
            f"{measured.table.file}: {why}, and strains and loads are positive. If the "
            "machine counts compression as positive, give compression_positive=True (--compression-positive); if it "
            "is tension, compression_positive=False (--tension-positive)."
        )
    is_all_negative = strain.max() < -NEGLIGIBLE_STRAIN * strain.min() and float((strain * stress).sum()) > 0
    if direction == "tension" and is_of_sign and is_all_negative:
        raise InputError(
            f"{measured.table.file}: a name says that this is tension, and {choice.measure} and {choice.load} are "
            "negative. If the machine counts tension as negative, give turn='both' (--turn both); if it is "
            "compression, compression_positive=False (--tension-positive)."
        )


def check_signs(
    measured: MeasuredRows, choices: Sequence[ColumnChoice], options: ReadingOptions, unit: StressUnit
) -> None:
    """Refuse stresses that do negative work clearly beyond noise: the sign convention must be asked for.

    Of several stresses the rows are looked at where the stretches are all above 1 or all below; of shear the first.
    """
    choice, stretch, stress = choices[0], measured.stretch[0], measured.stress[0]
    if choice.measure in SHEARS:
        row = _wrong_sign(1 + stretch, stress, np.ones(len(stretch), dtype=bool))
        if row is not None:
            raise InputError(
                f"{measured.table.place(choice.stress, row)}: at an amount of shear of {stretch[row]:g} the shear "
                f"stress is {unit.written(stress[row])}; it must have the sign of the shear. Turn one of them, "
                "turn='load' (--turn load), or check which columns are read."
            )
        return
    if measured.axial_stretch is not None:
        return  # a tube that was stretched is narrower than undeformed, under pressure, too
    if choice.load == "pressure":
        row = _wrong_sign(stretch, stress, stretch < 1)
        if row is not None:
            raise InputError(
                f"{measured.table.place(choice.deformation, row)}: the tube is under pressure and narrower than "
                f"undeformed (stretch {stretch[row]:g} in the middle of the wall). Give the outer diameter that it has "
                "without pressure (--diameter), or check which columns are read."
            )
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
        _check_signs(clear.table, *axis, bool(options.get("compression_positive")), advice, unit)


def _check_signs(
    table: Table,
    choice: ColumnChoice,
    stretch: Column,
    stress: Column,
    compression_positive: bool,
    advice: str,
    unit: StressUnit,
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
            raise InputError(f"{cell} (compression) the stress is positive ({unit.written(stress[row])}). {advice}")
        alternative = "; if the column of stretches holds strain, give it as strain"
        if choice.measure in ("strain", "displacement"):
            alternative = (
                f"; if this is tension, in which the {choice.measure} falls, give compression_positive=False "
                "(--tension-positive)"
            )
        raise InputError(
            f"{cell} (compression) the stress is positive ({unit.written(stress[row])}). If the machine "
            "counts compression as positive, give compression_positive=True (--compression-positive)"
            f"{alternative}."
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
            f"is negative ({unit.written(stress[row])}); tension must be positive. {advice}"
        )


def _wrong_sign(stretch: Column, stress: Column, rows: BoolArray) -> int | None:
    """Return the row with the most negative work if the rows as a whole, beyond noise, do negative work."""
    change = stretch - 1
    work = np.where(rows, stress * change, 0.0)
    notable = (
        np.abs(change[rows]).max(initial=0.0) >= NOTABLE_SHARE * np.abs(change).max()
        and np.abs(stress[rows]).max(initial=0.0) >= NOTABLE_SHARE * np.abs(stress).max()
    )
    return int(np.argmin(work)) if notable and work.sum() < -0.5 * np.abs(work).sum() else None
