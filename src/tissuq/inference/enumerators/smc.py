"""Tempered sequential Monte Carlo: draws and the log evidence of any bounded posterior, with an honest error."""

# BlackJAX supplies the Markov kernels, not the tempering loop. Its tempered SMC compiles the number of moves in,
# keeps one population, and returns a weighted one; here the number of moves follows what the particles do, and
# several populations run at once, because their spread is the only error of the evidence that can be trusted.

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import logsumexp, ndtr, stdtrit

from tissuq.arrays import BoolArray, FloatArray
from tissuq.errors import ConvergenceError, InputError
from tissuq.inference.convergence import MAX_RHAT, Draws, check_minima
from tissuq.inference.coordinates import Box
from tissuq.inference.enumerators.mutation import Mutation, Program, compiled_program
from tissuq.inference.quasi_monte_carlo import resampled_at_random

MIN_ESS = 400
MAX_LOG_EVIDENCE_ERROR = 0.3
MAX_TEMPERATURES = 1000
REMEDY_MORE = "more particles"


@dataclass(frozen=True)
class SmcSettings:
    """How many particles and how carefully they are led from the prior to the posterior.

    Parameters
    ----------
    particles : int
        Particles in all, a multiple of ``runs``.
    runs : int
        Independent populations that share the particles: their spread is the error of the evidence.
    ess_fraction : float
        Share of the particles that must stay effective from one temperature to the next.
    max_sweeps : int
        Sweeps per temperature after which a mutation ends even though the particles remember its start.
    seed : int
        Fixes every random number.
    """

    particles: int = 2000
    runs: int = 8
    ess_fraction: float = 0.7
    max_sweeps: int = 40
    seed: int = 0

    def __post_init__(self) -> None:
        check_minima("SMC", self, runs=4, particles=50 * self.runs, max_sweeps=1, seed=0)
        if self.particles % self.runs:
            raise InputError(f"SMC particles: {self.particles} is not a multiple of the {self.runs} runs.")
        if not 0.5 <= self.ess_fraction <= 0.9:
            raise InputError(f"SMC ess_fraction: {self.ess_fraction} is not between 0.5 and 0.9.")


@dataclass(frozen=True)
class SmcDraws(Draws):
    r"""Draws from a posterior and its evidence, with the diagnostics of their quality.

    The draws of a run stand in genealogical order: particles that descend from the same ancestor are neighbours.
    What relatives still have in common, exact duplicates included, therefore shows as autocorrelation along the
    draws, and the effective sample sizes of ArviZ discount it as they do for a Markov chain; differences between
    the runs lower them further. They never exceed the number of distinct draws.

    Parameters
    ----------
    increments : (temperatures, runs) array
        What each temperature added to the log evidence of each run.
    drifts : (temperatures, runs) array
        What each mutation added to the mean of the log weights. It would add nothing, but for chance, had the
        reweighted particles been draws from the temperature's density already.
    temperatures : (temperatures,) array
        The powers of the likelihood, rising to one.
    sweeps : (temperatures,) array
        Mutation sweeps at each temperature.
    moved : (temperatures,) array
        Whether the particles forgot where their mutation started.
    acceptance : (temperatures, 2) array
        Mean acceptance of the trajectories and of the jumps.

    References
    ----------
    Del Moral, Doucet & Jasra (2006), Journal of the Royal Statistical Society B 68, 411-436.
    """

    increments: FloatArray
    drifts: FloatArray
    temperatures: FloatArray
    sweeps: NDArray[np.int64]
    moved: BoolArray
    acceptance: FloatArray

    @property
    def log_evidences(self) -> FloatArray:
        """Log evidence of each run: (runs,) array."""
        return np.asarray(self.increments.sum(0))

    @property
    def log_evidence(self) -> float:
        """Logarithm of the mean of the runs' evidences, each of which is unbiased but for the adaptation."""
        return _log_mean(self.log_evidences)

    @cached_property
    def log_evidence_error(self) -> float:
        """Standard error of the log evidence, the largest of three estimates.

        The first is the jackknife over the runs, times the factor by which Student's t with as many degrees of
        freedom exceeds the normal at one standard error, because a spread estimated from a few runs may be small
        by luck. The second adds the variances between runs temperature by temperature: it has many more degrees
        of freedom, but misses what the temperatures have in common (a mode that one run keeps overweight). The
        third is the sum of the drifts: where all runs alike lose a region that the temperatures pass on their way
        (the neck of a funnel), no spread between them shows the loss, but the mutations that repair it do.
        """
        runs = len(self.log_evidences)
        without = np.array([_log_mean(np.delete(self.log_evidences, run)) for run in range(runs)])
        jackknife = np.sqrt((runs - 1) * without.var())
        by_temperature = np.sqrt(self.increments.var(axis=1, ddof=1).sum() / runs)
        drift = abs(self.drifts.sum(0).mean())
        return float(max(jackknife * stdtrit(runs - 1, ndtr(1.0)), by_temperature, drift))

    @cached_property
    def distinct(self) -> int:
        """Number of distinct draws, which no effective sample size exceeds."""
        return len(np.unique(self.values.reshape(-1, self.values.shape[-1]), axis=0))

    def _limited(self, sizes: FloatArray) -> FloatArray:
        return np.minimum(sizes, self.distinct)

    def _quality(self) -> str:
        return (
            f"log evidence {self.log_evidence:.2f} with standard error {self.log_evidence_error:.2f} from "
            f"{len(self.values)} runs"
        )

    def _failures(self) -> list[tuple[str, str]]:
        failures = []
        worst = int(np.argmax(self.rhat))
        if not self.rhat[worst] < MAX_RHAT:
            fault = f"R-hat between runs is {self.rhat[worst]:.3f} for {self.names[worst]}"
            failures.append((f"{fault} and must be below {MAX_RHAT}", REMEDY_MORE))
        failures += self._small_sizes(MIN_ESS, REMEDY_MORE)
        if not self.log_evidence_error < MAX_LOG_EVIDENCE_ERROR:
            fault = f"the standard error of the log evidence is {self.log_evidence_error:.2f}"
            failures.append((f"{fault} and must be below {MAX_LOG_EVIDENCE_ERROR}", REMEDY_MORE))
        # Particles that hardly moved show in the diagnostics above; on their own they are no failure.
        stuck = np.count_nonzero(~self.moved)
        if failures and stuck:
            fault = f"at {stuck} of {len(self.moved)} temperatures the particles still remember their start"
            failures.append((f"{fault} after {self.sweeps.max()} sweeps", "more sweeps (max_sweeps)"))
        return failures


def sample_smc(
    log_likelihood: Callable[..., Any],
    log_prior: Callable[..., Any],
    lower: ArrayLike,
    upper: ArrayLike,
    prior_draws: ArrayLike,
    settings: SmcSettings | None = None,
    names: Sequence[str] | None = None,
    data: Any = None,
) -> SmcDraws:
    r"""Lead particles from the prior to the posterior through powers of the likelihood.

    The particles pass through :math:`p_t(x) \propto p(x)\, L(x)^t` with :math:`t` rising from 0 to 1. Each
    temperature weights them by :math:`L^{\Delta t}`, where :math:`\Delta t` leaves a set share of them
    effective; the mean weights multiply to the evidence :math:`\int p L`. They are then resampled and mutated by
    sweeps that leave :math:`p_t` unchanged, on the real line (`tissuq.inference.coordinates`): one Hamiltonian
    trajectory with the particles' covariance as metric, which follows correlated and curved posteriors, and d
    jumps along differences of particles, which fit separated modes and need no gradient. The step size follows
    the acceptance; the sweeps go on until the particles have forgotten where they started.

    Several populations run side by side. They share temperatures, covariance and step size but no particle.

    Parameters
    ----------
    log_likelihood : callable
        Log likelihood of a (d,) JAX array inside the box; not finite, NaN for instance, where the likelihood is
        zero.
    log_prior : callable
        Log prior density, likewise, up to a constant.
    lower, upper : (d,) array
        Bounds of the box; infinite where there is none.
    prior_draws : (particles, d) array
        Independent draws from the normalised prior: they, not ``log_prior``, fix the constant of the evidence.
    settings : SmcSettings, optional
        Numbers of particles and runs, care and seed.
    names : sequence of str, optional
        What to call the parameters in messages.
    data : pytree of arrays, optional
        A second argument of both densities. What is compiled once for them and the bounds serves all data of one
        shape.

    Returns
    -------
    SmcDraws
        The draws and the evidence; look at ``converged`` before use. The same seed and prior draws give the same
        bits.

    Raises
    ------
    InputError
        When the bounds, the draws or the names do not fit, or a prior draw is outside the box or has no finite
        prior density.
    ConvergenceError
        When a run has no prior draw with a positive likelihood, or the temperatures do not reach one.

    References
    ----------
    Del Moral, Doucet & Jasra (2006), Journal of the Royal Statistical Society B 68, 411-436.
    Buchholz, Chopin & Jacob (2021), Bayesian Analysis 16, 745-771 (Hamiltonian mutation, its tuning and when to
    stop it). ter Braak (2006), Statistics and Computing 16, 239-249 (differences of particles as jumps).

    Examples
    --------
    A normal likelihood of standard deviation 0.01 under a uniform prior on (0, 2) has the evidence 1/2:

    >>> import jax.scipy.stats as jss
    >>> draws = sample_smc(
    ...     lambda x: jss.norm.logpdf(x[0], 1.0, 0.01),
    ...     lambda x: 0.0,
    ...     [0.0],
    ...     [2.0],
    ...     2 * np.random.default_rng(0).random((2000, 1)),
    ... )
    >>> bool(abs(draws.log_evidence - np.log(0.5)) < 5 * draws.log_evidence_error)
    True
    """
    settings = settings or SmcSettings()
    box = Box(lower, upper)
    labels = box.labels(names)
    arguments = () if data is None else (data,)
    program = compiled_program(log_likelihood, log_prior, box)
    lines = _starting_lines(box, prior_draws, settings)
    log_likelihoods = _log_likelihoods_at_start(program, lines, arguments)
    # Not the plain seed: the caller may have drawn the prior's particles from it.
    generator = np.random.default_rng([settings.seed, 3])
    mutation = Mutation(program, arguments, settings.max_sweeps, settings.seed, generator)

    temperature = 0.0
    steps: list[tuple[Any, ...]] = []
    while temperature < 1:
        if len(steps) == MAX_TEMPERATURES:
            raise ConvergenceError(
                f"after {MAX_TEMPERATURES} temperatures the likelihood is raised to the power {temperature:.3g} only; "
                "check that it is smooth, or give more particles."
            )
        rise = _rise(log_likelihoods, 1 - temperature, settings.ess_fraction)
        # The last rise ends on one exactly, whatever the rounding of the sum.
        temperature = 1.0 if rise == 1 - temperature else temperature + rise
        log_weights = rise * log_likelihoods
        increment = logsumexp(log_weights, axis=1)
        reweighted = np.where(log_weights > -np.inf, log_weights, 0) * np.exp(log_weights - increment[:, None])
        survivors = resampled_at_random(log_weights, generator)
        lines = np.take_along_axis(lines, survivors[:, :, None], axis=1)
        lines, log_likelihoods, *moves = mutation(lines, temperature)
        drift = rise * log_likelihoods.mean(1) - reweighted.sum(1)
        steps.append((increment - np.log(log_weights.shape[1]), drift, temperature, *moves))
    values = np.asarray(program.points(lines))
    increments, drifts, temperatures, sweeps, moved, acceptance = map(np.array, zip(*steps, strict=True))
    return SmcDraws(values, labels, increments, drifts, temperatures, sweeps, moved, acceptance)


def _starting_lines(box: Box, prior_draws: ArrayLike, settings: SmcSettings) -> FloatArray:
    """Return the prior draws on the real line: (runs, draws, d) array."""
    points = np.asarray(prior_draws, dtype=np.float64)
    expected = (settings.particles, box.is_bounded.size)
    if points.shape != expected:
        raise InputError(f"the prior draws have the shape {points.shape}; {expected} (particles, d) is expected.")
    inside = ((box.lower < points) & (points < box.upper)).all(1)
    if not inside.all():
        index = int(np.argmin(inside))
        raise InputError(f"prior draw {index} is {points[index]}; it must lie inside the box.")
    return np.stack([box.to_line(point) for point in points]).reshape(settings.runs, -1, expected[1])


def _log_likelihoods_at_start(program: Program, lines: FloatArray, data: tuple[Any, ...]) -> FloatArray:
    """Return the log likelihoods of the prior draws, (runs, draws) array, checked together with their prior."""
    log_likelihoods, log_priors = (np.asarray(array) for array in program.densities(lines, *data))
    if not np.isfinite(log_priors).all():
        index = int(np.argmin(np.isfinite(log_priors)))
        raise InputError(f"the log prior is {log_priors.ravel()[index]} at prior draw {index}; it must be finite.")
    positive = np.isfinite(log_likelihoods).sum(1)
    if not positive.all():
        raise ConvergenceError(
            f"the likelihood is zero at all {log_likelihoods.shape[1]} prior draws of a run; give more particles or a "
            "narrower prior."
        )
    return log_likelihoods


def _rise(log_likelihoods: FloatArray, largest_rise: float, ess_fraction: float) -> float:
    """Return the rise in temperature that leaves a share of the particles effective, on average over the runs.

    The share is of the particles with a positive likelihood: no rise brings back the others.
    """
    positive = np.isfinite(log_likelihoods)

    def is_small(rise: float) -> bool:
        weights = rise * np.where(positive, log_likelihoods, -np.inf)
        log_ess = 2 * logsumexp(weights, axis=1) - logsumexp(2 * weights, axis=1)
        return bool(np.mean(np.exp(log_ess) / positive.sum(1)) >= ess_fraction)

    if is_small(largest_rise):
        return largest_rise
    finite = log_likelihoods[positive]
    low, high = np.log(min(largest_rise, 1e-3 / np.ptp(finite))), np.log(largest_rise)
    while high - low > 1e-3:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if is_small(np.exp(middle)) else (low, middle)
    return float(np.exp(low))


def _log_mean(logarithms: FloatArray) -> float:
    return float(logsumexp(logarithms) - np.log(len(logarithms)))
