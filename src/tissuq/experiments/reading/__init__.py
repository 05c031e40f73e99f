"""From a laboratory's file to an experiment: table, columns, units, cycles, signs, and what is strange about it."""

from tissuq.experiments.reading.file_format import FileFormat
from tissuq.experiments.reading.workbook import Workbook

__all__ = ["FileFormat", "Workbook"]
