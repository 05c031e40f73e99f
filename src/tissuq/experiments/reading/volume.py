"""Whether a specimen kept its volume, where a column beside its stretch says how it grew thinner or thicker."""

from __future__ import annotations

import re

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments.reading.measured_rows import MeasuredRows
from tissuq.experiments.reading.table import Column, Table

__all__ = ["poisson_ratio", "readable_shares", "volume_step"]

LATERAL = re.compile(r"transvers|\blateral|\bradial|\bquer|попереч|横向")
STRETCH = re.compile(r"stretch|lambda|λ|streckung")
STRAIN = re.compile(r"strain|dehnung|kontraktion|epsilon|ε|déformation|деформац|应变|ひずみ")
LEAST_RATIO = 0.45
"""Poisson's ratio below which a material is not taken as incompressible: its shear modulus is off by 3 % or more."""
LEAST_STRAIN = 0.02
"""Largest logarithmic strain that a specimen needs, for a ratio to be told."""
STANDARD_ERRORS, INDEPENDENT_ROWS = 2.0, 10
"""How clearly the ratio is less, taking the rows of a smooth curve for so many measurements."""


def volume_step(measured: MeasuredRows, *, is_taken: bool = False) -> str:
    """Return Poisson's ratio of a uniaxial test with lateral strains, as a step; an empty text without them.

    Raises
    ------
    InputError
        When they are clearly those of a material whose volume changes, which no law here describes, unless that
        ``is_taken`` as it is.
    """
    table = measured.table
    along = np.log(measured.stretch[0])
    columns = (_lateral(table, number, along) for number in range(len(table.names)))
    number, lateral = next(filter(None, columns), (0, np.zeros(1)))
    if np.abs(along).max() < LEAST_STRAIN or lateral.min() <= 0:
        return ""
    ratio, error = poisson_ratio(along, np.log(lateral))
    said = f"Poisson's ratio {ratio:.2f} ± {error:.2f}"
    if ratio + STANDARD_ERRORS * error >= LEAST_RATIO:
        return f"{said} by column {table.label(number)}"
    if is_taken:
        return f"taken as incompressible, though {said} by column {table.label(number)}"
    end = int(np.argmax(np.abs(along)))
    change = np.exp(along[end] * (1 - 2 * ratio)) - 1
    raise InputError(
        f"{table.place(number)}: the specimen does not keep its volume ({said}; at stretch "
        f"{np.exp(along[end]):.3g} it changes by {100 * change:+.0f} %), while every material here is incompressible: "
        "its modulus would be wrong. Foams and lung need a compressible law in another tool. To fit it as one of "
        "constant volume all the same, give --incompressible."
    )


def poisson_ratio(along: Column, across: Column) -> tuple[float, float]:
    """Return the ratio of logarithmic strains (n,) by least squares, and its standard error.

    Examples
    --------
    >>> import numpy as np
    >>> strain = np.linspace(0, 0.2, 21)
    >>> [round(number, 6) for number in poisson_ratio(strain, -0.3 * strain)]
    [0.3, 0.0]
    """
    squares = float(along @ along)
    slope = float(along @ across) / squares
    scatter = float(((across - slope * along) ** 2).sum()) / max(len(along) - 1, 1)
    rows = min(len(along), INDEPENDENT_ROWS)
    return -slope, float(np.sqrt(scatter / squares * len(along) / rows))


def readable_shares(table: Table, number: int) -> Column | None:
    """Return a column (n,) of stretches or strains, of which percentages are shares; None where a cell is faulty."""
    try:
        (values,) = table.numbers([number])
    except InputError:
        return None
    return values / (100 if table.unit(number) == "%" else 1)


def _lateral(table: Table, number: int, along: Column) -> tuple[int, Column] | None:
    """Return a column with the lateral stretches (n,) that it holds, if it is one; those with faulty cells are not.

    A contraction may be written as positive.
    """
    quantity, unit = table.quantities[number], table.unit(number)
    is_stretch, is_strain = bool(STRETCH.search(quantity)), bool(STRAIN.search(quantity))
    if not LATERAL.search(quantity) or not (is_stretch or is_strain) or unit not in ("", "1", "-", "%", "mm/mm"):
        return None
    values = readable_shares(table, number)
    if values is None:
        return None
    return number, values if is_stretch else 1 - np.sign(values @ along) * values
