"""Which columns of a table hold the deformation and the stress or force of every measured stress, by name or role."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace

from tissuq.errors import InputError
from tissuq.experiments.modes import LoadingMode, ThinTube
from tissuq.experiments.modes.mode import SHEAR
from tissuq.experiments.reading.column_checks import (
    SPREAD_ROLES,
    check_is_shear,
    check_machine,
    check_roles,
    check_section,
    check_test,
    check_together,
    with_types,
)
from tissuq.experiments.reading.columns_of_tube import columns_of_tube, with_columns_of_tube
from tissuq.experiments.reading.headings import on_axes_by_unit, on_axis
from tissuq.experiments.reading.options import ReadingOptions
from tissuq.experiments.reading.recognition import (
    DEFORMATIONS,
    DEFORMATIONS_OF_UNITS,
    LENGTHENINGS,
    LOADS,
    ColumnChoice,
    Contents,
    adding,
    columns_there_are,
    find_column,
    recognise,
    told_by_unit,
)
from tissuq.experiments.reading.table import Table
from tissuq.experiments.reading.vocabulary import DEFORMATION_NOUNS, OPEN_WITHOUT_UNIT, ROLE_OF_AXIAL_STRETCH, ROLES
from tissuq.experiments.units import FORCE_PER_WIDTH, measured_in


def choose_columns(table: Table, mode: LoadingMode, options: ReadingOptions) -> dict[str, ColumnChoice]:
    """Return the columns of every stress of a mode, by what it is called; of a mode with one by an empty text.

    They are those of the options, the others are known by their names: a stress goes before a force, a stretch or
    strain before a displacement. Those of a second stress are known by the axis in their names, or given in roles that
    end in 2. Which measures of strain and stress they are, names say where no option does; engineering ones where these
    say nothing.

    Raises
    ------
    InputError
        When a role or column does not exist, several columns fit, or none does.
    """
    count, axis = len(mode.stresses), options.get("axis")
    if isinstance(mode, ThinTube) and (of_tube := columns_of_tube(table, mode, options)):
        return of_tube
    mapping = {role: name for role, name in (options.get("columns") or {}).items() if role != ROLE_OF_AXIAL_STRETCH}
    if count > 1 and axis is not None:
        raise InputError(f"loading mode '{mode.name}' reads both axes; leave axis (--axis) out, or give another mode.")
    names = list(map(on_axis, Contents.of(table, options).quantities))
    is_of_axes = bool(mode.machine_axes) and _axes_of(names) == list(mode.machine_axes)
    if mode.machine_axes and not (is_of_axes or mapping):
        mapping = _with_numbered_second(names)
    mappings = mapping_of_each_stress(mode, mapping)
    needed = (LOADS,) if len(mode.controls) == 1 else (LOADS, DEFORMATIONS)
    if not is_of_axes and not all(roles.keys() & kind for roles in mappings[1:] for kind in needed):
        raise _roles_missing(table, mode)
    axes = mode.machine_axes if is_of_axes else (axis,) * count
    labels = [f"axis {name}" for name in axes] if is_of_axes else list(mode.stresses) if count > 1 else [""]
    choices: list[ColumnChoice] = []
    for number, (roles, axis_of_stress) in enumerate(zip(mappings, axes, strict=True)):
        if number and len(mode.controls) == 1:
            roles = roles | {choices[0].measure: choices[0].deformation + 1}
        with about_stress(number, labels, mode):
            choices.append(_choice(table, mode, roles, options, axis_of_stress))
    if count > 1:
        check_together(table, mode, choices)
    return dict(zip(labels, choices, strict=True))


def about_stress(number: int, labels: Sequence[str], mode: LoadingMode) -> AbstractContextManager[None]:
    """Add to what is wrong with a stress after the first how its columns and dimensions are given."""
    sizes = " Along it the specimen measures --width, and across it --length." if mode.machine_axes else ""
    roles = "roles of its columns end in 2, as in --column stress2=NAME."
    return adding(f"This is about {labels[number]}: {roles}{sizes}" if number else "")


def _with_numbered_second(names: Sequence[tuple[str, str]]) -> dict[str, str | int]:
    """Return the roles of columns whose first axis has no number, ``stretch`` beside ``stretch_2``; else none."""
    columns: dict[str, str | int] = {}
    for column, (axis, name) in enumerate(names, start=1):
        role = next((role for role in (*DEFORMATIONS, *LOADS) if name in ROLES[role]), "")
        numbered = role + "2" * (axis == "y")
        if role and (axis == "x" or numbered in columns):
            return {}
        if role:
            columns[numbered] = column
    seconds = {role.removesuffix("2") for role in columns if role.endswith("2")}
    firsts = {role for role in columns if not role.endswith("2")}
    is_whole = firsts == seconds and firsts & {*DEFORMATIONS} and firsts & {*LOADS}
    return columns if is_whole else {}


def _axes_of(names: Sequence[tuple[str, str]]) -> list[str]:
    """Return the axes (x, y) of which there are columns, with the names of these."""
    return sorted({axis for axis, _ in names} - {""})


def mapping_of_each_stress(mode: LoadingMode, mapping: Mapping[str, str | int] | None) -> list[dict[str, str | int]]:
    """Return the roles of every stress: those of the second end in 2; with one control it has only a stress."""
    mappings = [dict(mapping or {})]
    roles = (*(DEFORMATIONS + LOADS if len(mode.controls) > 1 else ("stress",)), *SPREAD_ROLES)
    for number in range(2, len(mode.stresses) + 1):
        numbered = [role for role in roles if f"{role}{number}" in mappings[0]]
        mappings.append({role: mappings[0].pop(f"{role}{number}") for role in numbered})
    return mappings


def _choice(
    table: Table, mode: LoadingMode, mapping: Mapping[str, str | int], options: ReadingOptions, axis: str | None
) -> ColumnChoice:
    """Return the columns of one stress, in roles that are given or by their names."""
    is_shear, unnamed = mode.controls == (SHEAR,), set[int]()
    check_roles(table, mapping, is_shear)
    contents = Contents.of(table, options)
    contents = replace(contents, quantities=_quantities(table, contents.quantities, axis, mapping))
    mapping = with_columns_of_tube(table, mode, mapping, contents.quantities)
    load = next((role for role in LOADS if role in mapping), None)
    if load:
        stress = find_column(table, load, mapping[load])
    else:
        loads = ("stress", "torque", "force") if is_shear else ("stress", "force")
        load = next((role for role in loads if contents.fitting(role)), "")
        by_unit = None if load else told_by_unit(table, contents, loads)
        load, stress = by_unit or (load, recognise(table, contents, [load or "force"], loads))
        unnamed |= {stress} if by_unit else set()
        is_per_width = measured_in(table.unit(stress)) == FORCE_PER_WIDTH.name
        load = "force" if load == "stress" and is_per_width else load
        check_section(table, stress, load)
    measure = next((role for role in DEFORMATIONS if role in mapping), None)
    if measure:
        deformation = find_column(table, measure, mapping[measure])
    else:
        measures = ["shear"] if is_shear else ["stretch", "strain"]
        roles = ("shear", "twist") if load == "torque" else ("shear", "rate", "sliding") if is_shear else LENGTHENINGS
        if load == "torque" and not contents.fitting("shear"):
            measures = ["twist"]
        elif is_shear:
            is_stretch = len(contents.fitting("stretch")) == 1
            sheared = (role for role in ("shear", "rate", "sliding", "strain") if contents.fitting(role))
            measures = [next(sheared, "stretch" if is_stretch else "shear")]
        if not is_shear and not contents.fitting(*measures):
            measures = ["displacement"] if contents.fitting("displacement") else ["length"]
        is_named = bool(contents.fitting(*measures)) or (is_shear and load != "torque")
        kinds = ("angle",) if is_shear else ("strain", "length", "pixels")
        by_unit = None if is_named else told_by_unit(table, contents, kinds, stress)
        if by_unit:
            measure, deformation = DEFORMATIONS_OF_UNITS[by_unit[0]], by_unit[1]
            unnamed |= {deformation} if contents.quantities[deformation] not in OPEN_WITHOUT_UNIT else set()
        else:
            deformation = recognise(table, contents, measures, roles)
            name = contents.quantities[deformation]
            measure = next((measure for measure in measures if name in ROLES[measure]), "strain")
            if is_shear and measure == "stretch":
                check_is_shear(table, deformation)
                unnamed |= {deformation}
            measure = "shear" if is_shear and measure in ("strain", "stretch") else measure
        by_unit_alone = measured_in(table.unit(deformation))
        if measure == "displacement" and by_unit_alone == "strain":
            measure = "strain"
        elif (
            measure == "strain" and by_unit_alone == "length" and contents.quantities[deformation] in DEFORMATION_NOUNS
        ):
            measure = "displacement"
        if not is_shear:
            check_machine(table, contents.quantities, deformation, measure)
    if deformation == stress:
        raise InputError(
            f"{table.file}: column {table.label(stress)} cannot be both {measure} and {load}; "
            f"give two columns. {columns_there_are(table)}"
        )
    check_test(table, stress, mapping, is_shear)
    return with_types(table, ColumnChoice(deformation, stress, measure, load, by_unit=frozenset(unnamed)), contents)


def _quantities(
    table: Table, quantities: Sequence[str], axis: str | None, mapping: Mapping[str, str | int]
) -> list[str]:
    """Return what the columns' names say they hold; of the columns of two axes only those of the one asked for."""
    names = list(map(on_axis, quantities))
    axes = _axes_of(names)
    if len(axes) == 2:
        names = on_axes_by_unit(names, [*map(table.unit, range(len(names)))])
    if not mapping:
        names = _without_empty(table, names)
    if axis is not None and axis not in axes:
        raise InputError(
            f"{table.file} has no columns of an axis '{axis}'. {columns_there_are(table)} Leave axis (--axis) out."
        )
    if axis is None and len(axes) == 2 and not mapping:
        loaded = {axis_of_load for axis_of_load, name in names if any(name in ROLES[role] for role in LOADS)}
        if len(loaded & {*axes}) == 1:
            (only,) = loaded & {*axes}
            raise InputError(
                f"{table.file} has deformations along two axes, and a load along axis {only} alone: read that one, "
                f"axis='{only}' (--axis {only}), in the loading mode in which the specimen was stretched, such as "
                "--mode planar where the other axis was held, or equibiaxial where both were stretched alike."
            )
        raise InputError(
            f"{table.file} is of a biaxial test. Say which axis is read: axis='x' (--axis x) or axis='y' (--axis y), "
            "with the loading mode that belongs to it, or read both at once: mode='biaxial' (--mode biaxial). If "
            "numbers in the names are of two specimens, write S1 and S2 there."
        )
    wanted = axis or (axes[0] if len(axes) == 1 else "")
    return [name if axis_of_name in ("", wanted) else "" for axis_of_name, name in names]


def _without_empty(table: Table, names: Sequence[tuple[str, str]]) -> list[tuple[str, str]]:
    """Return names of columns, but none of those that hold the same number throughout where others are like them.

    An axis that is held at its length while the load along it changes (a strip test) keeps its deformation.
    """
    deformations, loads = (frozenset().union(*(ROLES[role] for role in roles)) for roles in (DEFORMATIONS, LOADS))
    filled = list(names)
    is_loaded = {axis for column, (axis, name) in enumerate(names) if name in loads and not table.is_constant(column)}
    for kind in (deformations, loads):
        columns = [column for column, (_, name) in enumerate(names) if name in kind]
        empty = [column for column in columns if table.is_constant(column)]
        if kind is deformations:
            empty = [column for column in empty if not names[column][0] or names[column][0] not in is_loaded]
        if len(empty) < len(columns):
            for column in empty:
                filled[column] = "", ""
    return filled


def _roles_missing(table: Table, mode: LoadingMode) -> InputError:
    roles = ("stretch", "stress", "stretch2", "stress2") if len(mode.controls) > 1 else ("stress", "stress2")
    named = ", or name them 'stretch x', 'stress x', 'stretch y', 'stress y'" if mode.machine_axes else ""
    return InputError(
        f"{table.file}: loading mode '{mode.name}' has {' and '.join(mode.stresses)}, and the file's columns do not "
        f"tell both. {columns_there_are(table)} Say which they are: "
        f"{' '.join(f'--column {role}=NAME' for role in roles)} (in Python columns=){named}."
    )
