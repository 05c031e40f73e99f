"""Long files are read as short ones are: every number to its last digit, and the same messages where one is wrong."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from tissuq.experiments.reading import tables

ROWS = 10_500


def lines(separator=",", seed=0):
    rng = np.random.default_rng(seed)
    stretch = rng.uniform(0.7, 1.5, ROWS)
    stress = stretch - stretch**-2 + 0.01 * rng.standard_normal(ROWS)
    return ["stretch" + separator + "stress"] + [
        f"{a!r}{separator}{b!r}" for a, b in zip(stretch.tolist(), stress.tolist(), strict=True)
    ]


def written(folder, content):
    path = folder / "long.csv"
    path.write_text("\n".join(content) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize("separator", [",", ";", "\t", "  "])
def test_every_number_is_read_to_its_last_digit(tmp_path, separator):
    content = lines(separator)
    table = tables.read_table(written(tmp_path, ["made by a machine, today", *content, "", ""]))
    assert list(table.lines) == list(range(3, ROWS + 3))
    expected = np.array([row.split(separator) for row in content[1:]], dtype=float)
    np.testing.assert_array_equal(np.column_stack(table.numbers([0, 1])), expected)


def test_statistics_beneath_a_long_table_are_no_measurements(tmp_path):
    stretch = np.linspace(1, 1.5, ROWS)
    values = np.column_stack([stretch, stretch - stretch**-2])
    content = ["stretch,stress", *(f"{a!r},{b!r}" for a, b in values.tolist())]
    summary = [",".join(map(repr, statistic(values, axis=0).tolist())) for statistic in (np.mean, np.max)]
    with pytest.warns(UserWarning, match="a summary with its mean, maximum, left out"):
        assert len(tq.read_experiment(written(tmp_path, [*content, *summary]), stress_unit="MPa")) == ROWS


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
