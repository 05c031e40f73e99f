"""The benchmark on real tissue: what is read, that nothing predicted is fitted, and that its counts are right."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest

import tissuq as tq
from tissuq.errors import InputError
from tissuq.report.tissues import tissue_result
from tissuq.validation.tissues import (
    TissueSettings,
    read_corpus,
    run_benchmark,
    summarise_tissues,
    summarise_verdicts,
)
from tissuq.validation.tissues.benchmark import PROTOCOLS, RIVALS, carry_out, predicted, tasks_of

BIAXIAL = """mode,stretch,stress_MPa,stretch_2,stress_2_MPa,direction,specimen
"""


def biaxial_rows(direction: str, specimen: str, ratio: float, modulus: float, count: int = 6) -> str:
    stretch = np.linspace(1.02, 1.12, count)
    other = 1 + ratio * (stretch - 1)
    stress = modulus * (stretch - 1 / (stretch**3 * other**2)), modulus * (other - 1 / (other**3 * stretch**2))
    rows = np.column_stack([stretch, stress[0], other, stress[1]])
    return "".join(
        "biaxial," + ",".join(f"{value:.8g}" for value in row) + f",{direction},{specimen}\n" for row in rows
    )


@pytest.fixture
def folder(tmp_path):
    """A folder of two sets: an axial one without labels, and two specimens with two biaxial tests each."""
    stretch = np.concatenate([np.linspace(0.8, 0.95, 5), np.linspace(1.05, 1.3, 5)])
    stress = 0.2 * (stretch - stretch**-2)
    lines = [f"uniaxial,{x:.6g},{y:.8g}" for x, y in zip(stretch, stress, strict=True)]
    (tmp_path / "gel-axial.csv").write_text("mode,stretch,stress_MPa\n" + "\n".join(lines) + "\n")
    rows = [
        biaxial_rows(direction, specimen, ratio, modulus)
        for specimen, modulus in (("A", 0.4), ("B", 0.5))
        for direction, ratio in (("equi", 1.0), ("off", 0.5))
    ]
    (tmp_path / "sheet.csv").write_text(BIAXIAL + "".join(rows))
    (tmp_path / "index.csv").write_text('dataset,tissue\nsheet,"Rubber, thin (made here)"\n')
    return tmp_path


def test_sets_are_read_with_their_classes_and_their_tests_apart(folder):
    gel, sheet = read_corpus(folder)
    assert (gel.name, gel.tissue_class) == ("gel-axial", "gel")
    assert [test.name for test in gel.tests] == ["uniaxial tension", "uniaxial compression"]
    assert gel.tests[1].stretch.tolist() == pytest.approx([0.8, 0.8375, 0.875, 0.9125, 0.95])
    assert (sheet.tissue_class, len(sheet.tests)) == ("rubber", 4)
    assert [test.specimen for test in sheet.tests] == ["A", "A", "B", "B"]
    assert sheet.tests[1].stress.shape == (6, 2)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("mode,stretch\nuniaxial,1.1\n", "has no column 'stress_MPa'"),
        ("mode,stretch,stress_MPa\nbiaxial,1.1,0.2\n", "needs the column 'stretch_2', 'stress_2_MPa'"),
        ("mode,stretch,stress_MPa\ntwisted,1.1,0.2\n", "test twisted: there is no loading mode"),
        ("mode,stretch,stress_MPa\nuniaxial,-1.1,0.2\n", "is not positive"),
        ("mode,stretch,stress_MPa\nuniaxial,abc,0.2\n", "could not convert"),
    ],
)
def test_a_file_in_another_form_is_refused_with_its_name(tmp_path, text, message):
    (tmp_path / "wrong.csv").write_text(text)
    with pytest.raises(InputError, match=r"wrong\.csv") as refusal:
        read_corpus(tmp_path)
    assert message in str(refusal.value)


def test_a_folder_that_is_none_or_holds_no_set_is_refused(tmp_path):
    with pytest.raises(InputError, match="there is no folder"):
        read_corpus(tmp_path / "none")
    with pytest.raises(InputError, match="holds no data set"):
        read_corpus(tmp_path)
    with pytest.raises(InputError, match=r"there is no set 'brian'\. The sets are: brain-cortex"):
        tasks_of(TissueSettings(sets=("brian",)))


@pytest.mark.parametrize("protocol", list(PROTOCOLS))
def test_no_measurement_is_both_fitted_and_predicted(folder, protocol):
    splits = [split for tissue in read_corpus(folder) for split in PROTOCOLS[protocol](tissue.tests)]
    splits += [split for tissue in read_corpus() for split in PROTOCOLS[protocol](tissue.tests)]
    assert splits
    for split in splits:
        assert split.fitted
        for test in split.fitted:
            if test.mode == split.predicted.mode:
                rows = np.column_stack([test.stretch, test.stress])
                taken = np.column_stack([split.predicted.stretch, split.predicted.stress])
                assert not (rows[:, None] == taken).all(axis=2).any()
            if protocol == "specimens":
                assert test.specimen == split.predicted.specimen
            if protocol == "modes":
                assert test.mode != split.predicted.mode


def test_the_end_is_the_last_part_of_the_range_on_both_sides():
    stretch = np.linspace(0.8, 1.2, 21)
    test = tq.Experiment("uniaxial", stretch, stretch - stretch**-2)
    (split,) = PROTOCOLS["ends"]([test])
    assert np.abs(split.predicted.stretch - 1).min() > 0.7 * 0.2
    assert np.abs(split.fitted[0].stretch - 1).max() <= 0.7 * 0.2 + 1e-12
    assert len(split.predicted) + len(split.fitted[0]) == 21


def test_scores_are_those_of_a_normal_predictive_distribution():
    """Known noise, no discrepancy and a vague prior: predictions are normal about least squares."""
    stretch = np.array([1.1, 1.2, 1.3, 1.4])
    column, sd = 2 * (stretch - stretch**-2), 0.05
    generator = np.random.default_rng(3)
    data = tq.Experiment("uniaxial", stretch, 0.5 * column + sd * generator.standard_normal(4))
    posterior = tq.fit(data, discrepancy="none", noise_sd=sd)
    points = np.linspace(1.05, 1.45, 200)
    rows = 2 * (points - points**-2)
    new = tq.Experiment("uniaxial", points, 0.5 * rows + sd * generator.standard_normal(200))
    scores = predicted(posterior, new)
    centre = rows * (column @ data.stress) / (column @ column)
    spread = sd * np.sqrt(1 + rows**2 / (column @ column))
    size = np.sqrt(np.mean(new.stress**2))
    standard = np.abs(new.stress - centre) / spread
    for label, bound in (("inside_50", 0.6744898), ("inside_80", 1.2815516), ("inside_95", 1.9599640)):
        assert scores[label] == pytest.approx(np.mean(standard <= bound), abs=1e-12)
    assert scores["half_width"] == pytest.approx(1.9599640 * np.sqrt(np.mean(spread**2)) / size, rel=1e-6)
    assert scores["error"] == pytest.approx(np.sqrt(np.mean((centre - new.stress) ** 2)) / size, rel=1e-6)
    beyond = np.maximum(standard - 1.9599640, 0) * spread
    assert scores["score"] == pytest.approx(np.mean(2 * 1.9599640 * spread + 40 * beyond) / size, rel=1e-6)


def test_verdicts_are_set_against_what_came_true():
    alike = {"protocol": "modes", "formulation": "auto"}
    moduli = {"modulus_low": 0.4, "modulus_of_predicted": 0.5, "modulus_high": 0.8, "modulus_mean": 0.6}
    results = [
        alike | {"verdict": "yes", "inside_95": 1.0, "error": 0.1, "modulus_verdict": "with care"} | moduli,
        alike | {"verdict": "yes", "inside_95": 0.8, "error": 0.3, "modulus_verdict": "no"} | moduli,
        alike | {"verdict": "no", "inside_95": 0.9, "error": 2.0, "modulus_verdict": "with care"} | moduli
        | {"modulus_mean": 0.9, "modulus_low": 0.6, "modulus_high": 1.2},
        alike | {"failure": "of some kind"},
        alike | {"protocol": "ends", "inside_95": 1.0, "error": 0.1},
    ]  # fmt: skip
    columns = ["quantity", "verdict", "predictions", "held", "error", "precise", "of_use"]
    assert summarise_verdicts(results)[columns].to_numpy().tolist() == [
        ["stress", "yes", 2, 0.9, 0.2, 0.5, 1.0],
        ["stress", "no", 1, 0.9, 2.0, 0.0, 0.0],
        ["modulus", "with care", 2, 0.5, pytest.approx(0.5), 0.5, 0.5],
        ["modulus", "no", 1, 1.0, pytest.approx(0.2), 1.0, 1.0],
    ]
    assert summarise_verdicts(results[-2:]).empty


def test_the_verdict_is_on_the_mode_that_is_predicted(folder):
    settings = TissueSettings(folder=str(folder), sets=("sheet",), protocols=("specimens",), formulations=("none",))
    split, *_ = PROTOCOLS["specimens"](read_corpus(folder)[-1].tests)
    posterior = tq.fit(split.fitted, discrepancy="none", tolerances="specimen")
    assert carry_out(settings, tasks_of(settings)[0])["verdict"] == posterior.answer.uses[1].verdict


@pytest.mark.slow
def test_a_benchmark_resumes_and_its_summary_averages_predictions(folder, tmp_path):
    settings = TissueSettings(folder=str(folder), protocols=("specimens", "tests"), formulations=("none",), points=5)
    target = tmp_path / "out"
    target.mkdir()
    told = []
    results = run_benchmark(settings, target, step=lambda label, is_new: told.append(is_new))
    assert all(told)
    told.clear()
    assert run_benchmark(settings, target, step=lambda label, is_new: told.append(is_new)) == results
    assert told
    assert not any(told)
    assert json.loads((target / "tasks.jsonl").read_text().splitlines()[0])["key"] == "gel-axial/tests/0/none"
    summary = summarise_tissues(results)
    rows = pd.DataFrame(results)
    tests = rows[rows["protocol"] == "tests"]
    row = summary[(summary["protocol"] == "tests") & (summary["class"] == "all")].iloc[0]
    assert row["predictions"] == len(tests) == 6
    assert row["inside_95"] == pytest.approx(tests["inside_95"].mean())
    assert row["half_width"] == pytest.approx(tests["half_width"].median())
    assert list(summary["protocol"].unique()) == ["tests", "specimens"]


def test_a_fit_that_fails_is_counted_and_says_why(folder):
    settings = TissueSettings(folder=str(folder), sets=("sheet",), protocols=("tests",), formulations=("none", "gp"))
    task = tasks_of(settings)[0]
    broken = settings.model_copy(update={"material": "standard-fibres"})
    result = carry_out(broken, task)
    assert "add a matrix" in result["failure"]
    summary = summarise_tissues([result, carry_out(settings, task)])
    assert summary.loc[0, ["predictions", "failed"]].tolist() == [1, 1]


def test_a_set_that_a_protocol_finds_nothing_in_is_named(folder):
    settings = TissueSettings(folder=str(folder), protocols=("tests", "specimens"), formulations=("none",))
    results = [{"key": str(task.number), **carry_out(settings, task)} for task in tasks_of(settings)]
    (missing,) = (section for section in tissue_result(settings, results).sections if section.title == "Not predicted")
    ((sentence,),) = missing.blocks
    assert sentence.startswith("Each test from the others of the same specimen: nothing in gel-axial, ")


def test_tolerances_are_those_of_every_fit(folder):
    settings = TissueSettings(folder=str(folder), sets=("gel-axial",), protocols=("tests",), formulations=("none",))
    task = tasks_of(settings)[0]
    wide = carry_out(settings.model_copy(update={"tolerances": {"stress": 0.3}}), task)["half_width"]
    assert 1.9 * 0.3 < wide < 1.5 * 2 * 0.3 * 2**0.5  # of the fitted test and of the new one
    assert carry_out(settings.model_copy(update={"tolerances": {}}), task)["half_width"] < 0.05
    with pytest.raises(ValueError, match="there is no error of a test named 'stres'"):
        TissueSettings(tolerances={"stres": 0.1})


def test_no_more_predictions_are_made_than_asked_for(folder):
    settings = TissueSettings(folder=str(folder), protocols=("tests",), formulations=("none",), predictions=3)
    assert [task.number for task in tasks_of(settings) if task.tissue == "sheet"] == [0, 2, 3]


def test_one_mode_predicted_from_another_compares_the_moduli():
    settings = TissueSettings(sets=("brain-cortex",), protocols=("modes",), formulations=("none",), tolerances={})
    result = carry_out(settings, tasks_of(settings)[0])
    brain = tq.datasets.load("brain-cortex-shear")
    C10 = np.vdot(brain.stress, 2 * brain.stretch) / np.vdot(2 * brain.stretch, 2 * brain.stretch)
    shear = next(r for t in tasks_of(settings) if (r := carry_out(settings, t))["mode"] == "simple-shear")
    assert shear["modulus_of_predicted"] == pytest.approx(2 * C10, rel=0.02)
    assert result["modulus_low"] < result["modulus_high"]


def test_an_embedded_error_is_that_of_a_stiffness_that_is_random_at_every_measurement(folder):
    """Against the likelihood written down: y ~ N(C10 x, (s C x + noise)^2), C near C10, summed over a grid of all."""
    settings = TissueSettings(folder=str(folder), sets=("gel-axial",), protocols=("tests",), formulations=("embedded",))
    row = carry_out(settings, tasks_of(settings)[0])
    split = next(iter(PROTOCOLS["tests"](read_corpus(folder)[0].tests)))
    alone = tq.fit(split.fitted, discrepancy="none", noise_sd="proportional")
    assert row["half_width"] == pytest.approx(predicted(alone, split.predicted)["half_width"], rel=1e-9)

    generator = np.random.default_rng(8)
    stretch = np.linspace(1.02, 1.6, 60)
    x = 2 * (stretch - stretch**-2)
    y = (0.1 + 0.004 * generator.standard_normal(60)) * x + 2e-4 * generator.standard_normal(60)
    posterior = tq.fit(tq.Experiment("uniaxial", stretch, y), **RIVALS["embedded"])
    modulus, share, noise = np.linspace(0.097, 0.103, 201), np.geomspace(0.005, 0.5, 81), np.geomspace(1e-6, 0.01, 81)
    variance = (0.1 * share[:, None, None] * x + noise[:, None]) ** 2
    log_prior = (posterior.model.priors["noise_share"].log_density(share) + np.log(share))[:, None]
    log_prior = log_prior + posterior.model.priors["noise_sd"].log_density(noise) + np.log(noise)
    log_prior -= 0.5 * np.log(variance).sum(axis=-1)
    logs = -0.5 * np.einsum("mi,abi->mab", (y - modulus[:, None] * x) ** 2, 1 / variance) + log_prior
    weights = np.exp(logs - logs.max()).sum(axis=(1, 2))
    weights /= weights.sum()
    mean = weights @ modulus
    sd = np.sqrt(weights @ (modulus - mean) ** 2)
    c10 = posterior.marginals["C10"]
    assert c10.mean == pytest.approx(mean, abs=0.1 * sd)
    assert c10.sd == pytest.approx(sd, rel=0.1)
