"""The posterior as ArviZ and pandas see it."""

from __future__ import annotations

import pickle

import arviz_stats
import numpy as np
import pytest
import xarray as xr

import tissuq as tq

STRETCH = np.linspace(0.6, 2.2, 14)
DATA = tq.simulate("yeoh", {"C10": 1.2, "C20": -0.057, "C30": 0.004}, STRETCH, 0.2, seed=6)


@pytest.fixture(scope="module")
def posterior():
    return tq.fit(DATA, discrepancy="gp", noise_sd=0.2, seed=3)


def test_the_summary_has_a_row_for_each_parameter(posterior):
    table = posterior.summary()
    assert list(table.index) == ["C10", "c", "psi"]
    assert list(table.columns) == ["mean", "sd", "hdi_low", "hdi_high"]
    assert (table["hdi_low"] < table["mean"]).all()
    assert (table["mean"] < table["hdi_high"]).all()


def test_the_file_holds_every_group_and_arviz_reads_it(posterior, tmp_path):
    posterior.save(tmp_path / "gp.nc")
    with xr.open_datatree(tmp_path / "gp.nc", engine="h5netcdf") as tree:
        groups = {"posterior", "posterior_predictive", "log_likelihood", "observed_data", "constant_data"}
        assert groups == set(tree.children)
        assert tree["posterior"]["C10"].dims == ("chain", "draw")
        assert tree["posterior_predictive"]["stress"].shape == (4, 1000, 14)
        np.testing.assert_array_equal(tree["observed_data"]["stress"], DATA.stress)
        np.testing.assert_array_equal(tree["constant_data"]["stretch"], STRETCH)
        assert tree["posterior"]["C10"].attrs["units"] == "MPa"
        assert tree.attrs["log_evidence"] == posterior.log_evidence
        table = arviz_stats.summary(tree, ci_prob=0.95, ci_kind="hdi", round_to="none")
        assert table.loc["C10", "mean"] == pytest.approx(posterior.summary().loc["C10", "mean"], abs=0.02)
        assert np.isfinite(arviz_stats.loo(tree).elpd)


def test_independent_draws_have_the_effective_size_of_their_number(posterior):
    ess = arviz_stats.ess(posterior.data["posterior"].dataset)
    assert all(float(ess[symbol]) > 3200 for symbol in ("C10", "c", "psi"))


@pytest.mark.parametrize("method", ["exact", "nuts"])
def test_a_posterior_survives_pickling(method):
    before = tq.fit(DATA, discrepancy="constant", noise_sd=0.2, method=method)
    table = before.summary()
    assert pickle.loads(pickle.dumps(before)).summary().equals(table)
