"""``tissuq inspect``, and the same options with ``tissuq fit``."""

import os
import subprocess
import sys
import tomllib

import numpy as np
import pandas as pd
import pytest

from machine_files import biotester_protocols, instron, wintest, zwick

from .conftest import tree

WINTEST = ["--length", "10 mm", "--area", "6 mm2", "--cycle", "3", "--branch", "loading", "--preload", "0.01 N"]


def test_what_is_understood_is_printed_and_nothing_is_written(cli, here):
    file = zwick().written(here)
    before = tree(here)
    said = cli("inspect", file)
    assert (said.status, said.err) == (0, "")
    assert "'Standardkraft' is force, 'Standardweg' is displacement" in said.out
    assert "length in line 4" in said.out
    assert tree(here) == before


def test_a_built_in_data_set_is_inspected(cli):
    said = cli("inspect", "brain-cortex-uniaxial")
    assert (said.status, said.err) == (0, "")
    assert "34 of 34 used" in said.out


def test_figure_data_and_text_are_written_where_asked(cli, refused, done, here):
    file = wintest()
    said = cli("inspect", file.written(here), *WINTEST, "--out", "seen")
    assert (said.status, said.err) == (0, "")
    assert said.out.rstrip().endswith("Figure: seen/figures/curve.png")
    assert set(tree(here / "seen")) == {
        "contents.txt", "data.csv", "figures", "figures/curve.png", "figures/curve.svg", "inspection.txt"
    }  # fmt: skip
    data = np.loadtxt(here / "seen" / "data.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(data[:, 0], file.stretch, atol=1e-5)
    assert (here / "seen" / "inspection.txt").read_text() in said.out
    refused(["--force"], "inspect", file.name, *WINTEST, "--out", "seen")
    done("inspect", file.name, *WINTEST, "--out", "seen", "--force")


def test_a_fit_reads_with_the_same_options_and_is_repeated_from_its_run_toml(done, here):
    file = wintest()
    path = file.written(here)
    done("fit", path, *WINTEST, "--discrepancy", "none", "--no-figures")
    data = np.loadtxt(here / "runs" / "wintest" / "data.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(data, np.column_stack([file.stretch, 1000 * file.stress]), atol=1e-2)
    recipe = tomllib.loads((here / "runs" / "wintest" / "run.toml").read_text())
    assert recipe["dimensions"] == {"length": "10 mm", "area": "6 mm2"}
    assert (recipe["cycle"], recipe["branch"], recipe["preload"]) == ("3", "loading", "0.01 N")
    done("fit", "--config", "runs/wintest/run.toml", "--out", "again", "--no-figures")
    assert (here / "again" / "data.csv").read_bytes() == (here / "runs" / "wintest" / "data.csv").read_bytes()


def test_a_fit_says_what_is_strange_about_the_measurements(done, here):
    path = wintest().written(here)
    said = done("fit", path, "--length", "10 mm", "--area", "6 mm2", "--discrepancy", "none", "--no-figures")
    assert "all 3 cycles are used; to fit one" in said.out


@pytest.mark.slow
def test_both_axes_of_a_biaxial_test_are_inspected_and_fitted_at_once(cli, done, here):
    file = biotester_protocols()
    options = [file.written(here), "--mode", "biaxial", "--thickness", "1.5 mm", "--branch", "loading"]
    said = cli("inspect", *options, "--out", "seen")
    assert (said.status, said.err) == (0, "")
    assert "'YForce_mN' is force of axis y" in " ".join(said.out.split())
    assert "axis x, as recorded" in (here / "seen" / "figures" / "curve.svg").read_text()
    done("fit", *options, "--material", "mooney-rivlin", "--discrepancy", "none", "--no-figures", "--out", "run")
    for folder in ("seen", "run"):
        data = np.loadtxt(here / folder / "data.csv", delimiter=",", skiprows=1, usecols=(3, 4))
        np.testing.assert_allclose(data[:, 0], file.stretch.T.ravel(), atol=1e-6)
        np.testing.assert_allclose(data[:, 1], 1000 * file.stress.T.ravel(), atol=1e-3)
    done("fit", "--config", "run/run.toml", "--out", "again", "--no-figures")
    assert (here / "again" / "data.csv").read_bytes() == (here / "run" / "data.csv").read_bytes()


@pytest.mark.parametrize("command", ["inspect", "fit"])
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], ["wintest.txt", "undeformed length", "--length"]),
        (["--length", "10"], ["'10' has no unit"]),
        (["--length", "10 mm"], ["undeformed cross-section", "--area", "--width", "--diameter"]),
        ([*WINTEST, "--cycle", "9"], ["3 cycles", "'9'"]),
        ([*WINTEST, "--branch", "up"], ["loading, unloading", "'up'"]),
        ([*WINTEST, "--preload", "9 N"], ["9 N is not reached"]),
        ([*WINTEST, "--every", "0"], ["every", "greater than or equal to 1"]),
        ([*WINTEST, "--sheet", "1"], ["not an Excel workbook"]),
        ([*WINTEST, "--axis", "x"], ["no columns of an axis 'x'"]),
    ],
)
def test_bad_options_end_with_status_2_and_one_message(refused, here, command, arguments, words):
    wintest().written(here)
    refused(words, command, "wintest.txt", *arguments)


def test_an_inspection_needs_neither_jax_nor_matplotlib(tmp_path):
    path = instron().written(tmp_path)
    code = (
        "import sys\n"
        "from tissuq.cli import main\n"
        f"sys.argv = ['tissuq', 'inspect', {str(path)!r}]\n"
        "try:\n    main()\n"
        "except SystemExit as end:\n    assert not end.code\n"
        "print([name for name in ('jax', 'matplotlib', 'openpyxl') if name in sys.modules])"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert said.splitlines()[-1] == "[]"


def test_specimens_of_a_table_are_listed_and_one_of_them_is_read(cli, done, here):
    rows = [f"{name},{1 + k / 100},{factor * k}" for name, factor in (("a 1", 1), ("b 2", 2)) for k in range(10)]
    (here / "all.csv").write_text("\n".join(["Specimen,stretch,stress [kPa]", *rows]) + "\n")
    said = done("inspect", "all.csv")
    assert "2 tests were understood" in said.out
    for arguments in (["all.csv#b 2"], ["all.csv#2"], ["all.csv", "--only", "Specimen=b 2"]):
        said = done("inspect", *arguments)
        assert "0 to 18 kPa" in said.out
    said = cli("inspect", "all.csv#c")
    assert (said.status, said.err) == (2, "tissuq: there is no test 'c' in all.csv. Its tests are: 'a 1', 'b 2'.\n")
    assert cli("inspect", "all.csv", "--only", "Specimen").status == 2


def test_what_was_seen_in_several_tests_is_one_note(cli, here):
    rows = [f"{name},{1 + k / 100},{max(k - slack, 0)}" for name, slack in (("a", 6), ("b", 8)) for k in range(40)]
    (here / "slack.csv").write_text("\n".join(["Specimen,stretch,stress [kPa]", *rows]) + "\n")
    said = " ".join(cli("inspect", "slack.csv").out.split())
    assert said.count("carry no load that shows") == 1
    assert "Note all tests: the first " in said
    assert "(The numbers are those of the first.)" in said


def test_positions_and_a_rupture_are_read_by_options(cli, here):
    force = [*(0.1 * k for k in range(20)), *[0.01] * 5]
    rows = [f"{30 + 0.2 * k},{load}" for k, load in enumerate(force)]
    (here / "torn.csv").write_text("\n".join(["Position (mm),Load (N)", *rows]) + "\n")
    options = ["--length", "10 mm", "--area", "5 mm2"]
    said = cli("inspect", "torn.csv", *options)
    assert (said.status, said.err) == (0, "")
    text = " ".join(said.out.split())
    assert "--zero first" in text
    assert "--until-peak" in text
    said = cli("inspect", "torn.csv", *options, "--zero", "first", "--until-peak")
    assert "stretch   1 to 1.38" in said.out
    assert "Note" not in said.out


def liver_file(folder):
    """Two tests of stretch and one of shear, beneath one another."""
    stretch = np.linspace(1, 1.3, 12)
    tables = [
        ("tension", "stretch", stretch, 40 * (stretch - stretch**-2)),
        ("shear", "shear", stretch - 1, 40 * (stretch - 1)),
    ]
    lines = []
    for title, name, deformation, stress in tables:
        lines += ["", title, f"{name}\tstress [kPa]"]
        lines += [f"{a:.6f}\t{b:.6f}" for a, b in zip(deformation, stress, strict=True)]
    (folder / "liver.txt").write_text("\n".join(lines) + "\n")


def test_columns_that_one_of_several_files_has_are_those_of_that_file(cli, here):
    (here / "plain.csv").write_text("stretch,stress [kPa]\n" + "".join(f"{1 + k / 20},{k}\n" for k in range(6)))
    (here / "odd.csv").write_text("alpha,beta [kPa]\n" + "".join(f"{1 + k / 20},{3 * k}\n" for k in range(6)))
    columns = ["--column", "stretch=alpha", "--column", "stress=beta [kPa]"]
    said = cli("inspect", "plain.csv", "odd.csv", "--mode", "uniaxial", *columns, "--write", "study.toml")
    assert "plain: uniaxial (as given), 6 rows, stretch 1 to 1.25, stress 0 to 5 kPa" in said.out
    assert "odd: uniaxial (as given), 6 rows, stretch 1 to 1.25, stress 0 to 15 kPa" in said.out
    tests = tomllib.loads((here / "study.toml").read_text())["tests"]
    assert [test.get("columns") for test in tests] == [None, {"stretch": "alpha", "stress": "beta [kPa]"}]
    said = cli("inspect", "plain.csv", "odd.csv", "--column", "stretch=gamma")
    assert (said.status, said.out) == (2, "")
    assert "plain.csv has no column 'gamma'" in said.err


def test_a_study_is_not_taken_for_a_file_of_measurements(refused, here):
    (here / "study.toml").write_text("material = 'yeoh'\n")
    refused(["if it is a study, give it alone: tissuq fit study.toml."], "inspect", "study.toml")


def test_what_a_shear_test_is_along_is_an_amount_of_shear(cli):
    said = cli("inspect", "brain-cortex-shear")
    assert "\nshear     0 to 0.2\n" in said.out
    assert "stretch" not in said.out


@pytest.mark.slow
def test_a_study_of_all_tests_in_a_file_is_written_and_fitted(cli, done, here):
    liver_file(here)
    said = done("inspect", "liver.txt", "--write", "study.toml")
    assert "test 1    tension: uniaxial ('tension'), 12 rows, stretch 1 to 1.3" in said.out
    assert "test 2    shear: simple-shear ('shear'), 12 rows, amount of shear 0 to 0.3, stress 0 to 12 kPa" in said.out
    assert cli("inspect", "liver.txt", "--write", "study.toml").status == 2
    study = here / "study.toml"
    assert [test["table"] for test in tomllib.loads(study.read_text())["tests"]] == [1, 2]
    study.write_text(study.read_text().replace('# specimen = "S1" ', 'specimen = "S1" '))
    options = ["--discrepancy", "none", "--no-figures"]
    done("fit", "study.toml", *options, "--out", "from-study")
    said = done("fit", "liver.txt", *options, "--out", "from-file")
    assert said.out.startswith("test 1    tension: uniaxial ('tension'), 12 rows")
    recipe = tomllib.loads((here / "from-study" / "run.toml").read_text())
    assert [test["specimen"] for test in recipe["tests"]] == ["S1", ""]
    assert [test["mode"] for test in recipe["tests"]] == ["uniaxial", "simple-shear"]
    assert os.listdir(here / "from-file" / "input") == ["liver.txt"]
    done("fit", "--config", "from-file/run.toml", "--no-figures", "--out", "again")
    summaries = [pd.read_csv(here / run / "summary.csv").drop(columns="seconds") for run in ("from-file", "again")]
    pd.testing.assert_frame_equal(*summaries)


def test_tests_in_a_file_take_a_mode_and_a_specimen_each(cli, done, here):
    liver_file(here)
    (here / "other.csv").write_text("stretch,stress [kPa]\n" + "".join(f"{1 + k / 20},{k}\n" for k in range(6)))
    fit = ["fit", "liver.txt", "other.csv", "--discrepancy", "none", "--no-figures"]
    said = cli(*fit)
    assert (said.status, "neither 'other.csv' nor its name says in which loading mode" in said.err) == (2, True)
    done(*fit, "--mode", "uniaxial", "--mode", "simple-shear", "--mode", "planar", "--specimen", "A")
    recipe = tomllib.loads((here / "runs" / "liver-and-2-more" / "run.toml").read_text())
    described = [(test["name"], test["mode"], test["specimen"]) for test in recipe["tests"]]
    assert described == [
        ("liver tension", "uniaxial", "A"),
        ("liver shear", "simple-shear", "A"),
        ("other", "planar", "A"),
    ]
    said = cli(*fit, "--mode", "uniaxial", "--mode", "planar", "--mode", "planar", "--mode", "planar")
    assert "--mode is given 4 times for 2 files with 3 tests" in said.err


@pytest.mark.slow
def test_specimens_beside_one_another_are_a_population(done, here):
    stretch = np.linspace(1, 1.3, 12)
    header = "stretch,stress S1 [kPa],stress S2 [kPa],stress S3 [kPa]"
    rows = [",".join(f"{v:.6f}" for v in (s, *(k * (s - s**-2) for k in (30, 40, 50)))) for s in stretch]
    (here / "all.csv").write_text("\n".join([header, *rows]) + "\n")
    done("population", "all.csv", "--discrepancy", "none", "--no-figures")
    specimens = pd.read_csv(here / "runs" / "population" / "specimens.csv")
    assert set(specimens.iloc[:, 0]) == {"s1", "s2", "s3"}


@pytest.fixture
def slack_file(here):
    """Fifty of 201 rows without load, then a neo-Hookean material with C10 = 50 kPa."""
    grips = np.linspace(1, 1.4, 201)
    taut = np.maximum(grips / grips[50], 1.0)
    stress = 100 * (taut - taut**-2) + 0.1 * np.random.default_rng(2).standard_normal(201)
    rows = "".join(f"{a:.6f},{b:.6f}\n" for a, b in zip(grips, stress, strict=True))
    (here / "slack.csv").write_text("stretch,stress [kPa]\n" + rows)
    return "slack.csv"


def test_the_advice_about_slack_can_be_typed_and_enters_the_fit(cli, done, here, slack_file):
    said = cli("inspect", slack_file)
    assert "give --preload auto" in " ".join(said.out.split())
    done("fit", slack_file, "--preload", "auto", "--discrepancy", "none", "--noise-sd", "0.1", "--no-figures")
    recipe = tomllib.loads((here / "runs" / "slack" / "run.toml").read_text())
    assert recipe["preload"] == "auto"
    page = (here / "runs" / "slack" / "report.html").read_text()
    assert "where load begins (estimated; standard deviation" in page
    assert "is as large as the measurements show" in page


def test_rows_are_chosen_by_lines_and_stretches(cli, done, here, slack_file):
    said = done("inspect", slack_file, "--stretch", "1.2:1.3", "--leave-out", "110:112")
    assert "without the rows in lines 110:112" in said.out
    assert "only rows at stretches from 1.2 to 1.3" in said.out
    assert cli("inspect", slack_file, "--stretch", "1.2").status == 2
    done("fit", slack_file, "--stretch", "1.2:1.3", "--discrepancy", "none", "--no-figures", "--preload", "1 kPa")
    assert tomllib.loads((here / "runs" / "slack" / "run.toml").read_text())["stretch_range"] == [1.2, 1.3]


def test_one_axis_of_a_biaxial_machine_needs_no_mode(cli, here):
    here.joinpath("sheet.csv").write_text(
        "stretch x,stretch y,stress x [kPa],stress y [kPa]\n1,1,0,0\n1.1,1.05,2,1.5\n1.2,1.1,4,3\n"
    )
    said = cli("inspect", "sheet.csv", "--axis", "y")
    assert (said.status, said.err) == (0, "")
    assert "'stretch y' is stretch" in said.out
    assert "'stress y" in said.out


def test_tubes_at_several_axial_stretches_are_fitted_from_a_file_each(cli, refused, done, here):
    inner, outer = 1.25, 1.5
    for axial in (1.3, 1.5):
        radius = np.linspace(outer * axial**-0.5, 1.5, 30)
        x = (axial * radius**2 - outer**2) / inner**2, (axial * radius**2 - outer**2) / outer**2
        inside, outside = (np.log(1 + each) - 1 / (1 + each) for each in x)  # p of C10 = 20 kPa, by parts
        pressure = 0.02 / axial * (inside - outside) / 133.322387415e-6
        rows = [f"{p:.8g},{2e3 * r:.8g}" for p, r in zip(pressure, radius, strict=True)]
        (here / f"at {axial}.csv").write_text("\n".join(["Pressure (mmHg),Outer diameter (um)", *rows]))
    files, sizes = ["at 1.3.csv", "at 1.5.csv"], ["--diameter", "3 mm", "--thickness", "0.25 mm"]
    options = [*sizes, "--specimen", "A", "--discrepancy", "none", "--tolerance", "none", "--noise-sd", "0.01"]
    assert cli("fit", *files, *options).status == 2
    fit = done(
        "fit", *files, *options, "--axial-stretch", "1.3", "--axial-stretch", "1.5", "--no-figures", "--out", "A"
    )
    assert "initial shear modulus  40" in fit.out
    done("fit", "--config", "A/run.toml", "--no-figures", "--out", "again")
    refused(["--axial-stretch is given 3 times for 2 files"], "fit", *files, *options, *["--axial-stretch", "1.3"] * 3)


def test_a_tube_is_read_by_the_flags_that_the_first_message_gives(cli, refused, done, here):
    inner, outer, radius = 1.25, 1.5, np.linspace(1.5, 1.9, 30)
    x = (radius**2 - outer**2) / inner**2, (radius**2 - outer**2) / outer**2
    inside, outside = (np.log(1 + each) - 1 / (1 + each) for each in x)  # p of C10 = 20 kPa, by parts
    rows = [f"{p / 133.322387415e-6:.8g},{2e3 * r:.8g}" for p, r in zip(0.02 * (inside - outside), radius, strict=True)]
    (here / "artery.csv").write_text("\n".join(["Pressure (mmHg),Outer diameter (um)", *rows]))
    refused(['--mode planar --diameter "3 mm" --thickness "0.5 mm"'], "inspect", "artery.csv")
    sizes = ["--mode", "planar", "--diameter", "3 mm", "--thickness", "0.25 mm"]
    said = cli("inspect", "artery.csv", *sizes)
    assert (said.status, said.err) == (0, "")
    assert "'Pressure (mmHg)' is pressure, 'Outer diameter (um)' is outer diameter" in said.out
    assert "hoop stretch in the middle of the wall = sqrt(1 + (d^2/4 - B^2)/(A B))" in said.out
    assert "taken as held at its undeformed length" in said.out
    named = ["--column", "pressure=1", "--column", "outer_diameter=2"]
    done("fit", "artery.csv", *sizes, *named, "--discrepancy", "none", "--no-figures")
    data = np.loadtxt(here / "runs" / "artery" / "data.csv", delimiter=",", skiprows=1)
    stretch = np.sqrt(1 + (radius**2 - outer**2) / (inner * outer))
    np.testing.assert_allclose(data, np.column_stack([stretch, 40 * (stretch - stretch**-3)]), atol=1e-3)
