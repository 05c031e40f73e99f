"""The no-U-turn sampler for any differentiable log density on a box, with the evidence that it converged."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from typing import Any, NamedTuple

import blackjax
import jax
import jax.numpy as jnp
import numpy as np
from blackjax.adaptation.step_size import dual_averaging_adaptation
from blackjax.adaptation.window_adaptation import build_schedule
from numpy.typing import ArrayLike

from tissuq.arrays import BoolArray, FloatArray
from tissuq.errors import ConvergenceError, InputError
from tissuq.inference.convergence import MAX_RHAT, Draws, check_minima, diagnostic
from tissuq.inference.coordinates import (
    Box,
    Derivatives,
    LogDensity,
    Mode,
    derivatives_on_line,
    find_modes,
    log_density_on_line,
)

MIN_ESS_PER_CHAIN = 100
MAX_DIVERGENT_SHARE = 0.002
"""Few as they are, they may tell of a place that no chain enters: along a curved ridge with 16 to 34 of 8000, all else
was well, and sds came out up to 30 % too small. Fits and populations have none, or up to one in a thousand."""
MIN_BFMI = 0.3
SEPARATE_RHAT = 1.2
"""An R-hat that slow chains hardly reach, but chains in different modes do."""
REMEDY_LONGER = "a longer warm-up and more draws or thinning"
OVERDISPERSION_SDS = 1.5
"""Standard deviation of the starting points around a mode, in posterior standard deviations."""


@dataclass(frozen=True)
class NutsSettings:
    """How long to sample and how carefully.

    Parameters
    ----------
    chains : int
        Independent chains, at least two: their agreement is the check.
    warmup : int
        Trajectories per chain that tune the sampler and are thrown away; all chains tune together.
    draws : int
        Draws per chain that are kept.
    thinning : int
        Trajectories from one kept draw to the next.
    target_acceptance : float
        Mean acceptance that the step size is tuned to; closer to one takes smaller steps.
    seed : int
        Fixes every random number.
    """

    chains: int = 4
    warmup: int = 500
    draws: int = 1000
    thinning: int = 2
    target_acceptance: float = 0.9
    seed: int = 0

    def __post_init__(self) -> None:
        check_minima("NUTS", self, chains=2, warmup=20, draws=4, thinning=1, seed=0)
        if not 0 < self.target_acceptance < 1:
            raise InputError(f"NUTS target_acceptance: {self.target_acceptance} is not between 0 and 1.")


@dataclass(frozen=True)
class NutsDraws(Draws):
    """Draws from a posterior with the diagnostics of their quality.

    Parameters
    ----------
    energies : (chains, draws * thinning) array
        Energy of the simulated dynamics at the end of each trajectory.
    divergences : int
        Trajectories that the integrator lost.
    leapfrogs_per_draw : float
        Mean number of gradients that one draw took.

    References
    ----------
    Betancourt (2016), arXiv:1604.00695 (BFMI).
    """

    energies: FloatArray
    divergences: int
    leapfrogs_per_draw: float

    @cached_property
    def bfmi(self) -> FloatArray:
        """Estimated fraction of missing information of the energy: (chains,) array."""
        return diagnostic("bfmi", self.energies)

    def _quality(self) -> str:
        return f"{self.divergences} of {self.energies.size} trajectories divergent, BFMI at least {self.bfmi.min():.2f}"

    def _failures(self) -> list[tuple[str, str]]:
        worst = int(np.argmax(self.rhat))
        failures = []
        if not self.rhat[worst] < MAX_RHAT:
            fault = f"R-hat is {self.rhat[worst]:.3f} for {self.names[worst]} and must be below {MAX_RHAT}"
            failures.append((fault, REMEDY_LONGER))
            if not self.rhat[worst] < SEPARATE_RHAT:
                failures.append(("the chains stay in different places", "a narrower prior that leaves one mode"))
        failures += self._small_sizes(MIN_ESS_PER_CHAIN * len(self.values), REMEDY_LONGER)
        if not self.divergences < MAX_DIVERGENT_SHARE * self.energies.size:
            fault = f"{self.divergences} of {self.energies.size} trajectories diverged"
            failures.append((fault, "a target acceptance closer to one, such as 0.99"))
        if not self.bfmi.min() > MIN_BFMI:
            fault = f"the BFMI is {self.bfmi.min():.2f} and must exceed {MIN_BFMI}"
            failures.append((fault, "a narrower prior on the parameters that set a scale"))
        return failures


def sample_nuts(
    log_density: LogDensity | Callable[[Any, Any], Any],
    lower: ArrayLike,
    upper: ArrayLike,
    start: ArrayLike,
    settings: NutsSettings | None = None,
    names: Sequence[str] | None = None,
    data: Any = None,
) -> NutsDraws:
    """Sample a log density on a box.

    The density is moved to the real line and whitened by the Hessian at its mode
    (`tissuq.inference.coordinates`), where one step length fits all directions however stiff the posterior.
    Chains start overdispersed around the mode; when several modes hold probability they start around each,
    so that R-hat tells. Warm-up tunes one step size and one dense mass matrix on the draws of all chains.

    Parameters
    ----------
    log_density : callable
        Log density, up to a constant, of a (d,) JAX array inside the box; JAX traces and differentiates it.
    lower, upper : (d,) array
        Bounds of the box; infinite where there is none.
    start : (d,) array
        A point inside the box with a finite log density.
    settings : NutsSettings, optional
        Lengths, target and seed.
    names : sequence of str, optional
        What to call the parameters in messages.
    data : pytree of arrays, optional
        A second argument of the log density. What is compiled once for a function, bounds and settings serves all
        data of one shape and every seed.

    Returns
    -------
    NutsDraws
        The draws; look at ``converged`` before use. The same seed gives the same bits.

    Raises
    ------
    InputError
        When the bounds, the start or the names do not fit, or the log density is not finite at the start.
    ConvergenceError
        When no starting point with a finite log density is found around a mode.

    References
    ----------
    Hoffman & Gelman (2014), Journal of Machine Learning Research 15, 1593-1623.
    Betancourt (2017), arXiv:1701.02434 (multinomial trajectories; BlackJAX implements them).

    Examples
    --------
    >>> settings = NutsSettings(warmup=200, draws=500)
    >>> draws = sample_nuts(lambda x: -3.0 * x[0], [0.0], [np.inf], [1.0], settings)
    >>> bool(abs(draws.values.mean() - 1 / 3) < 0.05)
    True
    """
    settings = settings or NutsSettings()
    box = Box(lower, upper)
    labels = box.labels(names)
    generator = np.random.default_rng(settings.seed)
    arguments = () if data is None else (data,)
    derivatives = derivatives_on_line(log_density, box, *arguments)
    modes = find_modes(derivatives, box, start, generator)
    states = _overdispersed(derivatives, modes, settings.chains, generator)
    run = _compiled_run(log_density, box, replace(settings, seed=0))
    key = jax.random.key(settings.seed)
    trace = run(key, states, _schedule(settings), modes[0].location, modes[0].scale, *arguments)
    values, energies, divergent, leapfrogs = (np.asarray(array) for array in trace)
    gradients = float(leapfrogs.mean()) * settings.thinning
    return NutsDraws(values, labels, energies, int(divergent.sum()), gradients)


def _overdispersed(derivatives: Derivatives, modes: Sequence[Mode], chains: int, generator: np.random.Generator) -> Any:
    """Return one starting state per chain, around the modes in turn, whitened at the first mode."""
    starts = [_start_around(derivatives, modes[chain % len(modes)], generator) for chain in range(chains)]
    positions, values, gradients = zip(*starts, strict=True)
    whitened = np.stack([modes[0].whiten(line) for line in positions])
    return blackjax.mcmc.hmc.HMCState(whitened, np.stack(values), np.stack(gradients) @ modes[0].scale)


def _start_around(
    derivatives: Derivatives, mode: Mode, generator: np.random.Generator
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a point around a mode, closer at every failure, with its finite log density and gradient."""
    for shrinkage in 0.8 ** np.arange(50):
        offset = OVERDISPERSION_SDS * shrinkage * generator.standard_normal(mode.location.size)
        line = mode.unwhiten(offset)
        value, gradient, _ = derivatives(line)
        if np.isfinite(value) and np.isfinite(gradient).all():
            return line, value, gradient
    raise ConvergenceError(f"the log density is not finite anywhere around its mode at {mode.location} on the line.")


class _Tuning(NamedTuple):
    """What warm-up learns: the step size, the mass matrix, and the moments of the window in progress."""

    step_size: Any
    inverse_mass: Any
    count: Any
    total: Any
    squares: Any


@lru_cache(maxsize=64)
def _compiled_run(log_density: Callable[..., Any], box: Box, settings: NutsSettings) -> Any:
    """Return the function that runs all chains in one compiled loop.

    It returns values by chain and draw; energies, divergences and leapfrogs by chain and trajectory. Warm-up and
    sampling share the loop body: the trajectory code, by far the costliest to compile, appears once.
    """
    kernel = blackjax.nuts.build_kernel()

    @jax.jit
    def run(key: Any, states: Any, schedule: Any, location: Any, scale: Any, *data: Any) -> Any:
        on_line = log_density_on_line(log_density, box, *data)

        def to_line(whitened: Any) -> Any:
            return location + scale @ whitened

        def iterate(carry: tuple[Any, _Tuning], step: tuple[Any, ...]) -> tuple[Any, Any]:
            states, tuning = carry
            key, is_warmup, is_slow, ends_window = step
            learning = tuning.step_size
            step_size = jnp.exp(jnp.where(is_warmup, learning.log_step_size, learning.log_step_size_avg))
            keys = jax.random.split(key, settings.chains)
            move = partial(
                kernel,
                logdensity_fn=lambda whitened: on_line(to_line(whitened)),
                step_size=step_size,
                inverse_mass_matrix=tuning.inverse_mass,
            )
            states, info = jax.vmap(move)(keys, states)
            acceptance = info.acceptance_rate
            tuned = _tune(tuning, states.position, acceptance, is_slow, ends_window, settings.target_acceptance)
            tuning = jax.tree.map(partial(jnp.where, is_warmup), tuned, tuning)
            return (states, tuning), (states.position, info.energy, info.is_divergent, info.num_integration_steps)

        keys = jax.random.split(key, len(schedule[0]))
        start = (states, _untuned(len(location), settings.target_acceptance))
        _, trace = jax.lax.scan(iterate, start, (keys, *schedule))
        positions, *statistics = (jnp.swapaxes(array[settings.warmup :], 0, 1) for array in trace)
        thinned = slice(settings.thinning - 1, None, settings.thinning)
        to_box: Any = jax.vmap(jax.vmap(lambda whitened: box.from_line(to_line(whitened))))
        return to_box(positions[:, thinned]), *statistics

    return run


def _schedule(settings: NutsSettings) -> tuple[BoolArray, ...]:
    """Return by trajectory whether it is warm-up, feeds the mass matrix, and ends one of Stan's windows."""
    sampling = settings.draws * settings.thinning
    windows = np.asarray(build_schedule(settings.warmup), dtype=bool)
    is_slow, ends_window = np.pad(windows, ((0, sampling), (0, 0))).T
    return np.arange(settings.warmup + sampling) < settings.warmup, is_slow, ends_window


def _untuned(dimension: int, target_acceptance: float) -> _Tuning:
    start, _, _ = dual_averaging_adaptation(target_acceptance)
    step_size = jax.tree.map(jnp.asarray, start(1.0))
    inverse_mass, squares = jnp.eye(dimension), jnp.zeros((dimension, dimension))
    return _Tuning(step_size, inverse_mass, 0.0, jnp.zeros(dimension), squares)


def _tune(
    tuning: _Tuning, positions: Any, acceptance: Any, is_slow: Any, ends_window: Any, target_acceptance: float
) -> _Tuning:
    """Return the tuning after one trajectory of all chains.

    The step size follows dual averaging. The mass matrix is renewed at a window's end, from the covariance of
    all chains shrunk towards a small multiple of the identity, as in Stan.
    """
    start, update, finish = dual_averaging_adaptation(target_acceptance)
    chains, dimension = positions.shape
    step_size = update(tuning.step_size, acceptance.mean())
    count = tuning.count + is_slow * chains
    total = tuning.total + is_slow * positions.sum(0)
    squares = tuning.squares + is_slow * positions.T @ positions
    mean = total / jnp.maximum(count, 1)
    covariance = squares / jnp.maximum(count, 1) - jnp.outer(mean, mean)
    shrunk = (count * covariance + 5e-3 * jnp.eye(dimension)) / (count + 5)
    going_on = _Tuning(step_size, tuning.inverse_mass, count, total, squares)
    restarted = _Tuning(start(finish(step_size)), shrunk, 0.0, jnp.zeros_like(total), jnp.zeros_like(squares))
    return _Tuning(*jax.tree.map(partial(jnp.where, ends_window), restarted, going_on))
