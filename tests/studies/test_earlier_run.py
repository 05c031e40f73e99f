"""A run is gone on with: its posterior is the one that it saved."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest

import tissuq as tq
from tissuq.report.specimen import specimen_result
from tissuq.report.writer import write_result
from tissuq.studies.earlier_run import load_without_discrepancy, recipe_of
from tissuq.studies.specimen import SpecimenSettings, run_specimen

STRETCH = np.linspace(0.7, 1.6, 15)


@pytest.fixture
def run(written_run, tmp_path):
    """A copy of it that a test may damage."""
    return shutil.copytree(written_run, tmp_path / "run")


@pytest.fixture(scope="module")
def written_run(tmp_path_factory):
    """A run in kPa, with priors of parameters that only some of its discrepancies have."""
    tmp_path = tmp_path_factory.mktemp("earlier")
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
    write_result(specimen_result(run_specimen(settings)), folder, figures=False)
    source.unlink()
    return folder


@pytest.mark.parametrize("discrepancy", ["none", "constant", "auto"])
def test_the_posterior_of_a_run_is_that_which_was_saved(run, discrepancy, monkeypatch):
    monkeypatch.setattr("tissuq.posterior.solver.Solver.solve", lambda *_: pytest.fail("fitted again"))
    rows = {row["formulation"]: row for row in json.loads((run / "summary.json").read_text())}
    (run / "input" / "specimen.csv").unlink()
    found = tq.load(run, discrepancy)
    assert found.summary().loc["C10", "mean"] == rows[discrepancy]["C10_mean"]
    assert found.log_evidence == rows[discrepancy]["log_evidence"]
    assert found.model.experiment.stress_unit == "kPa"
    with pytest.deprecated_call():
        assert tq.load_run(run, discrepancy).log_evidence == found.log_evidence


def test_auto_is_taken_unless_another_is_named(run):
    assert tq.load(run).model.discrepancy.name == "auto"
    assert tq.load(run, tq.discrepancies()["constant"]()).model.discrepancy.name == "constant"
    assert tq.load(run / "posterior" / "none.nc").model.discrepancy.name == "none"
    with pytest.raises(tq.InputError, match="has no discrepancy 'gp': choose one of auto, constant, none"):
        tq.load(run, "gp")


def test_other_folders_are_refused(run, tmp_path):
    with pytest.raises(tq.InputError, match="there is no run folder"):
        tq.load(tmp_path / "none")
    with pytest.raises(tq.InputError, match="has no posterior of a material"):
        tq.load(tmp_path)
    recipe = run / "run.toml"
    recipe.write_text(recipe.read_text().replace("tissuq fit", "tissuq paper"))
    with pytest.raises(tq.InputError, match="is not a run of tissuq fit"):
        recipe_of(run)


def test_a_damaged_posterior_is_said(run):
    (run / "posterior" / "auto.nc").write_bytes(b"{")
    with pytest.raises(tq.InputError, match="is damaged or no posterior of tissuq"):
        tq.load(run)


def test_without_discrepancy_what_was_saved_is_taken_and_fitted_where_nothing_was(run, monkeypatch):
    saved = load_without_discrepancy(run).summary()
    (run / "posterior" / "none.nc").unlink()
    assert load_without_discrepancy(run).summary().loc["C10", "mean"] == pytest.approx(
        saved.loc["C10", "mean"], rel=1e-9
    )


def test_another_material_than_that_of_the_run_is_refused(run):
    with pytest.raises(tq.InputError, match="is of the material 'neo-hookean', not 'yeoh'"):
        tq.load(run, material=tq.materials()["yeoh"]())
    assert tq.load(run, material=tq.materials()["neo-hookean"]()).model.material.name == "neo-hookean"


@pytest.mark.parametrize("outside", ["../specimen.csv", "/etc/hostname", "link.csv"])
def test_a_run_that_names_a_file_outside_of_its_folder_is_refused(run, tmp_path, outside):
    (tmp_path / "specimen.csv").write_text((run / "input" / "specimen.csv").read_text())
    (run / "link.csv").symlink_to(tmp_path / "specimen.csv")
    (run / "posterior" / "none.nc").unlink()
    recipe = run / "run.toml"
    recipe.write_text(recipe.read_text().replace("input/specimen.csv", outside))
    with pytest.raises(tq.InputError, match=f"names the file '{outside}', which does not lie in the folder"):
        load_without_discrepancy(run)


def test_a_sum_has_its_name_in_the_literature_however_it_is_typed(tmp_path):
    stretch = np.linspace(1.02, 1.2, 8)
    symbols = [parameter.symbol for parameter in tq.mechanics.material_named("standard-reinforcing").parameters]
    truth = dict(zip(symbols, (0.02, 0.05, 0.6), strict=True))
    data = tq.simulate("standard-reinforcing", truth, np.column_stack([stretch, stretch]), mode="biaxial",
                       noise_sd=1e-4, seed=1)  # fmt: skip
    columns = np.column_stack([data.stretch, data.stress])
    header = "stretch_x,stretch_y,stress_x (MPa),stress_y (MPa)"
    np.savetxt(tmp_path / "sheet.csv", columns, delimiter=",", header=header, comments="")
    settings = SpecimenSettings(
        file=str(tmp_path / "sheet.csv"),
        mode="biaxial",
        material="neo-hookean+standard-fibres",
        discrepancies=("none",),
    )
    result = specimen_result(run_specimen(settings))
    assert result.title == "sheet: standard-reinforcing"
    (tmp_path / "run").mkdir()
    write_result(result, tmp_path / "run", figures=False)
    page = (tmp_path / "run" / "report.html").read_text(encoding="utf-8").partition("material = ")[0]
    assert "neo-hookean+standard-fibres" not in page
    for name in ("standard-reinforcing", "neo-hookean+standard-fibres"):
        assert tq.load(tmp_path / "run", material=name).model.material.name == "standard-reinforcing"
    with pytest.raises(tq.InputError, match="is of the material 'standard-reinforcing', and not of 'yeoh'"):
        tq.load(tmp_path / "run", material="yeoh")
