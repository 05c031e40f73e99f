"""A run is gone on with: its posterior is that of the run."""

from __future__ import annotations

import json

import numpy as np
import pytest

import tissuq as tq
from tissuq.report.specimen import write_specimen_run
from tissuq.studies.specimen import SpecimenSettings, run_specimen

STRETCH = np.linspace(0.7, 1.6, 15)


@pytest.fixture
def run(tmp_path):
    """A run in kPa, with priors of parameters that only some of its discrepancies have."""
    data = tq.simulate("yeoh", {"C10": 0.5, "C20": 0.06, "C30": 0.01}, STRETCH, noise_sd=0.02, seed=3)
    source = tmp_path / "specimen.csv"
    rows = [f"{at!r},{1000 * stress!r}\n" for at, stress in zip(STRETCH.tolist(), data.stress.tolist(), strict=True)]
    source.write_text("stretch,stress_kPa\n" + "".join(rows))
    priors = {"S": {"distribution": "half-normal", "sd": 50}, "C10": {"distribution": "uniform", "low": 0, "high": 900}}
    settings = SpecimenSettings(
        file=str(source), discrepancies=("none", "constant", "auto"), noise_sd=20, priors=priors
    )
    folder = tmp_path / "run"
    folder.mkdir()
    write_specimen_run(run_specimen(settings), [source], folder, figures=False)
    source.unlink()
    return folder


@pytest.mark.parametrize("discrepancy", ["none", "constant", "auto"])
def test_the_posterior_of_a_run_is_fitted_again_from_its_own_files(run, discrepancy):
    rows = {row["formulation"]: row for row in json.loads((run / "summary.json").read_text())}
    found = tq.load_run(run, discrepancy)
    assert found.summary().loc["C10", "mean"] == pytest.approx(rows[discrepancy]["C10_mean"], rel=1e-9)
    assert found.log_evidence == pytest.approx(rows[discrepancy]["log_evidence"], rel=1e-9)
    assert found.model.experiment.stress_unit == "kPa"


def test_auto_is_taken_unless_another_is_named(run):
    assert tq.load_run(run).model.discrepancy.name == "auto"
    with pytest.raises(tq.InputError, match="has no discrepancy 'gp': choose one of none, constant, auto"):
        tq.load_run(run, "gp")


def test_a_run_whose_files_have_changed_warns(run):
    copy = run / "input" / "specimen.csv"
    copy.write_text(copy.read_text().replace("stress_kPa", "stress_kPa", 1).replace("0.7,", "0.71,", 1))
    with pytest.warns(UserWarning, match="have changed since"):
        tq.load_run(run)


def test_other_folders_are_refused(run, tmp_path):
    with pytest.raises(tq.InputError, match="there is no run folder"):
        tq.load_run(tmp_path / "none")
    with pytest.raises(tq.InputError, match="not a complete run"):
        tq.load_run(tmp_path)
    recipe = run / "run.toml"
    recipe.write_text(recipe.read_text().replace("tissuq fit", "tissuq paper"))
    with pytest.raises(tq.InputError, match="is not one of tissuq fit"):
        tq.load_run(run)


@pytest.mark.parametrize(("content", "words"), [("{", "is damaged"), ("[3]", "is damaged"), ("[]", "has no rows")])
def test_a_damaged_summary_is_said(run, content, words):
    (run / "summary.json").write_text(content)
    with pytest.raises(tq.InputError, match=words):
        tq.load_run(run)


def test_another_material_than_that_of_the_run_is_refused(run):
    with pytest.raises(tq.InputError, match="is of the material 'neo-hookean', not 'yeoh'"):
        tq.load_run(run, material=tq.materials()["yeoh"]())
    assert tq.load_run(run, material=tq.materials()["neo-hookean"]()).model.material.name == "neo-hookean"
