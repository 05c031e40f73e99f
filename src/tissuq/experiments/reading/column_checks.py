"""Whether columns can be what they are chosen as: their roles, their measures, and what else the table holds."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments.modes import LoadingMode
from tissuq.experiments.reading.layout import split
from tissuq.experiments.reading.measures import STRAIN_MEASURES, STRESS_MEASURES
from tissuq.experiments.reading.recognition import (
    DEFORMATIONS,
    LENGTHENINGS,
    LOADS,
    OTHER_MEASURE,
    PRESSURE,
    SHEARS,
    ColumnChoice,
    Contents,
    say_which,
)
from tissuq.experiments.reading.table import Table
from tissuq.experiments.reading.vocabulary import ROLES
from tissuq.experiments.units import FORCE, measured_in, stress_unit

SPREAD_ROLES = ("sem", "sd", "n")
"""Of columns beside a mean of several specimens: their standard error, their standard deviation, and their number."""
NO_MEASURE = re.compile(r"rate|modul|speed|control|max|yield|break|ultimate|peak|end of")
"""In a line above the table that speaks of strain or stress without saying what the columns hold."""
MAY_BE_OTHER = {
    "strain": re.compile(rf"^e( ?([1-3xyzrθ]|theta){{2}})?$|^e ?gl?$|^ε ?t$|^ln|{OTHER_MEASURE}"),
    "stress": re.compile(OTHER_MEASURE),
}
"""Names of a strain or stress that is, or may be, another one than the engineering one, such as Green's strain."""
TENSOR_SHEAR = re.compile(r"\b(e|eps|epsilon|ε)[ _]?([1-3xyzrθ])(?!\2)[1-3xyzrθ]\b|tensor")
"""Names of a shear strain that is a component of a tensor: half of the amount of shear."""
SHEAR_STRESS = re.compile(
    r"shear|lateral|horizontal|schub|scher|quer|cisaillement|cort[ae]|taglio|cisalhamento|τ|tau|"
    r"сдвиг|касательн|剪切|剪应|せん断"
)
ON_SPECIMEN = re.compile(
    r"exten[sz]om|estensim|aufnehmer|video|opti[ck]|[oó]ptic|ottic|camera|kamera|laser|marker|clip|gau?ge|lvdt|\bdic\b|"
    r"\bext(\b|\d)|\bave ?\d|\b(gap)?ex ?\d\b|\(strain ?\d\)|"
    r"伸び計|引伸[计計]|экстензометр|видео|оптич|камер|лазер|датчик деформ"
)
"""Names of a deformation that is measured on the specimen itself, not by the displacement of the machine."""
RATIO = re.compile(
    r"strain|stretch|lambda|hencky|lagrang|^e ?[xyz123]{1,2}\b|^eps|ε|λ|dehnung|d[eé]formation|deformaci|deformazion"
)
"""Names of strains and stretches, alone or with further words."""
NOT_ALONG = re.compile(r"trans|lat|quer|width|vol|shear|rate|max|min|yield|break|fail|set|limit|plastic|residual|^exx")
"""Names of a strain that is not the one along the test at every row."""
LARGEST_RATIO = 5.0
"""Number without a unit beyond which a column is taken for no strain or stretch."""
MAX_DIFFERENCE = 0.01
"""Largest difference of two columns, over the range of one, at which they say the same."""
SAME_NUMBERS = 1e-3
"""Largest difference of a stress and a force over 1 mm2, over the largest force."""
NORMAL = re.compile(r"normal|axial|^f ?[nz]$|нормальн|осев")
OSCILLATION = re.compile(
    r"(storage|loss|speicher|verlust|complex|dynamic) ?modul|^[ge](\'{1,2}|′|″|\"| prime)$|tan ?\(?(delta|δ)"
)
"""Names of what is measured in oscillations."""


def check_machine(table: Table, quantities: Sequence[str], column_read: int, measure: str, load: str = "") -> None:
    """Ask which is read where the deformation was measured twice: by the machine, and on the specimen.

    By an extensometer or a camera, as names say; or, beside a displacement, in a column of strains or stretches.
    ``load`` is how the column of the load is given, where both are needed.
    """
    on_specimen = [
        column for column, name in enumerate(quantities) if ON_SPECIMEN.search(name) and not table.is_constant(column)
    ]
    if column_read in on_specimen or measure not in ("displacement", "strain", "stretch"):
        return
    roles = {"length": "displacement", "strain": "strain", "pixels": "length"}
    if measure != "displacement":
        roles = {"": measure, "strain": measure}
    seen = {column: roles.get(measured_in(table.unit(column))) for column in on_specimen}
    if measure == "displacement":
        unitless = [column for column in on_specimen if not measured_in(table.unit(column))]
        small = {column for column in unitless if np.abs(table.numbers([column])).max() < LARGEST_RATIO}
        ratios = small.union(_ratios(table, quantities, column_read))
        seen |= {column: _ratio_role(table, column) for column in sorted(ratios)}
    seen = {column: role for column, role in seen.items() if role}
    if not seen or (measure != "displacement" and all(_is_same(table, column_read, column) for column in seen)):
        return
    labels = " and ".join(dict.fromkeys(map(table.label, seen)))
    choices = [(measure, column_read), *((str(role), column) for column, role in seen.items())]
    flags = " or ".join(dict.fromkeys(f'--column {role}="{table.names[column]}"{load}' for role, column in choices))
    raise InputError(
        f"{table.file}: column {table.label(column_read)} is the {measure} of the machine, and {labels} was "
        "measured on the specimen, by an extensometer or a camera. They give different stretches. Say which is read: "
        f"{flags}."
    )


def _ratios(table: Table, quantities: Sequence[str], displacement: int) -> list[int]:
    """Return columns that by their names hold strains or stretches along the test, beside a displacement."""
    return [
        column
        for column, quantity in enumerate(quantities)
        if column != displacement
        and RATIO.search(quantity)
        and not NOT_ALONG.search(quantity)
        and measured_in(table.unit(column)) in ("", "strain")
        and not table.is_constant(column)
    ]


def _ratio_role(table: Table, column: int) -> str:
    """Return whether numbers of a column are stretches, which begin at one, or strains."""
    (values,) = table.numbers([column])
    return "stretch" if abs(values[0] - 1) < abs(values[0]) else "strain"


def _is_same(table: Table, column: int, same_column: int) -> bool:
    """Return whether two columns say the same."""
    values, same_values = table.numbers([column, same_column])
    return bool(np.abs(same_values - values).max() <= MAX_DIFFERENCE * np.ptp(values))


def check_roles(table: Table, mapping: Mapping[str, str | int], is_shear: bool) -> None:
    """Refuse roles that do not exist, do not go together, or that the loading mode does not have."""
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
        advice = " If it holds the amount of shear, give it so: --column shear=NAME." if is_shear else ""
        raise InputError(
            f"{table.file}: a column is given as {min(unfit)}, but this loading mode has {deformation}.{advice}"
        )


def check_is_shear(table: Table, column: int) -> None:
    """Ask about a column that is called a stretch in simple shear, unless it begins at 0 as an amount of shear does."""
    if _ratio_role(table, column) == "stretch":
        (values,) = table.numbers([column])
        raise InputError(
            f"{table.place(column)} is called a stretch, and its values ({values.min():g} to {values.max():g}) are "
            "those of one, which is 1 at rest; simple shear has an amount of shear, which is 0 there. If the column "
            f'holds the amount of shear all the same, give --column shear="{table.names[column]}"; if the specimen '
            "was stretched, give its mode, such as --mode uniaxial."
        )


def with_types(table: Table, choice: ColumnChoice, contents: Contents) -> ColumnChoice:
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
    is_named_stretch = is_strain and not is_percent and bool(set(name.split()) & {"stretch", "lambda", "λ"})
    if is_named_stretch and _ratio_role(table, choice.deformation) == "stretch":
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
    if choice.measure == "shear" and not strain_type and TENSOR_SHEAR.search(name):
        raise InputError(
            f"{table.place(choice.deformation)} is named as a component of a strain tensor, which is half of the "
            "amount of shear: to read twice its values give --strain-type green. If it holds the amount of shear "
            "(gamma) all the same, give --strain-type engineering."
        )
    of_strain = choice.deformation, "strain", strain_type
    of_stress = choice.stress, "stress", stress_type if choice.load == "stress" else ""
    both = [of_strain] * is_strain + [of_stress] * (choice.load == "stress")
    are_open = [(column, kind) for column, kind, measure in both if not measure]
    for column, kind in are_open:
        if MAY_BE_OTHER[kind].search(contents.quantities[column]):
            raise InputError(f"{table.place(column)} may be a {kind} of several types. {say_which(kind)}")
    for column, kind in are_open:
        _check_lines_above(table, column, kind)
    is_told = contents.strain_type or contents.stress_type
    others = [stated for stated in both if stated[2] not in ("", "engineering")]
    if are_open and others and not is_told:
        (column, kind), (other, other_kind, measure) = are_open[0], others[0]
        raise InputError(
            f"{table.place(column)} does not say which type of {kind} it is, and {other_kind} {table.label(other)} is "
            f"{measure}. {say_which(kind)}"
        )
    for column, kind, measure in (of_strain, of_stress):
        if measure and measure not in (STRAIN_MEASURES if kind == "strain" else STRESS_MEASURES):
            raise InputError(
                f"{table.place(column)} is read as {kind}, and its name says '{measure}', which is no type of {kind}. "
                f"Give another column as {kind} (--column {kind}=NAME), or rename it."
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


def check_test(table: Table, stress: int, mapping: Mapping[str, str | int], is_shear: bool) -> None:
    """Refuse a shear stress where nothing is sheared, and amplitudes of oscillations, which are no curve."""
    quantities = table.quantities
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


def check_section(table: Table, stress: int, load: str, given: str = "") -> None:
    """Ask about stresses that are a force over exactly 1 mm2, as software states them to which nobody said the area.

    ``given`` are further options that read the same test.
    """
    are_forces = [
        quantity in ROLES["force"] or measured_in(table.unit(k)) == "force"
        for k, quantity in enumerate(table.quantities)
    ]
    forces = [k for k, is_force in enumerate(are_forces) if is_force and table.varies(k)]
    of_area_1 = [force for force in forces if load == "stress" and _is_over_1_mm2(table, stress, force)]
    if of_area_1:
        raise InputError(
            f"{table.place(stress)} is {table.label(of_area_1[0])} over 1 mm2, as the software of a machine states it "
            f"where no cross-section was entered. Give the forces,{given} --column "
            f'force="{table.names[of_area_1[0]]}", and the --area of the specimen; if that is 1 mm2 all the same,'
            f'{given} --column stress="{table.names[stress]}".'
        )


def _is_over_1_mm2(table: Table, stress: int, force: int) -> bool:
    """Tell whether a column of stresses holds forces in N as MPa; not where units or cells are faulty."""
    with suppress(InputError):
        stresses, forces = table.numbers([stress, force])
        megapascals = stress_unit(table.unit(stress)).to_mpa * stresses
        newtons = FORCE.factor(table.unit(force)) * forces
        return bool(np.abs(megapascals - newtons).max() <= SAME_NUMBERS * np.abs(newtons).max())
    return False


def check_together(table: Table, mode: LoadingMode, choices: Sequence[ColumnChoice]) -> None:
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
