"""What was measured: stretches and engineering stresses of one specimen in one loading mode."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tissuq.errors import InputError
from tissuq.experiments.modes import LoadingMode, Path, loading_mode

__all__ = ["Experiment", "checked_points"]


@dataclass(frozen=True, eq=False)
class Experiment:
    """Measurements of one test: what it set, such as stretches, and the stresses.

    Parameters
    ----------
    mode : str or LoadingMode
        How the specimen was loaded.
    stretch : (n,) or (n, c) array, dimensionless
        What the mode controls: deformed over undeformed length, positive, or an amount of shear of either sign; a
        column for each control where there are several. Any order, repetitions allowed.
    stress : (n,) or (n, k) array, MPa
        Engineering (nominal) stress, tension positive and compression negative; a column for each stress of the mode
        where there are several.
    name : str
        A short name for tables and figures.
    source : str
        Where the values come from (a file and its columns, or a citation).
    stress_unit : str
        The unit in which people want to read the stresses; the values here are MPa whatever it is.
    specimen : str
        Which specimen it was, where several tests are fitted together: those of one specimen share its errors of area
        and length. Without a name every test counts as one of a specimen of its own.

    Raises
    ------
    InputError
        When the arrays differ in length, do not have the columns of the mode, are empty, or hold values that are not
        finite or not stretches.

    Examples
    --------
    >>> import tissuq as tq
    >>> data = tq.Experiment(mode="uniaxial", stretch=[0.9, 1.0, 1.2], stress=[-0.3, 0.0, 0.5])
    >>> len(data)
    3
    >>> both = tq.Experiment("biaxial", stretch=[[1.1, 1.0], [1.2, 1.1]], stress=[[0.3, 0.2], [0.5, 0.4]])
    >>> len(both), both.mode.stresses
    (2, ('engineering stress of axis 1', 'engineering stress of axis 2'))
    """

    mode: LoadingMode
    stretch: NDArray[np.float64]
    stress: NDArray[np.float64]
    name: str = "experiment"
    source: str = ""
    stress_unit: str = "MPa"
    specimen: str = ""

    def __init__(
        self,
        mode: str | LoadingMode,
        stretch: ArrayLike,
        stress: ArrayLike,
        name: str = "experiment",
        source: str = "",
        stress_unit: str = "MPa",
        specimen: str = "",
    ) -> None:
        mode = loading_mode(mode)
        values = {
            "mode": mode,
            "stretch": checked_points(mode, stretch),
            "stress": _checked("stress", stress, mode.stresses),
            "name": name,
            "source": source,
            "stress_unit": stress_unit,
            "specimen": specimen,
        }
        for field, value in values.items():
            object.__setattr__(self, field, value)
        if len(self.stretch) != len(self.stress):
            raise InputError(
                f"experiment '{name}': {len(self.stretch)} stretches but {len(self.stress)} stresses; "
                "give one stress for every stretch."
            )

    def __len__(self) -> int:
        return len(self.stretch)

    @property
    def parts(self) -> tuple[Experiment, ...]:
        """The tests that it is made of: itself."""
        return (self,)

    @property
    def modes(self) -> tuple[LoadingMode, ...]:
        """The different modes of its tests."""
        return tuple(dict.fromkeys(part.mode for part in self.parts))

    @property
    def curves(self) -> list[tuple[Experiment, int, NDArray[np.float64]]]:
        """Every measured stress (n,) of its tests: the test, the number of the stress in its mode, and the values."""
        return [
            (part, number, stress)
            for part in self.parts
            for number, stress in enumerate(part.stress.reshape(len(part.stress), -1).T)
        ]

    def along(
        self, mode: LoadingMode, points: NDArray[np.float64], channel: int = 0
    ) -> tuple[Path, NDArray[np.float64]]:
        """Return a path and its points that stand for points of a mode: what models of this experiment speak of.

        ``channel`` is the number of the stress, where the mode has several.
        """
        return mode.channels[channel], points

    def joined(self, other: Experiment) -> Experiment:
        """Return this experiment with the measurements of another one in the same loading mode added.

        Raises
        ------
        InputError
            When the loading modes differ.
        """
        if other.mode != self.mode:
            raise InputError(
                f"experiment '{other.name}' is {other.mode.name} and experiment '{self.name}' {self.mode.name}: only "
                "measurements in the same loading mode can be added."
            )
        stretch, stress = (
            np.concatenate(pair) for pair in ((self.stretch, other.stretch), (self.stress, other.stress))
        )
        return Experiment(self.mode, stretch, stress, self.name, self.source, self.stress_unit, self.specimen)


def checked_points(mode: LoadingMode, points: ArrayLike) -> NDArray[np.float64]:
    """Return points of a mode as an array (n,), or (n, c) where the mode has c controls.

    Raises
    ------
    InputError
        When it is not of this shape, or holds what is no value of a control.
    """
    found = _checked("stretch", points, [control.name for control in mode.controls])
    for control, column in zip(mode.controls, found.reshape(len(found), -1).T, strict=True):
        low = np.flatnonzero(column <= control.above)
        if len(low):
            raise InputError(
                f"{control.name} {column[low[0]]:g} at position {low[0]} is not positive. "
                "A stretch is deformed over undeformed length; if this is a strain, add 1."
            )
    return found


def _checked(name: str, values: Any, columns: Sequence[str]) -> NDArray[np.float64]:
    """Return an array of finite numbers, (n,) or with several columns (n, k), that cannot be changed."""
    try:
        found = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} must be an array of numbers: {error}.") from error
    count = len(columns)
    if found.ndim != min(count, 2) or not found.size or found.shape[1:] != (count,)[: found.ndim - 1]:
        form = f"an array with {count} columns ({', '.join(columns)})" if count > 1 else "a one-dimensional array"
        raise InputError(f"{name} must be {form} with values, not of shape {found.shape}.")
    for column, own in zip(columns, found.reshape(len(found), -1).T, strict=True):
        bad = np.flatnonzero(~np.isfinite(own))
        if len(bad):
            raise InputError(f"{column} is {own[bad[0]]} at position {bad[0]}; every value must be a finite number.")
    found.flags.writeable = False
    return found
