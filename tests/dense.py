"""Dense quadrature over every parameter, for any noise, discrepancy and prior: an oracle for the inference engine.

Nothing of the package's inference is used, nor its stress function. Given the nonlinear parameters, the covariance of
all measurements is written out as a full matrix and factorised, and the linear parameters are integrated by least
squares; what their bounds cut off is integrated by nested Gauss-Legendre rules. The nonlinear parameters run over a
tensor product of composite Gauss-Legendre rules, from end to end of their priors, cut where the density is e^-30 of the
largest. ``refine`` multiplies the number of panels; the change it makes is the oracle's own error.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.special import log_ndtr
from scipy.stats import norm

from oracle import stress_per_unit

Array = NDArray[np.float64]

NEGLIGIBLE = 30.0
REACH = 10.0
INACTIVE = 1e-11
BLOCK = 20_000
ZOOMS = 4
TERMS = {
    "none": (),
    "constant": ("m0",),
    "linear": ("m0", "m1"),
    "quadratic": ("m0", "m1", "m2"),
    "mooney-rivlin": ("C01",),
    "yeoh": ("C20", "C30"),
    "gp": (),
}
"""The linear parameters of every discrepancy."""


@dataclass(frozen=True)
class Linear:
    """A prior of a linear parameter: uniform between bounds, or a Gaussian cut at them and normalised."""

    low: float
    high: float
    mean: float = 0.0
    sd: float = np.inf

    @property
    def log_constant(self) -> float:
        """Log of the factor of exp(-(x - mean)^2 / (2 sd^2)) within the bounds."""
        if self.sd == np.inf:
            return -float(np.log(self.high - self.low))
        inside = norm.cdf((self.high - self.mean) / self.sd) - norm.cdf((self.low - self.mean) / self.sd)
        return -float(np.log(self.sd * np.sqrt(2 * np.pi) * inside))


@dataclass(frozen=True)
class Axis:
    """A nonlinear parameter: bounds, normalised log prior density, and the value above which nodes are logarithmic."""

    low: float
    high: float
    scale: float
    log_prior: Callable[[Array], Array] | None = None

    def density(self, value: Array) -> Array:
        return np.full(value.shape, -np.log(self.high - self.low)) if self.log_prior is None else self.log_prior(value)

    @property
    def ends(self) -> tuple[float, float]:
        return float(np.arcsinh(self.low / self.scale)), float(np.arcsinh(self.high / self.scale))


@dataclass(frozen=True)
class Problem:
    """y = X(h) b + e with e ~ N(0, V(h)), b with bounds, h on axes.

    ``design`` maps values of h, each (M,), to (n, p) or (M, n, p); ``covariance`` maps them to (M, n, n).
    """

    stress: Array
    design: Callable[[Mapping[str, Array]], Array]
    covariance: Callable[[Mapping[str, Array]], Array]
    linear: Mapping[str, Linear]
    axes: Mapping[str, Axis]


@dataclass(frozen=True)
class Dense:
    """What the quadrature finds; ``mean``, ``sd`` and ``hdi`` are those of the wanted linear parameter.

    ``of_wanted`` returns nodes, their weights and its density there, which takes longer than all else.
    """

    log_evidence: float
    means: dict[str, float]
    sds: dict[str, float]
    weights: Array
    settings: dict[str, Array]
    of_wanted: Callable[[], tuple[Array, Array, Array]]

    @cached_property
    def _wanted(self) -> tuple[Array, Array, Array]:
        return self.of_wanted()

    @property
    def mean(self) -> float:
        grid, steps, density = self._wanted
        return float(steps @ (density * grid)) / float(steps @ density)

    @property
    def sd(self) -> float:
        grid, steps, density = self._wanted
        return float(np.sqrt(steps @ (density * (grid - self.mean) ** 2) / (steps @ density)))

    @cached_property
    def hdi(self) -> tuple[float, float]:
        grid, _, density = self._wanted
        return shortest(grid, density)

    def mass(self, low: float, high: float) -> float:
        """Return the probability of the wanted parameter between two values."""
        grid, _, density = self._wanted
        fine, value = _finely(grid, density)
        below = cumulative(fine, value)
        return float(np.diff(np.interp([low, high], fine, below))[0])


def columns(names: Sequence[str], stretch: Array) -> Array:
    """Return the (n, p) uniaxial stresses of unit parameters, from their closed forms."""
    return np.stack([stress_per_unit(name, np.asarray(stretch, dtype=float)) for name in names], axis=1)


def problem_of(
    discrepancy: str,
    stretch: Array,
    stress: Array,
    linear: Mapping[str, Linear],
    axes: Mapping[str, Axis],
    noise_sd: float | None = None,
    level: Array | None = None,
    shared: bool = False,
    material: Sequence[str] = ("C10",),
) -> Problem:
    """Return the problem of a polynomial material with one of the seven discrepancies.

    ``noise_sd`` is known, or the axes have one; ``level`` multiplies an axis ``noise_share``; ``shared`` lets equal
    stretches share S.
    """
    x = np.asarray(stretch, dtype=float)
    design = columns((*material, *TERMS[discrepancy]), x)
    same = (x[:, None] == x).astype(float)
    eye = np.eye(len(x))

    def covariance(h: Mapping[str, Array]) -> Array:
        count = len(next(iter(h.values()))) if h else 1
        sd = np.broadcast_to(h.get("noise_sd", np.full(count, noise_sd))[:, None], (count, len(x)))
        if level is not None:
            sd = sd + h["noise_share"][:, None] * level
        total = sd[:, :, None] ** 2 * eye
        if "S" in h:
            total = total + h["S"][:, None, None] ** 2 * (same if shared else eye)
        if "c" in h:
            away = (x[:, None] - x) / h["psi"][:, None, None]
            total = total + h["c"][:, None, None] ** 2 * np.exp(-0.5 * away**2)
        return total

    return Problem(np.asarray(stress, dtype=float), lambda h: design, covariance, linear, axes)


def integrate(problem: Problem, wanted: str = "", refine: float = 1.0, nodes: int = 0) -> Dense:
    """Integrate over everything; ``wanted`` is the linear parameter whose density is computed (the first one)."""
    names = tuple(problem.axes)
    ranges = {name: axis.ends for name, axis in problem.axes.items()}
    bounds = np.array([[prior.low, prior.high] for prior in problem.linear.values()]).reshape(-1, 2)
    coarse = {0: 1, 1: 201, 2: 41, 3: 17}[len(names)]
    for _ in range(3 if names else 0):
        lines = {name: np.linspace(*ranges[name], coarse) for name in names}
        h, _ = _settings(problem, {name: (line, np.ones(coarse)) for name, line in lines.items()})
        log, mean, covariance = _log_given(problem, h)
        log = log + _log_prior(problem, h) + sum(0.5 * np.log(h[n] ** 2 + problem.axes[n].scale ** 2) for n in names)
        log = log + log_box_mass(mean, covariance, bounds, 16, log)
        keep = (log > log.max() - NEGLIGIBLE).reshape([coarse] * len(names))
        for place, name in enumerate(names):
            seen = np.flatnonzero(keep.any(axis=tuple(k for k in range(len(names)) if k != place)))
            line = lines[name]
            ranges[name] = line[max(seen[0] - 1, 0)], line[min(seen[-1] + 1, coarse - 1)]
    panels = nodes or round({0: 1, 1: 40, 2: 14, 3: 5}[len(names)] * refine)
    h, log_weights = _settings(problem, {name: _panels(*ranges[name], panels, 8) for name in names})
    log, mean, covariance = _log_given(problem, h)
    log = log + _log_prior(problem, h) + log_weights
    inside = np.full(len(log), -np.inf)
    ceiling = log + _log_single_mass(mean, covariance, bounds)
    heavy = ceiling > ceiling.max() - 2 * NEGLIGIBLE
    order = round(48 * refine)
    inside[heavy] = log_box_mass(mean[heavy], covariance[heavy], bounds, order, log[heavy])
    total = log + inside
    top = total.max()
    weights = np.exp(total - top)
    log_evidence = float(top + np.log(weights.sum()))
    weights /= weights.sum()
    means = {name: float(weights @ h[name]) for name in names}
    sds = {name: float(np.sqrt(weights @ (h[name] - means[name]) ** 2)) for name in names}

    def of_wanted() -> tuple[Array, Array, Array]:
        first = list(problem.linear).index(wanted or next(iter(problem.linear)))
        used = heavy & (total > top - NEGLIGIBLE)
        return _density(log[used] - log_evidence, mean[used], covariance[used], bounds, first, order, refine)

    return Dense(log_evidence, means, sds, weights, h, of_wanted)


def log_box_mass(mean: Array, covariance: Array, bounds: Array, order: int, log_weights: Array) -> Array:
    """Return the log mass (M,) of M Gaussians between bounds (p, 2), by nested rules over all parameters but one.

    A parameter is left out where the Gaussians, with their weights, have nothing beyond its bounds even when they
    are moved by as many standard deviations as any mean lies outside.
    """
    sd = np.sqrt(np.einsum("mii->mi", covariance))
    low, high = (bounds[:, 0] - mean) / sd, (bounds[:, 1] - mean) / sd
    depth = np.maximum(np.maximum(low, -high), 0.0).max(axis=1, initial=0.0)[:, None]
    beyond = norm.cdf(low + depth) + norm.sf(high - depth)
    active = np.flatnonzero(np.exp(log_weights - log_weights.max()) @ beyond > INACTIVE)
    mean, covariance, bounds = mean[:, active], covariance[:, active[:, None], active], bounds[active]
    if not len(active):
        return np.zeros(len(mean))
    if len(active) == 1:
        return log_interval(low[:, active[0]], high[:, active[0]])
    blocks = np.array_split(np.arange(len(mean)), 1 + len(mean) * order ** (len(active) - 1) // 1_000_000)
    found = [_nested(mean[b], covariance[b], bounds, order) for b in blocks]
    return np.concatenate(found)


def _log_single_mass(mean: Array, covariance: Array, bounds: Array) -> Array:
    """Return the least log mass (M,) within the bounds (p, 2) of single parameters."""
    sd = np.sqrt(np.einsum("mii->mi", covariance))
    return log_interval((bounds[:, 0] - mean) / sd, (bounds[:, 1] - mean) / sd).min(axis=1, initial=0.0)


def _nested(mean: Array, covariance: Array, bounds: Array, order: int) -> Array:
    if mean.shape[1] == 1:
        spread = np.sqrt(np.maximum(covariance[:, 0, 0], 1e-300))
        return log_interval((bounds[0, 0] - mean[:, 0]) / spread, (bounds[0, 1] - mean[:, 0]) / spread)
    sd = np.sqrt(covariance[:, 0, 0])
    low, high = (bounds[0, 0] - mean[:, 0]) / sd, (bounds[0, 1] - mean[:, 0]) / sd
    slope = covariance[:, 1:, 0] / sd[:, None]
    rest = covariance[:, 1:, 1:] - slope[:, :, None] * slope[:, None]
    p = rest.shape[1]

    def log_density(score: Array) -> Array:
        """Return the log density of the first parameter at scores (M, k), the others inside their bounds."""
        centre = (mean[:, None, 1:] + score[:, :, None] * slope[:, None]).reshape(-1, p)
        every = np.broadcast_to(rest[:, None], (*score.shape, p, p)).reshape(-1, p, p)
        inside = _nested(centre, every, bounds[1:], order).reshape(score.shape)
        return inside - 0.5 * score**2 - 0.5 * np.log(2 * np.pi)

    # The log density is concave: where a coarse look finds it high it is high, and nowhere else.
    near = np.abs(np.clip(0.0, low, high))
    start, end = np.maximum(low, -near - 60), np.minimum(high, near + 60)
    steps = np.linspace(0, 1, 17)
    for _ in range(ZOOMS):
        score = start[:, None] + (end - start)[:, None] * steps
        log = log_density(score)
        seen = log > log.max(axis=1, keepdims=True) - 45.0
        first, last = seen.argmax(axis=1), 16 - seen[:, ::-1].argmax(axis=1)
        start, end = (
            np.take_along_axis(score, place[:, None], 1)[:, 0]
            for place in (np.maximum(first - 1, 0), np.minimum(last + 1, 16))
        )
    nodes, node_weights = _panels(0.0, 1.0, 4, order // 4)
    log = log_density(start[:, None] + (end - start)[:, None] * nodes) + np.log((end - start)[:, None] * node_weights)
    top = log.max(axis=1, keepdims=True)
    return top[:, 0] + np.log(np.exp(log - top).sum(axis=1))


def log_interval(low: Array, high: Array) -> Array:
    """Return log(Phi(high) - Phi(low)), in the lower tail, where the digits are."""
    flip = low > 0
    start, end = np.where(flip, -high, low), np.where(flip, -low, high)
    upper = log_ndtr(end)
    return upper + np.log(-np.expm1(np.minimum(log_ndtr(start) - upper, -1e-300)))


def shortest(grid: Array, density: Array, mass: float = 0.95) -> tuple[float, float]:
    """Return the shortest interval that holds a mass, from a density on a grid."""
    fine, value = _finely(grid, density)
    below = cumulative(fine, value)
    alphas = np.linspace(0, 1 - mass, 20_001)
    low, high = np.interp(alphas, below, fine), np.interp(alphas + mass, below, fine)
    best = int((high - low).argmin())
    return float(low[best]), float(high[best])


def cumulative(points: Array, density: Array) -> Array:
    """Return the cumulative probabilities at points, by trapezoids."""
    below = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(points))])
    return below / below[-1]


def _finely(grid: Array, density: Array) -> tuple[Array, Array]:
    """Return many points between the nodes, and a little beyond them as far as their panels, with the density."""
    nodes = np.polynomial.legendre.leggauss(8)[0]
    beyond = (1 + nodes[0]) / (nodes[7] - nodes[0])
    ends = grid[0] - (grid[7] - grid[0]) * beyond, grid[-1] + (grid[-1] - grid[-8]) * beyond
    seen = density > 1e-10 * density.max()
    kept = np.concatenate([[ends[0]] if seen[0] else [], grid[seen], [ends[1]] if seen[-1] else []])
    fine = np.interp(np.linspace(0, len(kept) - 1, 200_001), np.arange(len(kept)), kept)
    return fine, np.exp(CubicSpline(grid[seen], np.log(density[seen]))(fine))


def _density(
    log: Array, mean: Array, covariance: Array, bounds: Array, place: int, order: int, refine: float
) -> tuple[Array, Array, Array]:
    """Return nodes, weights and the posterior density of one linear parameter."""
    sd = np.sqrt(covariance[:, place, place])
    low, high = max(bounds[place, 0], (mean[:, place] - REACH * sd).min()), None
    high = min(bounds[place, 1], (mean[:, place] + REACH * sd).max())
    if low >= high:  # all Gaussians lie beyond a bound
        low, high = bounds[place]
    for _ in range(3):
        grid = np.linspace(low, high, 61)
        density = _density_at(grid, log, mean, covariance, bounds, place, order // 2)
        seen = np.flatnonzero(density > density.max() * np.exp(-NEGLIGIBLE))
        low, high = grid[max(seen[0] - 1, 0)], grid[min(seen[-1] + 1, 60)]
    # Close where most of the density is, however far its tails reach.
    order_of_sd = np.argsort(sd)
    shares = np.cumsum(np.exp(log - log.max())[order_of_sd])
    width = min(sd[order_of_sd][np.searchsorted(shares, 0.5 * shares[-1])], high - low)
    centre = grid[density.argmax()]
    t, steps = _panels(*np.arcsinh((np.array([low, high]) - centre) / width), round(40 * refine), 8)
    grid, steps = np.clip(centre + width * np.sinh(t), low, high), steps * width * np.cosh(t)
    density = _density_at(grid, log, mean, covariance, bounds, place, order)
    return grid, steps, density


def _density_at(
    grid: Array, log: Array, mean: Array, covariance: Array, bounds: Array, place: int, order: int
) -> Array:
    others = [k for k in range(mean.shape[1]) if k != place]
    variance = covariance[:, place, place]
    away = grid[None] - mean[:, place, None]
    log_density = log[:, None] - 0.5 * away**2 / variance[:, None] - 0.5 * np.log(2 * np.pi * variance)[:, None]
    if others:
        slope = covariance[:, others, place] / variance[:, None]
        rest = covariance[:, others][:, :, others] - slope[:, :, None] * slope[:, None] * variance[:, None, None]
        rest_mean = mean[:, None, others] + away[:, :, None] * slope[:, None]
        used = log_density > log_density.max() - NEGLIGIBLE
        every = np.broadcast_to(rest[:, None], (*away.shape, len(others), len(others)))[used]
        log_density[~used] = -np.inf
        log_density[used] += log_box_mass(rest_mean[used], every, bounds[others], order, log_density[used])
    return np.exp(log_density).sum(axis=0)


def _settings(problem: Problem, rules: Mapping[str, tuple[Array, Array]]) -> tuple[dict[str, Array], Array]:
    """Return all combinations of nodes, and their log weights with the Jacobians of x = scale sinh(t)."""
    log_weights, values = np.zeros(1), {}
    for name, (nodes, weights) in rules.items():
        scale = problem.axes[name].scale
        axis = problem.axes[name]
        new = np.clip(scale * np.sinh(nodes), axis.low + 1e-9 * scale, axis.high)  # no division by zero at the end
        values = {known: np.repeat(old, len(new)) for known, old in values.items()}
        values[name] = np.tile(new, len(log_weights))
        log_weights = np.add.outer(log_weights, np.log(weights * scale * np.cosh(nodes))).ravel()
    return values, log_weights


def _log_prior(problem: Problem, h: Mapping[str, Array]) -> Array:
    return np.asarray(sum(problem.axes[name].density(value) for name, value in h.items()))


def _log_given(problem: Problem, h: Mapping[str, Array]) -> tuple[Array, Array, Array]:
    """Return log p(y | h) without bounds, and mean and covariance of the linear parameters, block by block."""
    count = len(next(iter(h.values()))) if h else 1
    edges = [*range(0, count, BLOCK), count]
    parts = [_block(problem, {k: v[a:b] for k, v in h.items()}) for a, b in pairwise(edges)]
    return tuple(np.concatenate(part) for part in zip(*parts, strict=True))


def _block(problem: Problem, h: Mapping[str, Array]) -> tuple[Array, Array, Array]:
    n, priors = len(problem.stress), list(problem.linear.values())
    p = len(priors)
    factor = np.linalg.cholesky(problem.covariance(h))
    rows = np.empty((len(factor), n, p + 1))
    rows[:, :, :p], rows[:, :, p] = problem.design(h), problem.stress
    white = np.linalg.solve(factor, rows)
    extra = np.zeros((len(factor), p, p + 1))
    for k, prior in enumerate(priors):
        extra[:, k, k], extra[:, k, -1] = 1 / prior.sd, prior.mean / prior.sd
    triangle = np.linalg.qr(np.concatenate([white, extra], axis=1), mode="r")
    inverse = np.linalg.inv(triangle[:, :p, :p])
    mean = (inverse @ triangle[:, :p, p:])[:, :, 0]
    log = -np.log(np.einsum("mii->mi", factor)).sum(axis=1) - 0.5 * (n - p) * np.log(2 * np.pi)
    log -= np.log(np.abs(np.einsum("mii->mi", triangle[:, :p, :p]))).sum(axis=1)
    log -= 0.5 * triangle[:, p, p] ** 2
    log += sum(prior.log_constant for prior in priors)
    return log, mean, inverse @ inverse.swapaxes(1, 2)


def _panels(low: float, high: float, panels: int, order: int) -> tuple[Array, Array]:
    nodes, weights = np.polynomial.legendre.leggauss(order)
    edges = np.linspace(low, high, panels + 1)
    half = np.diff(edges)[:, None] / 2
    middle = ((edges[1:] + edges[:-1]) / 2)[:, None]
    return (middle + half * nodes).ravel(), (half * weights).ravel()
