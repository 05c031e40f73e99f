import json
import re
import shutil
import tomllib

import numpy as np
import pytest

import tissuq as tq
from marks import slow_but

from .conftest import STRESS_KPA, STRETCH, command, rows_in_mpa, without_wall_times

stretch, stress = np.array(STRETCH), np.array(STRESS_KPA)
unit_stress = 2 * (stretch - stretch**-2)
ALONE = ["--discrepancy", "none", "--no-figures"]


def summary_of(folder):
    return rows_in_mpa(folder / "summary.csv")


def written(file, **columns):
    names = list(columns)
    rows = zip(*columns.values(), strict=True)
    file.write_text("\n".join([",".join(names), *(",".join(map(repr, map(float, row))) for row in rows)]) + "\n")
    return file


def assert_closed_form(row, noise_kpa=1.0, width_kpa=None):
    """Compare with the posterior of C10 alone under a flat prior: normal, by hand."""
    size = unit_stress @ unit_stress
    mean, sd = unit_stress @ stress / size, noise_kpa / np.sqrt(size)
    assert float(row["C10_mean"]) == pytest.approx(mean * 1e-3, rel=1e-6)
    assert float(row["C10_sd"]) == pytest.approx(sd * 1e-3, rel=1e-6)
    assert float(row["C10_hdi_low"]) == pytest.approx((mean - 1.959964 * sd) * 1e-3, rel=1e-5)
    assert float(row["C10_hdi_high"]) == pytest.approx((mean + 1.959964 * sd) * 1e-3, rel=1e-5)
    if width_kpa:
        residual, noise = (stress - mean * unit_stress) * 1e-3, noise_kpa * 1e-3
        log_likelihood = -3 * np.log(2 * np.pi * noise**2) - residual @ residual / (2 * noise**2)
        expected = log_likelihood + np.log(np.sqrt(2 * np.pi) * sd / width_kpa)
        assert float(row["log_evidence"]) == pytest.approx(expected, rel=1e-9)


def test_a_run_leaves_the_promised_files_and_a_copy_of_the_users(fit_run):
    folder, said = fit_run
    found = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    figures = {f"figures/{name}.{kind}" for name in ("answer", "marginals", "with_discrepancy", "model_alone")
               for kind in ("svg", "png")}  # fmt: skip
    posteriors = {f"posterior/{name}.nc" for name in ("none", "constant", "gp")}
    tables = {"data.csv", "summary.csv", "summary.json", "parameters.csv", "stability.csv"}
    assert found == figures | posteriors | tables | {
        "report.html", "run.toml", "contents.txt", "tissuq.log", "result.json", "assessment.json", "input/specimen.csv"
    }  # fmt: skip
    users = folder.parents[1] / "specimen.csv"
    assert (folder / "input" / "specimen.csv").read_bytes() == users.read_bytes()
    assert said.err == ""
    assert "specimen: neo-hookean with model uncertainty" in said.out
    assert "C10, kPa" in said.out


def test_the_data_are_written_in_the_unit_of_the_file(fit_run):
    folder, _ = fit_run
    lines = (folder / "data.csv").read_text().splitlines()
    assert lines[0] == "stretch,stress [kPa]"
    np.testing.assert_allclose(np.array([line.split(",") for line in lines[1:]], float).T, [stretch, stress])


@pytest.mark.slow
def test_a_run_is_repeated_byte_for_byte_from_its_run_toml_after_the_users_file_is_gone(fit_run, tmp_path):
    folder, _ = fit_run
    moved = tmp_path / "moved"
    moved.mkdir()
    for path in folder.rglob("*"):
        target = moved / path.relative_to(folder)
        target.mkdir() if path.is_dir() else target.write_bytes(path.read_bytes())
    said = command("fit", "--config", moved / "run.toml", "--out", "again", folder=tmp_path)
    assert (said.status, said.err) == (0, "")
    first, second = without_wall_times(folder), without_wall_times(tmp_path / "again")
    assert [name for name in first if first[name] != second.get(name)] == []
    assert first.keys() == second.keys()


@pytest.mark.parametrize("noise_kpa", [1.0, 2.5])
def test_noise_and_priors_are_in_the_stress_unit_of_the_file(done, here, specimen, noise_kpa):
    options = ["--noise-sd", noise_kpa, "--prior", "C10=uniform(10,110)"]
    done("fit", specimen, *options, *ALONE)
    assert_closed_form(summary_of(here / "runs" / "specimen")[0], noise_kpa, width_kpa=100)


def test_the_table_in_the_terminal_is_in_the_stress_unit_of_the_file(cli, done, here, specimen):
    done("fit", specimen, "--noise-sd", 1, *ALONE)
    said = cli("show", "runs/specimen", "--details")
    line = next(line for line in said.out.splitlines() if line.strip().startswith("none"))
    size = unit_stress @ unit_stress
    mean, sd = unit_stress @ stress / size, 1 / np.sqrt(size)
    ends = mean - 1.959964 * sd, mean + 1.959964 * sd
    assert line.split()[1:5] == [f"{mean:.2f}", f"{sd:.2f}", f"[{ends[0]:.2f},", f"{ends[1]:.2f}]"]
    answer = next(line for line in said.out.splitlines() if line.strip().startswith("C10 "))
    assert answer.split()[1:] == f"{mean:.2f} kPa, 95 % interval {ends[0]:.2f} to {ends[1]:.2f}".split()


@pytest.mark.parametrize(
    ("columns", "options"),
    [
        ({"Strain": stretch - 1, "Load": stress}, ["--column", "strain=Strain", "--column", "stress=Load"]),
        ({"a": stress, "b": stretch}, ["--column", "stretch=2", "--column", "stress=1"]),
        ({"strain": 100 * (stretch - 1), "stress": stress}, ["--strain-unit", "percent"]),
        ({"stretch": stretch, "stress": stress * stretch}, ["--stress-type", "cauchy"]),
        ({"stretch": stretch, "stress": np.where(stretch < 1, -stress, stress)}, ["--compression-positive"]),
        ({"lambda": stretch, "stress": stress}, []),
    ],
    ids=["named columns", "numbered columns", "percent", "cauchy", "compression positive", "plain"],
)
def test_every_way_to_give_the_same_measurements_gives_the_same_posterior(done, here, columns, options):
    file = written(here / "test.csv", **columns)
    done("fit", file, *options, "--stress-unit", "kPa", "--noise-sd", 1, *ALONE)
    assert_closed_form(summary_of(here / "runs" / "test")[0])


@pytest.mark.parametrize(("unit", "kpa"), [("Pa", 1e-3), ("N/cm2", 10), ("psi", 6.894757293168361)])
def test_any_unit_of_stress_is_converted(done, here, unit, kpa):
    file = written(here / "test.csv", stretch=stretch, stress=stress / kpa)
    said = done("fit", file, "--stress-unit", unit, "--noise-sd", 1 / kpa, *ALONE)
    assert_closed_form(summary_of(here / "runs" / "test")[0])
    assert re.search(rf"C10 +[\d.]+ {unit}, 95 % interval", said.out)


def test_unknown_noise_is_a_parameter(done, here, specimen):
    done("fit", specimen, "--noise-sd", "unknown", *ALONE)
    lines = (here / "runs" / "specimen" / "parameters.csv").read_text().splitlines()
    assert [line.split(",")[1] for line in lines[1:]] == ["C10", "noise_sd"]


def test_the_material_and_the_discrepancy_can_be_chosen(done, here, specimen):
    said = done("fit", specimen, "--material", "yeoh", "--discrepancy", "none", "--discrepancy", "constant",
               "--noise-sd", 1, "--no-figures")  # fmt: skip
    assert [row["formulation"] for row in summary_of(here / "runs" / "specimen")] == ["none", "constant"]
    assert "specimen: yeoh" in said.out


@pytest.mark.parametrize("names", [["none", "quadratic", "yeoh"], pytest.param(None, marks=pytest.mark.slow)])
def test_discrepancies_that_cannot_be_fitted_are_told_when_all_are_asked_for(done, here, specimen, monkeypatch, names):
    """The short version has three discrepancies, of which one can be fitted."""
    if names:
        monkeypatch.setattr("tissuq.studies.specimen._every", lambda: names)
    said = done("fit", specimen, "--material", "yeoh", "--discrepancy", "all", "--noise-sd", 1, "--no-figures")
    fitted = [row["formulation"] for row in summary_of(here / "runs" / "specimen")]
    assert "yeoh" not in fitted
    assert "none" in fitted
    assert "Not fitted: yeoh: discrepancy 'yeoh' adds C20, C30" in said.out
    assert "Not fitted: quadratic: 6 measurements are too few" in said.out


def test_a_built_in_data_set_is_fitted_by_its_name(done, here):
    done("fit", "rubber-treloar-uniaxial", *ALONE)
    assert (here / "runs" / "rubber-treloar-uniaxial" / "input" / "rubber-treloar-uniaxial.csv").exists()


def test_a_file_beside_a_config_that_names_the_same_measurements_is_accepted(done, here, specimen):
    done("fit", specimen, "--noise-sd", 1, *ALONE, "--out", "first")
    done("fit", specimen, "--config", "first/run.toml", "--no-figures", "--out", "second")
    assert_closed_form(summary_of(here / "second")[0])


def test_an_option_prevails_over_the_config(cli, done, here, specimen):
    cli("fit", specimen, "--noise-sd", 1, "--prior", "C10=uniform(10,110)", *ALONE, "--out", "first")
    done("fit", "--config", "first/run.toml", "--noise-sd", 2.5, "--no-figures", "--out", "second")
    assert_closed_form(summary_of(here / "second")[0], 2.5, width_kpa=100)


@pytest.mark.parametrize(
    ("first", "second"),
    [(["--noise-sd", 1], ["--noise", "proportional"]), (["--noise", "proportional"], ["--noise-sd", 2.5])],
    ids=["known, then proportional", "proportional, then known"],
)
def test_an_option_of_the_noise_prevails_over_any_noise_of_the_config(done, here, specimen, first, second):
    done("fit", specimen, *first, *ALONE, "--out", "first")
    done("fit", "--config", "first/run.toml", *second, "--no-figures", "--out", "second")
    kinds = [line.split(",")[1] for line in (here / "second" / "parameters.csv").read_text().splitlines()[1:]]
    assert kinds == (["C10"] if "--noise-sd" in second else ["C10", "noise_sd", "noise_share"])


def test_proportional_noise_and_repeats_can_be_chosen(done, here, specimen):
    done("fit", specimen, "--noise", "proportional", *ALONE)
    lines = (here / "runs" / "specimen" / "parameters.csv").read_text().splitlines()
    assert [line.split(",")[1] for line in lines[1:]] == ["C10", "noise_sd", "noise_share"]
    twice = written(here / "twice.csv", stretch=np.repeat(stretch, 2), stress=np.repeat(stress, 2) + [0.5, -0.5] * 6)
    done("fit", twice, "--stress-unit", "kPa", "--noise", "repeats", "--discrepancy", "constant", "--no-figures")
    lines = (here / "runs" / "twice" / "parameters.csv").read_text().splitlines()
    assert [line.split(",")[1] for line in lines[1:]] == ["C10", "m0", "S", "noise_sd"]


def test_a_material_of_other_parameters_is_summarised_by_its_first_one(done, here, specimen):
    said = done("fit", specimen, "--material", "ogden-1", "--noise-sd", 1, "--prior", "mu1=uniform(-500,500)", *ALONE)
    (row,) = summary_of(here / "runs" / "specimen")
    # the measurements are neo-Hookean with C10 = 50 kPa: mu1 = 2 C10
    assert float(row["mu1_mean"]) == pytest.approx(0.1, abs=4 * float(row["mu1_sd"]))
    assert re.search(r"mu1 +[\d.]+ kPa, 95 % interval", said.out)


def test_a_name_with_markup_and_spaces_is_shown_as_it_is(done, here):
    file = written(here / "<b>pig & cow</b>".replace("/", "_"), stretch=stretch, stress=stress)
    done("fit", file, "--stress-unit", "kPa", "--noise-sd", 1, *ALONE)
    (report,) = (here / "runs").glob("*/report.html")
    text = report.read_text()
    assert "&lt;b&gt;pig &amp; cow&lt;_b&gt;" in text
    assert "<b>" not in text


def test_show_prints_what_fit_printed(cli, done, here, specimen):
    fitted = cli("fit", specimen, "--noise-sd", 1, *ALONE)
    shown = done("show", "runs/specimen")
    assert fitted.out == shown.out
    assert "Warning: " in shown.out  # of the test's design
    assert tomllib.loads((here / "runs" / "specimen" / "run.toml").read_text())["file"] == "input/specimen.csv"


def test_show_gives_programs_what_the_files_hold(cli, done, here, specimen):
    done("fit", specimen, "--noise-sd", 1, *ALONE)
    shown = json.loads(cli("show", "runs/specimen", "--json").out)
    files = {name: json.loads((here / "runs" / "specimen" / f"{name}.json").read_text()) for name in shown}
    files["result"]["next"] = files["result"]["next"].replace("{run}", "runs/specimen")
    assert shown == files
    assert {"result", "summary", "assessment"} == set(shown)
    assert cli("show", "nowhere", "--json").status == 2


@pytest.mark.parametrize(
    "damage",
    [
        {"result.json": "[]"},
        {"result.json": "{}"},
        {"result.json": "[{"},
        {"result.json": '[{"formulation": "none"}]'},
        {"result.json": "5"},
        {"result.json": None},
        {"result.json": None, "run.toml": "= ="},
        {"result.json": None, "run.toml": None},
    ],
    ids=str,
)
def test_show_refuses_a_folder_that_is_not_a_complete_run(cli, here, fit_run, damage):
    shutil.copytree(fit_run[0], here / "runs" / "specimen")
    for name, text in damage.items():
        file = here / "runs" / "specimen" / name
        file.unlink() if text is None else file.write_text(text)
    said = cli("show", "runs/specimen")
    assert said.status == 2
    assert said.err.startswith("tissuq: ")
    assert "runs/specimen" in said.err
    assert "Traceback" not in said.err


@pytest.mark.parametrize("folder", ["nowhere", ".", "specimen.csv"])
def test_show_refuses_what_is_not_a_run_folder(cli, specimen, folder):
    said = cli("show", folder)
    assert said.status == 2
    reason = "there is no folder 'nowhere'" if folder == "nowhere" else "is not the folder of a complete run"
    assert reason in said.err


@pytest.mark.slow
@pytest.mark.parametrize("discrepancy", ["gp-orthogonal", "gp-scaled"])
def test_an_estimate_of_the_best_fit_says_so_beside_its_numbers(cli, done, here, specimen, discrepancy):
    said = done("fit", specimen, "--discrepancy", discrepancy, "--noise-sd", 1, "--no-figures")
    report = (here / "runs" / "specimen" / "report.html").read_text(encoding="utf-8")
    for text in (said.out + said.err, report, cli("discrepancies").out):
        assert "not the initial modulus" in " ".join(text.split())


@pytest.mark.parametrize(
    ("stretches", "noise_kpa", "told", "words", "discrepancy"),
    [
        ([0.8, 1.3], 20, 20, "determine C10 poorly", "log"),
        pytest.param([0.8, 1.3], 20, 20, "determine C10 poorly", "auto", marks=pytest.mark.slow),
        pytest.param([0.5, 0.6, 0.7, 1.3, 1.4, 1.6, 1.8], 5, "unknown", "extrapolated", "auto", marks=pytest.mark.slow),
        pytest.param(
            np.linspace(0.7, 1.5, 16).tolist(), 150, 150, "determine C10 poorly", "auto", marks=pytest.mark.slow
        ),
    ],
    ids=["two points", "two points, auto", "nothing near the reference", "noise above the signal"],
)
def test_data_that_say_little_give_a_report_with_a_warning(done, here, stretches, noise_kpa, told, words, discrepancy):
    points = np.array(stretches)
    values = 100 * (points - points**-2) + noise_kpa * np.random.default_rng(3).standard_normal(len(points))
    file = written(here / "poor.csv", stretch=points, stress=values)
    options = ["--stress-unit", "kPa", "--noise-sd", told, "--discrepancy", discrepancy, "--no-figures"]
    said = done("fit", file, *options, "--out", "run")
    assert words in " ".join(said.out.split())
    (row,) = summary_of(here / "run")
    assert float(row["C10_hdi_low"]) < 0.05 < float(row["C10_hdi_high"])
    amplitude = next(line for line in (here / "run" / "parameters.csv").read_text().splitlines() if ",c1," in line)
    assert ",,," in amplitude  # no mean, no sd


@pytest.mark.parametrize("material", slow_but(["neo-hookean"], ["neo-hookean", "mooney-rivlin"]))
def test_a_fit_of_stable_materials_is_repeated_from_its_run_toml(done, here, material):
    asked = ("--material", material, "--stable-in", "uniaxial")
    done("fit", "rubber-treloar-uniaxial", *asked, *ALONE, "--out", "first")
    assert 'stable_in = [\n    "uniaxial",\n]' in (here / "first" / "run.toml").read_text()
    done("fit", "--config", "first/run.toml", "--no-figures", "--out", "second")
    first, second = summary_of(here / "first")[0], summary_of(here / "second")[0]
    assert (first["C10_mean"], first["stable"]) == (second["C10_mean"], "1.0")


def test_the_default_interval_of_a_file_is_of_the_specimen_and_says_so(cli, here, specimen):
    options = [specimen, *ALONE]
    said = {name: cli("fit", *options, "--estimand", name, "--out", name) for name in ("as-tested", "tissue")}
    said["specimen"] = cli("fit", *options, "--out", "specimen")
    assert all(one.status == 0 for one in said.values())
    widths = {}
    for name, one in said.items():
        (row,) = summary_of(here / name)
        assert row["estimand"] == name
        meaning = tq.estimands()[name].description
        assert f"intervals for {meaning}." in " ".join(one.out.split())
        assert f"Intervals are of {meaning}." in (here / name / "report.html").read_text()
        widths[name] = float(row["C10_hdi_high"]) - float(row["C10_hdi_low"])
    assert widths["as-tested"] < widths["specimen"] < widths["tissue"]
    assert "of the stress of a specimen (its area" not in (here / "as-tested" / "report.html").read_text()


def test_a_size_replaces_that_of_the_estimand_and_a_run_repeats_with_both(done, here, specimen):
    options = ["--estimand", "specimen", "--tolerance", "test=0", "--tolerance", "slack=2%"]
    done("fit", specimen, *options, *ALONE, "--out", "first")
    model = tq.load(here / "first").model
    assert model.tolerances == tq.Tolerances("specimen", test=0, slack=0.02)
    assert (model.tolerances.sizes["length"], "test" in model.tolerances.sizes) == (0.01, False)
    done("fit", "--config", "first/run.toml", "--no-figures", "--out", "second")
    assert tq.load(here / "second").model.tolerances == model.tolerances


def test_an_estimand_that_does_not_exist_is_refused(cli, here, specimen):
    said = cli("fit", specimen, "--estimand", "patient", *ALONE)
    assert said.status == 2
    assert "there is no estimand 'patient'. Choose one of: as-tested, specimen, tissue." in said.err.replace("\n", " ")
    assert not (here / "runs").exists()


@pytest.mark.slow
def test_the_page_and_the_terminal_say_that_errors_are_correlated(done, here):
    points, score = np.linspace(0.8, 1.5, 60), np.random.default_rng(4).standard_normal(60)
    errors = np.convolve(score, 0.7 ** np.arange(8))[:60]
    file = written(here / "drift.csv", stretch=points, stress=600 * (points - points**-2) + 10 * errors)
    done("fit", file, "--stress-unit", "kPa", "--discrepancy", "taylor", "--no-figures", "--out", "run")
    assert "correlated (lag-1 correlation 0." in (here / "run" / "report.html").read_text(encoding="utf-8")


def test_a_doubtful_unit_is_warned_of_once(cli, here):
    rows = "".join(f"{1 + k / 40},{k * 0.02 / 12}\n" for k in range(13))
    (here / "test.csv").write_text(f"stretch,stress\n{rows}", encoding="utf-8")
    result = cli("fit", "test.csv", "--discrepancy", "none", "--no-figures")
    assert (result.out + result.err).count("check the unit") == 1


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--mode", "uniaxial", "--mode", "planar"), "--mode is given 2 times beside --config"),
        (("--noise-sd", "1,2"), "--noise-sd is given 2 times beside --config"),
        (("--specimen", "S1"), "--specimen names the specimens of FILES"),
    ],
)
def test_what_is_said_of_each_of_several_files_is_refused_beside_a_config(cli, fit_run, here, options, words):
    said = cli("fit", "--config", fit_run[0] / "run.toml", "--out", "again", *options)
    assert (said.status, (here / "again").exists()) == (2, False)
    assert words in said.err


def test_a_mode_prevails_over_that_of_a_config(done, fit_run, here):
    done("fit", "--config", fit_run[0] / "run.toml", "--out", "again", "--mode", "equibiaxial", "--no-figures")
    assert 'mode = "equibiaxial"' in (here / "again" / "run.toml").read_text()
