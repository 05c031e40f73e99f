"""How sequential Monte Carlo moves its particles: sweeps of trajectories and jumps that leave a density unchanged."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any, NamedTuple

import blackjax
import jax
import jax.numpy as jnp
import numpy as np
from blackjax.mcmc.random_walk import RWState

from tissuq.arrays import FloatArray
from tissuq.inference.coordinates import Box

MAX_CORRELATION_WITH_START = 0.1
"""Correlation with the start of a mutation, in any direction, below which the particles count as moved.

With an unknown noise, 0.3 halves the sweeps and doubles the error of the log evidence.
"""
MAX_GROWTH = 1.1
"""Growth of the squared distance from the start, over the second half of the sweeps, that counts as none."""
TARGET_ACCEPTANCE = 0.8
MAX_STEP_SDS = 1.5
"""Leapfrog steps, in standard deviations, stay below this; the dynamics of a normal density break up at two."""
TRAJECTORY_SDS = 2.0
"""Longest trajectory in standard deviations: steps are jittered, so that the mean is near a quarter period."""
MAX_LEAPFROGS = 64
MIN_JUMP_SHARE = 0.1
"""Shortest jump along the difference of two particles, as a share of the best length for a normal density."""


class Mutation:
    """Moves the particles by sweeps until they have forgotten their start; keeps the step size between calls."""

    def __init__(
        self, program: Program, data: tuple[Any, ...], max_sweeps: int, seed: int, generator: np.random.Generator
    ) -> None:
        self.program = program
        self.data = data
        self.max_sweeps = max_sweeps
        self.generator = generator
        self.step_size = 1.0
        self.key = jax.random.key(seed)
        self.count = 0

    def __call__(self, lines: FloatArray, temperature: float) -> tuple[FloatArray, FloatArray, int, bool, FloatArray]:
        """Return the moved particles, their log likelihoods, sweeps, whether they moved, and the acceptance."""
        covariance = _covariance(lines)
        root = np.linalg.cholesky(covariance)
        start, moved = lines, False
        distances: list[FloatArray] = []
        accepted: list[FloatArray] = []
        while not moved and len(distances) < self.max_sweeps:
            self.count += 1
            key = jax.random.fold_in(self.key, self.count)
            leapfrogs = int(np.clip(np.ceil(TRAJECTORY_SDS / self.step_size), 1, MAX_LEAPFROGS))
            # Jittered steps: no period of the dynamics resonates, and short ones enter narrow places.
            sizes = self.step_size * self.generator.uniform(0.2, 1.0, lines.shape[:2])
            # A run jumps along the differences of its neighbour. Its own particles depend on where each one started:
            # jumps along theirs biased the log evidence of 15 parameters by 0.25.
            jumps = _jumps(np.roll(start, 1, axis=0), self.generator)
            moves = self.program.sweep(key, lines, temperature, covariance, sizes, leapfrogs, jumps, *self.data)
            lines, log_likelihoods, acceptance = (np.asarray(array) for array in moves)
            # Pooled over all particles the acceptance is nearly exact, so its steps need no decay.
            self.step_size *= float(np.exp(acceptance[0] - TARGET_ACCEPTANCE))
            self.step_size = min(self.step_size, MAX_STEP_SDS)
            accepted.append(acceptance)
            whitened_start, whitened_lines = (
                np.linalg.solve(root, array.reshape(-1, len(root)).T) for array in (start, lines)
            )
            moved = _has_moved(whitened_start, whitened_lines, distances)
        return lines, log_likelihoods, len(distances), moved, np.mean(accepted, axis=0)


def _covariance(lines: FloatArray) -> FloatArray:
    """Return the covariance of all particles, kept invertible should a coordinate have collapsed."""
    covariance = np.atleast_2d(np.cov(lines.reshape(-1, lines.shape[-1]).T))
    return covariance + 1e-10 * np.diag(np.diag(covariance) + np.finfo(float).tiny)


def _has_moved(start: FloatArray, current: FloatArray, distances: list[FloatArray]) -> bool:
    """Return whether the particles have forgotten their start in every whitened direction, (d, particles) arrays.

    Either they are uncorrelated with it, or the median distance from it has stopped to grow: for a particle that
    wanders, doubling the sweeps doubles its square. In separated modes, where all remember their mode, only the
    second can happen.
    """
    distances.append(np.median(np.abs(current - start), axis=1) ** 2)
    sweeps = len(distances)
    correlations = np.array([np.corrcoef(*pair)[0, 1] for pair in zip(start, current, strict=True)])
    has_moved = np.abs(correlations) < MAX_CORRELATION_WITH_START
    if sweeps >= 4:
        has_moved |= distances[-1] < MAX_GROWTH * distances[(sweeps + 1) // 2 - 1]
    return bool(has_moved.all())


class Program(NamedTuple):
    """The compiled functions of real-line coordinates, (runs, draws, d); data follow where densities take them."""

    sweep: Callable[..., tuple[Any, Any, Any]]
    densities: Callable[..., tuple[Any, Any]]
    points: Callable[[Any], Any]


@lru_cache(maxsize=64)
def compiled_program(log_likelihood: Callable[..., Any], log_prior: Callable[..., Any], box: Box) -> Program:
    """Return the functions of all particles at once; whatever changes with temperature or data is an argument."""
    trajectory = blackjax.hmc.build_kernel()
    jump = blackjax.additive_step_random_walk.build_kernel()

    def likelihood(line: Any, *data: Any) -> Any:
        value = log_likelihood(box.from_line(line), *data)
        return jnp.where(jnp.isfinite(value), value, -jnp.inf)

    def prior(line: Any, *data: Any) -> Any:
        return log_prior(box.from_line(line), *data) + box.log_jacobian(line)

    def sweep(
        key: Any, lines: Any, temperature: Any, covariance: Any, sizes: Any, leapfrogs: Any, jumps: Any, *data: Any
    ) -> tuple[Any, Any, Any]:
        def tempered(line: Any) -> Any:
            return prior(line, *data) + temperature * likelihood(line, *data)

        def jump_once(state: Any, drawn: tuple[Any, Any]) -> tuple[Any, Any]:
            key, by = drawn
            state, info = jump(key, state, tempered, lambda key, line: by)
            return state, info.acceptance_rate

        def move(key: Any, line: Any, size: Any, jumps: Any) -> tuple[Any, Any, Any]:
            key_trajectory, key_jumps = jax.random.split(key)
            start = blackjax.hmc.init(line, tempered)
            state, info = trajectory(key_trajectory, start, tempered, size, covariance, leapfrogs)
            keys = jax.random.split(key_jumps, len(jumps))
            state, accepted = jax.lax.scan(jump_once, RWState(state.position, state.logdensity), (keys, jumps))
            acceptance = jnp.stack([info.acceptance_rate, accepted.mean()])
            return state.position, likelihood(state.position, *data), acceptance

        keys = jax.random.split(key, lines.shape[:2])
        moved, log_likelihoods, acceptance = jax.vmap(jax.vmap(move))(keys, lines, sizes, jumps)
        return moved, log_likelihoods, acceptance.mean((0, 1))

    def densities(lines: Any, *data: Any) -> tuple[Any, Any]:
        return jax.vmap(jax.vmap(lambda line: (likelihood(line, *data), prior(line, *data))))(lines)

    # At XLA's usual level the kernels' random numbers take three times as long to compile and run no faster.
    compiled = partial(jax.jit, compiler_options={"xla_backend_optimization_level": 1})
    return Program(compiled(sweep), compiled(densities), compiled(jax.vmap(jax.vmap(box.from_line))))


def _jumps(clouds: FloatArray, generator: np.random.Generator) -> FloatArray:
    """Return d jumps per particle along lines between two particles of a cloud, (runs, draws, d, d) array.

    Now and then a jump has the full length, which changes the mode. Half of them move only some coordinates,
    which enters the narrow places of a funnel.
    """
    runs, draws, dimension = clouds.shape
    shape = (runs, draws, dimension)
    particle, partner = (
        clouds[np.arange(runs)[:, None, None], generator.integers(draws, size=shape)] for _ in range(2)
    )
    shortened = 2.38 / np.sqrt(2 * dimension) * MIN_JUMP_SHARE ** generator.random(shape)
    sizes = np.where(generator.random(shape) < 0.1, 1.0, shortened)[..., None]
    takes_part = (generator.random((*shape, 1)) < 0.5) | (generator.random(particle.shape) < 0.5)
    return np.asarray((particle - partner) * sizes * takes_part)
