"""`tissuq compare`, as a user runs it."""

from __future__ import annotations

import csv

import pytest


@pytest.fixture
def two_runs(cli, here, specimen):
    for name, discrepancies in (("first", ("none", "constant")), ("second", ("auto",))):
        options = [part for each in discrepancies for part in ("--discrepancy", each)]
        assert cli("fit", specimen, *options, "--noise-sd", 1, "--no-figures", "--out", name).status == 0
    return here


def test_runs_are_compared(cli, two_runs):
    said = cli("compare", "first", "second", "--out", "table.csv")
    assert said.status == 0, said.err
    for name in ("first/none", "first/constant", "second/auto"):
        assert name in said.out
    assert "nothing of parameters" in said.out
    with (two_runs / "table.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {row["fit"] for row in rows} == {"first/none", "first/constant", "second/auto"}
    again = cli("compare", "first", "--out", "table.csv")
    assert again.status == 2
    assert "table.csv" in again.err


@pytest.mark.parametrize(("arguments", "words"), [(["."], "no posterior"), (["missing"], "no posterior")])
def test_what_is_no_run_is_refused(cli, here, arguments, words):
    said = cli("compare", *arguments)
    assert said.status == 2
    assert words in said.err
    assert "Traceback" not in said.err


def test_a_file_that_is_no_posterior_is_refused(cli, here):
    (here / "broken.nc").write_text("nothing")
    said = cli("compare", "broken.nc", "broken.nc")
    assert said.status == 2
    assert "cannot be read" in said.err


def test_runs_of_one_name_are_kept_apart(cli, two_runs):
    (two_runs / "other").mkdir()
    (two_runs / "first").rename(two_runs / "other" / "run")
    (two_runs / "second").rename(two_runs / "run")
    assert cli("compare", "other/run", "run", "--out", "table.csv").status == 0
    assert len((two_runs / "table.csv").read_text().splitlines()) == 4
    assert cli("compare", "other/run/posterior/none.nc", "other/run", "--out", "again.csv").status == 0
    assert len((two_runs / "again.csv").read_text().splitlines()) == 4
