"""Coordinates in which a bounded posterior is close to a standard normal: box, real line, whitened.

A sampler meets neither bounds nor stiffness there. Every bounded coordinate is stretched to the real line,
the modes are found on the line by damped Newton steps, and the Hessian at a mode gives the affine map that
whitens.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import ndtr
from numpy.typing import ArrayLike
from scipy.special import ndtri

from tissuq.arrays import BoolArray, FloatArray
from tissuq.errors import InputError

jax.config.update("jax_enable_x64", True)  # type: ignore[no-untyped-call]

LogDensity = Callable[[Any], Any]
Derivatives = Callable[[Any], tuple[Any, Any, Any]]
"""Maps a point to the value, the gradient and the Hessian of a log density."""

MODE_SEARCHES = 8
"""Starting points of the search for modes: the given one, the others scattered over the box."""
NEGLIGIBLE_MASS = 1e-2
"""Modes with less than this share of the best mode's probability, by Laplace's approximation, are ignored."""
SAME_MODE_SDS = 0.5
"""Two modes closer than this, in standard deviations, are one."""


@dataclass(frozen=True)
class Box:
    r"""An open box, of which any side may be infinite, and its map to the real line.

    Per coordinate, with :math:`\Phi` the standard normal distribution function:

    .. math::

        x = u, \qquad x = l + e^u, \qquad x = h - e^u, \qquad x = l + (h - l)\, \Phi(u)

    for no bound, a lower bound :math:`l`, an upper bound :math:`h`, and both. A uniform density between two
    bounds becomes a standard normal one on the line; the more usual logistic map would give it exponential
    tails, in which trajectories are slow. Points keep their relative accuracy towards either bound, and
    rounding never puts a point on a bound.

    Parameters
    ----------
    lower, upper : (d,) array
        The bounds; ``-inf`` and ``inf`` where there is none.

    Raises
    ------
    InputError
        When the bounds have different lengths or leave no room between them.

    Examples
    --------
    >>> box = Box([0.0, -50.0], [np.inf, 50.0])
    >>> line = box.to_line([2.0, 25.0])
    >>> np.round(np.asarray(box.from_line(line)), 12).tolist()
    [2.0, 25.0]
    """

    lower: FloatArray
    upper: FloatArray

    def __init__(self, lower: ArrayLike, upper: ArrayLike) -> None:
        object.__setattr__(self, "lower", np.atleast_1d(np.asarray(lower, dtype=np.float64)))
        object.__setattr__(self, "upper", np.atleast_1d(np.asarray(upper, dtype=np.float64)))
        if self.lower.shape != self.upper.shape or self.lower.ndim != 1:
            raise InputError(f"the bounds need one shape (d,); found {self.lower.shape} and {self.upper.shape}.")
        if not np.all(self.lower < self.upper):
            index = int(np.argmin(self.lower < self.upper))
            fault = f"{self.lower[index]} is not below {self.upper[index]}"
            raise InputError(f"bounds {index}: {fault}; give lower < upper.")

    def __eq__(self, value: object) -> bool:
        return isinstance(value, Box) and self._ends == value._ends

    def __hash__(self) -> int:
        return hash(self._ends)

    @property
    def _ends(self) -> tuple[bytes, bytes]:
        return self.lower.tobytes(), self.upper.tobytes()

    @property
    def has_lower(self) -> BoolArray:
        """Which coordinates have a lower bound."""
        return np.isfinite(self.lower)

    @property
    def has_upper(self) -> BoolArray:
        """Which coordinates have an upper bound."""
        return np.isfinite(self.upper)

    @property
    def is_bounded(self) -> BoolArray:
        """Which coordinates have both bounds."""
        return self.has_lower & self.has_upper

    @property
    def is_half_bounded(self) -> BoolArray:
        """Which coordinates have exactly one bound."""
        return self.has_lower ^ self.has_upper

    @property
    def width(self) -> FloatArray:
        """The distance between the bounds, or one."""
        return np.where(self.is_bounded, self.upper - self.lower, 1.0)

    def labels(self, names: Sequence[str] | None) -> tuple[str, ...]:
        """Return what to call the coordinates: their names, or where there are none, their numbers.

        Raises
        ------
        InputError
            When there are more or fewer names than coordinates.
        """
        labels = tuple(f"x[{index}]" for index in range(self.lower.size)) if names is None else tuple(names)
        if len(labels) != self.lower.size:
            raise InputError(f"the box has {self.lower.size} coordinates; {len(labels)} names were given.")
        return labels

    def to_line(self, point: ArrayLike) -> FloatArray:
        """Return the (d,) real-line coordinates of a (d,) point inside the box.

        Raises
        ------
        InputError
            When the point is not strictly inside the box.
        """
        point = np.asarray(point, dtype=np.float64)
        if point.shape != self.lower.shape:
            raise InputError(f"the box has {self.lower.size} coordinates; the point has shape {point.shape}.")
        inside = (self.lower < point) & (point < self.upper)
        if not inside.all():
            index = int(np.argmin(inside))
            bounds = f"({self.lower[index]}, {self.upper[index]})"
            raise InputError(f"coordinate {index} of the point is {point[index]}; it must lie inside {bounds}.")
        above_lower, below_upper = point - self.lower, self.upper - point
        nearer = np.minimum(above_lower, below_upper)
        lower_quantile = ndtri(np.minimum(nearer / self.width, 0.5))
        quantile = np.where(above_lower < below_upper, lower_quantile, -lower_quantile)
        logarithm = np.log(np.where(self.is_half_bounded, nearer, 1.0))
        return np.where(self.is_bounded, quantile, np.where(self.is_half_bounded, logarithm, point))

    def from_line(self, line: Any) -> Any:
        """Return the (d,) point of the box at (d,) real-line coordinates; JAX differentiates it."""
        lower = np.where(self.has_lower, self.lower, 0.0)
        upper = np.where(self.has_upper, self.upper, 0.0)
        # The distance is taken from the nearer bound, which keeps it accurate when it is tiny.
        distance = self.width * ndtr(jnp.where(line < 0, line, -line))
        bounded = jnp.where(line < 0, lower + distance, upper - distance)
        # The unused branch must not overflow: its infinite slope would turn the gradient into NaN.
        growth = jnp.exp(jnp.where(self.is_half_bounded, line, 0.0))
        half = jnp.where(self.has_lower, lower + growth, upper - growth)
        point = jnp.where(self.is_bounded, bounded, jnp.where(self.is_half_bounded, half, line))
        return jnp.clip(point, _next_inside(self.lower, np.inf), _next_inside(self.upper, -np.inf))

    def log_jacobian(self, line: Any) -> Any:
        """Return log |d point / d line| at (d,) real-line coordinates."""
        bounded = np.log(self.width) - 0.5 * jnp.log(2 * jnp.pi) - 0.5 * line**2
        return jnp.sum(jnp.where(self.is_bounded, bounded, jnp.where(self.is_half_bounded, line, 0.0)))


@dataclass(frozen=True)
class Mode:
    r"""A local maximum on the real line and the normal distribution that Laplace's approximation puts there.

    With :math:`H` the Hessian of the log density at the mode, the scale is an :math:`L` with
    :math:`L L^T = (-H)^{-1}`; the whitened coordinates are :math:`z = L^{-1} (u - \mathrm{mode})`.

    Parameters
    ----------
    location : (d,) array
        The mode.
    scale : (d, d) array
        The matrix L.
    log_mass : float
        Log density at the mode plus log det L: the log of the mode's probability, up to a constant.
    """

    location: FloatArray
    scale: FloatArray
    log_mass: float

    def whiten(self, line: Any) -> Any:
        """Return the whitened coordinates of a point on the real line."""
        return np.linalg.solve(self.scale, line - self.location)

    def unwhiten(self, whitened: Any) -> Any:
        """Return the real-line coordinates of a whitened point."""
        return self.location + self.scale @ whitened


def log_density_on_line(log_density: Callable[..., Any], box: Box, *data: Any) -> LogDensity:
    """Return a log density of the box, and of data, as that of real-line coordinates, Jacobian included."""
    return lambda line: log_density(box.from_line(line), *data) + box.log_jacobian(line)


def derivatives_on_line(log_density: Callable[..., Any], box: Box, *data: Any) -> Derivatives:
    """Return the compiled value, gradient and Hessian of a box's log density, given data, on the real line."""
    compiled = _compiled_derivatives(log_density, box)
    return lambda line: tuple(np.asarray(array) for array in compiled(line, *data))  # type: ignore[return-value]


@lru_cache(maxsize=64)
def _compiled_derivatives(log_density: Callable[..., Any], box: Box) -> Callable[..., Any]:
    def derivatives(line: Any, *data: Any) -> tuple[Any, Any, Any]:
        value_and_gradient = jax.value_and_grad(log_density_on_line(log_density, box, *data))

        def along(direction: Any) -> tuple[Any, Any, Any]:
            (value, gradient), (_, column) = jax.jvp(value_and_gradient, (line,), (direction,))
            return value, gradient, column

        return jax.vmap(along, out_axes=(None, None, 0))(jnp.eye(line.size))

    return jax.jit(derivatives)


def find_modes(
    derivatives: Derivatives, box: Box, start: ArrayLike, generator: np.random.Generator
) -> tuple[Mode, ...]:
    """Return the modes of a log density on the real line that hold its probability, the weightiest first.

    Newton searches begin at the start and at points scattered over the box (over ten standard deviations
    where the box is infinite), so that a second mode away from the start is seen.

    Parameters
    ----------
    derivatives : callable
        Value, gradient and Hessian of the log density on the real line.
    box : Box
        The box.
    start : (d,) array
        A point inside the box with a finite log density.
    generator : numpy.random.Generator
        Scatters the searches.

    Raises
    ------
    InputError
        When the start is outside the box or has no finite log density or derivatives.
    """
    line = box.to_line(start)
    if not _is_finite(derivatives(line)):
        raise InputError(f"the log density or its derivatives are not finite at {np.asarray(start)}; start elsewhere.")
    mode_at_start = _climb(derivatives, line)
    # A standard normal variable on the line is a uniform one between two bounds.
    centre = np.where(box.is_bounded, 0.0, mode_at_start.location)
    spread = np.where(box.is_bounded, 1.0, 10 * np.linalg.norm(mode_at_start.scale, axis=1))
    scattered = centre + spread * generator.standard_normal((MODE_SEARCHES - 1, line.size))
    modes = [mode_at_start] + [_climb(derivatives, point) for point in scattered if _is_finite(derivatives(point))]
    return _distinct(sorted(modes, key=lambda mode: -mode.log_mass))


def _distinct(modes: list[Mode]) -> tuple[Mode, ...]:
    distinct: list[Mode] = []
    for mode in modes:
        is_new = all(np.linalg.norm(earlier.whiten(mode.location)) > SAME_MODE_SDS for earlier in distinct)
        if is_new and mode.log_mass >= modes[0].log_mass + np.log(NEGLIGIBLE_MASS):
            distinct.append(mode)
    return tuple(distinct)


def _climb(derivatives: Derivatives, line: FloatArray, max_steps: int = 500, tolerance: float = 1e-8) -> Mode:
    """Climb to a local maximum by Newton steps, damped until they rise and repelled by saddle points.

    The search ends when the next undamped step promises less than the tolerance (a difference of log
    densities, hence free of scale) or when rounding hides any rise. A search that runs out of steps returns
    its last point.
    """
    value, gradient, hessian = derivatives(line)
    curvature, axes = np.linalg.eigh(-hessian)
    damping = 1e-3 * np.abs(curvature).max()
    for _ in range(max_steps):
        slope, steepness = axes.T @ gradient, np.maximum(np.abs(curvature), 1e-12)
        if 0.5 * np.sum(slope**2 / steepness) < tolerance or damping > 1e16 * steepness.max():
            break
        proposal = line + axes @ (slope / (steepness + damping))
        reached = derivatives(proposal)
        if _is_finite(reached) and reached[0] > value:
            line, (value, gradient, hessian) = proposal, reached
            curvature, axes = np.linalg.eigh(-hessian)
            damping *= 0.1
        else:
            damping = 10 * max(damping, 1e-12 * steepness.max())
    scale = _inverse_root(-hessian)
    return Mode(line, scale, float(value + np.linalg.slogdet(scale)[1]))


def _inverse_root(matrix: FloatArray) -> FloatArray:
    """Return L with L L^T the inverse of a symmetric matrix, negative curvatures counted as positive.

    Rows and columns are brought to unit diagonal first, so that very different scales cost no accuracy.
    """
    diagonal = np.diag(matrix)
    size = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    curvature, axes = np.linalg.eigh(matrix / np.outer(size, size))
    return np.asarray(axes / np.sqrt(np.maximum(np.abs(curvature), 1e-12)) / size[:, None])


def _next_inside(bound: ArrayLike, towards: float) -> FloatArray:
    """Return the nearest number inside a bound that XLA does not flush to zero."""
    bound = np.asarray(bound, dtype=np.float64)
    tiny = np.copysign(np.finfo(float).tiny, towards)
    inside = np.where(np.abs(bound) < np.finfo(float).tiny, bound + tiny, np.nextafter(bound, towards))
    return np.asarray(inside)


def _is_finite(derivatives: tuple[Any, Any, Any]) -> bool:
    return all(np.isfinite(array).all() for array in derivatives)
