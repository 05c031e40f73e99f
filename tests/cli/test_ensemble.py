"""``tissuq ensemble``: the whole path with a program in the place of CalculiX, and what it refuses."""

from __future__ import annotations

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from .conftest import run_in, write_specimen

STUB = Path(__file__).parents[1] / "stub_solver.py"
DECK = """*HEADING
*NODE, NSET=TOP
1, 0., 0., 0.
*MATERIAL, NAME=Tissue
*ELASTIC
1., 0.3
*MATERIAL, NAME=Fat
*ELASTIC
2., 0.3
*STEP
*STATIC
*END STEP
"""
PATIENCE_S = 120.0


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """The run folder of a fit without discrepancy."""
    folder = tmp_path_factory.mktemp("fitted")
    write_specimen(folder / "specimen.csv")
    said = run_in(
        folder, "fit", "specimen.csv", "--noise-sd", 1, "--discrepancy", "none", "--no-figures", "--out", "run"
    )
    assert said.status == 0, said.err
    return folder / "run"


@pytest.fixture
def model(fitted, here):
    """A run, a deck and the stub in the current folder; what every command here ends with."""
    shutil.copytree(fitted, here / "run")
    shutil.copyfile(STUB, here / "stub.py")
    (here / "model.inp").write_text(DECK, encoding="utf-8")
    command = f'"{Path(sys.executable).as_posix()}" "{(here / "stub.py").as_posix()}" {{job}}'
    return [
        "run", "model.inp", "--replace", "TISSUE", "--qoi", "force=RF2@TOP", "--solver", "ccx", "--command", command,
        "--draws", 6, "--max-jobs", 1, "--out", "out",
    ]  # fmt: skip


def rows_of(path):
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def started(here):
    return (here / "started").read_text(encoding="utf-8").split() if (here / "started").exists() else []


def test_the_forces_are_those_of_the_draws_that_export_writes(cli, here, model):
    said = cli("ensemble", *model, "--unit", "kPa")
    assert said.status == 0, said.err
    assert "Model 'model.inp' with 6 draws" in said.out
    assert str(Path("out") / "report.html") in said.out
    assert cli("export", "run", "--format", "calculix", "--draws", 6, "--unit", "kPa", "--out", "cards").status == 0
    constants = [float(row["card_C10"]) for row in rows_of(here / "cards" / "index.csv")]
    assert len(set(constants)) == 6
    draws = rows_of(here / "out" / "draws.csv")
    assert [float(row["force"]) for row in draws] == pytest.approx(constants, rel=1e-8)
    assert [1e3 * float(row["C10"]) for row in draws] == pytest.approx(constants, rel=1e-8)
    summary = json.loads((here / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["quantities"]["force"]["mean"] == pytest.approx(np.mean(constants), rel=1e-8)
    assert summary["quantities"]["force"]["sd"] == pytest.approx(np.std(constants, ddof=1), rel=1e-6)
    halves = rows_of(here / "out" / "quantities.csv")
    assert [float(row["time"]) for row in halves] == [0.5, 1.0]
    assert float(halves[0]["mean"]) == pytest.approx(np.mean(constants) / 2, rel=1e-8)
    page = (here / "out" / "report.html").read_text(encoding="utf-8")
    assert "too few for a 95 % band" in page
    assert page.count("data:image/svg+xml") == 2
    assert "HYPERELASTIC, NEO HOOKE" in page


def test_the_decks_differ_from_the_model_in_the_material_alone(cli, here, model):
    assert cli("ensemble", *model, "--no-figures").status == 0
    start, end = DECK.index("*ELASTIC"), DECK.index("*MATERIAL, NAME=Fat")
    for number in range(1, 7):
        text = (here / "out" / "draws" / f"complete-{number}" / "model.inp").read_text(encoding="utf-8")
        assert text.startswith(DECK[:start])
        assert text.endswith(DECK[end:])
        assert text.count("*HYPERELASTIC") == 1


OTHERS = {
    "febio": (
        "model.feb",
        '<febio_spec version="4.0"><Material><material id="1" name="Fat" type="neo-Hookean"><E>1</E></material>'
        '<material id="2" name="Tissue" type="neo-Hookean"><E>1</E></material></Material></febio_spec>',
        "Tissue",
        r"id=.2. name=.Tissue. type=.Mooney-Rivlin.>\s*<c1>(.*?)</c1>",
        "card_c1",
    ),
    "ls-dyna": (
        "model.k",
        "*KEYWORD\n*MAT_ELASTIC\n         7   1.1e-9        1.       0.3\n*END\n",
        "7",
        r"\n +7 +1\.1e-9.*\n.*\n +(\S+)",
        "card_C10",
    ),
    "ansys": ("model.cdb", "/PREP7\nMP,EX,3,1.0\n/SOLU\n", "3", r"TB,HYPER,3,1,,NEO\nTBDATA,1,([^,]+)", "card_mu"),
}
"""Of each format a deck, its material, where a draw's first constant stands then, and its name in the index."""


@pytest.mark.parametrize("code", OTHERS)
def test_other_solvers_get_their_decks_and_a_function_reads_what_they_leave(cli, here, model, code):
    name, deck, wanted, pattern, column = OTHERS[code]
    (here / name).write_text(deck, encoding="utf-8")
    body = (
        f"import re\ndef first(folder):\n    return float(re.search({pattern!r}, (folder / {name!r}).read_text())[1])\n"
    )
    (here / "mine.py").write_text(body, encoding="utf-8")
    says = "N O R M A L   T E R M I N A T I O N"
    command = f'"{Path(sys.executable).as_posix()}" -c "print(\'{says}\')"'
    solver = ["--solver", "febio4"] if code == "febio" else []
    options = ["--qoi", "first=mine.py:first", *solver, "--command", command, "--draws", 3, "--max-jobs", 1]
    said = cli("ensemble", "run", name, "--replace", wanted, *options, "--no-figures", "--out", "out")
    assert said.status == 0, said.err
    assert cli("export", "run", "--format", code, "--draws", 3, "--out", "cards").status == 0
    constants = [float(row[column]) for row in rows_of(here / "cards" / "index.csv")]
    assert [float(row["first"]) for row in rows_of(here / "out" / "draws.csv")] == pytest.approx(constants, rel=1e-9)


def test_every_material_may_name_its_run(cli, here, model):
    words = ["model.inp", "--replace", "TISSUE=run", *model[4:]]
    assert cli("ensemble", *words, "--no-figures").status == 0
    assert len(rows_of(here / "out" / "draws.csv")) == 6


def test_a_dry_run_shows_the_diff_and_leaves_nothing(cli, here, model):
    said = cli("ensemble", *model, "--dry-run")
    assert said.status == 0, said.err
    lines = said.out.splitlines()
    gone = [line for line in lines if line.startswith("-") and not line.startswith(("---", "- "))]
    assert gone == ["-*ELASTIC", "-1., 0.3"]
    assert "+*HYPERELASTIC, NEO HOOKE" in lines
    assert not (here / "out").exists()
    assert not started(here)


def test_what_is_done_is_not_done_again_and_another_quantity_needs_no_run(cli, here, model):
    assert cli("ensemble", *model, "--no-figures").status == 0
    assert len(started(here)) == 6
    assert cli("ensemble", *model, "--no-figures").status == 0
    (here / "mine.py").write_text("def size(folder):\n    return (folder / 'model.dat').stat().st_size\n")
    said = cli("ensemble", *model, "--no-figures", "--qoi", "size=mine.py:size")
    assert said.status == 0, said.err
    assert len(started(here)) == 6
    assert float(rows_of(here / "out" / "draws.csv")[0]["size"]) > 100
    repeat = ["ensemble", "--config", "out/run.toml", "--no-figures", "--out", "again", "--max-jobs", 1]
    said = cli(*repeat)
    assert said.status == 2
    assert "--qoi size=quantities/mine.py:size" in said.err
    assert "--command" in said.err
    assert len(started(here)) == 6
    command = model[model.index("--command") + 1]
    said = cli(*repeat, "--qoi", "size=quantities/mine.py:size", "--command", command)
    assert said.status == 0, said.err
    assert len(started(here)) == 12
    first, again = ((here / name / "quantities.csv").read_text(encoding="utf-8") for name in ("out", "again"))
    assert first == again


def test_a_draw_that_fails_is_listed_with_the_last_lines_and_made_again_on_request(cli, here, model):
    (here / "fails").write_text("3")
    said = cli("ensemble", *model, "--no-figures")
    assert said.status == 0, said.err
    assert "1 of 6 draws failed (3; first reason: increment size smaller than minimum)" in " ".join(said.out.split())
    (row,) = rows_of(here / "out" / "failures.csv")
    assert (row["number"], row["reached"], row["problem"]) == ("3", "0.5", "increment size smaller than minimum")
    assert row["lines"] == "best residual |  *ERROR: increment size smaller than minimum"
    halves = rows_of(here / "out" / "quantities.csv")
    assert [row["draws"] for row in halves] == ["6", "5"]
    (here / "fails").unlink()
    assert cli("ensemble", *model, "--no-figures", "--again").status == 0
    assert started(here)[6:] == [started(here)[-1]]
    assert not (here / "out" / "failures.csv").exists()


def test_a_run_that_fails_once_is_made_again_where_that_is_allowed(cli, here, model):
    (here / "sometimes").touch()
    said = cli("ensemble", *model, "--no-figures", "--retries", 1)
    assert said.status == 0, said.err
    assert "failed" not in said.out
    assert len(started(here)) == 7


def test_the_files_of_the_solver_go_where_they_are_not_kept(cli, here, model):
    assert cli("ensemble", *model, "--no-figures", "--no-keep").status == 0
    assert {path.name for path in (here / "out" / "draws").rglob("*") if path.is_file()} == {"run.json", "solver.log"}
    assert cli("ensemble", *model, "--no-figures", "--no-keep").status == 0
    assert len(started(here)) == 6


def test_another_run_or_model_or_setting_is_not_mixed_in(cli, here, model):
    assert cli("ensemble", *model, "--no-figures").status == 0
    said = cli("ensemble", *model, "--no-figures", "--seed", 5)
    assert (said.status, "other settings" in said.err) == (2, True)
    (here / "model.inp").write_text(DECK.replace("0.3", "0.31"), encoding="utf-8")
    said = cli("ensemble", *model, "--no-figures")
    assert (said.status, "another model" in said.err) == (2, True)
    assert len(started(here)) == 6


def test_a_quantity_that_is_not_in_the_results_costs_one_run(cli, here, model):
    said = cli("ensemble", *model, "--qoi", "base=RF2@BASE")
    assert said.status == 2
    assert "RF2@BASE:sum is not in the results" in said.err
    assert "*NODE PRINT, NSET=BASE" in said.err
    assert len(started(here)) == 1


def test_draws_that_all_fail_are_one_message_with_the_last_lines(cli, here, model):
    (here / "stub.py").write_text("raise SystemExit('  licence server is down')\n")
    said = cli("ensemble", *model)
    assert said.status == 2
    assert "fewer than 2 give 'force'" in said.err
    assert "licence server is down" in said.err
    assert "Traceback" not in said.err


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs Linux")
def test_what_is_killed_in_the_middle_loses_nothing_that_was_done(cli, here, model):
    (here / "slow").write_text("0.5")
    arguments = ["ensemble", *map(str, model), "--no-figures"]
    process = subprocess.Popen(
        [sys.executable, "-c", "from tissuq.cli import main; main()", *arguments],
        cwd=here, env=dict(os.environ), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    deadline = time.monotonic() + PATIENCE_S
    results = here / "out" / "tasks.jsonl"
    while not results.exists() or results.read_text(encoding="utf-8").count("\n") < 3:
        assert time.monotonic() < deadline
        assert process.poll() is None
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    process.wait()
    done = results.read_text(encoding="utf-8").splitlines()[:3]
    (here / "slow").unlink()
    said = cli("ensemble", *model, "--no-figures")
    assert said.status == 0, said.err
    assert results.read_text(encoding="utf-8").splitlines()[:3] == done
    runs = [name.rpartition("complete-")[2][0] for name in started(here)]
    assert [runs.count(number) for number in "123"] == [1, 1, 1]
    assert set(runs) == set("123456")
    assert not list((here / "out" / "draws").glob(".running-*"))
    assert len(rows_of(here / "out" / "draws.csv")) == 6


def test_two_materials_get_draws_of_their_runs_that_are_independent(cli, here, model):
    assert (
        cli("fit", write_specimen(here / "other.csv"), "--noise-sd", 2, "--discrepancy", "none", "--no-figures").status
        == 0
    )
    said = cli("ensemble", *model, "--replace", "fat=runs/other", "--no-figures")
    assert said.status == 0, said.err
    rows = rows_of(here / "out" / "draws.csv")
    pairs = np.array([[float(row["TISSUE.C10"]), float(row["fat.C10"])] for row in rows])
    assert abs(np.corrcoef(pairs.T)[0, 1]) < 0.95  # one sequence for both would order them alike
    text = (here / "out" / "draws" / "complete-1" / "model.inp").read_text(encoding="utf-8")
    assert text.count("*HYPERELASTIC") == 2


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"run": "nowhere"}, ["no run folder 'nowhere'"]),
        ({"model.inp": "none.inp"}, ["none.inp", "cannot be read"]),
        ({"TISSUE": "Muscle"}, ["no material 'Muscle'", "Tissue, Fat"]),
        ({"TISSUE": "=run"}, ["is not a material"]),
        ({"force=RF2@TOP": "RF2@TOP"}, ["is not a quantity of interest (--qoi)"]),
        ({"force=RF2@TOP": "force=RF9@TOP"}, ["not a quantity", "NAME=RF3@SET"]),
        ({"ccx": "febio4"}, ["reads decks of the format febio"]),
        ({"ccx": "cxx"}, ["no solver named 'cxx'", "ccx"]),
        ({6: 1}, ["draws", "greater than or equal to 2"]),
    ],
)
def test_what_cannot_be_used_gets_one_message_and_leaves_nothing(cli, here, model, changes, words):
    said = cli("ensemble", *(changes.get(word, word) for word in model))
    assert said.status == 2, said.out
    assert "Traceback" not in said.err
    assert all(word in said.err for word in words), said.err
    assert not (here / "out").exists()


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--bulk-modulus", "1e-9"], ["Poisson's ratio that is not positive"]),
        (["--replace", "Tissue"], ["one material of the model twice"]),
        (["--replace", "TISSUE"], ["given twice for 'TISSUE'"]),
        (["--also", "umat.f"], ["umat.f"]),
        (["--qoi", "C10=RF1@TOP"], ["cannot be called 'C10'"]),
        (["--command", "no-such-program {job}"], ["no program 'no-such-program'"]),
        (["--command", "sh {job.x}"], ["is not understood", "{job}"]),
        (["--command", "sh {job[x]}"], ["is not understood", "{job}"]),
        (["--command", "sh {job:d}"], ["is not understood", "{job}"]),
        (["--format", "table"], ["do not go into a deck"]),
    ],
)
def test_options_that_cannot_be_used_get_one_message(cli, here, model, more, words):
    said = cli("ensemble", *model, *more)
    assert said.status == 2, said.out
    assert "Traceback" not in said.err
    assert all(word in said.err for word in words), said.err
    assert not (here / "out").exists()


def test_without_a_model_or_a_question_it_says_what_to_give(cli, here, model):
    assert "RUN folder of a fit and your MODEL" in cli("ensemble", "run").err
    assert "has no run" in cli("ensemble", "model.inp", "--replace", "TISSUE", "--qoi", "force=RF2@TOP").err
    assert "give --replace NAME" in cli("ensemble", "run", "model.inp").err
    assert "give --qoi" in cli("ensemble", "run", "model.inp", "--replace", "TISSUE").err


def test_a_dry_run_of_a_recipe_runs_no_function(cli, here, model):
    (here / "mine.py").write_text("def size(folder):\n    return 1\n")
    assert cli("ensemble", *model, "--no-figures", "--qoi", "size=mine.py:size").status == 0
    copy = here / "out" / "quantities" / "mine.py"
    copy.write_text(f"open({str(here / 'ran')!r}, 'w')\n" + copy.read_text())
    said = cli("ensemble", "--config", "out/run.toml", "--dry-run")
    assert said.status == 0, said.err
    assert "+*HYPERELASTIC" in said.out
    assert not (here / "ran").exists()


@pytest.mark.parametrize("name", ["../../precious", "..", ".", "/", None])
@pytest.mark.parametrize("is_other", [False, True], ids=["same", "other-quantities"])
def test_making_failures_again_deletes_no_other_folder(cli, here, model, name, is_other):
    (here / "fails").write_text("3")
    assert cli("ensemble", *model, "--no-figures").status == 0
    (here / "precious").mkdir()
    (here / "precious" / "data.txt").write_text("1")
    place = name if name != "/" else str(here / "precious")
    lines = (json.loads(line) for line in (here / "out" / "tasks.jsonl").read_text(encoding="utf-8").splitlines())
    with (here / "out" / "tasks.new").open("w", encoding="utf-8") as file:
        for line in lines:
            if line["problem"]:
                line.pop("folder") if place is None else line.update(folder=place)
            file.write(json.dumps(line) + "\n")
    (here / "out" / "tasks.new").replace(here / "out" / "tasks.jsonl")
    (here / "fails").unlink()
    (here / "mine.py").write_text("def one(folder):\n    return 1\n")
    others = ["--qoi", "one=mine.py:one"] if is_other else []
    said = cli("ensemble", *model, "--no-figures", "--again", *others)
    assert said.status == 0, said.err
    assert (here / "precious" / "data.txt").exists()
    assert len(list((here / "out" / "draws").iterdir())) == 6
    assert len(started(here)) == (6 if is_other else 7)


def test_making_the_first_draw_again_leaves_the_other_results(cli, here, model):
    (here / "fails").write_text("1")
    assert cli("ensemble", *model, "--no-figures", "--no-keep").status == 0
    (here / "fails").unlink()
    said = cli("ensemble", *model, "--no-figures", "--no-keep", "--again")
    assert said.status == 0, said.err
    assert len(started(here)) == 7


def test_a_function_that_cannot_read_is_told_with_the_option_that_reads_again(cli, here, model):
    (here / "mine.py").write_text(f"def size(folder):\n    return float(open({str(here / 'size.txt')!r}).read())\n")
    for _ in range(2):
        said = cli("ensemble", *model, "--no-figures", "--qoi", "size=mine.py:size")
        assert said.status == 2
        assert "FileNotFoundError" in said.err
        assert "--again" in said.err
    (here / "size.txt").write_text("3")
    said = cli("ensemble", *model, "--no-figures", "--qoi", "size=mine.py:size", "--again")
    assert said.status == 0, said.err


def test_files_of_one_name_are_refused(cli, here, model):
    for name in "ab":
        (here / name).mkdir()
        (here / name / "q.py").write_text("def f(folder):\n    return 1\n")
        (here / name / "d.txt").write_text(name)
    said = cli("ensemble", *model, "--qoi", "x=a/q.py:f", "--qoi", "y=b/q.py:f")
    assert (said.status, "called 'q.py' (--qoi)" in said.err) == (2, True)
    said = cli("ensemble", *model, "--also", "a/d.txt", "--also", "b/d.txt")
    assert (said.status, "called 'd.txt'" in said.err) == (2, True)
    assert not (here / "out").exists()
    assert cli("ensemble", *model, "--no-figures", "--qoi", "x=a/q.py:f", "--qoi", "y=a/q.py:f").status == 0


@pytest.mark.parametrize("is_absolute", [True, False])
def test_a_file_outside_of_the_folder_of_the_model_is_used_only_if_named_and_not_mixed(cli, here, model, is_absolute):
    (here / "deck").mkdir()
    outside = here / "more.inp"
    outside.write_text("** nothing\n")
    name = outside.as_posix() if is_absolute else "../more.inp"
    deck = DECK.replace("*STEP", f"*INCLUDE, INPUT={name}\n*STEP")
    (here / "deck" / "model.inp").write_text(deck, encoding="utf-8")
    words = ["ensemble", *(f"deck/{word}" if word == "model.inp" else word for word in model), "--no-figures"]
    said = cli(*words)
    assert said.status == 2
    assert f"--also {outside}" in said.err
    assert not (here / "out").exists()
    assert cli(*words, "--also", outside).status == 0
    assert cli(*words, "--also", "more.inp").status == 0
    command = model[model.index("--command") + 1]
    repeat = ["ensemble", "--config", "out/run.toml", "--command", command, "--out", "again", "--no-figures"]
    said = cli(*repeat)
    assert (said.status, f"--also {outside}" in said.err) == ((2, True) if is_absolute else (0, False)), said.err
    assert cli(*repeat, *(["--also", outside] if is_absolute else [])).status == 0
    outside.write_text("** something\n")
    said = cli(*words, "--also", outside)
    assert (said.status, "another model" in said.err) == (2, True)
    assert len(started(here)) == 12


def test_a_draw_whose_results_are_cut_short_fails_alone(cli, here, model):
    text = (here / "stub.py").read_text()
    cut = "    if 'complete-4' in folder.name:\n        table = Path(f'{job}.dat')\n"
    cut += "        table.write_text(table.read_text().replace(' 0.0\\n', '\\n'))\n"
    (here / "stub.py").write_text(text.replace("    rows = [", cut + "    rows = ["))
    said = cli("ensemble", *model, "--no-figures")
    assert said.status == 0, said.err
    (row,) = rows_of(here / "out" / "failures.csv")
    assert row["number"] == "4"
    assert "cut short or damaged" in row["problem"]


def test_a_set_of_a_set_that_is_nowhere_is_refused_before_a_run(cli, here, model):
    (here / "model.inp").write_text(DECK.replace("*STEP", "*NSET, NSET=ENDS\nTOP, BASE\n*STEP"), encoding="utf-8")
    said = cli("ensemble", *model)
    assert (said.status, "'ENDS' has 'BASE'" in said.err) == (2, True)
    assert not started(here)


def test_a_material_of_ansys_that_a_parameter_numbers_is_refused(cli, here, model):
    (here / "m.cdb").write_text("/PREP7\nfat=2\nMP,EX,1,5.0\nMP,EX,fat,10\n/SOLU\n")
    said = cli("ensemble", "run", "m.cdb", "--replace", "fat", "--qoi", "x=q.py:f", "--command", "true", "--dry-run")
    assert (said.status, "number in digits" in said.err) == (2, True)
