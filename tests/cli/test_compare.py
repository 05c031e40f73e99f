"""`tissuq compare`, as a user runs it."""

from __future__ import annotations

import json
import shutil

import pytest

import tissuq as tq
from marks import slow_but

from .conftest import fitted_in, rows_of


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """Two run folders, of two discrepancies and of one."""
    folder = tmp_path_factory.mktemp("fitted")
    for name, discrepancies in (("first", ("none", "constant")), ("second", ("auto",))):
        options = [part for each in discrepancies for part in ("--discrepancy", each)]
        fitted_in(folder, *options, "--no-figures", "--out", name)
    return folder


@pytest.fixture
def two_runs(fitted, here):
    """Copies of both in the current folder."""
    for name in ("first", "second"):
        shutil.copytree(fitted / name, here / name)
    return here


def fits_in(folder):
    return {row["fit"]: row for row in rows_of(folder / "comparison.csv")}


@pytest.mark.slow
def test_runs_are_compared(cli, done, two_runs):
    said = done("compare", "first", "second", "--out", "compared")
    for name in ("first/none", "first/constant", "second/auto"):
        assert name in said.out
    assert "C10, kPa (95 %)" in said.out
    for explained in (cli("show", "compared", "--details"), cli("compare", "first", "second")):
        assert "weights for averaging predictions" in " ".join(explained.out.split())
    rows = fits_in(two_runs / "compared")
    assert set(rows) == {"first/none", "first/constant", "second/auto"}
    (own,) = json.loads((two_runs / "second" / "assessment.json").read_text())
    assert float(rows["second/auto"]["evidence_change_quarter"]) == own["evidence_changes"]["quarter"]
    assert all(row["log_bayes_factor_low"] for row in rows.values())
    found = {path.relative_to(two_runs / "compared").as_posix() for path in (two_runs / "compared").rglob("*.*")}
    assert found == {
        "comparison.csv",
        "report.html",
        "result.json",
        "contents.txt",
        "figures/answer.svg",
        "figures/answer.png",
        "figures/comparison.svg",
        "figures/comparison.png",
    }


@pytest.mark.slow
def test_a_comparison_is_never_overwritten_unasked(cli, two_runs, empty_figures):
    for options, status in (([], 0), ([], 2), (["--force"], 0)):
        said = cli("compare", "first", "--out", "compared", *options)
        assert said.status == status
        assert ("compared" in said.err) == (status == 2)
    said = cli("compare", "first", "second", "--out", "second", "--force")
    assert said.status == 2
    assert "second" in said.err
    assert (two_runs / "second" / "posterior" / "auto.nc").exists()


@pytest.mark.parametrize(("arguments", "words"), [(["."], "no posterior"), (["missing"], "no posterior")])
def test_what_is_no_run_is_refused(refused, arguments, words):
    refused([words], "compare", *arguments)


def test_a_run_is_compared_once(refused, here):
    refused(["a run is given twice among run, run: name every run once"], "compare", "run", "./run")


def test_a_file_that_is_no_posterior_is_named_and_refused(refused, here):
    (here / "broken.nc").write_text("nothing")
    refused(["'broken.nc' is damaged or no posterior of tissuq"], "compare", "broken.nc")


def test_a_posterior_with_damaged_attributes_is_named_and_refused(refused, here):
    data = tq.simulate("neo-hookean", {"C10": 0.5}, [0.8, 0.9, 1.1, 1.2], noise_sd=0.02, seed=1)
    tq.fit(data, discrepancy="none", noise_sd=0.02).save(here / "broken.nc")
    content = (here / "broken.nc").read_bytes()
    (here / "broken.nc").write_bytes(content.replace(b"log_evidence", b"log_EVIDENCE"))  # HDF5 keeps a sum of them
    refused(["'broken.nc' is damaged or no posterior of tissuq"], "compare", "broken.nc")


@pytest.mark.parametrize("command", ["compare", "design", "export"])
def test_measurements_in_place_of_a_run_are_named_as_such(cli, here, command):
    (here / "test.csv").write_text("stretch,stress\n1,0\n1.1,2\n")
    said = cli(command, "test.csv")
    assert said.status == 2
    assert "test.csv" in said.err
    assert "damaged" not in said.err
    assert "run" in said.err


@pytest.mark.slow
def test_runs_of_one_name_are_kept_apart(done, two_runs, empty_figures):
    (two_runs / "other").mkdir()
    (two_runs / "first").rename(two_runs / "other" / "run")
    (two_runs / "second").rename(two_runs / "run")
    done("compare", "other/run", "run", "--out", "one")
    assert len(fits_in(two_runs / "one")) == 3
    done("compare", "other/run/posterior/none.nc", "other/run", "--out", "two")
    assert len(fits_in(two_runs / "two")) == 3


@pytest.mark.slow
@pytest.mark.parametrize("text", slow_but(["nothing"], ["nothing", "[]", '[{"formulation": "auto"}]']))
def test_a_damaged_assessment_leaves_other_priors_unknown(done, two_runs, empty_figures, text):
    (two_runs / "second" / "assessment.json").write_text(text)
    done("compare", "first/posterior/none.nc", "second", "--out", "compared")
    assert fits_in(two_runs / "compared")["second/auto"]["evidence_change_quarter"] == ""
