"""What happens in a test besides elastic loading is found, where it is, and the advice that is given cures it."""

import re

import numpy as np
import pytest

import tissuq as tq
from planted import CLEAN, LAWS, PLANTED, STIFFENING, rates
from tissuq.errors import InputError
from tissuq.experiments import datasets
from tissuq.experiments.reading.disturbances import find_drift, find_outliers, find_saturation, staircase_of, step_of
from written_files import written

ALL_LAWS = [*LAWS, *STIFFENING]
WAY = np.linspace(0, 1, 121)


@pytest.fixture
def inspected(tmp_path):
    def inspect(stretch, stress, **options):
        path = written(tmp_path, "stretch,stress [kPa]", stretch, stress, form="{:.6f}".format)
        return tq.inspect(path, **options)

    return inspect


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in PLANTED if name != "slack over a quarter"])
def test_what_is_planted_is_found_in_95_of_100_tests(name):
    """Of 500 of each kind 95 to 100 % are found (`python tests/planted.py 250`): fewer than 52 of 60 by chance is
    less likely than 0.01 for 95 %."""
    assert rates(name, 60, 11, ALL_LAWS)[PLANTED[name][0]] >= 52


@pytest.mark.slow
@pytest.mark.parametrize("name", CLEAN)
def test_clean_tests_raise_no_more_than_5_of_100_false_alarms_of_all_kinds_together(name):
    """Of 500 1 to 2 % raise one: more than 10 of 120 by chance is less likely than 1e-3 for 2 %."""
    assert rates(name, 120, 12, ALL_LAWS)["any"] <= 10


@pytest.mark.parametrize("name", datasets.names())
def test_the_data_sets_show_none_but_few_digits(name):
    reading = tq.inspect(datasets.path(name), mode=datasets.load(name).mode).reading
    assert {region.kind for tested in reading.tested for region in tested.regions} <= {"resolution"}


def test_a_slip_is_said_with_its_lines_and_the_advice_keeps_what_came_before(inspected):
    stress = 10 * WAY - 0.5 * (WAY > 0.5)
    (note,) = inspected(1 + 0.3 * WAY, stress).warnings
    assert note.startswith("in line 63 the stress suddenly falls, by up to 5.3 % of the largest")
    inspection = inspected(1 + 0.3 * WAY, stress, leave_out=re.search(r"--leave-out (\S+)\.$", note)[1])
    assert inspection.warnings == ()
    assert inspection.reading.experiment.stretch.max() == pytest.approx(1.15)


def test_a_saturated_load_cell_is_said_and_the_advice_leaves_its_rows_out(inspected):
    stress = np.minimum(10 * WAY + WAY**2, 9.0)
    (note,) = inspected(1 + 0.3 * WAY, stress).warnings
    count = int((stress == 9.0).sum())
    assert note.startswith(f"{count} rows carry exactly the largest stress, 9 kPa")
    inspection = inspected(1 + 0.3 * WAY, stress, leave_out=re.search(r"--leave-out (\S+)\.$", note)[1])
    assert inspection.warnings == ()
    assert len(inspection.reading.experiment) == 121 - count


@pytest.mark.slow
def test_noise_beside_a_saturated_load_cell_is_no_slip(inspected):
    """The equal loads hid the scatter of the others, so that 6 of 100 such tests seemed to slip; of 400 none does."""
    noise = np.random.default_rng(5)
    stretch = 1 + 0.42 * np.linspace(0, 1, 365)
    curve = (stretch - stretch**-2) * (1 + (stretch**2 + 2 / stretch - 3))
    for _ in range(40):
        load = np.minimum(curve / curve.max() + noise.normal(0, 0.005, 365), 0.75)
        regions = inspected(stretch, load).reading.tested[0].regions
        assert {region.kind for region in regions} == {"saturation"}


def test_the_end_of_a_test_in_coarse_steps_is_no_saturation():
    assert not len(find_saturation(np.rint(20 * WAY) / 20))
    assert not len(find_saturation(np.rint(20 * np.sin(np.pi * WAY)) / 20))


def test_outliers_are_said_and_the_advice_leaves_them_out(inspected):
    stress = 10 * WAY + WAY**2
    stress[[30, 80]] += 3.0, -2.0
    (note,) = inspected(1 + 0.3 * WAY, stress).warnings
    assert note.startswith("rows lie far off the ones before and after, in lines 32,82; ")
    inspection = inspected(1 + 0.3 * WAY, stress, leave_out=re.search(r"--leave-out (\S+)\.$", note)[1])
    assert inspection.warnings == ()
    assert len(inspection.reading.experiment) == 119


def test_rows_that_are_all_there_several_times_are_said_and_the_advice_leaves_them_out(inspected):
    stretch, stress = 1 + 0.3 * WAY, 10 * WAY + WAY**2
    (note,) = inspected(np.repeat(stretch, 3), np.repeat(stress, 3)).warnings
    assert note.startswith("every row is there 3 times, one after the other")
    inspection = inspected(
        np.repeat(stretch, 3), np.repeat(stress, 3), every=int(re.search(r"--every (\d+)\.$", note)[1])
    )
    assert inspection.warnings == ()
    np.testing.assert_allclose(inspection.reading.experiment.stretch, stretch, atol=1e-6)


def test_copied_rows_are_said_and_the_advice_leaves_them_out(inspected):
    rows = np.r_[0:80, 30:121]
    notes = inspected((1 + 0.3 * WAY)[rows], (10 * WAY + WAY**2)[rows]).warnings
    (note,) = [note for note in notes if "to the last digit" in note]
    assert note.startswith("lines 82:131 repeat 32:81 to the last digit")
    inspection = inspected(
        (1 + 0.3 * WAY)[rows], (10 * WAY + WAY**2)[rows], leave_out=re.search(r"--leave-out (\S+)\.$", note)[1]
    )
    assert inspection.warnings == ()
    np.testing.assert_allclose(inspection.reading.experiment.stretch, 1 + 0.3 * WAY, atol=1e-6)


def test_rows_on_the_way_back_are_no_copies(inspected):
    rows = np.r_[0:121, 119:-1:-1]
    assert not any("last digit" in note for note in inspected((1 + 0.3 * WAY)[rows], (10 * WAY)[rows]).warnings)


def test_a_fall_a_turning_point_and_a_kink_are_no_outliers():
    for values in (WAY - 0.4 * (WAY > 0.5), 1 - np.abs(2 * WAY - 1), np.maximum(WAY - 0.3, 0)):
        assert not len(find_outliers(values))
    off = WAY.copy()
    off[50] += 0.2
    assert find_outliers(off).tolist() == [50]


def test_coarse_loads_are_said_with_their_step_and_enter_the_fit(inspected):
    stress = 0.25 * np.rint((10 * WAY + WAY**2) / 0.25)
    inspection = inspected(1 + 0.3 * WAY, stress)
    (note,) = inspection.warnings
    assert note.startswith("the stresses are multiples of 0.25 kPa, 2.3 % of the largest")
    least = inspection.reading.experiment.least_errors
    assert least == pytest.approx({"resolution": 0.25 / 11 / np.sqrt(12)})
    assert f"--tolerance resolution={least['resolution']:.2g}" in note


def test_coarse_positions_are_said_with_their_step_and_enter_the_fit(inspected):
    stretch = 1 + 0.02 * np.rint(0.3 * WAY / 0.02)
    inspection = inspected(stretch, 10 * WAY + WAY**2)
    (note,) = inspection.warnings
    assert note.startswith("the stretch goes on in steps of 0.02 while the stress goes on evenly")
    assert inspection.reading.experiment.least_errors == pytest.approx({"stretch": 0.02 / np.sqrt(12)})


def test_fine_steps_and_even_points_are_no_resolution():
    assert step_of(np.linspace(0, 1, 21)) is None
    assert step_of(np.random.default_rng(1).standard_normal(50)) is None
    assert step_of(np.array([0, 1, 1, 2, 4, 5, 6, 8, 9.0]) / 7) == pytest.approx(1 / 7)
    assert staircase_of(np.repeat([1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6], 5), np.tile([3, 2, 1.5, 1.2, 1.1], 7)) is None


def test_a_zero_that_drifts_is_said_with_both_ends(inspected):
    way = 1 - np.abs(2 * np.linspace(0, 1, 201) - 1)
    drifting = 10 * way - np.linspace(0, 1, 201)
    note, hysteresis = inspected(1 + 0.3 * way, drifting).warnings
    assert hysteresis.startswith("loading and unloading differ")
    assert "10 % of the largest apart: the zero of the load cell drifts" in note
    assert "--branch loading" in note
    assert inspected(1 + 0.3 * way, drifting, branch="loading").warnings == ()
    assert find_drift(way, 10 * way) is None


def test_lines_to_leave_out_are_left_out_and_stated(inspected):
    reading = inspected(1 + 0.3 * WAY, 10 * WAY, leave_out="2, 4:6,122").reading
    lines = np.arange(2, 123)
    assert reading.used.table.lines == [line for line in lines.tolist() if line not in (2, 4, 5, 6, 122)]
    assert "without the rows in lines 2, 4:6,122" in reading.used.steps


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ("3:x", "must be lines of the file such as 31,45:50, not '3:x'"),
        ("20:10", "must be lines of the file such as 31,45:50, not '20:10'"),
        ("1", "there is no row to leave out in line 1; rows are in lines 2 to 122"),
        ("130:140", "there is no row to leave out in line 130:140"),
        ("2:122", "no row is left without lines 2:122"),
    ],
)
def test_lines_that_cannot_be_left_out_are_refused(inspected, lines, words):
    with pytest.raises(InputError, match=re.escape(words)):
        inspected(1 + 0.3 * WAY, 10 * WAY, leave_out=lines)


def test_a_range_of_stretches_keeps_the_rows_within_it_on_every_branch(inspected):
    way = 1 - np.abs(2 * WAY - 1)
    reading = inspected(1 + 0.3 * way, 10 * way, stretch_range=(1.06, 1.2)).reading
    expected = 1 + 0.3 * way[(way >= 0.2 - 1e-9) & (way <= 2 / 3 + 1e-9)]
    np.testing.assert_allclose(reading.experiment.stretch, expected, atol=1e-6)
    assert "only rows at stretches from 1.06 to 1.2" in reading.used.steps


@pytest.mark.parametrize("pair", [(1.2, 1.0), (1.0,), (1.0, np.nan)])
def test_a_range_that_is_none_is_refused(inspected, pair):
    with pytest.raises(InputError, match=r"a lowest and a highest stretch such as 1:1\.2"):
        inspected(1 + 0.3 * WAY, 10 * WAY, stretch_range=pair)


def test_a_range_without_rows_is_refused_with_those_there_are(inspected):
    with pytest.raises(InputError, match=r"no row has a stretch from 2 to 3; they are from 1 to 1\.3"):
        inspected(1 + 0.3 * WAY, 10 * WAY, stretch_range=(2, 3))


def test_a_fall_on_the_way_from_compression_to_the_reference_is_no_slip(inspected):
    """The size of the stress falls there in any case, more steeply in places."""
    strain = np.linspace(-0.15, 0.15, 101)
    stress = np.where(strain < 0, 3.0, 1.0) * strain - 0.03 * (strain < -0.08)
    assert inspected(1 + strain, stress).reading.tested[0].regions == []


def test_two_loads_alone_are_no_saturation():
    assert not len(find_saturation(np.repeat([0.17, 0.40], 11)))


def test_the_last_rows_of_protocols_that_begin_anew_are_no_outliers(inspected):
    way = np.linspace(0, 1, 16)
    stretch = np.concatenate([1 + end * way for end in (0.2, 0.15, 0.15)])
    stress = 5 * np.expm1(14 * (stretch - 1))
    assert not any("far off" in text for text in inspected(stretch, stress).warnings)
    stress[8] += 25.0
    assert any(
        "a row lies far off the ones before and after, in line 10" in text
        for text in inspected(stretch, stress).warnings
    )
