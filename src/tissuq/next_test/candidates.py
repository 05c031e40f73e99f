"""What a next test may be: candidates to measure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from tissuq.arrays import FloatArray
from tissuq.errors import InputError
from tissuq.experiments.checked_arrays import check_no_percent, checked_points
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import LoadingMode, loading_mode, loading_modes
from tissuq.mechanics import Material
from tissuq.mechanics.invariants import MeasuredStates, farthest_stretch, invariants, largest_invariants

MIN_POINTS, MAX_POINTS = 10, 40
"""Smallest and largest number of measurements of a default candidate, which otherwise has as many as the data."""
EXTENDED_REACH = 1.5
"""Largest I1 - 3 and I2 - 3 of the extended default candidates, over those of the data."""
REPEATS = {1: "the same test again", 3: "three more of the same test"}
"""Numbers of repetitions of a test of the data, with which other tests are compared, in words."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A test that could be made.

    Parameters
    ----------
    mode : str or LoadingMode
        Loading mode with one control; it may measure several stresses.
    stretch : (n,) array, dimensionless
        Stretches to be set, or amounts of shear; as an attribute each as often as there are tests.
    name : str
        Mode, range and number of points unless another is given.
    is_repeat : bool
        Whether it is one of the tests of the data again.
    tests : int
        How many tests are made at these stretches; those on other specimens are each on one of its own.

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
    tests: int

    def __init__(
        self, mode: str | LoadingMode, stretch: ArrayLike, name: str = "", is_repeat: bool = False, tests: int = 1
    ) -> None:
        mode = loading_mode(mode)
        if len(mode.controls) > 1:
            raise InputError(
                f"mode '{mode.name}' sets {len(mode.controls)} controls; a test to come has one: choose another mode."
            )
        points = checked_points(mode, stretch)
        default_name = _name(mode, float(points.min()), float(points.max()), len(points))
        for field, value in (
            ("mode", mode),
            ("stretch", np.repeat(points, tests)),
            ("name", name or default_name),
            ("is_repeat", is_repeat),
            ("tests", tests),
        ):
            object.__setattr__(self, field, value)


def candidate_named(text: str) -> Candidate:
    """Return the test of a text such as ``planar 0.8:1.5 20``: a mode, the range of stretches, how many of them.

    Raises
    ------
    InputError, ModelError
        When it is no such text, or there is no such mode.
    """
    mode, *range_and_count = text.split() or [""]
    try:
        (ends, number), count = range_and_count, 0
        low, high = map(float, ends.split(":"))
        count = int(number)
    except ValueError:
        low, high, count = 0.0, 0.0, 0
    if count < 1 or not -np.inf < low < high < np.inf:
        raise InputError(
            f"'{text}' does not describe a test; write MODE LOW:HIGH POINTS, as in 'planar 1:1.5 20' (stretches, or "
            "amounts of shear)."
        )
    check_no_percent(text, low, "1:1.5")
    return Candidate(mode, np.linspace(low, high, count) if count > 1 else [high])


def default_candidates(
    data: Experiment, material: Material, *, is_energy: bool, points: tuple[int, ...] = ()
) -> Iterator[Candidate]:
    """Yield the tests that are ranked by default, the repetitions of those of the data first.

    Every mode with one control and one stress, in tension, compression and both, as far as I1 - 3 and I2 - 3 were
    measured, and half as far again in these.

    Parameters
    ----------
    data : Experiment
    material : Material
        Material, which must deform as the mode prescribes.
    is_energy : bool
        Whether the discrepancy holds in other modes than those of the data.
    points : tuple of int
        Numbers of measurements; one like that of the data unless given.
    """
    yield from _repeats(data)
    counts = points or (int(np.clip(len(data.tests[0]), MIN_POINTS, MAX_POINTS)),)
    for mode in (kind() for kind in loading_modes().values()):
        is_known = is_energy or mode in data.modes
        if len(mode.controls) == len(mode.stresses) == 1 and is_known and not _why_not(material, mode):
            for low, high in _ranges(data, mode):
                for count in counts:
                    yield Candidate(mode, _even_points(mode, low, high, count), _name(mode, low, high, count))


def reach_of(data: Experiment, mode: LoadingMode, points: FloatArray) -> FloatArray:
    """Return the larger (g,) of I1 - 3 and I2 - 3 at points of a mode, each over the largest that was measured."""
    pairs = zip(invariants(mode.paths[0].at(points)), largest_invariants(data.states), strict=True)
    return np.asarray(np.max([values / largest for values, largest in pairs], axis=0))


def _name(mode: LoadingMode, low: float, high: float, count: int) -> str:
    return f"{mode.name} {low:.4g} to {high:.4g}, {count} point{'s' * (count > 1)}"


def farthest_range(data: Experiment, mode: LoadingMode, factor: float) -> tuple[float, float]:
    """Return the range of a mode's control in which I1 - 3 and I2 - 3 are at most so many times what was measured."""
    states, reference = MeasuredStates.of(data.states).times(factor), float(mode.reference)
    low, high = (_rounded(farthest_stretch(mode, states, sign), reference) for sign in (-1, 1))
    return low, high


def _repeats(data: Experiment) -> Iterator[Candidate]:
    tests = [test for test in data.tests if len(test.mode.controls) == 1]
    for test in tests:
        for times, words in REPEATS.items():
            suffix = f" ({test.name})" if len(tests) > 1 else ""
            name = f"{words}{suffix}, {times * len(test)} points"
            yield Candidate(test.mode, test.stretch, name, is_repeat=True, tests=times)


def _ranges(data: Experiment, mode: LoadingMode) -> Iterator[tuple[float, float]]:
    """Yield ranges of a mode's control; of shear on one side only, as the other one is the same."""
    reference = float(mode.reference)
    for factor in (1.0, EXTENDED_REACH):
        low, high = farthest_range(data, mode, factor)
        yield reference, high
        if reference:
            yield low, reference
            yield low, high


def _rounded(end: float, reference: float) -> float:
    """Return the end of a range with few digits, no farther from rest."""
    step = 10.0 ** (np.floor(np.log10(abs(end - reference))) - 2)
    return float(
        np.round(reference + np.sign(end - reference) * np.floor(abs(end - reference) / step + 1e-6) * step, 10)
    )


def _even_points(mode: LoadingMode, low: float, high: float, count: int) -> FloatArray:
    """Return evenly spread points of a range, without the reference, which carries no information."""
    reference = float(mode.reference)
    if low == reference:
        return np.linspace(low, high, count + 1)[1:]
    return np.linspace(low, high, count + 1)[:-1] if high == reference else np.linspace(low, high, count)


def _why_not(material: Material, mode: LoadingMode) -> str:
    return material.why_not(mode.path.moved(mode.excursion([0.01]), 0.0))
