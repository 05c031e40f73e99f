"""Fits side by side: against refitting without each measurement, and what must be refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from scipy.stats import norm

import gallery
import tissuq as tq
from tissuq.assessment.evidence import warnings_of_evidence
from tissuq.posterior.warnings import warnings_about
from tissuq.prediction.moments import stress_moments, variance_of_noise
from tissuq.report.comparison import comparison_warnings

STRETCH = np.linspace(0.7, 1.9, 14)
DATA = tq.simulate("yeoh", {"C10": 0.5, "C20": 0.1, "C30": 0.0}, STRETCH, noise_sd=0.05, seed=1)
NAMES = ("none", "yeoh", "taylor", "gp")


@pytest.fixture(scope="module")
def fits():
    return {name: tq.fit(DATA, discrepancy=name, noise_sd=0.05) for name in NAMES}


def test_evidence_and_probability_are_those_of_the_fits(fits):
    table = tq.compare(fits)
    for name, posterior in fits.items():
        assert table.loc[name, "log_evidence"] == pytest.approx(posterior.log_evidence)
    assert table["probability"].sum() == pytest.approx(1)
    assert table["log_bayes_factor"].iloc[0] == 0
    assert table["log_evidence"].is_monotonic_decreasing
    assert table["stacking"].sum() == pytest.approx(1, abs=1e-6)
    assert table.index[-1] == "none"


@pytest.mark.parametrize("name", NAMES)
def test_the_factor_ranges_over_other_priors_in_both_fits(fits, name):
    table = tq.compare(fits)
    best, changes = table.index[0], [f"evidence_change_{change}" for change in ("quarter", "fourfold", "boxes")]
    factor = table.loc[name, "log_bayes_factor"]
    others = [factor, *(factor + table.loc[name, changes] - table.loc[best, changes])]
    assert table.loc[name, "log_bayes_factor_low"] == pytest.approx(min(others))
    assert table.loc[name, "log_bayes_factor_high"] == pytest.approx(max(others))
    own = fits[name].assess().evidence_changes
    assert list(table.loc[name, changes]) == pytest.approx([own["quarter"], own["fourfold"], own["boxes"]])
    assert table.loc[name, ["hdi_low", "hdi_high"]].tolist() == fits[name].summary().loc["C10"].tolist()[-2:]


@pytest.mark.slow
def test_a_sampled_fit_without_evidence_is_compared_by_prediction(fits):
    sampled = tq.fit(DATA, discrepancy="constant", noise_sd=0.05, method="nuts")
    table = tq.compare({"sampled": sampled, "taylor": fits["taylor"]})
    assert table.loc["sampled", ["log_evidence", "log_bayes_factor_low"]].isna().all()
    assert table.loc["taylor", "probability"] == 1
    assert table.loc["sampled", "elpd_difference"] > 10


@pytest.mark.slow
def test_a_fit_without_evidence_is_compared_by_prediction_with_one_of_the_same_data():
    sampled = gallery.sampled_jointly()
    exact = tq.fit(sampled.model.experiment, discrepancy="none", noise_sd=0.05)
    table = tq.compare({"sampled": sampled, "exact": exact})
    assert table.loc["sampled", ["log_evidence", "log_bayes_factor_low"]].isna().all()
    assert table.loc["exact", "probability"] == 1
    assert table["elpd_difference"].max() < 0.2  # PSIS of the draws: hundredths for each of six measurements


@pytest.mark.parametrize("name", ["yeoh", "taylor"])
def test_leave_one_out_is_that_of_refitting(fits, name):
    density = 0.0
    for out in range(len(STRETCH)):
        rest = np.delete(np.arange(len(STRETCH)), out)
        data = tq.Experiment("uniaxial", STRETCH[rest], DATA.stress[rest])
        solution = tq.fit(data, discrepancy=name, noise_sd=0.05, priors=fits[name].model.priors).solution
        parts = solution.mixture
        states = solution.model.experiment.states_at(np.array([STRETCH[out]]))
        mean, variance = stress_moments(solution.model, parts, states)
        variance = variance + variance_of_noise(solution.model, parts, solution.model.relative_noise(states), mean)
        each = norm.pdf(DATA.stress[out], mean[:, 0], np.sqrt(variance[:, 0]))
        density += float(np.log(parts.weights @ each))
    assert tq.compare({name: fits[name], "none": fits["none"]}).loc[name, "elpd"] == pytest.approx(density, abs=0.7)


def test_saved_posteriors_compare_like_those_in_memory(fits, tmp_path):
    trees = {}
    for name in ("none", "yeoh"):
        fits[name].save(tmp_path / f"{name}.nc")
        trees[name] = xr.open_datatree(tmp_path / f"{name}.nc", engine="h5netcdf").load()
    first, second = tq.compare(trees), tq.compare({name: fits[name] for name in trees})
    assert list(first["parameter"]) == list(second["parameter"]) == ["C10", "C10"]
    refitted = ["evidence_change_quarter", "evidence_change_fourfold", "log_bayes_factor_low", "log_bayes_factor_high"]
    numbers = second.columns.drop(["is_rough", "parameter", "intervals_of"])
    np.testing.assert_allclose(first[numbers.drop(refitted)], second[numbers.drop(refitted)], rtol=1e-10)
    assert first.loc["yeoh", refitted].isna().all()  # a file holds no other fits
    assert (first.loc["none", refitted[:2]] == 0).all()  # has nothing to scale


def test_fits_of_a_list_are_named_by_material_and_discrepancy(fits, tmp_path):
    fits["yeoh"].save(tmp_path / "yeoh.nc")
    saved = xr.open_datatree(tmp_path / "yeoh.nc", engine="h5netcdf").load()
    listed = tq.compare([fits["none"], saved, fits["none"]])
    assert set(listed.index) == {"neo-hookean, none", "neo-hookean, yeoh", "neo-hookean, none (3)"}
    by_name = tq.compare({"none": fits["none"], "yeoh": fits["yeoh"]})
    assert listed.loc["neo-hookean, none", "elpd"] == by_name.loc["none", "elpd"]
    weights = tq.average([fits["none"], fits["taylor"]]).weights
    assert list(weights) == ["neo-hookean, none", "neo-hookean, taylor"]
    for wrong in (None, "yeoh", [1, 2], {"none": 1}):
        with pytest.raises(tq.InputError, match="fits are needed, such as"):
            tq.compare(wrong)


def test_fits_of_other_data_and_single_fits_are_refused(fits):
    with pytest.raises(tq.InputError, match="two fits or more"):
        tq.compare({"none": fits["none"]})
    other = tq.simulate("neo-hookean", {"C10": 0.5}, STRETCH, noise_sd=0.05, seed=2)
    with pytest.raises(tq.InputError, match="different measurements"):
        tq.compare({"none": fits["none"], "other": tq.fit(other, discrepancy="none", noise_sd=0.05)})
    planar = tq.fit(tq.Experiment("planar", STRETCH, DATA.stress), discrepancy="none", noise_sd=0.05)
    with pytest.raises(tq.InputError, match="loading modes"):
        tq.compare({"none": fits["none"], "planar": planar})
    with pytest.raises(tq.InputError, match="no fit of measured stresses"):
        tq.compare({"none": fits["none"], "foreign": xr.DataTree()})


@pytest.mark.parametrize(
    ("group", "variable"),
    [("observed_data", "stress"), ("constant_data", "stretch"), ("leave_one_out", "log_density")],
)
def test_a_tree_that_lacks_what_is_compared_is_refused(fits, group, variable):
    changed = fits["yeoh"].data.copy()
    changed[group] = xr.DataTree(changed[group].to_dataset().drop_vars(variable))
    with pytest.raises(tq.InputError, match="'changed' is no fit of measured stresses"):
        tq.compare({"none": fits["none"], "changed": changed})


def test_an_evidence_that_is_no_number_is_refused(fits):
    changed = fits["yeoh"].data.copy()
    changed.attrs["log_evidence"] = "high"
    with pytest.raises(tq.InputError, match="the attribute 'log_evidence' of 'changed' is no number, but 'high'"):
        tq.compare({"none": fits["none"], "changed": changed})


@pytest.mark.parametrize(
    ("evidences", "named"),
    [
        ({"a": (-3.0, 0.2), "b": (-3.25, 0.1), "c": (-9.0, 0.1)}, "whether a or b has"),
        ({"a": (-3.0, 0.2), "b": (-3.25, 0.1), "c": (-3.2, 0.1)}, "whether a or b or c has"),
        ({"a": (-3.0, 0.2), "b": (-3.5, 0.1)}, ""),  # differ by more
        ({"a": (-3.0, 0.04), "b": (-3.01, 0.04)}, ""),  # are known well, and hardly differ
        ({"a": (-3.0, np.nan), "b": (-3.5, np.nan), "c": (None, None)}, ""),
        ({"a": (-3.0, np.inf), "b": (-8.0, 0.1)}, "whether a or b has"),
        ({"a": (np.nan, np.nan)}, ""),
    ],
)
def test_errors_of_integration_are_told_where_they_order_fits(evidences, named):
    found = warnings_of_evidence(evidences)
    assert not any("inf" in text for text in found)
    assert len(found) == bool(named)
    assert not named or (found[0].startswith(named) and found[0].code == "inaccurate-integral")


def test_a_comparison_of_saved_fits_tells_of_their_errors(fits):
    trees = {name: fits[name].data.copy() for name in ("yeoh", "taylor")}
    assert not any("integration" in text for text in comparison_warnings(tq.compare(trees)))
    apart = abs(fits["yeoh"].log_evidence - fits["taylor"].log_evidence)
    trees["taylor"].attrs["log_evidence_error"] = apart + 0.2
    assert any("the error of the integration is" in text for text in comparison_warnings(tq.compare(trees)))


@pytest.mark.parametrize(("error", "is_told"), [(0.3, False), (1.0, True), (np.inf, True)])
def test_errors_of_the_evidence_are_a_warning_of_one_fit_where_its_intervals_suffer(fits, error, is_told):
    solution = replace(fits["taylor"].solution, log_evidence_error=error)
    warnings = warnings_about(solution, {}, np.ones(len(DATA), dtype=bool))
    told = [warning for warning in warnings if warning.code == "inaccurate-integral"]
    assert bool(told) == is_told


@pytest.mark.parametrize(("discrepancy", "is_advised"), [("constant", True), ("taylor", False)])
def test_sampling_is_advised_where_it_is_not_refused(discrepancy, is_advised):
    """Beside an energy it is."""
    solution = replace(tq.fit(DATA, discrepancy=discrepancy).solution, log_evidence_error=1.0, diagnostics=None)
    (told,) = (
        warning
        for warning in warnings_about(solution, {}, np.ones(len(DATA), dtype=bool))
        if warning.code == "inaccurate-integral"
    )
    assert ("method='nuts'" in told) == is_advised


def test_the_same_measurements_in_two_units_are_compared(fits):
    rounded = [float(f"{stress * 1e3:.4g}") for stress in DATA.stress]
    in_kpa = tq.Experiment("uniaxial", STRETCH, rounded, stress_unit="kPa")
    table = tq.compare({"MPa": fits["yeoh"], "kPa": tq.fit(in_kpa, discrepancy="yeoh", noise_sd=0.05)})
    assert table["probability"].to_numpy(float) == pytest.approx([0.5, 0.5], abs=0.01)
    assert table.columns.name == "stresses in MPa"
    of_kpa = tq.compare({"kPa": tq.fit(in_kpa, discrepancy="yeoh", noise_sd=0.05), "MPa": fits["yeoh"]})
    assert of_kpa.columns.name == "stresses in kPa"  # as of the summary, of the first
    assert of_kpa["median"].to_numpy(float) == pytest.approx(1e3 * table["median"].to_numpy(float), rel=1e-3)
    other = np.array(rounded) / 1e3
    other[5] += 0.001 * other.max()
    changed = tq.fit(tq.Experiment("uniaxial", STRETCH, other), discrepancy="none", noise_sd=0.05)
    with pytest.raises(tq.InputError, match="different measurements"):
        tq.compare({"none": fits["none"], "changed": changed})


def test_fits_of_different_materials_are_compared_by_their_initial_shear_modulus(fits):
    mooney = tq.fit(DATA, material="mooney-rivlin", discrepancy="none", noise_sd=0.05, tolerances="tissue")
    table = tq.compare({"none": fits["none"], "mooney": mooney})
    assert set(table["parameter"]) == {"initial shear modulus"}
    stiffness = mooney.initial_shear_modulus
    wanted = [float(stiffness.quantile(0.5)), *stiffness.hdi()]
    np.testing.assert_allclose(table.loc["mooney", ["median", "hdi_low", "hdi_high"]].to_numpy(float), wanted)
    assert table.loc["none", "median"] == pytest.approx(2 * fits["none"].marginals["C10"].quantile(0.5), rel=1e-6)
    (warning,) = (text for text in comparison_warnings(table) if "different things" in text)
    assert "of none they are of this specimen as tested" in warning
