"""The columns of a tube under pressure: its pressure, a diameter, the axial force, and what tells the axial stretch."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from tissuq.errors import InputError
from tissuq.experiments.modes import InflatedTube, LoadingMode, Planar, ThinTube
from tissuq.experiments.reading.axial_stretch import (
    HOW_TO_READ_TUBE,
    HOW_TO_SAY_AXIAL_STRETCH,
    column_of_axial_stretch,
    stated_axial_stretch,
)
from tissuq.experiments.reading.column_checks import with_types
from tissuq.experiments.reading.headings import STRESS_NOUNS
from tissuq.experiments.reading.options import ReadingOptions
from tissuq.experiments.reading.recognition import (
    DIAMETERS,
    PRESSURE,
    TOTAL_FORCE,
    ColumnChoice,
    Contents,
    find_column,
)
from tissuq.experiments.reading.table import Table
from tissuq.experiments.reading.vocabulary import (
    ROLE_OF_AXIAL_STRETCH,
    ROLES,
    other_quantity,
)
from tissuq.experiments.units import FORCE, measured_in

FORCES = ("force", TOTAL_FORCE)
"""Roles of an axial force: without what the pressure on the closed ends pulls with, and with it."""
ROLES_BESIDE = ("length", ROLE_OF_AXIAL_STRETCH)
"""Either is of what tells the axial stretch."""


def mode_of_tube(table: Table, options: ReadingOptions) -> tuple[str, str]:
    """Return the loading mode of a tube whose pressure, diameter and force or axial stretch are there, and why.

    Empty texts of other tables, and of one of pressure and diameter alone, which may have been stretched first.
    """
    columns = options.get("columns") or {}
    quantities = Contents.of(table, options).quantities
    has_stress = any(quantity in ROLES["stress"] | STRESS_NOUNS for quantity in quantities)
    if not {PRESSURE, *DIAMETERS, *FORCES, *ROLES_BESIDE}.issuperset(columns) or has_stress:
        return "", ""
    if PRESSURE not in columns and not [*_of_role(table, quantities, PRESSURE, may_be_held=True)]:
        return "", ""
    has_force = bool(columns.keys() & {*FORCES} or _forces(table, quantities))
    has_column, is_stated = column_of_axial_stretch(table, options) is not None, stated_axial_stretch(table, options)
    may_be_held = has_force and bool(has_column or is_stated)
    found = {role: [*_of_role(table, quantities, role, may_be_held=may_be_held)] for role in (PRESSURE, *DIAMETERS)}
    there = {role for role, columns_of_role in found.items() if role in columns or columns_of_role}
    if PRESSURE not in there or len(there) < 2:
        return "", ""
    if has_force:
        return ThinTube.name, "columns of pressure, diameter and force"
    if has_column:
        return InflatedTube.name, "columns of pressure, diameter and axial stretch"
    return (InflatedTube.name, is_stated.source) if is_stated else ("", "")


def columns_of_tube(table: Table, mode: LoadingMode, options: ReadingOptions) -> dict[str, ColumnChoice]:
    """Return the columns of both stresses of a tube, by what these are called; nothing where it is read as a sheet is.

    They are pressure and diameter, and the axial force with what tells the axial stretch. Where that is given for all
    rows, the diameter stands for its column.

    Raises
    ------
    InputError
        When a column is missing, or several may be it.
    """
    columns, contents = options.get("columns") or {}, Contents.of(table, options)
    if not {PRESSURE, *DIAMETERS, *FORCES, *ROLES_BESIDE}.issuperset(columns):
        return {}
    given = {role: name for role, name in columns.items() if role in (PRESSURE, *DIAMETERS)}
    of_tube = with_columns_of_tube(table, mode, given, contents.quantities)
    if not of_tube:
        return {}
    measure = next(role for role in DIAMETERS if role in of_tube)
    diameter, pressure = (find_column(table, role, of_tube[role]) for role in (measure, PRESSURE))
    load, force, is_named = _force(table, columns, contents.quantities)
    if force in (diameter, pressure):
        raise InputError(f"{table.file}: column {table.label(force)} cannot be the axial force of a tube, too.")
    axial = column_of_axial_stretch(table, options)
    if axial is None and stated_axial_stretch(table, options) is None:
        raise InputError(
            f"{table.file}: beside pressure and diameter column {table.label(force)} is the axial force of a tube, and "
            f"nothing says its axial stretch, {HOW_TO_SAY_AXIAL_STRETCH} To read the pressure alone of a tube that was "
            "held at its undeformed length, give --mode planar."
        )
    choices = (
        ColumnChoice(diameter, pressure, measure, PRESSURE),
        ColumnChoice(
            diameter if axial is None else axial,
            force,
            ROLE_OF_AXIAL_STRETCH,
            load,
            by_unit=frozenset() if is_named else frozenset({force}),
        ),
    )
    return dict(zip(mode.stresses, (with_types(table, choice, contents) for choice in choices), strict=True))


def _force(table: Table, columns: Mapping[str, str | int], quantities: Sequence[str]) -> tuple[str, int, bool]:
    """Return the role and the column of the axial force, and whether it is given or known by its name."""
    given = [role for role in FORCES if role in columns]
    if len(given) > 1:
        raise InputError(
            f"{table.file}: columns are given for both {' and '.join(given)}; give only one of them: force is what the "
            "machine pulls with in addition to the pressure on the closed ends, total_force has that in it."
        )
    if given:
        return given[0], find_column(table, given[0], columns[given[0]]), True
    found = _forces(table, quantities)
    if len(found) != 1:
        raise InputError(
            f"{table.file}: {_unclear(table, [*found])} the axial force of a tube. Say which it is: --column "
            "force=NAME, or --column total_force=NAME where the pressure on the closed ends is in it; without a force "
            "give --mode inflated-tube."
        )
    ((column, role),) = found.items()
    return role, column, any(quantities[column] in ROLES[force] for force in FORCES)


def _forces(table: Table, quantities: Sequence[str]) -> dict[int, str]:
    """Return the columns that may be the axial force of a tube with their roles: by their names, else units."""
    changing = [column for column in range(len(quantities)) if not table.is_constant(column)]
    for role in FORCES:
        if found := {column: role for column in changing if quantities[column] in ROLES[role]}:
            return found
    return {
        column: "force"
        for column in changing
        if FORCE.factor_or_none(table.unit(column)) and not other_quantity(quantities[column], table.unit(column))
    }


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
    roles_of_tube = (*DIAMETERS, PRESSURE)
    tube_roles, other_roles = (
        [role for role in mapping if (role in roles_of_tube) is is_given] for is_given in (True, False)
    )
    if not tube_roles and (other_roles or (len(mode.stresses) > 1 and not isinstance(mode, ThinTube))):
        return dict(mapping)
    may_be_held = isinstance(mode, ThinTube)
    found = {role: [*_of_role(table, quantities, role, may_be_held=may_be_held)] for role in roles_of_tube}
    by_role = {role: columns for role, columns in found.items() if columns}
    has_both = PRESSURE in by_role and not by_role.keys().isdisjoint(DIAMETERS)
    if not tube_roles and (not has_both or not ROLES["stress"].isdisjoint(quantities)):
        return dict(mapping)
    if other_roles:
        raise InputError(
            f"{table.file}: columns are given as {tube_roles[0]} and as {other_roles[0]}, which do not go together: of "
            "a tube give a pressure and a diameter (--column pressure=NAME --column outer_diameter=NAME), and with "
            "--mode thin-tube an axial force (--column force=NAME)."
        )
    diameter = next((role for roles in (mapping, by_role) for role in DIAMETERS if role in roles), DIAMETERS[0])
    for role in (PRESSURE, diameter):
        columns = by_role.get(role, [])
        if role not in mapping and len(columns) != 1:
            raise InputError(
                f"{table.file}: {_unclear(table, columns)} the {role.replace('_', ' ')} of a tube. Say which it is: "
                f"--column {role}=NAME."
            )
    if not isinstance(mode, Planar | InflatedTube | ThinTube):
        names = " and ".join(table.label(by_role[role][0]) for role in (PRESSURE, diameter) if role in by_role)
        advice = "" if tube_roles else " To read other columns, say which: --column stretch=NAME --column force=NAME."
        raise InputError(f"{table.file} is of a tube under pressure ({names}). {HOW_TO_READ_TUBE}{advice}")
    return {role: mapping.get(role, by_role.get(role, [0])[0] + 1) for role in (PRESSURE, diameter)}


def _unclear(table: Table, columns: Sequence[int]) -> str:
    """Return how a sentence begins that no column, or several, may be something."""
    labels = " and ".join(map(table.label, columns))
    return f"columns {labels} may each be" if labels else "no column is recognised as"


def _of_role(table: Table, quantities: Sequence[str], role: str, *, may_be_held: bool) -> Iterator[int]:
    """Yield the columns that change and whose names have a role, or whose unit is one of pressures alone.

    A pressure may be held while the tube is stretched.
    """
    names = ROLES[role]
    named = [column for column, quantity in enumerate(quantities) if quantity in names]
    by_unit = [column for column in range(len(quantities)) if measured_in(table.unit(column)) == PRESSURE]
    columns = named or (by_unit if role == PRESSURE else [])
    changing = [column for column in columns if not table.is_constant(column)]
    yield from changing or (named if role == PRESSURE and may_be_held else [])
