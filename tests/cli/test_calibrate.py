"""`tissuq calibrate`, as a user runs it."""

from __future__ import annotations

import json

import numpy as np
import pytest

import tissuq as tq
from command_line import done_in, run_in
from tissuq.studies.calibration import _are_proportional, _stresses_of_specimens

from .conftest import rows_of, tree

MODEL = """
import numpy as np


def force(parameters, depth):
    if parameters["b"] > 5.0:
        raise RuntimeError("the solver has not converged")
    return parameters["mu"] * np.expm1(parameters["b"] * depth)


def wrong(parameters):
    return [1.0, 2.0]


def failing(parameters, depth):
    raise RuntimeError("no licence")
"""
PRIORS = ["--prior", "mu=uniform(0.2,3)", "--prior", "b=uniform(0.5,6)"]
USUAL = [*PRIORS, "--noise-sd", 0.02, "--runs", 16]


def write_all(folder):
    depth = np.linspace(0.05, 0.7, 12)
    noise = 0.02 * np.random.default_rng(0).standard_normal(12)
    rows = zip(depth, 1.1 * np.expm1(2.4 * depth) + noise, strict=True)
    text = "".join(f"{a:.4f},{b:.5f}\n" for a, b in rows)
    (folder / "punch.csv").write_text("depth (mm),force (mN)\n" + text)
    (folder / "force.py").write_text(MODEL)


@pytest.fixture(scope="session")
def calibrate_run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("calibrate")
    write_all(folder)
    options = [*USUAL, "--discrepancy", "gp-pinned", "--out", "run"]
    said = done_in(folder, "calibrate", "punch.csv", "--forward", "force.py:force", *options)
    return folder, said


def test_a_run_leaves_the_promised_files(calibrate_run):
    folder, said = calibrate_run
    found = {name for name, content in tree(folder / "run").items() if content is not None}
    figures = {
        f"figures/{name}.{kind}" for name in ("answer", "band", "emulator", "marginals") for kind in ("svg", "png")
    }
    tables = {"summary.csv", "summary.json", "prediction.csv", "forward_runs.csv", "calibration.nc",
              "leave_one_out.csv", "sensitivity.csv"}  # fmt: skip
    files = {"input/punch.csv", "input/force.py", "report.html", "result.json", "run.toml", "contents.txt"}
    files |= {"tissuq.log"}
    assert found == figures | tables | files
    for words in ("force.py:force: 16 runs", "each left out", "the solver has not converged", "run-forward-runs"):
        assert words in " ".join(said.out.split())
    page = (folder / "run" / "report.html").read_text()
    assert all(
        words in page
        for words in (
            "against &#39;depth",
            "Runs that failed",
            "predicted worst from the others",
            "What the outputs depend on",
            "depth (mm)",
            "<td>mu</td>",
        )
        if words != "depth (mm)"
    )


def test_a_page_says_for_what_the_parameters_can_be_used_and_what_those_of_the_errors_are(calibrate_run):
    folder, _ = calibrate_run
    record = json.loads((folder / "run" / "result.json").read_text())
    uses = {use["purpose"]: use["verdict"] for use in record["uses"]}
    assert uses == {
        "report mu and b": "with care",  # of the variance the emulator makes more than a tenth
        "predict this experiment": "yes",
        "use mu and b in another model": "yes",
    }
    (table,) = record["tables"]
    assert {row[0]: row[1] for row in table["rows"]} == {
        "mu": "of the forward model",
        "b": "of the forward model",
        "c [mN]": "sd of the discrepancy",
        "psi [mm]": "length of the discrepancy",
    }


def test_the_text_for_a_paper_has_model_data_priors_emulator_and_result(calibrate_run):
    folder, _ = calibrate_run
    record = json.loads((folder / "run" / "result.json").read_text())
    (text,) = next(section["text"] for section in record["sections"] if section["title"].startswith("Text for"))
    for words in (
        f"The model force.py:force was calibrated by Bayesian inference with tissuq {tq.__version__} to",
        "is a Gaussian process with the covariance",
        "('gp-pinned' of tissuq",
        "Priors: mu ",
        "was made from 16 runs",
    ):
        assert words in text
    mu = next(number for number in record["numbers"] if number["name"] == "mu")
    assert f"mu {mu['text']} (" in text


def test_the_parameters_are_found_and_the_runs_listed(calibrate_run):
    folder, _ = calibrate_run
    rows = {row["parameter"]: row for row in json.loads((folder / "run" / "summary.json").read_text())}
    assert list(rows) == ["mu", "b", "c", "psi"]
    assert rows["mu"]["hdi_low"] < 1.1 < rows["mu"]["hdi_high"]
    assert rows["b"]["hdi_low"] < 2.4 < rows["b"]["hdi_high"]
    runs = rows_of(folder / "run" / "forward_runs.csv")
    assert len(runs) == 16
    for run in runs:
        assert ("solver" in run["error"]) == (float(run["b"]) > 5) == (run["output_1"] == "")
    band = rows_of(folder / "run" / "prediction.csv")
    assert sum(float(row["low"]) < float(row["measured"]) < float(row["high"]) for row in band) >= 10


@pytest.mark.slow
def test_the_next_step_names_all_options_that_a_law_needs(tmp_path):
    """Where the emulator is good enough beside the noise, here an unknown one."""
    write_all(tmp_path)
    options = [*PRIORS, "--runs", 16, "--discrepancy", "gp-pinned", "--no-figures", "--out", "run"]
    said = run_in(tmp_path, "calibrate", "punch.csv", "--forward", "force.py:force", *options)
    assert "--material LAW --range LOW:HIGH --force" in " ".join(said.out.split())


@pytest.mark.slow
def test_lines_are_left_out_as_the_message_says(calibrate_run, tmp_path):
    folder, _ = calibrate_run
    write_all(tmp_path)
    heading, *rows = (tmp_path / "punch.csv").read_text().splitlines(keepends=True)
    (tmp_path / "punch.csv").write_text("".join([heading, *rows[:3], "0.2,slipped\n", *rows[3:]]))
    options = [*USUAL, "--discrepancy", "gp-pinned", "--no-figures", "--out", "run"]
    arguments = ["calibrate", "punch.csv", "--forward", "force.py:force", *options]
    refused = run_in(tmp_path, *arguments)
    assert refused.status == 2
    assert "--leave-out 5 " in refused.err
    done_in(tmp_path, *arguments, "--leave-out", 5)
    assert (tmp_path / "run" / "summary.csv").read_bytes() == (folder / "run" / "summary.csv").read_bytes()


@pytest.mark.slow
def test_a_run_is_repeated_from_its_own_folder_when_the_model_is_named(calibrate_run):
    folder, _ = calibrate_run
    again = ["--config", "run/run.toml", "--no-figures", "--out", "again"]
    refused = run_in(folder, "calibrate", *again)
    assert refused.status == 2
    assert "used only if named here, too; if you know them, add --forward input/force.py:force" in refused.err
    done_in(folder, "calibrate", "--forward", "run/input/force.py:force", *again)
    assert (folder / "again" / "summary.csv").read_bytes() == (folder / "run" / "summary.csv").read_bytes()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["punch.csv", *USUAL], "give one forward model"),
        (["--forward", "force.py:force", *USUAL], "give a FILE"),
        (["punch.csv", "--forward", "no.py:force", *USUAL], "no file 'no.py'"),
        (["punch.csv", "--forward", "force.py:force", "--runs", 8], "give the --prior of every parameter"),
        (["punch.csv", "--forward", "force.py:force", *PRIORS, "--runs", 2], "runs or more, and 2 are requested"),
        (["punch.csv", "--forward", "force.py:wrong", *USUAL], "shape (2,)"),
        (["punch.csv", "--forward", "force.py:failing", *USUAL, "--out", "runs/punch"], "no licence"),
        (["punch.csv", "--forward", "force.py:force", *USUAL, "--control", "depth"], "name the column of the control"),
        (["punch.csv", "--forward", "force.py:force", *USUAL, "--control", "x", "--measured", "2"], "no column 'x'"),
        (["punch.csv", "--forward", "force.py:force", *USUAL, "--control", "2", "--measured", "2"], "the same column"),
        (["punch.csv", "--forward", "force.py:force", *PRIORS, "--noise-sd", "loud"], "--noise-sd"),
        (["punch.csv", "--forward", "force.py:force", *USUAL, "--kernel", "cubic"], "kernel"),
        (["punch.csv", "--forward", "force.py:force", *USUAL, "--discrepancy", "auto"], "cannot be used with"),
        (["punch.csv", "--umbridge", "http://127.0.0.1:9", *USUAL], "UM-Bridge"),
        (
            ["punch.csv", "--forward", "force.py:force", *USUAL, "--timeout", 5, "--keep"],
            "--timeout and --keep: only a",
        ),
    ],
)
def test_bad_input_gives_one_message_and_leaves_nothing(cli, here, arguments, words):
    write_all(here)
    said = cli("calibrate", *arguments)
    assert said.status == 2
    assert words in said.err
    assert "Traceback" not in said.err
    assert {path.name for path in here.iterdir()} - {"__pycache__"} == {"punch.csv", "force.py"}


def test_a_server_that_a_configuration_names_is_asked_only_when_the_command_line_names_it(cli, here, monkeypatch):
    write_all(here)
    asked = []
    monkeypatch.setattr("tissuq.emulation.forward.UmbridgeForward.check", lambda *each: asked.append(each))
    (here / "own.toml").write_text(
        'file = "punch.csv"\numbridge = "http://127.0.0.1:9"\n'
        '[priors]\nmu = { distribution = "uniform", low = 0.2, high = 3.0 }\n'
    )
    said = cli("calibrate", "--config", "own.toml")
    assert (said.status, asked) == (2, [])
    assert "add --umbridge http://127.0.0.1:9" in said.err


def test_a_calibration_without_a_law_says_what_other_commands_need(calibrate_run):
    folder, _ = calibrate_run
    said = run_in(folder, "predict", "run")
    assert said.status == 2
    assert "repeat tissuq calibrate with the law of the model" in " ".join(said.err.split())


PUNCH = """
def force(parameters, depth):
    stretch = 1 - depth
    return 2 * parameters["C10"] * (stretch**-2 - stretch)
"""


def write_cube(folder, heading):
    """Write seven measurements, as many as other tests of one parameter have: what is compiled serves all of them."""
    (folder / "cube.py").write_text(PUNCH)
    rows = [(depth, 3 * ((1 - depth) ** -2 - (1 - depth))) for depth in np.linspace(0.05, 0.3, 7)]
    (folder / "cube.csv").write_text(f"depth,{heading}\n" + "".join(f"{a:.4f},{b:.5f}\n" for a, b in rows))


@pytest.mark.slow
def test_a_material_that_was_calibrated_is_predicted_and_exported_from_the_run(tmp_path):
    write_cube(tmp_path, "force")
    usual = ["--forward", "cube.py:force", "--prior", "C10=uniform(0.5,10)", "--noise-sd", 0.02, "--runs", 8]
    material = ["--material", "neo-hookean", "--range", "0.7:1.2", "--unit", "kPa", "--no-figures"]
    done_in(tmp_path, "calibrate", "cube.csv", *usual, *material, "--discrepancy", "none", "--out", "run")
    said = done_in(tmp_path, "predict", "run", "--at", "1.1", "--out", "predicted", "--no-figures")
    assert "fitted to what a forward model was calibrated on" in " ".join(said.out.split())
    assert "measurements)" not in said.out  # the points of the range are none
    row = rows_of(tmp_path / "predicted" / "prediction.csv")[0]
    median = next(float(value) for name, value in row.items() if "median" in name or name.endswith("[kPa]"))
    assert median == pytest.approx(3 * (1.1 - 1.1**-2), rel=0.01)  # kPa
    done_in(tmp_path, "predict", "run", "--mode", "planar", "--points", 3, "--out", "planar", "--no-figures")
    (use,) = json.loads((tmp_path / "planar" / "result.json").read_text())["uses"]
    assert (use["purpose"], use["verdict"]) == ("predict other loading modes", "with care")  # without a discrepancy
    assert use["reason"].endswith("if the model is right: its errors are not included")
    done_in(tmp_path, "export", "run", "--draws", 2, "--out", "cards")


def test_stresses_in_another_unit_than_the_law_are_refused_until_the_unit_of_the_model_is_said(tmp_path):
    write_cube(tmp_path, "stress (kPa)")
    usual = ["calibrate", "cube.csv", "--forward", "cube.py:force", "--prior", "C10=uniform(0.5,10)", "--runs", 8]
    usual += ["--noise-sd", 0.02, "--discrepancy", "none", "--no-figures"]
    material = ["--material", "neo-hookean", "--range", "0.7:1.2", "--out", "run"]
    said = run_in(tmp_path, *usual, *material)
    assert said.status == 2
    assert "--unit kPa or --unit MPa" in " ".join(said.err.split())
    assert not list(tmp_path.glob("run*"))
    said = done_in(tmp_path, *usual, *material, "--unit", "kPa")
    assert "kPa, 95 % interval" in said.out


@pytest.fixture
def no_runs(monkeypatch):
    """End a calibration where its runs would begin, with a message."""

    def begin(*arguments, **options):
        raise tq.InputError("here runs begin")

    monkeypatch.setattr("tissuq.studies.calibration.calibrate", begin)


@pytest.mark.usefixtures("no_runs")
@pytest.mark.parametrize(("force", "is_refused"), [("mN", True), ("N", False)])
def test_forces_and_depths_that_go_with_another_unit_than_the_law_are_refused(cli, here, force, is_refused):
    (here / "punch.py").write_text("def force(parameters, depth):\n    return 16 * parameters['C10'] * depth\n")
    rows = "".join(f"{depth / 10},{16 * 1.5 * depth / 10}\n" for depth in range(1, 13))
    (here / "punch.csv").write_text(f"depth (mm),force ({force})\n{rows}")
    usual = ["calibrate", "punch.csv", "--forward", "punch.py:force", "--prior", "C10=uniform(0.5,10)", "--runs", 8]
    usual += ["--noise-sd", 0.02, "--discrepancy", "none", "--no-figures"]
    said = cli(*usual, "--material", "neo-hookean", "--range", "0.7:1.2")
    assert ("here runs begin" in said.err) != is_refused, said.err
    words = "the forces are in mN and the controls in mm, and the parameters of neo-hookean would be taken in MPa"
    assert (words in said.err and "--unit kPa or --unit MPa" in said.err) == is_refused


@pytest.mark.usefixtures("no_runs")
@pytest.mark.parametrize(("unit", "is_refused"), [("mmHg", True), ("MPa", False)])
def test_pressures_in_another_unit_than_the_law_are_refused(cli, here, unit, is_refused):
    write_cube(here, f"pressure ({unit})")
    usual = ["calibrate", "cube.csv", "--forward", "cube.py:force", "--prior", "C10=uniform(0.5,10)", "--runs", 8]
    usual += ["--noise-sd", 0.02, "--discrepancy", "none", "--no-figures"]
    said = cli(*usual, "--material", "neo-hookean", "--range", "0.7:1.2")
    assert ("here runs begin" in said.err) != is_refused, said.err
    assert ("--unit mmHg or --unit MPa" in " ".join(said.err.split())) == is_refused


def test_of_columns_of_one_name_the_number_is_asked_for(refused, here):
    write_all(here)
    (here / "two.csv").write_text("depth,force,depth,force\n0.1,1,0.1,2\n0.2,2,0.2,4\n")
    refused(
        ["has 2 columns 'depth': give the number of one, 1 or 3"],
        "calibrate",
        "two.csv",
        "--forward",
        "force.py:force",
        *USUAL,
        "--control",
        "depth",
        "--measured",
        "force",
    )


def test_several_specimens_are_refused_until_one_is_read(tmp_path):
    write_cube(tmp_path, "force (mN)")
    heading, *rows = (tmp_path / "cube.csv").read_text().splitlines()
    others = [f"{depth},{1.5 * float(force):.5f}" for depth, force in (row.split(",") for row in rows)]
    labelled = [f"{name},{row}" for name, test in (("S1", rows), ("S2", others)) for row in test]
    (tmp_path / "both.csv").write_text("\n".join([f"specimen,{heading}", *labelled]))
    arguments = ["calibrate", "both.csv", "--forward", "cube.py:force", "--prior", "C10=uniform(0.5,10)"]
    arguments += ["--noise-sd", 0.02, "--discrepancy", "none", "--runs", 8, "--control", "depth", "--measured", "force"]
    arguments += ["--no-figures"]
    said = run_in(tmp_path, *arguments, "--out", "run")
    assert said.status == 2
    assert "column 'specimen' names several tests: 'S1', 'S2'. To read one of them give --only 'specimen=S1'." in (
        " ".join(said.err.split())
    )
    assert not list(tmp_path.glob("run*"))
    done_in(tmp_path, *arguments, "--only", "specimen=S2", "--out", "run")
    measured = [float(row["measured"]) for row in rows_of(tmp_path / "run" / "prediction.csv")]
    assert measured == [float(row.split(",")[1]) for row in others]
    by_sensor = [f"S{1 + number % 2},{row}" for number, row in enumerate(rows)]
    (tmp_path / "both.csv").write_text("\n".join([f"sensor,{heading}", *by_sensor]))  # of one test, which a model knows
    done_in(tmp_path, *arguments, "--out", "sensors")


TENSION = """
def stress(parameters, stretch):
    return 2 * parameters["C10"] * (stretch - stretch**-2)
"""


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """A run whose file is in kPa; of its rows, the first are not fitted."""
    folder = tmp_path_factory.mktemp("fitted")
    (folder / "tension.py").write_text(TENSION)
    stretch = np.round(np.linspace(1.0, 1.3, 16), 3)
    stress = 6 * (stretch - stretch**-2) + 0.02 * np.random.default_rng(4).standard_normal(16)
    rows = list(zip(stretch, np.round(stress, 4), strict=True))
    (folder / "tension.csv").write_text("stretch,stress (kPa)\n" + "".join(f"{a},{b}\n" for a, b in rows))
    (folder / "again.csv").write_text("l,force (N)\n" + "".join(f"{a},{20e-6 * b:.5g}\n" for a, b in rows[4:]))
    options = ["--discrepancy", "none", "--stretch", "1.07:1.3", "--no-figures", "--out", "run"]
    done_in(folder, "fit", "tension.csv", *options)
    return folder


@pytest.mark.parametrize(
    "file",
    [
        "tension.csv",  # all rows of the file, of which the run fitted some
        "again.csv",  # those that it fitted, as forces and to five digits
    ],
)
@pytest.mark.parametrize("source", ["run", "run/posterior/none.nc"])
def test_the_posterior_of_the_measurements_is_no_prior_of_them(fitted, file, source):
    options = ["--forward", "tension.py:stress", "--material", "neo-hookean", "--range", "1:1.3", "--unit", "kPa"]
    said = run_in(fitted, "calibrate", file, *options, "--prior-run", source, "--runs", 8, "--out", "out")
    assert said.status == 2
    assert "which would count twice" in " ".join(said.err.split())
    assert not list(fitted.glob("out*"))


def test_the_stresses_of_every_specimen_are_looked_at_in_a_population(tmp_path):
    """The short version, of its measurements alone: successive ones, also of every second row."""
    rows = [("S1", 1.0, 1.5), ("S1", 1.1, 2.5), ("S2", 1.0, 3.5), ("S2", 1.1, 4.5), ("S2", 1.2, 6.5)]
    text = "specimen,stretch,stress [kPa]\n" + "".join(f"{name},{at},{stress}\n" for name, at, stress in rows)
    (tmp_path / "data.csv").write_text(text)
    (tmp_path / "posterior").mkdir()
    posterior = tmp_path / "posterior" / "new-patient.nc"
    posterior.touch()
    for run in (tmp_path, posterior):
        found = [values.tolist() for values in _stresses_of_specimens(run, 2, 1)]
        assert found == [[1.5, 2.5], [3.5, 4.5], [4.5, 6.5]]
    assert [values.tolist() for values in _stresses_of_specimens(tmp_path, 2, 2)] == [[3.5, 6.5]]
    (tmp_path / "data.csv").write_text("stretch,stress [kPa]\n1.0,1.5\n1.1,2.5\n")  # of a fit, whose posterior has it
    assert list(_stresses_of_specimens(tmp_path, 2, 1)) == []


@pytest.mark.slow
@pytest.mark.parametrize(("rows", "is_one"), [("all", True), ("some, as forces", True), ("another", False)])
def test_a_specimen_of_a_population_is_not_calibrated_beside_its_posterior(tmp_path, rows, is_one):
    """The file of the population holds all specimens; what is calibrated, one of them, or some of its rows."""
    stretch, rng = np.round(np.linspace(1.0, 1.3, 14), 3), np.random.default_rng(6)
    stresses = {
        name: np.round(modulus * (stretch - stretch**-2) + 0.02 * rng.standard_normal(14), 4)
        for name, modulus in (("S1", 5.0), ("S2", 6.0), ("S3", 7.0), ("S4", 6.5))
    }
    files = {"all": stresses["S2"], "some, as forces": 0.02 * stresses["S2"], "another": stresses.pop("S4")}
    lines = [f"{name},{a},{b}" for name, values in stresses.items() for a, b in zip(stretch, values, strict=True)]
    (tmp_path / "all.csv").write_text("\n".join(["specimen,stretch,stress (kPa)", *lines]) + "\n")
    done_in(tmp_path, "population", "all.csv", "--mode", "uniaxial", "--discrepancy", "none", "--noise-sd", 0.02,
                  "--no-figures", "--out", "tissue")  # fmt: skip
    taken = slice(3, 12) if rows == "some, as forces" else slice(None)
    lines = [f"{a},{b:.5g}" for a, b in zip(stretch[taken], files[rows][taken], strict=True)]
    (tmp_path / "one.csv").write_text("\n".join(["stretch,measured (kPa)", *lines]) + "\n")
    (tmp_path / "tension.py").write_text(TENSION)
    options = ["--forward", "tension.py:stress", "--material", "neo-hookean", "--range", "1:1.3", "--unit", "kPa"]
    options += ["--prior-run", "tissue", "--noise-sd", 0.02, "--runs", 8, "--no-figures", "--out", "out"]
    said = run_in(tmp_path, "calibrate", "one.csv", *options)
    assert said.status == (2 if is_one else 0), said.err
    assert ("which would count twice" in " ".join(said.err.split())) is is_one


def test_the_posterior_of_other_measurements_is_a_prior(fitted):
    rows = [row.split(",") for row in (fitted / "tension.csv").read_text().splitlines()[3::2]]
    noise = 0.02 * np.random.default_rng(5).standard_normal(len(rows))
    other = "".join(f"{a},{float(b) + error:.4f}\n" for (a, b), error in zip(rows, noise, strict=True))
    (fitted / "other.csv").write_text("stretch,stress (kPa)\n" + other)
    options = ["--forward", "tension.py:stress", "--material", "neo-hookean", "--range", "1:1.3", "--unit", "kPa"]
    options += ["--noise-sd", 0.02, "--discrepancy", "none", "--no-figures"]
    done_in(fitted, "calibrate", "other.csv", *options, "--prior-run", "run", "--runs", 8, "--out", "other")


@pytest.mark.parametrize(
    ("stress", "force", "is_same"),
    [
        ([1.0, 2.1, 3.3, 4.6], [20.0, 42.0, 66.0, 92.0], True),
        ([1.0, 2.1, 3.3, 4.6], [20.0, 42.0, 66.0, 93.0], False),
        ([1.0, 2.0, 3.0, 4.0], [20.0, 40.0, 60.0, 80.0], False),  # equal steps of load, which other tests have as well
        ([1.0, 2.1, 3.3], [20.0, 42.0, 66.0], False),  # so few may be proportional by chance
    ],
)
def test_measurements_in_another_unit_are_known_by_their_ratios(stress, force, is_same):
    assert _are_proportional(np.array(stress), np.array(force)) == is_same


def test_a_material_without_its_range_or_parameters_is_refused_before_any_run(tmp_path):
    write_all(tmp_path)
    usual = ["calibrate", "punch.csv", "--forward", "force.py:force", *USUAL, "--out", "run"]
    said = run_in(tmp_path, *usual, "--material", "neo-hookean")
    assert said.status == 2
    assert "give --material LAW --range 0.7:1.3" in " ".join(said.err.split())
    said = run_in(tmp_path, *usual, "--material", "neo-hookean", "--range", "0.7:1.2")
    assert said.status == 2
    assert "calibrated without C10" in " ".join(said.err.split())
    assert not (tmp_path / "run").exists()
