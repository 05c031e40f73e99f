"""`tissuq population`, as a user runs it."""

from __future__ import annotations

import json
import re
import tomllib
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

import tissuq as tq
from command_line import done_in, run_in
from tissuq.experiments.reading.findings import experiment_of
from tissuq.population.warnings import warnings_of_tests
from tissuq.result_warning import merged
from tissuq.studies import population
from tissuq.studies.population import PopulationSettings

from .conftest import STRETCH, rows_of
from .models import write_model

MODULI_KPA = [40.0, 48.0, 52.0, 60.0, 75.0, 45.0]
OPTIONS = ["--discrepancy", "none", "--noise-sd", 1]


def measured_rows(modulus, seed):
    stretch = np.array(STRETCH)
    stress = 2 * modulus * (stretch - stretch**-2) + np.random.default_rng(seed).standard_normal(len(stretch))
    return [f"{a},{b:.3f}" for a, b in zip(stretch, stress, strict=True)]


def write_all(folder):
    """Six specimens, the last with two tests, as files; and the same in one file."""
    (folder / "specimens" / "S5").mkdir(parents=True)
    lines = []
    for k, modulus in enumerate(MODULI_KPA):
        names = [f"S{k}.csv"] if k < 5 else ["S5/first.csv", "S5/second.csv"]
        for seed, name in enumerate(names):
            rows = measured_rows(modulus, 10 * k + seed)
            (folder / "specimens" / name).write_text("\n".join(["stretch,stress_kPa", *rows]) + "\n")
            lines += [f"S{k},{row}" for row in rows]
    (folder / "all.csv").write_text("\n".join(["specimen,stretch,stress_kPa", *lines]) + "\n")


@pytest.fixture(scope="session")
def population_run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("population")
    write_all(folder)
    said = done_in(folder, "population", "specimens", *OPTIONS, "--out", "run")
    return folder, said


@pytest.mark.slow
def test_a_run_leaves_the_promised_files(population_run):
    folder, said = population_run
    found = {path.relative_to(folder / "run").as_posix() for path in (folder / "run").rglob("*") if path.is_file()}
    inputs = {f"input/S{k}.csv" for k in range(5)} | {"input/S5/first.csv", "input/S5/second.csv"}
    figures = {f"figures/{name}.{kind}" for name in ("answer", "specimens", "new_patient") for kind in ("svg", "png")}
    tables = {
        "data.csv",
        "population.csv",
        "specimens.csv",
        "new_patient.csv",
        "population.nc",
        "posterior/new-patient.nc",
    }
    assert found == inputs | figures | tables | {"report.html", "result.json", "run.toml", "contents.txt", "tissuq.log"}
    assert "A population of 6 specimens" in said.out
    assert "does not describe the range of specimens" in " ".join(said.out.split())
    page = (folder / "run" / "report.html").read_text()
    assert all(f"<td>S{k}</td>" in page for k in range(6))
    assert "kPa" in page


@pytest.mark.slow
def test_show_prints_what_the_command_printed_and_details_all_else(population_run):
    folder, said = population_run
    assert run_in(folder, "show", "run").out == said.out
    details = " ".join(run_in(folder, "show", "run", "--details").out.split())
    assert "By itself (no pooling): only the data of the specimen." in details
    contents = json.loads(run_in(folder, "show", "run", "--json").out)
    patient = next(row for row in rows_of(folder / "run" / "population.csv") if row["quantity"] == "new specimen")
    headline = contents["result"]["numbers"][0]
    assert headline["name"] == "initial shear modulus of a new specimen"
    for name, end in (("value", "median"), ("low", "hdi_low"), ("high", "hdi_high")):
        assert headline[name] == pytest.approx(2 * float(patient[end]), rel=1e-6)  # the modulus is twice C10
    assert headline["unit"] == "kPa"
    median = next(row for row in rows_of(folder / "run" / "population.csv") if row["quantity"] == "median")
    half_width = (float(median["hdi_high"]) - float(median["hdi_low"])) / 2 / float(median["median"])
    reporting, predicting, _ = contents["result"]["uses"]
    assert reporting["purpose"] == "report the modulus of the tissue"
    assert f"known to ± {100 * half_width:.0f} %" in reporting["reason"]
    assert predicting["purpose"] == "predict a new specimen"
    assert "WITH CARE  report the modulus of the tissue" in said.out
    text = contents["result"]["sections"][-1]["text"][0]
    assert "was fitted by Bayesian inference with tissuq" in text
    assert "to 6 specimens (" in text
    assert "The prior of every spread is half-normal" in text
    assert f"initial shear modulus of a new specimen {headline['text']} (" in text


@pytest.mark.slow
def test_predictions_and_cards_start_from_a_new_patient(population_run):
    folder, _ = population_run
    row = next(row for row in rows_of(folder / "run" / "population.csv") if row["quantity"] == "new specimen")
    patient = tq.load(folder / "run")
    assert float(patient.summary().loc["C10", "median"]) == pytest.approx(float(row["median"]), rel=0.02)
    uses = json.loads((folder / "run" / "result.json").read_text())["uses"]
    (use,) = (use for use in uses if use["purpose"] == "compute with a new specimen")
    for arguments in (["predict", "run", "--mode", "planar", "--points", 3, "--no-figures"], ["export", "run"]):
        said = done_in(folder, *arguments)
        assert use["reason"] in " ".join(said.out.split())


@pytest.mark.slow
def test_no_next_test_is_sought_beside_a_new_patient_of_whom_nothing_was_measured(population_run):
    folder, _ = population_run
    said = run_in(folder, "design", "run", "--out", "design")
    assert said.status == 2
    assert "no stress was measured, it gives a new specimen of the population" in " ".join(said.err.split())


@pytest.mark.slow
def test_a_new_patient_goes_into_a_model_of_the_user_and_into_a_case(population_run, tmp_path):
    """The stub's force is the C10 that stands in the deck; that of a case is in proportion to C10."""
    pytest.importorskip("felupe", reason="FElupe is not installed")
    folder, _ = population_run
    command_of_stub = write_model(tmp_path)
    options = ["--command", command_of_stub, "--draws", 64, "--unit", "kPa", "--no-figures", "--max-jobs", 1]
    words = ["ensemble", folder / "run", "model.inp", "--replace", "TISSUE", "--qoi", "force=RF2@TOP", *options]
    said = done_in(tmp_path, *words, "--solver", "ccx", "--out", "forces")
    assert "those of a new specimen of the population of 6 specimens" in " ".join(said.out.split())
    forces = np.array([float(row["force"]) for row in rows_of(tmp_path / "forces" / "draws.csv")])
    row = next(row for row in rows_of(folder / "run" / "population.csv") if row["quantity"] == "new specimen")
    assert np.median(forces) == pytest.approx(float(row["median"]), rel=0.05)
    inside = (forces > float(row["hdi_low"])) & (forces < float(row["hdi_high"]))
    assert 0.85 <= inside.mean() < 1
    small = ["--case", "bar", "--draws", 4, "--steps", 1, "--size", "fineness=0.5", "--workers", 1, "--no-figures"]
    done_in(tmp_path, "structure", folder / "run", *small, "--out", "bar")
    with xr.open_dataset(tmp_path / "bar" / "curves.nc") as curves:
        ratio = curves["force_complete"].values[:, -1] / curves["parameter_C10"].values
    assert ratio == pytest.approx(ratio[0], rel=1e-6)
    assert "those of a new specimen of the population" in (tmp_path / "bar" / "report.html").read_text()
    again = ["structure", "--config", "bar/run.toml", "--workers", 1, "--no-figures", "--out", "again"]
    done_in(tmp_path, *again)
    assert (tmp_path / "again" / "forces.csv").read_bytes() == (tmp_path / "bar" / "forces.csv").read_bytes()


@pytest.mark.slow
def test_the_numbers_are_those_of_the_specimens(population_run):
    folder, _ = population_run
    found = {row["quantity"]: {key: float(row[key]) for key in ("median", "hdi_low", "hdi_high")}
             for row in rows_of(folder / "run" / "population.csv")}  # fmt: skip
    assert found["median"]["median"] == pytest.approx(np.exp(np.mean(np.log(MODULI_KPA))), rel=0.05)
    assert found["new specimen"]["hdi_low"] < 40
    assert found["new specimen"]["hdi_high"] > 75
    assert 0.1 < found["spread"]["median"] < 0.6  # of the logarithm, which has no unit
    shown = json.loads((folder / "run" / "result.json").read_text(encoding="utf-8"))["numbers"][2]
    assert shown["name"] == "spread between specimens, as a factor"
    assert shown["value"] == pytest.approx(np.exp(found["spread"]["median"]))
    units = [row["unit"] for row in rows_of(folder / "run" / "population.csv")]
    assert units == ["kPa", "", "kPa", "kPa"]
    own = [float(row["median"]) for row in rows_of(folder / "run" / "specimens.csv")]
    assert own == pytest.approx(MODULI_KPA, rel=0.05)
    data, bands = (rows_of(folder / "run" / f"{name}.csv") for name in ("data", "new_patient"))
    assert len(data) == 7 * len(STRETCH)
    stress = max(float(row["stress [kPa]"]) for row in data)
    assert float(bands[-1]["median [kPa]"]) == pytest.approx(stress, rel=0.5)


@pytest.mark.slow
def test_specimens_have_noises_of_their_own(here):
    write_all(here)
    noises = {f"S{k}": 0.5 * (k + 1) for k in range(5)}
    settings = PopulationSettings(files=("specimens",), discrepancy="none", noise_sd=noises)
    found = population.run_population(settings).population
    known = {name: posterior.model.noise for name, posterior in found.posteriors.items()}
    assert [known[name].sd({}, 0.0) for name in noises] == pytest.approx([sd / 1000 for sd in noises.values()])
    assert known["S5"].name == "unknown"
    drawn = found.patient.solution.mixture.settings[:, 0]  # of a random specimen, five of six of which are known
    is_known = np.isclose(drawn[:, None], [known[name].sd({}, 0.0) for name in noises], rtol=1e-9).any(axis=1)
    assert is_known.mean() == pytest.approx(5 / 6, abs=0.02)


@pytest.mark.slow
def test_specimens_that_differ_by_orders_of_magnitude_are_looked_into_first(cli, here):
    moduli, errors = (0.2, 0.9, 3, 10, 40, 160), np.random.default_rng(3).normal(1, 0.02, (6, len(STRETCH)))
    rows = [
        f"S{k},{x},{moduli[k] * (x - x**-2) * error}"
        for k, of_specimen in enumerate(errors)
        for x, error in zip(STRETCH, of_specimen, strict=True)
    ]
    (here / "all.csv").write_text("\n".join(["specimen,stretch,stress_kPa", *rows]) + "\n")
    said = cli("population", "all.csv", "--specimen-column", "specimen", *OPTIONS[:2], "--no-figures", "--out", "run")
    assert "find out why the specimens differ so much" in " ".join(said.out.split())


@pytest.mark.slow
def test_a_run_is_repeated_from_its_own_folder_and_from_one_file(population_run):
    folder, _ = population_run
    expected = (folder / "run" / "population.csv").read_bytes()
    options = ["--no-figures", "--out"]
    done_in(folder, "population", "--config", "run/run.toml", *options, "again")
    assert (folder / "again" / "population.csv").read_bytes() == expected
    done_in(folder, "population", "all.csv", "--specimen", "specimen", *OPTIONS, *options, "one")
    assert (folder / "one" / "population.csv").read_bytes() == expected
    recipe = tomllib.loads((folder / "one" / "run.toml").read_text())
    assert recipe["files"] == ["input/all.csv"]


def write_modes(here):
    """Three specimens with an uniaxial and a planar test, and one with a planar test alone."""
    for k, modulus in enumerate(MODULI_KPA[:3]):
        (here / "all" / f"S{k}").mkdir(parents=True)
        (here / "all" / f"S{k}" / "first.csv").write_text(
            "\n".join(["stretch,stress_kPa", *measured_rows(modulus, k)]) + "\n"
        )
        lines = [f"{a},{2 * modulus * (a - a**-3):.3f}" for a in STRETCH]
        (here / "all" / f"S{k}" / "planar.csv").write_text("\n".join(["stretch,stress_kPa", *lines]) + "\n")
    lines = ["# mode: planar", "stretch,stress_kPa", *(f"{a},{100 * (a - a**-3):.3f}" for a in STRETCH)]
    (here / "all" / "S3.csv").write_text("\n".join(lines) + "\n")


def write_units(here):
    """Three specimens, of which only the first file states the unit of stress."""
    for k, modulus in enumerate(MODULI_KPA[:3]):
        unit = "" if k else "_kPa"
        (here / f"S{k}.csv").write_text("\n".join([f"stretch,stress{unit}", *measured_rows(modulus, k)]) + "\n")


UNITS_ASSUMED = "S1, S2: check the unit: the file states no unit of stress, so MPa was assumed"


def test_files_say_their_mode_by_a_comment_or_by_their_name(here):
    """The short version, without a fit."""
    write_modes(here)
    readings = PopulationSettings(files=("all",)).readings()
    modes = {name: [reading.experiment.mode.name for reading in own] for name, own in readings.items()}
    assert modes == {key: ["uniaxial", "planar"] for key in ("S0", "S1", "S2")} | {"S3": ["planar"]}


def test_warnings_about_files_are_told_with_their_specimens(here):
    """The short version, without a fit."""
    write_units(here)
    readings = PopulationSettings(files=("S0.csv", "S1.csv", "S2.csv")).readings()
    fits = {
        name: SimpleNamespace(model=SimpleNamespace(experiment=tq.Experiment.of([*map(experiment_of, of_one)])))
        for name, of_one in readings.items()
    }
    warnings = merged(warnings_of_tests(SimpleNamespace(posteriors=fits)))
    assert any(text.startswith(UNITS_ASSUMED) for text in warnings)


def test_files_that_name_the_same_specimen_are_tests_of_it(here):
    (here / "all" / "S3").mkdir(parents=True)
    names = {"a.csv": "A12", "b.csv": "A12", "c.csv": "B7", "S3/first.csv": "A12", "S3/second.csv": "B7"}
    for seed, (file, specimen) in enumerate(names.items()):
        lines = [f"Specimen: {specimen}", "stretch,stress_kPa", *measured_rows(40.0, seed)]
        (here / "all" / file).write_text("\n".join(lines) + "\n")
    readings = PopulationSettings(files=("all",)).readings()
    assert {name: len(of_one) for name, of_one in readings.items()} == {"S3": 2, "A12": 2, "c": 1}
    with pytest.raises(tq.InputError, match=r"there are 1 \(A12\).*put each into a folder named after its specimen"):
        population.run_population(PopulationSettings(files=("all/a.csv", "all/b.csv")))


def test_specimens_are_left_out_by_name(here):
    write_all(here)
    settings = PopulationSettings(files=("specimens",), without=("S1", "S5"))
    assert list(settings.readings()) == ["S0", "S2", "S3", "S4"]
    with pytest.raises(tq.InputError, match=r"--without S9: there is no such specimen; the specimens are S0, S1"):
        PopulationSettings(files=("specimens",), without=("S9",)).readings()


@pytest.mark.slow
def test_specimens_may_be_tested_in_several_modes(done, here):
    """Files say their mode by a comment or by their name; a run folder keeps both."""
    write_modes(here)
    done("population", "all", *OPTIONS, "--no-figures", "--out", "run")
    assert {row["mode"] for row in rows_of(here / "run" / "data.csv")} == {"uniaxial", "planar"}
    assert {row["mode"] for row in rows_of(here / "run" / "new_patient.csv")} == {"uniaxial", "planar"}
    assert "4 specimens, uniaxial, planar, " in (here / "run" / "report.html").read_text()
    specimens = rows_of(here / "run" / "specimens.csv")
    assert {row["unit"] for row in specimens} == {"kPa"}
    assert [float(row["median"]) for row in specimens] == pytest.approx([*MODULI_KPA[:3], 50], rel=0.05)
    done("population", "--config", "run/run.toml", "--no-figures", "--out", "again")
    assert (here / "again" / "population.csv").read_bytes() == (here / "run" / "population.csv").read_bytes()


@pytest.mark.slow
def test_warnings_about_files_are_shown_with_their_specimens(done, here):
    write_units(here)
    said = done("population", "S0.csv", "S1.csv", "S2.csv", "--discrepancy", "none", "--no-figures")
    assert UNITS_ASSUMED in " ".join(said.out.split())


AGES = [30, 41, 50, 62, 70, 44]


def write_covariates(folder, rows=(), name="covariates.csv"):
    """Write the ages of the specimens of `write_all`, of files and of names, with other rows at their places."""
    lines = ["specimen;age [year]", *(f"S{k}{'.csv' if k < 2 else ''};{age}" for k, age in enumerate(AGES))]
    for place, row in rows:
        lines[place : place + 1] = [row] if row else []
    (folder / name).write_text("\n".join(lines) + "\n")


@pytest.mark.slow
def test_a_population_follows_covariates_and_a_new_patient_has_them(done, here):
    """The table lies among the specimens, of which it is none; a run is repeated with its copy."""
    write_all(here)
    write_covariates(here / "specimens")
    options = [
        "--covariates",
        "specimens/covariates.csv",
        "--new-patient",
        "age=80",
        "--aim",
        "8 %",
        *OPTIONS,
        "--no-figures",
    ]
    said = done("population", "specimens", *options, "--out", "run")
    row, share = rows_of(here / "run" / "covariates.csv")
    slope = np.polyfit(AGES, np.log(MODULI_KPA), 1)[0]
    assert (row["kind"], row["per"], share["covariate"]) == ("factor", "per year", "all covariates")
    assert float(row["hdi_low"]) < np.exp(slope) < float(row["hdi_high"])
    assert float(row["positive"]) > 0.9
    text = " ".join(said.out.split())
    assert "Positive: the probability that the parameter is larger with it." in text
    assert "new specimen (age 80 year)" in text
    mean_age = f"age {np.mean(AGES):.4g} year"
    assert f"The median of the initial shear modulus in the population ({mean_age}) is" in text
    assert "beyond the specimens: age 80 year (theirs: 30 to 70)" in text
    effect, low, high = map(float, re.search(r"× ([\d.]+) per year \[([\d.]+), ([\d.]+)\]", text).groups())
    width = float(row["hdi_high"]) - float(row["hdi_low"])
    for shown, name in ((effect, "median"), (low, "hdi_low"), (high, "hdi_high")):
        assert shown == pytest.approx(float(row[name]), abs=0.02 * width)  # as exact as the interval is wide
    needed = {row["quantity"]: row for row in rows_of(here / "run" / "specimens_needed.csv")}
    assert float(needed["median"]["specimens"]) == 6 + float(needed["median"]["more"]) > 6
    assert needed["new specimen"]["specimens"] == ""
    assert "Specimens like these for ± 8 %" in text
    assert "not reached: specimens differ more" in text
    page = " ".join((here / "run" / "report.html").read_text(encoding="utf-8").split())
    assert "with a mean that is linear in age (per year). The prior of every spread" in page
    assert "the file of each was read stands under" in page
    patient = next(row for row in rows_of(here / "run" / "population.csv") if row["quantity"] == "new specimen")
    assert float(patient["median"]) == pytest.approx(
        np.exp(np.polyval(np.polyfit(AGES, np.log(MODULI_KPA), 1), 80)), 0.1
    )
    loaded = tq.load(here / "run")
    assert float(loaded.summary().loc["C10", "median"]) == pytest.approx(float(patient["median"]), rel=0.02)
    assert "the patient: age 80 year" in loaded.how
    recipe = tomllib.loads((here / "run" / "run.toml").read_text())
    assert (here / "run" / recipe["covariates"]).read_bytes() == (here / "specimens/covariates.csv").read_bytes()
    again = PopulationSettings.model_validate(recipe)
    assert list(again.sources(here / "run")) == [f"S{k}" for k in range(6)]
    assert again.covariate_table(("S0",), here / "run").values()["S5"] == {"age [year]": "44"}


def test_covariates_may_stand_in_the_file_of_the_specimens(here):
    write_all(here)
    lines = (here / "all.csv").read_text().splitlines()
    aged = [f"{line},{AGES[int(line[1])]}" if place else f"{line},age" for place, line in enumerate(lines)]
    (here / "all.csv").write_text("\n".join(aged) + "\n")
    settings = PopulationSettings(files=("all.csv",), specimen="specimen", covariate=("age",))
    found = settings.covariate_table([])
    assert found.values() == {f"S{k}": {"age": str(age)} for k, age in enumerate(AGES)}
    assert list(settings.readings()) == list(found.values())
    first = {line.partition(",")[0]: line for line in reversed(aged)}
    once = [line if first[line.partition(",")[0]] == line else line.rpartition(",")[0] + "," for line in aged]
    assert once != aged
    (here / "all.csv").write_text("\n".join(once) + "\n")
    assert settings.covariate_table([]).values() == {f"S{k}": {"age": str(age)} for k, age in enumerate(AGES)}
    (here / "all.csv").write_text("\n".join([*aged[:3], aged[3][:-2] + "31", *aged[4:]]) + "\n")
    with pytest.raises(
        tq.InputError, match=r"all\.csv, line 4, column 'age': '31' for specimen 'S0', which has '30' in"
    ):
        settings.covariate_table([]).values()


@pytest.mark.parametrize(
    ("rows", "options", "words"),
    [
        ([(1, "X;3")], [], "covariates.csv, line 2, column 'specimen': there is no specimen 'X'"),
        ([(3, "")], [], "covariates.csv: the covariates of specimen 'S2' are missing. Add a row, or leave out"),
        (
            [(3, "S2;")],
            [],
            "line 4, column 'age [year]': the value of 'age [year]' is missing. Fill it in, or leave out",
        ),
        ([(3, "S1;20")], [], "covariates.csv, line 4, column 'specimen': specimen 'S1' has several rows"),
        ([(3, "S2;old")], [], "covariates.csv, line 4, column 'age [year]': 'old' is no number"),
        ([(3, "S2;5;6")], [], "covariates.csv, line 4: more cells than the 2 columns"),
        ([(0, "specimen;")], [], "covariates.csv, line 1: every column needs a name"),
        ([(k + 1, f"S{k};5") for k in range(6)], [], "column 'age [year]': all specimens have the same value"),
        ([], ["--new-patient", "sex=f"], "there is no covariate 'sex' in this population: the covariates are age"),
        ([], ["--new-patient", "age"], "'age' is not something known of a patient (--new-patient)"),
        ([], ["--covariate", "age"], "give --covariates TABLE, or --covariate for columns of the one FILE"),
    ],
)
def test_covariates_that_cannot_be_used_end_with_one_message(refused, here, rows, options, words):
    write_all(here)
    write_covariates(here, rows)
    refused([words], "population", "specimens", "--covariates", "covariates.csv", *OPTIONS, *options)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "give the FILES"),
        (["nowhere.csv"], "there is no such file"),
        (["specimens/S0.csv", "specimens/S1.csv"], "needs 3 specimens or more; there are 2 (S0, S1)"),
        (["specimens", "--specimen", "who"], "--specimen-column names a column of a single file"),
        (["specimens", "--covariate", "age"], "for several files give a table of the covariates"),
        (["specimens", "--new-patient", "age=60"], "it was fitted without covariates"),
        (["specimens", "--aim", "little"], "--aim needs a share such as 10% or 0.1, not 'little'"),
        (["specimens", "--aim", "0"], "aim"),
        (["specimens", "--aim", "10"], "--aim needs a share such as 10% or 0.1, not '10'"),
        (["specimens", "--estimand", "tissue"], "which a population finds itself"),
        (["specimens", "--tolerance", "stress=much"], "is not a tolerance"),
        (["specimens", "--parameter", "C99"], "found: C99"),
        (["specimens", "--without", "S9"], "--without S9: there is no such specimen"),
        (["specimens", "--spread", "-1"], "spread"),
        (["specimens", "--noise-sd", "much"], "--noise-sd must be a number"),
        (["specimens", "--noise-sd", "1,2"], "--noise-sd must be a number"),
        (["specimens", "--noise-sd", "S0=1,S9=2"], "there is a noise of S9, but the specimens are S0, S1"),
        (["specimens", "--noise-sd", "S0=0"], "must be a positive number in the file's stress unit"),
        (["specimens", "--mode", "biaxial"], "loading mode 'biaxial' has engineering stress of axis 1"),
    ],
)
def test_bad_input_ends_with_one_message(refused, here, arguments, words):
    write_all(here)
    refused([words], "population", *arguments)


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["biaxial", "simple-shear-normal"])
def test_specimens_with_two_stresses_in_several_tests_of_one_table_are_a_population(done, here, mode):
    noise, rows = np.random.default_rng(3), []
    for k, modulus in enumerate(MODULI_KPA):
        for test, (x, y) in {"first": (0.3, 0.3), "second": (0.3, 0.0)}.items():
            for part in np.linspace(0, 1, 9):
                if mode == "biaxial":
                    a, b = 1 + part * x, 1 + part * y
                    stresses = np.array([a - a**-3 * b**-2, b - b**-3 * a**-2])
                    points = f"{a:.6f},{b:.6f}"
                else:
                    shear = part * (x + y)
                    stresses, points = np.array([shear, -(shear**2)]), f"{shear:.6f}"
                first, second = 2 * modulus * stresses + 0.5 * noise.standard_normal(2)
                rows.append(f"S{k},{test},{points},{first:.4f},{second:.4f}")
    controls = "stretch x,stretch y" if mode == "biaxial" else "shear"
    stresses = "stress x [kPa],stress y [kPa]" if mode == "biaxial" else "shear stress [kPa],normal stress [kPa]"
    (here / "all.csv").write_text("\n".join([f"specimen,protocol,{controls},{stresses}", *rows]) + "\n")
    options = ["--specimen-column", "specimen", "--mode", mode, "--discrepancy", "none", "--noise-sd", 0.5]
    if mode != "biaxial":
        options += ["--column", "stress=shear stress [kPa]", "--column", "stress2=normal stress [kPa]"]
    done("population", "all.csv", *options, "--out", "run", "--no-figures")
    found = {row["specimen"]: float(row["median"]) for row in rows_of(here / "run" / "specimens.csv")}
    for k, modulus in enumerate(MODULI_KPA):
        assert found[f"S{k}"] == pytest.approx(modulus, rel=0.02)  # sd of a C10: 0.5 kPa over the norm of 36 stresses
    measured = [row["measured"] for row in rows_of(here / "run" / "data.csv")]
    assert len(set(measured)) == 2
    assert len(measured) == 2 * len(rows)
    page = (here / "run" / "report.html").read_text()
    assert ("Not predicted: biaxial" in page) == (mode == "biaxial")
    assert (here / "run" / "new_patient.csv").exists() == (mode != "biaxial")
