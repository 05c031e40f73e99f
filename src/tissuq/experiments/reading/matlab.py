"""Files of MATLAB: vectors of one length are the columns of a table, and so are those of each structure."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np

from tissuq.experiments.reading.file_format import FileFormat, explained, line_of
from tissuq.experiments.reading.headings import heading, is_of_role

FEWEST_ROWS = 2
"""Length of a vector that may be a column."""
AXES = 2
"""Columns of a matrix that may be of the axes of one test."""
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
    """Return a dataset as an array, its axes as in MATLAB, or as a text; a group as a mapping; cells as a list."""
    if hasattr(item, "items"):
        fields = {str(name): _of_hdf5(member) for name, member in item.items()}
        lists = [member for member in fields.values() if isinstance(member, list)]
        if len(lists) == len(fields) and len({len(member) for member in lists}) == 1:
            return [dict(zip(fields, values_of_one, strict=True)) for values_of_one in zip(*lists, strict=True)]
        return fields
    values = np.asarray(item)
    if values.dtype == object:
        return [_of_hdf5(item.file[reference]) for reference in values.ravel()]
    if item.attrs.get("MATLAB_class") == b"char":
        return "".join(map(chr, values.ravel()))
    return np.squeeze(values.T)


def _fields(value: Any) -> dict[str, Any]:
    """Return the fields of a structure; nothing of anything else."""
    fields = value if isinstance(value, Mapping) else getattr(value, "__dict__", {})
    return {field: member for field, member in fields.items() if not field.startswith("_")}


def _sheets(name: str, variables: Mapping[str, Any]) -> Iterator[tuple[str, list[str]]]:
    """Yield the lines of every table among variables; those that stand by themselves make the sheet of that name.

    Single numbers and texts beside them are lines above it.
    """
    vectors, matrices, statements = dict[str, Any](), dict[str, Any](), list[str]()
    for key, value in variables.items():
        path = key if name == VARIABLES else f"{name}.{key}"
        is_list = isinstance(value, list) or (isinstance(value, np.ndarray) and value.dtype == object and value.ndim)
        structures = [_fields(element) for element in np.ravel(value)] if is_list else []
        if is_list and all(structures):
            for label, fields in zip(_labels(path, structures), structures, strict=True):
                yield from _sheets(label, fields)
        elif fields := _fields(value):
            yield from _sheets(path, fields)
        elif isinstance(value, str | int | float) or (isinstance(value, np.ndarray | np.generic) and not value.ndim):
            statements.append(line_of([key, value if isinstance(value, str) else np.asarray(value).item()]))
        elif isinstance(value, np.ndarray) and np.issubdtype(value.dtype, np.number) and not np.iscomplexobj(value):
            if value.ndim == 1 and len(value) >= FEWEST_ROWS:
                vectors[key] = value
            elif value.ndim == 2:
                matrices[key] = value
    table = _of_tests(matrices, vectors)
    for key, value in matrices.items():
        if table is None or key not in table.keys:
            yield key if name == VARIABLES else f"{name}.{key}", [line_of(row) for row in value.tolist()]
    if table is not None:
        yield name, [*statements, *table.lines]
        vectors = {key: value for key, value in vectors.items() if key not in table.keys}
    by_length = groupby(sorted(vectors.items(), key=lambda item: len(item[1])), key=lambda item: len(item[1]))
    groups = [dict(items) for _, items in by_length]
    for columns in groups:
        rows = np.column_stack(list(columns.values())).tolist()
        sheet = name if len(groups) == 1 and table is None else f"{name} of {len(rows)}"
        yield sheet, [*statements, line_of(list(columns)), *map(line_of, rows)]


def _labels(name: str, structures: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return what tells structures apart: a text that is different in each, or else their numbers."""
    for field in structures[0]:
        texts = [fields.get(field) for fields in structures]
        if all(isinstance(text, str) and text for text in texts) and len(set(texts)) == len(texts):
            return [f"{name} {text}" for text in texts]
    return [f"{name}({number})" for number in range(1, len(structures) + 1)]


class _TableOfTests(NamedTuple):
    """A table of several tests beside one another, and the names of the variables that are in it."""

    keys: frozenset[str]
    lines: list[str]


def _of_tests(matrices: Mapping[str, Any], vectors: Mapping[str, Any]) -> _TableOfTests | None:
    """Return the table of matrices of which each holds one quantity of several tests; None where there are none.

    Their names say that they do. Two columns may be of two axes, and are named so that they are asked about.
    """
    named = {key: value for key, value in matrices.items() if is_of_role(key)}
    common = {
        key: value for key, value in vectors.items() if any(len(value) in matrix.shape for matrix in named.values())
    }
    if len({value.shape for value in named.values()}) != 1 or len(named) + sum(map(is_of_role, common)) < 2:
        return None
    shape = next(iter(named.values())).shape
    lengths = {len(value) for value in common.values()} or {max(shape)}
    if len(lengths) > 1:
        return None
    rows = lengths.pop()
    upright = {key: value if value.shape[0] == rows else value.T for key, value in named.items()}
    count = min(shape) if rows == max(shape) else max(shape)
    tests_above, names, columns = [""] * len(common), list(common), list(common.values())
    for number in range(1, count + 1):
        for key, value in upright.items():
            tests_above.append(f"test {number}")
            names.append(key if count > AXES else heading(key).with_unit(f"{heading(key).quantity} {number}"))
            columns.append(value[:, number - 1])
    lines = [line_of(tests_above)] if count > AXES else []
    content = [*lines, line_of(names), *map(line_of, np.column_stack(columns).tolist())]
    return _TableOfTests(frozenset([*named, *common]), content)
