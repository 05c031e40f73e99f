"""``tissuq ensemble`` after a failure, a kill or a change: what is done stays, and nothing is done twice."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from .conftest import rows_of
from .models import killed_after, started


def test_what_is_done_is_not_done_again_and_another_quantity_needs_no_run(refused, done, here, model):
    done("ensemble", *model, "--no-figures")
    assert len(started(here)) == 6
    done("ensemble", *model, "--no-figures")
    (here / "mine.py").write_text("def size(folder):\n    return (folder / 'model.dat').stat().st_size\n")
    done("ensemble", *model, "--no-figures", "--qoi", "size=mine.py:size")
    assert len(started(here)) == 6
    assert float(rows_of(here / "out" / "draws.csv")[0]["size"]) > 100
    repeat = ["ensemble", "--config", "out/run.toml", "--no-figures", "--out", "again", "--max-jobs", 1]
    refused(["--qoi size=quantities/mine.py:size", "--command"], *repeat)
    assert len(started(here)) == 6
    command = model[model.index("--command") + 1]
    done(*repeat, "--qoi", "size=quantities/mine.py:size", "--command", command)
    assert len(started(here)) == 12
    first, again = ((here / name / "quantities.csv").read_text(encoding="utf-8") for name in ("out", "again"))
    assert first == again


def test_a_draw_that_fails_is_listed_with_the_last_lines_and_made_again_on_request(done, here, model):
    (here / "fails").write_text("3")
    said = done("ensemble", *model, "--no-figures")
    told = "1 of 6 draws failed (draw 3 at time 0.5; first reason: increment size smaller than minimum)"
    assert told in " ".join(said.out.split())
    (row,) = rows_of(here / "out" / "failures.csv")
    assert (row["number"], row["reached"], row["problem"]) == ("3", "0.5", "increment size smaller than minimum")
    assert row["lines"] == "best residual |  *ERROR: increment size smaller than minimum"
    halves = rows_of(here / "out" / "quantities.csv")
    assert [row["draws"] for row in halves] == ["6", "5"]
    (here / "fails").unlink()
    done("ensemble", *model, "--no-figures", "--again")
    assert started(here)[6:] == [started(here)[-1]]
    assert not (here / "out" / "failures.csv").exists()


def test_a_run_that_fails_once_is_made_again_where_that_is_allowed(done, here, model):
    (here / "sometimes").touch()
    said = done("ensemble", *model, "--no-figures", "--retries", 1)
    assert "failed" not in said.out
    assert len(started(here)) == 7


def test_the_files_of_the_solver_go_where_they_are_not_kept(done, here, model):
    done("ensemble", *model, "--no-figures", "--no-keep")
    assert {path.name for path in (here / "out" / "draws").rglob("*") if path.is_file()} == {"run.json", "solver.log"}
    done("ensemble", *model, "--no-figures", "--no-keep")
    assert len(started(here)) == 6


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs Linux")
def test_what_is_killed_in_the_middle_loses_nothing_that_was_done(done, here, model):
    (here / "slow").write_text("0.5")
    results = here / "out" / "tasks.jsonl"
    kept = killed_after(3, results, here, "ensemble", *model, "--no-figures")
    (here / "slow").unlink()
    done("ensemble", *model, "--no-figures")
    assert results.read_text(encoding="utf-8").splitlines()[:3] == kept
    runs = [name.rpartition("complete-")[2][0] for name in started(here)]
    assert [runs.count(number) for number in "123"] == [1, 1, 1]
    assert set(runs) == set("123456")
    assert not list((here / "out" / "draws").glob(".running-*"))
    assert len(rows_of(here / "out" / "draws.csv")) == 6


@pytest.mark.parametrize("name", ["../../precious", "..", ".", "/", None])
@pytest.mark.parametrize("is_other", [False, True], ids=["same", "other-quantities"])
def test_making_failures_again_deletes_no_other_folder(done, here, model, name, is_other):
    (here / "fails").write_text("3")
    done("ensemble", *model, "--no-figures")
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
    done("ensemble", *model, "--no-figures", "--again", *others)
    assert (here / "precious" / "data.txt").exists()
    assert len(list((here / "out" / "draws").iterdir())) == 6
    assert len(started(here)) == (6 if is_other else 7)


def test_making_the_first_draw_again_leaves_the_other_results(done, here, model):
    (here / "fails").write_text("1")
    done("ensemble", *model, "--no-figures", "--no-keep")
    (here / "fails").unlink()
    done("ensemble", *model, "--no-figures", "--no-keep", "--again")
    assert len(started(here)) == 7


def test_a_function_that_cannot_read_is_told_with_the_option_that_reads_again(cli, done, here, model):
    (here / "mine.py").write_text(f"def size(folder):\n    return float(open({str(here / 'size.txt')!r}).read())\n")
    for _ in range(2):
        said = cli("ensemble", *model, "--no-figures", "--qoi", "size=mine.py:size")
        assert said.status == 2
        assert "FileNotFoundError" in said.err
        assert "--again" in said.err
    (here / "size.txt").write_text("3")
    done("ensemble", *model, "--no-figures", "--qoi", "size=mine.py:size", "--again")


def test_a_draw_whose_results_are_cut_short_fails_alone(done, here, model):
    text = (here / "stub.py").read_text()
    cut = "    if 'complete-4' in folder.name:\n        table = Path(f'{job}.dat')\n"
    cut += "        table.write_text(table.read_text().replace(' 0.0\\n', '\\n'))\n"
    (here / "stub.py").write_text(text.replace("    rows = [", cut + "    rows = ["))
    done("ensemble", *model, "--no-figures")
    (row,) = rows_of(here / "out" / "failures.csv")
    assert row["number"] == "4"
    assert "cut short or damaged" in row["problem"]
