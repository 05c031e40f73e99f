"""Direction and condition of a test: what a column of the table, or a word in the names of the test, says of them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from tissuq.errors import InputError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.reading.headings import NEXT_WORD
from tissuq.experiments.reading.several_specimens import row_names
from tissuq.experiments.reading.table import Table

__all__ = ["LABELS", "check_labels", "columns_only", "labels_of"]

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
    return {label: _in_column(table, column) or _in_names(names, words) for label, (column, words) in LABELS.items()}


def columns_only(table: Table, only: Mapping[str, str | int] | None) -> dict[str, str | int]:
    """Return what of ``only`` is asked of cells of columns; directions and conditions may be said elsewhere."""
    stated = LABELS.keys() - {*table.quantities}
    return {name: value for name, value in (only or {}).items() if name.lower() not in stated}


def check_labels(table: Table, experiment: Experiment, only: Mapping[str, str | int] | None) -> None:
    """Refuse a test whose direction or condition is not what is asked for.

    Raises
    ------
    InputError
        With what it is, as far as anything says so.
    """
    for name in set(only or {}) - columns_only(table, only).keys():
        wanted, stated_label = str((only or {})[name]), getattr(experiment, name.lower())
        if stated_label.lower() != wanted.strip().lower():
            is_what = f"is '{stated_label}'" if stated_label else "is not said by a column or a name"
            raise InputError(f"{table.file}: the {name.lower()} of the test {is_what}, not '{wanted}'. Leave it out.")


def _in_column(table: Table, pattern: str) -> str:
    """Return the text in all rows of the only column of a label."""
    columns = [k for k, quantity in enumerate(table.quantities) if re.fullmatch(pattern, quantity)]
    cells = set(row_names(table, columns[0])) if len(columns) == 1 else set[str]()
    return cells.pop() if len(cells) == 1 else ""


def _in_names(names: Sequence[str], pattern: str) -> str:
    """Return the word in the last name that says a label; nothing where one says two."""
    for name in reversed(names):
        words = re.sub(r"[\s_-]+", " ", NEXT_WORD.sub(" ", name)).lower()
        labels = {match[0] for match in re.finditer(rf"(?<!\w)(?:{pattern})(?!\w)", words)}
        if labels:
            return labels.pop() if len(labels) == 1 else ""
    return ""
