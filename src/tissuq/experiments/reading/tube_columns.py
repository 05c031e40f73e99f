"""Which columns hold the pressure in a tube and its diameter, and which loading mode they are read in."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments.modes import LoadingMode, Planar
from tissuq.experiments.reading.headings import role_names
from tissuq.experiments.reading.table import Table
from tissuq.experiments.reading.vocabulary import ROLES_OF_TUBE
from tissuq.experiments.units import measured_in

__all__ = ["DIAMETERS", "PRESSURE", "with_columns_of_tube"]

*DIAMETERS, PRESSURE = ROLES_OF_TUBE
HOW = (
    'If it was held at its undeformed length, give --mode planar --diameter "3 mm" --thickness "0.5 mm": its '
    "undeformed outer diameter and the thickness of its wall. If it was stretched along its axis, too, convert "
    "pressure and force with ThinTube.engineering_stresses in Python, and give these stresses with --mode thin-tube."
)
"""How a tube is read."""
AXIAL_STRETCH = re.compile(r"(axial|longitudinal|z) (stretch( ratio)?|lambda|λ)|(stretch|lambda|λ) ?z")
SAME_LENGTH = 0.01
"""Axial stretch, less one, up to which a tube counts as held at its undeformed length."""


def with_columns_of_tube(
    table: Table, mode: LoadingMode, mapping: Mapping[str, str | int], quantities: Sequence[str]
) -> dict[str, str | int]:
    """Return the roles of columns with those of a tube, its pressure and a diameter, where the table is of one.

    Parameters
    ----------
    table : Table
    mode : LoadingMode
    mapping : mapping
        The roles that are given.
    quantities : sequence of str
        What the columns' names say they hold.

    Raises
    ------
    InputError
        When one of both columns is missing, or the loading mode is none of a tube.
    """
    tube_roles, other_roles = (
        [role for role in mapping if (role in ROLES_OF_TUBE) is is_given] for is_given in (True, False)
    )
    if not tube_roles and (other_roles or len(mode.stresses) > 1):
        return dict(mapping)
    by_role = {role: columns for role in ROLES_OF_TUBE if (columns := list(_columns(table, quantities, role)))}
    has_both = PRESSURE in by_role and not by_role.keys().isdisjoint(DIAMETERS)
    if not tube_roles and (not has_both or not role_names("stress").isdisjoint(quantities)):
        return dict(mapping)
    if other_roles:
        raise InputError(
            f"{table.file}: columns are given as {tube_roles[0]} and as {other_roles[0]}, which do not go together: of "
            "a tube give a pressure and a diameter (--column pressure=NAME --column outer_diameter=NAME)."
        )
    diameter = next((role for roles in (mapping, by_role) for role in DIAMETERS if role in roles), DIAMETERS[0])
    for role in (PRESSURE, diameter):
        columns = by_role.get(role, [])
        if role not in mapping and len(columns) != 1:
            labels = " and ".join(map(table.label, columns))
            fault = f"columns {labels} may each be" if labels else "no column is recognised as"
            raise InputError(
                f"{table.file}: {fault} the {role.replace('_', ' ')} of a tube. Say which it is: --column {role}=NAME."
            )
    if not isinstance(mode, Planar):
        names = " and ".join(table.label(by_role[role][0]) for role in (PRESSURE, diameter) if role in by_role)
        advice = "" if tube_roles else " To read other columns, say which: --column stretch=NAME --column force=NAME."
        raise InputError(f"{table.file} is of a tube under pressure ({names}). {HOW}{advice}")
    _check_length(table)
    return {role: mapping.get(role, by_role.get(role, [0])[0] + 1) for role in (PRESSURE, diameter)}


def _columns(table: Table, quantities: Sequence[str], role: str) -> Iterator[int]:
    """Yield the columns that change and whose names have a role, or whose unit is one of pressures alone."""
    names = role_names(role)
    is_named = any(quantity in names for quantity in quantities)
    for column, quantity in enumerate(quantities):
        is_one = quantity in names if is_named or role != PRESSURE else measured_in(table.unit(column)) == PRESSURE
        if is_one and not table.is_constant(column):
            yield column


def _check_length(table: Table) -> None:
    """Refuse a tube whose axial stretch the table says, and that is not one."""
    for column, quantity in enumerate(table.quantities):
        if not AXIAL_STRETCH.fullmatch(quantity):
            continue
        (stretch,) = table.numbers([column])
        row = int(np.argmax(np.abs(stretch - 1)))
        if abs(stretch[row] - 1) > SAME_LENGTH:
            raise InputError(
                f"{table.place(column, row)}: the axial stretch is {stretch[row]:g}, and in loading mode 'planar' a "
                f"tube keeps its undeformed length. {HOW}"
            )
