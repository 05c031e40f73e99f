import numpy as np
import pytest

from tissuq.errors import InputError
from tissuq.experiments.reading.experiment_file import read_experiment, read_file

LENGTH, SLACK, STIFFNESS = 20.0, 1.5, 0.4
SPECIMEN = {"length": "20 mm", "area": "2 mm2"}


@pytest.fixture
def hanging(tmp_path):
    """A spring of 0.4 N/mm that hangs slack over the first 1.5 mm, pulled by 4 mm and let go."""
    up = np.linspace(0, 4, 41)
    displacement = np.concatenate([up, up[-2::-1]])
    force = np.maximum(displacement - SLACK, 0) * STIFFNESS
    path = tmp_path / "test.csv"
    rows = "".join(f"{d:.6f},{f:.6f}\n" for d, f in zip(displacement, force, strict=True))
    path.write_text("Disp (mm),Load (N)\n" + rows)
    return path


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
    path = tmp_path / "test.csv"
    path.write_text("stretch,stress [kPa]\n1.25,2\n1.5,4\n")
    reading = read_file(path, preload="1 kPa")
    np.testing.assert_allclose(reading.experiment.stretch, [1.0, 1.2])
    assert "in line 2, the first, where the stress is already 0.002 MPa" in reading.used.steps[2]


def test_compression_is_taut_by_the_size_of_its_stress(tmp_path):
    path = tmp_path / "test.csv"
    path.write_text("strain,stress [kPa]\n0,0\n-0.1,0\n-0.2,-10\n-0.3,-20\n")
    data = read_experiment(path, preload="5 kPa")
    np.testing.assert_allclose(data.stretch, [0.8 / 0.85, 0.7 / 0.85])


def test_cauchy_stress_is_divided_by_the_stretch_counted_from_the_preload(tmp_path):
    path = tmp_path / "test.csv"
    path.write_text("stretch,Cauchy stress [kPa]\n1.2,2\n1.5,4\n")
    data = read_experiment(path, stress_type="cauchy", preload="2 kPa")
    np.testing.assert_allclose(data.stress, [0.002, 0.004 / 1.25])


@pytest.mark.parametrize(
    ("preload", "words"),
    [
        ("5 N", "the preload 5 N is not reached: the largest stress is 0.5 MPa, and the preload is 2.5 MPa"),
        ("0.1", "a positive force or stress with its unit, such as '0.05 N', not '0.1'"),
        ("-1 N", "not '-1 N'"),
        ("1 g", "'g' is a mass, not a force"),
        ("1 mm", "'mm' is not a unit of stress"),
    ],
)
def test_a_preload_that_cannot_be_meant_is_refused(hanging, preload, words):
    with pytest.raises(InputError) as caught:
        read_experiment(hanging, dimensions=SPECIMEN, preload=preload)
    assert words in str(caught.value)


def test_a_force_is_no_preload_of_a_file_of_stresses(tmp_path):
    path = tmp_path / "test.csv"
    path.write_text("stretch,stress\n1,0\n1.1,2\n")
    with pytest.raises(InputError, match="is a force, but the file gives stresses"):
        read_experiment(path, preload="1 N")
