"""Long files are read by a fast parser: the same numbers, and the same messages where something is wrong."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from tissuq.experiments.reading import tables
from written_files import text_file

ROWS = tables.LONG_FILE + 500


def lines(separator=",", seed=0):
    rng = np.random.default_rng(seed)
    stretch = rng.uniform(0.7, 1.5, ROWS)
    stress = stretch - stretch**-2 + 0.01 * rng.standard_normal(ROWS)
    return ["stretch" + separator + "stress"] + [
        f"{a!r}{separator}{b!r}" for a, b in zip(stretch.tolist(), stress.tolist(), strict=True)
    ]


def written(folder, content):
    return text_file(folder / "long.csv", *content)


@pytest.mark.parametrize("separator", [",", ";", "\t", "  "])
def test_the_fast_parser_reads_the_same_numbers(tmp_path, monkeypatch, separator):
    path = written(tmp_path, ["made by a machine, today", *lines(separator), "", ""])
    fast = tables.read_table(path)
    assert fast.block is not None
    tables._tables_in.cache_clear()
    monkeypatch.setattr(tables, "LONG_FILE", 10**9)
    slow = tables.read_table(path)
    assert slow.block is None
    assert list(fast.lines) == list(slow.lines)
    assert fast.rows == slow.rows
    for quick, careful in zip(fast.numbers([0, 1]), slow.numbers([0, 1]), strict=True):
        np.testing.assert_array_equal(quick, careful)


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        ("1.1,oops", "line 8001, column 'stress': 'oops' is not a number"),
        ("1.1,", "line 8001, column 'stress': the cell is empty"),
        ("1.1,nan", "line 8001, column 'stress': 'nan' is not a finite number"),
        ("1.1,0.2,0.3", "line 8001 has 3 cells"),
    ],
)
def test_bad_rows_far_down_are_named_by_the_first_line(tmp_path, bad, words):
    content = lines()
    content[8000:9000] = [bad] * 1000
    with pytest.raises(tq.InputError, match=words):
        tq.read_experiment(written(tmp_path, content), stress_unit="MPa")


def test_comments_and_gaps_far_down_are_passed_over(tmp_path):
    content = lines()
    content[9000:9000] = ["# a pause", ""]
    assert len(tq.read_experiment(written(tmp_path, content), stress_unit="MPa")) == ROWS


def test_decimal_commas_are_read_in_long_files_too(tmp_path):
    content = [line.replace(".", ",") for line in lines(";")]
    data = tq.read_experiment(written(tmp_path, content), stress_unit="MPa")
    assert len(data) == ROWS
    assert data.stretch.max() < 1.5
