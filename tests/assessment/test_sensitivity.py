"""Sensitivity to priors: against fits with other priors, closed forms, and ArviZ."""

from __future__ import annotations

import arviz_stats
import numpy as np
import pytest
import xarray as xr
from scipy.stats import norm

import tissuq as tq
from tissuq.assessment import known_evidence_changes, sensitivity
from tissuq.assessment.sensitivity import power_scaling
from tissuq.prediction.densities import joint_log_likelihood

STRETCH = np.linspace(0.7, 1.9, 14)
DATA = tq.simulate("yeoh", {"C10": 0.5, "C20": 0.1, "C30": 0.0}, STRETCH, noise_sd=0.05, seed=1)
UNIT = 2 * (STRETCH - STRETCH**-2)
POWERS = (0.8, 1.25)


@pytest.fixture
def wide_powers(monkeypatch):
    """Powers so far from one that refitting tells the difference."""
    monkeypatch.setattr(sensitivity, "POWERS", POWERS)


def speed(draws, cdf, others):
    """Return the mean distance of cumulative distributions to others, for each doubling of the power."""
    grid = np.linspace(draws.min(), draws.max(), 20_001)
    found = []
    for alpha, other in zip(POWERS, others, strict=True):
        distances = []
        for p, q in ((cdf(grid), other(grid)), (1 - cdf(grid), 1 - other(grid))):
            p, q = (np.clip(each, 1e-12, 1) for each in (p, q))
            between = 0.5 * (p + q)
            divergence = np.trapezoid(p * np.log2(p / between) + q * np.log2(q / between), grid)
            distances.append(np.sqrt(divergence / np.trapezoid(p + q, grid)))
        found.append(max(distances) / abs(np.log2(alpha)))
    return np.mean(found)


@pytest.mark.usefixtures("wide_powers")
def test_powers_of_a_normal_prior_and_likelihood_are_other_variances():
    # N(m, s^2)^alpha is N(m, s^2 / alpha), and so is the likelihood with the noise.
    posterior = tq.fit(DATA, discrepancy="none", noise_sd=0.05, priors={"C10": tq.Normal(0.65, 0.01)})

    def cdf(prior_power, likelihood_power):
        precision = prior_power / 0.01**2 + likelihood_power * UNIT @ UNIT / 0.05**2
        pull = prior_power * 0.65 / 0.01**2 + likelihood_power * UNIT @ DATA.stress / 0.05**2
        return norm(pull / precision, precision**-0.5).cdf

    draws, found = posterior.solution.draws["C10"], power_scaling(posterior.solution)
    # 4000 draws tell a cumulative distribution to some hundredths of its change.
    assert found.prior == pytest.approx(speed(draws, cdf(1, 1), [cdf(a, 1) for a in POWERS]), rel=0.06)
    assert found.likelihood == pytest.approx(speed(draws, cdf(1, 1), [cdf(1, a) for a in POWERS]), rel=0.06)


@pytest.mark.usefixtures("wide_powers")
@pytest.mark.parametrize("name", ["taylor", "taylor+zero-modulus", "constant"])
def test_the_power_of_an_amplitudes_prior_is_a_fit_with_it(name):
    # A half-normal density to the power alpha is half-normal with its sd over sqrt(alpha).
    scales = dict.fromkeys(("c1", "c2", "S"), 0.05)

    def fitted(alpha):
        own = {"taylor": ["c1"], "constant": ["S"]}.get(name, ["c1", "c2"])
        priors = {symbol: tq.HalfNormal(scales[symbol] / np.sqrt(alpha)) for symbol in own}
        return tq.fit(DATA, discrepancy=name, noise_sd=0.05, priors=priors).solution

    def cdf(solution):
        marginal = solution.marginals["C10"]
        return lambda values: np.interp(values, marginal.points, marginal.cumulative, left=0.0, right=1.0)

    solution = fitted(1.0)
    expected = speed(solution.draws["C10"], cdf(solution), [cdf(fitted(alpha)) for alpha in POWERS])
    # Over seeds of the 4000 draws the number has an sd of 0.003.
    assert power_scaling(solution).prior == pytest.approx(expected, abs=0.012)


def test_the_numbers_are_those_of_arviz():
    priors = {"C10": tq.Normal(0.65, 0.01)}
    solution = tq.fit(DATA, discrepancy="constant", noise_sd=0.05, priors=priors).solution
    place, sample = ("chain", "draw"), {"chain": np.arange(4), "draw": np.arange(1000)}
    groups = {
        "posterior": {"C10": solution.draws["C10"]},
        "log_prior": {"C10": norm(0.65, 0.01).logpdf(solution.draws["C10"])},
        "log_likelihood": {"stress": joint_log_likelihood(solution)},
    }
    tree = xr.DataTree.from_dict(
        {
            name: xr.Dataset({key: (place, value) for key, value in each.items()}, sample)
            for name, each in groups.items()
        }
    )
    found = power_scaling(solution)
    # ArviZ smooths the weights.
    assert found.prior == pytest.approx(float(arviz_stats.psense(tree, group="prior")["C10"]), rel=0.03)
    assert found.likelihood == pytest.approx(float(arviz_stats.psense(tree, group="likelihood")["C10"]), rel=0.03)


def test_a_missing_amplitude_does_not_bring_in_the_unit_of_stress():
    found = []
    for factor in (1.0, 1000.0):
        data = tq.Experiment("uniaxial", STRETCH, factor * DATA.stress)
        found.append(power_scaling(tq.fit(data, discrepancy="auto-sharp", noise_sd=0.05 * factor).solution))
    assert found[0].prior == pytest.approx(found[1].prior, rel=0.02)


@pytest.mark.parametrize(
    ("prior", "likelihood", "words"),
    [(0.01, 0.1, "is from the data"), (0.2, 0.01, "priors influence"), (0.2, 0.3, "contradict"), (0.0, 0.0, "neither")],
)
def test_the_diagnosis_is_a_sentence(prior, likelihood, words):
    text = sensitivity.PowerScaling(prior, likelihood).sentence("C10")
    assert words in text
    assert f"prior {prior:.2f}, likelihood {likelihood:.2f}" in text


def test_changes_of_the_evidence_are_those_of_fits_with_other_priors():
    posterior = tq.fit(DATA, discrepancy="yeoh", noise_sd=0.05)
    found, priors = posterior.assess().evidence_changes, posterior.model.priors
    boxes = {symbol: priors[symbol].scaled(4.0) for symbol in ("C10", "C20", "C30")}
    others = {"quarter": {"S": priors["S"].scaled(0.25)}, "fourfold": {"S": priors["S"].scaled(4.0)}, "boxes": boxes}
    for name, changed in others.items():
        other = tq.fit(DATA, discrepancy="yeoh", noise_sd=0.05, priors=priors | changed)
        assert found[name] == pytest.approx(other.log_evidence - posterior.log_evidence, abs=1e-4)


def test_of_a_box_that_cuts_nothing_is_claimed():
    cut = tq.fit(DATA, discrepancy="none", noise_sd=0.05, priors={"C10": tq.Uniform(0.0, 0.68)})
    assert "boxes" not in known_evidence_changes(cut.solution)
    data = tq.Experiment("uniaxial", STRETCH, 0.002 * UNIT)  # cut at zero, where a wider box would end, too
    natural = tq.fit(data, discrepancy="none", noise_sd=0.5, priors={"C10": tq.Uniform(0.0, 10.0)})
    expected = {"boxes": -np.log(4), "quarter": 0.0, "fourfold": 0.0}
    assert known_evidence_changes(natural.solution) == pytest.approx(expected)


def test_without_an_evidence_it_has_no_changes():
    flat = tq.fit(DATA, discrepancy="none", noise_sd=0.05, priors={"C10": tq.Flat()})
    assert flat.assess().evidence_changes == {}
