"""Which test next, after a run."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from tissuq.report.run_folder import run_folder
from tissuq.report.specimen import specimen_result
from tissuq.report.writer import write_result
from tissuq.studies.design import run_design
from tissuq.studies.run_settings import CandidateSettings, DesignSettings
from tissuq.studies.specimen import SpecimenSettings, run_specimen


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("design")
    stretch = np.linspace(0.8, 1.3, 12)
    data = tq.simulate("neo-hookean", {"C10": 0.5}, stretch, 0.02, seed=1)
    rows = [f"{a!r},{1000 * b!r}\n" for a, b in zip(data.stretch.tolist(), data.stress.tolist(), strict=True)]
    (folder / "specimen.csv").write_text("stretch,stress_kPa\n" + "".join(rows))
    settings = SpecimenSettings(file="specimen.csv", discrepancies=("none", "gp"), noise_sd=20.0)
    with run_folder(folder / "run", "fit") as place:
        write_result(specimen_result(run_specimen(settings, folder), folder), place, figures=False)
    return folder


def test_a_run_is_taken_up_and_tests_of_any_stretches_are_ranked(run):
    tests = ("planar 1.05:1.2 6", CandidateSettings(mode="uniaxial", stretch=(0.9, 0.8), name="two"))
    settings = DesignSettings(run="run", discrepancy="none", candidates=tests, targets=("C10", "modulus"))
    announced = []
    study = run_design(settings, run, announced.append)
    assert announced[0] == "loading the run"
    assert set(announced[1:]) == set(study.table["candidate"])
    own = study.table.set_index(["target", "candidate"])
    x = 2 * (np.linspace(0.8, 1.3, 12) - np.linspace(0.8, 1.3, 12) ** -2)
    z = 2 * (np.array([0.9, 0.8]) - np.array([0.9, 0.8]) ** -2)
    assert own.loc[("C10", "two"), "sd_after"] == pytest.approx(20 / np.sqrt(x @ x + z @ z), rel=1e-8)
    assert own.loc[("modulus", "two"), "sd_after"] == pytest.approx(40 / np.sqrt(x @ x + z @ z), rel=1e-8)
    assert (set(study.table["unit"]), study.specimen) == ({"kPa"}, "same")
    assert not study.warnings


def test_an_other_specimen_is_told(run):
    study = run_design(
        DesignSettings(run="run", discrepancy="none", candidates=("planar 1.05:1.2 6",), specimen="other"), run
    )
    assert study.error == 0.18
    assert any("differ by about 18 %" in text for text in study.explanations)


def test_what_was_not_fitted_is_refused(run):
    with pytest.raises(tq.InputError, match="several discrepancies"):
        run_design(DesignSettings(run="run"), run)
    with pytest.raises(tq.InputError, match="no run folder"):
        run_design(DesignSettings(run="walk"), run)
