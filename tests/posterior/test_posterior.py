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
    assert list(table.columns) == ["mean", "sd", "median", "hdi_low", "hdi_high"]
    assert (table["hdi_low"] < table["mean"]).all()
    assert (table["mean"] < table["hdi_high"]).all()


def test_an_amplitude_that_may_have_no_mean_has_a_median(posterior):
    heavy = tq.fit(DATA, discrepancy="auto", noise_sd=0.2).summary()
    assert heavy.loc[["c1", "c2"], ["mean", "sd"]].isna().to_numpy().all()
    assert (heavy.loc[["c1", "c2"], "median"] > 0).all()
    assert heavy.loc["C10"].notna().all()
    light = tq.fit(DATA, discrepancy="taylor", noise_sd=0.2, priors={"c1": tq.HalfNormal(1.0)}).summary()
    assert light.notna().to_numpy().all()
    assert posterior.summary().notna().to_numpy().all()


def test_the_median_halves_the_posterior():
    posterior = tq.fit(DATA, discrepancy="none", noise_sd=0.2)
    c10 = posterior.summary().loc["C10"]
    assert c10["median"] == pytest.approx(c10["mean"], abs=1e-4 * c10["sd"])  # normal


def test_the_file_holds_every_group_and_arviz_reads_it(posterior, tmp_path):
    posterior.save(tmp_path / "gp.nc")
    with xr.open_datatree(tmp_path / "gp.nc", engine="h5netcdf") as tree:
        groups = {"posterior", "posterior_predictive", "log_likelihood"}
        groups |= {"leave_one_out", "observed_data", "constant_data", "fit"}
        assert groups == set(tree.children)
        assert tree["posterior"]["C10"].dims == ("chain", "draw")
        assert tree["posterior_predictive"]["stress"].shape == (4, 1000, 14)
        np.testing.assert_array_equal(tree["observed_data"]["stress"], DATA.stress)
        np.testing.assert_array_equal(tree["constant_data"]["stretch"], STRETCH)
        assert tree["posterior"]["C10"].attrs["units"] == "MPa"
        assert tree.attrs["log_evidence"] == posterior.log_evidence
        assert tree.attrs["headline_median"] == posterior.summary().loc["C10", "median"]
        table = arviz_stats.summary(tree, ci_prob=0.95, ci_kind="hdi", round_to="none")
        assert table.loc["C10", "mean"] == pytest.approx(posterior.summary().loc["C10", "mean"], abs=0.02)
        assert np.isfinite(arviz_stats.loo(tree).elpd)


def test_independent_draws_have_the_effective_size_of_their_number(posterior):
    ess = arviz_stats.ess(posterior.data["posterior"].dataset)
    assert all(float(ess[symbol]) > 3200 for symbol in ("C10", "c", "psi"))


@pytest.mark.parametrize("method", ["exact", pytest.param("nuts", marks=pytest.mark.slow)])
def test_a_posterior_survives_pickling(method):
    before = tq.fit(DATA, discrepancy="constant", noise_sd=0.2, method=method)
    table = before.summary()
    assert pickle.loads(pickle.dumps(before)).summary().equals(table)


@pytest.mark.parametrize(
    ("law", "directions", "is_told"),
    [
        ("neo-hookean+standard-fibres:one@0", ("circumferential", "axial"), True),
        ("neo-hookean+standard-fibres:one@0", ("axial", "axial"), False),
        ("neo-hookean+standard-fibres:one@0", ("", "axial"), False),
        ("neo-hookean", ("circumferential", "axial"), False),
    ],
)
def test_fibres_beside_strips_of_several_directions_are_a_problem(law, directions, is_told):
    stretch = np.linspace(1.02, 1.4, 12)
    strips = [
        tq.Experiment("uniaxial", stretch, factor * (stretch - stretch**-2), direction=direction)
        for factor, direction in zip((1.0, 2.0), directions, strict=True)
    ]
    warnings = tq.fit(strips, material=law, discrepancy="none", noise_sd=0.05).warnings
    told = [warning for warning in warnings if "several directions of the tissue (" in warning]
    assert [(warning.code, warning.severity.name) for warning in told] == [("contradicting-tests", "PROBLEM")] * is_told


def test_sheets_of_which_both_axes_were_measured_may_have_names_of_protocols_beside_fibres():
    stretch = np.array([[1 + x, 1 + share * x] for share in (0.5, 1.0) for x in np.linspace(0.02, 0.3, 8)])
    stress = 0.1 * (stretch - 1 / (stretch * stretch.prod(axis=1, keepdims=True) ** 2))
    sheets = [
        tq.Experiment("biaxial", stretch[rows], stress[rows], direction=name)
        for name, rows in {"off-x": slice(8), "equi": slice(8, None)}.items()
    ]
    warnings = tq.fit(sheets, material="neo-hookean+standard-fibres@0", discrepancy="none", noise_sd=0.01).warnings
    assert not any("directions of the tissue" in warning for warning in warnings)
