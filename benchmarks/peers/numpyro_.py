"""NumPyro: NUTS with its defaults, four chains in parallel."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpyro
from numpyro import distributions as dist
from numpyro.infer import MCMC, NUTS

from peers.outcome import Chains, fit_all
from peers.problem import BOUNDS, NOISE_SD, STRESS, STRETCH, Problem

numpyro.enable_x64()
numpyro.set_host_device_count(4)

import jax  # noqa: E402  (after the number of devices is set)
import jax.numpy as jnp  # noqa: E402


def model(problem: Problem) -> None:
    """State one formulation."""
    values = {symbol: numpyro.sample(symbol, dist.Uniform(*BOUNDS[symbol])) for symbol in problem.symbols}
    mean = problem.design @ jnp.stack([values[symbol] for symbol in problem.linear])
    if problem.name == "gp":
        squares = (STRETCH[:, None] - STRETCH) ** 2
        process = values["c"] ** 2 * jnp.exp(-0.5 * squares / values["psi"] ** 2)
        covariance = process + NOISE_SD**2 * jnp.eye(len(STRETCH))
        numpyro.sample("stress", dist.MultivariateNormal(mean, covariance), obs=STRESS)
    else:
        sd = jnp.sqrt(NOISE_SD**2 + values.get("S", 0.0) ** 2)
        numpyro.sample("stress", dist.Normal(mean, sd), obs=STRESS)


def sample(stated: Callable[..., None], symbols: tuple[str, ...], *arguments: object, seed: int = 1) -> Chains:
    """Return the draws of a model."""
    mcmc = MCMC(
        NUTS(stated), num_warmup=1000, num_samples=1000, num_chains=4, chain_method="parallel", progress_bar=False
    )
    mcmc.run(jax.random.key(seed), *arguments)
    drawn = mcmc.get_samples(group_by_chain=True)
    return Chains(np.stack([drawn[symbol] for symbol in symbols], axis=-1))


def fit(problem: Problem) -> Chains:
    """Return the posterior of one formulation."""
    return sample(model, problem.symbols, problem)


if __name__ == "__main__":
    fit_all(fit)
