"""From a laboratory's file to an experiment: table, columns, units, cycles, signs, and what is strange about it."""

from tissuq.experiments.reading.data_frame import ParquetFile
from tissuq.experiments.reading.file_format import FileFormat
from tissuq.experiments.reading.html import Html
from tissuq.experiments.reading.json_file import JsonFile
from tissuq.experiments.reading.matlab import MatlabFile
from tissuq.experiments.reading.workbooks import BinaryWorkbook, OldWorkbook, OpenDocument, Workbook

__all__ = [
    "BinaryWorkbook",
    "FileFormat",
    "Html",
    "JsonFile",
    "MatlabFile",
    "OldWorkbook",
    "OpenDocument",
    "ParquetFile",
    "Workbook",
]
