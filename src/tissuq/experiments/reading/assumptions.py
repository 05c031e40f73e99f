"""What was assumed where a file does not say it, and the options that say it: units, and the zero of displacements."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from tissuq.experiments.reading.column_units import MPA_ASSUMED
from tissuq.experiments.reading.headings import without_correction
from tissuq.experiments.reading.measured_rows import MeasuredRows, labelled
from tissuq.experiments.reading.measures import STRAIN_MEASURES
from tissuq.experiments.reading.options import ReadingOptions
from tissuq.experiments.reading.plausibility import RATIO_ASSUMED, ZERO_ASSUMED
from tissuq.experiments.reading.recognition import ColumnChoice
from tissuq.experiments.reading.stated_mode import is_torque
from tissuq.experiments.reading.stated_sizes import UNIT_ASSUMED
from tissuq.experiments.reading.table import Table

DOUBTFUL_UNIT, DOUBTFUL_COLUMN = "check the unit:", "check the column:"
"""How warnings begin that come before all others: a wrong unit is a factor of 100 or 1000, a wrong column anything."""


DISC = re.compile(r"(?i)parallel[ -]plate|plate[ -/]plate|platte[ -/]platte|(?<!\w)pp ?\d{1,2}(?![\d.])")
"""Words above a table of a rheometer with a disc between plates, such as ``PP25``."""


def is_doubtful(warning: str) -> bool:
    """Tell whether a warning comes before all others."""
    return DOUBTFUL_UNIT in warning or DOUBTFUL_COLUMN in warning


def assumptions(measured: MeasuredRows, choices: Sequence[ColumnChoice], options: ReadingOptions) -> tuple[str, ...]:
    """Return a sentence about everything that the steps of reading say was assumed, units first."""
    source = "; ".join(measured.steps)
    sentences = []
    if MPA_ASSUMED in source:
        sentences.append(
            f"{DOUBTFUL_UNIT} the file states no unit of stress, so MPa was assumed; say which it is: --stress-unit "
            "kPa, or --stress-unit MPa (in Python unit='kPa' or 'MPa')."
        )
    if RATIO_ASSUMED in source:
        strain = STRAIN_MEASURES[choices[0].strain_type].strain
        largest = float(np.abs(strain(measured.stretch)).max()) if strain else 0.0
        sentences.append(
            f"{DOUBTFUL_UNIT} the file states no unit of strain, and {largest:g} was taken as {100 * largest:.0f} %; "
            "say which it is: --strain-unit % or --strain-unit 1."
        )
    if UNIT_ASSUMED in source:
        sentences.append(
            f"{DOUBTFUL_UNIT} the file states no unit of the sizes of specimens, so that of displacements was assumed, "
            f"{source[: source.index(UNIT_ASSUMED)].split()[-1].lstrip('(')}. If it is another, read one specimen at a "
            'time, and give its sizes: --length "20 mm", --area "10 mm2".'
        )
    for choice in choices:
        roles = {choice.deformation: choice.measure, choice.stress: choice.load}
        names = (_about_name(measured, column, role) for column, role in roles.items() if column in choice.by_unit)
        corrections = (_about_correction(measured.table, column, role) for column, role in roles.items())
        sentences += filter(None, (*names, *corrections))
    if choices[0].measure == "shear" and choices[0].load == "stress" and options.get("stress_type") is None:
        torques = [f"column '{name}' stands" for name in measured.table.names if is_torque(name)]
        discs = [
            f"line {line} says '{' '.join(text.split())}'" for line, text in measured.table.head if DISC.search(text)
        ]
        sentences += [
            f"{seen} beside the shear stress, which a rheometer states as if a twisted disc were of a linear material. "
            "If a disc was twisted, give --stress-type torsion, which corrects it; if not, --stress-type engineering."
            for seen in torques or discs[:1]
        ]
    if ZERO_ASSUMED in source:
        table, columns = measured.table, [choice.deformation for choice in choices]
        about_zero = [
            f"column {table.label(column)} does not begin at 0, and the load there is small: it was taken for "
            "positions, and counted from its first row. To say so give --zero first; if it holds displacements, --zero "
            f"'0 mm'; if it holds the length or height of the specimen, --column 'length={table.key(column)}'."
            for column in columns
        ]
        sentences += labelled(measured.labels, about_zero)
    return tuple(sentences)


def _about_correction(table: Table, column: int, role: str) -> str:
    """Return that a column was read which is the corrected one of two, or of which there is a corrected one."""
    quantity = table.quantities[column]
    name = without_correction(quantity)
    beside = [k for k, same in enumerate(table.quantities) if same != quantity and without_correction(same) == name]
    if not beside:
        return ""
    text = f"{table.label(column)} is read, and not {table.label(beside[0])} beside it"
    return f"{text}; if that one is meant, give --column {role}={table.label(beside[0])}."


def _about_name(measured: MeasuredRows, column: int, role: str) -> str:
    label, taken = measured.table.label(column), f"{role} by its unit alone, for its name is not known"
    if role == "shear":
        if measured.stretch.min() < 0:
            return ""  # as no stretch is
        taken = "amount of shear, because the mode is simple shear and its values begin at 0, as no stretch does"
    return (
        f"{DOUBTFUL_COLUMN} {label} was taken for the {taken}. If it is, "
        f"say so: --column {role}={label}; if another column is, name that one there."
    )
