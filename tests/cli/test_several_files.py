"""``tissuq fit`` of several files at once."""

from __future__ import annotations

import json
import tomllib

import numpy as np
import pytest

import tissuq as tq
from tissuq.experiments.reading.tests_in_file import measurements

from .conftest import rows_in_mpa, rows_of

STRETCH = {"uniaxial": np.array([0.8, 0.9, 1.1, 1.2, 1.3, 1.4]), "planar": np.array([1.05, 1.1, 1.2, 1.3, 1.4])}
NOISE = {"uniaxial": 1e-3 * np.array([1, 0, -2, 1, 0, -1]), "planar": 1e-3 * np.array([2, -4, 0, 3, -1])}
ALONE = ["--discrepancy", "none", "--no-figures"]


def written(folder, mode, name, head=""):
    stress = tq.engineering_stress(tq.materials()["neo-hookean"](), tq.loading_modes()[mode](), STRETCH[mode], [0.05])
    rows = [
        f"{a!r},{b!r}" for a, b in zip(STRETCH[mode].tolist(), (1e3 * (stress + NOISE[mode])).tolist(), strict=True)
    ]
    file = folder / name
    file.write_text("\n".join([*([head] if head else []), "stretch,stress_kPa", *rows]) + "\n")
    return file


@pytest.fixture
def files(here):
    (here / "tests").mkdir()
    return [
        written(here / "tests", "planar", "b.csv", head="# mode: planar"),
        written(here / "tests", "uniaxial", "uniaxial.csv"),
    ]


def summary_of(folder):
    return rows_in_mpa(folder / "summary.csv")


def expected(files, **options):
    parts = [tq.read_experiment(file, mode=mode) for file, mode in zip(files, ("planar", "uniaxial"), strict=True)]
    return tq.fit(parts, discrepancy="none", **options)


def test_strips_along_both_axes_of_a_tissue_are_fitted_with_fibres(cli, here):
    truth, stretch = {"C10": 0.01, "k": 0.05}, np.linspace(1.05, 1.4, 8)
    for mode, file in (("uniaxial", "circ.csv"), ("uniaxial@2", "axial.csv")):
        test = tq.simulate("neo-hookean+standard-fibres@40", truth, stretch, 5e-4, seed=1, mode=mode)
        rows = [f"{a!r},{b!r}" for a, b in zip(stretch.tolist(), (1e3 * test.stress).tolist(), strict=True)]
        (here / file).write_text("\n".join([f"# mode: {mode}", "stretch,stress_kPa", *rows]) + "\n")
    options = "circ.csv", "axial.csv", "--material", "neo-hookean+standard-fibres@40", "--noise-sd", 0.5
    refused = cli("fit", *options)
    assert refused.status == 2
    assert "--discrepancy gp-pinned" in refused.err
    said = cli("fit", *options, *ALONE, "--tolerance", "none", "--out", "run")
    assert (said.status, said.err) == (0, "")
    rows = {row["parameter"]: row for row in rows_of(here / "run" / "parameters.csv")}
    assert list(rows) == ["C10", "k_over_C10", "k"]
    assert (rows["k"]["unit"], rows["k"]["prior"]) == ("kPa", "follows from the others")
    assert float(rows["k"]["hdi_low"]) < 50 < float(rows["k"]["hdi_high"])
    text = " ".join(cli("show", "run", "--details").out.split())
    assert "those without lateral stress; k follows from the ratio" in text
    assert "k follows from the others" not in text
    card = cli("export", "run", "--format", "febio", "--out", "cards")
    assert (card.status, card.err) == (0, "")


def test_a_folder_is_fitted_with_the_modes_that_files_or_names_say(cli, files, here):
    said = cli("fit", "tests", *ALONE, "--noise-sd", "1.5")
    assert (said.status, said.err) == (0, "")
    (row,) = summary_of(here / "runs" / "tests")
    posterior = expected(files, noise_sd=1.5e-3)
    assert float(row["C10_mean"]) == pytest.approx(posterior.marginals["C10"].mean, rel=1e-9)
    assert float(row["C10_sd"]) == pytest.approx(posterior.marginals["C10"].sd, rel=1e-9)
    assert posterior.model.tolerances.stress > 0
    page = (here / "runs" / "tests" / "report.html").read_text()
    assert "planar test, 5 measurements, stretch 1.05 to 1.4" in page
    assert "uniaxial test, 6 measurements, stretch 0.8 to 1.4" in page
    assert "Errors of whole tests (standard deviations): 0.18 of the stress" in page
    rows = rows_of(here / "runs" / "tests" / "data.csv")
    assert [row["mode"] for row in rows] == ["planar"] * 5 + ["uniaxial"] * 6


def test_specimens_noise_and_tolerances_are_those_given(done, files, here):
    options = ["--specimen", "one", "--specimen", "two", "--noise-sd", "1,2", "--tolerance", "stress=10%"]
    options += ["--tolerance", "zero=0.5", "--mode", "planar", "--mode", "uniaxial", "--out", "run"]
    done("fit", *files, *ALONE, *options)
    (row,) = summary_of(here / "run")
    tolerances = tq.Tolerances("tissue", stress=0.1, zero=0.5e-3)
    posterior = expected(files, noise_sd=[1e-3, 2e-3], tolerances=tolerances)
    assert float(row["C10_mean"]) == pytest.approx(posterior.marginals["C10"].mean, rel=1e-9)
    assert float(row["log_evidence"]) == pytest.approx(posterior.solution.log_evidence, rel=1e-9)


def test_a_run_of_several_files_repeats(done, files, here):
    done("fit", *files, *ALONE, "--tolerance", "none", "--out", "first")
    recipe = tomllib.loads((here / "first" / "run.toml").read_text())
    assert [test["file"] for test in recipe["tests"]] == ["input/b.csv", "input/uniaxial.csv"]
    assert recipe["tolerances"] == {}
    done("fit", "--config", "first/run.toml", "--no-figures", "--out", "again")
    same = [{name: value for name, value in row.items() if name != "seconds"} for row in summary_of(here / "first")]
    again = [{name: value for name, value in row.items() if name != "seconds"} for row in summary_of(here / "again")]
    assert same == again
    done("show", "again")


@pytest.mark.slow
def test_tests_in_a_toml_file_have_their_own_options(done, here):
    written(here, "uniaxial", "a.csv")
    (here / "b.csv").write_text("gamma;tau (Pa)\n0,1;9800\n0,2;20100\n0,3;29900\n0,4;40000\n")
    (here / "both.toml").write_text(
        'discrepancies = ["none"]\n[tolerances]\n[[tests]]\nfile = "a.csv"\nmode = "uniaxial"\nnoise_sd = 0.1\n'
        '[[tests]]\nfile = "b.csv"\nmode = "simple-shear"\nnoise_sd = 100\n'
        'columns = { shear = "gamma", stress = "tau (Pa)" }\n'
    )
    done("fit", "--config", "both.toml")
    assert (here / "runs" / "both" / "figures" / "with_discrepancy.png").exists()
    unit, shear = 2 * (STRETCH["uniaxial"] - STRETCH["uniaxial"] ** -2), 2 * np.array([0.1, 0.2, 0.3, 0.4])
    x = np.concatenate([unit, shear])
    y = np.concatenate([0.05 * unit + NOISE["uniaxial"], 1e-6 * np.array([9800, 20100, 29900, 40000])])
    (row,) = summary_of(here / "runs" / "both")
    assert float(row["C10_mean"]) == pytest.approx(x @ y / (x @ x), rel=1e-9)


@pytest.mark.parametrize(
    "options", [["--noise-sd", "1"], ["--prior", "C10=uniform(0,90)"], ["--tolerance", "zero=0.1"]]
)
def test_a_stress_in_the_unit_of_files_that_have_several_is_refused(cli, done, files, here, options):
    in_pascal = "".join(f"{x},{1e5 * (x - x**-2):.6g}\n" for x in (0.8, 0.9, 1.1, 1.2, 1.3))
    (here / "pascal.csv").write_text(f"stretch,stress [Pa]\n{in_pascal}")
    tests = [files[1], "pascal.csv", "--mode", "uniaxial", "--discrepancy", "none", "--no-figures"]
    said = cli("fit", *tests, *options, "--out", "mixed")
    assert (said.status, "different units (kPa, Pa)" in said.err) == (2, True), said.err
    done("fit", *tests, "--noise-sd", "1,100", "--estimand", "as-tested", "--out", "of_each")
    np.testing.assert_allclose(tq.load(here / "of_each").model.noise.sds, [1e-3, 1e-4])
    assert "Noise: sd 1 kPa, 100 Pa." in cli("show", "of_each", "--details").out


def test_every_test_is_predicted_from_the_others(cli, done, files, here):
    said = done("fit", *files, *ALONE, "--noise-sd", "1.5", "--held-out", "--out", "run")
    assert "Each test predicted from the others" in said.out
    parts = [tq.read_experiment(file, mode=mode) for file, mode in zip(files, ("planar", "uniaxial"), strict=True)]
    found = tq.held_out_tests(parts, discrepancy="none", noise_sd=1.5e-3)
    rows = rows_in_mpa(here / "run" / "held_out.csv")
    assert [row["test"] for row in rows] == ["b", "uniaxial"]
    for name in ("inside", "beyond", "half_width", "error", "crps", "interval_score", "C10_median"):
        assert [float(row[name]) for row in rows] == pytest.approx(found[name].tolist(), rel=1e-9)
    of_json = json.loads((here / "run" / "held_out.json").read_text())
    assert {row["unit"] for row in of_json} == {"kPa"}
    assert [row["crps"] for row in of_json] == pytest.approx((1000 * found["crps"]).tolist(), rel=1e-9)
    assert "Each test predicted from the others" in (here / "run" / "report.html").read_text()
    assert "Each test predicted from the others" in cli("show", "run").out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ["tests/b.csv", "other.csv"],
            ["neither 'other.csv' nor its name says", "--mode once for all files, or once for each"],
        ),
        (
            ["tests/b.csv", "tests/uniaxial.csv", "--mode", "planar", "--mode", "planar", "--mode", "planar"],
            ["3 times"],
        ),
        (
            ["tests/b.csv", "tests/uniaxial.csv", "--noise-sd", "1,2,3"],
            ["--noise-sd has 3 numbers, 1 and 2 and 3, for 2 files; give it once for each"],
        ),
        (["tests/b.csv", "--noise-sd", "1,2"], ["--noise-sd has 2 numbers, 1 and 2, for one test"]),
        (["tests/b.csv", "--noise-sd", "0,5"], ["has 2 numbers, 0 and 5", "a decimal point and no comma"]),
        (
            ["tests/b.csv", "--column", "stress=1", "--column", "stress=2"],
            ["tests/b.csv: --column is given twice for 'stress', and there"],
        ),
        (["tests/b.csv", "--tolerance", "stress"], ["'stress' is not a tolerance; write stress=10%"]),
        (["tests/b.csv", "--tolerance", "zero=1%"], ["'zero=1%' is not a tolerance"]),
        (["tests/b.csv", "--tolerance", "stress=1%", "--tolerance", "stress=2%"], ["given twice for 'stress'"]),
        (["tests/b.csv", "--held-out"], ["held_out needs two or more tests"]),
        (["empty"], ["folder 'empty' has no files of measurements"]),
        (["tests", "--config", "x.toml"], ["give FILES or --config, not both"]),
    ],
)
def test_what_cannot_be_used_is_said(cli, files, here, arguments, words):
    (here / "empty").mkdir()
    written(here, "uniaxial", "other.csv")
    (here / "x.toml").write_text('file = "other.csv"\n')
    said = cli("fit", *arguments)
    assert (said.status, said.out) == (2, "")
    for word in words:
        assert word in " ".join(said.err.split())
    assert not (here / "runs").exists()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('file = "a.csv"\n[[tests]]\nfile = "b.csv"\n', "give one file, or several tests with a file each"),
        ('mode = "planar"\n[[tests]]\nfile = "b.csv"\n', "belong in each of the tests, not beside them (mode)"),
        ('[[tests]]\nfile = "a.csv"\nnoise_sd = 1\n[[tests]]\nfile = "b.csv"\n', "noise_sd for each of the tests"),
    ],
)
def test_settings_that_contradict_each_other_are_refused(refused, here, text, words):
    (here / "run.toml").write_text(text)
    refused([words], "fit", "--config", "run.toml")


@pytest.mark.slow
def test_each_file_is_read_once_and_each_note_is_printed_once(cli, here, monkeypatch):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.remove(book.active)
    stretch = np.linspace(1, 1.3, 31)
    for name, factor in (("S1", 1.0), ("S2", 1.1)):
        sheet = book.create_sheet(name)
        for row in (["Stretch", "Stress"], *zip(stretch, factor * 0.05 * (stretch - stretch**-2), strict=True)):
            sheet.append(list(row))
    book.save(here / "two.xlsx")
    with monkeypatch.context() as patch:
        patch.setattr("tissuq.experiments.reading.experiment_file.read_file", None)
        said = cli("fit", "two.xlsx", *ALONE)
        one = cli("fit", "two.xlsx#S2", *ALONE, "--out", "one")
        two_laws = ["--material", "neo-hookean", "--material", "mooney-rivlin"]
        laws = cli("fit", "two.xlsx", *ALONE, *two_laws, "--out", "laws")
    assert [outcome.status for outcome in (said, one, laws)] == [0, 0, 0]
    assert " ".join(said.out.split()).count("the file states no unit of stress") == 1
    assert "S2: neo-hookean" in one.out
    again = cli("fit", "--config", "one/run.toml", *ALONE, "--out", "again")
    means = [summary_of(here / folder)[0]["C10_mean"] for folder in ("again", "one")]
    assert (again.status, means[0]) == (0, means[1])


def in_compression(folder):
    """Displacements and forces of a cylinder 10 mm high, 8 mm across, which count compression as positive."""
    stretch = np.linspace(1, 0.8, 9)
    stress = tq.engineering_stress(tq.materials()["neo-hookean"](), tq.loading_modes()["uniaxial"](), stretch, [0.05])
    rows = np.column_stack([10 * (1 - stretch), -stress * np.pi * 4**2]).tolist()
    file = folder / "compression.csv"
    file.write_text("\n".join(["displacement [mm],force [N]", *(f"{a!r},{b!r}" for a, b in rows)]) + "\n")
    return file


def test_sizes_and_signs_go_to_the_files_that_need_them(cli, files, here):
    sizes = {"length": "10 mm", "diameter": "8 mm"}
    of_compression = ["--length", "10 mm", "--diameter", "8 mm", "--compression-positive"]
    said = cli("fit", files[0], files[1], in_compression(here), *of_compression, *ALONE, "--out", "run")
    assert (said.status, said.err) == (0, "")
    tests = tomllib.loads((here / "run" / "run.toml").read_text())["tests"]
    assert [test["dimensions"] for test in tests] == [{}, {}, sizes]
    assert [test.get("compression_positive") for test in tests] == [None, None, True]
    together = measurements([*files, here / "compression.csv"], dimensions=sizes, compression_positive=True)
    assert [test.size for test in together.tests] == [5, 6, 9]


def test_sizes_that_no_file_needs_are_refused(refused, files):
    refused(
        ["b.csv, column 'stretch' is read as stretch, which needs no length"],
        "fit",
        *files,
        "--length",
        "10 mm",
        *ALONE,
    )


def test_a_specimen_that_nothing_is_told_apart_by_is_refused(cli, here):
    rows = [f"{name},{1 + k / 20},{k * size}" for name, size in (("A", 1), ("B", 2)) for k in range(12)]
    (here / "two.csv").write_text("specimen,stretch,stress [kPa]\n" + "\n".join(rows) + "\n")
    (here / "one.csv").write_text("stretch,stress [kPa]\n" + "".join(f"{1 + k / 20},{k}\n" for k in range(12)))
    said = cli("fit", "two.csv", "--specimen", "A")
    assert (said.status, "has the specimens A, B: to fit one alone give --only COLUMN=A" in said.err) == (2, True)
    said = cli("fit", "one.csv", "--specimen", "A")
    assert (said.status, "'one.csv' is of one test; leave it out" in said.err) == (2, True)
