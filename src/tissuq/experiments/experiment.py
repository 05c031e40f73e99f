"""What was measured: stretches and engineering stresses of one specimen in one loading mode."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tissuq.errors import InputError
from tissuq.experiments.modes import LoadingMode, loading_mode

__all__ = ["Experiment"]


@dataclass(frozen=True, eq=False)
class Experiment:
    """Stress-stretch measurements of one test.

    Parameters
    ----------
    mode : str or LoadingMode
        How the specimen was loaded.
    stretch : (n,) array, dimensionless
        Deformed over undeformed length, positive; any order, repetitions allowed.
    stress : (n,) array, MPa
        Engineering (nominal) stress, tension positive and compression negative.
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
        When the arrays differ in length, are empty, or hold values that are not finite or not stretches.

    Examples
    --------
    >>> import tissuq as tq
    >>> data = tq.Experiment(mode="uniaxial", stretch=[0.9, 1.0, 1.2], stress=[-0.3, 0.0, 0.5])
    >>> len(data)
    3
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
        values = {
            "mode": loading_mode(mode),
            "stretch": _column("stretch", stretch),
            "stress": _column("stress", stress),
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
        not_positive = np.flatnonzero(self.stretch <= 0)
        if len(not_positive):
            row = not_positive[0]
            raise InputError(
                f"experiment '{name}': stretch {self.stretch[row]:g} at position {row} is not positive. "
                "A stretch is deformed over undeformed length; if this is a strain, add 1."
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

    def along(self, mode: LoadingMode, points: NDArray[np.float64]) -> tuple[LoadingMode, NDArray[np.float64]]:
        """Return a path and its points that stand for points of a mode: what models of this experiment speak of."""
        return mode, points

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


def _column(name: str, values: Any) -> NDArray[np.float64]:
    try:
        column = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} must be an array of numbers: {error}.") from error
    if column.ndim != 1 or not len(column):
        raise InputError(f"{name} must be a one-dimensional array with values, not of shape {column.shape}.")
    bad = np.flatnonzero(~np.isfinite(column))
    if len(bad):
        raise InputError(f"{name} is {column[bad[0]]} at position {bad[0]}; every value must be a finite number.")
    column.flags.writeable = False
    return column
