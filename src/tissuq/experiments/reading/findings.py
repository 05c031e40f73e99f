"""What is strange about the measurements of a file, a check each, with what is proposed and the option that does it."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.polynomial import Polynomial

from tissuq.arrays import FloatArray
from tissuq.experiments.checked_arrays import LARGE_STRETCH
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import Biaxial, Uniaxial
from tissuq.experiments.reading.assumptions import is_doubtful
from tissuq.experiments.reading.axial_stretch import note_of_stretched_tube
from tissuq.experiments.reading.disturbances import scatter_of_neighbours
from tissuq.experiments.reading.experiment_file import Reading
from tissuq.experiments.reading.headings import on_axis
from tissuq.experiments.reading.measured_rows import Cycle, labelled
from tissuq.experiments.reading.plausibility import LEAST_STRAIN, STANDARD_ERRORS, poisson_ratio, readable_shares
from tissuq.experiments.reading.python_form import in_python
from tissuq.experiments.reading.rows_of_tests import advice_on_numbered_tests, jump
from tissuq.experiments.reading.side_by_side import test_beside
from tissuq.experiments.reading.slack import Slack
from tissuq.experiments.reading.table import Column, Table
from tissuq.experiments.reading.vocabulary import CYCLE_NAMES, ROLES
from tissuq.experiments.units import stress_unit
from tissuq.result_warning import ResultWarning, Severity

MIN_ROWS_PER_CYCLE = 10
"""Number of rows that a cycle has on average where cycles are meant, and not a table in any order."""
NOTABLE_SHARE = 0.05
"""Share of the largest stress, or of the range of stretches, that is worth a word."""
ROWS_OF_LINE = 3
"""Measurements next to the reference, at the least, through which a line says the stress there."""
ERRORS_OF_ZERO = 3.0
"""Standard errors of the stress there, by which it must differ from zero."""
NEGLIGIBLE_STRESS = 0.01
"""Share of the largest stress that is none."""
PLAUSIBLE_STRESS = (1e-6, 1e3)
"""Largest stresses, MPa, between which units are hardly mistaken."""
SAME_RATIO = np.radians(5.0)
"""Angle between the strains of two axes within which cycles have the same ratio of them."""
SAME_LOAD = 0.02
"""Range of the stresses over the largest below which the load of a test was held."""
SAME_PEAK = 0.02
"""Difference of the deformations at the peaks of cycles, over the range of the test, within which these are equal."""
MIN_CONTRACTION = 0.2
"""Smallest strain across over that along the axis, of the other sign, of a specimen that is free there: 0.5 of an
isotropic one."""
SHEAR = re.compile(r"(?P<gradient>[fu])_?(12|21|xy|yx)|(?P<tensor>e|ε|epsilon|eps)_?(12|21|xy|yx)|(γ|gamma)_?(12|xy)?")
"""Names of components that shear the plane: of the deformation gradient, of a strain tensor, or the amount of shear."""
NOTABLE_SHEAR = 0.2
"""Amount of shear over the largest strain of an axis that is worth a word: squared stretches at 45 degrees change by a
tenth of what the stretches along the axes change them by."""
REGION_CODES: Mapping[str, tuple[str, Severity]] = {
    "slack": ("slack", Severity.CAUTION),
    "resolution": ("measurements", Severity.NOTE),  # a fit allows for it
}
"""Code and severity of the warnings about kinds of regions, where they are no cautions about the measurements."""
HYSTERESIS = (
    "loading and unloading differ by up to {percent:.0f} % of the largest stress, and an elastic material has one curve"
)
DISTURBED = {"rupture", "hold", "slip"}
"""What makes loading and unloading differ without hysteresis."""


def data_warnings(reading: Reading) -> tuple[ResultWarning, ...]:
    """Return what a person should look at before a fit, of each stress: what was assumed comes first.

    A unit that was assumed may make the answer wrong by a factor of 100 or 1000.
    """
    labels = reading.used.labels
    warnings = [ResultWarning(text, *DOUBTFUL if is_doubtful(text) else CAUTION) for text in reading.notes]
    kinds_and_codes = [(region.kind, region.code) for tested in reading.tested for region in tested.regions]
    for kind, stated in dict.fromkeys(kinds_and_codes):
        of_kind = (
            [region.text for region in tested.regions if (region.kind, region.code) == (kind, stated)]
            for tested in reading.tested
        )
        texts = labelled(labels, [" ".join(sentences) for sentences in of_kind])
        code, severity = REGION_CODES.get(kind, CAUTION)
        warnings += [ResultWarning(text, stated or code, severity) for text in texts if text]
    for check, code_and_severity in CHECKS.items():
        texts = labelled(labels, [check(reading, number) for number in range(len(labels))])
        warnings += [ResultWarning(text, *code_and_severity) for text in texts if text]
    return tuple(warnings)


def experiment_of(reading: Reading) -> Experiment:
    """Return what was read as an experiment that keeps its `data_warnings`, in the forms of Python and the shell."""
    experiment = reading.experiment
    warnings = (warning.in_python(in_python(warning, experiment.stress_unit)) for warning in data_warnings(reading))
    return experiment.labelled(warnings=tuple(warnings))


def _size(reading: Reading, number: int) -> str:
    largest, low, high = float(np.abs(reading.used.stress[number]).max()), *PLAUSIBLE_STRESS
    if low <= largest <= high:
        return ""
    return f"the largest stress is {largest:.3g} MPa: check the units of force and area, or of stress."


def _creep(reading: Reading, number: int) -> str:
    """Return that the only stress of a test rests while the specimen deforms; nothing of others."""
    course, stress = reading.used.course, reading.used.stress[number]
    least, largest = np.sort(np.abs([stress.min(), stress.max()]))
    if len(reading.used.labels) > 1 or np.ptp(course) == 0 or np.ptp(stress) >= SAME_LOAD * largest:
        return ""
    unit, control = reading.tested[number].unit, reading.experiment.mode.controls[0].name
    return (
        f"the stress stays between {least / unit.to_mpa:.4g} and {largest / unit.to_mpa:.4g} {unit.name} while the "
        f"{control} goes from {course.min():.4g} to {course.max():.4g}: the specimen creeps under a load that is held, "
        "as no elastic material does, and one stress tells no curve; or another column is the stress."
    )


def _stretch_size(reading: Reading, number: int) -> str:
    largest = float(reading.used.stretch[number].max())
    if largest <= LARGE_STRETCH:
        return ""
    choice = reading.choices[0]
    if choice.measure == "stretch":
        column = reading.table.label(choice.deformation)
        return (
            f"the largest stretch is {largest:.4g}: see whether column {column} holds stretches, deformed over "
            "undeformed length; where these are in percent, write % in its heading, as in 'stretch (%)'."
        )
    return f"the largest stretch is {largest:.4g}: check the length of the specimen and the unit of the displacement."


def _cycles(reading: Reading, number: int) -> str:
    count, ratios = len(reading.used_cycles), _ratios(reading)
    if not _has_cycles(reading) or ratios == count or reading.used.is_at_several_lengths:
        return ""
    if ratios > 1:
        return (
            f"all {count} cycles are used, which have {ratios} ratios of strains between them: to leave out the first "
            "of those with the same ratio, give --leave-out with their lines."
        )
    numbered = advice_on_numbered_tests(reading.table, reading.choices, reading.recorded.course)
    seen = f"all {count} cycles are used{_change_of_peaks(reading, number)}"
    advice = "to fit one, give --cycle last, first or a number"
    if share := _hysteresis_share(reading, number):
        seen += f", and {HYSTERESIS.format(percent=100 * share)}"
        advice = "to fit one branch of one cycle, give --cycle last --branch loading"
    return f"{seen}; {'; '.join(filter(None, (advice, numbered or _several_specimens(reading, number))))}."


def _several_specimens(reading: Reading, number: int) -> str:
    """Return what else cycles may be whose unloading was not recorded, and whose stresses differ; nothing of others."""
    course, cycles = reading.recorded.course, reading.cycles
    labels = [cycle.label for cycle in cycles for _ in range(cycle.stop - cycle.start)]
    are_named, are_all_used = CYCLE_NAMES & set(reading.table.quantities), len(reading.used_cycles) == len(cycles)
    if are_named or not are_all_used or not jump(labels, course):
        return ""
    difference = _difference_of_cycles(reading, number)
    if difference < NOTABLE_SHARE:
        return ""
    return (
        f"as no unloading between them was recorded, and at one deformation their stresses differ by up to "
        f"{100 * difference:.0f} % of the largest, they may be tests of several specimens: then name the specimen of "
        "every row in a column 'specimen', or write a file for each"
    )


def _difference_of_cycles(reading: Reading, number: int) -> float:
    """Return by how much the stresses of cycles differ as far as all of them go, over the largest stress."""
    course, stress = reading.recorded.course, reading.recorded.stress[number]
    way = np.abs(course - course[0])
    loadings = [rows[np.argsort(way[rows])] for rows in (cycle.rows("loading") for cycle in reading.cycles)]
    reach = min(float(way[rows].max()) for rows in loadings)
    reached = [float(np.interp(reach, way[rows], stress[rows])) for rows in loadings]
    return float(np.ptp(reached) / max(float(np.abs(stress).max()), np.finfo(float).tiny))


def _change_of_peaks(reading: Reading, number: int) -> str:
    """Return by how much the stress at the peaks of equal cycles changes, as a clause; nothing where it hardly does."""
    if DISTURBED.intersection(region.kind for region in reading.tested[number].regions):
        return ""
    peaks = [cycle.peak for cycle in reading.used_cycles]
    reached, stress = reading.used.course[peaks], reading.used.stress[number][peaks]
    largest = float(np.abs(reading.used.stress[number]).max())
    change = (abs(stress[-1]) - abs(stress[0])) / max(largest, np.finfo(float).tiny)
    if np.ptp(reached) > SAME_PEAK * np.ptp(reading.used.course) or abs(change) < NOTABLE_SHARE:
        return ""
    how = "falls" if change < 0 else "rises"
    return f", at whose peaks the stress {how} by {100 * abs(change):.0f} % of the largest from the first to the last"


def _has_cycles(reading: Reading) -> bool:
    """Return whether there are several cycles of enough rows to be some."""
    count = len(reading.used_cycles)
    return count > 1 and len(reading.used) >= MIN_ROWS_PER_CYCLE * count


def _ratios(reading: Reading) -> int:
    """Return how many ratios of the strains of its axes the cycles of a test turn at: several are a protocol."""
    strains = reading.used.stretch[:, [cycle.peak for cycle in reading.used_cycles]] - 1
    angles = np.sort(np.arctan2(*strains)) if len(strains) == 2 else np.zeros(1)
    return 1 + int(np.count_nonzero(np.diff(angles) > SAME_RATIO))


def _hysteresis(reading: Reading, number: int) -> str:
    if _has_cycles(reading) and _ratios(reading) == 1:
        return ""  # said of the cycles
    share = _hysteresis_share(reading, number)
    seen = HYSTERESIS.format(percent=100 * share)
    return f"{seen}; to fit one of them, give --branch loading or unloading." if share else ""


def _hysteresis_share(reading: Reading, number: int) -> float:
    """Return by how much loading and unloading differ, over the largest stress; zero where that is not worth a word."""
    if DISTURBED.intersection(region.kind for region in reading.tested[number].regions):
        return 0.0
    course, stress = reading.used.course, reading.used.stress[number]
    share = max(_gap_of_branches(course, stress, cycle) for cycle in reading.used_cycles)
    share /= max(float(np.abs(stress).max()), np.finfo(float).tiny)
    return share if share >= NOTABLE_SHARE else 0.0


def _gap_of_branches(course: Column, stress: Column, cycle: Cycle) -> float:
    """Return by how much the stresses of loading and unloading differ in a cycle; zero where none are comparable."""
    branches = [cycle.rows("loading"), cycle.rows("unloading")]
    if min(map(len, branches)) < MIN_ROWS_PER_CYCLE / 2:
        return 0.0
    ordered = [rows[np.argsort(course[rows])] for rows in branches]
    low = max(course[rows[0]] for rows in ordered)
    high = min(course[rows[-1]] for rows in ordered)
    if (
        min(np.count_nonzero((course[rows] >= low) & (course[rows] <= high)) for rows in ordered)
        < MIN_ROWS_PER_CYCLE / 2
    ):
        return 0.0  # tension and compression one after another, of which a jump joins the two
    grid = np.linspace(low, high, 50)
    loading, unloading = (np.interp(grid, course[rows], stress[rows]) for rows in ordered)
    return float(np.abs(loading - unloading).max())


def _nearest_to_reference(reading: Reading) -> tuple[FloatArray, int]:
    """Return how far every measurement is from the reference, and which is the nearest."""
    mode, points = reading.experiment.mode, reading.experiment.stretch
    change = np.abs((points - mode.reference).reshape(len(points), -1)).max(axis=1)
    return change, int(np.argmin(change))


def _reference(reading: Reading, number: int) -> str:
    change, nearest = _nearest_to_reference(reading)
    if change[nearest] <= NOTABLE_SHARE * change.max() or reading.used.axial_stretch is not None:
        return ""
    control, points = reading.tested[number].control, reading.experiment.stretch
    if points.ndim == 1 and points.min() < reading.experiment.mode.reference < points.max():
        return ""  # between measurements, which says neither where the test begins nor what its zero is
    begin = reading.used.stretch[number][nearest]
    return f"the measurements begin at {control.name} {begin:.4g}, not near {control.reference:g}."


def _stress_at_rest(reading: Reading, number: int) -> str:
    change, nearest = _nearest_to_reference(reading)
    gap = float(change[nearest])
    if gap > NOTABLE_SHARE * change.max():
        return ""
    stretch, stress, points = reading.used.stretch[number], reading.used.stress[number], reading.experiment.stretch
    unit, control = stress_unit(reading.experiment.stress_unit), reading.tested[number].control
    at_reference, largest = float(stress[nearest]), float(np.abs(stress).max())
    at_rest, standard_error = at_reference, scatter_of_neighbours(stress)
    if points.ndim == 1 and gap > 0:  # what a line through the measurements next to the reference has there
        rows = change <= max(ROWS_OF_LINE * gap, np.sort(change)[min(ROWS_OF_LINE, len(change)) - 1])
        away = points[rows] - reading.experiment.mode.reference
        at_rest = float(Polynomial.fit(away, stress[rows], 1)(0.0))
        standard_error *= np.sqrt(1 / len(away) + away.mean() ** 2 / ((away - away.mean()) ** 2).sum())
    sign = np.sign(at_reference)
    if min(sign * at_reference, sign * at_rest) <= max(NOTABLE_SHARE * largest, ERRORS_OF_ZERO * standard_error):
        return ""
    options = f"--load-zero {_load_zero(reading, number, nearest, at_rest / at_reference)}"
    beside = ""
    if slack := _slack_without(reading, number, at_rest):
        options += " --preload auto"
        beside = (
            f", and slack: without it the first {slack.rows} rows carry no load that shows, until the {control.name} "
            f"is {slack.stretch:.4g}"
        )
    return (
        f"at {control.name} {stretch[nearest]:.4g} the stress is already {at_reference / unit.to_mpa:.3g} {unit.name}, "
        f"{100 * abs(at_reference) / largest:.0f} % of the largest: a preload, or the zero of the load cell, which "
        f"{options} takes off{beside}. A hyperelastic material has no stress at {control.name} {control.reference:g}."
    )


def _slack_without(reading: Reading, number: int, at_rest: float) -> Slack | None:
    """Return the slack of a test that is stretched once, if its stress at rest is taken off; None where none shows."""
    if len(reading.used_cycles) > 1 or reading.used.stretch[number].min() < 1:
        return None
    tested = reading.tested[number]
    return replace(tested, used=replace(tested.used, stress=tested.used.stress - at_rest)).slack


def _load_zero(reading: Reading, number: int, row: int, share: float) -> str:
    """Return what takes off a share of the load in a row, as the file has it."""
    table, column = reading.used.table, reading.choices[number].stress
    (values,) = table.taken(np.array([row])).numbers([column])
    unit = table.unit(column)
    return f'"{share * values[0]:.4g} {unit}"' if unit and reading.used.rows[row] else "first"


def _diameter(reading: Reading, number: int) -> str:
    """Return a sentence about a tube that without pressure is not as wide as it is said to be."""
    if reading.choices[number].load != "pressure":
        return ""
    stretch, stress = reading.used.stretch[number], np.abs(reading.used.stress[number])
    row, axial = int(np.argmin(stress)), reading.used.axial_stretch
    if stress[row] > NEGLIGIBLE_STRESS * stress.max():
        return ""
    narrow = 1.0 if axial is None else float(axial[row]) ** -0.5
    start = (
        f"in {reading.used.table.counted} {reading.used.table.lines[row]} the tube has hardly any pressure, and the "
        f"hoop stretch {stretch[row]:.4g}"
    )
    if abs(narrow - 1) > NOTABLE_SHARE:
        if abs(stretch[row] - 1) >= abs(stretch[row] - narrow):
            return ""
        return (
            f"{start} at an axial stretch of {narrow**-2:.4g}, where a wall without fibres has {narrow:.4g}: check "
            "that --diameter and --thickness are those of the tube when it is neither stretched nor inflated."
        )
    if abs(stretch[row] - narrow) <= NOTABLE_SHARE * np.ptp(stretch):
        return ""
    return f"{start} instead of 1: check that its undeformed outer diameter is --diameter."


def _stretched_tube(reading: Reading, number: int) -> str:
    axial = reading.used.axial_stretch
    load = reading.choices[-1].load if len(reading.choices) > 1 else ""
    return "" if axial is None else note_of_stretched_tube(axial, load)


def _other_axis(reading: Reading, number: int) -> str:
    """Return a sentence about a biaxial test that is read as uniaxial."""
    table, choice, mode = reading.table, reading.choices[number], reading.experiment.mode
    axis, _ = on_axis(table.quantities[choice.deformation])
    if not axis or not isinstance(mode.along_axis_1, Uniaxial) or test_beside(table, choice.stress, mode, {}):
        return ""
    names = enumerate(map(on_axis, table.quantities))
    across = [(column, name) for column, (name_axis, name) in names if name_axis not in ("", axis)]
    forces = (column for column, name in across if name in ROLES["force"])
    strains = (column for column, name in across if name in ROLES["stretch"] | ROLES["strain"])
    if (column := next(forces, None)) is not None and _is_loaded(table, choice.stress, column):
        doubt = f"{table.label(column)} carries force, too, so the test is not uniaxial"
    elif (column := next(strains, None)) is not None and _is_held(reading, number, column):
        doubt = f"{table.label(column)} does not become narrower as in a uniaxial test"
    else:
        return ""
    return (
        f"column {doubt}: give --mode biaxial to read both axes, planar if this one was held, or equibiaxial with one "
        "of them if both were stretched alike."
    )


def _shear(reading: Reading, _: int) -> str:
    """Return a sentence about a biaxial test whose sheet was sheared, too."""
    if not isinstance(reading.experiment.mode, Biaxial):
        return ""
    table, amounts = reading.used.table, dict[str, dict[int, Column]]()
    for column, quantity in enumerate(table.quantities):
        component = SHEAR.fullmatch(quantity)
        values = readable_shares(table, column) if component else None
        if component and values is not None and values.any():
            of_one_measure = amounts.setdefault(component["gradient"] or quantity, {})
            of_one_measure[column] = (2 if component["tensor"] else 1) * values
    strain = max(float(np.abs(stretch - 1).max()) for stretch in reading.used.stretch)
    largest = max((float(np.abs(sum(of_one.values())).max()) for of_one in amounts.values()), default=0.0)
    if largest <= NOTABLE_SHEAR * strain:
        return ""
    columns = [column for of_one in amounts.values() for column in of_one]
    several = len(columns) > 1
    return (
        f"column{'s' * several} {' and '.join(map(table.label, columns))} say{'s' * (not several)} that the sheet was "
        f"sheared, too, by up to {largest:.2g} beside strains of up to {strain:.2g}; a biaxial test is read without "
        "shear, which fibres that lie across feel. Fit tests, or rows, with less of it, mounted along the axes of the "
        "tissue."
    )


def _is_loaded(table: Table, stress: int, column: int) -> bool:
    """Tell whether a column of forces across is a notable share of those along the axis."""
    along, across = (float(np.abs(numbers).max()) for numbers in table.numbers([stress, column]))
    return across >= NOTABLE_SHARE * along


def _is_held(reading: Reading, number: int, column: int) -> bool:
    """Tell whether a column of stretches or strains across hardly falls while those along the axis rise."""
    table, along = reading.used.table, np.log(reading.used.stretch[number])
    values = readable_shares(table, column)
    if values is None:
        return False
    stretch = values if on_axis(table.quantities[column])[1] in ROLES["stretch"] else 1 + values
    if stretch.min() <= 0 or np.abs(along).max() < LEAST_STRAIN:
        return False
    ratio, error = poisson_ratio(along, np.log(stretch))
    return ratio + STANDARD_ERRORS * error < MIN_CONTRACTION


CAUTION, NOTE = ("measurements", Severity.CAUTION), ("measurements", Severity.NOTE)
DOUBTFUL = "doubtful-reading", Severity.PROBLEM
CHECKS: Mapping[Callable[[Reading, int], str], tuple[str, Severity]] = {
    _other_axis: CAUTION,
    _shear: CAUTION,
    _creep: DOUBTFUL,
    _size: CAUTION,
    _stretch_size: CAUTION,
    _cycles: CAUTION,
    _hysteresis: CAUTION,
    _stress_at_rest: ("stress-at-rest", Severity.CAUTION),
    _reference: NOTE,
    _diameter: CAUTION,
    _stretched_tube: NOTE,
}
