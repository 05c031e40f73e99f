"""All tests in one file, whether in sheets, tables, columns or rows, each with the options that read it alone."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple, Unpack

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import Uniaxial
from tissuq.experiments.reading.column_checks import check_machine, check_section
from tissuq.experiments.reading.columns import choose_columns
from tissuq.experiments.reading.data_frame import is_data_frame
from tissuq.experiments.reading.experiment_file import Reading, read_rows
from tissuq.experiments.reading.findings import experiment_of
from tissuq.experiments.reading.layout import LENGTH_RATIO, SHORT_TABLE
from tissuq.experiments.reading.options import PythonOptions, ReadingOptions, checked_mode, spelled_out
from tissuq.experiments.reading.python_form import is_to_be_read, refusals_in_python
from tissuq.experiments.reading.recognition import find_column
from tissuq.experiments.reading.rows_of_tests import SeveralSpecimens, columns_only, only_rows, other_label, row_names
from tissuq.experiments.reading.side_by_side import ColumnsOfTest, columns_named_again, columns_side_by_side
from tissuq.experiments.reading.stated_mode import DEFAULT_SOURCE, about_mode, direction_of, mode_of
from tissuq.experiments.reading.table import Table
from tissuq.experiments.reading.tables import read_tables
from tissuq.result_warning import Severity

MIN_SHARE_OF_TEST = 0.5
"""Rows of a table that may be a test, over those of the longest test in its file; shorter ones are of results."""


class TestInFile(NamedTuple):
    """A test in a file.

    Parameters
    ----------
    name : str
        What the file calls it; that of the file where it is the only one.
    reading : Reading
    options : ReadingOptions
        Those that read it alone, its loading mode among them.
    """

    name: str
    reading: Reading
    options: ReadingOptions


def read_tests(path: Any, **options: Unpack[PythonOptions]) -> list[Experiment]:
    """Read all tests in one file or table: sheets of a workbook, tables, columns or rows of several specimens.

    Parameters
    ----------
    path : str or path, or table
    options
        As for :func:`tissuq.read`, for every test.

    Returns
    -------
    list of Experiment
        In the order of the file, named as there.

    Warns
    -----
    UserWarning
        As `tissuq.read` does, and of tables that are left out.

    Raises
    ------
    InputError
        When there is no test in the file, or one of them cannot be read.

    Examples
    --------
    >>> from tissuq.experiments import datasets
    >>> [test.name for test in read_tests(datasets.path("rubber-treloar-uniaxial"))]
    ['rubber-treloar-uniaxial']
    """
    return _read(path, options)


def _read(path: Any, options: PythonOptions, *, is_one_of_several: bool = False) -> list[Experiment]:
    """Return all tests in one file or table, and warn of what there is to know of them."""
    with refusals_in_python(path):
        plain = spelled_out(options)
        tests = find_tests_in_file(path, is_one_of_several=is_one_of_several, **plain)
    experiments = [experiment_of(test.reading) for test in tests]
    names_of_text = dict[str, list[str]]()
    for test, experiment in zip(tests, experiments, strict=True):
        for warning in dict.fromkeys(experiment.curves[0].warnings):
            if warning.severity is not Severity.NOTE:
                names_of_text.setdefault(warning, []).append(test.name)
    for text, names in names_of_text.items():
        warnings.warn(text if len(names) == len(tests) else f"{', '.join(names)}: {text}", stacklevel=3)
    return experiments


def measurements(data: Any, more_names: Sequence[str] = (), **options: Unpack[PythonOptions]) -> Experiment:
    """Return what people have as an experiment: one as it is, all tests in a file or a table, or several together.

    Parameters
    ----------
    data : Experiment, str, path or table, or sequence of these
    more_names : sequence of str
        Names of further options, which messages may propose.
    options
        As of `read_tests`; of several files those of each.

    Raises
    ------
    InputError
        When it is none of these, or options of reading come with what has been read.

    Examples
    --------
    >>> measurements({"stretch": [1.0, 1.1], "stress": [0.0, 0.2]}, unit="MPa").stress.tolist()
    [0.0, 0.2]
    """
    spelled_out(options, more_names)
    if is_to_be_read(data):
        return Experiment.of(read_tests(data, **options))
    if isinstance(data, Experiment):
        if options:
            raise InputError(
                f"{', '.join(options)}: said of how a file is read, but the measurements are an Experiment, "
                "which has been read. Give it to tissuq.read, or to Experiment."
            )
        return data
    if isinstance(data, Sequence):
        is_one_of_several = len(data) > 1
        tests = [
            Experiment.of(_read(test, options, is_one_of_several=is_one_of_several))
            if is_to_be_read(test)
            else measurements(test, more_names, **options)
            for test in data
        ]
        return Experiment.of(tests)
    raise InputError(
        "measurements are needed: a file ('test.csv'), a table (a DataFrame, a Dataset of xarray), or an Experiment, "
        f"which tissuq.Experiment(mode, stretch, stress) makes of arrays; or a list of these. Not {data!r:.80}."
    )


def find_tests_in_file(
    path: Any, *, is_one_of_several: bool = False, **options: Unpack[ReadingOptions]
) -> list[TestInFile]:
    """Return all tests in one file, as `read_tests` reads them, each with the options that read it alone.

    Shorter tables without columns of deformation and load, such as one of results, are no tests, nor are a few rows
    beside one of many; those of statistics, in which these columns may be, are far shorter. Sizes and signs that a
    test cannot use are left out where it is one of several, in the file or in several files.

    Raises
    ------
    InputError
        As `read_tests`, and where some tests say in which loading mode they were measured, and others do not.
    """
    tables = read_tables(path, **options)
    path = tables[0].file if is_data_frame(path) else path
    has_sheets = len({table.sheet for table in tables}) > 1
    tests, refused = list[TestInFile](), list[tuple[Table, InputError, float, str]]()
    for table in tables:
        selection, names = options.copy(), list[str]()
        if has_sheets:
            selection["sheet"] = table.sheet
            names.append(table.sheet)
        if table.number:
            selection["table"] = table.number
            titles = [other.title for other in tables if other.sheet == table.sheet]
            is_alone = titles.count(table.title) == 1
            names.append(table.title if is_alone else f"{table.title} {table.number}".strip())
        try:
            rows = only_rows(table, columns_only(table, options.get("only")))
            of_table = _side_by_side(rows, path, selection, names)
        except InputError as error:
            refused.append((table, error, MIN_SHARE_OF_TEST, "no columns of one are recognised in it."))
            continue
        try:
            tests += [
                test
                for columns in of_table
                for test in _of_one_table(rows, path, selection, names, columns, is_only_test=not is_one_of_several)
            ]
        except InputError as error:
            refused.append((table, error, 1 / LENGTH_RATIO, "it is short, and cannot be read as one."))
    longest = max((len(test.reading.table.rows) for test in tests), default=0)
    refused.sort(key=lambda item: -item[2] if tests else -len(item[0].rows))
    for table, why, share, _ in refused:
        if len(table.rows) >= share * longest:
            raise _may_be_test(why, tests) if tests else why
    counts = [len(test.reading.recorded) for test in tests]
    are_few = [count <= SHORT_TABLE and LENGTH_RATIO * count <= max(counts) for count in counts]
    of_few_rows = [test.name for test, is_short in zip(tests, are_few, strict=True) if is_short]
    tests = [test for test, is_short in zip(tests, are_few, strict=True) if not is_short]
    refusals = [other_label(test.reading.table, test.reading.experiment, options.get("only")) for test in tests]
    if refusals and all(refusals):
        raise InputError(refusals[0])
    tests = [test for test, refusal in zip(tests, refusals, strict=True) if not refusal]
    _check_modes(path, tests)
    notes = [f"'{name}' is left out: of {SHORT_TABLE} rows or fewer, and no test." for name in of_few_rows]
    notes += [f"{table.file} is no test: {what}" for table, _, _, what in refused]
    return [test._replace(reading=replace(test.reading, warnings=(*test.reading.warnings, *notes))) for test in tests]


def _may_be_test(refusal: InputError, tests: Sequence[TestInFile]) -> InputError:
    """Return why a table was refused, with how to read the tests in the others."""
    options = tests[0].options
    option = f"--sheet '{options['sheet']}'" if options.get("sheet") else f"--table {options.get('table')}"
    return InputError(f"{refusal} To leave that table out and read '{tests[0].name}': {option}.")


def _side_by_side(
    table: Table, path: str | os.PathLike[str], options: ReadingOptions, names: list[str]
) -> list[ColumnsOfTest | None]:
    """Return the columns of each test beside the others; None for the only test of a table."""
    stated, source = mode_of(path, table, options, names)
    mode = checked_mode(stated, options)
    columns = options.get("columns")
    tests = columns_named_again(table, columns) if columns else columns_side_by_side(table, mode, options)
    if not tests or len(mode.stresses) > 1:
        with about_mode(mode.name, source):
            choose_columns(table, mode, options)
        return [None]
    if not columns:
        (measure, deformation), (load, stress) = tests[0].columns.items()
        given = f' --column {load}="{table.names[int(stress) - 1]}"'
        check_machine(table, table.quantities, int(deformation) - 1, measure, given)
        for test in tests:
            (measure, deformation), (load, stress) = test.columns.items()
            given = f' --column {measure}="{table.names[int(deformation) - 1]}"'
            check_section(table, int(stress) - 1, load, given)
    return list(tests)


def _of_one_table(
    table: Table,
    path: str | os.PathLike[str],
    options: ReadingOptions,
    names: list[str],
    columns: ColumnsOfTest | None,
    *,
    is_only_test: bool,
) -> Iterator[TestInFile]:
    """Yield the test in some rows and columns, or those of each specimen that a column names.

    One that has no name of its own in the file is the only test, unless there are other files.
    """
    words = [*names, columns.name] if columns else names
    name = " ".join(words) or Path(path).stem
    of_test: ReadingOptions = {"name": name, **options}
    if columns:
        of_test["columns"] = columns.columns
    if options.get("compression_positive") and direction_of(*words) == "tension":
        of_test["compression_positive"] = None
    try:
        reading = read_rows(table, path, words, **of_test)
    except SeveralSpecimens as several:
        only, labels = options.get("only") or {}, np.array(row_names(table, find_column(table, "only", several.column)))
        for label in dict.fromkeys(several.labels):
            rows = table.of_test(np.flatnonzero(labels == label))
            selection: ReadingOptions = {**options, "only": {**only, several.column: label}}
            yield from _of_one_table(rows, path, selection, [*names, label], columns, is_only_test=is_only_test)
        return
    except InputError as error:
        if is_only_test and not words:
            raise
        reading, of_test = _without_what_others_need(table, path, words, of_test, error)
    mode = options.get("mode") or reading.experiment.mode.name
    yield TestInFile(name, reading, {**of_test, "mode": mode})


def _without_what_others_need(
    table: Table, path: str | os.PathLike[str], words: Sequence[str], options: ReadingOptions, error: InputError
) -> tuple[Reading, ReadingOptions]:
    """Read one of several tests without options that it refuses, and that others may need.

    Raises
    ------
    InputError
        When it cannot be read without them either: the error with them.
    """
    sizes, is_positive = options.get("dimensions") or {}, options.get("compression_positive")
    of_section = {name: size for name, size in sizes.items() if name != "length"}
    of_length = {name: size for name, size in sizes.items() if name == "length"}
    refused = [(is_positive, sizes)]
    for choice in product((is_positive, None), (sizes, of_section, of_length, {})):
        if choice in refused:
            continue
        refused.append(choice)
        compression_positive, dimensions = choice
        of_test: ReadingOptions = {
            **options, "dimensions": dimensions or None, "compression_positive": compression_positive
        }  # fmt: skip
        with suppress(InputError):
            return read_rows(table, path, words, **of_test), of_test
    raise error


def _check_modes(path: str | os.PathLike[str], tests: Sequence[TestInFile]) -> None:
    """Refuse tests of which some say their loading mode, and others do not, unless these are directions alone.

    Sheets named Axial and Circ are of the same uniaxial test in two of them.
    """
    silent = [test.name for test in tests if test.reading.mode_source == DEFAULT_SOURCE]
    experiments = [test.reading.experiment for test in tests]
    are_directions = all(test.direction and isinstance(test.mode.along_axis_1, Uniaxial) for test in experiments)
    if silent and len(silent) < len(tests) and not are_directions:
        raise InputError(
            f"{path}: '{silent[0]}' does not say in which loading mode it was measured, as other tests in the file do. "
            f"Rename it, or give --mode once for all {len(tests)} tests, or once for each."
        )
