"""From a laboratory's file to an experiment: table, columns, units, cycles, signs, and what is strange about it."""

from tissuq.experiments.reading.file_format import FileFormat, Workbook

__all__ = ["FileFormat", "Workbook"]
