"""`tissuq predict`, as a user runs it."""

from __future__ import annotations

import json

import pytest

from .conftest import rows_of, tree

PLANAR_KPA = "# mode: planar\nstretch,stress_kPa\n1.0,0.0\n1.1,34.9\n1.2,62.5\n1.8,160.0\n"
"""100 (l - l^-3) kPa, C10 = 50 kPa, but for a few tenths."""


@pytest.fixture
def run(fit_run, here):
    """A run of tissuq fit, as seen from the current folder, with the discrepancies none, constant and gp."""
    (here / "run").symlink_to(fit_run[0])
    return "run"


@pytest.fixture
def planar(here):
    (here / "planar.csv").write_text(PLANAR_KPA)
    return "planar.csv"


def test_a_mode_is_predicted(done, here, run):
    said = done("predict", run, "--mode", "planar", "--at", "0.9:2.5", "--points", 9, "--discrepancy", "none")
    words = " ".join(said.out.split())
    assert "Stress in mode planar, kPa" in words
    assert "points lie outside the measured range: in mode planar the run is calibrated from" in words
    found = rows_of(here / "run-planar" / "prediction.csv")
    assert [float(row["stretch"]) for row in found] == pytest.approx([0.9 + 0.2 * place for place in range(9)])
    assert {row["is_calibrated"] for row in found} == {"True", "False"}
    # C10 is about 50 kPa: 2 C10 (l - l^-3).
    assert float(found[2]["alone_median [kPa]"]) == pytest.approx(100 * (1.3 - 1.3**-3), rel=0.03)
    assert (here / "run-planar" / "figures" / "prediction.png").exists()


def test_a_prediction_in_a_folder_behind_a_symbolic_link_is_repeated(done, here, run):
    (here / "deep" / "mine").mkdir(parents=True)
    (here / "mine").symlink_to("deep/mine")
    options = ["--mode", "planar", "--points", 3, "--discrepancy", "none", "--no-figures", "--out", "mine/planar"]
    done("predict", run, *options)
    done("predict", "--config", "mine/planar/run.toml", "--no-figures", "--out", "again")
    assert rows_of(here / "again" / "prediction.csv") == rows_of(here / "mine" / "planar" / "prediction.csv")


def test_the_name_of_a_file_says_its_mode_as_for_a_fit(done, here, run):
    (here / "planar sheet.csv").write_text(PLANAR_KPA.partition("\n")[2])
    said = done("predict", run, "--data", "planar sheet.csv", "--discrepancy", "none", "--no-figures", "--out", "out")
    assert "Predicted stress: planar" in said.out


def test_measurements_are_compared_with_and_the_prediction_repeats(done, here, run, planar):
    options = ["--discrepancy", "none", "--points", 5, "--no-figures"]
    said = done("predict", run, "--data", planar, *options, "--stress", "cauchy")
    assert "Measurements of planar" in said.out
    scores = json.loads((here / "run-planar" / "scores.json").read_text())
    assert [row["range"] for row in scores] == ["all", "calibrated", "beyond"]
    assert scores[0]["count"] == 3
    assert scores[1]["error"] < 0.05
    (here / planar).unlink()
    again = done("predict", "--config", "run-planar/run.toml", "--no-figures", "--out", "elsewhere/again")
    first, second = tree(here / "run-planar"), tree(here / "elsewhere" / "again")
    assert first.keys() == second.keys()
    differ = {name for name in first if first[name] != second[name]}
    assert differ == {"run.toml", "report.html", "tissuq.log"}  # which name the run from where they are, and the time
    assert again.out.replace("elsewhere/again", "run-planar") == said.out


def test_columns_and_cauchy_stress_of_the_file_can_be_said(done, here, run):
    (here / "odd.csv").write_text("lambda,sigma\n1.1,38.4\n1.2,75.0\n")
    words = ["--column", "stretch=lambda", "--column", "stress=sigma", "--stress-unit", "kPa"]
    words += ["--data-stress-type", "cauchy", "--mode", "planar", "--discrepancy", "none", "--no-figures"]
    done("predict", run, "--data", "odd.csv", *words, "--out", "odd")
    (row,) = json.loads((here / "odd" / "scores.json").read_text())
    assert row["error"] < 0.05


def test_an_error_of_the_stress_is_said_to_be_left_out(done, run):
    said = done("predict", run, "--discrepancy", "gp", "--mode", "equibiaxial", "--no-figures", "--points", 3)
    assert "does not apply to the equibiaxial stress" in " ".join(said.out.split())


def test_two_controls_are_given_apart(done, here, run):
    words = ["--mode", "biaxial", "--at", "1:1.2", "--at2", "1.1", "--points", 3, "--discrepancy", "none"]
    done("predict", run, *words, "--no-figures")
    assert [row["stretch2"] for row in rows_of(here / "run-biaxial" / "prediction.csv")] == ["1.1"] * 6


BAD = [
    ([], ["RUN", "--config"]),
    (["nowhere"], ["there is no run folder 'nowhere'"]),
    (["."], ["no posterior of a material", "give the folder of a run of tissuq fit"]),
    (["RUN"], ["has several discrepancies", "constant, gp, none"]),
    (["RUN", "--discrepancy", "cubic"], ["'cubic'", "constant"]),
    (["RUN", "--discrepancy", "none", "--mode", "torsion"], ["'torsion'", "planar", "For torsion take 'simple-shear'"]),
    (["RUN", "--discrepancy", "none", "--at", "0.7-2"], ["'0.7-2'", "0.7:2.0"]),
    (["RUN", "--discrepancy", "none", "--at", "2:0.7"], ["'2:0.7'", "LOW:HIGH"]),
    (["RUN", "--discrepancy", "none", "--at", "-1:2"], ["stretch -1", "not positive"]),
    (["RUN", "--discrepancy", "none", "--at2", "1"], ["one control", "--at2"]),
    (["RUN", "--discrepancy", "none", "--mode", "biaxial"], ["several controls", "stretch of axis 2"]),
    (["RUN", "--discrepancy", "none", "--points", "1"], ["points", "2"]),
    (["RUN", "--discrepancy", "none", "--at", "1.1,1.2", "--points", "7"], ["--grid-points are those of a range"]),
    (["RUN", "--discrepancy", "none", "--prob", "1"], ["prob", "less than 1"]),
    (["RUN", "--discrepancy", "none", "--stress", "kirchhoff"], ["stress_type", "'kirchhoff'"]),
    (["RUN", "--discrepancy", "none", "--cycle", "1"], ["--cycle can only be used with --data"]),
    (["RUN", "--data-stretch", "1:1.1", "--length", "9 mm"], ["--length, --data-stretch can only be used"]),
    (["RUN", "--discrepancy", "none", "--data", "nowhere.csv"], ["nowhere.csv", "no such file"]),
    (["RUN", "--discrepancy", "none", "--data", "PLANAR", "--mode", "equibiaxial"],
     ["planar.csv", "measured in mode planar", "equibiaxial"]),
    (["RUN", "--discrepancy", "none", "--data", "PLANAR", "--stress-unit", "furlong"], ["'furlong'"]),
    (["RUN", "--discrepancy", "none", "--mode", "equibiaxial", "--at", "1e160"], ["'1e160'", "not in percent"]),
    (["--config", "nowhere.toml"], ["nowhere.toml"]),
    (["RUN", "--config", "run.toml"], ["RUN", "--config"]),
    (["RUN", "--discrepancy", "none", "--out", "RUN", "--force"], ["is the run itself or contains it"]),
    (["RUN", "--discrepancy", "none", "--out", "run/inside"], ["lies inside the run 'run'"]),
    (["RUN", "--discrepancy", "none", "--user-law", "yeoh"], ["law.py:Name", "'yeoh' is not"]),
    (["RUN", "--discrepancy", "none", "--material", "yeoh"], ["is of the material 'neo-hookean', and not of 'yeoh'"]),
    (["RUN", "--discrepancy", "none", "--at", "1e-200"], ["too large for a number"]),
    (["RUN", "--discrepancy", "none", "--out", "PLANAR"], ["is a file"]),
]  # fmt: skip


@pytest.mark.parametrize(("arguments", "words"), BAD)
def test_bad_input_is_one_message_and_leaves_nothing(refused, run, planar, arguments, words):
    known = {"RUN": run, "PLANAR": planar}
    refused(words, "predict", *[known.get(each, each) for each in arguments])


def test_a_prediction_is_never_overwritten_unasked(cli, here, run):
    options = ["--discrepancy", "none", "--no-figures", "--points", 3]
    for more, status in (([], 0), ([], 2), (["--force"], 0)):
        said = cli("predict", run, *options, *more)
        assert said.status == status
        assert ("run-uniaxial" in said.err) == (status == 2)


def test_a_prediction_is_no_run_to_predict_from(refused, done, here, run):
    done("predict", run, "--discrepancy", "none", "--no-figures", "--points", 3)
    refused(["run of tissuq fit"], "predict", "run-uniaxial")
