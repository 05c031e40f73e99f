"""Tables in memory as columns with units: of pandas, polars and xarray, or mappings; and files that store them."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import InputError
from tissuq.experiments.pint_units import is_quantity, unit_of
from tissuq.experiments.reading.file_format import SEPARATOR_OF_CELLS, FileFormat, as_text, explained, line_of

PANDAS, XARRAY, POLARS, LAZY, OTHERS = "iloc", "to_dataframe", "get_columns", "collect", "to_pandas"
"""What a table of each library can do, and no path can."""
NUMBERS = "iuf"
"""Kinds of numpy's arrays of numbers."""
NO_NAME = "Unnamed:"
"""How pandas begins the name of a column whose heading is empty."""
MOST_ROWS = 10_000_000
"""Rows of a file that is read; one of a few bytes may say that it has any number."""


class DataColumn(NamedTuple):
    """A column of a table: its name, its unit or an empty text, and its cells."""

    name: str
    unit: str
    cells: NDArray[Any]

    def texts(self) -> Iterator[str]:
        """Return the cells as text, numbers to the last digit."""
        return map(repr if self.cells.dtype.kind in NUMBERS else as_text, self.cells.tolist())


def is_data_frame(data: Any) -> bool:
    """Tell whether something is a table in memory.

    Examples
    --------
    >>> is_data_frame({"stretch": [1.0, 1.1], "stress": [0.0, 0.2]}), is_data_frame("test.csv")
    (True, False)
    """
    return isinstance(data, Mapping) or any(hasattr(data, name) for name in (PANDAS, XARRAY, POLARS, LAZY, OTHERS))


def kind_of(data: Any) -> str:
    """Return what messages call a table in memory."""
    return "table" if isinstance(data, dict) else type(data).__name__


def columns_of(data: Any) -> list[DataColumn]:
    """Return the columns of a table in memory, first those of its index where that has names.

    Parameters
    ----------
    data : pandas.DataFrame, polars.DataFrame, xarray.Dataset or mapping of str to array
        Or a series of pandas, an array of xarray, quantities of pint, or what has a method ``to_pandas``. Units are
        those of quantities, and the attributes ``units`` of xarray.

    Raises
    ------
    InputError
        When it has fewer than two columns, no rows, or columns of different lengths.

    Examples
    --------
    >>> columns_of({"stretch": [1.0, 1.1], "stress": [0.0, 0.2]})[1]
    DataColumn(name='stress', unit='', cells=array([0. , 0.2]))
    """
    columns, kind = list(_columns(data)), kind_of(data)
    lengths = {column.name: len(column.cells) for column in columns}
    if len(columns) < 2 or not all(lengths.values()):
        raise InputError(
            f"{kind}: expected a column of stretches and one of stresses, with values (columns: {len(columns)}, rows: "
            f"{min(lengths.values(), default=0)})."
        )
    if len(set(lengths.values())) > 1:
        words = ", ".join(f"'{name}' has {length}" for name, length in lengths.items())
        raise InputError(f"{kind}: the columns differ in length: {words}.")
    return columns


def lines_of(columns: Sequence[DataColumn]) -> list[str]:
    """Return the rows of columns as lines of a file: numbers to the last digit, with tabs between cells."""
    return [SEPARATOR_OF_CELLS.join(row) for row in zip(*(column.texts() for column in columns), strict=True)]


def _columns(data: Any) -> Iterator[DataColumn]:
    if hasattr(data, PANDAS):
        yield from _of_pandas(data)
    elif hasattr(data, XARRAY):
        yield from _of_xarray(data)
    elif hasattr(data, LAZY):
        yield from _columns(data.collect())
    elif hasattr(data, POLARS):
        yield from (DataColumn(series.name, "", series.to_numpy()) for series in data.get_columns())
    elif hasattr(data, OTHERS):
        yield from _of_pandas(data.to_pandas())
    else:
        yield from (_of_array(str(name), values) for name, values in data.items())


def _of_pandas(frame: Any) -> Iterator[DataColumn]:
    if frame.ndim == 1:
        frame = frame.to_frame("stress" if frame.name is None else frame.name)
    if any(name is not None and name not in frame.columns for name in frame.index.names):
        frame = frame.reset_index()
    for number, name in enumerate(frame.columns):
        levels = [str(level) for level in (name if isinstance(name, tuple) else (name,))]
        heading = " ".join(level for level in levels if level and not level.startswith(NO_NAME))
        column = frame.iloc[:, number]
        if hasattr(column.dtype, "units"):  # of pint-pandas
            yield _of_array(heading, column.array.quantity)
        else:
            is_plain = isinstance(column.dtype, np.dtype) and column.dtype.kind in NUMBERS
            cells = column if is_plain else column.astype(object).where(column.notna(), None)
            yield DataColumn(heading, "", cells.to_numpy())


def _of_xarray(data: Any) -> Iterator[DataColumn]:
    dataset = data if hasattr(data, "data_vars") else data.to_dataset(name=data.name or "stress")
    units = {name: variable.attrs.get("units", "") for name, variable in dataset.variables.items()}
    units |= {name: unit_of(column.data) for name, column in dataset.variables.items() if is_quantity(column.data)}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of quantities whose units are known already
        frame = dataset.to_dataframe().reset_index()
    for column in _of_pandas(frame[[name for name in frame.columns if name in units]]):
        yield column._replace(unit=str(units[column.name]).replace("dimensionless", "1"))


def _of_array(name: str, values: Any) -> DataColumn:
    unit, plain = (unit_of(values) or "1", values.magnitude) if is_quantity(values) else ("", values)
    array = np.asarray(plain)
    if array.ndim != 1:
        raise InputError(f"column '{name}' must be one-dimensional, not of shape {array.shape}.")
    return DataColumn(name, unit, array)


class ParquetFile(FileFormat):
    """A table of columns with names, as dataframes are stored."""

    name = "parquet"
    signature = b"PAR1"

    def sheets(self, path: str | os.PathLike[str]) -> dict[str, list[str]]:
        with explained(path, "a Parquet file", "polars", "export the table as CSV", extra="parquet"):
            import polars

            content = polars.scan_parquet(Path(path))
            rows = int(content.select(polars.len()).collect().item())
            frame = content.collect() if rows <= MOST_ROWS else None
        if frame is None:
            raise InputError(f"{path} has {rows} rows; at most {MOST_ROWS} are read. Export fewer.")
        columns = columns_of(frame)
        return {"table": [line_of([column.name for column in columns]), *lines_of(columns)]}
