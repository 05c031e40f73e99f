"""Files of Parquet: one table of columns with names."""

from __future__ import annotations

import os
from pathlib import Path

from tissuq.errors import InputError
from tissuq.experiments.reading.data_frame import columns_of, lines_of
from tissuq.experiments.reading.file_format import FileFormat, explained, line_of

__all__ = ["ParquetFile"]

MOST_ROWS = 10_000_000
"""Rows of a table that is read; a file of a few bytes may say that it has any number."""


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
