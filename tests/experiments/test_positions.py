import numpy as np
import pytest

import tissuq as tq
from machine_files import neo_hookean
from tissuq.errors import InputError
from tissuq.experiments.reading.experiment_file import read_file
from written_files import check_curve, message, text_file, written

LENGTH, AREA = 20.0, 10.0
SPECIMEN = {"length": "20 mm", "area": "10 mm2"}


def positions(folder, stretch, start, name="Displacement (mm)", unit=1.0, sign=1.0, noise=0.0, load="Load (N)", seed=0):
    """A test whose column of displacements begins at a position (mm)."""
    force = AREA * neo_hookean(stretch)
    force = force + noise * np.abs(force).max() * np.random.default_rng(seed).standard_normal(len(force))
    position = (start + LENGTH * (stretch - 1)) / unit
    return written(folder, f"{name},{load}", position, sign * force)


def ramp(top, rows=60, unloads=False):
    up = np.linspace(1, top, rows)
    return np.concatenate([up, up[-2::-1]]) if unloads else up


@pytest.mark.parametrize("name", ["Displacement (mm)", "Position (mm)", "Stroke (mm)"])
@pytest.mark.parametrize("start", [35.2, -5.0, 0.5, 120.0, -60.0, 20.0])
@pytest.mark.parametrize("top", [1.3, 0.7])
@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_positions_are_counted_from_their_first_row_with_a_note(tmp_path, name, start, top, noise):
    stretch = ramp(top, unloads=start > 0)
    inspection = tq.inspect(positions(tmp_path, stretch, start, name, noise=noise), dimensions=SPECIMEN)
    np.testing.assert_allclose(inspection.reading.experiment.stretch, stretch, atol=1e-6)
    assert any("does not begin at 0, and the load there is small" in note for note in inspection.warnings)


@pytest.mark.parametrize("start", [0.1, 0.3, -0.3])
@pytest.mark.parametrize("top", [1.3, 0.7])
@pytest.mark.parametrize("noise", [0.0, 0.002])
def test_a_small_offset_shows_by_a_load_that_begins_there(tmp_path, start, top, noise):
    stretch = ramp(top, rows=200)
    inspection = tq.inspect(positions(tmp_path, stretch, start, noise=noise), dimensions=SPECIMEN)
    np.testing.assert_allclose(inspection.reading.experiment.stretch, stretch, atol=1e-6)
    assert any("does not begin at 0" in note for note in inspection.warnings)


@pytest.mark.parametrize("zero", ["first", "35.2 mm", "3.52 cm"])
def test_the_zero_is_said_and_then_raises_no_note(tmp_path, zero):
    path = positions(tmp_path, ramp(1.3), 35.2)
    inspection = tq.inspect(path, dimensions=SPECIMEN, zero=zero)
    np.testing.assert_allclose(inspection.reading.experiment.stretch, ramp(1.3), atol=1e-6)
    assert not inspection.warnings
    assert "counted from 35.2 mm" in inspection.reading.experiment.source


def test_displacements_of_a_specimen_stretched_before_are_read_so_when_said(tmp_path):
    data = tq.read_experiment(positions(tmp_path, ramp(1.3), 2.0), dimensions=SPECIMEN, zero="0 mm")
    np.testing.assert_allclose(data.stretch, ramp(1.3) + 0.1, atol=1e-6)


def test_a_start_away_from_0_under_load_is_asked_about_with_every_answer(tmp_path):
    stretch = ramp(1.3)[20:]
    path = positions(tmp_path, stretch, 35.2 - 3)
    text = message(path, dimensions=SPECIMEN)
    for words in (
        "--zero first (stretch 1 to 1.198)",
        "--zero '0 mm' (stretch 2.",
        "--column 'length=Displacement (mm)'",
    ):
        assert words in text
    data = tq.read_experiment(path, dimensions=SPECIMEN, zero="32.2 mm")
    np.testing.assert_allclose(data.stretch, stretch, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("noise", [0.0, 0.02])
@pytest.mark.parametrize(
    "kind", ["tension", "compression", "both", "both from one end", "unloading", "taut at once", "cut"]
)
def test_displacements_are_read_as_before(tmp_path, kind, noise, seed):
    stretch = {
        "tension": ramp(1.3),
        "compression": ramp(0.6),
        "both": np.concatenate([ramp(1.2, unloads=True), ramp(0.8, unloads=True)]),
        "both from one end": np.linspace(0.8, 1.2, 80),
        "unloading": ramp(1.4)[::-1],
        "taut at once": ramp(1.5)[1:],
        "cut": ramp(1.3, rows=200)[8:],
    }[kind]
    inspection = tq.inspect(positions(tmp_path, stretch, 0.0, noise=noise, seed=seed), dimensions=SPECIMEN)
    np.testing.assert_allclose(inspection.reading.experiment.stretch, stretch, atol=1e-6)
    assert not any("begin at 0" in note for note in inspection.warnings)


@pytest.mark.parametrize(("name", "unit"), [("Gap (um)", 1e-3), ("Height [mm]", 1.0), ("Sample height / mm", 1.0)])
@pytest.mark.parametrize("start", [10.2, 20.0])
def test_heights_are_read_over_that_of_the_first_row(tmp_path, name, unit, start):
    height = np.linspace(start, start / 2, 60)
    path = written(tmp_path, f"{name},Normal force (N)", height / unit, -AREA * neo_hookean(height / start))
    with pytest.raises(InputError, match="--compression-positive"):
        tq.read_experiment(path, dimensions={"area": "10 mm2"})
    data = tq.read_experiment(path, dimensions={"area": "10 mm2"}, compression_positive=True)
    check_curve(data, height / start, neo_hookean(height / start), atol=1e-6)
    dimensions = {"area": "10 mm2", "length": f"{start} mm"}
    same = tq.read_experiment(path, dimensions=dimensions, compression_positive=True)
    np.testing.assert_allclose(same.stretch, data.stretch, rtol=1e-9)
    as_positions = tq.read_experiment(
        path, columns={"displacement": 1}, dimensions=dimensions, compression_positive=True, zero="first"
    )
    np.testing.assert_allclose(as_positions.stretch, data.stretch, rtol=1e-6)


def test_a_distance_of_grips_is_a_length_and_where_it_stays_a_size(tmp_path):
    stretch = ramp(1.3)
    force, grips = AREA * neo_hookean(stretch), 0 * stretch + 50
    path = written(tmp_path, "Grip separation (mm),Force (N),Gauge length (mm)", 50 * stretch, force, grips)
    data = tq.read_experiment(path, dimensions={"area": "10 mm2"})
    np.testing.assert_allclose(data.stretch, stretch, atol=1e-6)
    path = written(tmp_path, "Extension (mm),Force (N),Grip separation (mm)", 50 * (stretch - 1), force, grips)
    data = tq.read_experiment(path, dimensions={"area": "10 mm2"})
    np.testing.assert_allclose(data.stretch, stretch, atol=1e-6)


@pytest.mark.parametrize(
    ("rows", "words"),
    [("10.2,1\n10.2,2\n", "stays 10.2 mm long"), ("10.2,1\n-5,2\n", "cannot be -5 mm long")],
)
def test_what_cannot_be_a_height_is_refused(tmp_path, rows, words):
    path = text_file(tmp_path / "test.csv", "Gap (mm),Normal force (N)\n" + rows)
    with pytest.raises(InputError, match=words):
        tq.read_experiment(path, dimensions={"area": "10 mm2"})


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"zero": "35.2"}, "zero must be 'first', or a length with its unit"),
        ({"zero": "1 N"}, "'N' is not a unit of length"),
        ({"zero": "first", "columns": {"length": 1}}, "read as length, but zero='first' is given"),
    ],
)
def test_a_zero_that_cannot_be_meant_is_refused(tmp_path, options, words):
    with pytest.raises(InputError, match=words):
        tq.read_experiment(positions(tmp_path, ramp(1.3), 35.2), dimensions=SPECIMEN, **options)


def compliant(tmp_path, compliance, sign=1):
    """A specimen of 20 mm whose grips move further than it by 0.05 mm for every N, 10 N at 4 mm."""
    true = np.linspace(0, 4, 41)
    force = 2.5 * true
    path = written(tmp_path, "Displacement (um),Load (kN)", 1000 * (true + 0.05 * force), sign * force / 1000)
    return true, read_file(path, dimensions={"length": "20 mm", "area": "10 mm2"}, compliance=compliance)


@pytest.mark.parametrize("compliance", ["0.05 mm/N", "50 um/N", "50 mm/kN"])
def test_what_the_machine_gives_way_is_taken_off_displacements(tmp_path, compliance):
    true, reading = compliant(tmp_path, compliance)
    np.testing.assert_allclose(reading.experiment.stretch, 1 + true / 20, rtol=1e-6)
    assert reading.used.steps[0].endswith("of the machine's compliance times the force")


@pytest.mark.parametrize("compliance", ["0.05", "0.05 mm", "-1 mm/N", "0.05 N/mm", "mm/N"])
def test_a_compliance_that_is_none_is_refused(tmp_path, compliance):
    with pytest.raises(InputError, match=r"length|mass|unit"):
        compliant(tmp_path, compliance)


def test_a_machine_gives_way_in_the_direction_of_its_force_whatever_the_signs(tmp_path):
    true = np.linspace(0, 4, 41)
    path = written(tmp_path, "Displacement (mm),Load (N)", true + 0.05 * 2.5 * true, -2.5 * true)
    options = {"dimensions": {"length": "20 mm", "area": "10 mm2"}, "compression_positive": True}
    data = read_file(path, compliance="0.05 mm/N", **options).experiment
    np.testing.assert_allclose(data.stretch, 1 - true / 20, rtol=1e-5)


def test_a_compliance_is_refused_where_the_file_gives_strain_or_stress(tmp_path):
    path = text_file(tmp_path / "test.csv", "strain,stress [kPa]\n0,0\n0.1,1\n0.2,2")
    with pytest.raises(InputError, match="is read as strain and stress"):
        read_file(path, compliance="0.5 um/N")
