"""Tables whose stresses are in a unit of stress, which stands at their head."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from tissuq.experiments.units import StressUnit, stress_unit

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["headed", "in_unit"]


def in_unit(table: pd.DataFrame, columns: Sequence[str], unit: str) -> pd.DataFrame:
    """Return a table whose columns in MPa are in another unit of stress, which stands at the head of the columns.

    Raises
    ------
    InputError
        When it is no unit of stress.

    Examples
    --------
    >>> import pandas as pd
    >>> print(in_unit(pd.DataFrame({"stretch": [1.1], "low": [0.002]}), ["low"], "kPa"))
    stresses in kPa  stretch  low
    0                    1.1  2.0
    """
    shown = stress_unit(unit)
    return headed(table.assign(**{name: table[name] / shown.to_mpa for name in columns}), shown)


def headed(table: pd.DataFrame, unit: StressUnit) -> pd.DataFrame:
    """Return a table with the unit of its stresses at the head of its columns, as their name."""
    return table.rename_axis(columns=f"stresses in {unit.name}")
