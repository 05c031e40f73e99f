"""Standard deviations and errors beside the mean stress of several specimens: their columns, and the error of that."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
from scipy.special import ndtri, stdtrit

from tissuq.errors import InputError
from tissuq.experiments.reading.headings import is_of_mean, of_spread, plain, without_mean
from tissuq.experiments.reading.loads import Load
from tissuq.experiments.reading.recognition import PRESSURE, ColumnChoice, find_column
from tissuq.experiments.reading.table import Column, Table
from tissuq.experiments.reading.vocabulary import (
    COUNT_NAMES,
    LOWER_ENDS,
    ROLE_OF_AXIAL_STRETCH,
    ROLES,
    SPREADS,
    STATED_COUNT,
    UPPER_ENDS,
)
from tissuq.experiments.units import FORCE, measured_in, stress_unit

UPPER = 0.975
"""Upper end of an interval of 95 %."""
MOST_ROWS = 0.9
"""Share of the rows from which on a stress that lies between two columns is taken to be the middle of error bars."""


@dataclass(frozen=True, eq=False)
class Spread:
    """Standard errors (n,) of the mean stress, MPa, zero where there are none; their column, what it holds, and how.

    ``problem`` says why a column is not used, or two columns of ends of error bars; otherwise ``column`` is None where
    there is none.
    """

    column: int | None = None
    kind: str = ""
    standard_error: Column | float = 0.0
    source: str = ""
    problem: str = ""


def spread_of(
    table: Table, choice: ColumnChoice, mapping: Mapping[str, str | int], load: Load, mean_of: int | None
) -> Spread:
    """Return the standard errors of a column of stresses that are means of several specimens.

    A column of standard errors goes before one of standard deviations, which over sqrt(n) are standard errors. Those of
    n specimens are themselves uncertain: they are multiplied by the 97.5 % quantile of Student's t with n - 1 degrees
    of freedom over that of the normal distribution, so that normal errors of this size are as wide. A column that is
    known by its name and cannot be used is passed over, with the problem.

    Parameters
    ----------
    table : Table
    choice : ColumnChoice
        The stress, and what it is drawn against.
    mapping : mapping
        From the roles ``sem``, ``sd`` and ``n`` to columns that are given.
    load : Load
    mean_of : int, optional
        The number of specimens.

    Raises
    ------
    InputError
        When a column that is given cannot be used.
    """
    wanted = next((kind for kind in SPREADS if kind in mapping), None)
    is_of_tube = choice.load == PRESSURE or choice.measure == ROLE_OF_AXIAL_STRETCH
    if choice.stress_type == "torsion" or is_of_tube:
        of_load = f"the {choice.load.replace('_', ' ')} in a tube" if is_of_tube else "the torque of a disc"
        if wanted or mean_of is not None:
            option = f"--column {wanted}={mapping[wanted]}" if wanted else f"mean_of={mean_of} (--mean-of)"
            raise InputError(f"{table.file}: {option} is for stresses or forces, not for {of_load}. Leave it out.")
        spread = _recognised(table, choice)
        if spread.column is None:
            return spread
        unused = f"column {table.label(spread.column)} is not used: standard deviations and standard errors"
        return replace(spread, problem=f"{unused} are taken of stresses or forces, not of {of_load}.")
    spread = Spread(find_column(table, wanted, mapping[wanted]), wanted) if wanted else _recognised(table, choice)
    if spread.column is None and mean_of is not None:
        raise InputError(
            f"{table.file}: mean_of={mean_of} (--mean-of) is for standard deviations beside a mean, and no column is "
            "recognised as such. Say which it is (--column sd=NAME), or leave it out."
        )
    if spread.column is None or spread.problem:
        return spread
    try:
        return _with_errors(table, choice, spread, mapping, load, mean_of)
    except InputError as error:
        if wanted:
            raise
        return replace(spread, problem=f"{error} So the column is not used.")


def _recognised(table: Table, choice: ColumnChoice) -> Spread:
    """Return the column whose name says that it is of the spread of the stresses: of several the next to the right.

    Where some columns are of means, those of others have none.
    """
    quantities = table.quantities
    of_stress = quantities[choice.stress]
    ends = set(chain(*_ends(table, choice)))
    is_mean = [is_of_mean(quantity) for column, quantity in enumerate(quantities) if column not in ends]
    if any(is_mean) and not is_of_mean(of_stress):
        return Spread()
    by_kind: dict[str, list[int]] = {}
    for column in range(len(table.names)):
        kind, of_what = of_spread(quantities[column])
        is_of_load = measured_in(table.unit(column)) in ("", choice.load) and of_what in (
            "",
            without_mean(of_stress),
            *ROLES[choice.load],
        )
        if kind and is_of_load and column not in ends and table.has_numbers(column):
            by_kind.setdefault(kind, []).append(column)
    for kind in (*SPREADS, ""):
        columns = by_kind.get(kind or "open", [])
        following = [column for column in columns if column > choice.stress]
        if columns:
            column = min(following or columns)
            label, key = table.label(column), table.key(column)
            problem = (
                f"column {label} may hold standard deviations or standard errors of the stress, and is not used. Say "
                f"which: --column 'sem={key}', or --column 'sd={key}' with the number of specimens "
                f"({_option_of_count(table)})."
            )
            return Spread(column, kind, problem="" if kind else problem)
    return Spread(problem=_ends_of_error_bars(table, choice))


def _ends(table: Table, choice: ColumnChoice) -> tuple[list[int], list[int]]:
    """Return the columns that may be of the upper ends of error bars, and of the lower ones."""
    others = [column for column in range(len(table.names)) if column not in (choice.stress, choice.deformation)]
    upper = [column for column in others if UPPER_ENDS.search(table.quantities[column])]
    with_minus = {plain(table.quantities[column].replace("+", " ")) for column in upper}  # a minus reads as a blank
    is_lower = {column: LOWER_ENDS.search(table.quantities[column]) for column in others}
    lower = [column for column in others if is_lower[column] or table.quantities[column] in with_minus]
    return upper, [column for column in lower if column not in upper]


def _ends_of_error_bars(table: Table, choice: ColumnChoice) -> str:
    """Return in words that two columns are error bars, which are not read; empty where no two are."""
    for upper, lower in zip(*_ends(table, choice), strict=False):
        try:
            above, below, stress = table.numbers([upper, lower, choice.stress])
        except InputError:
            continue
        names = table.label(upper), table.label(lower)
        if ((below <= stress) & (stress <= above) & (below < above)).mean() > MOST_ROWS:
            half = "half of {} - {}".format(*names)
        elif "err" in table.quantities[upper] and (np.minimum(above, below) >= 0).all():
            half = "the mean of {} and {}".format(*names)
        else:
            continue
        return (
            f"columns {' and '.join(names)} look like error bars of the stress, and are not used. If they are, write "
            f"{half} into a column 'SEM' (standard errors of a mean), or 'SD' (standard deviations between specimens) "
            f"with their number ({_option_of_count(table)})."
        )
    return ""


def _option_of_count(table: Table) -> str:
    """Return the option for the number of specimens: with that which a line above the table or a name states."""
    above = [(f"{table.counted} {number}", text) for number, text in table.head]
    lines = [*above, *(("a name", name) for name in table.names)]
    for place, text in lines:
        if match := STATED_COUNT.search(text):
            number = match["number"] or match["specimens"]
            return f"--mean-of {number}, if that is what {place} means by '{match[0].strip()}'"
    return "--mean-of 6"


def _with_errors(
    table: Table,
    choice: ColumnChoice,
    spread: Spread,
    mapping: Mapping[str, str | int],
    load: Load,
    mean_of: int | None,
) -> Spread:
    """Return the spread with its standard errors."""
    column = spread.column or 0
    label, (values,) = table.label(column), table.numbers([column])
    if (values < 0).any():
        row = int(np.argmax(values < 0))
        raise InputError(
            f"{table.place(column, row)}: {values[row]:g} is negative, which no {SPREADS[spread.kind]} is."
        )
    count, count_source = _count(table, mapping, mean_of)
    scale, unit_source = _scale(table, choice, column, load)
    source = f"standard error of the mean = column {label} in {unit_source}"
    if count is not None:
        of_sd = np.sqrt(count) if spread.kind == "sd" else 1.0
        values = values / of_sd * stdtrit(count - 1, UPPER) / ndtri(UPPER)
        over = " / sqrt(n)" if spread.kind == "sd" else ""
        source += f"{over} x t(n - 1)/1.96 (Student's t at 97.5 %), n = {count_source}"
    elif spread.kind == "sd":
        raise InputError(
            f"{table.place(column)} is taken for standard deviations between specimens. How far their mean may be off "
            f"is the standard error, sd / sqrt(n): give the number of specimens ({_option_of_count(table)}), or if "
            f"these are standard errors --column 'sem={table.key(column)}'."
        )
    return replace(spread, standard_error=values * scale, source=source)


def _count(table: Table, mapping: Mapping[str, str | int], mean_of: int | None) -> tuple[Column | None, str]:
    """Return the number of specimens in every row, or of all, and where it comes from; None where nobody says it."""
    if mean_of is not None:
        return np.array(float(mean_of)), f"{mean_of} (as given)"
    columns = [column for column, quantity in enumerate(table.quantities) if COUNT_NAMES.fullmatch(quantity)]
    if "n" in mapping:
        columns = [find_column(table, "n", mapping["n"])]
    if len(columns) != 1:
        return None, ""
    (counts,) = table.numbers(columns)
    is_count = bool((counts == np.round(counts)).all() and counts.min() >= 2)
    is_number_of_row = len(counts) > 1 and bool((np.diff(counts) == 1).all())
    if not is_count or is_number_of_row:
        if "n" in mapping:
            raise InputError(f"{table.place(columns[0])} holds no numbers of specimens, which are 2 or more.")
        return None, ""
    return counts, f"column {table.label(columns[0])}"


def _scale(table: Table, choice: ColumnChoice, column: int, load: Load) -> tuple[float, str]:
    """Return what one unit of a column of spreads is in MPa, and where its unit comes from."""
    unit = table.unit(column)
    if measured_in(unit) != choice.load:
        return load.scale, f"the unit of {table.label(choice.stress)}"
    if load.divided is not None:
        return load.divided.factor(unit) / load.by, f"{unit} / {load.by:g} {'mm2' if load.divided is FORCE else 'mm'}"
    return stress_unit(unit).to_mpa, f"{unit} (from the file)"
