"""Files that tests of reading write, of lines, columns or cells, what is read of them, and what refusals say."""

from __future__ import annotations

import numpy as np
import pytest

from tissuq.errors import InputError
from tissuq.experiments.reading.read import read_experiment


def text_file(path, *lines, encoding="utf-8"):
    """Write lines into a file, and return it."""
    path.write_text("\n".join(lines) + "\n", encoding=encoding)
    return path


def written(folder, head, *columns, separator=",", name="test.csv", form="{:.12g}".format, encoding="utf-8"):
    """Return a file of columns beneath lines of text, of which the last has the names of the columns."""
    rows = [separator.join(map(form, row)) for row in zip(*columns, strict=True)]
    return text_file(folder / name, head, *rows, encoding=encoding)


def workbook(path, **sheets):
    """Write rows of cells into the sheets of a workbook, and return it."""
    openpyxl = pytest.importorskip("openpyxl", reason="openpyxl is not installed")
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(row)
    book.save(path)
    return path


def by_name(folder, **columns):
    """Return a file of columns, each beneath its name."""
    return written(folder, ",".join(columns), *columns.values())


def message(path, **options):
    """Return why a file is refused."""
    with pytest.raises(InputError) as caught:
        read_experiment(path, **options)
    return str(caught.value)


def check_curve(data, stretch, stress, *, rtol=1e-7, atol=0.0, stress_atol=0.0):
    """Compare what was read with what was measured; stresses of nearly zero may have a tolerance of their own."""
    np.testing.assert_allclose(data.stretch, stretch, rtol=rtol, atol=atol)
    np.testing.assert_allclose(data.stress, stress, rtol=rtol, atol=atol or stress_atol)
