"""Which column of a table has a role, by its name or its unit, and what to say where none has it, or several may."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Self

from tissuq.errors import InputError
from tissuq.experiments.reading.headings import COMPONENTS, STRESS_NOUNS, contents_of, dimensions_named, plain
from tissuq.experiments.reading.measures import STRAIN_MEASURES, STRESS_MEASURES
from tissuq.experiments.reading.options import ReadingOptions
from tissuq.experiments.reading.table import Table
from tissuq.experiments.reading.vocabulary import CYCLE_NAMES, ROLES, ROLES_OF_TUBE, other_quantity
from tissuq.experiments.units import measured_in

LENGTHENINGS = ("stretch", "strain", "displacement", "length")
SHEARS = ("shear", "twist", "rate", "sliding")
*DIAMETERS, PRESSURE, TOTAL_FORCE = ROLES_OF_TUBE
DEFORMATIONS = (*LENGTHENINGS, *SHEARS, *DIAMETERS)
LOADS = ("stress", "torque", "force", PRESSURE)
DEFORMATIONS_OF_UNITS = {"strain": "strain", "length": "displacement", "angle": "twist", "pixels": "length"}
"""What a column is that alone has such a unit."""
OTHER_MEASURE = (
    r"true|cauchy|piola|kirchhoff|pk|log|hencky|green|almansi|lagrang|euler|wahr|vrai|r[ée]elle|verdader|real\b|"
    r"真|对数|対数|истинн|логарифм|грина|альманси|коши|пиол"
)
"""Within names of a strain or stress that is, or may be, another one than the engineering one."""
NOT_ENGINEERING = re.compile(rf"^(sigma|σ|[st]( ?([1-3xyzrθ]|theta){{2}})?$)|{OTHER_MEASURE}")
"""Names of a stress that is, or may be, over another area than the undeformed one."""
FEWEST_SPECIMENS = 2
"""Columns whose names are not known that may be of as many specimens."""
IS_PRESSURE = re.compile(r"pressure|druck$|pression|presi[oó]n|press[aã]o|压力|壓力|圧力|압력|давлени")
NEITHER_LOAD_NOR_DEFORMATION = re.compile(
    r"modul|time|zeit|czas|temp|tijd|时间|時間|시간|время|температур|модул|энерги|скорост|温度|模量|cycle|energy|rate|index|^(no|nr|n|point|punkt|step)\.?$|"
    + IS_PRESSURE.pattern
)
"""Names of columns that are no rivals, whatever their unit."""


X_AND_Y = ("x", "y")
"""Names of all columns of curves that were taken from a picture."""


@dataclass(frozen=True)
class ColumnChoice:
    """The columns (counted from 0) of the deformation and of the stress or force, and what they hold.

    Parameters
    ----------
    deformation, stress : int
        The columns.
    measure : str
        What the deformation is: stretch, strain, displacement, (current) length, (amount of) shear, its rate, twist, or
        outer or inner diameter.
    load : str
        What the other column holds: stress, torque, force or pressure.
    strain_type, stress_type : str
        Which measure of strain, or of shear, and of stress.
    by_unit : frozenset of int
        Which of the columns were told by their units alone, under names that are not known; or an amount of shear by
        its numbers, under the name of a stretch.
    """

    deformation: int
    stress: int
    measure: str = "stretch"
    load: str = "stress"
    strain_type: str = "engineering"
    stress_type: str = "engineering"
    by_unit: frozenset[int] = frozenset()


@dataclass(frozen=True)
class Contents:
    """What the names of columns say they hold, without words for a measure, and that measure where they say one.

    ``strain_type`` and ``stress_type`` are the measures that are asked for; none where the names decide.
    """

    quantities: Sequence[str]
    measures: Sequence[str]
    strain_type: str | None = None
    stress_type: str | None = None

    @classmethod
    def of(cls, table: Table, options: ReadingOptions) -> Self:
        """Return what the columns of a table hold, and which measures are asked for."""
        names = contents_of(table.names, [table.unit(column) for column in range(len(table.names))])
        quantities, measures = [name for name, _ in names], [measure for _, measure in names]
        return cls(quantities, measures, options.get("strain_type"), options.get("stress_type"))

    def fitting(self, *roles: str) -> list[int]:
        """Return the columns that may have one of the roles: of several those of the measure that is wanted.

        That is the one asked for, or else the engineering one, or what does not say another.
        """
        names = frozenset().union(*(ROLES[role] for role in roles))
        if "stress" in roles and self.stress_type is not None:
            names |= STRESS_NOUNS | COMPONENTS["stress"]
        if "strain" in roles and self.strain_type is not None:
            names |= COMPONENTS["strain"]
        columns = [column for column, quantity in enumerate(self.quantities) if quantity in names]
        wanted = self.stress_type if "stress" in roles else self.strain_type
        for measures in (("", "engineering"),) if wanted is None else ((wanted,), ("",)):
            preferred = [column for column in columns if self.measures[column] in measures]
            if preferred:
                return preferred
        return columns


def told_by_unit(
    table: Table, contents: Contents, kinds: Sequence[str], load: int | None = None
) -> tuple[str, int] | None:
    """Return the first kind of unit (stress, force, length, strain) that one column alone has, and that column.

    None where columns are left that could be meant as well: of a deformation, all that are neither of a load nor of
    time nor of a known dimension of the specimen. A stress that may be of another kind (sigma, true stress) is not
    taken unless its kind is said, and nothing that is called shear.
    """
    columns_of = {
        kind: [column for column in columns if column != load and contents.quantities[column]]
        for kind, columns in _by_unit(table, contents.quantities).items()
        if kind != "time"
    }
    rivals = [column for kind, columns in columns_of.items() if kind not in LOADS for column in columns]
    for kind in kinds:
        columns = columns_of.get(kind, [])
        if len(columns) == 1 and (load is None or rivals == columns or kind == "angle"):
            name = contents.quantities[columns[0]]
            is_open = kind == "stress" and not contents.stress_type and NOT_ENGINEERING.search(name)
            return None if is_open or name in ROLES["shear"] else (kind, columns[0])
    return None


def _by_unit(table: Table, quantities: Sequence[str]) -> dict[str, list[int]]:
    """Return the columns that vary, and that no name says are of something else, by the kind of their unit."""
    columns_of: dict[str, list[int]] = {}
    for column, quantity in enumerate(quantities):
        unit = table.unit(column)
        is_other = quantity in CYCLE_NAMES or bool(dimensions_named(quantity) or other_quantity(quantity, unit))
        is_other = is_other or bool(NEITHER_LOAD_NOR_DEFORMATION.search(quantity))
        if not is_other and not table.is_constant(column):
            columns_of.setdefault(measured_in(unit), []).append(column)
    return columns_of


def recognise(
    table: Table,
    contents: Contents,
    candidates: Sequence[str],
    roles: Sequence[str],
) -> int:
    """Return the one column whose name says that it has one of the candidate roles, of those that it may have."""
    columns = contents.fitting(*candidates)
    if len(columns) > 1:
        raise ambiguous(table, [_role_among(table, contents, candidates, column) for column in columns], columns)
    if {*table.quantities} == {*X_AND_Y}:
        raise _of_picture(table, {*SHEARS, "torque"}.isdisjoint(roles))
    if not columns:
        by_role = _stress_hint(table, contents) if "stress" in roles else _deformation_hint(table, contents, roles)
        hint = by_role or _of_other_quantities(table, roles) or _several_hint(table, contents, roles)
        hint = hint or _sizes_hint(table)
        what = " or ".join(filter(None, (", ".join(roles[:-1]), roles[-1])))
        of_units = DEFORMATIONS_OF_UNITS | ({"strain": "shear", "length": "sliding"} if "sliding" in roles else {})
        of_roles = (
            (of_units.get(kind, kind), columns_of_role)
            for kind, columns_of_role in _by_unit(table, table.quantities).items()
        )
        by_unit = {role: columns for role, columns in of_roles if role in roles}
        likely = [table.label(column) for columns in by_unit.values() for column in columns]
        several = f" By their units these may be: {', '.join(likely)}." if len(likely) > 1 and not hint else ""
        in_order = [*by_unit, *(role for role in roles if role not in by_unit)]
        raise InputError(
            f"{table.file}: no column is recognised as {what}.{hint}{several} "
            f"{columns_there_are(table)} {_how_to_say(table, in_order)}"
        )
    return columns[0]


def _of_picture(table: Table, is_lengthened: bool) -> InputError:
    """Return that the columns of curves from a picture do not say what they hold, and all that is to be said."""
    x, y = (table.names[table.quantities.index(name)] for name in X_AND_Y)
    deformation = "stretch" if is_lengthened else "shear"
    others = (
        f" Of strains in percent: --column strain={x} --column stress={y} --strain-unit % --stress-unit kPa. Of "
        f"displacements and forces: --column displacement={x} --column force={y} --displacement-unit mm --force-unit N "
        '--length "20 mm" --area "10 mm2".'
    )
    return InputError(
        f"{table.file}: columns {x} and {y} do not say what was measured. Say all of it at once, for all curves: "
        f'--column {deformation}={x} --column stress={y} --stress-unit kPa (in Python {deformation}="{x}", '
        f'stress="{y}", unit="kPa").{others * is_lengthened}'
    )


def _role_among(table: Table, contents: Contents, candidates: Sequence[str], column: int) -> str:
    """Return which of the candidate roles a column has by its name; a displacement over a length is a strain."""
    role = next((role for role in candidates if contents.quantities[column] in ROLES[role]), candidates[0])
    return "strain" if role == "displacement" and measured_in(table.unit(column)) == "strain" else role


def _of_other_quantities(table: Table, roles: Sequence[str]) -> str:
    """Return which columns have a unit of one of the roles, but the name of another quantity, and how to read them."""
    role_of_kind = {kind: DEFORMATIONS_OF_UNITS.get(kind, kind) for kind in (*LOADS, *DEFORMATIONS_OF_UNITS)}
    texts = []
    for column, (name, quantity) in enumerate(zip(table.names, table.quantities, strict=True)):
        role = role_of_kind.get(measured_in(table.unit(column)), "")
        if role in roles and (what := other_quantity(quantity, table.unit(column))):
            texts.append(
                f" Column {table.label(column)} is {what}, by its name. If it is the {role} all the same, "
                f'give --column {role}="{name}".'
            )
    return "".join(texts)


def _sizes_hint(table: Table) -> str:
    """Return where sizes are read, of a table that holds some and nothing else that has a unit."""
    sizes = [table.label(column) for column, name in enumerate(table.quantities) if dimensions_named(name)]
    if not sizes or any(_by_unit(table, table.quantities).keys() - {"", "time"}):
        return ""
    return (
        f" It holds sizes ({', '.join(sizes)}), which are read where the measurements stand: in lines above their "
        "table ('Width : 5 mm'), in columns of it, or in another sheet of their workbook."
    )


def _stress_hint(table: Table, contents: Contents) -> str:
    for column, quantity in enumerate(contents.quantities):
        if quantity in ROLES["torque"]:
            return f" Column {table.label(column)} is a torque; if a disc was twisted, give --mode simple-shear."
        if IS_PRESSURE.search(quantity):
            return f" Column {table.label(column)} is a pressure. For a tube, give --column outer_diameter=NAME, too."
        is_symbol = quantity in COMPONENTS["stress"]
        is_other = other_quantity(quantity, table.unit(column))
        is_stress = measured_in(table.unit(column)) == "stress" and not is_other
        if is_stress and (is_symbol or NOT_ENGINEERING.search(quantity)):
            return f" Column {table.label(column)} may be a stress of several types. {say_which('stress')}"
    return ""


def _several_hint(table: Table, contents: Contents, roles: Sequence[str]) -> str:
    """Return how columns of several specimens are given, where they stand beside one another and one deformation."""
    deformations = contents.fitting(*LENGTHENINGS, "shear")
    by_unit = _by_unit(table, table.quantities)
    columns = sorted({*by_unit.get("", []), *by_unit.get("stress", [])} - {*deformations})
    are_beside = columns == [*range(columns[0], columns[-1] + 1)] if columns else False
    if "stress" not in roles or len(deformations) != 1 or len(columns) < FEWEST_SPECIMENS or not are_beside:
        return ""
    return (
        f" If columns {columns[0] + 1} to {columns[-1] + 1} hold the stresses of several specimens, give "
        f"--column stress={columns[0] + 1}:{columns[-1] + 1} and --stress-unit."
    )


@contextmanager
def adding(text: str) -> Iterator[None]:
    """Add a text, in brackets, to what is wrong; nothing where it is empty."""
    try:
        yield
    except InputError as error:
        if not text:
            raise
        raise InputError(f"{error} ({text})") from error


def say_which(kind: str) -> str:
    """Return how to say which measure of strain or stress a column is."""
    strains = [name for name, measure in STRAIN_MEASURES.items() if measure.stretch]
    names = strains if kind == "strain" else list(STRESS_MEASURES)
    return f"Say which type it is (--{kind}-type; in Python {kind}_type): {', '.join(names[:-1])} or {names[-1]}."


def _deformation_hint(table: Table, contents: Contents, roles: Sequence[str]) -> str:
    symbols = [column for column, name in enumerate(contents.quantities) if name in COMPONENTS["strain"]]
    if symbols and "strain" in roles:
        return f" Column {table.label(symbols[0])} may be a strain of several types. {say_which('strain')}"
    columns = [] if "shear" in roles else contents.fitting("shear")
    if not columns:
        return ""
    return f" Column {table.label(columns[0])} is an amount of shear; if it is simple shear, give --mode simple-shear."


def find_column(table: Table, role: str, wanted: str | int) -> int:
    """Return the column (counted from 0) that is asked for in a role by its name, or its number from 1."""
    text = str(wanted).strip()
    readings = (
        table.names,
        [name.lower() for name in table.names],
        table.quantities,
    )
    for names, key in zip(readings, (text, text.lower(), plain(text)), strict=True):
        columns = [column for column, name in enumerate(names) if name and name == key]
        if len(columns) > 1:
            raise ambiguous(table, [role] * len(columns), columns)
        if columns:
            return columns[0]
    if text.isdecimal() and 1 <= int(text) <= len(table.names):
        return int(text) - 1
    close = get_close_matches(text.lower(), [name.lower() for name in table.names], n=1)
    suggestion = next((f" Did you mean '{name}'?" for name in table.names if [name.lower()] == close), "")
    raise InputError(
        f"{table.file} has no column '{text}' (asked for as {role}).{suggestion} {columns_there_are(table)}"
    )


def ambiguous(table: Table, roles: Sequence[str], columns: Sequence[int]) -> InputError:
    """Return that several columns may be read, each in its role, and how to say which is."""
    fitting = " and ".join(f"{table.label(column)} (number {column + 1})" for column in columns)
    distinct = list(dict.fromkeys(roles))
    return InputError(
        f"{table.file}: several columns may be the {' or '.join(distinct)}: {fitting}. {_how_to_say(table, distinct)}"
    )


def columns_there_are(table: Table) -> str:
    """Return the sentence that lists the columns of a table."""
    if not any(table.names):
        return f"Its {len(table.names)} columns have no names."
    names = ", ".join(f"'{name}'" if name else "(no name)" for name in table.names)
    return f"The columns are: {names}."


def _how_to_say(table: Table, roles: Sequence[str]) -> str:
    if not any(table.names):
        deformation = "shear" if {*SHEARS, "torque"} & {*roles} else "stretch"
        return (
            f'Say by number which is which: columns={{"{deformation}": 1, "stress": 2}} or --column {deformation}=1 '
            "--column stress=2."
        )
    more = f" (or {', '.join(f'{role}=' for role in roles[1:])})" if len(roles) > 1 else ""
    return f'Say which it is by name or number: columns={{"{roles[0]}": "NAME"}} or --column {roles[0]}=NAME{more}.'
