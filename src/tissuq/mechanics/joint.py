"""Several tests as one: the rows of all their measurements, whatever the mode of each."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import InputError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import Deformation, LoadingMode, Path
from tissuq.mechanics.path import STEP

__all__ = ["ABSCISSA", "CURVE", "JointExperiment", "Rows", "joined", "rows_along"]

FloatArray = NDArray[np.float64]

CURVE, ABSCISSA, STRETCHES, RATES, PLANE, PLANE_RATES = 0, 1, slice(2, 5), slice(5, 8), slice(8, 11), slice(11, 14)
"""Columns of a row: its curve, what that is drawn against, and the deformation and its rate along the stress."""


class Rows(LoadingMode):
    """The path of measurements of many kinds: a point is a row, which holds its deformation and the rate of it."""

    @property
    def name(self) -> str:  # type: ignore[override]  # no name of the class, so that nobody can choose it
        """What it is in a few words."""
        return "several tests"

    def principal_stretches(self, stretch: Any) -> tuple[Any, Any, Any]:
        return self.moved(stretch, 0.0).stretches

    def moved(self, point: Any, step: Any) -> Deformation:
        columns = [point[..., place] for place in range(PLANE_RATES.stop)]
        stretches, plane = (
            tuple(at + step * rate for at, rate in zip(columns[values], columns[rates], strict=True))
            for values, rates in ((STRETCHES, RATES), (PLANE, PLANE_RATES))
        )
        return Deformation(stretches, plane)

    def abscissa(self, points: Any) -> Any:
        return points[..., ABSCISSA]


def rows_along(path: Path, points: FloatArray, curve: int) -> FloatArray:
    """Return the rows (n, 14) of points on a path, measured in a curve of that number (-1: in none)."""
    moved = path.moved(points, 1j * STEP)
    found = np.empty((len(points), PLANE_RATES.stop))
    found[:, CURVE], found[:, ABSCISSA] = curve, path.abscissa(points)
    for parts, values, rates in ((moved.stretches, STRETCHES, RATES), (moved.plane, PLANE, PLANE_RATES)):
        known = [np.nan if each is None else each for each in parts]
        columns = np.stack([np.broadcast_to(each, len(points)).astype(complex) for each in known], axis=1)
        found[:, values], found[:, rates] = columns.real, columns.imag / STEP / path.loaded_axes
    return found


class JointExperiment(Experiment):
    """Several tests, or one with several stresses, as one experiment along one path: that of their rows.

    Attributes
    ----------
    parts : tuple of Experiment
    stretch : (n, 14) array
        The rows of all measurements, test by test and stress by stress.
    stress : (n,) array, MPa
        Theirs.
    """

    _parts: tuple[Experiment, ...]

    def __init__(self, parts: Sequence[Experiment]) -> None:
        paths = [(path, part) for part in parts for path in part.mode.channels]
        rows = [rows_along(path, part.stretch, curve) for curve, (path, part) in enumerate(paths)]
        values = {
            "_parts": tuple(parts),
            "specimen": "",
            "mode": Rows(),
            "stretch": np.concatenate(rows),
            "stress": np.concatenate([part.stress.T.ravel() for part in parts]),
            "name": " + ".join(part.name for part in parts),
            "source": "; ".join(part.source for part in parts if part.source),
            "stress_unit": parts[0].stress_unit,
        }
        for field, value in values.items():
            object.__setattr__(self, field, value)

    @property
    def parts(self) -> tuple[Experiment, ...]:
        """The tests."""
        return self._parts

    def along(self, mode: LoadingMode, points: FloatArray, channel: int = 0) -> tuple[Path, FloatArray]:
        """Return the path of rows and those of points of a mode, as measured in the first test of that mode."""
        own = [curve for curve, (part, number, _) in enumerate(self.curves) if (part.mode, number) == (mode, channel)]
        return self.mode, rows_along(mode.channels[channel], points, own[0] if own else -1)

    def __len__(self) -> int:
        return len(self.stress)

    def joined(self, other: Experiment) -> Experiment:
        """Refuse: further measurements of one test are no test of their own."""
        raise InputError(
            f"experiment '{other.name}' cannot be added to a fit of several tests or stresses: fit all together again."
        )


def joined(tests: Experiment | Sequence[Experiment]) -> Experiment:
    """Return tests as what a model is fitted to: one with one stress as it is, all else joined.

    Raises
    ------
    InputError
        When there is none, or the same measurements are there twice.
    """
    if isinstance(tests, JointExperiment):
        return tests
    parts = (tests,) if isinstance(tests, Experiment) else tuple(tests)
    if not parts:
        raise InputError("there is no experiment to fit.")
    for number, part in enumerate(parts):
        if not isinstance(part, Experiment):
            raise InputError(f"experiment number {number + 1} is no tissuq.Experiment, but {part!r:.80}.")
    for place, other in combinations(range(len(parts)), 2):
        one, two = parts[place], parts[other]
        if one.mode == two.mode and np.array_equal(one.stretch, two.stretch) and np.array_equal(one.stress, two.stress):
            raise InputError(
                f"experiments number {place + 1} ('{one.name}') and {other + 1} ('{two.name}') hold the same "
                "measurements, which would count twice: leave one of them out."
            )
    if len(parts) == 1 and parts[0].stress.ndim == 1 and parts[0].stretch.ndim == 1:
        return parts[0]
    return JointExperiment(parts)
