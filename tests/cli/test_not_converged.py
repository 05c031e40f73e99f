"""A sampler that has not converged: exit status 3, and the result says so wherever it is read."""

import json
import re
from dataclasses import replace
from math import nan

import pytest

from tissuq.inference.enumerators import sampled
from tissuq.inference.enumerators.adaptive_cells import AdaptiveCells
from tissuq.inference.solution import Diagnostics

VERDICT = "4 chains of 1000 draws have NOT converged: R-hat of C10 is 1.73."


@pytest.fixture
def stuck(monkeypatch):
    """Make every sampled fit one that has not converged; ``rhat`` may be nan, as of chains that never move."""

    def install(rhat=1.73):
        def sample(model, seed):
            (solution,) = AdaptiveCells().solve([model], seed)
            rhats, sizes = dict.fromkeys(model.symbols, rhat), dict.fromkeys(model.symbols, 12.0)
            found = Diagnostics(False, VERDICT, rhats, sizes, sizes, divergences=3)
            return replace(solution, route="joint", log_evidence=None, log_evidence_error=None, diagnostics=found)

        monkeypatch.setattr(sampled, "sample_joint", sample)

    return install


@pytest.fixture
def fitted(cli, stuck, specimen):
    stuck()
    return cli("fit", specimen, "--method", "joint", "--discrepancy", "none", "--noise-sd", 1, "--no-figures")


def test_the_exit_status_is_3_and_the_message_names_the_discrepancy(fitted):
    assert fitted.status == 3
    assert fitted.err.startswith("tissuq: sampling has NOT converged for none; do not use these results.")
    assert fitted.err.count("\n") == 1


def test_the_report_warns_and_shows_rhat_and_ess(fitted, here):
    report = (here / "runs" / "specimen" / "report.html").read_text()
    assert f"First warning: the result must not be used as it is</strong>{VERDICT}</div>" in report
    assert '<th scope="col">R-hat</th><th scope="col">ESS</th>' in report
    assert "<td>1.730</td><td>12</td>" in report


def test_the_tables_and_the_terminal_hold_rhat_and_ess_and_no_evidence(fitted, cli, here):
    (row,) = json.loads((here / "runs" / "specimen" / "summary.json").read_text())
    assert (row["rhat"], row["ess"], row["log_evidence"]) == (1.73, 12.0, None)
    for said in (fitted, cli("show", "runs/specimen")):
        assert said.out.startswith(f"Warning: {VERDICT}")
    said = cli("show", "runs/specimen", "--details")
    lines = [line.split() for line in said.out.splitlines() if line.strip().startswith("none")]
    assert ["1.730", "12"] in [line[-2:] for line in lines]


def test_an_rhat_that_is_not_a_number_is_null_in_json(cli, done, stuck, here, specimen):
    stuck(rhat=nan)
    said = cli("fit", specimen, "--method", "joint", "--discrepancy", "none", "--noise-sd", 1, "--no-figures")
    assert said.status == 3
    text = (here / "runs" / "specimen" / "summary.json").read_text()
    (row,) = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))
    assert (row["rhat"], row["ess"]) == (None, 12.0)
    done("show", "runs/specimen")


@pytest.mark.slow
def test_the_study_of_the_paper_ends_with_status_3_too_and_keeps_its_exact_results(
    cli, stuck, here, one_range, empty_posteriors
):
    stuck()
    said = cli("paper", "--points", 6, "--sampler", "both", "--no-figures", "--out", "run")
    assert said.status == 3
    assert "NOT converged for none, constant, linear, quadratic, mooney-rivlin, yeoh, gp" in said.err
    exact, nuts = (json.loads((here / "run" / f"summary{which}.json").read_text()) for which in ("", "-nuts"))
    assert all(row["rhat"] is None and row["log_evidence"] is not None for row in exact)
    assert all(row["rhat"] == 1.73 and row["log_evidence"] is None for row in nuts)
    assert len(list((here / "run" / "posterior").glob("*-nuts.nc"))) == 7
    report = (here / "run" / "report.html").read_text()
    assert len(re.findall(rf'class="warning [^>]*><strong[^<]*</strong>[^<]*{re.escape(VERDICT)}', report)) == 1
    assert "none (nuts), constant (nuts), linear (nuts), quadratic (nuts), mooney-rivlin (nuts)" in report
    assert "Two independent routes" in report
