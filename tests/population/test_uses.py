"""For what populations can be used, by the limits of the documentation."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
import tissuq.population.warnings as of_population
from tissuq.assessment.uses import Verdict
from tissuq.population.uses import CONTRADICTING, DEPARTING, uses_of_population
from tissuq.prediction.bands import Band
from tissuq.result_warning import ResultWarning, Severity

STRETCH = np.array([0.8, 0.9, 1.1, 1.2, 1.3])
MODULI = [0.42, 0.46, 0.5, 0.54, 0.48, 0.52]
"""As many as specimens in other tests, so that the sampler is compiled once."""


def population(moduli, discrepancy="none", noise_sd=0.01):
    tests = {
        f"s{place}": tq.simulate("neo-hookean", {"C10": modulus}, STRETCH, noise_sd=noise_sd, seed=place)
        for place, modulus in enumerate(moduli)
    }
    return tq.fit_population(tests, discrepancy=discrepancy, noise_sd=noise_sd)


@pytest.fixture(scope="module")
def alike():
    """Six specimens that differ little: their median is known to 8 % or so."""
    return population(MODULI)


def band(half_width):
    """A band of that half width over its median."""
    median = 2 * (STRETCH - STRETCH**-2)
    return Band(STRETCH, median, median - half_width * abs(median), median + half_width * abs(median))


def warn_of(monkeypatch, names, warning):
    """Let the tests of these specimens have a warning."""
    monkeypatch.setattr(of_population, "warnings_of_tests", lambda _: dict.fromkeys(names, (warning,)))
    monkeypatch.setattr("tissuq.population.uses.warnings_of_tests", of_population.warnings_of_tests)


def test_the_modulus_of_a_tissue_is_reported_as_its_median_is_known(alike):
    row = alike.summary(unit="MPa").loc[("C10", "median")]
    half_width = float(row["hdi_high"] - row["hdi_low"]) / 2 / float(row["median"])
    assert half_width < 0.2
    reporting, _ = uses_of_population(alike, [band(0.1)])
    assert reporting.purpose == "report the modulus of the tissue"
    assert reporting.verdict is Verdict.CARE  # without a discrepancy
    assert f"known to ± {100 * half_width:.2g} %" in reporting.reason
    assert reporting.reason.endswith("if the material is right: its errors are not included")


@pytest.mark.parametrize(("width", "verdict"), [(0.15, Verdict.CARE), (0.45, Verdict.CARE), (0.55, Verdict.NO)])
def test_a_new_specimen_is_predicted_as_its_stress_is_known(alike, width, verdict):
    _, predicting = uses_of_population(alike, [band(0.05), band(width)])
    assert predicting.purpose == "predict a new specimen"
    assert predicting.verdict is verdict
    assert f"its stress known to ± {100 * width:.0f} %" in predicting.reason


def test_with_a_discrepancy_both_can_be_yes(monkeypatch):
    found = population(MODULI, "constant")
    carried = [0.1, 0.0, 0.2]
    monkeypatch.setattr("tissuq.population.uses.shares_of_discrepancy", lambda _: ((0, 0, 0), carried))
    assert [use.verdict for use in uses_of_population(found, [band(0.15)])] == [Verdict.YES, Verdict.YES]
    carried[0] = 0.3
    reporting, predicting = uses_of_population(found, [band(0.15)])
    assert (reporting.verdict, predicting.verdict) == (Verdict.NO, Verdict.YES)
    assert "carries 30 % of the initial stiffness" in reporting.reason


@pytest.mark.parametrize("code", ["doubtful-reading", "stress-at-rest"])
def test_what_is_wrong_with_measurements_stands_against_both(alike, code, monkeypatch):
    warn_of(monkeypatch, alike.names, ResultWarning("x", code))
    uses = uses_of_population(alike, [band(0.1)])
    assert [use.verdict for use in uses] == [Verdict.NO, Verdict.NO]


AT_REST = ResultWarning("there is stress.", "stress-at-rest")


def test_stress_at_rest_in_few_specimens_calls_for_care_where_it_hardly_moves_the_tissue(alike, monkeypatch):
    warn_of(monkeypatch, ["s0"], AT_REST)
    uses = uses_of_population(alike, [band(0.1)])
    assert [use.verdict for use in uses] == [Verdict.CARE, Verdict.CARE]
    assert all(use.reason.endswith("; there is stress at rest in s0") for use in uses)
    assert "known to ±" in uses[0].reason
    monkeypatch.setattr("tissuq.population.uses._half_width", lambda _: 0.01)  # s0 is 17 % softer than the others
    uses = uses_of_population(alike, [band(0.1)])
    assert [use.verdict for use in uses] == [Verdict.NO, Verdict.NO]
    assert uses[0].reason.startswith("there is stress at rest in s0, so that moduli may be off")


def test_stress_at_rest_in_half_of_the_specimens_stands_against_both(alike, monkeypatch):
    warn_of(monkeypatch, ["s0", "s1", "s2"], AT_REST)
    uses = uses_of_population(alike, [band(0.1)])
    assert [use.verdict for use in uses] == [Verdict.NO, Verdict.NO]


@pytest.mark.parametrize(("severity", "is_doubted"), [(Severity.CAUTION, True), (Severity.NOTE, False)])
def test_doubtful_measurements_of_a_specimen_call_for_care(monkeypatch, severity, is_doubted):
    monkeypatch.setattr("tissuq.population.uses._reporting", lambda _: (Verdict.YES, "known"))
    monkeypatch.setattr("tissuq.population.uses._predicting", lambda *_: (Verdict.NO, "not known"))
    monkeypatch.setattr("tissuq.population.uses._reason_against", lambda *_: "")
    warn_of(monkeypatch, ["s1"], ResultWarning("it slipped.", severity=severity))
    reporting, predicting = uses_of_population(None, [])
    assert (reporting.verdict, predicting.verdict) == (Verdict.CARE if is_doubted else Verdict.YES, Verdict.NO)
    for use in (reporting, predicting):
        assert use.reason.endswith("; see the warning about the measurements") is is_doubted


def test_what_is_not_predicted_is_not_used(alike):
    assert uses_of_population(alike, [])[1].verdict is Verdict.NO


def test_a_population_is_of_no_use_where_the_fits_of_most_specimens_are_of_none(alike, monkeypatch):
    codes = dict.fromkeys(alike.posteriors, "unmodelled-curve")

    def warnings_about(solution, *_):
        return [ResultWarning("x", next(codes[name] for name in codes if alike.posteriors[name].solution is solution))]

    monkeypatch.setattr("tissuq.population.uses.warnings_about", warnings_about)
    assert {use.reason for use in uses_of_population(alike, [band(0.1)])} == {DEPARTING}
    codes |= dict.fromkeys(list(codes)[:4], "tests-apart")
    assert {use.reason for use in uses_of_population(alike, [band(0.1)])} == {CONTRADICTING}
    codes |= dict.fromkeys(list(codes)[:3], "poorly-determined")  # of six
    assert all(use.verdict is Verdict.CARE for use in uses_of_population(alike, [band(0.1)]))


def test_curves_that_a_law_cannot_follow_stand_against_both():
    stretch = np.linspace(1.02, 1.5, 25)
    tests = {
        f"s{place}": tq.simulate("ogden-1", {"mu1": mu, "alpha1": 12.0}, stretch, noise_sd=0.002, seed=place)
        for place, mu in enumerate([0.1, 0.11, 0.12, 0.1, 0.09, 0.11])
    }
    uses = uses_of_population(tq.fit_population(tests, discrepancy="none"), [band(0.1)])
    assert [(use.verdict, use.reason) for use in uses] == [(Verdict.NO, DEPARTING)] * 2


def test_few_specimens_say_little_of_a_new_one_and_one_in_another_unit_of_none():
    few = population(MODULI[:3], "constant")
    _, predicting = uses_of_population(few, [band(0.1)])
    assert predicting.verdict is Verdict.CARE
    assert "which 3 specimens determine no better than its prior" in predicting.reason
    uses = uses_of_population(population([*MODULI[:5], 500.0]), [band(0.1)])
    assert [use.verdict for use in uses] == [Verdict.NO, Verdict.NO]
    assert "s5 differs from the others as much as by a mistaken unit" in uses[0].reason


def test_the_answer_in_python_has_the_numbers_of_the_summary_and_the_uses_of_the_page(alike):
    answer = alike.answer
    new, median, spread = answer.estimates
    table = alike.summary(unit="MPa")
    for estimate, quantity in ((new, "new specimen"), (median, "median")):
        expected = [2 * table.loc[("C10", quantity), end] for end in ("median", "hdi_low", "hdi_high")]  # mu = 2 C10
        assert estimate[1:4] == pytest.approx(expected, rel=1e-9)
        assert estimate.unit == "MPa"
    assert spread[1:4] == pytest.approx(np.exp(table.loc[("C10", "spread")].to_numpy(float)), rel=1e-9)
    assert [use.purpose for use in answer.uses] == [
        "report the modulus of the tissue", "predict a new specimen", "compute with a new specimen",
    ]  # fmt: skip
    bands = alike.new_patient(np.linspace(0.8, 1.3, 41), unit="MPa")
    width = Band(*(bands[name].to_numpy(float) for name in ("stretch", "median", "low", "high")))
    assert answer.uses[:2] == uses_of_population(alike, [width])
    assert "modulus of a new specimen" in str(answer)
    assert "WITH CARE: report the modulus of the tissue: " in str(answer)


def test_what_is_doubtful_in_files_stands_against_the_answer_in_python(tmp_path):
    tests = {}
    for place, modulus in enumerate(MODULI):
        test = tq.simulate("neo-hookean", {"C10": modulus}, STRETCH, noise_sd=0.01, seed=place)
        lines = [f"{stretch},{stress:.4f}" for stretch, stress in zip(STRETCH, test.stress, strict=True)]
        (tmp_path / f"s{place}.csv").write_text("\n".join(["stretch,stress", *lines]) + "\n")
        tests[f"s{place}"] = tq.read(tmp_path / f"s{place}.csv")
    found = tq.fit_population(tests, discrepancy="none", noise_sd=0.01)
    assert [use.verdict for use in found.answer.uses] == [Verdict.NO] * 3
    assert "what was read of the files is doubtful" in found.answer.uses[0].reason
    assert any(str(text).startswith("all specimens: check the unit") for text in found.warnings)
