import numpy as np
import pytest

import tissuq as tq
from machine_files import neo_hookean, ramp
from tissuq.errors import InputError
from written_files import message, text_file

STIFFNESS = {"A": 1.0, "B": 1.1, "C": 1.2}


def written(folder, names, labels, rows=20, unloads=False, interleaved=False):
    """Tests of three specimens, one after another or row by row, with a column of labels."""
    up = np.linspace(1, 1.3, rows)
    stretch = np.concatenate([up, up[-2::-1]]) if unloads else up
    lines = [
        (label, value, 1e3 * factor * neo_hookean(np.array(value)))
        for label, factor in zip(labels, STIFFNESS.values(), strict=True)
        for value in stretch
    ]
    if interleaved:
        lines.sort(key=lambda line: line[1])
    text = "\n".join(f"{label},{value:.6f},{stress:.6f}" for label, value, stress in lines)
    return text_file(folder / "test.csv", f"{names},stretch,stress [kPa]\n{text}")


@pytest.mark.parametrize("unloads", [False, True])
@pytest.mark.parametrize("interleaved", [False, True])
@pytest.mark.parametrize(
    ("name", "labels"),
    [
        ("Specimen", "ABC"),
        ("specimen_id", "123"),
        ("Sample No.", "123"),
        ("Probe", "456"),
        ("Patient", ["x", "y", "z"]),
    ],
)
def test_specimens_of_a_column_are_not_pooled_and_the_advice_reads_one(tmp_path, name, labels, unloads, interleaved):
    path = written(tmp_path, name, labels, unloads=unloads, interleaved=interleaved)
    with pytest.raises(
        InputError, match=rf"names several tests.*--only '{name}={labels[0]}'.*--specimen-column '{name}'"
    ):
        tq.read_experiment(path)
    data = tq.read_experiment(path, only={name: labels[1]})
    np.testing.assert_allclose(data.stress, 1.1 * neo_hookean(data.stretch), atol=1e-6)
    assert len(data) == (39 if unloads else 20)
    assert f"only rows with '{labels[1]}' in column '{name}'" in data.source


@pytest.mark.parametrize("name", ["Region", "ID", "Probe 3 Ort", "x"])
def test_words_that_part_the_rows_into_tests_that_begin_anew_are_specimens_too(tmp_path, name):
    with pytest.raises(InputError, match="names several tests: 'cortex', 'corona', 'stem'"):
        tq.read_experiment(written(tmp_path, name, ["cortex", "corona", "stem"]))


@pytest.mark.parametrize("name", ["Specimen", "Region"])
def test_a_name_that_stands_only_in_the_first_row_of_its_test_is_of_all(tmp_path, name):
    path = written(tmp_path, name, ["cortex", "corona", "stem"])
    lines = path.read_text().splitlines()
    rows = [line if row % 20 == 0 else line[line.find(",") :] for row, line in enumerate(lines[1:])]
    path.write_text("\n".join([lines[0], *rows]) + "\n")
    with pytest.raises(InputError, match="names several tests: 'cortex', 'corona', 'stem'"):
        tq.read_experiment(path)
    data = tq.read_experiment(path, only={name: "corona"})
    assert len(data) == 20
    np.testing.assert_allclose(data.stress, 1.1 * neo_hookean(data.stretch), atol=1e-6)


def test_a_specimen_named_once_is_one_specimen(tmp_path):
    path = tmp_path / "test.csv"
    path.write_text("Specimen,stretch,stress [kPa]\nA,1,0\n" + "".join(f",{1 + k / 20},{k}\n" for k in range(1, 20)))
    assert len(tq.read_experiment(path)) == 20


@pytest.mark.parametrize(
    ("name", "labels"),
    [
        ("Specimen", "AAA"),
        ("Segment", ["Cycle 1", "Cycle 2", "Cycle 3"]),
        ("Cycle", "123"),
        ("cycle number", "123"),
        ("Step", "123"),
        ("Temperature", "123"),
    ],
)
def test_cycles_and_one_specimen_are_read_as_before(tmp_path, name, labels):
    assert len(tq.read_experiment(written(tmp_path, name, labels))) == 60


def test_numbers_that_may_be_of_steps_or_of_specimens_are_said(tmp_path):
    path = written(tmp_path, "Step", "123")
    (note,) = tq.inspect(path).warnings
    assert "all 3 cycles are used" in note
    assert "if column 'Step' numbers specimens, give --only 'Step=1'" in note
    assert len(tq.read_experiment(path, only={"Step": 1})) == 20


@pytest.mark.parametrize("name", ["No", "Mouse", "Test ID"])
def test_numbered_tests_that_are_not_unloaded_are_no_cycles(tmp_path, name):
    path = written(tmp_path, name, "123")
    with pytest.raises(InputError, match=f"--only '{name}=1'"):
        tq.read_experiment(path)
    assert [test.name for test in tq.read_tests(path)] == ["1", "2", "3"]


def test_numbers_of_animals_and_replicates_part_tests_together(tmp_path):
    path, up = tmp_path / "mice.csv", ramp()
    rows = [f"{m},{r},{s:.6f},{m * r * neo_hookean(s):.6f}" for m in (1, 2) for r in (1, 2) for s in up]
    path.write_text("\n".join(["Mouse,Replicate,Stretch,Stress (MPa)", *rows]) + "\n")
    tests = tq.read_tests(path)
    assert [test.name for test in tests] == ["1 1", "1 2", "2 1", "2 2"]
    for test, size in zip(tests, (1, 2, 2, 4), strict=True):
        np.testing.assert_allclose(test.stress, size * neo_hookean(up), atol=2e-6)


def test_two_specimens_are_no_population(tmp_path):
    path = written(tmp_path, "Specimen", "AAB")
    text = message(path)
    assert "--only 'Specimen=A'" in text
    assert "population" not in text


def test_phases_of_one_test_are_no_specimens(tmp_path):
    stretch = np.concatenate([np.linspace(1, 1.3, 30), np.full(10, 1.3), np.linspace(1.3, 1, 30)])  # up, held, down
    phases = ["Stretch"] * 30 + ["Hold"] * 10 + ["Recover"] * 30
    rows = "\n".join(f"{p},{s:.5f},{neo_hookean(s):.6f}" for p, s in zip(phases, stretch, strict=True))
    path = text_file(tmp_path / "test.csv", f"Phase,stretch,stress [MPa]\n{rows}")
    assert len(tq.read_experiment(path)) == 70


def test_tension_and_compression_of_one_specimen_are_one_test(tmp_path):
    stretch = np.concatenate([np.linspace(1, 1.3, 30), np.linspace(1, 0.7, 30)])
    names = ["tension"] * 30 + ["compression"] * 30
    rows = "\n".join(f"{n},{s:.5f},{neo_hookean(s):.6f}" for n, s in zip(names, stretch, strict=True))
    path = text_file(tmp_path / "test.csv", f"direction,stretch,stress [MPa]\n{rows}")
    assert len(tq.read_experiment(path)) == 60


@pytest.mark.parametrize("name", ["sample", "Sample no", "probe temperature", "specimen width [mm]"])
def test_running_numbers_and_measured_values_are_no_specimens(tmp_path, name):
    path = tmp_path / "test.csv"
    path.write_text(f"{name},stretch,stress [kPa]\n" + "".join(f"{k},{1 + k / 100},{k}\n" for k in range(40)))
    assert len(tq.read_experiment(path)) == 40


def test_a_value_that_is_not_there_is_refused_with_those_that_are(tmp_path):
    path = written(tmp_path, "Specimen", "ABC")
    with pytest.raises(InputError, match=r"column 'Specimen': no row has 'D' there. There are 'A', 'B', 'C'"):
        tq.read_experiment(path, only={"Specimen": "D"})
    with pytest.raises(InputError, match="no column 'Speciman'"):
        tq.read_experiment(path, only={"Speciman": "A"})


def test_lines_to_leave_out_are_of_the_test_that_has_them(tmp_path):
    path = written(tmp_path, "Specimen", "ABC")
    path.write_text(path.read_text().replace("C,1.000000,", "C,1.000000,x"))  # a cell that is no number, in line 42
    assert [len(test) for test in tq.read_tests(path, leave_out="42,30:31")] == [20, 18, 19]
    assert len(tq.read_experiment(path, only={"Specimen": "B"}, leave_out="42,30:31")) == 18
    assert tq.read_experiment(path, only={"Specimen": "A"}, leave_out="30:31").source.count("without") == 0
    with pytest.raises(InputError, match="no row to leave out in line 62; rows are in lines 2 to 61"):
        tq.read_tests(path, leave_out="62")


@pytest.mark.parametrize("name", ["mode", "Loading mode", "test_mode"])
@pytest.mark.parametrize("stated", ["equibiaxial", "Planar", "pure shear", "tension"])
def test_a_column_of_the_loading_mode_says_it(tmp_path, name, stated):
    path = written(tmp_path, name, [stated] * 3, interleaved=True)
    mode = {"equibiaxial": "equibiaxial", "tension": "uniaxial"}.get(stated, "planar")
    assert tq.read_experiment(path).mode.name == mode
    assert tq.read_experiment(path, mode="uniaxial").mode.name == "uniaxial"
    assert f"'{name}' is loading mode" in str(tq.inspect(path))


@pytest.mark.parametrize("interleaved", [False, True])
def test_rows_of_several_loading_modes_are_a_test_each(tmp_path, interleaved):
    modes = ["uniaxial", "equibiaxial", "planar"]
    tests = tq.read_tests(written(tmp_path, "mode", modes, interleaved=interleaved))
    assert [test.mode.name for test in tests] == modes
    for test, factor in zip(tests, STIFFNESS.values(), strict=True):
        np.testing.assert_allclose(test.stress, factor * neo_hookean(test.stretch), atol=1e-6)


def test_directions_of_different_reach_on_both_sides_of_rest_are_tests_of_their_own(tmp_path):
    reaches = {"FS": 0.34, "SF": 0.30, "NF": 0.41}  # they begin 14 % of the range of all apart
    lines = [f"{name},{x:.6f},{x:.6f}" for name, end in reaches.items() for x in np.linspace(-end, end, 40)]
    path = text_file(tmp_path / "shear.csv", "direction,shear,stress [kPa]\n" + "\n".join(lines) + "\n")
    tests = tq.read_tests(path, mode="simple-shear")
    assert {test.direction: test.stretch.max() for test in tests} == pytest.approx(reaches)


def test_cycles_whose_way_back_was_measured_stay_one_test_where_they_begin_apart(tmp_path):
    there = np.linspace(-0.3, 0.3, 20)
    lines = [
        f"{name},{begin + x:.6f},{begin + x:.6f}"
        for name, begin in (("first", 0.0), ("second", -0.1))
        for x in [*there, *there[::-1]]
    ]
    path = text_file(tmp_path / "shear.csv", "part,shear,stress [kPa]\n" + "\n".join(lines) + "\n")
    assert len(tq.read_tests(path, mode="simple-shear")) == 1


def test_protocols_of_a_sheet_that_hold_either_axis_are_tests_of_their_own(tmp_path):
    rise = np.linspace(0, 0.25, 20)
    ends = {"off": (0.6, 0.5), "equi": (0.6, 1.0), "strip-x": (0.6, 0.0), "strip-y": (0.0, 1.0)}
    lines = [
        f"{name},{1 + along * x:.6f},{(along + across / 2) * x:.6f},{1 + across * x:.6f},{(across + along / 2) * x:.6f}"
        for name, (along, across) in ends.items()
        for x in rise
    ]
    path = tmp_path / "sheet.csv"
    path.write_text("protocol,stretch x,stress x [kPa],stretch y,stress y [kPa]\n" + "\n".join(lines) + "\n")
    tests = tq.read_tests(path)
    assert [test.name for test in tests] == list(ends)
    for test, (along, across) in zip(tests, ends.values(), strict=True):
        np.testing.assert_allclose(test.stretch[-1], [1 + 0.25 * along, 1 + 0.25 * across])
