"""The population: mean, spread and correlation of the specimens' parameters, every specimen integrated in closed form.

In the coordinates of `likelihoods`, with d pooled parameters and the likelihood of each specimen i,

    theta_i ~ N(m + B x_i, S),   S = diag(tau) Omega diag(tau),
    m ~ N(0, 5²),   B ~ N(0, 1),   tau ~ half-normal(spread),   Omega ~ LKJ(2),

where x_i are the columns of the specimen's covariates, if there are any (`covariates`).

A Gaussian of a likelihood times N(m + B x_i, S) integrates in closed form, so that only m, B, tau and Omega are
sampled: as many dimensions for fifty specimens as for three. What is left of the funnel, a mean that is free where the
spread is large, goes with the scale of m: it is sampled as (m - c) / sqrt(tau² + s²), where c is the middle of the
specimens and s what each of them leaves open. Each theta_i is then drawn exactly, given these.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from tissuq.arrays import FloatArray
from tissuq.inference.enumerators.nuts import NutsDraws, NutsSettings, sample_nuts
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.inference.quasi_monte_carlo import systematic
from tissuq.population.covariates import Covariates
from tissuq.population.likelihoods import likelihoods_of

NO_COLUMNS: FloatArray = np.zeros(0)

MEAN_PRIOR_SD = 5.0
"""Sd of the prior of the mean; of a logarithm it is a factor of 150 either way from the median specimen."""
EFFECT_PRIOR_SD = 1.0
"""Sd of the prior of an effect on the line: of a logarithm it is a factor of 2.7 either way for one sd of a number, or
between a level and the reference."""
LKJ_CONCENTRATION = 2.0
"""Concentration of the LKJ prior of the correlations; one would be uniform."""
DRAWS_PER_CHAIN = 1000
"""Number of draws in each of four chains."""
THINNINGS = (1, 4)
"""Steps of the sampler for each draw: the second where the first has not converged."""
SAMPLING_COMPONENTS, CORRECTION_COMPONENTS = 16, 200
"""Number of Gaussians per specimen for sampling, and for the correction of the draws."""
CORRECTION_BATCH = 20
"""Number of draws corrected at once, which bounds the memory."""


@dataclass(frozen=True, eq=False)
class Hierarchy:
    """Draws of the population and of every specimen, on the line.

    Attributes
    ----------
    mean : (chains, draws, d) array
    root : (chains, draws, d, d) array
        Lower triangle A of the covariance A A' between specimens.
    specimens : (chains, draws, I, d) array
    sampled : NutsDraws
        Draws of m, tau, Omega and B, with their diagnostics.
    effective : float
        Share of the draws that remain effective after their correction.
    """

    mean: FloatArray
    root: FloatArray
    specimens: FloatArray
    sampled: NutsDraws
    effective: float

    @property
    def tau(self) -> FloatArray:
        """Spreads (chains, draws, d)."""
        return np.asarray(np.linalg.norm(self.root, axis=3))

    @property
    def correlation(self) -> FloatArray:
        """Correlations (chains, draws, d, d)."""
        rows = self.root / self.tau[..., None]
        return np.asarray(rows @ rows.swapaxes(2, 3))

    @property
    def effects(self) -> FloatArray:
        """Effects B (chains, draws, k, d) of the columns of the covariates."""
        *_, effects = _parted(self.sampled.values, self.mean.shape[2])
        return np.asarray(effects)

    @cached_property
    def diagnostics(self) -> NutsDraws:
        """The run with the parameters of every specimen among its quantities."""
        chains, draws, count, size = self.specimens.shape
        names = [f"parameter {k + 1} of specimen {index + 1}" for index in range(count) for k in range(size)]
        values = np.concatenate([self.sampled.values, self.specimens.reshape(chains, draws, -1)], axis=2)
        return self.sampled.of(values, (*self.sampled.names, *names))

    def middle(self, columns: FloatArray) -> FloatArray:
        """Return m + B x (chains, draws, d) for columns x (k,) of covariates."""
        return np.asarray(self.mean + np.einsum("k,cdki->cdi", columns, self.effects)) if len(columns) else self.mean

    def new(self, generator: np.random.Generator, columns: FloatArray = NO_COLUMNS) -> FloatArray:
        """Return a new specimen (chains, draws, d), with columns (k,) of its covariates, for every draw."""
        score = generator.standard_normal(self.mean.shape)
        return np.asarray(self.middle(columns) + np.einsum("cdij,cdj->cdi", self.root, score))


def sample_hierarchy(
    mixtures: Sequence[GaussianMixture],
    reference: FloatArray,
    symbols: Sequence[str],
    covariates: Covariates,
    spread: float,
    seed: int,
) -> Hierarchy:
    """Return draws of the population that specimens come from.

    The sampler represents every specimen by a few Gaussians. Its draws are then weighted by the likelihood of many
    more Gaussians and resampled by these weights; specimens are drawn from the larger number.

    Parameters
    ----------
    mixtures, reference
        From `tissuq.population.likelihoods.mixtures_of`.
    symbols : sequence of str
        The pooled parameters.
    covariates : Covariates
        Of the specimens.
    spread : float
        Sd of the half-normal prior of every spread on the line.
    seed : int
    """
    coarse, fine = ({k: jnp.asarray(v) for k, v in vars(likelihoods_of(mixtures, reference, count)).items()}
                 for count in (SAMPLING_COMPONENTS, CORRECTION_COMPONENTS))  # fmt: skip
    size = len(symbols)
    pairs = [(i, j) for i in range(size) for j in range(i)]
    names = [f"{quantity} of {symbol}" for quantity in ("mean", "spread") for symbol in symbols]
    names += [f"partial correlation of {symbols[i]} and {symbols[j]}" for i, j in pairs]
    effects = [f"effect of {column} on {symbol}" for column, _ in covariates.effects for symbol in symbols]
    unbounded = np.full(len(effects), np.inf)
    lower = np.r_[np.full(size, -np.inf), np.zeros(size), -np.ones(len(pairs)), -unbounded]
    upper = np.r_[np.full(2 * size, np.inf), np.ones(len(pairs)), unbounded]
    start = np.r_[np.zeros(size), np.full(size, 0.3 * spread), np.zeros(len(pairs)), np.zeros(len(effects))]
    design = jnp.asarray(covariates.design)
    middles, covariances = map(np.array, zip(*(mixture.moments() for mixture in mixtures), strict=True))
    data = coarse | {
        "spread": jnp.asarray(spread),
        "design": design,
        "centre": jnp.asarray(middles.mean(axis=0)),
        "width": jnp.sqrt(jnp.asarray(np.einsum("ikk->k", covariances) / len(mixtures))),
    }
    for thinning in THINNINGS:
        settings = NutsSettings(draws=DRAWS_PER_CHAIN, thinning=thinning, seed=seed)
        scores = sample_nuts(_log_posterior_of_scores, lower, upper, start, settings, [*names, *effects], data)
        values = jax.vmap(jax.vmap(partial(_with_mean, data=data)))(jnp.asarray(scores.values))
        sampled = scores.of(np.asarray(values), scores.names)
        hierarchy = _corrected(sampled, coarse, fine, design, seed + 1)
        if hierarchy.diagnostics.converged:
            break
    return hierarchy


def _corrected(sampled: NutsDraws, coarse: Any, fine: Any, design: Any, seed: int) -> Hierarchy:
    """Return draws resampled by the likelihood of the many Gaussians, over that of the few that were sampled from."""
    points = jnp.asarray(sampled.values.reshape(-1, len(sampled.names)))
    keys = jax.random.split(jax.random.key(seed), len(points))
    resampled = _corrected_draws(points, keys, coarse, fine, design)
    mean, root, specimens, gain = (np.asarray(array) for array in resampled)
    weights = np.exp(gain - gain.max())
    shape = sampled.values.shape[:2]
    rows = systematic(weights.reshape(shape), DRAWS_PER_CHAIN) + DRAWS_PER_CHAIN * np.arange(shape[0])[:, None]
    effective = float(weights.sum() ** 2 / (weights**2).sum() / len(weights))
    corrected = sampled.of(np.asarray(points)[rows], sampled.names)
    return Hierarchy(mean[rows], root[rows], specimens[rows], corrected, effective)


def _root(tau: Any, partial: Any) -> Any:
    """Return the root (d, d) of the covariance between specimens from spreads (d,) and partial correlations.

    Row by row, every partial correlation takes its share of what is left of a unit row (Lewandowski, Kurowicka & Joe
    2009).
    """
    size, rows = len(tau), []
    for i in range(size):
        row, remaining = [], jnp.asarray(1.0)
        for j in range(i):
            row.append(partial[i * (i - 1) // 2 + j] * jnp.sqrt(remaining))
            remaining = remaining * (1 - partial[i * (i - 1) // 2 + j] ** 2)
        rows.append(jnp.stack([*row, jnp.sqrt(remaining), *[jnp.asarray(0.0)] * (size - i - 1)]))
    return tau[:, None] * jnp.stack(rows)


def _parted(position: Any, size: int) -> tuple[Any, Any, Any, Any]:
    """Return m (d,), tau (d,), partial correlations and effects (k, d) of columns of covariates at a point (..., n)."""
    start = size * (size + 3) // 2
    whole, effects = position[..., :start], position[..., start:]
    effects = effects.reshape(*effects.shape[:-1], -1, size)
    return whole[..., :size], whole[..., size : 2 * size], whole[..., 2 * size :], effects


def _log_posterior_of_scores(position: Any, data: Any) -> Any:
    """Return the log density of a population at a point with scores of the mean in its place."""
    return _log_posterior(_with_mean(position, data), data) + jnp.log(_scale(position, data)).sum()


def _with_mean(position: Any, data: Any) -> Any:
    """Return a point with the mean in place of its scores."""
    size = len(data["centre"])
    return position.at[:size].set(data["centre"] + _scale(position, data) * position[:size])


def _scale(position: Any, data: Any) -> Any:
    """Return what the scores (d,) of the mean are multiplied with."""
    size = len(data["centre"])
    return jnp.sqrt(position[size : 2 * size] ** 2 + data["width"] ** 2)


def _log_posterior(position: Any, data: Any) -> Any:
    """Return the log density of a population."""
    size = data["pull"].shape[-1]
    mean, tau, partial, effects = _parted(position, size)
    level = jnp.array([j + 1 for i in range(size) for j in range(i)])
    power = LKJ_CONCENTRATION - 1 + 0.5 * (size - 1 - level)
    prior = -0.5 * (mean**2).sum() / MEAN_PRIOR_SD**2 - 0.5 * (tau**2).sum() / data["spread"] ** 2
    prior += (power * jnp.log1p(-(partial**2))).sum()
    prior += -0.5 * (effects**2).sum() / EFFECT_PRIOR_SD**2 if effects.size else 0.0
    terms, _, _ = _terms(mean, _root(tau, partial), *_around(_offset(data["design"], effects), data))
    return prior + jax.scipy.special.logsumexp(terms, axis=1).sum()


@jax.jit
def _corrected_draws(points: Any, keys: Any, coarse: Any, fine: Any, design: Any) -> Any:
    """Return mean, root, specimens (I, d) and what many Gaussians add to the log likelihood, for points (N, k)."""

    def complete(point_and_key: Any) -> Any:
        point, key = point_and_key
        mean, tau, partial, effects = _parted(point, coarse["pull"].shape[-1])
        root, offset = _root(tau, partial), _offset(design, effects)
        coarse_terms, _, _ = _terms(mean, root, *_around(offset, coarse))
        terms, triangle, half = _terms(mean, root, *_around(offset, fine))
        gain = (jax.nn.logsumexp(terms, axis=1) - jax.nn.logsumexp(coarse_terms, axis=1)).sum()
        specimens = _specimen_draws(key, mean, root, terms, triangle, half)
        return mean, root, specimens if offset is None else specimens + offset, gain

    return jax.lax.map(complete, (points, keys), batch_size=CORRECTION_BATCH)


def _offset(design: Any, effects: Any) -> Any:
    """Return B x (I, d) of all specimens; None without covariates."""
    return design @ effects if effects.size else None


def _around(offset: Any, likelihoods: Any) -> tuple[Any, Any, Any]:
    """Return log factor, pull and precision of likelihoods of what remains of theta without an offset (I, d)."""
    log_factor, pull, precision = (likelihoods[name] for name in ("log_factor", "pull", "precision"))
    if offset is None:
        return log_factor, pull, precision
    drop = jnp.einsum("ikab,ib->ika", precision, offset)
    return log_factor + ((pull - 0.5 * drop) * offset[:, None]).sum(axis=-1), pull - drop, precision


def _terms(mean: Any, root: Any, log_factor: Any, pull: Any, precision: Any) -> tuple[Any, list[list[Any]], list[Any]]:
    """Integrate Gaussians of likelihoods (..., K) over theta = mean + root z, z ~ N(0, I).

    Returns the logs of the integrals (..., K); the triangle L of the precision L L' of z within each, by its entries;
    and the entries of L^-1 b, where L L' z = b at the mean of z. Entry by entry, because a library call for each of
    many tiny matrices takes ten times as long.
    """
    size = mean.shape[0]
    at_mean = pull - precision @ mean
    projected, precision_of_z = at_mean @ root, jnp.eye(size) + root.T @ precision @ root
    triangle: list[list[Any]] = []
    half: list[Any] = []
    for i in range(size):
        row: list[Any] = []
        for j in range(i):
            row.append((precision_of_z[..., i, j] - sum(row[k] * triangle[j][k] for k in range(j))) / triangle[j][j])
        row.append(jnp.sqrt(precision_of_z[..., i, i] - sum(entry**2 for entry in row)))
        triangle.append(row)
        half.append((projected[..., i] - sum(row[k] * half[k] for k in range(i))) / row[i])
    log_size = sum(jnp.log(triangle[i][i]) for i in range(size))
    at_zero = 0.5 * ((pull + at_mean) * mean).sum(axis=-1)
    return log_factor + at_zero + 0.5 * sum(entry**2 for entry in half) - log_size, triangle, half


def _specimen_draws(key: Any, mean: Any, root: Any, terms: Any, triangle: Any, half: Any) -> Any:
    """Return theta (I, d) of all specimens given a population."""
    component_key, score_key = jax.random.split(key)
    component = jax.random.categorical(component_key, terms, axis=1)
    specimen, size = jnp.arange(len(component)), mean.shape[0]
    score = jax.random.normal(score_key, (len(component), size))
    z: list[Any] = [None] * size
    for i in reversed(range(size)):
        solved = sum(triangle[k][i][specimen, component] * z[k] for k in range(i + 1, size))
        z[i] = (half[i][specimen, component] + score[:, i] - solved) / triangle[i][i][specimen, component]
    return mean + jnp.stack(z, axis=1) @ root.T
