"""Files of tests with two stresses: the columns and dimensions of each, and the rows that both of them keep."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import reduce

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments.modes import LoadingMode
from tissuq.experiments.modes.mode import SHEAR
from tissuq.experiments.reading.columns import (
    DEFORMATIONS,
    LOADS,
    ColumnChoice,
    axes_of,
    choose_columns,
    columns_there_are,
)
from tissuq.experiments.reading.dimensions import Dimensions
from tissuq.experiments.reading.measures import initial_size
from tissuq.experiments.reading.table import Table
from tissuq.experiments.reading.table_rows import Column, Curve

__all__ = ["choose_every", "dimensions_of_axes", "of_the_second", "on_same_rows", "told_once", "told_steps"]

OTHER_WAY = {"length": "width", "width": "length"}
"""What the undeformed sizes along the first and the second axis are to the second one."""


def choose_every(
    table: Table, mode: LoadingMode, columns: Mapping[str, str | int] | None, stress_type: str, axis: str | None
) -> dict[str, ColumnChoice]:
    """Return the columns of every stress of a mode, by what it is called; of a mode with one by "".

    Those of a second stress are found by the axis in their names, or given in roles that end in 2.

    Raises
    ------
    InputError
        When a role or column does not exist, several columns fit, or none does.
    """
    is_shear = mode.controls == (SHEAR,)
    if len(mode.stresses) == 1:
        return {"": choose_columns(table, columns, stress_type, axis, is_shear)}
    if axis is not None:
        raise InputError(f"loading mode '{mode.name}' reads both axes; leave axis (--axis) out, or give another mode.")
    has_two_controls = len(mode.controls) > 1
    further = (*DEFORMATIONS, *LOADS) if has_two_controls else ("stress",)
    own = dict(columns or {})
    given = {role: own.pop(f"{role}2") for role in further if f"{role}2" in own}
    is_of_axes = bool(mode.machine_axes) and axes_of(table) == list(mode.machine_axes)
    if not is_of_axes and not (given.keys() & LOADS and (given.keys() & DEFORMATIONS or not has_two_controls)):
        raise _not_told(table, mode)
    names = mode.machine_axes if is_of_axes else (None, None)
    labels = [f"axis {name}" for name in names] if is_of_axes else list(mode.stresses)
    first = choose_columns(table, own, stress_type, names[0], is_shear)
    with of_the_second(labels, mode):
        shared: dict[str, str | int] = {} if has_two_controls else {first.measure: first.deformation + 1}
        second = choose_columns(table, shared | given, stress_type, names[1], is_shear)
    _check_pair(table, mode, first, second)
    return dict(zip(labels, (first, second), strict=True))


@contextmanager
def of_the_second(labels: Sequence[str], mode: LoadingMode) -> Iterator[None]:
    """Add to what is wrong that it is about the second stress, and how its columns and dimensions are given."""
    try:
        yield
    except InputError as error:
        sizes = " Along it the specimen measures --width, and across it --length." if mode.machine_axes else ""
        raise InputError(
            f"{error} (This is about {labels[1]}: roles of its columns end in 2, as in --column stress2=NAME.{sizes})"
        ) from error


def dimensions_of_axes(
    table: Table, dimensions: Dimensions, choices: Sequence[ColumnChoice], deformations: Sequence[Column]
) -> list[Dimensions]:
    """Return the dimensions that belong to each of two axes.

    The specimen's length is that along the first axis, its width that along the second one; each is the width of the
    other axis. Where neither the user nor the lines above the table say them, the file's columns of sizes may.

    Raises
    ------
    InputError
        When a diameter is given.
    """
    if "diameter" in dimensions.given:
        raise InputError(
            f"{table.file}: the cross-sections of two axes do not follow from a diameter. Give thickness, and length "
            "and width (the undeformed sizes along the first and the second axis) where the file does not say them."
        )
    own = replace(dimensions, known={name: size for name, size in dimensions.known.items() if name != "diameter"})
    pair = [own, _turned(own)]
    found = []
    for each, choice, other, moved in zip(pair, choices, choices[::-1], deformations[::-1], strict=True):
        unneeded = {"length"} if choice.measure != "displacement" and other.load == "force" else set()
        unneeded |= {"width"} if choice.load != "force" and other.measure == "displacement" else set()
        known = dict(each.known)
        is_sought = "width" not in known and ("area" not in known or "thickness" in each.given)
        if other.measure == "displacement" and is_sought:
            size = initial_size(table, other, moved)
            known |= {"width": size} if size else {}
        found.append(replace(each, known=known, given=each.given - unneeded))
    return found


def on_same_rows(curves: Sequence[Curve], reason: str) -> list[Curve]:
    """Return the curves with only the rows that each of them has kept; the others are dropped for a reason.

    Raises
    ------
    InputError
        When there is none.
    """
    common = reduce(np.intersect1d, [curve.rows for curve in curves])
    if not len(common):
        raise InputError(
            f"{curves[0].table.file}: no row is left, for all are {reason}. Give a lower --preload, or another --cycle."
        )
    return [curve.kept(np.flatnonzero(np.isin(curve.rows, common)), reason) for curve in curves]


def told_once(labels: Sequence[str], texts: Sequence[str]) -> list[str]:
    """Return what is told of every stress: once where it is the same for all, else each with what it is of."""
    if len(set(texts)) == 1:
        return [texts[0]]
    return [f"{label}: {text}" for label, text in zip(labels, texts, strict=True) if text]


def told_steps(labels: Sequence[str], curves: Sequence[Curve]) -> list[str]:
    """Return the steps of all curves in their order."""
    return [text for texts in zip(*(curve.steps for curve in curves), strict=True) for text in told_once(labels, texts)]


def _not_told(table: Table, mode: LoadingMode) -> InputError:
    roles = ("stretch", "stress", "stretch2", "stress2") if len(mode.controls) > 1 else ("stress", "stress2")
    named = ", or name them 'stretch x', 'stress x', 'stretch y', 'stress y'" if mode.machine_axes else ""
    return InputError(
        f"{table.file}: loading mode '{mode.name}' has {' and '.join(mode.stresses)}, and the file's columns do not "
        f"tell both. {columns_there_are(table)} Say which they are: "
        f"{' '.join(f'--column {role}=NAME' for role in roles)} (in Python columns=){named}."
    )


def _check_pair(table: Table, mode: LoadingMode, first: ColumnChoice, second: ColumnChoice) -> None:
    """Refuse one column for both, and forces and displacements where the mode does not say what they do."""
    pairs = [(first.stress, second.stress)]
    pairs += [(first.deformation, second.deformation)] * (len(mode.controls) > 1)
    for one, other in pairs:
        if one == other:
            raise InputError(
                f"{table.file}: column {table.label(one)} cannot be that of both {' and '.join(mode.stresses)}. Say "
                "which is the second one's: --column stretch2=NAME, --column stress2=NAME."
            )
    if mode.machine_axes:
        return
    for each in (first, second):
        for column, kind in ((each.deformation, each.measure), (each.stress, each.load)):
            if kind in ("displacement", "force"):
                raise InputError(
                    f"{table.place(column)} holds a {kind}, and in loading mode '{mode.name}' columns are read as "
                    "stretch, strain or shear, and as stress. Convert it, and give its column as one of them."
                )


def _turned(dimensions: Dimensions) -> Dimensions:
    """Return the dimensions as the second axis has them."""

    def turned(name: str) -> str:
        return OTHER_WAY.get(name, name)

    return replace(
        dimensions,
        known={turned(name): size for name, size in dimensions.known.items()},
        given=frozenset(map(turned, dimensions.given)),
        unclear={turned(name): text for name, text in dimensions.unclear.items()},
    )
