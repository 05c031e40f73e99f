"""BlackJAX as its documentation shows: window adaptation, then NUTS, four chains under vmap; bounds by a logit."""

from __future__ import annotations

import blackjax
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.linalg import solve_triangular

from peers.outcome import Chains, fit_all
from peers.problem import NOISE_SD, STRESS, STRETCH, Problem

jax.config.update("jax_enable_x64", True)


def log_likelihood(problem: Problem, point: jax.Array) -> jax.Array:
    """Return log p(stress | parameters), up to a constant."""
    k = len(problem.linear)
    residual = STRESS - problem.design @ point[:k]
    if problem.name == "gp":
        c, psi = point[k], point[k + 1]
        process = c**2 * jnp.exp(-0.5 * ((STRETCH[:, None] - STRETCH) / psi) ** 2)
        root = jnp.linalg.cholesky(process + NOISE_SD**2 * jnp.eye(len(STRETCH)))
        whitened = solve_triangular(root, residual, lower=True)
        return -0.5 * whitened @ whitened - jnp.log(jnp.diag(root)).sum()
    variance = NOISE_SD**2 + (point[k] ** 2 if "S" in problem.symbols else 0.0)
    return -0.5 * (residual @ residual / variance + len(STRESS) * jnp.log(variance))


def fit(problem: Problem) -> Chains:
    """Return the posterior of one formulation."""
    lower, upper = problem.bounds

    def to_box(line: jax.Array) -> jax.Array:
        return lower + (upper - lower) * jax.nn.sigmoid(line)

    def log_density(line: jax.Array) -> jax.Array:
        log_slope = jax.nn.log_sigmoid(line) + jax.nn.log_sigmoid(-line)
        return log_likelihood(problem, to_box(line)) + log_slope.sum()

    def chain(key: jax.Array) -> jax.Array:
        start_key, warmup_key, sample_key = jax.random.split(key, 3)
        start = jax.random.uniform(start_key, lower.shape, minval=-2.0, maxval=2.0)
        warmup = blackjax.window_adaptation(blackjax.nuts, log_density)
        (state, parameters), _ = warmup.run(warmup_key, start, num_steps=1000)
        step = blackjax.nuts(log_density, **parameters).step

        def draw(state: blackjax.mcmc.hmc.HMCState, key: jax.Array) -> tuple[blackjax.mcmc.hmc.HMCState, jax.Array]:
            state, _ = step(key, state)
            return state, to_box(state.position)

        return jax.lax.scan(draw, state, jax.random.split(sample_key, 1000))[1]

    return Chains(np.asarray(jax.jit(jax.vmap(chain))(jax.random.split(jax.random.key(1), 4))))


if __name__ == "__main__":
    fit_all(fit)
