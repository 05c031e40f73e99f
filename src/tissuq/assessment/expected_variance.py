"""How uncertain targets are expected to be after further measurements, for a posterior that is a mixture of Gaussians.

Given a component everything is linear and Gaussian, so that the variance after the measurements does not depend on what
they will show: it is exact. What they will show weights the components anew; the variance between these is averaged
over measurements drawn from what the posterior predicts.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["GaussianMixture", "Variances", "expected_variances"]

FloatArray = NDArray[np.float64]

AT_ONCE = 4_000_000
"""Values in an array over components, outcomes and measurements at once: what bounds the memory."""


@dataclass(frozen=True, eq=False)
class GaussianMixture:
    """Measurements to come and targets, jointly Gaussian in each of M components.

    Attributes
    ----------
    weights : (M,) array
        Sum one.
    mean, root : (M, n) and (M, n, r) arrays
        Of the stresses to be measured, without the errors of single measurements.
    noise_sd : (M, n) array
        Of these errors.
    target_mean, target_root : (M, t) and (M, t, r) arrays
        Covariances are products of roots.
    """

    weights: FloatArray
    mean: FloatArray
    root: FloatArray
    noise_sd: FloatArray
    target_mean: FloatArray
    target_root: FloatArray

    def __getitem__(self, chosen: NDArray[np.intp]) -> GaussianMixture:
        return GaussianMixture(*(each[chosen] for each in vars(self).values()))

    def weighted(self, weights: FloatArray) -> GaussianMixture:
        """Return the same with other weights (M,)."""
        return GaussianMixture(weights, *list(vars(self).values())[1:])

    @property
    def variance(self) -> FloatArray:
        """The variances (t,) of the targets before the measurements."""
        centre = self.weights @ self.target_mean
        within = (self.target_root**2).sum(axis=2)
        return np.asarray(self.weights @ (within + (self.target_mean - centre) ** 2))


@dataclass(frozen=True, eq=False)
class Variances:
    """Of targets (t,) before and after measurements, and the effective number of components after them.

    ``within`` and ``between`` components add up to ``after``; the former is exact.
    """

    before: FloatArray
    within: FloatArray
    between: FloatArray
    effective: float

    @property
    def after(self) -> FloatArray:
        """The expected variances after the measurements."""
        return self.within + self.between


def expected_variances(mixture: GaussianMixture, uniforms: FloatArray) -> Variances:
    """Return the variances of targets that are expected after measurements.

    Parameters
    ----------
    mixture : GaussianMixture
    uniforms : (S, 1 + r + n) array
        Evenly spread points of the unit cube, from which S outcomes follow; unused where there is one component.
    """
    # Whitened, with T'T = I + B'B, the Gaussian given an outcome has the root T^-1 in the coordinates of the mixture's.
    scaled = mixture.root / mixture.noise_sd[:, :, None]
    count, _, r = scaled.shape
    stacked = np.concatenate([scaled, np.broadcast_to(np.eye(r), (count, r, r))], axis=1)
    triangle = np.asarray(np.linalg.qr(stacked, mode="r"))
    after = np.linalg.solve(triangle.swapaxes(1, 2), mixture.target_root.swapaxes(1, 2))
    within = mixture.weights @ (after**2).sum(axis=1)
    if count == 1:
        return Variances(mixture.variance, within, np.zeros_like(within), 1.0)
    outcomes = _outcomes(mixture, uniforms)
    log_density, moved = np.empty((count, len(outcomes))), np.empty((count, len(outcomes), after.shape[2]))
    for block in _blocks(count, len(outcomes) * max(scaled.shape[1:])):
        residual = (outcomes - mixture.mean[block, None]) / mixture.noise_sd[block, None]
        along = np.linalg.solve(triangle[block].swapaxes(1, 2), (residual @ scaled[block]).swapaxes(1, 2))
        square = (residual**2).sum(axis=2) - (along**2).sum(axis=1)
        size = np.log(np.abs(np.einsum("mrr->mr", triangle[block]))).sum(axis=1)
        size += np.log(mixture.noise_sd[block]).sum(axis=1)
        log_density[block] = -0.5 * square - size[:, None]
        moved[block] = along.swapaxes(1, 2) @ after[block]
    with np.errstate(divide="ignore"):  # a component may have no weight
        log_weights = np.log(mixture.weights)[:, None] + log_density
    weights = np.exp(log_weights - log_weights.max(axis=0))
    weights /= weights.sum(axis=0)
    centres = mixture.target_mean[:, None] + moved
    middle = np.einsum("ms,mst->st", weights, centres)
    between = np.einsum("ms,mst->t", weights, (centres - middle) ** 2) / len(outcomes)
    return Variances(mixture.variance, within, between, float((1 / (weights**2).sum(axis=0)).mean()))


def _outcomes(mixture: GaussianMixture, uniforms: FloatArray) -> FloatArray:
    """Return measurements (S, n) as the mixture predicts them."""
    from scipy.special import ndtri

    r = mixture.root.shape[2]
    edges = np.cumsum(mixture.weights)
    chosen = np.minimum(np.searchsorted(edges, uniforms[:, 0] * edges[-1], side="right"), len(edges) - 1)
    scores = ndtri(np.clip(uniforms[:, 1:], 1e-12, 1 - 1e-12))
    signal = np.einsum("snr,sr->sn", mixture.root[chosen], scores[:, :r])
    return np.asarray(mixture.mean[chosen] + signal + mixture.noise_sd[chosen] * scores[:, r:])


def _blocks(count: int, size: int) -> Iterator[slice]:
    """Yield slices of so many components, of a size each, that fit into memory together."""
    step = max(1, AT_ONCE // size)
    for start in range(0, count, step):
        yield slice(start, start + step)
