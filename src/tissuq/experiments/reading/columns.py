"""Which columns of a table hold the deformation and the stress or force, and the units that their headings state."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches

from tissuq.errors import InputError
from tissuq.experiments.reading.table import Table
from tissuq.experiments.reading.units import looks_like_unit
from tissuq.experiments.reading.vocabulary import STRESS_NAMES, on_axis, plain, role_names

__all__ = [
    "DEFORMATIONS",
    "LOADS",
    "ColumnChoice",
    "Heading",
    "axes_of",
    "choose_columns",
    "columns_there_are",
    "declared_unit",
    "find_column",
    "heading",
]

DEFORMATIONS = ("stretch", "strain", "displacement", "shear")
LOADS = ("stress", "force")
UNIT_IN_HEADING = (
    re.compile(r"(?P<quantity>.+?)\s*[\[(](?P<unit>[^\])]*)[\])]"),
    re.compile(r"(?P<quantity>.+?)\s*/\s*(?P<unit>.+)"),
    re.compile(r"(?P<quantity>.+?)(?:,\s*|\s+in\s+)(?P<unit>\S+)"),
)
UNIT_AS_SUFFIX = re.compile(r"(?P<quantity>.+)[_\s](?P<unit>\S*[^\W\d_]\S*|%)")


@dataclass(frozen=True)
class Heading:
    """A column name taken apart: ``Stress [kPa]`` is the quantity ``stress`` in the unit ``kPa``."""

    quantity: str
    unit: str = ""


@dataclass(frozen=True)
class ColumnChoice:
    """The columns (counted from 0) of the deformation and of the stress or force, and what they hold.

    Parameters
    ----------
    deformation, stress : int
        The columns.
    measure : str
        What the deformation is: stretch, strain, displacement or (amount of) shear.
    load : str
        What the other column holds: stress or force.
    """

    deformation: int
    stress: int
    measure: str = "stretch"
    load: str = "stress"

    @property
    def is_strain(self) -> bool:
        """Whether the deformation is a strain."""
        return self.measure == "strain"


def heading(name: str) -> Heading:
    """Take a column name apart into its quantity, in lower case, and its unit."""
    name = name.strip()
    parts = next(filter(None, (pattern.fullmatch(name) for pattern in UNIT_IN_HEADING)), None)
    if parts is None:
        parts = UNIT_AS_SUFFIX.fullmatch(name)
        if parts is None or not looks_like_unit(parts["unit"]):
            return Heading(plain(name))
    return Heading(plain(parts["quantity"]), parts["unit"].strip())


def declared_unit(table: Table, column: int) -> str:
    """Return the unit that the heading or the units row states for a column; empty when neither does.

    Raises
    ------
    InputError
        When both state one and they differ.
    """
    in_heading = heading(table.names[column]).unit
    beneath = table.units[column].strip("[]() ")
    if in_heading and beneath and in_heading != beneath and looks_like_unit(in_heading):
        raise InputError(
            f"{table.place(column)}: the name says '{in_heading}' but the row of units beneath it says "
            f"'{beneath}'. Correct the file."
        )
    return beneath or in_heading


def axes_of(table: Table) -> list[str]:
    """Return the axes (x, y) of which the table has columns."""
    return sorted({axis for axis, _ in (on_axis(heading(name).quantity) for name in table.names) if axis})


def choose_columns(
    table: Table,
    mapping: Mapping[str, str | int] | None,
    stress_type: str,
    axis: str | None = None,
    is_shear: bool = False,
) -> ColumnChoice:
    """Return the columns to read: those of the mapping, the others by their names.

    A stress goes before a force, a stretch or strain before a displacement.

    Parameters
    ----------
    table : Table
        The table to choose from.
    mapping : mapping or None
        From a role (stretch, strain, displacement or shear; stress or force) to the name or the number, from 1, of a
        column.
    stress_type : str
        ``engineering`` or ``cauchy``: what a stress column may be called.
    axis : str, optional
        ``x`` or ``y``: whose columns are read from the file of a biaxial machine.
    is_shear : bool
        Whether the deformation is an amount of shear.

    Raises
    ------
    InputError
        When a role or column does not exist, several columns fit, or none does.
    """
    mapping = dict(mapping or {})
    _check_roles(table, mapping, is_shear)
    quantities = _quantities(table, axis, mapping)
    load = next((role for role in LOADS if role in mapping), None)
    if load:
        stress = find_column(table, load, mapping[load])
    else:
        load = "stress" if _fitting(quantities, ["stress"], stress_type) else "force"
        hint = _stress_hint(table, stress_type)
        stress = _recognise(table, quantities, "stress", [load], stress_type, "stress or force", hint)
    measure = next((role for role in DEFORMATIONS if role in mapping), None)
    if measure:
        deformation = find_column(table, measure, mapping[measure])
    else:
        first, second = (("shear",), ()) if is_shear else (("stretch", "strain"), ("displacement",))
        known = first if not second or _fitting(quantities, first) else second
        what = "amount of shear" if is_shear else "stretch, strain or displacement"
        deformation = _recognise(table, quantities, first[0], known, stress_type, what)
        measure = next(role for role in known if quantities[deformation] in role_names(role))
    if deformation == stress:
        raise InputError(
            f"{table.file}: column {table.label(stress)} cannot be both {measure} and {load}; "
            f"give two columns. {columns_there_are(table)}"
        )
    choice = ColumnChoice(deformation, stress, measure, load)
    _check_measures(table, choice, stress_type)
    return choice


def _quantities(table: Table, axis: str | None, mapping: Mapping[str, str | int]) -> list[str]:
    """Return what the columns' names say they hold; of the columns of two axes only those of the one asked for."""
    found = [on_axis(heading(name).quantity) for name in table.names]
    axes = axes_of(table)
    if axis is not None and axis not in axes:
        raise InputError(
            f"{table.file} has no columns of an axis '{axis}'. {columns_there_are(table)} Leave axis (--axis) out."
        )
    if axis is None and len(axes) == 2 and not mapping:
        raise InputError(
            f"{table.file} is of a biaxial test. Say which axis is read: axis='x' (--axis x) or axis='y' (--axis y), "
            "with the loading mode that belongs to it, or read both at once: mode='biaxial' (--mode biaxial)."
        )
    wanted = axis or (axes[0] if len(axes) == 1 else "")
    return [name if each in ("", wanted) else "" for each, name in found]


def _check_roles(table: Table, mapping: Mapping[str, str | int], is_shear: bool) -> None:
    unknown = [role for role in mapping if role not in DEFORMATIONS + LOADS]
    if unknown:
        raise InputError(
            f"{table.file}: a column cannot be given as '{unknown[0]}'. Give stretch, strain or displacement, and "
            'stress or force, as in columns={"strain": "Strain"} or --column strain=Strain.'
        )
    for roles in (DEFORMATIONS, LOADS):
        both = [role for role in roles if role in mapping]
        if len(both) > 1:
            raise InputError(f"{table.file}: columns are given for both {' and '.join(both)}; give only one of them.")
    other = set(DEFORMATIONS) - {"shear"} if is_shear else {"shear"}
    if other & set(mapping):
        deformation = "an amount of shear" if is_shear else "a stretch, strain or displacement"
        raise InputError(
            f"{table.file}: a column is given as {min(other & set(mapping))}, but this loading mode has {deformation}."
        )


def find_column(table: Table, role: str, wanted: str | int) -> int:
    """Return the place of a column, by its name or its number from 1, that is asked for in a role."""
    text = str(wanted).strip()
    readings = (
        table.names,
        [name.lower() for name in table.names],
        [heading(name).quantity for name in table.names],
    )
    for names, key in zip(readings, (text, text.lower(), plain(text)), strict=True):
        found = [column for column, name in enumerate(names) if name and name == key]
        if len(found) > 1:
            raise _ambiguous(table, role, found)
        if found:
            return found[0]
    if text.isdecimal() and 1 <= int(text) <= len(table.names):
        return int(text) - 1
    close = get_close_matches(text.lower(), [name.lower() for name in table.names], n=1)
    suggestion = next((f" Did you mean '{name}'?" for name in table.names if [name.lower()] == close), "")
    raise InputError(
        f"{table.file} has no column '{text}' (asked for as {role}).{suggestion} {columns_there_are(table)}"
    )


def _fitting(quantities: Sequence[str], roles: Sequence[str], stress_type: str = "engineering") -> list[int]:
    names = frozenset().union(*(role_names(role, stress_type) for role in roles))
    return [column for column, quantity in enumerate(quantities) if quantity in names]


def _recognise(
    table: Table,
    quantities: Sequence[str],
    role: str,
    known: Sequence[str],
    stress_type: str,
    what: str,
    hint: str = "",
) -> int:
    """Return the one column whose name says that it has one of the known roles."""
    found = _fitting(quantities, known, stress_type)
    if len(found) > 1:
        raise _ambiguous(table, known[0], found)
    if not found:
        raise InputError(
            f"{table.file}: no column is recognised as {what}.{hint} "
            f"{columns_there_are(table)} {_how_to_say(table, role)}"
        )
    return found[0]


def _stress_hint(table: Table, stress_type: str) -> str:
    for other, known in STRESS_NAMES.items():
        named = [column for column, name in enumerate(table.names) if heading(name).quantity in known]
        if named and other != stress_type:
            return (
                f" Column {table.label(named[0])} is a stress of the {other} kind; "
                f'to read it give stress_type="{other}" (--stress-type {other}).'
            )
    return ""


def _ambiguous(table: Table, role: str, found: Sequence[int]) -> InputError:
    fitting = " and ".join(f"{table.label(column)} (number {column + 1})" for column in found)
    return InputError(f"{table.file}: several columns may be the {role}: {fitting}. {_how_to_say(table, role)}")


def columns_there_are(table: Table) -> str:
    """Return the sentence that lists the columns of a table."""
    if not any(table.names):
        return f"Its {len(table.names)} columns have no names."
    names = ", ".join(f"'{name}'" if name else "(no name)" for name in table.names)
    return f"The columns are: {names}."


def _how_to_say(table: Table, role: str) -> str:
    if not any(table.names):
        return (
            'Say by number which is which: columns={"stretch": 1, "stress": 2} or --column stretch=1 --column stress=2.'
        )
    return f'Say which it is by name or number: columns={{"{role}": "NAME"}} or --column {role}=NAME.'


def _check_measures(table: Table, choice: ColumnChoice, stress_type: str) -> None:
    """Refuse columns whose own names contradict what they are read as."""
    stress_words = set(heading(table.names[choice.stress]).quantity.split())
    if stress_type == "engineering" and stress_words & {"cauchy", "true"}:
        raise InputError(
            f"{table.place(choice.stress)} is named a Cauchy stress but read as an engineering stress. "
            'Give stress_type="cauchy" (--stress-type cauchy), or rename the column.'
        )
    if stress_type == "cauchy" and stress_words & {"engineering", "nominal"}:
        raise InputError(
            f"{table.place(choice.stress)} is named an engineering stress but read as a Cauchy stress. "
            'Leave out stress_type="cauchy" (--stress-type cauchy), or rename the column.'
        )
    strain_words = set(heading(table.names[choice.deformation]).quantity.split())
    if choice.is_strain and strain_words & {"stretch", "lambda", "λ"}:
        raise InputError(
            f"{table.place(choice.deformation)} is named a stretch but read as a strain. Give it as stretch "
            "(--column stretch=NAME), or rename the column."
        )
    other_strains = strain_words & {"true", "log", "logarithmic", "hencky", "green", "almansi"}
    if other_strains:
        raise InputError(
            f"{table.place(choice.deformation)} is not an engineering strain (stretch - 1), the only "
            "strain that is converted. Add a column with the stretch to the file."
        )
