"""Tables and labelled arrays are in the unit of the measurements, and say so; densities are those of data in MPa."""

from __future__ import annotations

import arviz_stats
import numpy as np
import pytest
import xarray as xr

import tissuq as tq

STRETCH = [0.8, 0.9, 1.1, 1.2, 1.3]
STRESS = [-3.81, -1.67, 1.37, 2.53, 3.54]  # kPa
OPTIONS = {"discrepancy": "constant", "noise_sd": 2e-5}


@pytest.fixture(scope="module")
def posterior():
    return tq.fit({"stretch": STRETCH, "stress": STRESS}, unit="kPa", **OPTIONS)


@pytest.fixture(scope="module")
def in_mpa():
    return tq.fit(tq.Experiment("uniaxial", STRETCH, 1e-3 * np.array(STRESS)), **OPTIONS)


def test_a_summary_is_in_the_unit_of_the_measurements_or_the_one_asked_for(posterior, in_mpa):
    table, mean = posterior.summary(), posterior.marginals["C10"].mean
    assert table.columns.name == "stresses in kPa"
    assert table.loc["C10", "mean"] == 1e3 * mean
    assert posterior.summary(unit="Pa").loc["C10", "mean"] == pytest.approx(1e6 * mean, rel=1e-12)
    assert posterior.summary(unit="MPa").equals(in_mpa.summary())
    with pytest.raises(tq.InputError, match="'mm' is not a unit of stress"):
        posterior.summary(unit="mm")


@pytest.mark.slow
def test_what_is_no_stress_stays_as_it_is():
    found = tq.fit({"stretch": STRETCH, "stress": STRESS}, unit="kPa", material="ogden-1", discrepancy="none")
    whole, other = found.summary(), found.summary(unit="MPa")
    assert whole.loc["alpha1"].equals(other.loc["alpha1"])
    np.testing.assert_allclose(whole.loc["mu1"], 1e3 * other.loc["mu1"], rtol=1e-12)


@pytest.mark.parametrize("stress_type", ["engineering", "cauchy"])
def test_predictions_and_scores_are_in_the_unit_of_the_measurements(posterior, in_mpa, stress_type):
    options = {"stress_type": stress_type}
    band, other = posterior.predict([0.9, 1.2], **options), in_mpa.predict([0.9, 1.2], **options)
    assert (band.columns.name, other.columns.name) == ("stresses in kPa", "stresses in MPa")
    np.testing.assert_allclose(band[["median", "low", "high"]], 1e3 * other[["median", "low", "high"]], rtol=1e-12)
    assert band["stretch"].tolist() == [0.9, 1.2]
    test = tq.Experiment("uniaxial", [1.15, 1.25], [1.9, 3.1], stress_unit="kPa")
    scores, in_pa = posterior.scores(test, **options), posterior.scores(test, unit="Pa", **options)
    assert scores["error"].equals(in_pa["error"])
    for name in ("crps", "interval_score"):
        np.testing.assert_allclose(in_pa[name], 1e3 * scores[name], rtol=1e-12)
        np.testing.assert_allclose(scores[name], 1e3 * in_mpa.scores(test, **options)[name], rtol=1e-12)


def test_every_labelled_stress_says_its_unit_and_is_in_it(posterior, tmp_path):
    tree, other = posterior.data, posterior.data_in("MPa")
    posterior.save(tmp_path / "fit.nc")
    with xr.open_datatree(tmp_path / "fit.nc", engine="h5netcdf") as saved:
        for group, name in (("posterior", "C10"), ("posterior", "S"), ("posterior_predictive", "stress"),
                            ("observed_data", "stress")):  # fmt: skip
            for one in (tree[group][name], saved[group][name]):
                assert (one.attrs["units"], other[group][name].attrs["units"]) == ("kPa", "MPa")
                np.testing.assert_allclose(one, 1e3 * other[group][name], rtol=1e-12)
    assert tree["observed_data"]["stress"].values == pytest.approx(STRESS, rel=1e-12)
    for group, name in (("log_likelihood", "stress"), ("leave_one_out", "log_density")):
        assert tree[group][name].equals(other[group][name])
        assert tree[group][name].attrs["density_of"] == "stresses in MPa"
    mean = float(arviz_stats.summary(tree, round_to="none").loc["C10", "mean"])
    assert mean == pytest.approx(1e3 * posterior.marginals["C10"].mean, rel=0.02)


def test_fits_in_two_units_are_compared_and_averages_are_in_that_of_the_measurements(posterior):
    without = tq.fit(posterior.model.experiment, discrepancy="none", noise_sd=2e-5)
    table = tq.compare({"constant": posterior.data_in("MPa"), "none": without.data})
    again = tq.compare({"constant": posterior.data, "none": without.data})
    assert table["elpd"].equals(again["elpd"])
    average = tq.average({"constant": posterior, "none": without})
    assert average.summary().loc["C10", "mean"] == pytest.approx(1e3 * average.marginals["C10"].mean, rel=1e-12)
    medians = [fit.predict([1.2])["median"][0] for fit in (posterior, without, average)]
    assert min(medians[:2]) <= medians[2] <= max(medians[:2])


def test_a_comparison_says_its_unit_and_takes_another(posterior, in_mpa):
    fits = {"one": posterior, "two": posterior}
    table, in_kpa = tq.compare(fits, unit="MPa"), tq.compare(fits)
    assert (table.columns.name, in_kpa.columns.name) == ("stresses in MPa", "stresses in kPa")
    for name in ("median", "hdi_low", "hdi_high"):
        np.testing.assert_allclose(in_kpa[name], 1000 * table[name])
    np.testing.assert_allclose(table["log_evidence"], in_kpa["log_evidence"])


def test_priors_of_labelled_arrays_say_in_what_they_are(posterior):
    attributes = posterior.data.attrs
    assert attributes["prior_C10"] == f"{posterior.model.priors['C10']}, in MPa"


def test_notebooks_show_tables_with_units(posterior):
    page = posterior._repr_html_()
    assert "stresses in kPa" in page
    assert page.startswith("<p>&lt;Posterior of C10")
    assert f"<td>{posterior.summary().loc['C10', 'median']:.4g}</td>" in page
    data = posterior.model.experiment.labelled(name="<b>")
    shown = data._repr_html_()
    assert "<b>" not in shown
    assert "stress to [kPa]" in shown
    assert "<td>3.54</td>" in shown
    assert repr(data) == "<Experiment '<b>': uniaxial, 5 measured stresses in kPa>"
