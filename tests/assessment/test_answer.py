"""The answer of a posterior: its numbers are those of the posterior, and its verdicts follow from known cases."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.stats import norm

import gallery
import tissuq as tq
from tissuq.assessment import answer
from tissuq.assessment.answer import Answer, Estimate
from tissuq.assessment.next_step import STEPS, Step, _with_options, next_step
from tissuq.assessment.uses import PRECISE, Use, Verdict, _ends_in_words, precision_of, uses_of
from tissuq.experiments.reading.findings import data_warnings
from tissuq.mechanics import material_named
from tissuq.model.discrepancy import discrepancy_named
from tissuq.result_warning import ResultWarning, Severity

STRETCH = np.r_[np.linspace(0.7, 0.98, 8), np.linspace(1.02, 1.6, 12)]
YEOH = {"C10": 0.5, "C20": 0.1, "C30": 0.0}
PURPOSES = ["report the modulus", "predict these tests", "predict other loading modes", "simulate with finite elements"]


def verdicts(posterior):
    assert [use.purpose for use in posterior.answer.uses] == PURPOSES
    return [use.verdict for use in posterior.answer.uses]


def yeoh(**options):
    return gallery.fit(tq.simulate("yeoh", YEOH, STRETCH, noise_sd=0.01, seed=1), noise_sd=0.01, **options)


@pytest.mark.slow
def test_the_numbers_are_the_modulus_and_the_headline_parameter_of_the_posterior():
    posterior = yeoh(discrepancy="auto")
    modulus, c10 = posterior.answer.estimates
    assert (modulus.name, c10.name) == ("initial shear modulus", "C10")
    row = posterior.summary(unit="MPa").loc["C10"]
    assert [c10.mean, c10.low, c10.high] == pytest.approx(row[["mean", "hdi_low", "hdi_high"]].to_list(), rel=1e-6)
    assert [modulus.mean, modulus.low, modulus.high] == pytest.approx(
        [2 * c10.mean, 2 * c10.low, 2 * c10.high], rel=1e-6
    )
    assert modulus.low < 1.0 < modulus.high  # of the truth
    assert posterior.answer.meaning == "this specimen as tested, errors of the test not included"


def test_a_material_that_is_allowed_to_be_wrong_serves_where_one_mode_was_measured():
    posterior = yeoh(discrepancy="auto")
    modulus = posterior.answer.estimates[0]
    assert (modulus.high - modulus.low) / 2 / modulus.mean < PRECISE
    assert verdicts(posterior)[:3] == [Verdict.YES, Verdict.YES, Verdict.CARE]
    assert posterior.answer.uses[0].reason.endswith(", errors of the test not included")
    assert "only one mode was measured" in posterior.answer.uses[2].reason
    targets = [f"{mode}:{posterior.stable_ranges[mode].high:.3g}" for mode in ("equibiaxial", "planar")]
    aimed = " ".join(f"--target {target}" for target in targets)
    assert posterior.answer.next_step.shell.endswith(f"tissuq design {{run}} {aimed} says which helps most.")
    assert f"posterior.design(target={targets}) says" in posterior.answer.next_step.python


def test_a_sheet_that_was_strained_in_one_proportion_alone_is_judged_as_one_mode_is():
    strip = tq.simulate("yeoh", YEOH, STRETCH, noise_sd=0.01, mode="constrained-uniaxial", seed=1)
    sheet = tq.Experiment("biaxial", np.column_stack([STRETCH, np.ones_like(STRETCH)]), strip.stress)
    as_strip, as_sheet = (gallery.fit(data, material="yeoh", noise_sd=0.01) for data in (strip, sheet))
    assert verdicts(as_strip) == verdicts(as_sheet)
    assert as_sheet.answer.uses[2].reason.endswith("of both axes were measured in one proportion alone")
    both = np.column_stack([STRETCH, STRETCH[::-1]])
    several = gallery.fit(tq.simulate("yeoh", YEOH, both, 0.01, mode="biaxial", seed=1), material="yeoh", noise_sd=0.01)
    assert "proportion" not in several.answer.uses[2].reason


def test_a_wrong_material_without_discrepancy_serves_for_nothing_but_its_own_test_and_auto_is_next():
    posterior = yeoh(discrepancy="none")
    assert "unmodelled-curve" in {warning.code for warning in posterior.warnings}
    reporting, _, others, simulating = verdicts(posterior)
    assert (reporting, others, simulating) == (Verdict.NO, Verdict.NO, Verdict.NO)
    low, high = posterior.answer.estimates[0][2:]
    assert not low < 2 * YEOH["C10"] < high  # so that the verdict is right
    assert "--discrepancy auto" in posterior.answer.next_step.shell
    assert 'discrepancy="auto"' in posterior.answer.next_step.python


def test_a_right_material_without_discrepancy_is_to_be_reported_with_care():
    data = tq.simulate("neo-hookean", {"C10": 0.5}, STRETCH, noise_sd=0.01, seed=1)
    posterior = gallery.fit(data, discrepancy="none", noise_sd=0.01)
    assert verdicts(posterior) == [Verdict.CARE, Verdict.YES, Verdict.CARE, Verdict.CARE]
    assert "if the material is right" in posterior.answer.uses[0].reason


@pytest.mark.parametrize(
    ("share", "words"),
    [
        ((0.03, 0.01, 0.05), ""),
        ((0.1, 0.05, 0.15), "yeoh alone is off by 10 % of the stress"),
        ((0.4, 0.2, 0.6), "yeoh alone is wrong here: the discrepancy carries 40 % of the stress (95 % interval 20 %"),
        (
            (2.0, 1.4, 2.6),
            "yeoh alone is wrong here: the discrepancy opposes it with 200 % of the stress (95 % interval",
        ),
        ((0.9, 0.3, 1.5), "How much of the stress is yeoh's and how much the discrepancy's is not determined"),
    ],
)
def test_how_far_the_law_is_off_alone_is_said_where_it_is_known(share, words, monkeypatch):
    model = SimpleNamespace(discrepancy=discrepancy_named("auto"), material=material_named("yeoh"))
    monkeypatch.setattr(answer, "shares_of_discrepancy", lambda solution: (share, (0.0, 0.0, 0.0)))
    text = answer._law_in_words(SimpleNamespace(model=model), has_stress_at_rest=False, serves_together=True)
    assert text.startswith(words)
    assert bool(text) == bool(words)
    of_poor_fit = answer._law_in_words(SimpleNamespace(model=model), has_stress_at_rest=False, serves_together=False)
    assert of_poor_fit == text.replace(" Use it with the discrepancy, as exported cards do.", "")
    assert (of_poor_fit != text) == bool(words)
    at_rest = answer._law_in_words(SimpleNamespace(model=model), has_stress_at_rest=True, serves_together=True)
    assert at_rest.startswith("There is stress at rest") == bool(words)


def test_a_doubtful_measurement_makes_the_modulus_one_to_report_with_care():
    clean = yeoh(discrepancy="auto")
    torn = ResultWarning("it was torn.", "measurements", Severity.CAUTION)
    inside = np.ones(len(STRETCH), bool)
    use = uses_of(clean.solution, clean.initial_shear_modulus, clean.stable_ranges, [torn], inside)[0]
    assert clean.answer.uses[0].verdict is Verdict.YES
    assert use.verdict is Verdict.CARE
    assert use.reason.endswith("; see the warning about the measurements")


def test_a_process_in_stress_says_nothing_of_other_modes_and_is_no_material():
    posterior = yeoh(discrepancy="gp")
    reporting, _, others, simulating = verdicts(posterior)
    assert (others, simulating) == (Verdict.NO, Verdict.NO)
    share = abs(posterior.assess().initial_share[0])
    assert (reporting is Verdict.NO) == (share > PRECISE)


def test_a_negative_modulus_is_never_fit_for_simulation():
    posterior = gallery.fit(tq.datasets.load("rubber-treloar-uniaxial"), material="mooney-rivlin", discrepancy="none")
    assert posterior.stable_ranges["uniaxial"].probability < 0.05
    assert verdicts(posterior)[3] is Verdict.NO
    assert "unstable" in {warning.code for warning in posterior.warnings}


@pytest.mark.slow
def test_fibres_are_taken_into_finite_elements_with_care_and_not_with_a_free_energy_from_one_stress():
    material, stretch = "neo-hookean+standard-fibres:one@0", np.linspace(1.02, 1.3, 12)
    data = tq.simulate(material, {"C10": 0.01, "k": 0.02}, stretch, noise_sd=1e-4, seed=2)
    posterior = tq.fit(data, material=material, discrepancy="none", noise_sd=1e-4)
    assert verdicts(posterior)[3] is Verdict.CARE
    assert "cards" in posterior.answer.uses[3].reason
    posterior = tq.fit(data, material=material, discrepancy="auto", noise_sd=1e-4)
    assert verdicts(posterior)[3] is Verdict.NO
    assert "one stress was measured" in posterior.answer.uses[3].reason
    points = [
        (1 + a * share, 1 + b * share) for a, b in ((0.3, 0.3), (0.3, 0.1), (0.1, 0.3)) for share in (0.4, 0.7, 1)
    ]
    law = "neo-hookean+standard-fibres@40"
    data = tq.simulate(law, {"C10": 0.02, "k": 0.05}, points, mode="biaxial", noise_sd=2e-4, seed=1)
    posterior = tq.fit(data, material=law, noise_sd=2e-4)
    assert verdicts(posterior)[3] is Verdict.CARE
    assert "FEBio alone" in posterior.answer.uses[3].reason


def answer_with(posterior, warning):
    """The answer where a warning came with the measurements."""
    experiment = posterior.model.experiment.labelled(warnings=(warning,))
    model = replace(posterior.model, experiment=experiment)
    return replace(posterior, solution=replace(posterior.solution, model=model)).answer


@pytest.mark.slow
def test_what_is_implausible_in_the_measurements_comes_first():
    posterior = yeoh(discrepancy="auto")
    unit = ResultWarning("check the unit: MPa was assumed.", "doubtful-reading", Severity.PROBLEM)
    answer = answer_with(posterior, unit)
    assert answer.uses[0].verdict is Verdict.NO
    assert answer.next_step.shell == "act on the first warning: it says what to do."
    vague = gallery.fit(
        tq.simulate("yeoh", YEOH, [1.1, 1.3, 1.5], noise_sd=0.05, seed=1), discrepancy="auto", noise_sd=0.05
    )
    assert vague.answer.uses[0].verdict is not Verdict.YES
    zero = "at stretch 1 the stress is already 4 kPa, which --load-zero first takes off."
    offset = answer_with(posterior, ResultWarning(zero, "stress-at-rest"))
    assert offset.uses[0].verdict is Verdict.NO
    assert "stress at rest" in offset.uses[0].reason
    assert offset.uses[1].verdict is Verdict.CARE
    assert "--load-zero first" in offset.next_step.shell
    drift = "the stress is 0 kPa at the beginning and 1 kPa at the end: to fit one branch give --branch loading."
    drifted = answer_with(posterior, ResultWarning(drift, "large-drift"))
    assert [use.verdict for use in drifted.uses[:2]] == [Verdict.NO, Verdict.CARE]
    assert "the load drifts" in drifted.uses[0].reason
    assert "the load drifts" in drifted.uses[1].reason
    assert "--branch loading" in drifted.next_step.shell
    way, further = np.linspace(0, 0.3, 20), 1.3
    stacked = {"strain (%)": 100 * np.r_[way, way], "stress [kPa]": np.r_[way, further * way]}
    cycles = next(w for w in data_warnings(tq.inspect(pd.DataFrame(stacked)).reading) if "cycles" in w)
    assert "--cycle last" in cycles
    assert "fit again" not in answer_with(vague, cycles).next_step.shell  # they may be two specimens
    assert "it says what to do" in answer_with(vague, cycles).next_step.shell
    torn = ResultWarning("the stress falls while the test goes on: give --until-peak.")
    assert "warning about the measurements" in answer_with(vague, torn).next_step.shell
    slack = ResultWarning("the first 25 rows carry no load: give --preload auto.", "slack")
    assert "--preload auto" in answer_with(vague, slack).next_step.shell
    assert "design" in answer_with(vague, torn.as_note()).next_step.shell
    assert "design" in vague.answer.next_step.shell


def test_slack_is_next_before_the_instability_that_it_causes():
    way = np.maximum(np.linspace(1, 1.3, 45) - 0.04, 1)
    stress = 10 * (way - way**-2) + np.random.default_rng(11).normal(0, 0.03, 45)
    with pytest.warns(UserWarning, match="carry no load"):
        posterior = tq.fit(pd.DataFrame({"stretch": np.linspace(1, 1.3, 45), "stress [kPa]": stress}))
    cautions = [warning.code for warning in posterior.warnings if warning.severity is Severity.CAUTION]
    assert cautions[:2] == ["slack", "unstable"]
    assert [use.verdict for use in posterior.answer.uses[1::2]] == [Verdict.YES, Verdict.NO]
    assert "alone is wrong here" in posterior.answer.law
    assert "exported cards" not in posterior.answer.law  # which are not to be used
    assert posterior.answer.next_step == STEPS["slack"]


def test_known_noise_of_another_unit_is_the_first_warning():
    stretch = np.linspace(1, 1.3, 20)
    data = tq.Experiment("uniaxial", stretch, 10 * (stretch - stretch**-2), stress_unit="kPa")
    posterior = tq.fit(data, discrepancy="none", noise_sd=0.05)  # MPa, where kPa were meant
    first = posterior.warnings[0]
    assert (first.code, first.severity) == ("large-noise", Severity.PROBLEM)
    assert "50 kPa, is larger than the largest stress, 7.08 kPa" in first
    assert posterior.answer.next_step == STEPS["problem"]
    assert not any(warning.code == "large-noise" for warning in tq.fit(data, noise_sd="7 kPa").warnings)


@pytest.mark.slow
def test_where_the_assumed_spread_of_specimens_sets_the_width_more_specimens_are_next():
    data = [tq.datasets.load(f"rubber-treloar-{mode}") for mode in ("uniaxial", "equibiaxial", "planar")]
    answer = tq.fit(data, discrepancy="auto-first").answer
    modulus = answer.estimates[0]
    assert 0.7 * (modulus.high - modulus.low) / 2 / modulus.mean < 1.96 * 0.18
    assert "spread between specimens" in answer.uses[0].reason
    assert "--specimen NAME" in answer.next_step.shell
    assert STEPS["unnamed specimens"] == answer.next_step


def test_of_a_single_test_it_is_not_asked_whether_its_tests_are_of_one_specimen():
    answer = tq.fit(tq.datasets.load("brain-cortex-uniaxial"), tolerances="tissue").answer
    assert answer.uses[0].reason.endswith("the assumed spread between specimens")
    assert STEPS["specimens"] == answer.next_step


@pytest.mark.slow
def test_a_width_that_errors_of_one_specimen_set_is_not_called_a_spread_between_specimens():
    answer = tq.fit(tq.datasets.load("brain-cortex-uniaxial"), discrepancy="auto").answer
    assert answer.meaning == tq.estimands()["specimen"].description
    modulus = answer.estimates[0]
    half_width = (modulus.high - modulus.low) / 2 / modulus.mean
    share = 1.96**2 * (0.05**2 + 0.05**2) / half_width**2
    cause = "the assumed error of load and area (tolerance 'stress' and 'test', 7 %)"
    assert f"{100 * share:.0f} % of its variance due to {cause}" in answer.uses[0].reason


def test_an_answer_prints_itself_in_its_unit():
    answer = Answer(
        (Estimate("initial shear modulus", 0.00146, 0.00123, 0.00169),),
        "this specimen",
        (Use("report the modulus", Verdict.YES, "known to ± 15 %"),),
        Step("tissuq design {run}", "posterior.design()"),
        "kPa",
    )
    lines = str(answer).splitlines()
    assert lines[0] == "initial shear modulus 1.46 kPa, 95 % interval 1.23 to 1.69"
    assert lines[-1] == "Next: posterior.design()"


def in_shear_and_tension(times):
    """Tests of two specimens, one of which is so many times as stiff as the other."""
    stretch = np.linspace(0.85, 1.25, 21)
    tension = tq.simulate("neo-hookean", {"C10": 3e-3}, stretch, noise_sd=3e-5, seed=1)
    shear = tq.simulate(
        "neo-hookean", {"C10": 3e-3 * times}, np.linspace(0, 0.5, 21), mode="simple-shear", noise_sd=3e-5, seed=2
    )
    return [tension, shear]


@pytest.mark.slow
def test_tests_that_no_spread_between_them_explains_give_no_modulus():
    posterior = tq.fit(in_shear_and_tension(4.0))
    (warning,) = (warning for warning in posterior.warnings if warning.code == "tests-apart")
    assert "is 2.5 times that of one material for all" in warning
    assert "correlated-residuals" not in {warning.code for warning in posterior.warnings}
    assert verdicts(posterior)[0] == Verdict.NO


@pytest.mark.slow
def test_two_directions_of_one_specimen_that_differ_by_a_factor_give_no_modulus():
    """They tell a spread between tests that would explain it, which tests of one specimen do not have."""
    stretch = np.linspace(1.02, 1.3, 15)
    strips = [
        tq.simulate("demiray", {"mu": mu, "b": 4.0}, stretch, noise_sd=2e-4, seed=seed).labelled(specimen="S1")
        for seed, mu in enumerate((0.04, 0.014))
    ]
    posterior = tq.fit(strips)
    (warning,) = (warning for warning in posterior.warnings if warning.code == "tests-apart")
    assert "that tests of a specimen may have" in warning
    assert verdicts(posterior)[0] == Verdict.NO


def test_of_a_cycle_whose_residuals_are_correlated_one_branch_is_advised():
    way = np.r_[np.linspace(1.02, 1.3, 40), np.linspace(1.3, 1.02, 40)]
    stress = (way - way**-2) * np.r_[np.ones(40), np.full(40, 0.8)]
    options = {"noise_sd": 0.01, "discrepancy": "auto", "tolerances": "as-tested"}
    advice = {}
    for name, rows in {"cycle": slice(None), "branch": slice(40)}.items():
        waves = 0.03 * np.sin(80 * way[rows]) if name == "branch" else 0
        warnings = tq.fit(tq.Experiment("uniaxial", way[rows], stress[rows] + waves), **options).warnings
        advice[name] = next(warning.shell for warning in warnings if warning.code == "correlated-residuals")
    assert "--branch loading" in advice["cycle"]
    assert "--branch" not in advice["branch"]
    assert "--noise autoregressive, or with fewer points (--every " in advice["branch"]


@pytest.mark.slow
def test_tests_that_differ_as_specimens_do_are_not_said_to_contradict_each_other():
    codes = {warning.code for warning in tq.fit(in_shear_and_tension(1.2)).warnings}
    assert not codes & {"tests-apart", "contradicting-tests"}


@pytest.mark.slow
def test_a_prior_that_outweighs_the_data_is_said_and_the_modulus_reported_with_care():
    data = tq.simulate("neo-hookean", {"C10": 3e-3}, np.linspace(0.8, 1.3, 21), noise_sd=3e-5, seed=1)
    for centre in (1e-3, 3e-3):
        posterior = tq.fit(data, priors={"C10": tq.Normal(centre, 1e-5)})
        (warning,) = (warning for warning in posterior.warnings if warning.code == "prior-dominates")
        assert "for C10 determines the result more than the data do" in warning
        assert verdicts(posterior)[0] == Verdict.CARE
    wide = tq.fit(data, priors={"C10": tq.Normal(3e-3, 3e-2)})
    assert "prior-dominates" not in {warning.code for warning in wide.warnings}


def test_a_prior_as_sharp_as_the_error_in_common_is_said_and_its_advice_gives_both_together():
    """Against a grid of C10 of the specimen, under its prior: what is measured is C10 times 1 + e."""
    data = tq.simulate("neo-hookean", {"C10": 0.6}, np.linspace(0.85, 1.4, 20), noise_sd=0.004, seed=2)
    options = {"discrepancy": "none", "noise": "independent"}
    sharp = tq.fit(data, **options, priors={"C10": tq.Normal(0.5, 0.03)})
    assert "sharp-prior" in {warning.code for warning in sharp.warnings}
    for prior, tolerances in [
        (tq.Normal(0.5, 0.3), None),
        (tq.Normal(0.5, 0.03), "as-tested"),
        (tq.Uniform(0.4, 0.7), None),
    ]:
        found = tq.fit(data, **options, priors={"C10": prior}, tolerances=tolerances)
        assert "sharp-prior" not in {warning.code for warning in found.warnings}
    alone = tq.fit(data, **options)
    as_measured = tq.fit(data, **options, tolerances={"stress": 0, "test": 0}).marginals["C10"]
    values = np.linspace(0.3, 0.9, 2001)
    variance = as_measured.sd**2 + (alone.model.common_error * values) ** 2
    weights = norm(0.5, 0.03).pdf(values) * norm(values, np.sqrt(variance)).pdf(as_measured.mean)
    weights /= weights.sum()
    exact = weights @ values
    inverse = np.array([alone.marginals["C10"].sd, 0.03]) ** -2.0
    advised = inverse @ [alone.marginals["C10"].mean, 0.5] / inverse.sum()
    sd = np.sqrt(weights @ (values - exact) ** 2)
    assert abs(advised - exact) < 0.5 * sd < 0.5 * abs(sharp.marginals["C10"].mean - exact)
    assert inverse.sum() ** -0.5 == pytest.approx(sd, rel=0.15)


def test_stresses_of_other_modes_that_are_known_differently_in_tension_and_compression_are_told_apart():
    data = tq.simulate("yeoh", YEOH, np.linspace(1.02, 1.8, 20), noise_sd=0.01, seed=1)
    posterior = gallery.fit(data, noise_sd=0.01, discrepancy="auto")
    stable, words = posterior.stable_ranges["equibiaxial"], posterior.answer.uses[2].reason
    stated = re.search(r"equibiaxial stress ± ([\d.]+) % in tension and ± ([\d.]+) % in compression", words)
    for percent, ends in zip(stated.groups(), ((1.0, stable.high), (stable.low, 1.0)), strict=True):
        band = posterior.predict(np.linspace(*ends, 9), mode="equibiaxial", noise=False)
        width, size = band["high"] - band["low"], np.sqrt((band["median"] ** 2).mean())
        assert float(percent) == pytest.approx(50 * np.sqrt((width**2).mean()) / size, rel=0.02)


def test_a_law_that_does_not_describe_the_measurements_is_said_to_be_wrong_with_the_share_of_the_discrepancy():
    data = tq.simulate("yeoh", {"C10": 0.5, "C20": 0.6, "C30": 0.0}, STRETCH, noise_sd=0.01, seed=1)
    posterior = gallery.fit(data, discrepancy="auto", noise_sd=0.01)
    mean, low, high = posterior.assess().share
    assert mean > PRECISE
    ends = f"95 % interval {100 * low:.0f} % to {100 * high:.0f} %"
    assert f"the discrepancy carries {100 * mean:.0f} % of the stress ({ends})" in posterior.answer.law
    right = tq.simulate("neo-hookean", {"C10": 0.5}, STRETCH, noise_sd=0.01, seed=1)
    assert gallery.fit(right, discrepancy="auto", noise_sd=0.01).answer.law == ""


@pytest.mark.parametrize(
    ("ends", "words"),
    [
        ((-0.3, 0.3), "± 30 %"),
        ((-0.34, 0.52), "within −34 % and +52 %"),
        ((-0.011, 0.0008), "within −1.1 % and +0.1 %"),
    ],
)
def test_both_ends_of_a_skew_interval_are_said(ends, words):
    assert _ends_in_words(*ends) == words


def test_a_fit_that_does_not_describe_its_own_measurements_serves_nothing_else():
    posterior, inside = yeoh(discrepancy="auto"), np.ones(len(STRETCH), bool)
    of_fit = posterior.solution, posterior.initial_shear_modulus, posterior.stable_ranges, []
    assert {use.verdict for use in uses_of(*of_fit, inside)} <= {Verdict.YES, Verdict.CARE}
    inside[: len(STRETCH) // 5] = False
    reporting, *others = uses_of(*of_fit, inside)
    assert reporting.verdict is Verdict.CARE
    assert "but only 16 of 20 measurements inside the band" in reporting.reason
    assert {use.verdict for use in others} == {Verdict.NO}


def test_what_is_said_to_be_too_narrow_is_used_with_care_at_best():
    posterior = yeoh(discrepancy="auto")
    correlated = ResultWarning("residuals are autocorrelated.", "correlated-residuals")
    for use in answer_with(posterior, correlated).uses[:2]:
        assert use.verdict is Verdict.CARE
        assert "the errors of consecutive measurements are correlated" in use.reason


def test_tests_that_contradict_each_other_are_predicted_with_care_at_best():
    posterior = yeoh(discrepancy="auto")
    assert posterior.answer.uses[1].verdict is Verdict.YES
    answer = answer_with(posterior, ResultWarning("the tests are apart.", "tests-apart"))
    for use in answer.uses[1:3]:
        assert use.verdict is Verdict.CARE
        assert "contradict" in use.reason
    assert "contradict" in answer.next_step.shell


@pytest.mark.parametrize(
    ("warning", "options"),
    [
        ("to fit one branch of one cycle, give --cycle last --branch loading.", "--cycle last --branch loading"),
        ("the specimen tore; to leave out what follows give --until-peak.", "--until-peak"),
        ("to fit one of them, give --branch loading or unloading.", "--branch loading"),
        ('the zero of the load cell, which --load-zero "0.5 kPa" takes off.', '--load-zero "0.5 kPa"'),
        ("to leave them out give --leave-out 12:15,18.", "--leave-out 12:15,18"),
        ("for a zero that is not sure --tolerance zero=0.02.", "--tolerance zero=0.02"),
    ],
)
def test_the_next_step_has_the_options_of_the_warning_on_which_it_rests(warning, options):
    step = Step("fit again with {options}.", "act on the warning.")
    assert _with_options(step, ResultWarning(warning)).shell == f"fit again with {options}."
    assert _with_options(step, ResultWarning("torn.")).shell == step.python


def test_the_next_step_has_all_options_where_another_warning_proposes_the_same_and_more():
    step = Step("fit again with {options}.", "act on the warning.")
    drift = ResultWarning("the zero drifts: give --branch loading, and for a zero --tolerance zero=16.")
    cycles = ResultWarning("all 6 cycles are used: to fit one branch of one cycle, give --cycle last --branch loading.")
    torn = ResultWarning("the specimen tore, or slipped: give --until-peak.")
    for others in ([drift, cycles], [cycles, torn, drift]):
        assert _with_options(step, drift, others).shell == "fit again with --cycle last --branch loading."
    assert _with_options(step, torn, [torn, drift, cycles]).shell == "fit again with --until-peak."


WAY = np.linspace(1, 1.6, 25)


@pytest.mark.parametrize(
    ("is_directed", "stress", "name"),
    [
        (False, WAY - WAY**-2, "stable"),
        (False, (WAY - WAY**-2) * np.exp(-2.2 * (WAY - 1)), "peak"),
        (False, (2 - WAY) - (2 - WAY) ** -2, "stable"),
        (True, (WAY - WAY**-2) * np.exp(-2.2 * (WAY - 1)), "fibres"),
    ],
)
def test_instability_is_mended_by_fibres_of_a_sheet_and_by_leaving_out_a_fall_of_the_stress(is_directed, stress, name):
    tests = tq.Experiment(
        "uniaxial", 2 - WAY[::-1] if stress[-1] < 0 else WAY, np.sort(stress) if stress[-1] < 0 else stress
    )
    law = SimpleNamespace(material=material_named("neo-hookean"), energy_symbols=("c1",), experiment=tests)
    solution = SimpleNamespace(model=law, is_of_data=True, is_directed=is_directed)
    uses = [Use(purpose, Verdict.NO, "") for purpose in PURPOSES]
    unstable = ResultWarning("stable in only 20 % of the draws.", "unstable")
    assert next_step(solution, uses, {}, [unstable]) == STEPS[name]
    never = {"uniaxial": SimpleNamespace(probability=0.2), "planar": SimpleNamespace(probability=0.0)}
    assert next_step(solution, uses, never, [unstable]) == STEPS["law" if name == "stable" else name]


@pytest.mark.parametrize(
    ("half_width", "verdict", "words"),
    [(0.1, Verdict.YES, "known to ± 10 %"), (0.4, Verdict.CARE, "known to ± 40 %"),
     (2.0, Verdict.NO, "known to no better than ± 100 %"), (30.0, Verdict.NO, "not known at all"),
     (np.nan, Verdict.NO, "not known at all")],
)  # fmt: skip
def test_a_width_is_said_as_far_as_it_means_something(half_width, verdict, words):
    assert precision_of(half_width) == (verdict, words)


def test_a_test_in_shear_is_not_asked_for_stretches():
    data = tq.simulate("neo-hookean", {"C10": 1e-3}, np.linspace(0.02, 0.2, 13), 1e-3, mode="simple-shear", seed=1)
    (poor,) = [w for w in tq.fit(data, discrepancy="none", noise_sd=1e-3).warnings if w.code == "poorly-determined"]
    assert "nearer to rest" in poor
    assert "stretch" not in poor
