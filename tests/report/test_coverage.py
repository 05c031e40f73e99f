"""The report of a campaign shows every number of its tables, and draws every kind of campaign."""

from __future__ import annotations

import numpy as np
import pytest

from tissuq.experiments.numbers import unbroken
from tissuq.report.coverage import coverage_result, coverage_table
from tissuq.report.writer import write_result
from tissuq.studies.settings import RECIPE
from tissuq.validation.coverage import CoverageSettings, summarise
from tissuq.validation.coverage.campaign import tasks_of

DESIGN = {"low": 0.7, "high": 2.0, "points": 12, "noise_sd": 0.1}


def settings_of(**changes):
    given = {"designs": [DESIGN], "families": ["yeoh", "gent"], "formulations": ["none", "auto"], "replicates": 3}
    return CoverageSettings.model_validate(given | changes)


def made_up(settings):
    """Results of every task from a generator: what is in them does not matter here."""
    generator = np.random.default_rng(0)
    found = []
    for task in tasks_of(settings):
        low = generator.uniform(0.8, 1.1, task.count)
        fits = [[each, each + 0.1, each + 0.05, 0.02] for each in low]
        own = task.indices | {"truth": [1.0] * task.count, "oracle_sd": [0.01] * task.count, "fits": fits}
        more = {mode: [[0.9, 0.05]] * task.count for mode in settings.unseen}
        found.append(own | more | {"predictive": [0.94] * task.count})
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [
        pytest.param({}, marks=pytest.mark.slow),
        pytest.param({"formulations": ["auto"], "families": ["gent"]}, marks=pytest.mark.slow),
        {"replicates": 1, "families": ["gent"]},
        pytest.param({"strengths": [0.0, 0.5, 1.0], "noise": ["known", "unknown"]}, marks=pytest.mark.slow),
        {"predictive": True, "unseen": ["equibiaxial", "planar"], "designs": [DESIGN, DESIGN | {"points": 30}]},
    ],
)
def test_every_kind_of_campaign_has_its_page_tables_and_figures(changes, tmp_path):
    settings = settings_of(**changes)
    (tmp_path / RECIPE).write_text("seed = 0\n")
    results = made_up(settings)
    write_result(coverage_result(settings, results), tmp_path)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    rows = coverage_table(summarise(settings, results)).rows
    assert len(rows) == settings.cells
    assert all(unbroken(cell) in page for row in rows for cell in row)
    names = {
        "answer",
        "coverage",
        *(["families"] if len(settings.families) > 1 else []),
        *(["unseen"] if settings.unseen else []),
    }
    assert {path.stem for path in (tmp_path / "figures").iterdir()} == names
    assert page.count("<img") == len(names)
    assert {path.stem for path in tmp_path.glob("*.csv")} == {"summary", "families"} | (names - {"answer", "coverage"})
    assert not any("nan" in cell for row in rows for cell in row)


def test_failed_fits_are_told(tmp_path):
    settings = settings_of()
    (tmp_path / RECIPE).write_text("seed = 0\n")
    results = made_up(settings)
    results[0]["fits"][1] = None
    write_result(coverage_result(settings, results), tmp_path)
    assert summarise(settings, results)["failed"].sum() == 1
    assert "1 fits failed" in (tmp_path / "report.html").read_text(encoding="utf-8")
