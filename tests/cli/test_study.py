"""Campaigns from the command line: their folders, their presets, how they go on."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from tissuq.cli.progress import _left
from tissuq.validation.coverage import PRESETS

from .conftest import rows_of

CAMPAIGN = """
designs = [{ low = 0.7, high = 2.0, points = 9, noise_sd = 0.1 }]
formulations = ["none"]
families = ["yeoh", "gent"]
replicates = 2
"""


def test_the_help_names_every_preset(cli):
    said = " ".join(cli("study", "coverage", "--help").out.split()).replace("│ ", "").replace("- ", "-")
    assert all(name in said for name in (*PRESETS, "sbc"))


@pytest.mark.slow
def test_the_settings_in_a_campaigns_folder_repeat_it(done, here):
    (here / "small.toml").write_text(CAMPAIGN + "scale = [0.01, 10.0]\npredictive = true\nunseen = ['planar']\n")
    done("study", "coverage", "--config", "small.toml")
    first = here / "runs" / "coverage-small"
    done("study", "coverage", "--config", first / "run.toml", "--out", "again")
    for name in ("tasks.jsonl", "summary.csv", "families.csv", "unseen.csv", "run.toml"):
        assert (first / name).read_bytes() == (here / "again" / name).read_bytes()


@pytest.mark.slow
def test_sbc_writes_its_table_and_page_and_goes_on(done, here):
    (here / "quick.toml").write_text('formulations = ["none", "zero-modulus"]\nreplicates = 20\n')
    arguments = ("study", "sbc", "--config", "quick.toml", "--noise", "known", "--out", "out")
    done(*arguments)
    tasks = (here / "out" / "tasks.jsonl").read_bytes()
    rows = rows_of(here / "out" / "ranks.csv")
    assert [(row["formulation"], row["parameter"]) for row in rows] == [
        ("none", "C10"), ("zero-modulus", "C10"), ("zero-modulus", "c1"),
    ]  # fmt: skip
    page = (here / "out" / "report.html").read_text(encoding="utf-8")
    assert all(f"{float(row['spread']):.3f}" in page for row in rows)
    (here / "out" / "tasks.jsonl").write_bytes(tasks[:100])
    said = done(*arguments)
    assert "zero-modulus" in said.out
    assert (here / "out" / "tasks.jsonl").read_bytes() == tasks


@pytest.mark.parametrize(("seconds", "text"), [(None, ""), (65.0, "1:05 left, "), (7260.0, "2 h 01 min left, ")])
def test_the_time_left_is_told_in_minutes_or_hours(seconds, text):
    assert _left(seconds) == text


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")
def test_a_campaign_shows_progress_and_time_left_on_a_terminal(here):
    import pty

    (here / "small.toml").write_text(CAMPAIGN)
    reader, terminal = pty.openpty()
    environment = os.environ | {"TERM": "xterm", "COLUMNS": "120"}
    command = [sys.executable, "-m", "tissuq", "study", "coverage", "--config", "small.toml"]
    subprocess.run(command, stderr=terminal, stdout=subprocess.DEVNULL, check=True, env=environment)
    shown = os.read(reader, 100_000).decode("utf-8", "replace")
    assert "2/2" in shown
    assert "left, none" in shown


@pytest.mark.slow
def test_real_tests_are_predicted_from_others_and_the_page_tells_how_well(cli, done, here):
    arguments = ("study", "tissues", "--dataset", "brain-cortex", "--formulation", "none", "--protocol", "tests")
    said = done(*arguments, "--out", "out")
    assert "Do predictions of real tests hold?" in said.out
    page = (here / "out" / "report.html").read_text(encoding="utf-8")
    assert "Each test from the others of its set" in page
    assert {"summary.csv", "predictions.csv", "run.toml"} <= {file.name for file in (here / "out").iterdir()}
    done("study", "tissues", "--config", here / "out" / "run.toml", "--out", "out")
    refused = cli(*arguments, "--protocol", "test", "--out", "other")
    assert refused.status == 2
    assert "there is no protocol 'test'; choose from tests, modes, specimens, ends, halves" in " ".join(
        refused.err.split()
    )
    refused = cli(*arguments, "--tolerance", "stres=10%", "--out", "other")
    assert refused.status == 2
    assert "'stres=10%' is not a tolerance" in refused.err
    assert not (here / "other").exists()


@pytest.mark.finite_elements
def test_structures_write_bands_and_go_on(done, here):
    small = ["--replicates", 2, "--truth", "gent", "--structure", "bar", "--draws", 8, "--full-runs", 4, "--steps", 1]
    arguments = ("study", "structures", *small, "--measurements", 8, "--out", "out")
    done(*arguments)
    tasks = (here / "out" / "tasks.jsonl").read_bytes()
    rows = rows_of(here / "out" / "bands.csv")
    assert [(row["truth"], row["tests"], row["structure"]) for row in rows] == [
        ("gent", "1", "bar"),
        ("gent", "2", "bar"),
    ]
    for row in rows:
        assert float(row["default_low"]) < float(row["default_mean"]) < float(row["default_high"])
        assert float(row["force_N"]) == pytest.approx(float(row["oracle_mean"]), rel=0.5)
    (summary,) = rows_of(here / "out" / "summary.csv")
    inside = [float(row["default_low"]) <= float(row["force_N"]) <= float(row["default_high"]) for row in rows]
    assert float(summary["inside"]) == pytest.approx(sum(inside) / 2)
    (here / "out" / "tasks.jsonl").write_bytes(tasks[: tasks.index(b"\n") + 20])
    done(*arguments)
    assert (here / "out" / "tasks.jsonl").read_bytes() == tasks


@pytest.mark.parametrize(
    ("more", "words"),
    [(["--truth", "iron"], "no law 'iron'"), (["--structure", "bridge"], "no structure 'bridge'"),
     (["--mode", "biaxial"], "several controls"), (["--mode", "simple-shear-normal"], "or stresses"),
     (["--estimand", "all"], "estimand")],
)  # fmt: skip
def test_structures_that_are_not_known_are_refused(refused, here, more, words):
    refused([words], "study", "structures", *more)
    assert not (here / "runs").exists()
