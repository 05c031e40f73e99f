"""``tissuq ensemble``: what it refuses, with what message, and what that leaves."""

from __future__ import annotations

import pytest

from .models import DECK, started


def test_another_run_or_model_or_setting_is_not_mixed_in(cli, done, here, model):
    done("ensemble", *model, "--no-figures")
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


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"run": "nowhere"}, ["no run folder 'nowhere'"]),
        ({"model.inp": "none.inp"}, ["none.inp", "cannot be read"]),
        ({"TISSUE": "Muscle"}, ["no material 'Muscle'", "Tissue, Fat"]),
        ({"TISSUE": "=run"}, ["is not a material"]),
        ({"force=RF2@TOP": "RF2@TOP"}, ["is not a quantity of interest (--qoi)"]),
        ({"force=RF2@TOP": "force=RF9@TOP"}, ["not a quantity", "NAME=RF3@SET"]),
        ({"force=RF2@TOP": "force=RF2@TOPP"}, ["RF2@TOPP:sum", "sets are BASE, TOP.", "Did you mean 'TOP'?"]),
        ({"ccx": "febio4"}, ["reads decks of the format febio"]),
        ({"ccx": "cxx"}, ["no solver named 'cxx'", "ccx"]),
        ({6: 1}, ["draws", "greater than or equal to 2"]),
    ],
)
def test_what_cannot_be_used_gets_one_message_and_leaves_nothing(refused, model, changes, words):
    refused(words, "ensemble", *(changes.get(word, word) for word in model))


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
def test_options_that_cannot_be_used_get_one_message(refused, model, more, words):
    refused(words, "ensemble", *model, *more)


def test_without_a_model_or_a_question_it_says_what_to_give(cli, here, model):
    assert "RUN folder of a fit and your MODEL" in cli("ensemble", "run").err
    for given in (["run"], ["run", "model.inp"]):
        said = cli("ensemble", *given, "--config", "run.toml").err
        assert f"leave out --config, or {' '.join(given)}." in " ".join(said.split())
    assert "has no run" in cli("ensemble", "model.inp", "--replace", "TISSUE", "--qoi", "force=RF2@TOP").err
    assert "give --replace NAME" in cli("ensemble", "run", "model.inp").err
    assert "give --qoi" in cli("ensemble", "run", "model.inp", "--replace", "TISSUE").err


def test_files_of_one_name_are_refused(cli, done, here, model):
    for name in "ab":
        (here / name).mkdir()
        (here / name / "q.py").write_text("def f(folder):\n    return 1\n")
        (here / name / "d.txt").write_text(name)
    said = cli("ensemble", *model, "--qoi", "x=a/q.py:f", "--qoi", "y=b/q.py:f")
    assert (said.status, "called 'q.py' (--qoi)" in said.err) == (2, True)
    said = cli("ensemble", *model, "--also", "a/d.txt", "--also", "b/d.txt")
    assert (said.status, "called 'd.txt'" in said.err) == (2, True)
    assert not (here / "out").exists()
    done("ensemble", *model, "--no-figures", "--qoi", "x=a/q.py:f", "--qoi", "y=a/q.py:f")


@pytest.mark.slow
@pytest.mark.parametrize("is_absolute", [True, False])
def test_a_file_outside_of_the_folder_of_the_model_is_used_only_if_named_and_not_mixed(
    cli, done, here, model, is_absolute
):
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
    done(*words, "--also", outside)
    done(*words, "--also", "more.inp")
    command = model[model.index("--command") + 1]
    repeat = ["ensemble", "--config", "out/run.toml", "--command", command, "--out", "again", "--no-figures"]
    said = cli(*repeat)
    assert (said.status, f"--also {outside}" in said.err) == ((2, True) if is_absolute else (0, False)), said.err
    done(*repeat, *(["--also", outside] if is_absolute else []))
    outside.write_text("** something\n")
    said = cli(*words, "--also", outside)
    assert (said.status, "another model" in said.err) == (2, True)
    assert len(started(here)) == 12


def test_a_set_of_a_set_that_is_nowhere_is_refused_before_a_run(cli, here, model):
    (here / "model.inp").write_text(DECK.replace("*STEP", "*NSET, NSET=ENDS\nTOP, SIDE\n*STEP"), encoding="utf-8")
    said = cli("ensemble", *model)
    assert (said.status, "'ENDS' has 'SIDE'" in said.err) == (2, True)
    assert not started(here)


def test_a_material_of_ansys_that_a_parameter_numbers_is_refused(cli, here, model):
    (here / "m.cdb").write_text("/PREP7\nfat=2\nMP,EX,1,5.0\nMP,EX,fat,10\n/SOLU\n")
    said = cli("ensemble", "run", "m.cdb", "--replace", "fat", "--qoi", "x=q.py:f", "--command", "true", "--dry-run")
    assert (said.status, "number in digits" in said.err) == (2, True)
