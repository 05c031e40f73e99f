import numpy as np
import pytest

import tissuq as tq
from tissuq.errors import InputError
from tissuq.experiments import datasets
from tissuq.experiments.reading.assumptions import DOUBTFUL_UNIT
from tissuq.experiments.units import stress_units_in
from written_files import text_file

ROWS = "0,0\n0.1,2\n0.2,5\n"


@pytest.fixture
def written(tmp_path):
    def write(names, rows=ROWS):
        return text_file(tmp_path / "test.csv", f"{names}\n{rows}")

    return write


def doubts(inspection):
    return [text for text in inspection.warnings if text.startswith(DOUBTFUL_UNIT)]


@pytest.mark.parametrize(
    "name",
    [
        "Stress [kPa}",
        "Stress [kPa",
        "Stress {kPa}",
        "Stress <kPa>",
        "Stress (kPa]",
        "Engineering stress, kPa",
        '"Engineering stress, kPa"',
        "Stress: kPa",
        "Stress.kPa",
        "Stress-kPa",
        "Stress | kPa",
        "Stress; kPa",
        "stress_kpa",
        "Stress / kPa",
    ],
)
@pytest.mark.parametrize("strain", ["Strain", "Strain, mm/mm", "Strain (-)"])
def test_a_unit_beside_a_name_is_read_however_it_is_set_off(written, strain, name):
    data = tq.read_experiment(written(f"{strain},{name}"))
    np.testing.assert_allclose(data.stress, [0.0, 2e-3, 5e-3])
    np.testing.assert_allclose(data.stretch, [1.0, 1.1, 1.2])


def test_a_unit_in_odd_brackets_beneath_the_names_is_read(written):
    np.testing.assert_allclose(tq.read_experiment(written("Strain,Stress\n[%},[kPa}")).stress, [0.0, 2e-3, 5e-3])


def test_several_units_after_commas_are_joined_to_their_names(written):
    path = written("Time, s,Strain, %,Stress, kPa", "0,0,0\n1,10,2\n")
    data = tq.read_experiment(path)
    np.testing.assert_allclose((data.stretch[-1], data.stress[-1]), (1.1, 2e-3))


@pytest.mark.parametrize("head", ["# all stresses in kPa\n", "Units: mm and kPa\n", "Stress given in N/cm2\n"])
def test_a_unit_of_which_only_the_lines_above_speak_is_asked_about(written, head):
    path = written(f"{head}Strain,Stress")
    with pytest.raises(InputError, match=r"column 'Stress': no unit .* but line 1 speaks of .* \(--stress-unit "):
        tq.read_experiment(path)
    assert tq.read_experiment(path, stress_unit="kPa").stress[-1] == pytest.approx(5e-3)


def test_a_unit_within_a_name_is_asked_about(written):
    with pytest.raises(InputError, match="the name speaks of kPa"):
        tq.read_experiment(written("Strain,P in kPa of cycle 2"), columns={"stress": 2})


def test_numbers_too_large_for_mpa_are_asked_about(written):
    path = written("Strain,Stress", "0,0\n0.1,80\n0.2,250\n")
    with pytest.raises(InputError, match=r"250 MPa would be more than soft materials bear.*--stress-unit kPa"):
        tq.read_experiment(path)
    assert tq.read_experiment(path, stress_unit="Pa").stress[-1] == pytest.approx(250e-6)


def test_numbers_too_large_for_kpa_may_be_in_pa(written):
    with pytest.raises(InputError, match=r"2\.5e\+08 MPa would be more than soft materials bear.*--stress-unit Pa"):
        tq.read_experiment(written("Strain,Stress", "0,0\n0.1,8e7\n0.2,2.5e8\n"))


@pytest.mark.parametrize("top", [1.1, 1.5, 5.0])
def test_a_strain_that_may_be_percent_is_said_on_the_first_line(written, top):
    path = written("Strain,Stress (kPa)", f"0,0\n{top / 2},2\n{top},5\n")
    inspection = tq.inspect(path)
    (doubt,) = doubts(inspection)
    assert str(inspection).startswith(f"ATTENTION {DOUBTFUL_UNIT}")
    assert "--strain-unit % or --strain-unit 1" in doubt
    assert tq.inspect(path, strain_unit="%").reading.experiment.stretch[-1] == pytest.approx(1 + top / 100)
    assert tq.inspect(path, strain_unit="1").reading.experiment.stretch[-1] == pytest.approx(1 + top)
    assert not doubts(tq.inspect(path, strain_unit="1"))


def test_an_assumed_unit_of_stress_is_said_on_the_first_line(written):
    path = written("Strain,Stress")
    assert str(tq.inspect(path)).startswith(f"ATTENTION {DOUBTFUL_UNIT} the file states no unit of stress")
    assert not doubts(tq.inspect(path, stress_unit="MPa"))


@pytest.mark.parametrize("names", ["Strain,Stress", "Strain,Stress (kPa)"])
def test_reading_in_python_warns_of_an_assumed_unit(written, names):
    with pytest.warns(UserWarning, match=DOUBTFUL_UNIT):
        tq.read_experiment(written(names, "0,0\n0.7,2\n1.5,5\n"))


@pytest.mark.parametrize("names", ["Strain,Stress [kPa]", "Strain (%),Stress / MPa", "Strain [mm/mm],stress_Pa"])
def test_stated_units_raise_no_doubt(written, names):
    assert not doubts(tq.inspect(written(names)))


@pytest.mark.parametrize("name", datasets.names())
def test_the_data_sets_raise_no_doubt(name):
    mode = datasets.load(name).mode
    assert not doubts(tq.inspect(datasets.path(name), mode=mode))


@pytest.mark.parametrize("text", ["papa", "Specimen PA 7", "stress", "Parameter", "impact N/m", "psi angle"])
def test_words_that_only_look_like_units_of_stress(text):
    assert stress_units_in(text) in ([], ["psi"])
