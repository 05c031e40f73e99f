"""What the page of a comparison of laws says."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import tissuq as tq
from tissuq.assessment.answer import Answer
from tissuq.assessment.next_step import STEPS
from tissuq.assessment.uses import Use, Verdict
from tissuq.experiments.units import stress_unit
from tissuq.report.laws import _next_step, _numbers, columns_of_laws, law_lead
from tissuq.studies.laws import LawStudy


def law_study(comparison, settings=None):
    return LawStudy(settings, SimpleNamespace(shown_unit=stress_unit("MPa")), comparison)


def test_the_finding_is_said_whether_or_not_a_law_can_be_fitted_alone():
    data = tq.simulate("neo-hookean", {"C10": 0.4}, np.linspace(0.8, 1.5, 12), noise_sd=0.02, seed=1)
    comparison = tq.fit_laws(data, ["neo-hookean"], discrepancy="taylor", noise_sd=0.02)
    words = {}
    (law,) = comparison.laws.values()
    without = replace(law, alone=None, row=law.row | {"r_squared": np.nan, "nrmse": np.nan})
    not_alone = replace(comparison, laws={"neo-hookean": without})
    for name, of_laws in {"alone": comparison, "not alone": not_alone}.items():
        settings = SimpleNamespace(discrepancies=("taylor",))
        words[name] = law_lead(law_study(of_laws, settings))
    assert "Alone, without discrepancy, neo-hookean comes nearest" in words["alone"]
    assert words["alone"].startswith(words["not alone"])


def test_a_law_that_is_nearly_certain_is_not_called_one_of_those_that_the_data_do_not_tell_apart():
    data = tq.simulate("neo-hookean", {"C10": 0.5}, np.linspace(0.9, 1.1, 12), noise_sd=0.01, seed=1)
    laws = tq.fit_laws(data, ["neo-hookean", "mooney-rivlin"], discrepancy="none", noise_sd=0.01)
    table = laws.table_in("MPa")
    said = {}
    for share in (0.6, 0.999):
        known = table.assign(probability=[share, 1 - share], elpd_difference=[0.0, 0.1], elpd_difference_error=1.0)
        of_laws = SimpleNamespace(table_in=lambda unit, known=known: known, modulus=laws.modulus, between=laws.between)
        settings = SimpleNamespace(discrepancies=("none",))
        said[share] = law_lead(law_study(of_laws, settings))
    assert "equally well: the data do not tell these apart" in said[0.6]
    assert "tell these apart" not in said[0.999]
    assert f"that {table.index[0]} is the most probable (99.9 %)" in said[0.999]


@pytest.mark.parametrize(
    ("stable", "elpd_difference", "name"),
    [
        ([0.7, 0.9, 1.0], [0.0, 1.0, 9.0], "probable"),
        ([0.1, 0.9, 1.0], [0.0, 1.0, 9.0], "second"),
        ([0.1, 0.2, 1.0], [0.0, 1.0, 9.0], "second"),
        ([np.nan, 0.2, 1.0], [0.0, 1.0, 9.0], "probable"),
        ([0.1, 0.9, 1.0], [0.0, 9.0, 9.0], "probable"),
    ],
)
def test_a_law_that_is_rarely_stable_is_not_the_one_to_continue_with_where_another_predicts_as_well(
    stable, elpd_difference, name
):
    """The laws stand in the order of their probabilities; the third predicts worse than the others."""
    laws = pd.DataFrame(
        {"stable": stable, "elpd_difference": elpd_difference, "elpd_difference_error": 1.0},
        ["probable", "second", "third"],
    )
    assert law_study(SimpleNamespace(table_in=lambda unit: laws)).recommended == name


def test_laws_that_are_as_good_as_the_best_are_named_where_they_are_few_and_a_share_above_1_is_called_so():
    names = ["a", "b", "c", "d"]
    table = pd.DataFrame(index=names).assign(
        modulus=1.0, modulus_low=0.9, modulus_high=1.1, parameters=1, probability=0.25, r_squared=0.9, nrmse=0.1,
        elpd_difference=[0.0, 0.1, 0.2, 0.3], elpd_difference_error=1.0, stable=1.0, stable_beyond=1.0,
        discrepancy_share=0.5,
    )  # fmt: skip
    modulus = SimpleNamespace(mean=1.0, hdi=lambda: (0.9, 1.1))
    remarks = {}
    for count in range(1, 5):
        comparison = SimpleNamespace(table_in=lambda unit, count=count: table[:count], modulus=modulus)
        remarks[count] = _numbers(law_study(comparison))[-1].remark
    assert remarks == {
        1: "no other as good",
        2: "with its discrepancy as good: b",
        3: "with its discrepancy as good: b and c",
        4: "with its discrepancy as good: 3 others",
    }
    row = table.iloc[0]
    share = columns_of_laws(stress_unit("MPa"))["share of discrepancy"]
    assert share(row) == "50 %"
    assert share(row.replace(0.5, 1.7)) == "> 100 %"


YES, CARE, NO = Verdict
PURPOSES = ("report the modulus", "predict these tests", "predict other loading modes", "simulate with finite elements")
GENT_BUT = "gent is as good as any here, but"


@pytest.mark.parametrize(
    ("verdicts", "step", "is_of_all", "words"),
    [
        ((YES, YES, NO, NO), "second mode", True, "continue with gent, which is as good as any here: measure a second"),
        ((CARE, CARE, CARE, CARE), "export", True, "continue with gent, which is as good as any here: take it"),
        ((CARE, CARE, CARE, CARE), "apart", True, "find out why the tests contradict each other, as the warning says. "
         "As good as any here is gent: tissuq predict {run} --material gent"),
        ((NO, CARE, NO, NO), "design", True, f"{GENT_BUT} serves only to predict these tests: see which"),
        ((YES, NO, NO, NO), "design", True, f"{GENT_BUT} serves only to report the modulus: see which"),
        ((NO, NO, NO, NO), "apart", True, f"{GENT_BUT} is of no use yet: find out why the tests"),
        ((NO, YES, CARE, CARE), "law", False, f"{GENT_BUT} serves only to predict these tests and to predict other "
         "loading modes and to simulate with finite elements: see whether another law describes"),
        ((NO, YES, NO, NO), "law", True, f"{GENT_BUT} serves only to predict these tests: see which test would make it "
         "narrower: tissuq design {run} --material gent"),
    ],
)  # fmt: skip
def test_the_next_step_continues_with_a_law_only_where_its_verdicts_allow_it(verdicts, step, is_of_all, words):
    uses = tuple(Use(purpose, verdict, "") for purpose, verdict in zip(PURPOSES, verdicts, strict=True))
    said = _next_step("gent", Answer((), "", uses, STEPS[step]), is_of_all=is_of_all)
    assert said.startswith(words)
