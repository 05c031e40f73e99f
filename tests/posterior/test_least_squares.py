"""A law by itself: least squares, against searches over all parameters at once with stresses written out here."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares as over_all

import tissuq as tq
from tissuq.mechanics import material_named
from tissuq.mechanics.material import materials
from tissuq.model.discrepancy import discrepancy_named
from tissuq.model.noise import noise_named
from tissuq.model.statistical_model import StatisticalModel
from tissuq.posterior.least_squares import least_squares

BRAIN = tq.Experiment.of(tq.datasets.load("brain-cortex-uniaxial"))
STRETCH, STRESS = BRAIN.tests[0].stretch, BRAIN.measured


def priors_of(law):
    noise = noise_named("unknown")
    return StatisticalModel(BRAIN, material_named(law), discrepancy_named("none"), noise, {}, tq.Tolerances()).priors


def fitted(law):
    return least_squares(BRAIN, material_named(law), priors_of(law))


def ogden(values):
    """The uniaxial stress of Ogden's energy, sum of mu / alpha^2 (l1^alpha + l2^alpha + l3^alpha - 3) times 2."""
    moduli, exponents = np.split(values, 2)
    terms = [
        2 * mu / alpha * (STRETCH ** (alpha - 1) - STRETCH ** (-alpha / 2 - 1))
        for mu, alpha in zip(moduli, exponents, strict=True)
    ]
    return sum(terms)


@pytest.mark.parametrize(("law", "exponents"), [("ogden-1", [0.5, 3, -8, 20]), ("ogden-2", [2, 8, 20, 35])])
def test_no_search_over_all_parameters_comes_nearer(law, exponents):
    found = fitted(law)
    np.testing.assert_allclose(ogden(found.values), found.stress(BRAIN.states), rtol=1e-9, atol=1e-15)
    terms = len(found.values) // 2
    scale, costs = np.abs(STRESS).max(), []
    supports = [prior.support for prior in priors_of(law).values()][: 2 * terms]
    low, high = np.array(supports).T / np.repeat([scale, 1.0], terms)[:, None].T
    for alpha in exponents:
        for sign in (-1, 1):
            start = np.concatenate([np.full(terms, 0.5), alpha * np.where(np.arange(terms), -0.6, 1.0) * sign])
            start = np.clip(start, low + 1e-3, high - 1e-3)
            result = over_all(lambda v: (ogden(v * [*[scale] * terms, *[1] * terms]) - STRESS) / scale, start,
                              bounds=(low, high))  # fmt: skip
            costs.append(2 * result.cost * scale**2)
    own = ((STRESS - found.stress(BRAIN.states)) ** 2).sum()
    assert own <= min(costs) * 1.02
    assert found.nrmse == pytest.approx(np.sqrt(own / (STRESS**2).sum()))
    assert found.r_squared == pytest.approx(1 - own / ((STRESS - STRESS.mean()) ** 2).sum())


@pytest.mark.parametrize("law", [kind().name for kind in materials().values() if kind().is_isotropic])
def test_every_law_comes_as_near_as_from_a_thousand_random_parameters(law):
    found, material, generator = fitted(law), material_named(law), np.random.default_rng(0)
    priors = priors_of(law)
    own = ((STRESS - found.stress(BRAIN.states)) ** 2).sum()
    bent = [priors[p.symbol] for p in material.parameters if not p.is_linear]
    for _ in range(1000 if bent else 1):
        values = [float(prior.quantile(generator.random())) for prior in bent]
        basis = tq.mechanics.stress_basis(material, BRAIN.states, values)
        if np.isfinite(basis).all():
            inside = np.clip(np.linalg.lstsq(basis, STRESS, rcond=None)[0], *np.array(
                [priors[p.symbol].support for p in material.parameters if p.is_linear]).T)  # fmt: skip
            assert own <= ((STRESS - basis @ inside) ** 2).sum() * (1 + 1e-6)


@pytest.mark.parametrize("factor", [1e-4, 1e3])
def test_the_unit_of_the_stress_does_not_matter(factor):
    stretch = np.linspace(0.8, 1.3, 11)
    data = tq.simulate("ogden-1", {"mu1": 0.4 * factor, "alpha1": 3.0}, stretch)
    posterior = tq.fit(data, material="ogden-1", discrepancy="none", noise_sd=0.01 * factor)
    found = least_squares(data, posterior.model.material, posterior.model.priors)
    np.testing.assert_allclose(found.values, [0.4 * factor, 3.0], rtol=1e-6)


def test_exponents_whose_stress_is_beyond_all_numbers_are_left_out():
    priors = {"mu": tq.Uniform(1e-3, 0.1), "b": tq.Uniform(0, 800)}
    found = least_squares(BRAIN, material_named("demiray"), priors)
    assert 0 < found.values[1] < 100
    assert found.nrmse < 1


def test_equal_stresses_have_no_variance_to_explain():
    data = tq.Experiment("uniaxial", [1.2, 1.2], [0.01, 0.01])
    assert np.isnan(least_squares(data, material_named("neo-hookean"), {"C10": tq.Uniform(0, 1)}).r_squared)
