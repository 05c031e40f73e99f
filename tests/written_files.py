"""Files of columns of numbers that tests of reading write, and what refusals of them say."""

from __future__ import annotations

import pytest

from tissuq.errors import InputError
from tissuq.experiments.reading.read import read_experiment


def written(folder, head, *columns, separator=",", name="test.csv", form="{:.12g}".format, encoding="utf-8"):
    """Return a file of columns beneath lines of text, of which the last has the names of the columns."""
    rows = [separator.join(map(form, row)) for row in zip(*columns, strict=True)]
    (folder / name).write_text("\n".join([head, *rows]) + "\n", encoding=encoding)
    return folder / name


def by_name(folder, **columns):
    """Return a file of columns, each beneath its name."""
    return written(folder, ",".join(columns), *columns.values())


def message(path, **options):
    """Return why a file is refused."""
    with pytest.raises(InputError) as caught:
        read_experiment(path, **options)
    return str(caught.value)
