"""`tissuq design`, as a user runs it."""

from __future__ import annotations

import os

import pytest

from .conftest import rows_of


@pytest.fixture
def run(done, here, specimen):
    done("fit", specimen, "--discrepancy", "none", "--noise-sd", 1, "--no-figures", "--out", "run")
    return here / "run"


TESTS = ("--candidate", "planar 1.05:1.2 6", "--candidate", "uniaxial 0.9:1.1 6")


@pytest.mark.slow
def test_tests_are_ranked_and_the_ranking_can_be_repeated(done, run, here):
    said = done("design", "run", *TESTS, "--target", "modulus", "--target", "planar:1.3")
    assert "Initial shear modulus: sd" in said.out
    assert "planar 1.05 to 1.2, 6 points" in said.out
    folder = here / "runs" / "run-design"
    assert (folder / "figures" / "design.png").exists()
    rows = rows_of(folder / "design.csv")
    assert [row["target"] for row in rows] == ["modulus"] * 4 + ["planar:1.3"] * 4
    done("design", "--config", folder / "run.toml", "--out", "again")
    assert rows_of(here / "again" / "design.csv") == rows


def test_a_config_of_ones_own_may_list_stretches(done, run, here):
    (here / "tests.toml").write_text(
        'run = "run"\ntargets = ["C10"]\n[[candidates]]\nmode = "planar"\nstretch = [1.1, 1.3]\nname = "mine"\n'
    )
    done("design", "--config", "tests.toml", "--no-figures", "--out", "ranked")
    assert "mine" in {row["candidate"] for row in rows_of(here / "ranked" / "design.csv")}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "give the RUN folder"),
        (["walk"], "no run folder"),
        (["run", "--candidate", "planar 1.2"], "MODE LOW:HIGH POINTS"),
        (["run", "--candidate", "planer 1:1.2 5"], "planer"),
        (["run", "--target", "C30"], "no target 'C30'"),
        (["run", "--points", "0"], "one measurement or more"),
        (["run", "--next-specimen", "twin"], "specimen"),
        (["run", "--discrepancy", "auto"], "no discrepancy 'auto'"),
        (["run", "--out", "run", "--force"], "is the run itself or contains it"),
        (["run", "--out", "run/inside"], "lies inside the run"),
        (["run", "--target", "ensemble:nowhere:force"], "no complete ensemble in 'nowhere'"),
        (["run", "--candidate", "planar 1:1.2 9", "--points", "10"], "a candidate states its own points"),
    ],
)
def test_what_cannot_be_used_is_told_and_leaves_nothing(refused, run, here, arguments, words):
    said = refused([words], "design", *arguments)
    assert str(here) not in said.err  # paths are as typed


def test_a_ranking_is_never_overwritten_unasked(cli, run, here):
    for options, status in (([], 0), ([], 2), (["--force"], 0)):
        assert cli("design", "run", *TESTS, "--no-figures", *options).status == status


def test_a_run_that_is_typed_is_one_of_the_current_folder_also_beside_a_config(cli, done, run, here):
    (here / "mine").mkdir()
    (here / "mine" / "tests.toml").write_text('candidates = ["planar 1:1.5 20"]\n')
    done("design", os.path.relpath(run), "--config", "mine/tests.toml", "--no-figures")
    assert "give the RUN folder" in cli("design", "--target", "modulus").err


def test_a_run_is_the_one_that_was_typed_where_the_folder_of_the_recipe_is_a_symbolic_link(done, run, here):
    (here / "deep" / "mine").mkdir(parents=True)
    (here / "mine").symlink_to("deep/mine")
    (here / "mine" / "tests.toml").write_text('candidates = ["planar 1:1.5 20"]\n')
    options = ["--no-figures", "--out", "mine/ranked"]
    done("design", os.path.relpath(run), "--config", "mine/tests.toml", *options)
    done("design", "--config", "mine/ranked/run.toml", "--no-figures", "--out", "again")
    assert rows_of(here / "again" / "design.csv") == rows_of(here / "mine" / "ranked" / "design.csv")


def test_what_to_do_next_repeats_the_modes_and_what_the_interval_is_of(cli, done, here, specimen):
    done("fit", specimen, "--estimand", "as-tested", "--noise-sd", 1, "--no-figures", "--out", "run")
    said = cli("design", "run", *TESTS[:2], "--no-figures")
    words = "tissuq fit DATA.csv NEW.csv --mode uniaxial --mode planar --noise-sd 1 --estimand as-tested"
    assert words in " ".join(said.out.split()), said.err


def test_a_stress_that_is_known_is_no_target(refused, run):
    refused(["target 'planar:1': its value is known already"], "design", "run", *TESTS, "--target", "planar:1")


@pytest.mark.slow
def test_a_run_of_several_tests_is_ranked(done, here):
    for mode, factor in (("uniaxial", 1.0), ("planar", 1.2)):
        rows = "".join(f"{1 + 0.02 * k:.2f},{factor * 0.3 * k:.3f}\n" for k in range(1, 9))
        (here / f"{mode}.csv").write_text(f"stretch,stress [kPa]\n{rows}")
    words = ["--mode", "uniaxial", "--mode", "planar", "--no-figures", "--out", "both"]
    done("fit", "uniaxial.csv", "planar.csv", *words)
    said = done("design", "both", "--candidate", "equibiaxial 1.02:1.1 8", "--no-figures")
    assert "tissuq fit DATA.csv NEW.csv --estimand tissue" in " ".join(said.out.split())
    assert "of the tissue" in said.out
    assert "inaccurate" not in said.out
