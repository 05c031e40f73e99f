"""Campaigns: truths, resuming after a kill, any number of workers, and what the numbers mean."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from pydantic import ValidationError

import tissuq
from tissuq.errors import InputError
from tissuq.experiments.modes import loading_mode, loading_modes
from tissuq.mechanics import MooneyRivlin, Ogden2, Yeoh, engineering_stress
from tissuq.studies.coverage import PRESETS, CoverageSettings, campaign, preset, run_campaign, summarise
from tissuq.studies.coverage.campaign import RESULTS, carry_out, tasks_of
from tissuq.studies.coverage.truths import FAMILIES, draw_truth
from tissuq.studies.paper import FORMULATIONS

STRETCH = np.linspace(0.6, 2.2, 30)
DESIGN = {"low": 0.7, "high": 2.0, "points": 12, "noise_sd": 0.1}


def small(**changes):
    given = {"designs": [DESIGN], "families": ["yeoh", "gent"], "formulations": ["none", "yeoh"], "replicates": 3}
    return CoverageSettings.model_validate(given | changes)


@pytest.mark.parametrize("mode", sorted(loading_modes()))
@pytest.mark.parametrize("family", FAMILIES)
def test_c10_is_half_the_initial_shear_modulus(family, mode):
    truth, mode = draw_truth(family, (0, 1)), loading_mode(mode)
    step = 1e-5
    slope = np.diff(truth.stress(mode, np.array([1 - step, 1 + step])))[0] / (2 * step)
    per_modulus = {"uniaxial": 3, "equibiaxial": 6, "planar": 4}[mode.name]
    assert slope == pytest.approx(per_modulus * 2 * truth.C10, rel=1e-6)
    assert abs(truth.stress(mode, np.array([1.0]))[0]) < 1e-12


@pytest.mark.parametrize("mode", sorted(loading_modes()))
def test_families_that_the_library_has_are_the_librarys(mode):
    mode = loading_mode(mode)

    def best(material, nonlinear, stress):
        basis = engineering_stress(material, mode, STRETCH, np.hstack([np.eye(len(nonlinear[0])), nonlinear[1]])).T
        return np.abs(basis @ np.linalg.lstsq(basis, stress)[0] - stress).max()

    for family, material in (("mooney-rivlin", MooneyRivlin()), ("yeoh", Yeoh())):
        count = len(material.parameters)
        stress = draw_truth(family, (3, 1)).stress(mode, STRETCH)
        assert best(material, (np.eye(count)[0], np.zeros((count, 0))), stress) < 1e-10
    generator = np.random.default_rng((3, 1))
    generator.standard_normal()
    generator.uniform(0.2, 0.8)
    exponents = [generator.uniform(1, 5), -generator.uniform(1, 4)]
    stress = draw_truth("ogden-two", (3, 1)).stress(mode, STRETCH)
    assert best(Ogden2(), (np.zeros(2), np.tile(exponents, (2, 1))), stress) < 1e-10


def test_results_do_not_depend_on_workers(tmp_path):
    settings = small()
    contents = []
    for workers in (1, 2):
        folder = tmp_path / str(workers)
        folder.mkdir()
        run_campaign(settings, folder, workers=workers)
        contents.append((folder / RESULTS).read_bytes())
    assert contents[0] == contents[1]


def test_results_do_not_depend_on_a_dask_cluster_that_loses_a_worker(tmp_path):
    distributed = pytest.importorskip("distributed")
    settings = small(replicates=60)
    alone, together = tmp_path / "alone", tmp_path / "together"
    alone.mkdir()
    together.mkdir()
    run_campaign(settings, alone)
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        first = next(iter(cluster.workers.values()))
        killed = []

        def kill_once(text):
            if not killed:
                killed.append(os.kill(first.pid, signal.SIGKILL))

        run_campaign(settings, together, scheduler=cluster.scheduler_address, step=kill_once)
    assert killed
    assert (alone / RESULTS).read_bytes() == (together / RESULTS).read_bytes()


def test_a_campaign_that_is_killed_goes_on_and_repeats_nothing(tmp_path):
    config = tmp_path / "campaign.toml"
    config.write_text(
        'families = ["yeoh", "gent", "ogden"]\nformulations = ["none", "gp"]\nreplicates = 100\n'
        "designs = [{ low = 0.7, high = 2.0, points = 30, noise_sd = 0.1 }]\n"
    )
    folder, whole = tmp_path / "killed", tmp_path / "whole"
    command = [sys.executable, "-m", "tissuq", "study", "coverage", "--config", str(config)]
    process = subprocess.Popen([*command, "--out", str(folder)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    results = folder / RESULTS
    deadline = time.monotonic() + 120
    while time.monotonic() < deadline and not (results.exists() and results.read_bytes().count(b"\n") >= 2):
        time.sleep(0.01)
    process.kill()
    process.wait()
    before = results.read_bytes()
    done = before.count(b"\n")
    assert 2 <= done < 12, "it must be killed in the middle to test anything"
    results.write_bytes(before + b'{"key": "0-0-')  # as a kill in the middle of a line leaves it
    for target in (folder, whole):
        subprocess.run([*command, "--out", str(target)], check=True, capture_output=True)
    assert results.read_bytes() == (whole / RESULTS).read_bytes()
    keys = [json.loads(line)["key"] for line in results.read_text().splitlines()]
    assert len(keys) == len(set(keys)) == 12
    assert (folder / "report.html").exists()


def test_the_same_data_meet_every_formulation_and_others_every_family():
    settings = small(formulations=["none", "constant", "auto"], replicates=2)
    found = [carry_out(settings, task) for task in tasks_of(settings)]
    assert found[0]["truth"] == found[1]["truth"] == found[2]["truth"]
    assert found[0]["truth"] != found[3]["truth"]
    assert len({truth for each in found for truth in each["truth"]}) == 4


def test_a_formulation_may_be_an_average_of_the_papers_seven():
    settings = small(families=["yeoh"], formulations=["average-of-seven", "gp"], replicates=2)
    averaged, single = (carry_out(settings, task) for task in tasks_of(settings))
    assert averaged["truth"] == single["truth"]
    data = recorded_data(settings)
    for experiment, row, alone in zip(data, averaged["fits"], single["fits"], strict=True):
        fits = {name: tissuq.fit(experiment, discrepancy=name, noise_sd=0.1) for name in FORMULATIONS}
        expected = tissuq.average(fits).summary().loc["C10", ["hdi_low", "hdi_high", "mean", "sd"]]
        np.testing.assert_allclose(row, expected, rtol=2e-3)
        assert row != alone


def recorded_data(settings):
    """Return the data sets that a campaign of one task fits, caught on their way."""
    found = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(campaign, "marginals_of_c10", lambda name, data, noise_sd: found.extend(data) or [])
        carry_out(settings, tasks_of(settings)[0])
    return found


def test_the_summary_is_counted_by_hand():
    settings = small(families=["yeoh"], formulations=["none"], replicates=4)
    fits = [[0.9, 1.1, 1.0, 0.05], [1.2, 1.4, 1.3, 0.05], [0.5, 0.9, 0.7, 0.1], None]
    place = {"design": 0, "strength": 0, "family": 0, "formulation": 0}
    row = summarise(settings, [place | {"truth": [1.0] * 4, "oracle_sd": [0.05] * 4, "fits": fits}]).iloc[0]
    assert (row["fits"], row["failed"]) == (3, 1)
    assert row["coverage"] == pytest.approx(1 / 3)
    assert row["coverage_error"] == pytest.approx(np.sqrt(2 / 27))
    assert row["score"] == pytest.approx((0.2 + (0.2 + 40 * 0.2) + (0.4 + 40 * 0.1)) / 3)
    assert row["width"] == pytest.approx(0.2 / (2 * 1.959964 * 0.05), rel=1e-6)
    assert row["bias"] == pytest.approx(0.0, abs=1e-12)


def test_the_right_model_covers_as_often_as_it_says(tmp_path):
    found = run_campaign(small(families=["yeoh"], formulations=["yeoh"], replicates=400), tmp_path)
    row = summarise(small(families=["yeoh"], formulations=["yeoh"], replicates=400), found).iloc[0]
    chance = 4.3 * np.sqrt(0.95 * 0.05 / 400)  # two-sided 2e-5; S makes intervals a little wider than they need be
    assert 0.95 - chance < row["coverage"]


def test_auto_holds_where_the_paper_s_forms_do_not(tmp_path):
    # 120 materials; a share below 0.90 has a chance of 1 % when the true one is 0.95.
    settings = small(
        families=list(FAMILIES), formulations=["none", "gp", "auto"], replicates=10,
        designs=[{"low": 0.6, "high": 2.0, "points": 40, "noise_sd": 0.2}],
    )  # fmt: skip
    coverage = summarise(settings, run_campaign(settings, tmp_path)).set_index("formulation")["coverage"]
    assert coverage["auto"] > 0.90
    assert coverage["none"] < 0.6
    assert coverage["gp"] < 0.8


@pytest.mark.parametrize("name", PRESETS)
def test_presets_are_valid(name):
    assert CoverageSettings.model_validate(preset(name)).designs


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"families": ["rubber"]}, "no family 'rubber'"),
        ({"formulations": ["cubic"]}, "no discrepancy named 'cubic'"),
        ({"designs": [DESIGN | {"low": 3.0}]}, "must be less than high"),
        ({"designs": [DESIGN | {"mode": "torsion"}]}, "torsion"),
        ({"replicates": 0}, "greater than or equal to 1"),
        ({"replicates": 10**12}, "less than or equal to"),
        ({"formulations": ["none", "none"]}, "there twice"),
        ({"designs": [DESIGN | {"high": float("inf")}]}, "less than or equal to 10"),
        ({"designs": [DESIGN | {"noise_sd": float("inf")}]}, "finite"),
        ({"designs": [DESIGN | {"high": 8.0}]}, "Gent materials lock"),
        ({"strengths": [2.0]}, "less than or equal to 1"),
        ({"noise": "some"}, "'known' or 'unknown'"),
    ],
)
def test_wrong_settings_are_refused(wrong, words):
    with pytest.raises(ValidationError, match=words):
        small(**wrong)


def test_a_scheduler_that_does_not_answer_is_told(tmp_path):
    pytest.importorskip("distributed")
    with pytest.raises(InputError, match="no Dask scheduler answers"):
        run_campaign(small(), tmp_path, scheduler="tcp://127.0.0.1:1")
