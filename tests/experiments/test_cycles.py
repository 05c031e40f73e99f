import numpy as np
import pytest

from machine_files import cycles as made
from machine_files import neo_hookean
from tissuq.errors import InputError
from tissuq.experiments.reading.experiment_file import read_file
from tissuq.experiments.reading.measured_rows import find_cycles
from tissuq.experiments.reading.read import read_experiment
from written_files import message, text_file


@pytest.fixture
def written(tmp_path):
    def write(stretch, **columns):
        columns = {"stretch": stretch, "stress_MPa": neo_hookean(np.asarray(stretch)), **columns}
        rows = "\n".join(",".join(map(str, row)) for row in zip(*columns.values(), strict=True))
        return text_file(tmp_path / "test.csv", ",".join(columns) + "\n" + rows + "\n")

    return write


def found(path):
    return [(cycle.start, cycle.peak, cycle.stop) for cycle in read_file(path).cycles]


def test_turning_points_part_cycles(written):
    stretch, _ = made([1.1, 1.2, 1.3], rows=21)
    assert found(written(stretch)) == [(0, 20, 40), (40, 60, 80), (80, 100, 121)]


def test_the_way_back_to_rest_from_the_other_side_ends_the_last_cycle_and_is_none(written):
    there, back = np.linspace(1, 1.2, 21), np.linspace(1.2, 0.8, 41)[1:]
    once_more = np.concatenate([back[::-1][1:], [1.2], back])
    stretch = np.concatenate([there, back, once_more, np.linspace(0.8, 1, 21)[1:]])
    assert found(written(stretch)) == [(0, 20, 60), (60, 100, 161)]
    last = read_file(written(stretch), cycle="last")
    assert (last.experiment.stretch.min(), last.experiment.stretch.max()) == pytest.approx((0.8, 1.2))
    assert len(last.used_cycles) == 1
    assert len(found(written(np.concatenate([there, back, np.linspace(0.8, 1, 21)[1:]])))) == 1


def test_a_last_way_that_starts_at_rest_is_a_cycle_whether_it_reaches_the_peak_or_not(written):
    cycle = np.concatenate([np.linspace(1, 1.3, 31), np.linspace(1.3, 1, 31)[1:-1]])
    for end in (1.3, 1.15):
        ramp = np.linspace(1, end, 21)
        assert found(written(np.concatenate([cycle, ramp]))) == [(0, 30, 60), (60, 80, 81)]


def test_the_last_way_back_of_a_test_that_begins_stretched_is_a_cycle_unless_it_was_compressed_too(written):
    there, back = np.linspace(1, 1.2, 21)[1:], np.linspace(1.2, 1, 21)
    assert found(written(np.concatenate([back, there, back[1:]]))) == [(0, 20, 40), (40, 60, 61)]


def test_noise_and_holds_make_no_cycles(written):
    random = np.random.default_rng(3)
    stretch = np.concatenate([np.linspace(1, 1.3, 200), np.full(50, 1.3), np.linspace(1.3, 1.0, 200)])
    cycles = read_file(written(stretch + random.normal(0, 0.003, len(stretch)))).cycles
    assert len(cycles) == 1
    assert 190 <= cycles[0].peak <= 260


def test_a_ramp_is_one_cycle_that_ends_at_its_turning_point(written):
    assert found(written(np.linspace(1, 1.3, 50))) == [(0, 49, 50)]
    assert found(written(np.linspace(1, 0.7, 50))) == [(0, 49, 50)]


def test_one_row_is_one_cycle():
    assert [(c.start, c.peak, c.stop) for c in find_cycles(_table(), np.array([1.1]), 1.0)] == [(0, 0, 1)]


def _table():
    from tissuq.experiments.reading.table import Table

    return Table("none", ("stretch", "stress"), ("", ""), ",", ["1.1,0.5"], [1])


def test_a_column_of_cycles_goes_before_turning_points(written):
    stretch, _ = made([1.2, 1.2], rows=21)
    number = np.where(np.arange(len(stretch)) < 4, 7, 8)
    assert found(written(stretch, cycle=number)) == [(0, 3, 4), (4, 20, len(stretch))]


@pytest.mark.parametrize(
    ("options", "rows"),
    [
        ({"cycle": "last"}, range(80, 121)),
        ({"cycle": 1}, range(40)),
        ({"cycle": "2"}, range(40, 80)),
        ({"cycle": "first", "branch": "loading"}, range(21)),
        ({"cycle": 2, "branch": "unloading"}, range(60, 80)),
        ({"branch": "loading"}, [*range(21), *range(40, 61), *range(80, 101)]),
        ({"cycle": "last", "every": 10}, [80, 90, 100, 110, 120]),
    ],
)
def test_a_cycle_and_a_branch_are_chosen(written, options, rows):
    stretch, _ = made([1.1, 1.2, 1.3], rows=21)
    data = read_experiment(written(stretch), **options)
    np.testing.assert_array_equal(data.stretch, stretch[list(rows)])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"cycle": 4}, "has 3 cycles; cycle must be first, last or 1 to 3, not '4'"),
        ({"cycle": "middle"}, "not 'middle'"),
        ({"branch": "up"}, "branch must be one of loading, unloading, not 'up'"),
        ({"every": 0}, "every must be a number of rows, 1 or more, not 0"),
    ],
)
def test_a_cycle_or_branch_that_is_not_there_is_refused(written, options, words):
    stretch, _ = made([1.1, 1.2, 1.3], rows=21)
    assert words in message(written(stretch), **options)


def test_unloading_that_was_not_measured_is_refused(written):
    with pytest.raises(InputError, match="there is no unloading in cycle 1 of 1"):
        read_experiment(written(np.linspace(1, 1.3, 50)), branch="unloading")


def test_dropped_rows_are_counted_with_their_reasons(written):
    stretch, _ = made([1.1, 1.2], rows=21)
    used = read_file(written(stretch), cycle=2, branch="loading", every=2).used
    assert [(step.counts, step.reason) for step in used.dropped] == [
        ((len(stretch) - 21,), "not loading of cycle 2 of 2"),
        ((10,), "one row in 2 asked for"),
    ]


def test_messages_after_a_choice_name_the_lines_of_the_file(written):
    stretch, _ = made([1.2, 1.2], rows=21)
    path = written(np.where(np.arange(len(stretch)) < 45, stretch, 2 - stretch))
    with pytest.raises(InputError, match=r"line \d\d, column 'stress_MPa'"):
        read_experiment(path, cycle=2, columns={"stress": "stress_MPa"}, compression_positive=True)
