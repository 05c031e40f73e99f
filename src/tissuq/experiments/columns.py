"""Which columns of a table hold the deformation and the stress, and the units that their headings state."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches

from tissuq.errors import InputError
from tissuq.experiments.table import Table
from tissuq.experiments.units import looks_like_unit

__all__ = ["ColumnChoice", "Heading", "choose_columns", "declared_unit", "find_column", "heading"]

STRETCH_NAMES = frozenset(["stretch", "stretch ratio", "lambda", "λ"])
STRAIN_NAMES = frozenset(["strain", "engineering strain", "nominal strain"])
STRESS_NAMES = {
    "engineering": frozenset(["stress", "engineering stress", "nominal stress"]),
    "cauchy": frozenset(["stress", "cauchy stress", "true stress"]),
}
ROLES = ("stretch", "strain", "stress")
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
    """The columns (counted from 0) of the deformation and the stress; the deformation may be a strain."""

    deformation: int
    is_strain: bool
    stress: int


def heading(name: str) -> Heading:
    """Take a column name apart into its quantity, in lower case, and its unit."""
    name = name.strip()
    parts = next(filter(None, (pattern.fullmatch(name) for pattern in UNIT_IN_HEADING)), None)
    if parts is None:
        parts = UNIT_AS_SUFFIX.fullmatch(name)
        if parts is None or not looks_like_unit(parts["unit"]):
            return Heading(_plain(name))
    return Heading(_plain(parts["quantity"]), parts["unit"].strip())


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


def choose_columns(table: Table, mapping: Mapping[str, str | int] | None, stress_type: str) -> ColumnChoice:
    """Return the columns to read: those of the mapping, the others by their names.

    Parameters
    ----------
    table : Table
        The table to choose from.
    mapping : mapping or None
        From a role (stretch or strain, stress) to the name or the number, from 1, of a column.
    stress_type : str
        ``engineering`` or ``cauchy``: what a stress column may be called.

    Raises
    ------
    InputError
        When a role or column does not exist, several columns fit, or none does.
    """
    mapping = dict(mapping or {})
    _check_roles(table, mapping)
    if "stress" in mapping:
        stress = find_column(table, "stress", mapping["stress"])
    else:
        stress = _recognise(table, "stress", STRESS_NAMES[stress_type], _stress_hint(table, stress_type))
    role = next((role for role in ("stretch", "strain") if role in mapping), None)
    if role:
        deformation = find_column(table, role, mapping[role])
        is_strain = role == "strain"
    else:
        deformation = _recognise(table, "stretch", STRETCH_NAMES | STRAIN_NAMES)
        is_strain = heading(table.names[deformation]).quantity in STRAIN_NAMES
    if deformation == stress:
        raise InputError(
            f"{table.file}: column {table.label(stress)} cannot be both {role or 'stretch'} and stress; "
            f"give two columns. {_columns_there_are(table)}"
        )
    _check_measures(table, ColumnChoice(deformation, is_strain, stress), stress_type)
    return ColumnChoice(deformation, is_strain, stress)


def _plain(name: str) -> str:
    return re.sub(r"[\s_-]+", " ", name).strip().lower()


def _check_roles(table: Table, mapping: Mapping[str, str | int]) -> None:
    unknown = [role for role in mapping if role not in ROLES]
    if unknown:
        raise InputError(
            f"{table.file}: a column cannot be given as '{unknown[0]}'. Give stretch or strain, and stress, "
            'as in columns={"strain": "Strain"} or --column strain=Strain.'
        )
    if "stretch" in mapping and "strain" in mapping:
        raise InputError(f"{table.file}: columns are given for both stretch and strain; give only one of them.")


def find_column(table: Table, role: str, wanted: str | int) -> int:
    """Return the place of a column, by its name or its number from 1, that is asked for in a role."""
    text = str(wanted).strip()
    readings = (
        table.names,
        [name.lower() for name in table.names],
        [heading(name).quantity for name in table.names],
    )
    for names, key in zip(readings, (text, text.lower(), _plain(text)), strict=True):
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
        f"{table.file} has no column '{text}' (asked for as {role}).{suggestion} {_columns_there_are(table)}"
    )


def _recognise(table: Table, role: str, known: frozenset[str], hint: str = "") -> int:
    found = [column for column, name in enumerate(table.names) if heading(name).quantity in known]
    if len(found) > 1:
        raise _ambiguous(table, role, found)
    if not found:
        what = "stretch or strain" if role == "stretch" else role
        raise InputError(
            f"{table.file}: no column is recognised as {what}.{hint} "
            f"{_columns_there_are(table)} {_how_to_say(table, role)}"
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


def _columns_there_are(table: Table) -> str:
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
