"""Every prior is a normalised density, and SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import integrate, stats

from tissuq import (
    Exponential,
    Flat,
    HalfCauchy,
    HalfNormal,
    InputError,
    LogNormal,
    LogUniform,
    ModelError,
    Normal,
    Uniform,
    fit,
    simulate,
)
from tissuq.mechanics.stress import differentiator
from tissuq.parameters.priors import Prior, prior_from
from tissuq.registry import variants

CASES = [
    (Uniform(-2, 3), stats.uniform(-2, 5)),
    (Normal(1.5, 0.7), stats.norm(1.5, 0.7)),
    (Normal(1.5, 0.7, low=0.0), stats.truncnorm(-1.5 / 0.7, np.inf, 1.5, 0.7)),
    (Normal(1.5, 0.7, low=1.0, high=2.0), stats.truncnorm(-0.5 / 0.7, 0.5 / 0.7, 1.5, 0.7)),
    (HalfNormal(0.4), stats.halfnorm(0, 0.4)),
    (HalfCauchy(0.3), stats.halfcauchy(0, 0.3)),
    (Exponential(2.5), stats.expon(0, 2.5)),
    (LogNormal(0.8, 0.6), stats.lognorm(0.6, 0, 0.8)),
    (LogUniform(0.2, 5.0), stats.loguniform(0.2, 5.0)),
]
EVERY = pytest.mark.parametrize(("prior", "law"), CASES, ids=[str(prior) for prior, _ in CASES])
PROBABILITIES = np.array([0.01, 0.2, 0.5, 0.9, 0.999])


def test_every_distribution_is_among_the_cases():
    assert {type(prior) for prior, _ in CASES} | {Flat} == set(variants(Prior).values())


@pytest.mark.parametrize("flat", [Flat(), Flat(0.0), Flat(-1.0, 2.0)], ids=str)
def test_a_flat_prior_has_density_one_and_no_quantiles(flat):
    assert flat.log_density(np.array([0.1, 1.9])) == pytest.approx([0.0, 0.0])
    assert flat.gaussian == (0.0, 0.0, 0.0)
    assert flat.within((0.5, 1.0)).support == (0.5, 1.0)
    assert flat.scaled(1000.0).support == tuple(1000.0 * end for end in flat.support)
    assert prior_from(flat.as_dict()) == flat
    with pytest.raises(InputError, match="improper"):
        flat.quantile(0.5)


@EVERY
def test_a_gaussian_form_is_the_density_within_the_support(prior, law):
    if prior.gaussian is None:
        assert not isinstance(prior, Normal | Uniform)
        return
    mean, precision, log_constant = prior.gaussian
    values = law.ppf(PROBABILITIES)
    found = log_constant - 0.5 * precision * (values - mean) ** 2
    np.testing.assert_allclose(found, law.logpdf(values), rtol=1e-10, atol=1e-12)


@EVERY
def test_density_and_quantiles_are_scipys(prior, law):
    values = law.ppf(PROBABILITIES)
    np.testing.assert_allclose(prior.quantile(PROBABILITIES), values, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(prior.log_density(values), law.logpdf(values), rtol=1e-10, atol=1e-12)
    assert prior.support == pytest.approx(law.support())


@EVERY
def test_the_density_integrates_to_one(prior, law):
    low, high = prior.support
    total, _ = integrate.quad(lambda x: float(np.exp(prior.log_density(x))), low, high)
    assert total == pytest.approx(1, abs=1e-6)


@EVERY
def test_a_change_of_unit_keeps_probabilities(prior, law):
    scaled = prior.scaled(1000.0)
    np.testing.assert_allclose(scaled.quantile(PROBABILITIES), 1000 * law.ppf(PROBABILITIES), rtol=1e-9)


@EVERY
def test_the_plain_form_gives_the_prior_back(prior, law):
    assert prior_from(prior.as_dict()) == prior


@EVERY
def test_jax_sees_the_same_density(prior, law):
    jnp = differentiator().numpy
    value = law.ppf(0.3)
    assert float(prior.log_density(jnp.asarray(value))) == pytest.approx(law.logpdf(value), rel=1e-10)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Uniform(1, 1), "low must be less"),
        (lambda: Flat(1, 1), "low must be less"),
        (lambda: Normal(0, -1), "sd must be positive"),
        (lambda: Normal(0, 1, low=2, high=1), "low must be less"),
        (lambda: HalfNormal(float("nan")), "must be a finite number"),
        (lambda: Uniform(0, float("inf")), "must be a finite number"),
        (lambda: LogNormal(-1, 1), "must be positive"),
        (lambda: LogUniform(0, 1), "low must be positive"),
        (lambda: LogUniform(2, 1), "low must be less"),
        (lambda: prior_from({"distribution": "unifrom", "low": 0, "high": 1}), "Did you mean 'uniform'"),
        (lambda: prior_from({"distribution": "uniform", "low": 0}), "needs low and high"),
        (
            lambda: prior_from({"distribution": "normal", "mean": 0, "sd": 1, "scale": 2}),
            "may have low and high",
        ),
    ],
)
def test_a_bad_prior_is_refused_in_words(make, words):
    with pytest.raises(InputError, match=words):
        make()


@EVERY
def test_no_prior_has_a_problem(prior, law):
    assert not prior.problem


@pytest.mark.parametrize(
    "members",
    [
        {"log_density": lambda self, value: np.log(1.1) - value},
        {"log_density": lambda self, value: np.nan * value},
        {"quantile": lambda self, probability: -2 * np.log1p(-probability)},
    ],
    ids=["ten percent too much", "no number", "of another law"],
)
def test_a_density_that_is_not_that_of_the_quantiles_is_refused(members):
    name = property(lambda self: "wrong")  # that of an object is not kept
    prior = type("Wrong", (Exponential,), {**members, "name": name})(1.0)
    data = simulate("yeoh", {"C10": 0.5, "C20": 0.1, "C30": 0.1}, np.linspace(1, 1.5, 16), noise_sd=0.01, seed=1)
    with pytest.raises(ModelError, match=r"C10: the prior wrong.* cannot be used: its density is"):
        fit(data, material="yeoh", discrepancy="none", noise_sd=0.01, priors={"C10": prior})
