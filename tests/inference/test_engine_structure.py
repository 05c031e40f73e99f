"""What a model tells of its own structure, and priors that change it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

import tissuq as tq
from against import BOXES, assert_agrees, both, neo_hookean, parts
from dense import Linear
from tissuq.inference.enumerators import adaptive_cells
from tissuq.inference.reduction import _Fit, _of_independent_errors, _reduced
from tissuq.model.statistical_model import StatisticalModel

STRETCH = np.linspace(0.7, 2.0, 12)
DATA = tq.simulate("yeoh", {"C10": 1.2, "C20": -0.057, "C30": 0.004}, STRETCH, 0.1, seed=4)
OGDEN = {name: tq.materials()[name]() for name in ("ogden-1", "ogden-2", "ogden-3")}


def model(material="neo-hookean", discrepancy="none", noise=0.1, **priors):
    return tq.fit(DATA, material=material, discrepancy=discrepancy, noise=noise, priors=priors).model


@pytest.mark.parametrize("terms", [1, 2, 3])
def test_an_ogden_material_is_linear_in_its_moduli_and_bends_with_its_exponents(terms):
    kind = tq.discrepancies()["gp"]()
    found = StatisticalModel(DATA, OGDEN[f"ogden-{terms}"], kind, "unknown")
    moduli, exponents = (tuple(f"{name}{i}" for i in range(1, terms + 1)) for name in ("mu", "alpha"))
    assert found.linear == found.column_symbols == moduli
    assert found.bent_symbols == exponents
    assert found.structure == (*exponents, "psi")
    assert found.nonlinear == (*exponents, "psi", "c", "noise_sd")
    assert set(found.symbols) == {*found.linear, *found.nonlinear}


@pytest.mark.parametrize(
    ("prior", "is_linear"),
    [
        (tq.Uniform(0, 9), True),
        (tq.Flat(), True),
        (tq.Normal(1, 1), True),
        (tq.LogNormal(1, 1), False),
        (tq.HalfNormal(1), True),
        (tq.HalfCauchy(1), False),
        (tq.Exponential(1), False),
    ],
)
def test_a_linear_parameter_stays_so_under_flat_uniform_and_gaussian_priors_only(prior, is_linear):
    found = model(discrepancy="constant", C10=prior)
    assert ("C10" in found.linear) == is_linear
    assert found.nonlinear == (("S",) if is_linear else ("C10", "S"))
    assert found.structure == ()
    assert found.column_symbols == ("C10", "m0")


def test_default_structures_of_noise_and_discrepancy():
    assert model(noise="proportional").nonlinear == ("noise_sd", "noise_share")
    assert model(discrepancy="gp").nonlinear == ("psi", "c")
    assert model(discrepancy="yeoh", noise="unknown").linear == ("C10", "C20", "C30")


@pytest.mark.parametrize("discrepancy", ["none", "constant", "yeoh", "gp"])
def test_a_flat_prior_is_the_limit_of_a_wide_uniform_one_and_gives_no_evidence(discrepancy):
    linear, _ = parts(discrepancy)
    flat = {symbol: tq.Flat() for symbol in linear}
    wide = {symbol: tq.Uniform(0 if symbol == "C10" else -1e7, 1e7) for symbol in linear}
    first, second = (tq.fit(DATA, discrepancy=discrepancy, noise_sd=0.1, priors=priors) for priors in (flat, wide))
    assert first.log_evidence is None
    assert first.log_evidence_error is None
    np.testing.assert_allclose(first.summary(), second.summary(), rtol=1e-6, atol=1e-7)


def test_one_flat_prior_among_proper_ones_is_enough_to_have_no_evidence():
    found = tq.fit(DATA, discrepancy="constant", noise_sd=0.1, priors={"C10": tq.Flat()})
    assert found.log_evidence is None
    assert found.solution.route == "exact"


def test_a_flat_prior_keeps_the_bound_of_its_parameter():
    stress = -0.05 * neo_hookean(STRETCH)
    found = tq.fit(
        tq.Experiment("uniaxial", STRETCH, stress), discrepancy="none", noise_sd=0.1, priors={"C10": tq.Flat()}
    )
    x = neo_hookean(STRETCH)
    sd = 0.1 / np.sqrt(x @ x)
    low = 0.05 / sd
    mean = -0.05 + sd * norm.pdf(low) / norm.sf(low)
    assert found.summary().loc["C10", "mean"] == pytest.approx(mean, rel=1e-6)


def test_normal_priors_beside_an_unknown_amplitude():
    linear, axes = parts("mooney-rivlin")
    linear = {"C10": Linear(0.0, np.inf, 1.0, 0.5), "C01": Linear(-np.inf, np.inf, 0.2, 0.3)}
    posterior, problem = both("mooney-rivlin", STRETCH, DATA.stress, 0.1, linear, axes)
    assert_agrees(posterior, problem)
    assert posterior.model.linear == ("C10", "C01")


def test_normal_and_uniform_priors_side_by_side():
    linear, axes = parts("yeoh")
    linear |= {"C20": Linear(-np.inf, np.inf, 0.0, 0.05), "C30": Linear(*BOXES["C30"])}
    posterior, problem = both("yeoh", STRETCH, DATA.stress, 0.1, linear, axes)
    assert_agrees(posterior, problem)


def test_a_log_normal_prior_of_a_modulus_is_integrated_beside_the_others():
    # Written out: C10 on a grid, m0 in closed form for each C10 and S, by hand.
    prior = tq.LogNormal(1.0, 0.5)
    priors = {"C10": prior, "m0": tq.Normal(0.0, 0.5), "S": tq.Uniform(0, 2)}
    posterior = tq.fit(DATA, discrepancy="constant", noise_sd=0.1, priors=priors)
    c10, S = np.linspace(0.2, 3.5, 801), np.linspace(1e-6, 2, 801)
    residual = DATA.stress - c10[:, None] * neo_hookean(STRETCH)
    white = 0.01 + S**2
    total, n = residual.sum(axis=1), len(STRETCH)
    squares = (residual**2).sum(axis=1)
    # Covariance white I + 0.25 11': its inverse and determinant by Sherman and Morrison.
    exponent = squares[:, None] / white - 0.25 * total[:, None] ** 2 / (white * (white + 0.25 * n))
    log_density = -0.5 * exponent - 0.5 * (n - 1) * np.log(white) - 0.5 * np.log(white + 0.25 * n)
    log_density -= 0.5 * n * np.log(2 * np.pi) + np.log(2)
    log_density += (-0.5 * (np.log(c10) / 0.5) ** 2 - np.log(c10 * 0.5 * np.sqrt(2 * np.pi)))[:, None]
    top = log_density.max()
    weights = np.exp(log_density - top)
    each = np.trapezoid(weights, S, axis=1)
    whole = np.trapezoid(each, c10)
    assert posterior.log_evidence == pytest.approx(top + np.log(whole), abs=1e-4)
    mean = np.trapezoid(each * c10, c10) / whole
    sd = np.sqrt(np.trapezoid(each * (c10 - mean) ** 2, c10) / whole)
    assert posterior.solution.marginals["C10"].mean == pytest.approx(mean, abs=1e-3 * sd)
    assert posterior.solution.marginals["C10"].sd == pytest.approx(sd, rel=1e-3)
    assert posterior.model.nonlinear == ("C10", "S")


@pytest.mark.slow
@pytest.mark.parametrize("terms", [1, 2])
def test_designs_are_reduced_at_once_as_one_by_one(terms):
    found = model(OGDEN[f"ogden-{terms}"], noise="unknown")
    other = StatisticalModel(
        tq.Experiment("uniaxial", STRETCH, 1.1 * DATA.stress), found.material, found.discrepancy, "unknown"
    )
    settings = np.random.default_rng(0).uniform(1, 6, (5, terms))
    designs = np.array([found.rows(found.basis(found.states, setting)) for setting in settings])
    at_once = _of_independent_errors([found, other], designs)
    for reduction, design in zip(at_once, designs, strict=True):
        (fit,) = _Fit.of([found, other], design[None])
        (alone,) = _reduced(found, fit, [()])  # each level of the stress by itself
        np.testing.assert_allclose(reduction.squares[:, 0], alone.squares.sum(axis=1), rtol=1e-9, atol=1e-12)
        assert reduction.counts.sum() == alone.counts.sum()
        for name in ("inverse", "log_size", "centre"):
            np.testing.assert_allclose(getattr(reduction, name), getattr(alone, name), rtol=1e-9, atol=1e-12)
        for each, squares in zip((found, other), reduction.squares[:, 0], strict=True):
            rest = each.stress - design @ np.linalg.lstsq(design, each.stress)[0]
            assert squares[-1] == pytest.approx(rest @ rest, rel=1e-9)


@pytest.mark.slow
def test_of_models_with_several_noises_one_is_checked_for_missed_mass(monkeypatch):
    looked: list[int] = []
    monkeypatch.setattr(adaptive_cells, "has_missed", lambda *_: bool(looked.append(1)))
    posterior = tq.fit(DATA, material="ogden-2", discrepancy="none", tolerances={"stress": 0.05})
    assert "the noise integrated over" in posterior.solution.reason
    assert len(looked) <= 2  # of the noise grid, and of the fit from which its errors are estimated
