"""Tables with a row for each specimen, whose names stand in the first column: their sizes, and other things known."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from warnings import warn

from tissuq.errors import InputError
from tissuq.experiments.reading.dimensions import WAYS, Dimension, agree, quantity_of, sections_of
from tissuq.experiments.reading.dimensions_of_table import statements_of_size
from tissuq.experiments.reading.file_format import SEPARATOR_OF_CELLS, SUFFIXES, file_format
from tissuq.experiments.reading.headings import Heading, dimensions_named, heading, plain
from tissuq.experiments.reading.layout import MISSING, WHITESPACE, is_comment, is_units_row, split
from tissuq.experiments.reading.stated_sizes import StatedSize, numbered, sizes_of_text
from tissuq.experiments.reading.table import Table
from tissuq.experiments.reading.text_file import read_lines
from tissuq.experiments.reading.vocabulary import DIMENSION_NAMES
from tissuq.parameters.checks import checked_path

EXAMPLE_OF_SIZES = "specimen,length [mm],width [mm],thickness [mm]"
"""A first line of a table of sizes."""
SEPARATORS = "\t;,"
BETWEEN_CELLS = SEPARATORS + " "
"""What a line without cells consists of."""


def table_of_specimens(
    path: str | os.PathLike[str], specimens: Collection[str], what: str, example: str
) -> tuple[Table, list[str]]:
    """Return a table whose first line names its columns, and the specimen of every row, which it may call by a file.

    Parameters
    ----------
    path : str or path
    specimens : collection of str
        Names that stay as they are, even where they end as those of files.
    what, example : str
        What it holds, and a first line, for messages.

    Raises
    ------
    InputError
        When there is no such table in the file.
    """
    workbook = file_format(path)
    sheets = workbook.lines_by_sheet(os.fspath(path)) if workbook else {"": read_lines(path)}
    sheet, lines = next(iter(sheets.items()), ("", []))
    numbered = [(n, line) for n, line in enumerate(lines, 1) if line.strip(BETWEEN_CELLS) and not is_comment(line)]
    if len(numbered) < 2:
        place = f"{path}, sheet '{sheet}', which is the first," if len(sheets) > 1 else path
        raise InputError(
            f"{place} holds no {what}. Write the names of the columns into the first line, such as '{example}', and a "
            "line for each specimen."
        )
    header = numbered[0][1]
    separator = SEPARATOR_OF_CELLS if workbook else next((mark for mark in SEPARATORS if mark in header), WHITESPACE)
    names = split(header, separator)
    rows = [line for _, line in numbered[1:]]
    table = Table(str(path), tuple(names), ("",) * len(names), separator, rows, [n for n, _ in numbered[1:]])
    for row, line in enumerate(rows):
        if len(split(line, separator)) > len(names):
            raise InputError(
                f"{path}, line {table.lines[row]}: more cells than the {len(names)} columns that line {numbered[0][0]} "
                "names. Write numbers with a decimal point, or quote a text that holds the separator."
            )
    if "" in names or len(set(names)) < len(names):
        raise InputError(f"{path}, line {numbered[0][0]}: every column needs a name of its own; they are: {header!r}.")
    labels = [
        Path(cell).stem if cell not in specimens and cell.lower().endswith(SUFFIXES) else cell
        for cell in table.texts(0)
    ]
    if twice := [name for name in dict.fromkeys(labels) if labels.count(name) > 1]:
        row = len(labels) - 1 - labels[::-1].index(twice[0])
        raise InputError(f"{table.place(0, row)}: specimen '{twice[0]}' has several rows; give one for each specimen.")
    return table, labels


def read_sizes(path: str | os.PathLike[str]) -> dict[str, dict[str, str]]:
    r"""Read the sizes of specimens from a table of a laboratory book, with a row for each of them.

    Parameters
    ----------
    path : str or path
        A text, or a workbook with the table in its first sheet. Its first line names the columns; the first column
        names the specimens, or their files.
        Columns of lengths, widths, thicknesses, diameters and areas have their units in the names, such as
        ``width [mm]``, or in a row beneath them; of numbered ones (``Thickness 1 (mm)``) it is the mean. Others are not
        looked at.

    Returns
    -------
    dict of str to dict of str to str
        By the name of the specimen what `tissuq.read` takes as ``dimensions``.

    Raises
    ------
    InputError
        When there is no such table in the file, a size is no number with a unit, or an area is not that of the sides.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import tissuq as tq
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     table = Path(folder, "sizes.csv")
    ...     _ = table.write_text("specimen,length [mm],width [mm],thickness [mm]\nA.csv,20,10.2,3.1\n")
    ...     tq.read_sizes(table)
    {'A': {'width': '10.2 mm', 'thickness': '3.1 mm', 'length': '20.0 mm'}}
    """
    path = checked_path(path, "the file of a table of sizes")
    table, labels = table_of_specimens(path, (), "sizes", EXAMPLE_OF_SIZES)
    headings = {column: heading(name) for column, name in enumerate(table.names) if column}
    rows = table.cells()
    first = int(is_units_row(rows[0][1:]))
    if first:
        headings = {column: Heading(name.quantity, rows[0][column].strip("[]()")) for column, name in headings.items()}
    of_sizes = {
        column: name
        for column, name in headings.items()
        if dimensions_named(numbered(name.quantity)[0], is_cylinder=True)
    }
    if not of_sizes:
        raise InputError(
            f"{path}: none of the columns {', '.join(map(repr, table.names))} is known as a size of specimens. Name "
            f"them as in '{EXAMPLE_OF_SIZES}'."
        )
    numbered_rows = list(enumerate(zip(labels, rows, strict=True)))[first:]
    if unnamed := [row for row, (label, _) in numbered_rows if not label]:
        raise InputError(
            f"{table.place(0, unnamed[0])}: the row names no specimen. Write its name, in every row of its own; sizes "
            "that were measured several times are columns such as 'width 1 [mm]'."
        )
    return {label: _sizes_of_row(table, row, cells, of_sizes) for row, (label, cells) in numbered_rows}


@dataclass(frozen=True)
class TableOfSizes:
    """The sizes of specimens in a file, as `read_sizes` returns them."""

    file: str
    sizes: Mapping[str, Mapping[str, str]]

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> TableOfSizes:
        """Return those in a file."""
        return cls(str(path), read_sizes(path))

    def dimensions(
        self, names: Collection[str], test: str, given: Mapping[str, str] | None, folder: str = ""
    ) -> Mapping[str, str]:
        """Return those of the specimen of a test, and in place of them what is given.

        It is the first that has one of some names; capitals and blanks are the same. Where none has, it is the one
        whose name is that of the folder of the test. A warning says so, and where these differ.

        Raises
        ------
        InputError
            When none of the rows is of it, or several are that differ in capitals and blanks alone.
        """
        own = next((dimensions for name in names if (dimensions := self._row(name)) is not None), None)
        of_folder = self._row(folder)
        if of_folder is not None and of_folder != own:
            rows = (
                f"no row for {test}: its sizes are taken from the row of its folder, '{folder}'"
                if own is None
                else f"a row for {test} and another for its folder, '{folder}': its sizes are taken from its own"
            )
            warn(
                f"{self.file} has {rows}. If it is of another specimen, name the file, or its specimen, in the first "
                "column.",
                stacklevel=2,
            )
        of_table = of_folder if own is None else own
        if of_table is None:
            raise InputError(
                f"{self.file} has no row for {test}: its rows are of {', '.join(self.sizes)}. Name the file, or its "
                "specimen, in the first column."
            )
        replaced = WAYS if given and WAYS & given.keys() else frozenset()
        return {**{name: size for name, size in of_table.items() if name not in replaced}, **(given or {})}

    def _row(self, name: str) -> Mapping[str, str] | None:
        """Return the sizes of the specimen of that name, or of the only one but for capitals and blanks; or None."""
        alike = [name] if name in self.sizes else [label for label in self.sizes if plain(label) == plain(name)]
        if len(alike) > 1:
            raise InputError(
                f"{self.file} has rows for {' and '.join(map(repr, alike))}, and both may be '{name}': name one of "
                "them exactly so."
            )
        return self.sizes[alike[0]] if alike else None


def _sizes_of_row(table: Table, row: int, cells: Sequence[str], headings: Mapping[int, Heading]) -> dict[str, str]:
    """Return the sizes in a row as texts, the cross-section in one way; a height is a length where none is named so."""
    stated = list[StatedSize]()
    for column, named in headings.items():
        if cells[column].lower() in MISSING:
            continue
        quantity, measurement = numbered(named.quantity)
        of_cell = sizes_of_text(Heading(quantity, named.unit), cells[column], "", "", measurement)
        if not any(size.is_of(name, is_cylinder=True) for size in of_cell for name in DIMENSION_NAMES):
            raise InputError(
                f"{table.place(column, row)}: '{cells[column]}' is no size with a unit. Write a number above zero, and "
                "the unit into the name of the column, such as 'width [mm]'."
            )
        stated += of_cell
    sizes = dict[str, Dimension]()
    is_cylinder = not any(size.is_of("length", is_cylinder=False) for size in stated)
    for name in DIMENSION_NAMES:
        values = statements_of_size([size for size in stated if size.is_of(name, is_cylinder=is_cylinder)])
        if len(values) > 1:
            listed = " and ".join(f"{value:g} {quantity_of(name).unit}" for value, _ in values)
            raise InputError(f"{table.place(0, row)}: the {name} is {listed}; leave one of them.")
        if values:
            sizes[name] = Dimension(*values[0])
    sections = list(sections_of(sizes).values())
    if any(not agree(section, sections[0]) for section in sections):
        listed = " and ".join(f"{section.value:.4g} mm2" for section in sections)
        raise InputError(f"{table.place(0, row)}: the cross-section is {listed}; leave one of them.")
    unneeded = WAYS - {"area"} if "area" in sizes else frozenset()
    return {name: f"{size.value!r} {quantity_of(name).unit}" for name, size in sizes.items() if name not in unneeded}
