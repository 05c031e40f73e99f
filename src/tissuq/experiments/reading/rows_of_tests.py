"""Which test the rows of a table are of: its specimen, direction and condition, by columns and by names."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations, pairwise

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.numbers import NUMBER
from tissuq.experiments.reading.axial_stretch import STATEMENT
from tissuq.experiments.reading.headings import NEXT_WORD, dimensions_named, heading, is_of_specimens, plain
from tissuq.experiments.reading.layout import WHITESPACE, split
from tissuq.experiments.reading.recognition import PRESSURE, ColumnChoice, find_column
from tissuq.experiments.reading.stated_mode import modes_in_column
from tissuq.experiments.reading.table import Column, Table, filled_on
from tissuq.experiments.reading.tube import SAME_STRETCH
from tissuq.experiments.reading.vocabulary import AXIAL_STRETCH, CYCLE_NAMES, SET_NAMES

ROWS_OF_TEST = 5
"""Rows that the tests of a table have on average at least."""
RESTART, RETURN = 0.1, 0.5
"""Share of the range of stretches within which all tests begin, and of the longest way that all go."""
SAMPLED_ROWS = 500
"""Rows in which a column of measured values shows as such."""
NOT_OF_TESTS = re.compile(r"step|schritt|segment|phase|block|stage|loop|temp|rate|speed|geschwind|humid|feucht")
"""Names of columns of numbers that part a test of one specimen."""
SPECIMENS_OF_POPULATION = 3
"""Fewest specimens that show a population."""
SHOWN = 6
"""Number of values that a message lists."""

NAME_OF_ONE = re.compile(r"(?!(?P<letters>\D*)\d+[-–](?P=letters)?\d+$)(?=.*\d)(?=.*[^\W\d_])[\w.–-]{2,30}")
"""The name of a specimen, of letters and digits, but no range such as ``A1-A6``; words may be those of a material."""

LABELS = {
    "direction": (
        r"(loading |test(ing)? |fib(re|er) |specimen |sample |material )?(direction|orientation)|"
        r"(faser|last|zug)?richtung|orientierung|direction (de|du) .*|direcci[óo]n|direzione|direção|направление|方向",
        r"longitudinal\w*|transvers\w*|circumferential\w*|circ|hoop|axial\w*|radial\w*|"
        r"(along|across|cross|parallel|perpendicular)[ -]?(to )?(the )?fib(re|er)s?|fib(re|er)[ -]?direction|"
        r"längs\w*|quer\w*|umfangs\w*|продольн\w*|поперечн\w*|окружн\w*|(0|45|90)[ -]?(deg|degrees|°)",
    ),
    "condition": (
        r"(test(ing)? |specimen |sample )?(condition|treatment|state|group)|medium|bedingung|behandlung|zustand|gruppe|"
        r"condition|traitement|groupe|condici[óo]n|tratamiento|grupo|condizione|trattamento|состояние|условие|обработка|"
        r"группа|条件|处理|組|组",
        r"fresh|frozen|thawed|fixed|dried|dry|wet|hydrated|dehydrated|control|treated|untreated|healthy|diseased|"
        r"decellulari[sz]ed|native|cross-?linked|frisch|gefroren|aufgetaut|fixiert|trocken|feucht|kontrolle|behandelt",
    ),
}
"""Names of columns of each label, and words that say it in the name of a test, its sheet or its file."""


class SeveralSpecimens(InputError):
    """That rows are of several tests, and which.

    Parameters
    ----------
    place : str
        Of the column that tells them apart.
    column : str
        Its name, or its number from 1.
    labels : sequence of str
        Its cells, one a row.
    advice : str
        What else may be done than reading one of them.
    """

    def __init__(self, place: str, column: str, labels: Sequence[str], advice: str = "") -> None:
        super().__init__(
            f"{place} names several tests: {_listed(labels)}. To read one of them give --only "
            f"'{column}={labels[0]}'{advice}."
        )
        self.place, self.column, self.labels = place, column, labels


def only_rows(table: Table, only: Mapping[str, str | int] | None) -> Table:
    """Return the rows whose cells in some columns are as given.

    Raises
    ------
    InputError
        When there is no such column, or no such row.
    """
    for name, value in (only or {}).items():
        column = find_column(table, "only", name)
        texts = row_names(table, column)
        rows = np.flatnonzero([text.lower() == str(value).strip().lower() for text in texts])
        if not len(rows):
            raise InputError(f"{table.place(column)}: no row has '{value}' there. There are {_listed(texts)}.")
        table = table.of_test(rows)
    return table


def row_names(table: Table, column: int) -> list[str]:
    """Return the cells of a column, of which each goes for the empty ones beneath it where most are empty."""
    cells = table.texts(column)
    if cells.count("") <= len(cells) / 2:
        return cells
    return filled_on(cells)


def check_one_specimen(table: Table, choices: Sequence[ColumnChoice], course: Column) -> None:
    """Refuse a table of several specimens, which would be fitted as one.

    They are in a column that is named so, or in one whose words part the rows into tests that each begin anew, or its
    numbers where no test was unloaded: last of all in those of sizes and loading modes, which specimens may share.

    Raises
    ------
    SeveralSpecimens
        When there are several, with what reads one of them, or all.
    """

    def last(parting: tuple[int, list[str]]) -> tuple[int, int]:
        return len(dimensions_named(table.quantities[parting[0]])), len(modes_in_column(table, parting[0]))

    for column, labels in sorted(_parting_columns(table, choices, course), key=last):
        quantity = table.quantities[column]
        is_numbered = not NOT_OF_TESTS.search(quantity) and jump(labels, course)
        if not (is_of_specimens(quantity) or not any(map(NUMBER.fullmatch, labels)) or is_numbered):
            continue
        name, distinct = table.key(column), list(dict.fromkeys(labels))
        fit_all = (
            f"; to fit each and the population that they are from: tissuq population FILE --specimen-column '{name}'"
        )
        raise SeveralSpecimens(
            table.place(column),
            name,
            labels,
            f" (in Python only={{'{name}': '{labels[0]}'}}; tissuq.read_tests reads all)"
            f"{fit_all if len(distinct) >= SPECIMENS_OF_POPULATION else ''}",
        )


def specimen_of(table: Table) -> str:
    """Return the specimen of all rows that columns name, or else a line above; an empty text for none, or several."""
    columns = [column for column in range(len(table.names)) if is_of_specimens(table.quantities[column])]
    labels = [_text_of_all_rows(table, column) for column in columns]
    if not columns:
        labels = list(dict.fromkeys(_specimens_in_lines(table)))
        return labels[0] if len(labels) == 1 else ""
    return " ".join(labels) if all(labels) else ""


def _specimens_in_lines(table: Table) -> Iterator[str]:
    """Yield the names of specimens in lines above a table, such as A12; a number alone may be that of another test."""
    for _, text in table.head:
        cells = [text] if table.separator == WHITESPACE else split(text, table.separator)
        filled = [cell.strip(' "#') for cell in cells if cell.strip(' "#')]
        statements = [re.split(r"\s*[:=]\s*", cell, maxsplit=1) for cell in filled]
        statements = [words for words in statements if len(words) > 1 and words[1]]
        for name, value in statements or ([filled] if len(filled) == 2 else []):
            is_size = bool(dimensions_named(heading(value).quantity, is_cylinder=True))
            if is_of_specimens(heading(name.rstrip(" :=")).quantity) and NAME_OF_ONE.fullmatch(value) and not is_size:
                yield value


def advice_on_numbered_tests(table: Table, choices: Sequence[ColumnChoice], course: Column) -> str:
    """Return how to read one test where numbers in a column part the rows into tests that each begin anew."""
    for column, labels in _parting_columns(table, choices, course):
        return f"if column {table.label(column)} numbers specimens, give --only '{table.key(column)}={labels[0]}'"
    return ""


def _parting_columns(table: Table, choices: Sequence[ColumnChoice], course: Column) -> Iterator[tuple[int, list[str]]]:
    """Yield the columns, with their cells, that part the rows into tests: by their names, or as each begins anew."""
    used = {column for choice in choices for column in (choice.deformation, choice.stress)}
    is_tube, axial = choices[0].load == PRESSURE, choices[-1].deformation
    if is_tube:  # it is inflated at several axial stretches in turn, or stretched at several pressures
        stretches = [column for column, name in enumerate(table.quantities) if AXIAL_STRETCH.fullmatch(name)]
        axial = stretches[0] if len(choices) == 1 and stretches else axial
        used |= {*stretches, *(column for column in range(len(table.names)) if table.unit(column))}
    samples = list(zip(*table.some_rows(SAMPLED_ROWS).cells(), strict=True))
    for column in sorted(set(range(len(table.names))) - used):
        quantity = table.quantities[column]
        if quantity in CYCLE_NAMES | SET_NAMES or (table.block is not None and not is_of_specimens(quantity)):
            continue
        sample = samples[column]
        if len(set(sample)) > len(sample) / 2:
            continue
        labels = row_names(table, column)
        distinct = list(dict.fromkeys(labels))
        if len(distinct) < 2 or len(labels) < ROWS_OF_TEST * len(distinct):
            continue
        if is_tube and not is_of_specimens(quantity) and _are_at_other_stretches(table, axial, labels):
            continue
        are_cycles = all(plain(label).rstrip("0123456789 .#") in CYCLE_NAMES for label in distinct)
        is_of_tests = _goes_again(labels, distinct, course) and not are_cycles
        if is_of_specimens(quantity) or is_of_tests or len(modes_in_column(table, column)) > 1:
            yield column, labels


def _are_at_other_stretches(table: Table, axial: int, labels: Sequence[str]) -> bool:
    """Tell whether rows of different labels are of a tube at different axial stretches, or lengths: of its protocol."""
    (values,), are = table.numbers([axial]), np.array(labels)
    ranges = [(values[are == label].min(), values[are == label].max()) for label in dict.fromkeys(labels)]
    return not any(np.allclose(one, other, rtol=SAME_STRETCH, atol=0) for one, other in combinations(ranges, 2))


def _goes_again(labels: Sequence[str], distinct: Sequence[str], course: Column) -> bool:
    """Tell whether each label has its own rows, one after another, in which the same way is gone again.

    They begin at the same stretch, or where the way back to their beginning was not measured.
    """
    starts = [0, *(row for row in range(1, len(labels)) if labels[row] != labels[row - 1]), len(labels)]
    if len(starts) != len(distinct) + 1:
        return False
    tests = [course[start:stop] for start, stop in pairwise(starts)]
    begins = np.array([test[0] for test in tests])
    furthest = np.array([test[np.argmax(np.abs(test - test[0]))] for test in tests])
    ways = furthest - begins
    is_same_way = bool((ways > 0).all() or (ways < 0).all()) and np.abs(ways).min() >= RETURN * np.abs(ways).max()
    return is_same_way and (bool(np.ptp(begins) <= RESTART * np.ptp(course)) or jump(labels, course))


def jump(labels: Sequence[str], course: Column) -> bool:
    """Tell whether the way back between labels was not measured, as it is between cycles of one specimen."""
    last = np.flatnonzero([label != next_label for label, next_label in pairwise(labels)])
    return bool((np.abs(course[last] - course[last + 1]) >= RETURN * np.ptp(course)).all())


def _listed(texts: Sequence[str]) -> str:
    values = [f"'{text}'" for text in dict.fromkeys(texts)]
    more = f" and {len(values) - SHOWN} more" if len(values) > SHOWN else ""
    return ", ".join(values[:SHOWN]) + more


def labels_of(table: Table, names: Sequence[str]) -> dict[str, str]:
    """Return direction and condition of the test in a table, as far as one of them is said; empty texts otherwise.

    Parameters
    ----------
    table : Table
        Its columns with one text in all rows go before words in names.
    names : sequence of str
        Of the test, from its file to the test itself; the last that says a label tells it.

    Examples
    --------
    >>> from tissuq.experiments.reading.table import Table
    >>> table = Table("a.csv", ("stretch", "Treatment"), ("", ""), ",", ["1,frozen", "1.1,frozen"], [2, 3])
    >>> labels_of(table, ["aorta circumferential", "sheet 1"])
    {'direction': 'circumferential', 'condition': 'frozen'}
    """
    labels = dict[str, str]()
    for label, (pattern, words) in LABELS.items():
        columns = [column for column, name in enumerate(table.quantities) if re.fullmatch(pattern, name)]
        stated = _text_of_all_rows(table, columns[0]) if len(columns) == 1 else ""
        labels[label] = stated or _in_names(names, words)
    return labels


def columns_only(table: Table, only: Mapping[str, str | int] | None) -> dict[str, str | int]:
    """Return what of ``only`` is asked of cells of columns; directions and conditions may be said elsewhere."""
    stated = LABELS.keys() - {*table.quantities}
    return {name: value for name, value in (only or {}).items() if name.lower() not in stated}


def other_label(table: Table, experiment: Experiment, only: Mapping[str, str | int] | None) -> str:
    """Return that the direction or condition of a test is not what is asked for; an empty text where it is."""
    for name in set(only or {}) - columns_only(table, only).keys():
        wanted, stated_label = str((only or {})[name]), getattr(experiment, name.lower())
        if stated_label.lower() != wanted.strip().lower():
            is_what = f"is '{stated_label}'" if stated_label else "is not said by a column or a name"
            return f"{table.file}: the {name.lower()} of the test {is_what}, not '{wanted}'. Leave it out."
    return ""


def _text_of_all_rows(table: Table, column: int) -> str:
    """Return the text in all rows of a column; an empty text where there are several."""
    cells = set(row_names(table, column))
    return cells.pop() if len(cells) == 1 else ""


def _in_names(names: Sequence[str], pattern: str) -> str:
    """Return the word in the last name that says a label; nothing where one says two. An axial stretch is none."""
    for name in reversed(names):
        words = STATEMENT.sub(" ", re.sub(r"[\s_-]+", " ", NEXT_WORD.sub(" ", name)).lower())
        labels = {match[0] for match in re.finditer(rf"(?<!\w)(?:{pattern})(?!\w)", words)}
        if labels:
            return labels.pop() if len(labels) == 1 else ""
    return ""
