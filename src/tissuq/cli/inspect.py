"""``tissuq inspect``: what is understood of files of measurements, and questions where they leave a choice."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tissuq.cli.call import Call, IntoFolder
from tissuq.cli.command import command
from tissuq.errors import InputError, TissuqError
from tissuq.experiments.numbers import wrapped
from tissuq.studies.answers import DIMENSIONS, Answer, answers_in, options_in, with_options
from tissuq.studies.files_of_tests import files_of, find_tests, tables_of, tests_in_words
from tissuq.studies.measured_file import READING, ReadingSettings
from tissuq.studies.option import argument, option, table_of_sizes

if TYPE_CHECKING:
    from tissuq.experiments.reading.experiment_file import Reading

Tests = list[tuple[dict[str, Any], "Reading"]]

MOST_ANSWERS = 12
"""That a question lists."""
REFUSED = "then this is asked"
"""Before what is said where an answer does not suffice."""
WIDTH = 100
"""Characters of a line."""
MODE = "Nothing in the file says in which loading mode it was measured; uniaxial was assumed. Say which: "


class InspectedFiles(ReadingSettings):
    """Files, and how they are read."""

    file: tuple[Path, ...] = argument(
        ...,
        "CSV, Excel or other files, folders of them, FILE#NAME for one test in a file, data sets.",
        takes=list[Path],
    )
    sizes: Path | None = table_of_sizes(READING)


class InspectOptions(IntoFolder):
    """What is made of what was understood."""

    write: Path | None = option(None, "Write what was understood into this TOML file, to edit and to fit.")
    ask: bool = option(False, "Ask where files leave a choice, and write what was understood [study.toml].")


@command(InspectedFiles, InspectOptions, out="Folder for figure, converted data and what is printed.")
def inspect(call: Call[InspectedFiles, InspectOptions]) -> None:
    """Show what is understood of files of measurements: tests, columns, dimensions, cycles, rows, noise, warnings."""
    from tissuq.experiments.reading.inspection import Inspection, overview
    from tissuq.experiments.reading.table_of_specimens import TableOfSizes
    from tissuq.report.run_folder import run_folder
    from tissuq.studies.files_of_tests import study_file

    write, ask, out, force = call.how.write, call.how.ask, call.how.out, call.how.force
    if out is not None:
        call.target(out)
    if ask and write is None:
        write = Path("study.toml")
    if write is not None and write.exists() and not force:
        raise InputError(f"'{write}' exists. Give another name, or --force to replace it.")
    settings: dict[str, Any] = dict(call.stated)
    files = files_of(settings.pop("file"), sizes := settings.pop("sizes", None))
    settings |= {"sizes": TableOfSizes.read(sizes)} if sizes else {}
    tests: list[tuple[dict[str, Any], Reading]] = []
    for path in files:
        if ask:
            file_tests, settings = ask_about(path, settings, files)
        else:
            file_tests = find_tests(path, settings, files)
        tests += file_tests
    inspections = [Inspection(reading) for _, reading in tests]
    print(inspections[0] if len(tests) == 1 else overview(inspections))
    if write is not None:
        write.write_text(study_file([of_test for of_test, _ in tests], inspections, write.parent), encoding="utf-8")
        print(f"\nWritten: {write}. Look through it, then: tissuq fit {write}")
    if out is not None:
        from tissuq.report.inspection import write_inspection

        with run_folder(out, call.command, force=force) as folder:
            write_inspection(inspections, folder)
        print(f"\nFigures: {out / 'figures'}" if len(tests) > 1 else f"\nFigure: {out / 'figures' / 'curve.png'}")


def ask_about(file: Path, reading: Mapping[str, Any], files: Sequence[Path]) -> tuple[Tests, dict[str, Any]]:
    """Return the tests in a file, and the settings that read it, once a person has answered what it leaves open.

    Raises
    ------
    InputError
        When the input ends before all is answered, or a message says of nothing to type that could help.
    """
    settings, settled = dict(reading), set[str]()
    columns = list(dict.fromkeys(name for table in tables_of(file, settings) for name in table.names))
    while True:
        try:
            tests = find_tests(file, settings, files)
        except InputError as refusal:
            answers = answers_in(str(refusal), columns, settings)
            if not answers:
                raise
            settings = _chosen(file, str(refusal), answers, settings, files, columns) or settings
            continue
        question = next((text for text in _open_questions(tests) if text not in settled), None)
        if question is None:
            return tests, settings
        settled.add(question)
        answers = answers_in(question, columns, settings)
        if not answers:
            continue
        settings = _chosen(file, question, answers, settings, files, columns, now=tests) or settings


def _open_questions(tests: Tests) -> list[str]:
    """Return what was assumed of the tests: units, zeros, measures and loading modes."""
    from tissuq.experiments.modes import loading_modes
    from tissuq.experiments.reading.stated_mode import DEFAULT_SOURCE

    questions = [doubt for _, reading in tests for doubt in reading.doubts]
    if any(reading.mode_source == DEFAULT_SOURCE for _, reading in tests):
        questions.append(MODE + ", ".join(f"--mode {name}" for name in loading_modes()))
    return list(dict.fromkeys(questions))


def _chosen(
    file: Path,
    question: str,
    answers: list[Answer],
    settings: Mapping[str, Any],
    files: Sequence[Path],
    columns: Sequence[str],
    now: Tests | None = None,
) -> dict[str, Any] | None:
    """Return the settings with the answer that a person types; None to leave things as they are ``now``."""
    print(f"\n{wrapped(question, WIDTH)}")
    outcomes = {
        answer: _what_it_gives(file, answer, with_options(settings, answer, columns), question, files)
        for answer in answers
    }
    if now is not None:
        is_read = {answer: text for answer, text in outcomes.items() if not text.startswith(REFUSED)}
        outcomes = is_read or outcomes
    helpful = sorted(
        (answer for answer in outcomes if outcomes[answer]), key=lambda answer: outcomes[answer].startswith(REFUSED)
    )
    listed = (helpful or answers)[:MOST_ANSWERS]
    if now is not None:
        print(f"  Enter  leave it: {tests_in_words(now)}")
    for number, answer in enumerate(listed, start=1):
        print(wrapped(f"{number}  {answer.text}: {outcomes.get(answer, '')}", WIDTH, initial_indent="  ",
                      subsequent_indent="     "))  # fmt: skip
    while True:
        typed = _typed(f"Number{'' if now is None else ', Enter'} or options [1 to {len(listed)}]: ")
        if not typed and now is not None:
            return None
        try:
            if typed.isdecimal() and 1 <= int(typed) <= len(listed):
                return with_options(settings, _with_sizes(listed[int(typed) - 1]), columns)
            if typed.startswith("--"):
                return with_options(settings, Answer(options_in(typed)), columns)
            print(f"Type a number from 1 to {len(listed)}, or options such as --length '20 mm'.")
        except TissuqError as error:
            print(error)


def _what_it_gives(
    file: Path, answer: Answer, settings: Mapping[str, Any], question: str, files: Sequence[Path]
) -> str:
    """Return in words what an answer would give; nothing where the same would be asked again."""
    if answer.asked_for:
        is_size = set(answer.asked_for) <= set(DIMENSIONS)
        return "a size, to type with its unit" if is_size else "a number to type"
    try:
        return tests_in_words(find_tests(file, settings, files))
    except TissuqError as refusal:
        if str(refusal) == question:
            return ""
        words = str(refusal).removeprefix(f"{file}").lstrip(":, ")
        return f"{REFUSED}: {words[:WIDTH]} ..."


def _with_sizes(answer: Answer) -> Answer:
    """Return an answer with the sizes and numbers that a person types."""
    options = [
        (name, _typed_value(name, value) if name in answer.asked_for else value) for name, value in answer.options
    ]
    return Answer(tuple(options), answer.leaves_out)


def _typed_value(name: str, example: str) -> str:
    from tissuq.experiments.reading.dimensions_of_table import given_size

    if name not in DIMENSIONS:
        return _typed(f"{name}, such as {example}: ")
    while True:
        typed = _typed(f"{name}, with its unit: ")
        try:
            given_size(name, typed)
        except InputError as error:
            print(error)
        else:
            return typed


def _typed(prompt: str) -> str:
    try:
        return input(prompt).strip()
    except EOFError as error:
        raise InputError("the input ended at a question; --ask is for a terminal, where somebody answers.") from error
