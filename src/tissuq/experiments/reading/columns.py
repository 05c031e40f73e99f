"""Which columns of a table hold the deformation and the stress or force of every measured stress, by name or role."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from difflib import get_close_matches

from tissuq.errors import InputError
from tissuq.experiments.modes import LoadingMode
from tissuq.experiments.modes.mode import SHEAR
from tissuq.experiments.reading.headings import (
    AXES,
    COMPONENTS,
    heading,
    measure_in,
    of_spread,
    on_axis,
    plain,
    role_names,
    without_gradient,
    without_mean,
)
from tissuq.experiments.reading.layout import split
from tissuq.experiments.reading.recognition import (
    DEFORMATIONS,
    DEFORMATIONS_OF_UNITS,
    LENGTHENINGS,
    LOADS,
    OTHER_MEASURE,
    SHEARS,
    Contents,
    ambiguous,
    columns_there_are,
    recognise,
    say_which,
    told_by_unit,
)
from tissuq.experiments.reading.table import Table
from tissuq.experiments.reading.tube_columns import PRESSURE, with_columns_of_tube
from tissuq.experiments.reading.vocabulary import DEFORMATION_NOUNS, OPEN_WITHOUT_UNIT
from tissuq.experiments.units import FORCE_PER_WIDTH, measured_in

__all__ = [
    "ColumnChoice",
    "about_stress",
    "choose_columns",
    "find_column",
    "mapping_of_each_stress",
]

SPREAD_ROLES = ("sem", "sd", "n")
"""Of columns beside a mean of several specimens: their standard error, their standard deviation, and their number."""
NO_MEASURE = re.compile(r"rate|modul|speed|control|max|yield|break|ultimate|peak|end of")
"""In a line above the table that speaks of strain or stress without saying what the columns hold."""
STRETCH_LESS = r"(lambda|λ|stretch( ratio)?|streckung)\s*[-–−]\s*{}\s*([\[(].*)?"
LESS_ONE, LESS_TWO = (re.compile(STRETCH_LESS.format(number), re.IGNORECASE) for number in (1, 2))
"""A strain as a stretch less one, unless others are numbered likewise, as ``lambda-2`` is."""
NOT_ENGINEERING_STRAIN = re.compile(rf"^e( ?([1-3xyzrθ]|theta){{2}})?$|^e ?gl?$|^ε ?t$|^ln|{OTHER_MEASURE}")
"""Names of a strain that is, or may be, Green's, Almansi's or another one than the engineering strain."""
SHEAR_STRESS = re.compile(
    r"shear|lateral|horizontal|schub|scher|quer|cisaillement|cort[ae]|taglio|cisalhamento|τ|tau|"
    r"сдвиг|касательн|剪切|剪应|せん断"
)
ON_SPECIMEN = re.compile(
    r"exten[sz]om|estensim|aufnehmer|video|opti[ck]|[oó]ptic|ottic|camera|kamera|laser|marker|clip|gau?ge|lvdt|\bdic\b|"
    r"伸び計|引伸[计計]|экстензометр|видео|оптич|камер|лазер|датчик деформ"
)
"""Names of a deformation that is measured on the specimen itself, not by the displacement of the machine."""
NORMAL = re.compile(r"normal|axial|^f ?[nz]$|нормальн|осев")
OSCILLATION = re.compile(
    r"(storage|loss|speicher|verlust|complex|dynamic) ?modul|^[ge](\'{1,2}|′|″|\"| prime)$|tan ?\(?(delta|δ)"
)
"""Names of what is measured in oscillations."""


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
        Which of the columns were told by their units alone, under names that are not known.
    """

    deformation: int
    stress: int
    measure: str = "stretch"
    load: str = "stress"
    strain_type: str = "engineering"
    stress_type: str = "engineering"
    by_unit: frozenset[int] = frozenset()


def choose_columns(
    table: Table,
    mode: LoadingMode,
    mapping: Mapping[str, str | int] | None,
    strain_type: str | None,
    stress_type: str | None,
    axis: str | None,
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
        From a role (stretch, strain, displacement, length, shear, twist or a diameter; stress, torque, force or
        pressure) to the name of a column, or its number from 1.
    strain_type, stress_type : str or None
        Which measures they are, by the names in `STRAIN_MEASURES` and `STRESS_MEASURES`; what the columns' names say
        where none is given, and engineering where these say nothing.
    axis : str or None
        ``x`` or ``y``: whose columns are read from the file of a biaxial machine in a mode with one stress.

    Raises
    ------
    InputError
        When a role or column does not exist, several columns fit, or none does.
    """
    count = len(mode.stresses)
    if count > 1 and axis is not None:
        raise InputError(f"loading mode '{mode.name}' reads both axes; leave axis (--axis) out, or give another mode.")
    mappings = mapping_of_each_stress(mode, mapping)
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
            choices.append(_choice(table, mode, roles, (strain_type, stress_type), axis_of_stress))
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
            raise ambiguous(table, [role], columns)
        if columns:
            return columns[0]
    if text.isdecimal() and 1 <= int(text) <= len(table.names):
        return int(text) - 1
    close = get_close_matches(text.lower(), [name.lower() for name in table.names], n=1)
    suggestion = next((f" Did you mean '{name}'?" for name in table.names if [name.lower()] == close), "")
    raise InputError(
        f"{table.file} has no column '{text}' (asked for as {role}).{suggestion} {columns_there_are(table)}"
    )


def _axes_of(table: Table) -> list[str]:
    """Return the axes (x, y) of which the table has columns."""
    return sorted({axis for axis, _ in (on_axis(name) for name, _ in _names(table)) if axis})


def _names(table: Table) -> list[tuple[str, str]]:
    """Return what the columns' names say they hold, and the measure of strain or stress; empty texts of spreads.

    Beside columns of a spread without words for a mean.
    """
    quantities = [heading(name).quantity for name in table.names]
    if not any(LESS_TWO.fullmatch(name.strip()) for name in table.names):
        strains = map(LESS_ONE.fullmatch, map(str.strip, table.names))
        quantities = ["strain" if strain else name for name, strain in zip(quantities, strains, strict=True)]
    is_ratio = [not unit or measured_in(unit) == "strain" for unit in map(table.unit, range(len(quantities)))]
    quantities = [without_gradient(name) if ratio else name for name, ratio in zip(quantities, is_ratio, strict=True)]
    is_spread = [bool(of_spread(quantity)[0]) for quantity in quantities]
    if any(is_spread):
        quantities = [without_mean(quantity) or quantity for quantity in quantities]
    return [("", "") if of_spread else measure_in(name) for name, of_spread in zip(quantities, is_spread, strict=True)]


def mapping_of_each_stress(mode: LoadingMode, mapping: Mapping[str, str | int] | None) -> list[dict[str, str | int]]:
    """Return the roles of every stress: those of the second end in 2; with one control it has only a stress."""
    mappings = [dict(mapping or {})]
    roles = (*(DEFORMATIONS + LOADS if len(mode.controls) > 1 else ("stress",)), *SPREAD_ROLES)
    for number in range(2, len(mode.stresses) + 1):
        numbered = [role for role in roles if f"{role}{number}" in mappings[0]]
        mappings.append({role: mappings[0].pop(f"{role}{number}") for role in numbered})
    return mappings


def _has_roles(mode: LoadingMode, mapping: Mapping[str, str | int]) -> bool:
    """Return whether a mapping holds a stress or force, and a deformation where each stress has one of its own."""
    return bool(mapping.keys() & LOADS and (len(mode.controls) == 1 or mapping.keys() & DEFORMATIONS))


def _choice(
    table: Table,
    mode: LoadingMode,
    mapping: Mapping[str, str | int],
    types: tuple[str | None, str | None],
    axis: str | None,
) -> ColumnChoice:
    """Return the columns of one stress; ``types`` are the measures of strain and stress that are asked for."""
    is_shear, told = mode.controls == (SHEAR,), set[int]()
    _check_roles(table, mapping, is_shear)
    contents = Contents(_quantities(table, axis, mapping), [measure for _, measure in _names(table)], *types)
    mapping = with_columns_of_tube(table, mode, mapping, contents.quantities)
    load = next((role for role in LOADS if role in mapping), None)
    if load:
        stress = find_column(table, load, mapping[load])
    else:
        loads = ("stress", "torque", "force") if is_shear else ("stress", "force")
        load = next((role for role in loads if contents.fitting(role)), "")
        by_unit = None if load else told_by_unit(table, contents, loads)
        load, stress = by_unit or (load, recognise(table, contents, [load or "force"], loads))
        told |= {stress} if by_unit else set()
        is_per_width = measured_in(table.unit(stress)) == FORCE_PER_WIDTH.name
        load = "force" if load == "stress" and is_per_width else load
    measure = next((role for role in DEFORMATIONS if role in mapping), None)
    if measure:
        deformation = find_column(table, measure, mapping[measure])
    else:
        measures = ["shear"] if is_shear else ["stretch", "strain"]
        roles = ("shear", "twist") if load == "torque" else ("shear", "rate", "sliding") if is_shear else LENGTHENINGS
        if load == "torque" and not contents.fitting("shear"):
            measures = ["twist"]
        elif is_shear:
            sheared = (role for role in ("shear", "rate", "sliding", "strain") if contents.fitting(role))
            measures = [next(sheared, "shear")]
        if not is_shear and not contents.fitting(*measures):
            measures = ["displacement"] if contents.fitting("displacement") else ["length"]
        is_named = bool(contents.fitting(*measures)) or (is_shear and load != "torque")
        kinds = ("angle",) if is_shear else ("strain", "length", "pixels")
        by_unit = None if is_named else told_by_unit(table, contents, kinds, stress)
        if by_unit:
            measure, deformation = DEFORMATIONS_OF_UNITS[by_unit[0]], by_unit[1]
            told |= {deformation} if contents.quantities[deformation] not in OPEN_WITHOUT_UNIT else set()
        else:
            deformation = recognise(table, contents, measures, roles)
            name = contents.quantities[deformation]
            measure = next((measure for measure in measures if name in role_names(measure)), "strain")
            measure = "shear" if is_shear and measure == "strain" else measure
        by_unit_alone = measured_in(table.unit(deformation))
        if measure == "displacement" and by_unit_alone == "strain":
            measure = "strain"
        elif (
            measure == "strain" and by_unit_alone == "length" and contents.quantities[deformation] in DEFORMATION_NOUNS
        ):
            measure = "displacement"
        if measure == "displacement":
            _check_machine(table, contents.quantities, deformation)
    if deformation == stress:
        raise InputError(
            f"{table.file}: column {table.label(stress)} cannot be both {measure} and {load}; "
            f"give two columns. {columns_there_are(table)}"
        )
    _check_test(table, stress, mapping, is_shear)
    return _with_types(table, ColumnChoice(deformation, stress, measure, load, by_unit=frozenset(told)), contents)


def _check_machine(table: Table, quantities: Sequence[str], displacement: int) -> None:
    """Ask which is read where an extensometer or a camera measures the specimen beside the machine's displacement."""
    roles = {"length": "displacement", "strain": "strain", "pixels": "length"}
    seen = {column: roles.get(measured_in(table.unit(column))) for column in _columns_on_specimen(table, quantities)}
    seen = {column: role for column, role in seen.items() if role}
    if displacement in _columns_on_specimen(table, quantities) or not seen:
        return
    labels = " and ".join(map(table.label, seen))
    choices = [("displacement", displacement), *((str(role), column) for column, role in seen.items())]
    flags = " or ".join(f'--column {role}="{table.names[column]}"' for role, column in choices)
    raise InputError(
        f"{table.file}: column {table.label(displacement)} is the displacement of the machine, and {labels} was "
        "measured on the specimen, by an extensometer or a camera. They give different stretches. Say which is read: "
        f"{flags}."
    )


def _columns_on_specimen(table: Table, quantities: Sequence[str]) -> list[int]:
    return [
        column
        for column, quantity in enumerate(quantities)
        if ON_SPECIMEN.search(quantity) and not table.is_constant(column)
    ]


def _quantities(table: Table, axis: str | None, mapping: Mapping[str, str | int]) -> list[str]:
    """Return what the columns' names say they hold; of the columns of two axes only those of the one asked for."""
    names, axes = [on_axis(name) for name, _ in _names(table)], _axes_of(table)
    if len(axes) == 2:
        names = [_on_axis_by_unit(table, column, *name) for column, name in enumerate(names)]
    if not mapping:
        names = _without_empty(table, names)
    if axis is not None and axis not in axes:
        raise InputError(
            f"{table.file} has no columns of an axis '{axis}'. {columns_there_are(table)} Leave axis (--axis) out."
        )
    if axis is None and len(axes) == 2 and not mapping:
        raise InputError(
            f"{table.file} is of a biaxial test. Say which axis is read: axis='x' (--axis x) or axis='y' (--axis y), "
            "with the loading mode that belongs to it, or read both at once: mode='biaxial' (--mode biaxial). If "
            "numbers in the names are of two specimens, write S1 and S2 there."
        )
    wanted = axis or (axes[0] if len(axes) == 1 else "")
    return [name if axis_of_name in ("", wanted) else "" for axis_of_name, name in names]


def _on_axis_by_unit(table: Table, column: int, axis: str, name: str) -> tuple[str, str]:
    """Return the axis and the name of a column: where others have axes, ``P1`` with a unit of stress is along one."""
    symbol, number = name[:1], name[1:].strip()
    is_component = not axis and symbol in COMPONENTS["stress"] and number in AXES
    return (AXES[number], symbol) if is_component and measured_in(table.unit(column)) == "stress" else (axis, name)


def _without_empty(table: Table, names: Sequence[tuple[str, str]]) -> list[tuple[str, str]]:
    """Return names of columns, but none of those that hold the same number throughout where others are like them."""
    kinds = (frozenset().union(*map(role_names, roles)) for roles in (DEFORMATIONS, LOADS))
    filled = list(names)
    for kind in kinds:
        columns = [column for column, (_, name) in enumerate(names) if name in kind]
        empty = [column for column in columns if table.is_constant(column)]
        if len(empty) < len(columns):
            for column in empty:
                filled[column] = "", ""
    return filled


def _check_roles(table: Table, mapping: Mapping[str, str | int], is_shear: bool) -> None:
    unknown = [role for role in mapping if role not in DEFORMATIONS + LOADS + SPREAD_ROLES]
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
    unfit = (set(LENGTHENINGS) if is_shear else {*SHEARS, "torque"}) & set(mapping)
    if unfit:
        deformation = (
            "an amount of shear, its rate, a displacement along the planes (sliding), or the twist and torque of a disc"
            if is_shear
            else "a stretch, strain, displacement or length"
        )
        raise InputError(f"{table.file}: a column is given as {min(unfit)}, but this loading mode has {deformation}.")


def _with_types(table: Table, choice: ColumnChoice, contents: Contents) -> ColumnChoice:
    """Return a choice with the measures of its strain and stress: those asked for, or that the columns' names say.

    Raises
    ------
    InputError
        When a name contradicts what its column is read as, or it is open which measure it is.
    """
    strain_type = _type_of(table, choice.deformation, contents, "strain", contents.strain_type)
    stress_type = _type_of(table, choice.stress, contents, "stress", contents.stress_type)
    name, is_strain = contents.quantities[choice.deformation], choice.measure == "strain"
    is_percent = "%" in table.stated_units(choice.deformation)
    if is_strain and not is_percent and set(name.split()) & {"stretch", "lambda", "λ"}:
        raise InputError(
            f"{table.place(choice.deformation)} is named a stretch but read as a strain. Give it as stretch "
            "(--column stretch=NAME), or rename the column."
        )
    if choice.load in ("torque", PRESSURE):
        if stress_type:
            raise InputError(
                f"{table.place(choice.stress)} is read as a {choice.load}, which is no {stress_type} stress. Leave "
                "stress_type (--stress-type) out, or give the column as stress (--column stress=NAME)."
            )
        stress_type = "torsion" if choice.load == "torque" else ""
    if strain_type and not is_strain and choice.measure != "shear":
        raise InputError(
            f"{table.place(choice.deformation)} is a {strain_type} strain, as its name or strain_type (--strain-type) "
            f"says, but read as {choice.measure}. Leave strain_type out, or give the column as strain "
            "(--column strain=NAME)."
        )
    if is_strain and not strain_type and NOT_ENGINEERING_STRAIN.search(name):
        raise InputError(f"{table.place(choice.deformation)} may be a strain of several types. {say_which('strain')}")
    if choice.load == "stress" and not stress_type and re.search(OTHER_MEASURE, contents.quantities[choice.stress]):
        raise InputError(f"{table.place(choice.stress)} may be a stress of several types. {say_which('stress')}")
    if is_strain and not strain_type:
        _check_lines_above(table, choice.deformation, "strain")
    if choice.load == "stress" and not stress_type:
        _check_lines_above(table, choice.stress, "stress")
    is_told = contents.strain_type or contents.stress_type
    if is_strain and choice.load == "stress" and not is_told and (strain_type == "") != (stress_type == ""):
        stated, unstated = ("strain", "stress") if strain_type else ("stress", "strain")
        column, other = choice.stress, choice.deformation
        if unstated == "strain":
            column, other = other, column
        if (strain_type or stress_type) != "engineering":
            raise InputError(
                f"{table.place(column)} does not say which type of {unstated} it is, and {stated} "
                f"{table.label(other)} is {strain_type or stress_type}. {say_which(unstated)}"
            )
    return replace(choice, strain_type=strain_type or "engineering", stress_type=stress_type or "engineering")


def _type_of(table: Table, column: int, contents: Contents, kind: str, wanted: str | None) -> str:
    """Return the measure that a column is read as: the one asked for, which its name must not contradict."""
    by_name = contents.measures[column]
    if wanted and by_name and wanted != by_name:
        raise InputError(
            f"{table.place(column)} is named a {kind} of type '{by_name}' but read as '{wanted}'. Leave {kind}_type "
            f"(--{kind}-type) out, or rename the column."
        )
    return wanted or by_name


def _check_lines_above(table: Table, column: int, kind: str) -> None:
    """Refuse a column of open measure where a line above the table names one that is not the engineering one."""
    for line, text in table.head:
        if set(table.names) & {*split(text, table.separator)} - {""}:
            continue
        words = text.lower()
        if kind in words and not NO_MEASURE.search(words) and re.search(OTHER_MEASURE, words):
            raise InputError(
                f"{table.place(column)} does not say which type of {kind} it is, and line {line} says "
                f"'{text.strip()}'. {say_which(kind)}"
            )


def _check_test(table: Table, stress: int, mapping: Mapping[str, str | int], is_shear: bool) -> None:
    """Refuse a shear stress where nothing is sheared, and amplitudes of oscillations, which are no curve."""
    quantities = [heading(name).quantity for name in table.names]
    if is_shear and not mapping.keys() & LOADS and NORMAL.search(quantities[stress]):
        raise InputError(
            f"{table.place(stress)} is normal to the sheared planes, and no column is recognised as a shear stress, a "
            "shear force or a torque. Say which it is: --column stress=NAME, force=NAME or torque=NAME."
        )
    if not is_shear and "stress" not in mapping and SHEAR_STRESS.search(quantities[stress]):
        raise InputError(
            f"{table.place(stress)} is a load in shear. If the specimen was sheared, give --mode simple-shear and the "
            "column of the amount of shear (--column shear=NAME), or of the displacement (sliding=NAME)."
        )
    moduli = [k for k, name in enumerate(quantities) if OSCILLATION.search(name) and not table.is_constant(k)]
    if moduli and not (mapping.keys() & LOADS and mapping.keys() & DEFORMATIONS):
        raise InputError(
            f"{table.file}: column {table.label(moduli[0])} is of oscillations, whose strains and stresses are "
            "amplitudes and no curve of one test. If there is a curve all the same, say which columns it is in: "
            "--column shear=NAME --column stress=NAME."
        )


def _roles_missing(table: Table, mode: LoadingMode) -> InputError:
    roles = ("stretch", "stress", "stretch2", "stress2") if len(mode.controls) > 1 else ("stress", "stress2")
    named = ", or name them 'stretch x', 'stress x', 'stretch y', 'stress y'" if mode.machine_axes else ""
    return InputError(
        f"{table.file}: loading mode '{mode.name}' has {' and '.join(mode.stresses)}, and the file's columns do not "
        f"tell both. {columns_there_are(table)} Say which they are: "
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
            if content in ("displacement", "length", "twist", "rate", "sliding", "force", "torque"):
                raise InputError(
                    f"{table.place(column)} holds a {content}, and in loading mode '{mode.name}' columns are read as "
                    "stretch, strain or shear, and as stress. Convert it, and give its column as one of them."
                )
