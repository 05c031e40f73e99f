"""What was understood of files, for the page: tests with their curves, findings, and questions with their answers."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.errors import TissuqError
from tissuq.experiments.modes import LoadingMode, loading_mode, loading_modes
from tissuq.experiments.reading.inspection import Inspection, overview
from tissuq.experiments.reading.stated_mode import DEFAULT_SOURCE
from tissuq.experiments.reading.vocabulary import ROLE_OF_AXIAL_STRETCH
from tissuq.experiments.units import stress_unit
from tissuq.studies.answers import Answer, answers_in, with_options
from tissuq.studies.files_of_tests import find_tests, tables_of, tests_in_words

if TYPE_CHECKING:
    from tissuq.experiments.reading.experiment_file import Reading
    from tissuq.experiments.reading.table import Column, Table

MAX_POINTS = 1500
"""Points of a curve that are drawn."""
MAX_ANSWERS, MAX_SHOWN = 12, 6
"""Answers to one question, and how many of them are not folded."""
MIN_LETTERS = 25
"""Below which what is left of a message without its options says too little."""
SECONDS_TO_TRY = 2.0
"""After which no more answers to a question are tried to see what they would give."""
EXAMPLE_ROWS = 4
MODE = "Nothing says in which loading mode this was measured, so uniaxial was assumed. Which is it?"
WORDS = {
    "mode": "it was loaded in mode {}", "stress-unit": "stresses are in {}", "strain-unit": "strains are in {}",
    "force-unit": "forces are in {}", "displacement-unit": "displacements are in {}", "sheet": "take sheet {}",
    "table": "take table {}", "only": "take the rows where {}", "cycle": "take cycle {}", "branch": "take only {}",
    "zero": "displacement counts from {}", "load-zero": "the load counts from {}", "turn": "change the sign of: {}",
    "preload": "the specimen is taut at {}", "strain-type": "it is {} strain", "stress-type": "it is {} stress",
    "incompressible": "take its volume as constant all the same",
    "until-peak": "leave out what follows the largest stress", "leave-out": "leave out line {}",
    "relaxed": "take the end of every rest only",
    "compression-positive": "compression is positive in the file", "axis": "take axis {}",
    "every": "take every {}th row",
    "tension-positive": "tension is positive in the file", "stretch": "take stretches {}",
}  # fmt: skip
"""What options mean, for a person who clicks on them."""


def account(files: Sequence[str], reading: Mapping[str, Any], modes: Sequence[str | None]) -> dict[str, Any]:
    """Return what was understood of files, or why they are not, in plain data.

    Parameters
    ----------
    files : sequence of str
        In the current folder.
    reading : mapping
        Settings of how all are read.
    modes : sequence of str or None
        The loading mode of each; None where it is to say itself.
    """
    paths = list(map(Path, files))
    tables = {file: list(map(_table, tables_of(Path(file), reading))) for file in files}
    columns = {
        file: list(dict.fromkeys(column["name"] for table in of_file for column in table["columns"]))
        for file, of_file in tables.items()
    }
    record: dict[str, Any] = {"tables": tables, "text": "", "tests": [], "findings": [], "questions": [], "error": None}
    tests: list[tuple[dict[str, Any], Reading]] = []
    for path, mode in zip(paths, modes, strict=True):
        try:
            tests += find_tests(path, {**reading, "mode": mode}, paths)
        except TissuqError as refusal:
            settings, start = {**reading, "mode": mode}, perf_counter()
            doubt = _question(path, str(refusal), columns[str(path)], settings, paths, start, refused=True)
            record["error"] = doubt | {"file": str(path)}
            break
    start = perf_counter()
    if tests and not record["error"]:
        inspections = [Inspection(of_test) for _, of_test in tests]
        record["text"] = str(inspections[0]) if len(tests) == 1 else overview(inspections)
        pairs = list(zip(tests, inspections, strict=True))
        record["tests"] = [_test(settings, inspection) for (settings, _), inspection in pairs]
        texts = {text: str(settings["file"]) for (settings, _), inspection in pairs for text in inspection.warnings}
        record["findings"] = [_finding(text, columns[file], reading) for text, file in texts.items()]
        stated = dict(zip(files, modes, strict=True))
        for settings, of_test in tests:
            path, mode = Path(settings["file"]), stated.get(str(settings["file"]))
            for text in of_test.doubts:
                if text not in [question["text"] for question in record["questions"]]:
                    doubt = _question(path, text, columns[str(path)], {**reading, "mode": mode}, paths, start)
                    record["questions"] += [doubt | {"file": str(path)}] if doubt["answers"] else []
        silent = [str(settings["file"]) for settings, of_test in tests if of_test.mode_source == DEFAULT_SOURCE]
        if silent:
            answers = [
                {"label": mode.name, "gives": mode.description, "settings": {"mode": mode.name}, "asked_for": []}
                for mode in modes_of_specimens()
            ]
            record["questions"].append({"text": MODE, "plain": MODE, "answers": answers, "shown": 1, "file": silent[0]})
    return record


def modes_of_specimens() -> list[LoadingMode]:
    """Return every loading mode, and at the end those of specimens that were cut along axis 2 of the tissue."""
    kinds = loading_modes()
    along_axis_2 = [f"{name}@2" for name, kind in kinds.items() if kind.has_axis]
    return [loading_mode(name) for name in (*kinds, *along_axis_2)]


def _table(table: Table) -> dict[str, Any]:
    units = [*table.units, *[""] * (len(table.names) - len(table.units))]
    names = [{"name": table.key(column), "unit": units[column]} for column in range(len(table.names))]
    return {"sheet": table.sheet, "number": table.number, "columns": names, "rows": table.rows[:EXAMPLE_ROWS]}


def _test(settings: Mapping[str, Any], inspection: Inspection) -> dict[str, Any]:
    reading = inspection.reading
    experiment = reading.experiment
    roles: dict[str, str] = {}
    for number, choice in enumerate(reading.choices, start=1):
        is_of_tube = choice.measure == ROLE_OF_AXIAL_STRETCH
        suffix = "2" if number > 1 and not is_of_tube else ""
        if not is_of_tube:
            roles[reading.table.key(choice.deformation)] = choice.measure + suffix
        roles[reading.table.key(choice.stress)] = choice.load + suffix
    if reading.axial_column is not None:
        roles[reading.table.key(reading.axial_column)] = ROLE_OF_AXIAL_STRETCH
    return {
        "name": experiment.name,
        "file": str(settings["file"]),
        "mode": experiment.mode.name,
        "control": inspection.control,
        "mode_source": reading.mode_source,
        "is_mode_assumed": reading.mode_source == DEFAULT_SOURCE,
        "unit": experiment.stress_unit,
        "roles": roles,
        "rows": len(reading.used),
        "all_rows": len(reading.table.rows),
        "line": inspection.line,
        "steps": list(inspection.steps),
        "cycles": [cycle.label for cycle in reading.cycles],
        "range": [float(reading.used.stretch.min()), float(reading.used.stretch.max())],
        "curves": [_curve(reading, number) for number in range(len(reading.used.labels))],
    }


def _curve(reading: Reading, number: int) -> dict[str, Any]:
    """Return what is drawn of a stress: all rows, those that are used, and where something happened."""
    used, unit = reading.used, stress_unit(reading.experiment.stress_unit)
    regions = [
        {"kind": region.kind, **_points(used.stretch[number][region.rows], used.stress[number][region.rows], unit)}
        for region in reading.tested[number].regions
        if len(region.rows)
    ]
    return {
        "label": used.labels[number],
        "x": reading.experiment.mode.abscissa_control.name,
        "y": f"engineering stress [{unit.name}]",
        "recorded": _points(reading.recorded.stretch[number], reading.recorded.stress[number], unit),
        "used": _points(used.stretch[number], used.stress[number], unit),
        "regions": regions,
    }


def _points(stretch: Column, stress: Column, unit: Any) -> dict[str, list[float]]:
    """Return points, of many some that are spread over them, in a unit; those that are no numbers left out."""
    rows = np.unique(np.linspace(0, len(stretch) - 1, min(len(stretch), MAX_POINTS)).round().astype(int))
    x, y = stretch[rows], stress[rows] / unit.to_mpa
    is_number = np.isfinite(x) & np.isfinite(y)
    return {"x": [float(f"{value:.6g}") for value in x[is_number]], "y": [float(f"{v:.6g}") for v in y[is_number]]}


def _finding(text: str, columns: Sequence[str], reading: Mapping[str, Any]) -> dict[str, Any]:
    """Return something strange about measurements with what it proposes, which a person may take or not."""
    answers = [
        {"label": _in_words(proposal), "settings": _changes(reading, with_options(reading, proposal, columns))}
        for proposal in answers_in(text, columns, reading)
        if not proposal.asked_for and not proposal.leaves_out
    ]
    is_open = len(answers) <= MAX_SHOWN
    return {"text": text, "plain": _without_options(text) if answers and is_open else text,
            "answers": answers if is_open else []}  # fmt: skip


def _question(
    file: Path,
    text: str,
    columns: Sequence[str],
    settings: Mapping[str, Any],
    files: Sequence[Path],
    start: float,
    *,
    refused: bool = False,
) -> dict[str, Any]:
    """Return a message with the answers that it proposes, and what each of them would give."""
    answers: list[dict[str, Any]] = []
    later: list[dict[str, Any]] = []
    for proposal in answers_in(text, columns, settings):
        answer: dict[str, Any] = {"label": _in_words(proposal), "gives": "", "asked_for": list(proposal.asked_for)}
        answer["settings"] = _changes(settings, with_options(settings, proposal, columns))
        if proposal.asked_for:
            answers.append(answer)
            continue
        if perf_counter() - start < SECONDS_TO_TRY:
            try:
                tests = find_tests(file, with_options(settings, proposal, columns), files)
                answer["gives"] = tests_in_words(tests)
            except TissuqError as refusal:
                if str(refusal) == text or not refused:
                    continue
                later.append(answer | {"gives": "more is then asked"})
                continue
        answers.append(answer)
    listed = [*answers, *later][:MAX_ANSWERS]
    return {"text": text, "plain": _without_options(text) if listed else text, "answers": listed, "shown": MAX_SHOWN}


def _without_options(text: str) -> str:
    """Return a message without the clauses that say what to type, for which there are buttons.

    Examples
    --------
    >>> _without_options("the file states no unit of stress, so MPa was assumed; say which it is: --stress-unit kPa.")
    'the file states no unit of stress, so MPa was assumed.'
    """
    text = re.sub(r" \([^()]*--[^()]*\)", "", text)
    clauses = re.split(r"(?<=[;.:]) ", text)
    end = next((number for number, clause in enumerate(clauses) if "--" in clause), len(clauses))
    while end and clauses[end - 1].endswith(":") and end < len(clauses):
        end -= 1
    plain = " ".join(clauses[:end]).rstrip(";: ")
    return text if len(plain) < MIN_LETTERS else plain if plain.endswith(".") else f"{plain}."


def _changes(old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in new.items() if old.get(name) != value}


def _in_words(proposal: Answer) -> str:
    if proposal.leaves_out:
        return proposal.text
    return ", ".join(_one_in_words(*option) for option in proposal.options)


def _one_in_words(name: str, value: str) -> str:
    if name == "column":
        role, _, column = value.partition("=")
        return f"{role} is in column '{column}'"
    words = WORDS.get(name, name.replace("-", " ") + " {}")
    return words.format(value) if value else words.replace(" {}", "")
