"""``tissuq calibrate --model``: a deck as forward model, with a program in the place of CalculiX."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import tissuq as tq
from command_line import done_in

from .conftest import rows_of, write_specimen
from .models import killed_after, started, write_model

TIMES = np.array([0.1, 0.25, 0.4, 0.55, 0.7, 0.85, 1.0])
TRUTH, NOISE_SD = 3.0, 0.1


def forces(folder: Path) -> tuple[float, float]:
    """Write a file of the force at times, mN; return mean and sd of C10 by least squares: the force is C10 t."""
    measured = TRUTH * TIMES + NOISE_SD * np.random.default_rng(3).standard_normal(len(TIMES))
    rows = "".join(f"{at:.3f},{force:.6f}\n" for at, force in zip(TIMES, measured, strict=True))
    (folder / "punch.csv").write_text(f"time,force (mN)\n{rows}")
    return float(TIMES @ measured / (TIMES @ TIMES)), float(NOISE_SD / np.sqrt(TIMES @ TIMES))


@pytest.fixture
def words(here):
    """What is typed after ``tissuq``: the stub's force, of a model in kPa (mm, mN)."""
    command = write_model(here)
    return [
        "calibrate", "punch.csv", "--model", "model.inp", "--replace", "TISSUE", "--material", "neo-hookean",
        "--range", "0.7:1.3", "--qoi", "force=RF2@TOP", "--solver", "ccx", "--command", command, "--unit", "kPa",
        "--noise-sd", NOISE_SD, "--discrepancy", "none", "--runs", 8, "--max-jobs", 1, "--no-figures", "--out", "out",
    ]  # fmt: skip


WIDE = ["--prior", "C10=uniform(0.5,10)"]


def c10(folder: Path) -> tuple[float, float]:
    """Return mean and sd of C10 in a run."""
    rows = {row["parameter"]: row for row in json.loads((folder / "summary.json").read_text())}
    return rows["C10"]["mean"], rows["C10"]["sd"]


@pytest.mark.slow
def test_where_no_parameters_fit_units_and_priors_come_before_anything_else(done, here, words):
    forces(here)
    said = done(*words, "--prior", "C10=uniform(0.01,0.02)")
    assert "Next: check units and signs of data and model (--unit, --factor), and the priors" in said.out
    assert "Not to be used: no parameters that the priors allow give the measurements" in " ".join(said.out.split())


@pytest.mark.slow
def test_the_posterior_is_that_of_least_squares_in_the_unit_of_the_model(cli, done, here, words):
    mean, sd = forces(here)
    done(*words, *WIDE)
    found = c10(here / "out")
    assert found[0] == pytest.approx(mean, abs=0.05 * sd)
    assert found[1] == pytest.approx(sd, rel=0.03)
    assert len(started(here)) == 8
    done("export", "out", "--format", "calculix", "--draws", 64, "--unit", "kPa", "--out", "cards")
    constants = [float(row["card_C10"]) for row in rows_of(here / "cards" / "index.csv")]
    assert np.mean(constants) == pytest.approx(mean, abs=0.2 * sd)
    said = cli("design", "out")
    assert (said.status, "no stress was measured" in said.err) == (2, True)
    page = (here / "out" / "report.html").read_text(encoding="utf-8")
    assert "got the card of neo-hookean" in page
    assert "<td>C10 [kPa]" in page
    assert "Report C10:" in page
    (number,) = [n for n in json.loads((here / "out" / "result.json").read_text())["numbers"] if n["name"] == "C10"]
    assert number["text"].split()[1] == "kPa"
    units = {row["parameter"]: row["unit"] for row in rows_of(here / "out" / "summary.csv")}
    assert units["C10"] == "kPa"


@pytest.mark.slow
@pytest.mark.parametrize(("heading", "factor"), [("force (N)", 1e-3), ("force (uN)", 1e3)])
def test_units_signs_and_symmetry_are_made_those_of_the_file(done, here, words, heading, factor):
    mean, sd = forces(here)
    table = np.loadtxt(here / "punch.csv", delimiter=",", skiprows=1)
    rows = "".join(f"{at:.3f},{-4 * factor * force:.9g}\n" for at, force in table)
    (here / "punch.csv").write_text(f"time,{heading}\n{rows}")
    changed = [4 * factor * NOISE_SD if word == NOISE_SD else word for word in words]
    done(*changed, *WIDE, "--factor", "force=-4")
    assert c10(here / "out") == (pytest.approx(mean, abs=0.05 * sd), pytest.approx(sd, rel=0.03))


@pytest.mark.slow
def test_several_quantities_of_a_deck_have_a_column_a_unit_and_a_noise_each(done, here, words):
    """Least squares with weights; a quantity counts where there is a value of it."""
    forces(here)
    table = np.loadtxt(here / "punch.csv", delimiter=",", skiprows=1)
    second_sd, seen = 0.05, np.array([False, True, False, True, True, False, True])
    again = TRUTH * TIMES + second_sd * np.random.default_rng(4).standard_normal(len(TIMES))
    cells = (f"{-1e-3 * force:.9f}" if is_seen else "" for force, is_seen in zip(again, seen, strict=True))
    rows = "".join(f"{at:.3f},{cell},{force:.6f}\n" for (at, force), cell in zip(table, cells, strict=True))
    (here / "punch.csv").write_text(f"time,reaction (N),force (mN)\n{rows}")
    weights = np.concatenate([np.full(len(TIMES), NOISE_SD**-2), np.full(seen.sum(), second_sd**-2)])
    at, values = np.concatenate([TIMES, TIMES[seen]]), np.concatenate([table[:, 1], again[seen]])
    mean, sd = weights * at @ values / (weights * at @ at), (weights * at @ at) ** -0.5
    noise = f"force={NOISE_SD},reaction={1e-3 * second_sd}"
    changed = [noise if word == NOISE_SD else word for word in words]
    more = ["--qoi", "reaction=RF2@TOP", "--factor", "reaction=-1"]
    done(*changed, *WIDE, *more)
    assert c10(here / "out") == (pytest.approx(mean, abs=0.05 * sd), pytest.approx(sd, rel=0.03))
    assert [row["quantity"] for row in rows_of(here / "out" / "prediction.csv")] == ["force"] * 7 + ["reaction"] * 4
    page = " ".join((here / "out" / "report.html").read_text(encoding="utf-8").split())
    assert "reaction (N) of the file is -0.001 times reaction (RF2@TOP)" in page
    repeat = ["calibrate", "--config", "out/run.toml", "--max-jobs", 1, "--figures", "--out", "again"]
    done(*repeat, "--command", words[words.index("--command") + 1])
    assert (here / "again" / "summary.csv").read_bytes() == (here / "out" / "summary.csv").read_bytes()


def two_experiments(folder):
    """Write files of two tests, the second at other times, and their decks; return mean and sd of C10 together."""
    second_sd, at = 0.05, np.array([0.2, 0.5, 0.9])
    forces(folder)
    first = np.loadtxt(folder / "punch.csv", delimiter=",", skiprows=1)
    again = TRUTH * at + second_sd * np.random.default_rng(4).standard_normal(len(at))
    rows = "".join(f"{time:.3f},{force:.6f}\n" for time, force in zip(at, 1e-3 * again, strict=True))
    (folder / "pull.csv").write_text(f"time,pull (N)\n{rows}")
    (folder / "pull.inp").write_text((folder / "model.inp").read_text().replace("Tissue", "Other"))
    weights = np.concatenate([np.full(len(first), NOISE_SD**-2), np.full(len(at), second_sd**-2)])
    at, values = np.concatenate([TIMES, at]), np.concatenate([first[:, 1], again])
    return weights * at @ values / (weights * at @ at), (weights * at @ at) ** -0.5


TWO = ["--model", "pull.inp", "--replace", "OTHER", "--qoi", "pull=RF2@TOP"]


@pytest.mark.slow
def test_experiments_have_a_file_and_a_model_each(done, here, words):
    """Least squares with weights; the file named first is that of the model named first."""
    mean, sd = two_experiments(here)
    noises = f"force={NOISE_SD},pull={5e-5}"
    words = [words[0], "punch.csv", "pull.csv", *(noises if word == NOISE_SD else word for word in words[2:])]
    done(*words, *WIDE, *TWO)
    assert c10(here / "out") == (pytest.approx(mean, abs=0.05 * sd), pytest.approx(sd, rel=0.03))
    assert len(started(here)) == 2 * 8
    assert [row["quantity"] for row in rows_of(here / "out" / "prediction.csv")] == ["force"] * 7 + ["pull"] * 3
    page = " ".join((here / "out" / "report.html").read_text(encoding="utf-8").split())
    assert "of pull.inp got the card of neo-hookean" in page
    assert "pull (N) of the file is 0.001 times pull (RF2@TOP)" in page
    repeat = ["calibrate", "--config", "out/run.toml", "--max-jobs", 1, "--out", "again"]
    done(*repeat, "--command", words[words.index("--command") + 1])
    assert (here / "again" / "summary.csv").read_bytes() == (here / "out" / "summary.csv").read_bytes()


@pytest.mark.slow
def test_files_that_several_models_need_are_copied_for_each_and_the_run_is_repeated(done, here, words):
    """Of two decks one includes a mesh beside its folder; both get a file that none includes."""
    mean, sd = two_experiments(here)
    deck = (here / "model.inp").read_text()
    nodes = "*NODE, NSET=TOP\n1, 0., 0., 0.\n"
    (here / "mesh.inp").write_text(nodes)
    (here / "punch").mkdir()
    (here / "punch" / "model.inp").write_text(deck.replace(nodes, "*INCLUDE, INPUT=../mesh.inp\n"))
    (here / "fibres.txt").write_text("none")
    changed = {"model.inp": "punch/model.inp", NOISE_SD: f"force={NOISE_SD},pull={5e-5}"}
    words = [words[0], "punch.csv", "pull.csv", *(changed.get(word, word) for word in words[2:])]
    done(*words, *WIDE, *TWO, "--also", "mesh.inp", "--also", "fibres.txt")
    assert c10(here / "out") == (pytest.approx(mean, abs=0.05 * sd), pytest.approx(sd, rel=0.03))
    repeat = ["calibrate", "--config", "out/run.toml", "--max-jobs", 1, "--no-figures", "--out", "again"]
    done(*repeat, "--command", words[words.index("--command") + 1])
    assert (here / "again" / "summary.csv").read_bytes() == (here / "out" / "summary.csv").read_bytes()
    for number in (1, 2):
        copies = {path.name for path in (here / "again" / "input" / f"{number}").rglob("*")}
        assert {"mesh.inp", "fibres.txt"} <= copies


@pytest.mark.parametrize(
    ("option", "value", "advice"),
    [("--range", "1.3:0.7", "two rising positive numbers, not 1.3:0.7"), ("--mode", "uniaxail", "uniaxial")],
)
def test_a_range_that_is_none_is_refused_before_anything_is_run(cli, here, words, option, value, advice):
    forces(here)
    before = {path.name for path in here.iterdir()}
    said = cli(*words, *WIDE, option, value)
    assert (said.status, advice in said.err) == (2, True)
    assert {path.name for path in here.iterdir()} == before


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs Linux")
def test_what_is_killed_in_a_second_model_keeps_the_run_of_the_first(done, here, words):
    """Only the run of the solver that was going on is made again: 17 of two models at 8 points."""
    two_experiments(here)
    words = [words[0], "punch.csv", "pull.csv", *words[2:], *WIDE, *TWO, "--noise-sd", f"force={NOISE_SD},pull={5e-5}"]
    (here / "slow").write_text("1")
    killed_after(6, here / "started", here, *words)
    (here / "slow").unlink()
    done(*words)
    assert len(started(here)) == 2 * 8 + 1
    assert not list((here / "out-forward-runs").glob("model-*/solver/*"))


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ([], "every file has its model, in the same order: there are 2 files and 1 models"),
        (["--model", "pull.inp"], "give --qoi for each of 2"),
        (["--model", "pull.inp", "--qoi", "drop=RF2@TOP"], "no file has a column 'drop' (--qoi drop=...)"),
        (["--model", "pull.inp", "--qoi", "time=RF2@TOP"], "punch.csv and pull.csv have a column 'time'"),
        (["--model", "pull.inp", "--qoi", "time=RF2@TOP"], "exactly one file must have it; rename it in the others."),
        ([*TWO, "--along", "depth=U2@TOP"], "no file has a column 'depth' (--along depth=...)"),
        ([*TWO, "--replace", "THIRD"], "give --replace once for all models, or for each of the 2"),
        ([*TWO, "--along", "time=U2@TOP"], "punch.csv and pull.csv have a column 'time'"),
    ],
)
def test_files_and_models_that_do_not_fit_end_with_one_message(refused, here, words, more, message):
    two_experiments(here)
    refused([message], words[0], "punch.csv", "pull.csv", *words[2:], *WIDE, "--noise-sd", "unknown", *more)


def test_two_controls_of_one_of_several_files_are_refused(refused, here, words):
    two_experiments(here)
    (here / "pull.csv").write_text("travel,turn,pull (N)\n0.2,1,0.001\n0.5,2,0.002\n0.9,3,0.003\n")
    along = ["--along", "travel=U2@TOP", "--along", "turn=U1@TOP"]
    refused(
        ["has the columns travel and turn, both given as its control (--along)"],
        words[0],
        "punch.csv",
        "pull.csv",
        *words[2:],
        *WIDE,
        "--noise-sd",
        "unknown",
        *TWO,
        *along,
    )
    assert started(here) == []


@pytest.mark.slow
def test_runs_that_fail_are_listed_and_left_out(done, here, words):
    mean, sd = forces(here)
    (here / "stiff").write_text("6.83")  # above which are 4 of 12 stratified runs: as many are left as in other tests
    said = done(*words, *WIDE, "--runs", 12)
    runs = rows_of(here / "out" / "forward_runs.csv")
    assert all(bool(run["error"]) == (float(run["C10"]) > 6.83) for run in runs)
    assert sum(bool(run["error"]) for run in runs) == 4
    assert "increment size smaller than minimum; the control came to 0.5" in next(
        r["error"] for r in runs if r["error"]
    )
    assert "increment size smaller than minimum" in " ".join(said.out.split())
    assert c10(here / "out") == (pytest.approx(mean, abs=0.05 * sd), pytest.approx(sd, rel=0.03))


@pytest.mark.slow
def test_runs_that_failed_are_made_again_by_the_same_command(done, here, words):
    forces(here)
    (here / "sometimes").touch()  # one run of the solver gets no licence
    for options, failed, starts in (([], 1, 8), (["--force"], 0, 9)):
        done(*words, *WIDE, *options)
        assert sum(bool(run["error"]) for run in rows_of(here / "out" / "forward_runs.csv")) == failed
        assert len(started(here)) == starts


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs Linux")
def test_what_is_killed_in_the_middle_loses_nothing_that_was_done(done, here, words):
    forces(here)
    (here / "slow").write_text("0.3")
    results = here / "out-forward-runs" / "batch-0" / "tasks.jsonl"
    kept = killed_after(3, results, here, *words, *WIDE)
    (here / "slow").unlink()
    before = len(started(here))
    done(*words, *WIDE)
    assert results.read_text(encoding="utf-8").splitlines()[:3] == kept
    assert 3 <= before <= 4 + 1
    assert len(started(here)) - before <= 8 - 3
    assert not list((here / "out-forward-runs" / "solver").glob(".running-*"))
    done(*words[:-2], *WIDE, "--runs-in", "out-forward-runs", "--out", "whole")
    assert (here / "whole" / "summary.csv").read_bytes() == (here / "out" / "summary.csv").read_bytes()
    assert len(started(here)) - before <= 8 - 3


@pytest.mark.slow
def test_the_posterior_of_simple_tests_is_the_prior(tmp_path):
    """Normal prior and likelihood: precisions add up. The log-normal prior, 1 % wide, is nearly normal."""
    write_specimen(tmp_path / "specimen.csv")
    options = ["--noise-sd", 1, "--discrepancy", "none", "--tolerance", "none", "--no-figures", "--out", "fitted"]
    done_in(tmp_path, "fit", "specimen.csv", *options)
    before = tq.load(tmp_path / "fitted").marginals["C10"]  # MPa
    centre = 1e3 * before.mean
    measured = centre * 1.01 * TIMES
    (tmp_path / "punch.csv").write_text(
        "time,force (mN)\n" + "".join(f"{at},{force:.6f}\n" for at, force in zip(TIMES, measured, strict=True))
    )
    noise_sd = 1e3 * before.sd * np.sqrt(TIMES @ TIMES)  # as informative as the prior
    done_in(
        tmp_path, "calibrate", "punch.csv", "--model", "model.inp", "--replace", "TISSUE", "--material", "neo-hookean",
        "--range", "0.7:1.3", "--qoi", "force=RF2@TOP", "--command", write_model(tmp_path), "--solver", "ccx",
        "--unit", "kPa", "--prior-run", "fitted", "--noise-sd", noise_sd, "--discrepancy", "none", "--runs", 8,
        "--max-jobs", 1, "--no-figures", "--out", "out",
    )  # fmt: skip
    mean, sd = c10(tmp_path / "out")
    assert sd == pytest.approx(1e3 * before.sd / np.sqrt(2), rel=0.05)
    assert mean == pytest.approx(1.005 * centre, abs=0.1 * sd)
    assert "the posterior of the run fitted" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_run_is_repeated_from_its_own_folder_when_its_command_is_named(cli, done, here, words):
    forces(here)
    done(*words, *WIDE)
    repeat = ["calibrate", "--config", "out/run.toml", "--max-jobs", 1, "--no-figures", "--out", "again"]
    said = cli(*repeat)
    assert said.status == 2
    assert "--command" in said.err
    assert len(started(here)) == 8
    done(*repeat, "--command", words[words.index("--command") + 1])
    assert (here / "again" / "summary.csv").read_bytes() == (here / "out" / "summary.csv").read_bytes()


@pytest.mark.parametrize(
    ("changes", "more", "told", "runs"),
    [
        ({"model.inp": "none.inp"}, [], ["none.inp", "cannot be read"], 0),
        ({"TISSUE": "Muscle"}, [], ["no material 'Muscle'", "Tissue, Fat"], 0),
        ({"force=RF2@TOP": "force=RF9@TOP"}, [], ["not a quantity"], 0),
        ({"force=RF2@TOP": "force=RF2@BASE"}, [], ["RF2@BASE:sum is not in the results"], 1),
        ({"force=RF2@TOP": "force=own.py:top", "kPa": "MPa"}, [], ["in mN, and the model is in N", "force=1000 if"], 0),
        ({"force=RF2@TOP": "force=own.py:top", "kPa": "MPa"}, ["--factor", "force=1"], ["there is no file"], 0),
        ({"neo-hookean": "yeoh"}, [], ["calibrated without C20"], 0),
        ({}, ["--factor", "depth=-1"], ["factors are of force"], 0),
        ({}, ["--qoi", "more=RF1@TOP"], ["--noise-sd force=SD,more=SD"], 0),
        ({NOISE_SD: "unknown"}, ["--qoi", "more=RF1@TOP"], ["no column 'more'", "time, force (mN)"], 0),
        ({NOISE_SD: "unknown"}, ["--qoi", "time=RF1@TOP"], ["has the columns", "name that of the control"], 0),
        ({NOISE_SD: "more=1"}, ["--qoi", "more=RF1@TOP", "--measured", "force"], ["leave out measured"], 0),
        ({NOISE_SD: "force=1"}, [], ["is of one quantity, and has no name"], 0),
        ({NOISE_SD: "else=1"}, ["--qoi", "more=RF1@TOP"], ["is of force, more; it is given for else"], 0),
        ({}, ["--forward", "f.py:f"], ["give one forward model"], 0),
        ({}, ["--along", "depth=U2@TOP"], ["in which unit the length is"], 0),
        ({}, ["--prior-correlation", "C10,x=0.5"], ["two parameters of the model"], 0),
        ({}, ["--prior-run", "nowhere"], ["no run folder 'nowhere'"], 0),
    ],
)
def test_what_cannot_be_used_gets_one_message(cli, here, words, changes, more, told, runs):
    forces(here)
    said = cli(*(changes.get(word, word) for word in words), *WIDE, *more)
    assert said.status == 2, said.out
    assert "Traceback" not in said.err
    assert all(word in " ".join(said.err.split()) for word in told), said.err
    assert len(started(here)) == runs
    assert not (here / "out").exists()


def test_a_force_without_a_unit_is_refused(cli, here, words):
    forces(here)
    (here / "punch.csv").write_text((here / "punch.csv").read_text().replace("force (mN)", "force"))
    said = cli(*words, *WIDE)
    assert (said.status, "as in force [mN]" in said.err) == (2, True)
    assert not started(here)
