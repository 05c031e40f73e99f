"""Draws from the priors, and the data to which they lead, against the closed form of their first two moments."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq

DRAWS = 800


def test_prior_predictive_moments_are_those_of_priors_process_and_noise():
    """Of C10 phi + c M + e: C10 uniform(0, 5), c half-normal(0.5), M of variance one, sd of e 0.5; fails with 1e-4."""
    stretch = np.linspace(0.5, 2.0, 7)
    data = tq.simulate("neo-hookean", {"C10": 1.2}, stretch, noise_sd=0.5, seed=1)
    priors = {"C10": tq.Uniform(0, 5), "c": tq.HalfNormal(0.5)}
    posterior = tq.fit(data, discrepancy="gp", noise_sd=0.5, priors=priors)
    tree = posterior.prior_predictive(DRAWS)
    phi = 2 * (stretch - stretch**-2)
    variance = 25 / 12 * phi**2 + 0.25 + 0.25
    drawn = tree["prior_predictive"]["stress"].to_numpy()[0]
    assert np.abs(drawn.mean(axis=0) - 2.5 * phi).max() < 5 * np.sqrt(variance.max() / DRAWS)
    np.testing.assert_allclose(drawn.var(axis=0), variance, rtol=5 * np.sqrt(4 / DRAWS))
    assert pytest.approx(float(tree["prior"]["C10"].mean()), abs=5 * np.sqrt(25 / 12 / DRAWS)) == 2.5
    joined = posterior.data.assign(tree.children)
    assert {"posterior", "prior", "prior_predictive", "observed_data"} <= set(joined.children)


def test_stresses_drawn_from_priors_are_in_the_unit_of_the_data():
    table = {"lambda": [0.8, 0.9, 1.1, 1.2, 1.3], "P [kPa]": [-3.81, -1.67, 1.37, 2.53, 3.54]}
    posterior = tq.fit(table, discrepancy="none", noise_sd="0.01 kPa", priors={"C10": tq.Uniform(0.001, 0.002)})
    tree = posterior.prior_predictive(20)
    assert tree["prior"]["C10"].attrs["units"] == tree["prior_predictive"]["stress"].attrs["units"] == "kPa"
    assert ((tree["prior"]["C10"] > 1.0) & (tree["prior"]["C10"] < 2.0)).all()


def test_noise_that_follows_the_data_has_no_prior_predictive():
    table = {"lambda": [0.8, 0.9, 1.1, 1.2, 1.3], "P [kPa]": [-3.81, -1.67, 1.37, 2.53, 3.54]}
    posterior = tq.fit(table, discrepancy="none", noise="proportional")
    with pytest.raises(tq.ModelError, match="depends on the data"):
        posterior.prior_predictive()
