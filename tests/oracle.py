"""A slow, plain, independent numerical oracle for the posterior of C10 and the evidence.

Nothing of the package is used. Every number is a sum, over explicit nodes, of

    prior density * dense multivariate normal density (Cholesky factor of the full n x n covariance)

over ALL parameters: no Gaussian integral is done in closed form, nothing is conjugate, no data summary
stands in for the data. Gaussian shapes are used for one thing only, to decide where the nodes go; a bad
choice would cost accuracy (seen by refining), never correctness. Every integration range is clipped to its
prior box, dimension by dimension, so hard bounds are ends of ranges, not jumps inside them.

- none, gp: C10 on a uniform Simpson grid; c and log psi on composite Gauss-Legendre panels;
- the others: C10 on a Simpson grid uniform in t, C10 = centre + w sinh(t), shared by all S;
  S = scale sinh(t) on composite Gauss-Legendre panels; the remaining 1 to 3 linear parameters by nested
  Gauss-Legendre, each range clipped to its box given the parameters before it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import cumulative_simpson
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq, lsq_linear

Array = NDArray[np.float64]
Box = tuple[float, float]

LINEAR: dict[str, tuple[str, ...]] = {
    "none": ("C10",),
    "constant": ("C10", "m0"),
    "linear": ("C10", "m0", "m1"),
    "quadratic": ("C10", "m0", "m1", "m2"),
    "mooney-rivlin": ("C10", "C01"),
    "yeoh": ("C10", "C20", "C30"),
    "gp": ("C10",),
}
NONLINEAR: dict[str, tuple[str, ...]] = {
    "none": (),
    "constant": ("S",),
    "linear": ("S",),
    "quadratic": ("S",),
    "mooney-rivlin": ("S",),
    "yeoh": ("S",),
    "gp": ("c", "psi"),
}
FORMULATIONS = tuple(LINEAR)

NEGLIGIBLE = 30.0  # natural-log drop below the highest point at which a range may be cut


@dataclass(frozen=True)
class Oracle:
    """What the brute force finds; ``means`` and ``sds`` hold every parameter except C10."""

    mean: float
    sd: float
    hpd_low: float
    hpd_high: float
    log_evidence: float
    means: dict[str, float]
    sds: dict[str, float]


def stress_per_unit(name: str, stretch: ArrayLike) -> Array:
    """Return the uniaxial engineering stress (or discrepancy) per unit of one linear parameter."""
    x = np.asarray(stretch, dtype=float)
    if name == "C10":
        return 2 * (x - x**-2)
    if name == "C01":
        return 2 * (1 - x**-3)
    if name == "C20":
        return 4 * (x**3 - 3 * x + 1 + 3 * x**-2 - 2 * x**-3)
    if name == "C30":
        return 6 * (x**5 - 6 * x**3 + 3 * x**2 + 9 * x - 6 - 9 * x**-2 + 12 * x**-3 - 4 * x**-4)
    return x ** {"m0": 0, "m1": 1, "m2": 2}[name]


def covariance(formulation: str, stretch: ArrayLike, noise_sd: float, h: Mapping[str, float]) -> Array:
    """Return the full n x n covariance of the data at given nonlinear parameters."""
    x = np.asarray(stretch, dtype=float)
    total = noise_sd**2 * np.eye(x.size)
    if formulation == "gp":
        total = total + h["c"] ** 2 * np.exp(-((x[:, None] - x[None, :]) ** 2) / (2 * h["psi"] ** 2))
    elif formulation != "none":
        total = total + h["S"] ** 2 * np.eye(x.size)
    return total


def brute_force(
    formulation: str,
    stretch: ArrayLike,
    stress: ArrayLike,
    noise_sd: float,
    priors: Mapping[str, Box],
    refine: float = 1.0,
) -> Oracle:
    """Integrate the joint density over every parameter; ``refine=2`` doubles the resolution everywhere.

    ``priors`` maps each parameter to the (low, high) of its uniform prior; entries that the formulation does
    not have are ignored. The normalised prior densities are part of the evidence.
    """
    problem = _Problem(
        formulation,
        np.asarray(stretch, dtype=float),
        np.asarray(stress, dtype=float),
        float(noise_sd),
        {name: priors[name] for name in LINEAR[formulation] + NONLINEAR[formulation]},
        float(refine),
    )
    return _few(problem) if len(LINEAR[formulation]) == 1 else _many(problem)


@dataclass(frozen=True)
class _Problem:
    formulation: str
    x: Array
    y: Array
    noise: float
    box: dict[str, Box]
    refine: float

    def whitened(self, h: Mapping[str, float]) -> tuple[Array, Array, float]:
        """Return L^-1 y, L^-1 X (columns in the order of LINEAR) and the log normalising constant."""
        factor = np.linalg.cholesky(covariance(self.formulation, self.x, self.noise, h))
        columns = [self.y] + [stress_per_unit(name, self.x) for name in LINEAR[self.formulation]]
        white = np.linalg.solve(factor, np.stack(columns, axis=1))
        constant = -0.5 * self.x.size * np.log(2 * np.pi) - float(np.sum(np.log(np.diag(factor))))
        return white[:, 0], white[:, 1:], constant

    def log_prior(self) -> float:
        return -float(sum(np.log(high - low) for low, high in self.box.values()))

    def count(self, n: int) -> int:
        return round(n * self.refine)


def _simpson(low: float, high: float, intervals: int) -> tuple[Array, Array]:
    intervals += intervals % 2
    nodes = np.linspace(low, high, intervals + 1)
    weights = np.ones(intervals + 1)
    weights[1:-1:2] = 4
    weights[2:-1:2] = 2
    return nodes, weights * (high - low) / intervals / 3


def _panels(low: float, high: float, panels: int, order: int) -> tuple[Array, Array]:
    u, w = np.polynomial.legendre.leggauss(order)
    edges = np.linspace(low, high, panels + 1)
    half = np.diff(edges)[:, None] / 2
    middle = ((edges[1:] + edges[:-1]) / 2)[:, None]
    return (middle + half * u).ravel(), (half * w).ravel()


def _summary(
    problem: _Problem,
    t: Array,
    t_weights: Array,
    c10: Array,
    slope: Array,
    joint: Array,
    moments: dict[str, tuple[Array, Array]],
    log_shift: float,
) -> Oracle:
    """Turn the (unnormalised, shifted) C10 density and integrated moments on the C10 grid into an Oracle."""
    weights = t_weights * slope
    total = float(weights @ joint)
    mean = float(weights @ (joint * c10)) / total
    sd = float(np.sqrt(weights @ (joint * (c10 - mean) ** 2) / total))
    means, sds = {}, {}
    for name, (first, second) in moments.items():
        means[name] = float(weights @ first) / total
        sds[name] = float(np.sqrt(max(weights @ second / total - means[name] ** 2, 0.0)))
    low, high = _shortest(t, c10, slope, joint)
    return Oracle(mean, sd, low, high, float(np.log(total)) + log_shift + problem.log_prior(), means, sds)


def _shortest(t: Array, c10: Array, slope: Array, density: Array, mass: float = 0.95) -> tuple[float, float]:
    """Return the shortest interval of C10 that holds ``mass``."""
    fine = np.linspace(t[0], t[-1], 40001)
    value = np.exp(CubicSpline(t, np.log(np.maximum(density, 1e-300)))(fine))
    place = CubicSpline(t, c10)(fine)
    rate = CubicSpline(t, slope)(fine)
    below = cumulative_simpson(value * rate, x=fine, initial=0.0)
    below /= below[-1]

    def ends(alpha: float) -> tuple[float, float]:
        at = np.interp([alpha, alpha + mass], below, fine)
        low, high = np.interp(at, fine, place)
        return float(low), float(high)

    def slack(alpha: float) -> float:
        at = np.interp([alpha, alpha + mass], below, fine)
        f_low, f_high = np.interp(at, fine, value)
        return float(f_low - f_high)

    alphas = np.linspace(0.0, 1.0 - mass, 2001)
    widths = [high - low for low, high in map(ends, alphas)]
    best = int(np.argmin(widths))
    left, right = alphas[max(best - 1, 0)], alphas[min(best + 1, 2000)]
    if slack(left) < 0 < slack(right):  # interior minimum: the densities at both ends are equal
        return ends(float(brentq(slack, left, right, xtol=1e-12)))
    return ends(float(alphas[best]))


# --- one linear parameter: none, gp -------------------------------------------------------------------------


def _few(problem: _Problem) -> Oracle:
    names = NONLINEAR[problem.formulation]
    # psi is integrated over its logarithm; the Jacobian psi goes into the weights below.
    ranges = {n: _to_scale(n, problem.box[n]) for n in names}
    c10_range = problem.box["C10"]
    for _ in range(3):  # zoom: look everywhere (ends included), keep what is not negligible
        axes = {n: np.linspace(*ranges[n], 31) for n in names}
        grid = np.linspace(*c10_range, 401)
        log = np.stack([_log_line(problem, h, grid) for h in _points(axes)])
        log = log.reshape([31] * len(names) + [401])
        keep = log > log.max() - NEGLIGIBLE
        for i, n in enumerate(names):
            ranges[n] = _cut(axes[n], keep.any(axis=tuple(j for j in range(log.ndim) if j != i)))
        c10_range = _cut(grid, keep.any(axis=tuple(range(len(names)))))
    shift = float(log.max())

    c10, weights = _simpson(*c10_range, problem.count(240))
    rules = {n: _panels(*ranges[n], problem.count(5), 8) for n in names}
    node_weights = np.ones(1)
    for n in names:
        node_weights = np.outer(node_weights, rules[n][1]).ravel()
    joint = np.zeros(c10.size)
    moments = {n: (np.zeros(c10.size), np.zeros(c10.size)) for n in names}
    for h, weight in zip(_points({n: rules[n][0] for n in names}), node_weights, strict=True):
        jacobian = h.get("psi", 1.0)
        density = weight * jacobian * np.exp(_log_line(problem, h, c10) - shift)
        joint += density
        for n in names:
            moments[n][0][:] += density * h[n]
            moments[n][1][:] += density * h[n] ** 2
    return _summary(problem, c10, weights, c10, np.ones(c10.size), joint, moments, shift)


def _to_scale(name: str, box: Box) -> Box:
    return (float(np.log(box[0])), float(np.log(box[1]))) if name == "psi" else box


def _points(axes: dict[str, Array]) -> list[dict[str, float]]:
    points: list[dict[str, float]] = [{}]
    for name, axis in axes.items():
        back = np.exp(axis) if name == "psi" else axis
        points = [p | {name: float(v)} for p in points for v in back]
    return points


def _log_line(problem: _Problem, h: Mapping[str, float], c10: Array) -> Array:
    y, x, constant = problem.whitened(h)
    return constant - 0.5 * np.sum((y - c10[:, None] * x[:, 0]) ** 2, axis=1)


def _cut(axis: Array, keep: NDArray[np.bool_]) -> Box:
    """Return the range of the kept points, one step wider where there is room."""
    at = np.flatnonzero(keep)
    return float(axis[max(at[0] - 1, 0)]), float(axis[min(at[-1] + 1, axis.size - 1)])


# --- several linear parameters and S ------------------------------------------------------------------------


def _many(problem: _Problem) -> Oracle:
    names = LINEAR[problem.formulation]
    boxes = np.array([problem.box[n] for n in names])
    design = np.stack([stress_per_unit(n, problem.x) for n in names], axis=1)
    # The best point inside the box. The covariance is a multiple of I, so it is the same at every S.
    best = np.asarray(lsq_linear(design, problem.y, bounds=(boxes[:, 0], boxes[:, 1]), tol=1e-14).x)
    best = np.clip(best, boxes[:, 0], boxes[:, 1])

    # Where S matters: highest density at each S times a volume it cannot exceed.
    s_low, s_high = problem.box["S"]
    scale = max(problem.noise, 1e-3 * s_high)
    t = np.linspace(np.arcsinh(s_low / scale), np.arcsinh(s_high / scale), 301)
    peaks, bounds = np.empty(t.size), np.empty(t.size)
    for i, s in enumerate(scale * np.sinh(t)):
        y, x, constant = problem.whitened({"S": float(s)})
        peaks[i] = constant - 0.5 * float(np.sum((y - x @ best) ** 2))
        spread = np.sqrt(np.diag(_shape(x, boxes) @ _shape(x, boxes).T))
        bounds[i] = peaks[i] + float(np.sum(np.log(np.minimum(spread, boxes[:, 1] - boxes[:, 0]))))
    bounds += np.log(np.cosh(t))
    t_low, t_high = _cut(t, bounds > bounds.max() - NEGLIGIBLE)
    shift = float(peaks[bounds > bounds.max() - NEGLIGIBLE].max())

    # A rough pass over the whole C10 box finds where C10 lives; then the real pass.
    top = scale * float(np.sinh(t[int(np.argmax(bounds))]))
    width = 2 * float(_shape(problem.whitened({"S": top})[1], boxes)[0, 0])
    centre, c10_range = float(best[0]), problem.box["C10"]
    for _ in range(2):
        rough = _pass(problem, best, boxes, (t_low, t_high), scale, (c10_range, centre, width), shift, True)
        grid, weights, joint = rough[2], rough[1] * rough[3], rough[4]
        mass = weights @ joint
        mean = float(weights @ (joint * grid) / mass)
        centre, width = mean, 2 * float(np.sqrt(weights @ (joint * (grid - mean) ** 2) / mass))
        c10_range = _cut(grid, joint > joint.max() * np.exp(-NEGLIGIBLE))
    final = _pass(problem, best, boxes, (t_low, t_high), scale, (c10_range, centre, width), shift, False)
    return _summary(problem, *final, shift)


def _shape(white_design: Array, boxes: Array) -> Array:
    """Return a lower triangle that sets where nodes go: nothing else depends on it."""
    widths = boxes[:, 1] - boxes[:, 0]
    precision = white_design.T @ white_design + np.diag(1 / widths**2)
    return np.linalg.cholesky(np.linalg.inv(precision))


def _pass(
    problem: _Problem,
    best: Array,
    boxes: Array,
    t_range: Box,
    scale: float,
    c10_map: tuple[Box, float, float],
    shift: float,
    rough: bool,
) -> tuple[Any, ...]:
    names = LINEAR[problem.formulation]
    inner = len(names) - 1
    (low, high), centre, width = c10_map
    ends = np.arcsinh((np.array([low, high]) - centre) / width)
    t, t_weights = _simpson(ends[0], ends[1], 64 if rough else problem.count(80))
    c10 = np.clip(centre + width * np.sinh(t), low, high)
    slope = width * np.cosh(t)
    order = {1: 40, 2: 20, 3: 16}[inner]
    order = 10 if rough else problem.count(order)
    reach = 5.0 if rough else (6.0 if problem.refine <= 1 else 7.0)
    panels = 2 if rough else problem.count(4)

    joint = np.zeros(c10.size)
    moments = {n: (np.zeros(c10.size), np.zeros(c10.size)) for n in (*names[1:], "S")}
    u, u_weights = np.polynomial.legendre.leggauss(order)
    look, look_weights = np.polynomial.legendre.leggauss(7)
    step = max(1, 100_000 // order**inner // problem.x.size)
    for t_s, weight in zip(*_panels(*t_range, panels, 8), strict=True):
        s = scale * float(np.sinh(t_s))
        weight = float(weight) * scale * float(np.cosh(t_s))  # the Jacobian of S = scale sinh(t)
        white_y, white_x, constant = problem.whitened({"S": s})
        shape = _shape(white_x, boxes)
        # Leave out C10 values at which, for this S, a coarse look finds nothing: densities below exp(-40).
        theta, _ = _nest(c10, best, shape, boxes, reach, look, look_weights)
        seen = constant - 0.5 * _square(white_y, white_x, theta, look.size).min(axis=1)
        rows = np.flatnonzero(seen - shift > -40.0)
        for start in range(0, rows.size, step):
            part = rows[start : start + step]
            theta, volume = _nest(c10[part], best, shape, boxes, reach, u, u_weights)
            log = constant - 0.5 * _square(white_y, white_x, theta, order)
            density = weight * volume * np.exp(log - shift)
            total = density.sum(axis=1)
            joint[part] += total
            moments["S"][0][part] += total * s
            moments["S"][1][part] += total * s**2
            for d, n in enumerate(names[1:], start=1):
                moments[n][0][part] += (density * theta[..., d]).sum(axis=1)
                moments[n][1][part] += (density * theta[..., d] ** 2).sum(axis=1)
    return t, t_weights, c10, slope, joint, moments


def _square(white_y: Array, white_x: Array, theta: Array, last: int) -> Array:
    """Return |L^-1 (y - X theta)|^2 at every node, the residual vector written out in full.

    Runs of ``last`` nodes differ in the last parameter only, so they share the other terms. No BLAS: its
    threads fight over a busy machine.
    """
    theta = theta.reshape(theta.shape[0], -1, last, theta.shape[2])
    shared = white_y - np.einsum("ijd,nd->ijn", theta[:, :, 0, :-1], white_x[:, :-1])
    residual = theta[..., -1, None] * white_x[:, -1]
    np.subtract(shared[:, :, None, :], residual, out=residual)
    return np.einsum("ijkn,ijkn->ijk", residual, residual).reshape(theta.shape[0], -1)


def _nest(
    c10: Array, best: Array, shape: Array, boxes: Array, reach: float, u: Array, u_weights: Array
) -> tuple[Array, Array]:
    """Return nodes (C10 value, node, parameter) and their volumes, each range clipped to its prior box.

    Parameter d runs over its middle given the parameters before it, plus or minus ``reach`` spreads, cut at
    its box; its middle moves with the parameters before it as ``shape`` says.
    """
    theta = c10[:, None, None].copy()  # (C10 value, nodes so far, parameters so far)
    z = (theta - best[0]) / shape[0, 0]
    volume = np.ones((c10.size, 1))
    for d in range(1, best.size):
        middle = best[d] + z @ shape[d, :d]
        low = np.clip(middle - reach * shape[d, d], boxes[d, 0], boxes[d, 1])
        high = np.clip(middle + reach * shape[d, d], boxes[d, 0], boxes[d, 1])
        value = ((high + low) / 2)[..., None] + ((high - low) / 2)[..., None] * u
        volume = (volume * (high - low) / 2)[..., None] * u_weights
        z_new = (value - middle[..., None]) / shape[d, d]
        z = np.concatenate([np.repeat(z[:, :, None], u.size, 2), z_new[..., None]], axis=-1)
        theta = np.concatenate([np.repeat(theta[:, :, None], u.size, 2), value[..., None]], axis=-1)
        z, theta = z.reshape(c10.size, -1, d + 1), theta.reshape(c10.size, -1, d + 1)
        volume = volume.reshape(c10.size, -1)
    return theta, volume
