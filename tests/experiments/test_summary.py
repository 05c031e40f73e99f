from statistics import fmean, stdev

import numpy as np
import pytest

import tissuq as tq
from machine_files import cycles, neo_hookean
from tissuq.errors import InputError
from written_files import text_file, workbook

COLUMNS = "Time (s),Strain (%),Stress (kPa)"
SUMMARIES = {
    "maximum": lambda column: column.max(),
    "minimum": lambda column: column.min(),
    "mean": lambda column: column.mean(),
    "standard deviation": lambda column: column.std(ddof=1),
}


def measured(rows=40, turns=False, seed=0):
    stretch = cycles([1.3], rows=rows // 2)[0] if turns else np.linspace(1, 1.3, rows)
    noise = np.random.default_rng(seed).normal(0, 0.1, len(stretch))
    return np.column_stack([0.5 * np.arange(len(stretch)), 100 * (stretch - 1), 1e3 * neo_hookean(stretch) + noise])


def written(folder, values, *end, names=COLUMNS):
    rows = [",".join(f"{value:.4f}" for value in row) for row in values]
    return text_file(folder / "test.csv", names, *rows, *end)


def summary_row(values, name, time="", digits=4):
    return ",".join([time, *(f"{SUMMARIES[name](column):.{digits}f}" for column in values[:, 1:].T)])


@pytest.mark.parametrize("turns", [False, True])
@pytest.mark.parametrize("digits", [1, 4])
@pytest.mark.parametrize("gap", ["", ",,"])
@pytest.mark.parametrize("names", [["maximum"], ["mean", "standard deviation"], [*SUMMARIES]])
def test_a_summary_beneath_a_blank_line_is_left_out_and_told(tmp_path, turns, digits, gap, names):
    values = measured(turns=turns)
    end = [summary_row(values, name, digits=digits) for name in names]
    inspection = tq.inspect(written(tmp_path, values, gap, *end))
    assert len(inspection.reading.experiment) == len(values)
    (note, *_) = inspection.warnings
    first = len(values) + 3
    assert note.startswith(f"line {first}" if len(end) == 1 else f"lines {first} to {first + len(end) - 1}")
    assert all(name in note for name in names)


def test_statistics_of_measurements_that_were_rounded_afterwards_are_known(tmp_path):
    stretch = np.linspace(1, 1.3, 12)
    values = np.column_stack([np.arange(12), stretch, 100 * (stretch - stretch**-2)])
    end = ["", summary_row(values, "mean"), summary_row(values, "standard deviation")]
    assert len(tq.read_experiment(written(tmp_path, values, *end, names="Time (s),Stretch,Stress (kPa)"))) == 12


@pytest.mark.parametrize("blank", [True, False])
def test_a_row_of_means_with_its_name_in_an_unread_column_is_left_out(tmp_path, blank):
    values = measured()
    end = [""] * blank + [summary_row(values, "mean", "Mittelwert"), summary_row(values, "maximum", "Max.")]
    assert len(tq.read_experiment(written(tmp_path, values, *end))) == len(values)


@pytest.mark.parametrize("names", [["mean", "standard deviation"], ["maximum", "mean"], [*SUMMARIES]])
def test_statistics_right_beneath_the_measurements_are_left_out(tmp_path, names):
    values = measured(rows=12)
    inspection = tq.inspect(written(tmp_path, values, *(summary_row(values, name) for name in names)))
    assert len(inspection.reading.experiment) == len(values)
    assert all(name in inspection.warnings[0] for name in names)


def test_a_last_row_that_repeats_the_largest_values_is_measured(tmp_path):
    values = measured(turns=True)
    values[-1] = [values[-2, 0], *values[:, 1:].max(axis=0)]
    assert len(tq.read_experiment(written(tmp_path, values))) == len(values)


@pytest.mark.parametrize("end", [["", ",14.2,33.1"], ["", "0.0,0.31,12.1", "0.5,0.32,12.2"], ["modulus,0.3,55.0"]])
def test_other_rows_that_stand_apart_are_asked_about(tmp_path, end):
    with pytest.raises(InputError, match=r"test\.csv, lines? 4.*not going on from line 41"):
        tq.read_experiment(written(tmp_path, measured(), *end))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("turns", [False, True])
@pytest.mark.parametrize("last", [1, 3, 8])
def test_measurements_that_go_on_beneath_a_blank_line_stay(tmp_path, seed, turns, last):
    values = measured(turns=turns, seed=seed)
    rows = [",".join(f"{value:.4f}" for value in row) for row in values[-last:]]
    inspection = tq.inspect(written(tmp_path, values[:-last], "", *rows))
    assert len(inspection.reading.experiment) == len(values)
    assert not any("summary" in note for note in inspection.warnings)


def test_a_blank_line_after_every_row_is_no_gap(tmp_path):
    values = measured()
    path = written(tmp_path, values)
    path.write_text(path.read_text().replace("\n", "\n\n"))
    assert len(tq.read_experiment(path)) == len(values)


@pytest.mark.parametrize("label", ["Mean", None])
def test_a_summary_of_a_sheet_is_left_out(tmp_path, label):
    values = measured()
    summary = [[label, *map(statistic, values[:, 1:].T.tolist())] for statistic in (fmean, stdev)]
    path = workbook(tmp_path / "test.xlsx", Sheet=[COLUMNS.split(","), *values.tolist(), [], *summary])
    assert len(tq.read_experiment(path)) == len(values)


def test_a_number_beyond_all_bounds_at_the_end_is_no_statistic(tmp_path):
    path = tmp_path / "test.csv"
    path.write_text("stretch,stress [kPa]\n" + "".join(f"{1 + k / 100},{k}\n" for k in range(20)) + "\n1.19,1e999\n")
    with pytest.raises(InputError, match=r"line 23, column 'stress .kPa.': '1e999' is too large"):
        tq.read_experiment(path)
