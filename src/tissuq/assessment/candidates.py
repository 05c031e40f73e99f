"""Tests that could be made next: of a loading mode, at some stretches."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tissuq.errors import InputError
from tissuq.experiments.experiment import Experiment, checked_points
from tissuq.experiments.modes import LoadingMode, loading_mode, loading_modes
from tissuq.mechanics import Material
from tissuq.mechanics.path import farthest_stretch, invariants

__all__ = ["BEYOND", "Candidate", "candidate_named", "farthest_range", "reach_of", "usual_candidates"]

FloatArray = NDArray[np.float64]

FEWEST, MOST = 10, 40
"""Measurements of a usual candidate: as many as the data have, within these."""
BEYOND = 1.5
"""How much farther than the data some of the usual candidates go, in I1 - 3 and I2 - 3."""
REPEATS = {1: "the same test again", 3: "three more of the same test"}
"""How often a test is repeated, to compare others with."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A test that could be made.

    Parameters
    ----------
    mode : str or LoadingMode
        With one control; it may measure several stresses.
    stretch : (n,) array, dimensionless
        What is set: stretches, or amounts of shear.
    name : str
        Mode, range and number of points unless another is given.
    is_repeat : bool
        Whether it is one of the tests of the data again.

    Raises
    ------
    InputError
        When the mode has several controls, or the stretches cannot be set.

    Examples
    --------
    >>> import tissuq as tq
    >>> tq.Candidate("planar", [1.1, 1.2, 1.3]).name
    'planar 1.1 to 1.3, 3 points'
    """

    mode: LoadingMode
    stretch: FloatArray
    name: str
    is_repeat: bool

    def __init__(self, mode: str | LoadingMode, stretch: ArrayLike, name: str = "", is_repeat: bool = False) -> None:
        mode = loading_mode(mode)
        if len(mode.controls) > 1:
            raise InputError(
                f"mode '{mode.name}' sets {len(mode.controls)} controls; a test to come has one: choose another mode."
            )
        points = checked_points(mode, stretch)
        usual = _name(mode, float(points.min()), float(points.max()), len(points))
        for field, value in (("mode", mode), ("stretch", points), ("name", name or usual), ("is_repeat", is_repeat)):
            object.__setattr__(self, field, value)


def candidate_named(text: str) -> Candidate:
    """Return the test of a text such as ``planar 0.8:1.5 20``: a mode, the range of stretches, how many of them.

    Raises
    ------
    InputError, ModelError
        When it is no such text, or there is no such mode.
    """
    mode, *rest = text.split() or [""]
    try:
        (ends, number), count = rest, 0
        low, high = map(float, ends.split(":"))
        count = int(number)
    except ValueError:
        low, high, count = 0.0, 0.0, 0
    if count < 1 or not -np.inf < low < high < np.inf:
        raise InputError(
            f"'{text}' is no test; write MODE LOW:HIGH POINTS, as in 'planar 1:1.5 20' (stretches, or amounts of "
            "shear)."
        )
    return Candidate(mode, np.linspace(low, high, count) if count > 1 else [high])


def usual_candidates(
    data: Experiment, material: Material, *, is_energy: bool, points: tuple[int, ...] = ()
) -> Iterator[Candidate]:
    """Yield the tests that are ranked unless others are asked for, those of the data again first.

    Every mode with one control and one stress, in tension, compression and both, as far as I1 - 3 and I2 - 3 were
    measured, and half as far again in these.

    Parameters
    ----------
    data : Experiment
    material : Material
        Which must deform as the mode says.
    is_energy : bool
        Whether the discrepancy holds in other modes than those of the data.
    points : tuple of int
        Numbers of measurements; one like that of the data unless given.
    """
    yield from _repeats(data)
    counts = points or (int(np.clip(len(data.parts[0]), FEWEST, MOST)),)
    for mode in (kind() for kind in loading_modes().values()):
        is_known = is_energy or mode in data.modes
        if len(mode.controls) == len(mode.stresses) == 1 and is_known and not _why_not(material, mode):
            for low, high in _ranges(data, mode):
                for count in counts:
                    yield Candidate(mode, _spread(mode, low, high, count), _name(mode, low, high, count))


def reach_of(data: Experiment, mode: LoadingMode, points: FloatArray) -> FloatArray:
    """Return the larger (g,) of I1 - 3 and I2 - 3 at points of a mode, each over the largest that was measured."""
    most = [each.max() for each in invariants(data.mode, data.stretch)]
    reached = [invariants(path, points) for path in mode.channels]
    return np.asarray(np.max([own / end for each in reached for own, end in zip(each, most, strict=True)], axis=0))


def _name(mode: LoadingMode, low: float, high: float, count: int) -> str:
    return f"{mode.name} {low:.4g} to {high:.4g}, {count} point{'s' * (count > 1)}"


def farthest_range(data: Experiment, mode: LoadingMode, factor: float) -> tuple[float, float]:
    """Return the range of a mode's control in which I1 - 3 and I2 - 3 are at most so many times what was measured."""
    most, rest = [factor * float(each.max()) for each in invariants(data.mode, data.stretch)], float(mode.reference)
    low, high = (_rounded(farthest_stretch(mode, most, sign), rest) for sign in (-1, 1))
    return low, high


def _repeats(data: Experiment) -> Iterator[Candidate]:
    parts = [part for part in data.parts if len(part.mode.controls) == 1]
    for part in parts:
        for times, words in REPEATS.items():
            which = f" ({part.name})" if len(parts) > 1 else ""
            name = f"{words}{which}, {times * len(part)} points"
            yield Candidate(part.mode, np.tile(part.stretch, times), name, is_repeat=True)


def _ranges(data: Experiment, mode: LoadingMode) -> Iterator[tuple[float, float]]:
    """Yield ranges of a mode's control; of shear on one side only, as the other one is the same."""
    rest = float(mode.reference)
    for factor in (1.0, BEYOND):
        low, high = farthest_range(data, mode, factor)
        yield rest, high
        if rest:
            yield low, rest
            yield low, high


def _rounded(end: float, rest: float) -> float:
    """Return the end of a range with few digits, no farther from rest."""
    step = 10.0 ** (np.floor(np.log10(abs(end - rest))) - 2)
    return float(np.round(rest + np.sign(end - rest) * np.floor(abs(end - rest) / step + 1e-6) * step, 10))


def _spread(mode: LoadingMode, low: float, high: float, count: int) -> FloatArray:
    """Return evenly spread points of a range; where it ends at rest, which tells nothing, without that."""
    rest = float(mode.reference)
    if low == rest:
        return np.linspace(low, high, count + 1)[1:]
    return np.linspace(low, high, count + 1)[:-1] if high == rest else np.linspace(low, high, count)


def _why_not(material: Material, mode: LoadingMode) -> str:
    return material.why_not(mode.moved(mode.excursion([0.01]), 0.0))
