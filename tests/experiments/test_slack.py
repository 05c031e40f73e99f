import re

import numpy as np
import pytest

import tissuq as tq
from planted import LAWS, STIFFENING, Planting
from tissuq.errors import InputError
from tissuq.experiments import datasets
from tissuq.experiments.reading.experiment_file import read_file
from tissuq.experiments.reading.read import read_experiment
from tissuq.experiments.reading.slack import find_slack
from written_files import message, text_file, written

LENGTH, SLACK, STIFFNESS = 20.0, 1.5, 0.4
SPECIMEN = {"length": "20 mm", "area": "2 mm2"}


@pytest.fixture
def hanging(tmp_path):
    """A spring of 0.4 N/mm that hangs slack over the first 1.5 mm, pulled by 4 mm and let go."""
    up = np.linspace(0, 4, 41)
    displacement = np.concatenate([up, up[-2::-1]])
    force = np.maximum(displacement - SLACK, 0) * STIFFNESS
    return written(tmp_path, "Disp (mm),Load (N)", displacement, force)


@pytest.mark.parametrize("preload", ["0.1 N", "100 mN", "50 kPa", "0,05 MPa"])
def test_stretch_is_counted_from_where_the_preload_is_reached(hanging, preload):
    data = read_experiment(hanging, dimensions=SPECIMEN, preload=preload)
    taut = SLACK + 0.1 / STIFFNESS
    displacement = np.linspace(1.8, 4, 23)
    expected = (LENGTH + displacement) / (LENGTH + taut)
    np.testing.assert_allclose(data.stretch[:23], expected, rtol=1e-9)
    np.testing.assert_allclose(data.stress[:23], (displacement - SLACK) * STIFFNESS / 2, rtol=1e-6)
    assert len(data) == 45


def test_rows_that_carry_less_are_dropped_and_told(hanging):
    used = read_file(hanging, dimensions=SPECIMEN, preload="0.1 N").used
    assert [(step.counts, step.reason) for step in used.dropped] == [((36,), "carrying less than 0.1 N")]
    assert "where the preload 0.1 N is reached between lines 19 and 20" in used.steps[2]


def test_a_specimen_that_is_taut_from_the_first_row_starts_there(tmp_path):
    path = text_file(tmp_path / "test.csv", "stretch,stress [kPa]\n1.25,2\n1.5,4")
    reading = read_file(path, preload="1 kPa")
    np.testing.assert_allclose(reading.experiment.stretch, [1.0, 1.2])
    assert "in line 2, the first, where the stress is already 2 kPa" in reading.used.steps[2]


def test_compression_is_taut_by_the_size_of_its_stress(tmp_path):
    path = text_file(tmp_path / "test.csv", "strain,stress [kPa]\n0,0\n-0.1,0\n-0.2,-10\n-0.3,-20")
    data = read_experiment(path, preload="5 kPa")
    np.testing.assert_allclose(data.stretch, [0.8 / 0.85, 0.7 / 0.85])


def test_cauchy_stress_is_divided_by_the_stretch_counted_from_the_preload(tmp_path):
    path = text_file(tmp_path / "test.csv", "stretch,Cauchy stress [kPa]\n1.2,2\n1.5,4")
    data = read_experiment(path, stress_type="cauchy", preload="2 kPa")
    np.testing.assert_allclose(data.stress, [0.002, 0.004 / 1.25])


@pytest.mark.parametrize(
    ("preload", "words"),
    [
        ("5 N", "the preload 5 N is not reached: the largest stress is 500 kPa, and the preload is 2500 kPa"),
        ("0.1", "a positive force or stress with its unit, such as '0.05 N', not '0.1'"),
        ("-1 N", "not '-1 N'"),
        ("1 g", "'g' is a mass, not a force"),
        ("1 mm", "'mm' is not a unit of stress"),
    ],
)
def test_a_preload_that_cannot_be_meant_is_refused(hanging, preload, words):
    assert words in message(hanging, dimensions=SPECIMEN, preload=preload)


def test_a_force_is_no_preload_of_a_file_of_stresses(tmp_path):
    path = text_file(tmp_path / "test.csv", "stretch,stress\n1,0\n1.1,2")
    with pytest.raises(InputError, match="is a force, but the file gives stresses"):
        read_experiment(path, preload="1 N")


def found_slack(share, laws, count, noises, rows=(100, 201, 1000)):
    """Tests with slack over a share of the way, and what is found of it; the range of stretches goes with each."""
    random = np.random.default_rng(5)
    for number in range(count):
        planting = Planting(random, laws[number % len(laws)], float(noises[number % len(noises)]))
        planting.count = int(random.choice(rows))
        yield planting, find_slack(*planting.slack(share))


@pytest.mark.slow
@pytest.mark.parametrize(("share", "noises"), [(0.1, (0, 1e-3)), (0.15, (1e-3, 3e-3)), (0.25, (1e-3, 1e-2))])
def test_slack_is_found_in_95_of_100_planted_tests(share, noises):
    """Of 1200 99.5 to 100 % are found: fewer than 133 of 140 by chance is less likely than 1e-5."""
    found = [slack is not None for _, slack in found_slack(share, list(LAWS), 140, noises)]
    assert np.mean(found) >= 0.95


@pytest.mark.slow
def test_slack_of_a_tenth_is_found_in_j_shaped_curves_where_noise_is_small():
    """Of 1200 99.8 % are found: fewer than 90 of 100 by chance is less likely than 1e-9."""
    found = [slack is not None for _, slack in found_slack(0.1, list(STIFFENING), 100, (0, 1e-3), rows=(201, 1000))]
    assert np.mean(found) >= 0.90


@pytest.mark.slow
def test_clean_curves_and_j_shaped_ones_raise_no_more_than_5_of_100_false_alarms():
    """Of 2400 2 % raise one (J-shaped ones 3 %): more than 5 % of 500 by chance is less likely than 1e-4."""
    curves = found_slack(0.0, [*LAWS, *STIFFENING], 500, (0, 1e-3, 3e-3, 1e-2, 2e-2), rows=(40, 100, 201, 1000))
    assert np.mean([slack is not None for _, slack in curves]) <= 0.05


@pytest.mark.slow
def test_its_standard_deviation_is_how_far_it_is_from_where_load_begins():
    """Within two standard deviations in 98 of 100 of 1134: fewer than 90 of 100 by chance is less likely than 1e-4."""
    tests = found_slack(0.2, [*LAWS, *STIFFENING], 120, (1e-3, 3e-3, 1e-2))
    errors = [
        (slack.stretch - planting.stretch(np.array(0.2))) / slack.sd for planting, slack in tests if slack is not None
    ]
    assert len(errors) >= 100
    assert np.mean(np.abs(errors) < 2) >= 0.90
    assert np.std(errors) > 0.3


@pytest.mark.parametrize("name", datasets.names())
def test_the_data_sets_show_no_slack(name):
    notes = tq.inspect(datasets.path(name), mode=datasets.load(name).mode).warnings
    assert not any("carry no load" in note for note in notes)


@pytest.mark.parametrize("noise", [0.0, 0.03])
@pytest.mark.parametrize("sign", [1, -1])
def test_the_proposed_preload_reads_the_stretches_of_the_taut_specimen(tmp_path, noise, sign):
    """Fifty of 201 rows without load, as of a specimen of C10 = 50 kPa."""
    way = np.linspace(0, 0.4, 201)
    stretch = 1 + sign * np.maximum(way - way[50], 0)
    stress = 100 * (stretch - stretch**-2) + noise * np.random.default_rng(3).standard_normal(201)
    length = 20 - sign * 20 * way[50]  # between the grips, before the slack is taken up
    rows = "".join(f"{sign * 20 * w:.5f},{s:.5f}\n" for w, s in zip(way, stress, strict=True))
    path = text_file(tmp_path / "test.csv", "Displacement (mm),Stress (kPa)\n" + rows)
    (note,) = tq.inspect(path, dimensions={"length": f"{length} mm"}).warnings
    assert "rows carry no load" in note
    auto = tq.inspect(path, dimensions={"length": f"{length} mm"}, preload="auto")
    (error,) = auto.reading.experiment.least_errors.values()
    assert auto.warnings == ()
    assert error < 0.01
    np.testing.assert_allclose(auto.reading.experiment.stretch, stretch[auto.reading.used.rows], rtol=2.5 * error)
    preload = re.search(r'--preload "([^"]*)"', note)[1]
    reading = read_file(path, dimensions={"length": f"{length} mm"}, preload=preload)
    used = reading.used.rows
    np.testing.assert_allclose(reading.experiment.stretch, stretch[used], rtol=0.005)
    x = reading.experiment.stretch
    basis = 2 * (x - x**-2)
    assert 1e3 * (basis @ reading.experiment.stress) / (basis @ basis) == pytest.approx(50, rel=0.03)
    assert not tq.inspect(path, dimensions={"length": f"{length} mm"}, preload=preload).warnings


def slack_file(tmp_path, names, way, start, factor=100.0):
    rows = "".join(f"{w:.6f},{factor * max(w - start, 0):.6f}\n" for w in way)
    return text_file(tmp_path / "test.csv", f"{names}\n" + rows)


def test_auto_says_where_load_begins_and_hands_its_uncertainty_to_the_fit(tmp_path):
    reading = read_file(slack_file(tmp_path, "stretch,stress [kPa]", np.linspace(1, 1.4, 101), 1.1), preload="auto")
    slack = reading.experiment.least_errors["slack"]
    assert re.search(
        r"stretch counted from 1\.\d+, where load begins \(estimated; standard deviation", reading.used.steps[2]
    )
    assert 0 < slack < 0.01
    assert reading.experiment.stretch[0] == pytest.approx(1.0, abs=0.01)
    assert reading.experiment.stretch[-1] == pytest.approx(1.4 / 1.1, abs=3 * slack)
    assert reading.used.dropped[0].reason == "before load begins"


@pytest.mark.parametrize("preload", ["auto", "0.05 kPa"])
@pytest.mark.parametrize("cycle", [1, 2, None])
def test_unloading_is_counted_from_where_load_begins_on_the_way_there(tmp_path, preload, cycle):
    """Of an elastic specimen both ways are one curve. The way back was counted from its first row, the peak, or not."""
    way = np.concatenate([ramp := np.linspace(0, 0.4, 101), ramp[-2::-1], ramp[1:], ramp[-2::-1]])
    stretch = 1 + np.maximum(way - 0.08, 0) / 1.08
    rows = "".join(f"{20 * w:.6f},{100 * (x - x**-2):.6f}\n" for w, x in zip(way, stretch, strict=True))
    path = text_file(tmp_path / "test.csv", "Displacement (mm),Stress (kPa)\n" + rows)
    options = {"length": "20 mm", "preload": preload, "cycle": cycle}
    there, back = (tq.read(path, branch=branch, **options) for branch in ("loading", "unloading"))
    assert len(back) == len(there)
    np.testing.assert_allclose(np.sort(back.stretch), np.sort(there.stretch), rtol=1e-9)
    assert back.stretch.max() == pytest.approx(stretch.max(), abs=0.01)


def test_auto_leaves_a_test_without_slack_as_it_is_and_says_so(tmp_path):
    path = slack_file(tmp_path, "stretch,stress [kPa]", np.linspace(1, 1.4, 101), 1.0)
    reading = read_file(path, preload="auto")
    assert reading.used.steps[2] == "no slack shows, so the stretch is counted as in the file"
    assert reading.experiment.least_errors == {}
    np.testing.assert_array_equal(reading.experiment.stretch, read_file(path).experiment.stretch)


@pytest.mark.parametrize("preload", ["auto", "0.5 kPa"])
def test_amounts_of_shear_are_counted_from_there_by_their_difference(tmp_path, preload):
    path = slack_file(tmp_path, "shear,shear stress [kPa]", np.linspace(0, 0.4, 101), 0.1)
    data = read_experiment(path, mode="simple-shear", preload=preload)
    assert data.stretch[-1] == pytest.approx(0.3, abs=0.01)
    assert data.stretch[0] == pytest.approx(0.0, abs=0.01)


def test_each_axis_of_a_sheet_is_counted_from_where_it_carries_load(tmp_path):
    way = np.linspace(0, 0.4, 161)
    force = [np.maximum(way - start, 0) for start in (0.05, 0.1)]
    rows = "".join(f"{1 + w:.6f},{1 + w:.6f},{a:.6f},{b:.6f}\n" for w, a, b in zip(way, *force, strict=True))
    path = text_file(tmp_path / "test.csv", "stretch x,stretch y,stress x [kPa],stress y [kPa]\n" + rows)
    data = read_experiment(path, mode="biaxial", preload="auto")
    np.testing.assert_allclose(data.stretch[-1], [1.4 / 1.05, 1.4 / 1.1], rtol=0.01)
    assert (data.stretch >= 0.999).all()
    assert 0 < data.least_errors["slack"] < 0.01


@pytest.mark.parametrize(
    ("moduli", "shortest"),
    [((1.0, 0.3, 10.0), 0.5), ((1.0, 3.0, 10.0), 0.5), ((1.0, 3.0, 1.0), 0.4), ((1.0, 10.0, 0.0), 0.4)],
)
def test_the_stiffening_of_an_elastic_material_in_compression_is_no_slack(moduli, shortest):
    # Yeoh: P = 2 (l - l^-2) (C10 + 2 C20 (I1 - 3) + 3 C30 (I1 - 3)^2); the same curve behind a fifth of the way is.
    def stress(stretch):
        c10, c20, c30 = moduli
        away = stretch**2 + 2 / stretch - 3
        return 2 * (stretch - stretch**-2) * (c10 + 2 * c20 * away + 3 * c30 * away**2)

    stretch = np.linspace(1, shortest, 80)
    assert find_slack(stretch, stress(stretch)) is None
    trembling = stretch + np.where(np.arange(80) % 2, 1e-5, 0.0)
    assert find_slack(trembling, stress(stretch)) is None
    start = 1 - 0.2 * (1 - shortest)
    slack = find_slack(stretch, stress(np.minimum(stretch / start, 1)))
    assert slack is not None
    assert slack.stretch == pytest.approx(start, abs=0.02 * (1 - shortest))
