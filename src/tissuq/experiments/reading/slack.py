"""Preload and slack: from where on a specimen is taut, and stretches counted from there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments.reading.quantities import FORCE, MASSES, number_and_unit
from tissuq.experiments.reading.table_rows import Curve
from tissuq.experiments.reading.units import stress_unit

__all__ = ["preload_stress", "taut"]


def preload_stress(preload: str, area: float | None) -> float:
    """Return a preload, a force or a stress with its unit, as a stress in MPa; forces need the area (mm²).

    Raises
    ------
    InputError
        When it is no positive number with a unit of force or stress, or a force where the area is not known.

    Examples
    --------
    >>> preload_stress("0.05 N", area=10.0), preload_stress("2 kPa", area=None)
    (0.005, 0.002)
    """
    number, unit = number_and_unit(str(preload))
    if number is None or number <= 0 or not unit:
        raise InputError(
            f"preload must be a positive force or stress with its unit, such as '0.05 N', not '{preload}'."
        )
    if FORCE.known(unit) is None and unit not in MASSES:
        return number * stress_unit(unit).to_mpa
    if area is None:
        raise InputError(f"preload '{preload}' is a force, but the file gives stresses; give it as a stress.")
    return number * FORCE.factor(unit) / area


def taut(curve: Curve, preload: str, threshold: float, peak: int) -> Curve:
    """Return the rows in which the specimen carries the preload, with stretches counted from where it first does.

    That is where the absolute stress last rises through the threshold (MPa) on the way to the row ``peak``,
    interpolated between the rows on either side: there stretch 1 is, and the gauge length with it. Stresses stay as
    they are.

    Raises
    ------
    InputError
        When no row carries the preload.
    """
    size = np.abs(curve.stress)
    loaded = size >= threshold
    if not loaded[: peak + 1].any():
        largest = size[: peak + 1].max()
        raise InputError(
            f"{curve.table.file}: the preload {preload} is not reached: the largest stress is {largest:g} MPa, and "
            f"the preload is {threshold:g} MPa. Give a lower one, and check the units of force and area."
        )
    below = np.flatnonzero(~loaded[: peak + 1])
    below = below[below < np.flatnonzero(loaded[: peak + 1])[-1]]
    first = int(below[-1]) + 1 if len(below) else 0
    if first:
        share = (threshold - size[first - 1]) / (size[first] - size[first - 1])
        reference = curve.stretch[first - 1] + share * (curve.stretch[first] - curve.stretch[first - 1])
        where = f"between lines {curve.table.lines[first - 1]} and {curve.table.lines[first]}"
    else:
        reference = curve.stretch[0]
        where = f"in line {curve.table.lines[0]}, the first, where the stress is already {size[0]:g} MPa"
    if reference <= 0:
        raise InputError(
            f"{curve.table.file}: where the preload {preload} is reached ({where}), the stretch is {reference:g}, not "
            "positive. Check the length of the specimen and the column of displacements."
        )
    kept = curve.kept(np.flatnonzero(loaded & (np.arange(len(curve)) >= first)), f"carrying less than {preload}")
    sentence = f"stretch counted from {reference:.6g}, where the preload {preload} is reached {where}"
    return replace(kept, stretch=kept.stretch / reference).told(sentence)
