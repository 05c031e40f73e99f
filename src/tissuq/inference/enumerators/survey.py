"""Where the posteriors of the nonlinear parameters lie, and coordinates in which they are nearly flat."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tissuq.arrays import BoolArray, FloatArray
from tissuq.parameters.priors import Prior

LogDensity = Callable[[FloatArray], FloatArray]

PROBES = 10
"""Prior probabilities tried along each parameter: 2^-1, 2^-2, ... for positive ones, even ones for others."""
LATTICE_POINTS = {0: 1, 1: 10, 2: 7, 3: 5}
"""Settings tried along each parameter of the structure, by their number."""
MAX_ZOOMS = 8
"""Of the lattice on what holds mass."""
RELEVANT_LOG_DROP = 8.0
"""Log of the mass relative to the best setting below which a setting is left outside the zoom."""
MAX_NEWTON_STEPS = 25
COORDINATE_TOLERANCE = 0.02
"""Change of a coordinate at which the search for a mode ends."""
LEAST_CURVATURE = 0.04
"""Of a log density: no scale beyond five e-folds or units."""
DIFFERENCE_STEP = 1e-3
"""Of the finite differences, in a coordinate."""
REACH_E_FOLDS = 20.0
"""e-folds below the mode at which the logarithm of a parameter ends: about e^-20 of the mass lies below."""


@dataclass(frozen=True, eq=False)
class Survey:
    """Means and covariances of d coordinates under B posteriors, roughly.

    A coordinate is the logarithm of a parameter whose support is positive, and the parameter itself otherwise; the
    first ``structure`` of them cost a factorisation to vary.
    """

    structure: int
    is_log: BoolArray
    lower: FloatArray
    upper: FloatArray
    mean: FloatArray
    covariance: FloatArray


def parameters_of(coordinates: FloatArray, is_log: BoolArray) -> FloatArray:
    """Return the parameters (..., d) of coordinates (..., d), some of which are logarithms."""
    return np.where(is_log, np.exp(np.where(is_log, coordinates, 0.0)), coordinates)


def coordinates_of(parameters: FloatArray, is_log: BoolArray) -> FloatArray:
    """Return the coordinates (..., d) of parameters (..., d): of some their logarithms."""
    return np.where(is_log, np.log(np.where(is_log, parameters, 1.0)), parameters)


def log_prior_density(priors: Sequence[Sequence[Prior]], h: FloatArray) -> FloatArray:
    """Return the log prior density (B, N) of parameters (B, N, d) under the d priors of each data set."""
    if all(priors_of_one == priors[0] for priors_of_one in priors):
        columns = zip(priors[0], np.moveaxis(h, 2, 0), strict=True)
        return np.asarray(sum(prior.log_density(column) for prior, column in columns))
    return np.array(
        [log_prior_density([priors_of_one], row[None])[0] for priors_of_one, row in zip(priors, h, strict=True)]
    )


def survey(priors: Sequence[Sequence[Prior]], structure: int, log_likelihood: LogDensity) -> Survey:
    """Find where B posteriors of d parameters lie.

    The structure is tried on a lattice that zooms in on what holds mass; at every setting of it, the mode of the
    other coordinates is found by damped Newton steps, and Laplace's approximation tells its mass. The law of
    total covariance puts both together.

    Parameters
    ----------
    priors : B sequences of d Prior
        Those of the structure are the same for all data sets.
    structure : int
        Number of parameters, the first ones, that belong to the structure.
    log_likelihood : callable
        Maps parameters (B, N, d), with a structure shared by the data sets, to (B, N) values.
    """
    supports = np.array([[prior.support for prior in priors_of_one] for priors_of_one in priors])
    is_log = np.asarray((supports[:, :, 0] >= 0).all(axis=0), dtype=np.bool_)
    with np.errstate(divide="ignore"):
        bounds = np.where(is_log[:, None], np.log(np.maximum(supports, 0.0)), supports)

    def log_posterior(g: FloatArray) -> FloatArray:
        h = parameters_of(g, is_log)
        value = log_likelihood(h) + log_prior_density(priors, h) + (g * is_log).sum(axis=2)
        return np.where(np.isnan(value), -np.inf, value)

    probes = [_probes(priors_of_one, is_log) for priors_of_one in priors]
    probes_of_others = np.array([_grid(probes_of_one[structure:]) for probes_of_one in probes])
    low, high = (np.array([end(line) for line in probes[0][:structure]]) for end in (min, max))
    for _ in range(MAX_ZOOMS):
        settings, spacing = _lattice(low, high)
        modes, covariances, log_mass = _modes(log_posterior, settings, probes_of_others, bounds[:, structure:])
        weights = np.exp(log_mass - log_mass.max(axis=1, keepdims=True))
        seen = settings[(weights > np.exp(-RELEVANT_LOG_DROP)).any(axis=0)]
        closer = np.maximum(seen.min(axis=0) - spacing, low), np.minimum(seen.max(axis=0) + spacing, high)
        if not (closer[1] - closer[0] < 0.6 * (high - low)).any():
            break
        low, high = closer
    weights /= weights.sum(axis=1, keepdims=True)
    points = np.concatenate([np.broadcast_to(settings, (len(priors), *settings.shape)), modes], axis=2)
    mean = np.einsum("bk,bkd->bd", weights, points)
    away = points - mean[:, None]
    covariance = np.einsum("bk,bki,bkj->bij", weights, away, away)
    covariance[:, structure:, structure:] += np.einsum("bk,bkij->bij", weights, covariances)
    diagonal = np.arange(structure)
    covariance[:, diagonal, diagonal] += np.maximum(spacing, 1e-6) ** 2 / 12
    return Survey(structure, is_log, bounds[:, :, 0], bounds[:, :, 1], mean, covariance)


def climb(
    evaluate: LogDensity, point: FloatArray, low: FloatArray, high: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Climb to the modes, all at once, by damped Newton steps on finite differences."""
    value, gradient, curvature = _derivatives(evaluate, point)
    damping = np.full(value.shape, 1e-2)
    done = ~np.isfinite(value)
    for _ in range(MAX_NEWTON_STEPS):
        steep = curvature + damping[..., None, None] * np.eye(point.shape[-1])
        step = np.linalg.solve(steep, gradient[..., None])[..., 0]
        trial = np.clip(point + np.clip(step, -2.0, 2.0), low, high)
        derivatives = _derivatives(evaluate, trial)
        better = (derivatives[0] > value) & ~done
        moved = np.abs(trial - point).max(axis=-1)
        point = np.where(better[..., None], trial, point)
        value, gradient, curvature = (
            np.where(better.reshape(better.shape + (1,) * (new.ndim - 2)), new, old)
            for new, old in zip(derivatives, (value, gradient, curvature), strict=True)
        )
        damping = np.where(better, np.maximum(damping / 8, 1e-8), damping * 8)
        done |= (moved < COORDINATE_TOLERANCE) | (damping > 1e8)
        if done.all():
            break
    return point, value, curvature


def _probes(priors: Sequence[Prior], is_log: BoolArray) -> list[FloatArray]:
    """Return coordinates to try along each parameter."""
    powers, even = 0.5 ** np.arange(1, PROBES + 1), np.linspace(0.05, 0.95, PROBES)
    return [
        np.log(prior.quantile(np.append(1 - powers[3], powers))) if log else np.asarray(prior.quantile(even))
        for prior, log in zip(priors, is_log, strict=True)
    ]


def _lattice(low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
    count = LATTICE_POINTS[len(low)]
    lines = [np.linspace(*ends, count) for ends in zip(low, high, strict=True)]
    return _grid(lines), (high - low) / max(count - 1, 1)


def _grid(lines: Sequence[FloatArray]) -> FloatArray:
    """Return all combinations of values along each line, one a row."""
    return np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, len(lines)) if lines else np.zeros((1, 0))


def _modes(
    log_posterior: LogDensity, settings: FloatArray, probes: FloatArray, bounds: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the modes (B, K, t) of the other coordinates at K settings, their covariances, and log masses (B, K)."""
    count, (data_sets, _, t) = len(settings), probes.shape

    def evaluate(points: FloatArray) -> FloatArray:
        """Evaluate (B, K, P) at the other coordinates (B, K, P, t)."""
        fixed = np.broadcast_to(settings[:, None], (*points.shape[:3], settings.shape[1]))
        g = np.concatenate([fixed, points], axis=3)
        return log_posterior(g.reshape(data_sets, -1, g.shape[3])).reshape(points.shape[:3])

    tried = evaluate(np.broadcast_to(probes[:, None], (data_sets, count, *probes.shape[1:])))
    best = tried.argmax(axis=2)
    if not t:
        return np.zeros((data_sets, count, 0)), np.zeros((data_sets, count, 0, 0)), tried[:, :, 0]
    start = np.take_along_axis(probes, best[:, :, None], axis=1)
    inside = np.where(np.isfinite(bounds), bounds, np.sign(bounds) * 1e6)
    margin = 1e-4 * np.minimum(inside[:, :, 1] - inside[:, :, 0], 1.0)
    low, high = (inside[:, :, 0] + margin)[:, None], (inside[:, :, 1] - margin)[:, None]
    point, value, curvature = climb(evaluate, np.clip(start, low, high), low, high)
    covariance = np.asarray(np.linalg.inv(curvature), dtype=np.float64)
    return point, covariance, value + 0.5 * np.linalg.slogdet(covariance)[1]


def _derivatives(evaluate: LogDensity, point: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return values, gradients and negative Hessians, made positive, from finite differences."""
    t = point.shape[-1]
    pairs = [(i, j) for i in range(t) for j in range(i)]
    eye = np.eye(t) * DIFFERENCE_STEP
    stencil = np.array([np.zeros(t), *eye, *-eye, *(eye[i] + eye[j] for i, j in pairs)])
    values = evaluate(point[..., None, :] + stencil)
    centre, up, down, mixed = (
        values[..., 0],
        values[..., 1 : t + 1],
        values[..., t + 1 : 2 * t + 1],
        values[..., 2 * t + 1 :],
    )
    with np.errstate(invalid="ignore"):
        bend = (up - 2 * centre[..., None] + down) / DIFFERENCE_STEP**2
        hessian = bend[..., None] * np.eye(t)
        for index, (i, j) in enumerate(pairs):
            cross = mixed[..., index] - centre - (up[..., i] - down[..., i] + up[..., j] - down[..., j]) / 2
            hessian[..., i, j] = hessian[..., j, i] = cross / DIFFERENCE_STEP**2 - 0.5 * (bend[..., i] + bend[..., j])
        gradient = (up - down) / (2 * DIFFERENCE_STEP)
    return centre, np.nan_to_num(gradient, posinf=0, neginf=0), _positive(-hessian)


def _positive(curvature: FloatArray) -> FloatArray:
    """Return curvatures with eigenvalues of at least the least one."""
    is_finite = np.asarray(np.isfinite(curvature).all(axis=(-2, -1)))[..., None, None]
    values, vectors = np.linalg.eigh(np.where(is_finite, curvature, np.eye(curvature.shape[-1])))
    return np.asarray((vectors * np.maximum(values, LEAST_CURVATURE)[..., None, :]) @ vectors.swapaxes(-1, -2))


@dataclass(frozen=True, eq=False)
class Warp:
    """A map between the unit cube and d parameters with bounds, through one Cauchy distribution after another.

    Each parameter enters by its logarithm where its support is positive. Given those before it, its coordinate is
    the probability of a Cauchy distribution cut at its bounds, whose centre follows the others along the ridges of
    the posterior. The map is exact whatever centre and scale; good ones only save work. There is one for each of B
    data sets, all arrays but the first beginning with that dimension; they share the coordinates of the structure.

    Attributes
    ----------
    is_log : (d,) array
    lower, upper : (B, d) arrays
        Bounds of the parameters, or of their logarithms.
    anchor, centre, scale : (B, d) arrays
    slope : (B, d, d) array
        Given g before it, parameter j is centred on centre_j + slope_j (g - anchor).
    """

    is_log: BoolArray
    lower: FloatArray
    upper: FloatArray
    anchor: FloatArray
    centre: FloatArray
    slope: FloatArray
    scale: FloatArray

    def __getitem__(self, data_set: int) -> Warp:
        index = slice(data_set, data_set + 1)
        return Warp(self.is_log, *(value[index] for name, value in vars(self).items() if name != "is_log"))

    def parameters(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return parameters (B, N, d) at points (N, d) of the cube, and the log density (B, N) of the map there."""
        g = np.empty((len(self.scale), *u.shape))
        log_density = np.zeros(g.shape[:2])
        for j in range(u.shape[1]):
            centre, scale = self._centre(j, g), self.scale[:, j, None]
            start, mass = self._cut(j, centre)
            tangent = np.tan(np.pi * (start + mass * u[:, j] - 0.5))
            g[:, :, j] = np.clip(centre + scale * tangent, self.lower[:, j, None], self.upper[:, j, None])
            log_density -= np.log(np.pi * scale * (1 + tangent**2) * mass)
        h = parameters_of(g, self.is_log)
        return h, log_density - (g * self.is_log).sum(axis=2)

    def bounds(self, j: int) -> tuple[float, float]:
        """Return the lowest and highest value of parameter j of the first data set."""
        ends = np.array([self.lower[0, j], self.upper[0, j]])
        low, high = np.exp(ends) if self.is_log[j] else ends
        return float(low), float(high)

    def coordinate(self, j: int, value: FloatArray, preceding: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the coordinate u_j (N, k) of values (k,) given those before it (N, j), and du_j/dvalue.

        For the first data set.
        """
        g = np.zeros((1, len(preceding), len(self.is_log)))
        if j:
            padded = np.hstack([preceding, np.full((len(preceding), len(self.is_log) - j), 0.5)])
            h = self[0].parameters(padded)[0]
            g[:, :, :j] = coordinates_of(h, self.is_log)[:, :, :j]
        centre = self[0]._centre(j, g)
        start, mass = (value.T for value in self[0]._cut(j, centre))
        scale = self.scale[0, j]
        target = np.log(value) if self.is_log[j] else value
        distance = (target - centre.T) / scale
        slope = 1 / (np.pi * scale * (1 + distance**2) * mass)
        coordinate = (0.5 + np.arctan(distance) / np.pi - start) / mass
        return np.clip(coordinate, 0.0, 1.0 - 1e-12), slope / value if self.is_log[j] else slope

    def _centre(self, j: int, g: FloatArray) -> FloatArray:
        along = (g[:, :, :j] - self.anchor[:, None, :j]) @ self.slope[:, j, :j, None]
        return np.asarray(self.centre[:, j, None] + along[:, :, 0])

    def _cut(self, j: int, centre: FloatArray) -> tuple[FloatArray, FloatArray]:
        ends = ((bound[:, j, None] - centre) / self.scale[:, j, None] for bound in (self.lower, self.upper))
        start, end = (0.5 + np.arctan(distance) / np.pi for distance in ends)
        return start, end - start


def warp_along(survey: Survey) -> Warp:
    """Return the warp that follows the posteriors of a survey along their ridges."""
    anchor, covariance = survey.mean, survey.covariance
    centre, scale = anchor.copy(), np.empty_like(anchor)
    slope = np.zeros_like(covariance)
    shared = range(survey.structure) if len(anchor) > 1 else range(0)
    for j in range(anchor.shape[1]):
        covariances = covariance[:, :j, :j], covariance[:, :j, j]
        slope[:, j, :j] = np.linalg.solve(covariances[0], covariances[1][:, :, None])[:, :, 0]
        scale[:, j] = np.sqrt(covariance[:, j, j] - (covariances[1] * slope[:, j, :j]).sum(axis=1))
        if j in shared:
            slope[:, j], centre[:, j] = 0.0, anchor[:, j].mean()
            scale[:, j] = np.sqrt(covariance[:, j, j].mean() + anchor[:, j].var())
    for j in range(survey.structure):
        # Data sets on the same stretches then meet the same settings, whose factorisations are remembered.
        scale[:, j] = 2.0 ** np.round(np.log2(scale[:, j]))
        centre[:, j] = np.round(centre[:, j] / scale[:, j]) * scale[:, j]
    lower = np.where(survey.is_log, np.maximum(survey.lower, centre - REACH_E_FOLDS), survey.lower)
    if shared:
        lower[:, : survey.structure] = lower[:, : survey.structure].min(axis=0)
    return Warp(survey.is_log, lower, survey.upper, anchor, centre, slope, scale)
