"""Bad input: exit status 2, one message that names what is wrong, and the folder as it was."""

from pathlib import Path

import pytest

BAD_FILES = sorted((Path(__file__).parents[1] / "experiments" / "bad_files").iterdir())

FIT = [
    (["nowhere.csv"], ["nowhere.csv", "no such file"]),
    (["a" * 300 + ".csv"], ["aaa.csv", "too long"]),
    ([], ["FILE", "--config"]),
    (["SPECIMEN", "--column", "stress=Load"], ["no column 'Load'", "'stretch', 'stress_kPa'"]),
    (["SPECIMEN", "--column", "energy=Load"], ["'energy'", "stress or force"]),
    (["SPECIMEN", "--column", "stress"], ["--column", "ROLE=COLUMN"]),
    (["SPECIMEN", "--column", "stress="], ["--column", "ROLE=COLUMN"]),
    (["SPECIMEN", "--column", "stress=1", "--column", "stress=2"], ["--column", "twice", "'stress'"]),
    (["SPECIMEN", "--column", "stretch=1", "--column", "strain=1"], ["both stretch and strain"]),
    (["SPECIMEN", "--column", "stretch=stretch", "--strain-unit", "percent"], ["--strain-unit", "read as stretch"]),
    (["SPECIMEN", "--strain-unit", "percent"], ["--strain-unit", "column 'stretch'"]),
    (["SPECIMEN", "--stress-unit", "furlong"], ["'furlong'", "unit of stress"]),
    (["SPECIMEN", "--stress-unit", "MPa"], ["--stress-unit", "the file says 'kPa'"]),
    (["SPECIMEN", "--stress-type", "kirchhoff"], ["stress_type", "engineering, cauchy", "'kirchhoff'"]),
    (["SPECIMEN", "--compression-positive"], ["specimen.csv", "compression_positive"]),
    (["SPECIMEN", "--skip-rows", "-1"], ["skip_rows", "-1"]),
    (["SPECIMEN", "--mode", "torsion"], ["'torsion'", "uniaxial"]),
    (["SPECIMEN", "--noise-sd", "-1"], ["noise_sd", "positive", "-1", "stress unit"]),
    (["SPECIMEN", "--noise-sd", "0"], ["noise_sd", "positive", "0"]),
    (["SPECIMEN", "--noise-sd", "1e308"], ["noise_sd", "positive", "1e+308"]),
    (["SPECIMEN", "--noise-sd", "nan"], ["noise_sd", "positive", "nan"]),
    (["SPECIMEN", "--noise-sd", "inf"], ["noise_sd", "positive", "inf"]),
    (["SPECIMEN", "--noise-sd", "small"], ["--noise-sd", "'small'", "'unknown'"]),
    (["SPECIMEN", "--material", "neo-hooke"], ["'neo-hooke'", "Did you mean 'neo-hookean'?"]),
    (["SPECIMEN", "--discrepancy", "cubic"], ["'cubic'", "quadratic"]),
    (["SPECIMEN", "--discrepancy", "none", "--discrepancy", "cubic"], ["'cubic'", "quadratic"]),
    (["SPECIMEN", "--discrepancy", "none", "--discrepancy", "all"], ["discrepancies", "'all' cannot be combined"]),
    (["SPECIMEN", "--material", "yeoh", "--discrepancy", "yeoh"], ["C20, C30", "'yeoh'", "Choose another"]),
    (["SPECIMEN", "--method", "gibbs"], ["method", "'gibbs'", "'nuts'"]),
    (["SPECIMEN", "--noise-sd", "0.02 kPa"], ["'0.02 kPa'", "stresses are in kPa, type --noise-sd 0.02."]),
    (["SPECIMEN", "--noise", "0.02 kPa"], ["standard deviation", "the file's stress unit", "--noise-sd 0.02 "]),
    (["SPECIMEN", "--noise", "2%"], ["noise: ", "grows with the stress", "'proportional'"]),
    (["SPECIMEN", "--noise-sd", "2%"], ["'2%'", "--noise proportional"]),
    (["SPECIMEN", "--noise", "5"], ["standard deviation", "--noise-sd 5 "]),
    (["SPECIMEN", "--noise", "white"], ["noise: there is no noise named 'white'", "proportional, repeats"]),
    (["SPECIMEN", "--noise", "repeats", "--noise-sd", "1"], ["noise_sd or noise, not both", "1.0", "'repeats'"]),
    (["SPECIMEN", "--discrepancy", "none", "--method", "nuts", "--noise-sd", "1"], ["'nuts'", "nothing is left"]),
    (["SPECIMEN", "--seed", "-1"], ["seed", "-1"]),
    (["SPECIMEN", "--seed", "18446744073709551616"], ["seed", "4611686018427387904", "18446744073709551616"]),
    (["SPECIMEN", "--material", "ogden-1000000"], ["1 to 20 terms, not 1000000"]),
    (["SPECIMEN", "--material", "ogden-" + "9" * 5000], ["1 to 20 terms"]),
    (["SPECIMEN", "--prior", "C10"], ["'C10' is not a prior", "C10=uniform(0, 5)"]),
    (["SPECIMEN", "--prior", "C10=uniform(0;5)"], ["numbers", "0;5"]),
    (["SPECIMEN", "--prior", "C10=uniform(5)"], ["uniform", "low, high"]),
    (["SPECIMEN", "--prior", "C10=uniform(0,low=5)"], ["uniform", "low, high"]),
    (["SPECIMEN", "--prior", "C10=uniform(0,upper=5)"], ["uniform", "low, high"]),
    (["SPECIMEN", "--prior", "C10=uniform(5,0)"], ["uniform", "low must be less than high"]),
    (["SPECIMEN", "--prior", "C10=uniform(0,nan)"], ["uniform", "high", "nan"]),
    (["SPECIMEN", "--prior", "C10=unifrom(0,5)"], ["'unifrom'", "Did you mean 'uniform'?"]),
    (["SPECIMEN", "--prior", "C10=normal(5,-1)"], ["normal", "sd must be positive"]),
    (["SPECIMEN", "--prior", "C10=uniform(-5,5)"], ["C10", "beyond", "0 to inf"]),
    (["SPECIMEN", "--prior", "D1=uniform(0,5)"], ["'D1'", "C10"]),
    (["SPECIMEN", "--discrepancy", "none", "--prior", "c=uniform(0,5)"], ["'c'", "C10"]),
    (["SPECIMEN", "--prior", "C10=uniform(0,5)", "--prior", "C10=uniform(0,9)"], ["--prior", "twice", "'C10'"]),
    (["TWO", "--discrepancy", "constant"], ["'two'", "2 measurements for 4 parameters (C10, m0, S, noise_sd)"]),
    (["TWO", "--material", "yeoh", "--discrepancy", "all"],
     ["no discrepancy can be fitted", "2 measurements", "C10, C20, C30, noise_sd"]),
    (["SPECIMEN", "--config", "broken.toml"], ["broken.toml", "not TOML", "line 2"]),
    (["--config", "nowhere.toml"], ["no configuration file 'nowhere.toml'"]),
    (["--config", "."], ["configuration file '.'", "directory"]),
    (["--config", "SPECIMEN"], ["specimen.csv", "not TOML"]),
    (["--config", "unknown_key.toml"], ["unknown_key.toml", "no setting 'materail'", "material"]),
    (["--config", "wrong_type.toml"], ["wrong_type.toml", "seed", "'two'"]),
    (["--config", "wrong_table.toml"], ["wrong_table.toml", "priors", "5"]),
    (["--config", "wrong_prior.toml"], ["uniform", "low", "'zero'"]),
    (["--config", "no_file.toml"], ["no_file.toml", "give one file, or several tests"]),
    (["--config", "lost_file.toml"], ["lost.csv", "no such file"]),
    (["TWO", "--config", "good.toml"], ["two.csv", "good.toml", "specimen.csv", "Leave FILE out"]),
]  # fmt: skip

CONFIGS = {
    "good": 'file = "specimen.csv"\n',
    "broken": 'file = "specimen.csv"\nseed = = 2\n',
    "unknown_key": 'file = "specimen.csv"\nmaterail = "yeoh"\n',
    "wrong_type": 'file = "specimen.csv"\nseed = "two"\n',
    "wrong_table": 'file = "specimen.csv"\npriors = 5\n',
    "wrong_prior": 'file = "specimen.csv"\n[priors.C10]\ndistribution = "uniform"\nlow = "zero"\nhigh = 5\n',
    "no_file": "seed = 2\n",
    "lost_file": 'file = "lost.csv"\n',
}

PAPER = [
    (["--points", "5"], ["points", "6", "5"]),
    (["--measurements", "12.5"], ["--measurements", "whole number"]),
    (["--stretch-range", "0.5"], ["--stretch-range", "LOW:HIGH", "'0.5'"]),
    (["--stretch-range", "low:high"], ["--stretch-range", "LOW:HIGH"]),
    (["--stretch-range", "2:1"], ["the smallest stretch, 2", "the largest, 1 (--stretch-range)"]),
    (["--stretch-range", "0:2"], ["stretch_low", "greater than 0"]),
    (["--stretch-range", "nan:2"], ["stretch_low", "nan"]),
    (["--stretch-range", "0.5:inf"], ["stretch_high", "finite", "inf"]),
    (["--noise-sd", "0"], ["noise_sd", "greater than 0"]),
    (["--noise-sd", "-0.5"], ["noise_sd", "-0.5"]),
    (["--noise-sd", "nan"], ["noise_sd", "nan"]),
    (["--noise-sd", "little"], ["--noise-sd", "number"]),
    (["--seed", "-1"], ["seed", "-1"]),
    (["--replicates", "0"], ["replicates", "0"]),
    (["--sampler", "auto"], ["sampler", "'exact', 'nuts' or 'both'", "'auto'"]),
    (["--prior", "mu=uniform(0,5)"], ["no parameter is named mu", "C10"]),
    (["--prior", "c=uniform(5,0)"], ["low must be less than high"]),
    (["--prior", "c=uniform(0,1)", "--prior", "c=uniform(0,9)"], ["--prior", "twice", "'c'"]),
    (["--config", "good.toml"], ["good.toml", "no setting 'file'", "points"]),
    (["--config", "broken.toml"], ["broken.toml", "not TOML"]),
]


@pytest.fixture
def files(here, specimen):
    (here / "two.csv").write_text("stretch,stress_kPa\n0.9,-33\n1.1,28\n")
    for name, text in CONFIGS.items():
        (here / f"{name}.toml").write_text(text)
    return {"SPECIMEN": "specimen.csv", "TWO": "two.csv"}


@pytest.mark.parametrize("file", BAD_FILES, ids=lambda file: file.name)
def test_a_bad_file_is_named_and_no_run_is_left(refused, file):
    refused([file.name], "fit", file, "--discrepancy", "none", "--no-figures")


@pytest.mark.parametrize(("arguments", "words"), FIT, ids=lambda case: " ".join(case)[:60])
def test_fit_refuses_bad_options_and_leaves_the_folder_as_it_was(refused, files, arguments, words):
    refused(words, "fit", *(files.get(word, word) for word in arguments), "--no-figures")


MISNAMED = [
    (["--discrepancy", "cubic"], ["(--discrepancy)", "no discrepancy named 'cubic'", "quadratic"]),
    (["--material", "yeoh", "--material", "gent", "--discrepancy", "cubic"], ["no discrepancy named 'cubic'"]),
    (["--stable-in", "tension"], ["(--stable-in)", "'tension'", "uniaxial"]),
    (["--stable-in", "all", "--stable-in", "planar"], ["(--stable-in)", "'all' cannot be combined"]),
    (["--prior", "D1=uniform(0,5)"], ["'D1'", "C10"]),
    (["--material", "yeoh", "--material", "gent", "--prior", "D1=uniform(0,5)"], ["'D1'", "C20", "Jm"]),
    (["--tolerance", "stress=2"], ["'stress=2' is not a tolerance"]),
    (["--tolerance", "none", "--estimand", "specimen"], ["'specimen' has errors of the tests", "'as-tested'"]),
]  # fmt: skip


@pytest.mark.parametrize(("arguments", "words"), MISNAMED, ids=lambda case: " ".join(case)[:60])
def test_a_name_that_does_not_exist_is_told_before_that_the_folder_does(refused, here, files, arguments, words):
    (here / "runs" / "specimen").mkdir(parents=True)
    (here / "runs" / "specimen" / "notes.txt").touch()
    refused(["runs/specimen"], "fit", "specimen.csv")
    for source in (["specimen.csv"], ["--config", "good.toml"]):
        assert "runs/specimen" not in refused(words, "fit", *source, *arguments).err


@pytest.mark.parametrize(("arguments", "words"), PAPER, ids=lambda case: " ".join(case)[:60])
def test_paper_refuses_bad_options_and_leaves_the_folder_as_it_was(refused, files, arguments, words):
    refused(words, "paper", *arguments, "--no-figures")


@pytest.mark.parametrize("arguments", [["fit", "binary.csv"], ["paper", "--points", "2"]])
def test_an_error_is_one_line_on_standard_error(cli, arguments):
    bad = [str(file) for file in BAD_FILES if file.name == arguments[-1]] or arguments[-1:]
    said = cli(*arguments[:-1], *bad)
    assert said.err.startswith("tissuq: ")
    assert said.err.count("\n") == 1


def test_a_column_called_stretch_is_not_taken_for_a_strain(refused, here):
    (here / "a.csv").write_text("stretch,stress\n0.8,-1\n1.2,1\n1.3,1.4\n", encoding="utf-8")
    refused(["named a stretch but read as a strain"], "fit", "a.csv", "--column", "strain=stretch")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "--preset with one of"),
        (["--preset", "all"], "there is no preset 'all'"),
        (["--preset", "strength", "--noise", "some"], "'known' or 'unknown'"),
        (["--config", "missing.toml"], "missing.toml"),
        (["--preset", "strength", "--out", "other"], "not the folder of a campaign"),
        (["--config", "many.toml"], "1,200,000 fits are requested"),
        (["--config", "few.toml"], "3 measurements for 4 parameters"),
        (["--config", "unknown.toml"], "replicats"),
        (["--preset", "sbc", "--replicates", "5"], "greater than or equal to 20"),
        pytest.param(
            ["--preset", "strength", "--scheduler", "tcp://127.0.0.1:1"],
            "no Dask scheduler answers",
            marks=pytest.mark.slow,  # the message itself is held in tests/validation/test_coverage.py
        ),
    ],
)
def test_a_campaign_refuses_bad_options_before_anything_is_written(refused, here, arguments, words):
    design = "designs = [{ low = 0.7, high = 2.0, points = 3, noise_sd = 0.1 }]\n"
    (here / "many.toml").write_text(design + 'formulations = ["none"]\nreplicates = 100_000\n')
    (here / "few.toml").write_text(design + 'formulations = ["linear"]\n')
    (here / "unknown.toml").write_text(design + "replicats = 3\n")
    (here / "other").mkdir()
    (here / "other" / "file.txt").write_text("mine")
    refused([words], "study", "coverage", *arguments)


def test_a_campaign_goes_on_from_a_kill_before_its_recipe_was_whole(refused, done, here):
    (here / "small.toml").write_text(
        'designs = [{ low = 0.7, high = 2.0, points = 9, noise_sd = 0.1 }]\nformulations = ["none"]\n'
        'families = ["yeoh", "gent"]\nreplicates = 2\n'
    )
    (here / "out").mkdir()
    (here / "out" / "run.toml.new").write_text("designs = [")
    done("study", "coverage", "--config", "small.toml", "--out", "out")
    assert {
        "run.toml",
        "tasks.jsonl",
        "summary.csv",
        "families.csv",
        "figures",
        "report.html",
        "result.json",
        "tissuq.log",
    } == {path.name for path in (here / "out").iterdir()}
    refused(["other settings"], "study", "coverage", "--config", "small.toml", "--out", "out", "--seed", "1")
