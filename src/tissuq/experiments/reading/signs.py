"""Signs of deformation and load: whatever the file counts as positive, lengthening and tension are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments.reading.measured_rows import MeasuredRows
from tissuq.experiments.reading.options import TURNS
from tissuq.experiments.reading.recognition import SHEARS, ColumnChoice
from tissuq.experiments.reading.strain_measures import STRAIN_MEASURES
from tissuq.experiments.reading.table import Column

__all__ = ["with_signs"]

SIGNED = ("strain", "displacement", *SHEARS)
"""Deformations that may be counted the other way round."""
COMPRESSION_WORDS = ("compressive", "compression", "stauchung", "druck", "сжима")
"""How names of columns begin whose numbers may be positive in compression."""
NEGLIGIBLE_STRAIN = 0.1
"""Share of the largest strain up to which strains of the other sign are noise or slack."""


def with_signs(
    measured: MeasuredRows,
    choices: Sequence[ColumnChoice],
    compression_positive: bool | None,
    turn: str | None,
    direction: str,
) -> MeasuredRows:
    """Return the rows with lengthening and tension positive: some signs of the file turned.

    Parameters
    ----------
    measured : MeasuredRows
    choices : sequence of ColumnChoice
    compression_positive : bool or None
        Whether the file counts compression as positive; then the rows tell what is turned.
    turn : str or None
        What is turned, by a name in `TURNS`, whatever the rows tell.
    direction : str
        That of the load as names say it: compression, tension or an empty text.

    Raises
    ------
    InputError
        When what is asked for has no meaning for the columns, or would change nothing, or a name says compression and
        nobody says its sign.
    """
    if turn is not None:
        return _turned(measured, choices, TURNS[turn], "as asked")
    if choices[0].measure in SHEARS or choices[0].load == "pressure":
        if compression_positive:
            what = "pressure" if choices[0].load == "pressure" else "shear stress"
            raise InputError(f"compression_positive=True (--compression-positive) has no meaning for a {what}.")
        return measured
    if compression_positive is None:
        _check_names(measured, choices, direction)
        return measured
    if not compression_positive:
        falls = choices[0].measure in ("strain", "displacement") and _falls_in_tension(measured)
        return _turned(measured, choices, ("deformation",), "tension is positive") if falls else measured
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


def _falls_in_tension(measured: MeasuredRows) -> bool:
    """Tell whether strains are negative where the load is positive all along."""
    strain = measured.stretch - 1
    is_turned = float((measured.stress * strain).sum()) < 0 and strain.max() < -NEGLIGIBLE_STRAIN * strain.min()
    return bool(is_turned and measured.stress.sum() > 0)


def _turned(measured: MeasuredRows, choices: Sequence[ColumnChoice], what: Sequence[str], why: str) -> MeasuredRows:
    """Return rows with the other sign of deformations, loads or both, and a step that says so."""
    if unfit := next((choice for choice in choices if choice.measure not in SIGNED and "deformation" in what), None):
        raise InputError(
            f"{measured.table.place(unfit.deformation)} is read as {unfit.measure.replace('_', ' ')}, which has no "
            "other sign: turn the load alone (--turn load), or leave turn (--turn) out."
        )
    names = {"deformation": choices[0].measure, "load": choices[0].load}
    if "deformation" in what:
        turned = map(_of_other_sign, measured.stretch, choices)
        measured = replace(measured, stretch=np.stack(list(turned)))
    if "load" in what:
        measured = replace(measured, stress=-measured.stress)
    signs = "signs" if len(what) > 1 else "sign"
    return measured.with_step(f"{signs} of {' and '.join(names[name] for name in what)} changed: {why}")


def _of_other_sign(stretch: Column, choice: ColumnChoice) -> Column:
    """Return the stretches whose strains, or amounts of shear, have the other sign, in the measure of the file."""
    if choice.measure in SHEARS:
        return -stretch
    measure = STRAIN_MEASURES[choice.strain_type]
    return stretch if measure.strain is None else measure.converted(-measure.strain(stretch), is_shear=False)[0]


def _check_names(measured: MeasuredRows, choices: Sequence[ColumnChoice], direction: str) -> None:
    """Refuse positive numbers in columns whose names say compression, and of a test whose name does."""
    for choice, stretch, stress in zip(choices, measured.stretch, measured.stress, strict=True):
        furthest = int(np.argmax(np.abs(stretch - 1)))
        for column, value in ((choice.deformation, stretch[furthest] - 1), (choice.stress, stress[furthest])):
            if measured.table.quantities[column].startswith(COMPRESSION_WORDS) and value > 0:
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
    is_all_negative = strain.max() < -NEGLIGIBLE_STRAIN * strain.min() and float((strain * stress).sum()) > 0
    if direction == "tension" and is_of_sign and is_all_negative:
        raise InputError(
            f"{measured.table.file}: a name says that this is tension, and {choice.measure} and {choice.load} are "
            "negative. If the machine counts tension as negative, give turn='both' (--turn both); if it is "
            "compression, compression_positive=False (--tension-positive)."
        )
