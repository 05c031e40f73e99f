"""Files of MATLAB: vectors of one length are the columns of a table, and so are those of a structure."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from itertools import groupby
from typing import Any

import numpy as np

from tissuq.experiments.reading.file_format import FileFormat, explained, line_of

__all__ = ["MatlabFile"]

FEWEST_ROWS = 2
"""Length of a vector that may be a column."""
VARIABLES = "variables"
"""Name of the sheet of the variables that stand by themselves."""


class MatlabFile(FileFormat):
    """Variables of MATLAB as sheets: a matrix, a structure of vectors, or all vectors that stand by themselves."""

    name = "mat"
    signature = b"MATLAB "

    @classmethod
    def recognises(cls, path: str | os.PathLike[str], start: bytes) -> bool:
        return re.match(rb"MATLAB \d\.\d MAT-file", start) is not None

    def sheets(self, path: str | os.PathLike[str]) -> dict[str, list[str]]:
        with explained(path, "a file of MATLAB", "h5py or scipy", "export the table as CSV (writematrix)"):
            return dict(_sheets(VARIABLES, _variables(path)))


def _variables(path: str | os.PathLike[str]) -> dict[str, Any]:
    with open(path, "rb") as file:
        is_hdf5 = file.read(10) == b"MATLAB 7.3"
    if is_hdf5:
        import h5py

        with h5py.File(path) as content:
            return {str(name): _of_hdf5(item) for name, item in content.items() if not str(name).startswith("#")}
    from scipy.io import loadmat

    variables = loadmat(path, squeeze_me=True, struct_as_record=False)
    return {name: value for name, value in variables.items() if not name.startswith("__")}


def _of_hdf5(item: Any) -> Any:
    """Return a dataset as an array, its axes as in MATLAB; a group as a mapping."""
    if hasattr(item, "items"):
        return {str(name): _of_hdf5(part) for name, part in item.items()}
    return np.squeeze(np.asarray(item).T)


def _sheets(name: str, variables: Mapping[str, Any]) -> Iterator[tuple[str, list[str]]]:
    """Yield the lines of every table among variables; those that stand by themselves make the sheet of that name."""
    vectors: dict[str, Any] = {}
    for key, value in variables.items():
        fields = value if isinstance(value, Mapping) else getattr(value, "__dict__", {})
        parts = {field: part for field, part in fields.items() if not field.startswith("_")}
        if parts:
            yield from _sheets(key if name == VARIABLES else f"{name}.{key}", parts)
        elif isinstance(value, np.ndarray) and np.issubdtype(value.dtype, np.number) and not np.iscomplexobj(value):
            if value.ndim == 1 and len(value) >= FEWEST_ROWS:
                vectors[key] = value
            elif value.ndim == 2:
                yield key, [line_of(row) for row in value.tolist()]
    by_length = groupby(sorted(vectors.items(), key=lambda item: len(item[1])), key=lambda item: len(item[1]))
    groups = [dict(items) for _, items in by_length]
    for columns in groups:
        rows = np.column_stack(list(columns.values())).tolist()
        yield name if len(groups) == 1 else f"{name} of {len(rows)}", [line_of(list(columns)), *map(line_of, rows)]
