"""Files of JSON: rows of named values, or lists of one length, are the columns of a table, as dataframes write them."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from tissuq.errors import InputError
from tissuq.experiments.reading.file_format import FileFormat, explained, line_of


class JsonFile(FileFormat):
    """Tables as lists of rows or of columns, each a sheet under its name in the file."""

    name = "json"
    signature = b"{"

    @classmethod
    def recognises(cls, path: str | os.PathLike[str], start: bytes) -> bool:
        return Path(path).suffix.lower() == ".json" and start.lstrip(b"\xef\xbb\xbf \r\n\t")[:1] in (b"{", b"[")

    def sheets(self, path: str | os.PathLike[str]) -> dict[str, list[str]]:
        with explained(path, "a JSON file", "Python's json", "export the table as CSV"):
            content = json.loads(Path(path).read_text(encoding="utf-8-sig"))
        if sheets := {name: [*map(line_of, rows)] for name, rows in _tables("table", content)}:
            return sheets
        raise InputError(
            f'{path} is JSON without a table that is known: write lists of one length by name, {{"strain": [0, 0.1], '
            '"stress (kPa)": [0, 2.5]}, or rows, [{"strain": 0, "stress (kPa)": 0}], or export the table as CSV.'
        )


def _tables(name: str, content: Any) -> Iterator[tuple[str, Sequence[Sequence[Any]]]]:
    """Yield the tables in what a file holds with their names, as rows of which the first has the names of columns."""
    if isinstance(content, dict) and all(
        number.isdecimal() and isinstance(row, dict) for number, row in content.items()
    ):
        content = list(content.values())
    if isinstance(content, list):
        if content and all(isinstance(row, dict) for row in content):
            names = dict.fromkeys(column for row in content for column in row)
            yield name, [[*names], *([row.get(column) for column in names] for row in content)]
        elif content and all(isinstance(row, list) for row in content):
            yield name, content
    elif isinstance(content, dict):
        if isinstance(content.get("columns"), list) and isinstance(content.get("data"), list):
            yield name, [content["columns"], *content["data"]]
            return
        lists = {column: values for column, value in content.items() if (values := _values(value))}
        lengths = [len(values) for values in lists.values()]
        of_table = {column: values for column, values in lists.items() if len(values) == max(lengths)}
        if len(of_table) > 1:
            yield name, [[*of_table], *zip(*of_table.values(), strict=True)]
        else:
            for inner, value in content.items():
                yield from _tables(inner, value)


def _values(value: Any) -> list[Any]:
    """Return the values of a column, a list or by the number of the row; none of anything else."""
    if isinstance(value, Mapping) and all(map(str.isdecimal, value)):
        value = list(value.values())
    is_column = isinstance(value, list) and not any(isinstance(cell, list | dict) for cell in value)
    return value if is_column else []
