"""Which columns of a table hold the deformation and the stress or force of every measured stress, by name or role."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from difflib import get_close_matches

from tissuq.errors import InputError
from tissuq.experiments.modes import LoadingMode
from tissuq.experiments.modes.mode import SHEAR
from tissuq.experiments.reading.headings import (
    CYCLE_NAMES,
    DIMENSION_NAMES,
    STRESS_NAMES,
    heading,
    on_axis,
    plain,
    role_names,
)
from tissuq.experiments.reading.table import Table
from tissuq.experiments.units import measured_in

__all__ = ["DEFORMATIONS", "LOADS", "ColumnChoice", "about_stress", "choose_columns", "find_column"]

LENGTHENINGS = ("stretch", "strain", "displacement", "length")
DEFORMATIONS = (*LENGTHENINGS, "shear")
LOADS = ("stress", "force")
DEFORMATIONS_OF_UNITS = {"strain": "strain", "length": "displacement"}
"""What a column is that alone has such a unit."""
NOT_ENGINEERING = re.compile(r"^(sigma|σ)(?!.*(eng|nom))|true|cauchy|piola|kirchhoff")
"""Names of a stress that is, or may be, over another area than the undeformed one."""
NEITHER_LOAD_NOR_DEFORMATION = re.compile(r"modul|time|zeit|temp|energy|rate|index|^(no|nr|n|point|punkt)\.?$")
"""Names of columns that are no rivals, whatever their unit."""


@dataclass(frozen=True)
class ColumnChoice:
    """The columns (counted from 0) of the deformation and of the stress or force, and what they hold.

    Parameters
    ----------
    deformation, stress : int
        The columns.
    measure : str
        What the deformation is: stretch, strain, displacement, (current) length or (amount of) shear.
    load : str
        What the other column holds: stress or force.
    """

    deformation: int
    stress: int
    measure: str = "stretch"
    load: str = "stress"


def choose_columns(
    table: Table, mode: LoadingMode, mapping: Mapping[str, str | int] | None, stress_type: str, axis: str | None
) -> dict[str, ColumnChoice]:
    """Return the columns of every stress of a mode, by what it is called; of a mode with one by an empty text.

    They are those of the mapping, the others are known by their names: a stress goes before a force, a stretch or
    strain before a displacement. Those of a second stress are known by the axis in their names, or given in roles that
    end in 2.

    Parameters
    ----------
    table : Table
        The table to choose from.
    mode : LoadingMode
    mapping : mapping or None
        From a role (stretch, strain, displacement, length or shear; stress or force) to the name of a column, or its
        number from 1.
    stress_type : str
        ``engineering`` or ``cauchy``: what a stress column may be called.
    axis : str or None
        ``x`` or ``y``: whose columns are read from the file of a biaxial machine in a mode with one stress.

    Raises
    ------
    InputError
        When a role or column does not exist, several columns fit, or none does.
    """
    count, is_shear = len(mode.stresses), mode.controls == (SHEAR,)
    if count > 1 and axis is not None:
        raise InputError(f"loading mode '{mode.name}' reads both axes; leave axis (--axis) out, or give another mode.")
    mappings = _mapping_of_each_stress(mode, mapping)
    is_of_axes = bool(mode.machine_axes) and _axes_of(table) == list(mode.machine_axes)
    if not is_of_axes and not all(_has_roles(mode, roles) for roles in mappings[1:]):
        raise _roles_missing(table, mode)
    axes = mode.machine_axes if is_of_axes else (axis,) * count
    labels = [f"axis {name}" for name in axes] if is_of_axes else list(mode.stresses) if count > 1 else [""]
    choices: list[ColumnChoice] = []
    for number, (roles, axis_of_stress) in enumerate(zip(mappings, axes, strict=True)):
        if number and len(mode.controls) == 1:
            roles = roles | {choices[0].measure: choices[0].deformation + 1}
        with about_stress(number, labels, mode):
            choices.append(_choice(table, roles, stress_type, axis_of_stress, is_shear))
    if count > 1:
        _check_together(table, mode, choices)
    return dict(zip(labels, choices, strict=True))


@contextmanager
def about_stress(number: int, labels: Sequence[str], mode: LoadingMode) -> Iterator[None]:
    """Add to what is wrong with a stress after the first how its columns and dimensions are given."""
    try:
        yield
    except InputError as error:
        if not number:
            raise
        sizes = " Along it the specimen measures --width, and across it --length." if mode.machine_axes else ""
        raise InputError(
            f"{error} (This is about {labels[number]}: roles of its columns end in 2, as in "
            f"--column stress2=NAME.{sizes})"
        ) from error


def find_column(table: Table, role: str, wanted: str | int) -> int:
    """Return the column (counted from 0) that is asked for in a role by its name, or its number from 1."""
    text = str(wanted).strip()
    readings = (
        table.names,
        [name.lower() for name in table.names],
        [heading(name).quantity for name in table.names],
    )
    for names, key in zip(readings, (text, text.lower(), plain(text)), strict=True):
        columns = [column for column, name in enumerate(names) if name and name == key]
        if len(columns) > 1:
            raise _ambiguous(table, role, columns)
        if columns:
            return columns[0]
    if text.isdecimal() and 1 <= int(text) <= len(table.names):
        return int(text) - 1
    close = get_close_matches(text.lower(), [name.lower() for name in table.names], n=1)
    suggestion = next((f" Did you mean '{name}'?" for name in table.names if [name.lower()] == close), "")
    raise InputError(
        f"{table.file} has no column '{text}' (asked for as {role}).{suggestion} {_columns_there_are(table)}"
    )


def _axes_of(table: Table) -> list[str]:
    """Return the axes (x, y) of which the table has columns."""
    return sorted({axis for axis, _ in (on_axis(heading(name).quantity) for name in table.names) if axis})


def _mapping_of_each_stress(mode: LoadingMode, mapping: Mapping[str, str | int] | None) -> list[dict[str, str | int]]:
    """Return the roles of every stress: those of the second end in 2; with one control it has only a stress."""
    mappings = [dict(mapping or {})]
    roles = (*DEFORMATIONS, *LOADS) if len(mode.controls) > 1 else ("stress",)
    for number in range(2, len(mode.stresses) + 1):
        numbered = [role for role in roles if f"{role}{number}" in mappings[0]]
        mappings.append({role: mappings[0].pop(f"{role}{number}") for role in numbered})
    return mappings


def _has_roles(mode: LoadingMode, mapping: Mapping[str, str | int]) -> bool:
    """Return whether a mapping holds a stress or force, and a deformation where each stress has one of its own."""
    return bool(mapping.keys() & LOADS and (len(mode.controls) == 1 or mapping.keys() & DEFORMATIONS))


def _choice(
    table: Table, mapping: Mapping[str, str | int], stress_type: str, axis: str | None, is_shear: bool
) -> ColumnChoice:
    """Return the columns of one stress."""
    _check_roles(table, mapping, is_shear)
    quantities = _quantities(table, axis, mapping)
    load = next((role for role in LOADS if role in mapping), None)
    if load:
        stress = find_column(table, load, mapping[load])
    else:
        load = next((role for role in LOADS if _fitting(quantities, [role], stress_type)), "")
        by_unit = None if load else _told_by_unit(table, quantities, LOADS)
        load, stress = by_unit or (load, _recognise(table, quantities, [load or "force"], stress_type, LOADS))
    measure = next((role for role in DEFORMATIONS if role in mapping), None)
    if measure:
        deformation = find_column(table, measure, mapping[measure])
    else:
        measures = ["shear"] if is_shear else ["stretch", "strain"]
        roles = ("shear",) if is_shear else LENGTHENINGS
        if not is_shear and not _fitting(quantities, measures):
            measures = ["displacement"] if _fitting(quantities, ["displacement"]) else ["length"]
        is_named = is_shear or bool(_fitting(quantities, measures))
        by_unit = None if is_named else _told_by_unit(table, quantities, tuple(DEFORMATIONS_OF_UNITS), stress)
        if by_unit:
            measure, deformation = DEFORMATIONS_OF_UNITS[by_unit[0]], by_unit[1]
        else:
            deformation = _recognise(table, quantities, measures, stress_type, roles)
            measure = next(name for name in measures if quantities[deformation] in role_names(name))
    if deformation == stress:
        raise InputError(
            f"{table.file}: column {table.label(stress)} cannot be both {measure} and {load}; "
            f"give two columns. {_columns_there_are(table)}"
        )
    choice = ColumnChoice(deformation, stress, measure, load)
    _check_measures(table, choice, stress_type)
    return choice


def _quantities(table: Table, axis: str | None, mapping: Mapping[str, str | int]) -> list[str]:
    """Return what the columns' names say they hold; of the columns of two axes only those of the one asked for."""
    names = [on_axis(heading(name).quantity) for name in table.names]
    axes = _axes_of(table)
    if axis is not None and axis not in axes:
        raise InputError(
            f"{table.file} has no columns of an axis '{axis}'. {_columns_there_are(table)} Leave axis (--axis) out."
        )
    if axis is None and len(axes) == 2 and not mapping:
        raise InputError(
            f"{table.file} is of a biaxial test. Say which axis is read: axis='x' (--axis x) or axis='y' (--axis y), "
            "with the loading mode that belongs to it, or read both at once: mode='biaxial' (--mode biaxial). If "
            "numbers in the names are of two specimens, write S1 and S2 there."
        )
    wanted = axis or (axes[0] if len(axes) == 1 else "")
    return [name if axis_of_name in ("", wanted) else "" for axis_of_name, name in names]


def _check_roles(table: Table, mapping: Mapping[str, str | int], is_shear: bool) -> None:
    unknown = [role for role in mapping if role not in DEFORMATIONS + LOADS]
    if unknown:
        raise InputError(
            f"{table.file}: a column cannot be given as '{unknown[0]}'. Give stretch, strain, displacement or length, "
            'and stress or force, as in columns={"strain": "Strain"} or --column strain=Strain.'
        )
    for roles in (DEFORMATIONS, LOADS):
        chosen_roles = [role for role in roles if role in mapping]
        if len(chosen_roles) > 1:
            raise InputError(
                f"{table.file}: columns are given for both {' and '.join(chosen_roles)}; give only one of them."
            )
    unfit = (set(DEFORMATIONS) - {"shear"} if is_shear else {"shear"}) & set(mapping)
    if unfit:
        deformation = "an amount of shear" if is_shear else "a stretch, strain, displacement or length"
        raise InputError(f"{table.file}: a column is given as {min(unfit)}, but this loading mode has {deformation}.")


def _fitting(quantities: Sequence[str], roles: Sequence[str], stress_type: str = "engineering") -> list[int]:
    names = frozenset().union(*(role_names(role, stress_type) for role in roles))
    return [column for column, quantity in enumerate(quantities) if quantity in names]


def _told_by_unit(
    table: Table, quantities: Sequence[str], kinds: Sequence[str], load: int | None = None
) -> tuple[str, int] | None:
    """Return the first kind of unit (stress, force, length, strain) that one column alone has, and that column.

    None where columns are left that could be meant as well: of a deformation, all that are neither of a load nor of
    time nor of a known dimension of the specimen. A stress that may be of another kind (sigma, true stress) is not
    taken, and nothing that is called shear.
    """
    columns_of: dict[str, list[int]] = {}
    for column, quantity in enumerate(quantities):
        in_heading, beneath = table.stated_units(column)
        kind = measured_in(beneath or in_heading)
        is_rival = column != load and bool(quantity) and kind != "time" and not _is_of_something_else(quantity)
        if is_rival and not table.is_constant(column):
            columns_of.setdefault(kind, []).append(column)
    rivals = [column for kind, columns in columns_of.items() if kind not in LOADS for column in columns]
    for kind in kinds:
        columns = columns_of.get(kind, [])
        if len(columns) == 1 and (load is None or rivals == columns):
            name = quantities[columns[0]]
            is_open = kind == "stress" and NOT_ENGINEERING.search(name)
            return None if is_open or name in role_names("shear") else (kind, columns[0])
    return None


def _is_of_something_else(quantity: str) -> bool:
    """Tell whether a name is of a dimension of the specimen, a count, a time or a modulus."""
    return any(quantity in names for names in (*DIMENSION_NAMES.values(), CYCLE_NAMES)) or bool(
        NEITHER_LOAD_NOR_DEFORMATION.search(quantity)
    )


def _recognise(
    table: Table,
    quantities: Sequence[str],
    candidates: Sequence[str],
    stress_type: str,
    roles: Sequence[str],
) -> int:
    """Return the one column whose name says that it has one of the candidate roles, of those that it may have."""
    columns = _fitting(quantities, candidates, stress_type)
    if len(columns) > 1:
        raise _ambiguous(table, candidates, columns)
    if not columns:
        hint = _stress_hint(table, stress_type) if "stress" in roles else _shear_hint(table, quantities, roles)
        what = " or ".join(filter(None, (", ".join(roles[:-1]), roles[-1])))
        raise InputError(
            f"{table.file}: no column is recognised as {what}.{hint} "
            f"{_columns_there_are(table)} {_how_to_say(table, roles)}"
        )
    return columns[0]


def _stress_hint(table: Table, stress_type: str) -> str:
    for kind, names in STRESS_NAMES.items():
        columns = [column for column, name in enumerate(table.names) if heading(name).quantity in names]
        if columns and kind != stress_type:
            return (
                f" Column {table.label(columns[0])} is a stress of the {kind} kind; "
                f'to read it give stress_type="{kind}" (--stress-type {kind}).'
            )
    return ""


def _shear_hint(table: Table, quantities: Sequence[str], roles: Sequence[str]) -> str:
    columns = [] if "shear" in roles else _fitting(quantities, ["shear"])
    if not columns:
        return ""
    return f" Column {table.label(columns[0])} is an amount of shear; if it is simple shear, give --mode simple-shear."


def _ambiguous(table: Table, roles: Sequence[str], columns: Sequence[int]) -> InputError:
    fitting = " and ".join(f"{table.label(column)} (number {column + 1})" for column in columns)
    return InputError(
        f"{table.file}: several columns may be the {roles[0]}: {fitting}. {_how_to_say(table, roles[:1])}"
    )


def _columns_there_are(table: Table) -> str:
    """Return the sentence that lists the columns of a table."""
    if not any(table.names):
        return f"Its {len(table.names)} columns have no names."
    names = ", ".join(f"'{name}'" if name else "(no name)" for name in table.names)
    return f"The columns are: {names}."


def _how_to_say(table: Table, roles: Sequence[str]) -> str:
    if not any(table.names):
        return (
            'Say by number which is which: columns={"stretch": 1, "stress": 2} or --column stretch=1 --column stress=2.'
        )
    others = f" (or {', '.join(f'{role}=' for role in roles[1:])})" if len(roles) > 1 else ""
    return f'Say which it is by name or number: columns={{"{roles[0]}": "NAME"}} or --column {roles[0]}=NAME{others}.'


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
    if choice.measure == "strain" and strain_words & {"stretch", "lambda", "λ"}:
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


def _roles_missing(table: Table, mode: LoadingMode) -> InputError:
    roles = ("stretch", "stress", "stretch2", "stress2") if len(mode.controls) > 1 else ("stress", "stress2")
    named = ", or name them 'stretch x', 'stress x', 'stretch y', 'stress y'" if mode.machine_axes else ""
    return InputError(
        f"{table.file}: loading mode '{mode.name}' has {' and '.join(mode.stresses)}, and the file's columns do not "
        f"tell both. {_columns_there_are(table)} Say which they are: "
        f"{' '.join(f'--column {role}=NAME' for role in roles)} (in Python columns=){named}."
    )


def _check_together(table: Table, mode: LoadingMode, choices: Sequence[ColumnChoice]) -> None:
    """Refuse one column for two stresses, and forces and displacements where the mode does not say what they do."""
    columns = [[choice.stress for choice in choices]]
    columns += [[choice.deformation for choice in choices]] * (len(mode.controls) > 1)
    for column, *later in columns:
        if column in later:
            raise InputError(
                f"{table.file}: column {table.label(column)} cannot be that of both {' and '.join(mode.stresses)}. Say "
                "which is the second one's: --column stretch2=NAME, --column stress2=NAME."
            )
    if mode.machine_axes:
        return
    for choice in choices:
        for column, content in ((choice.deformation, choice.measure), (choice.stress, choice.load)):
            if content in ("displacement", "length", "force"):
                raise InputError(
                    f"{table.place(column)} holds a {content}, and in loading mode '{mode.name}' columns are read as "
                    "stretch, strain or shear, and as stress. Convert it, and give its column as one of them."
                )
