"""Expected variances of targets after further measurements, for a posterior that is a mixture of Gaussians.

Given a component everything is linear and Gaussian, so that the variance after the measurements does not depend on
their outcome: it is exact. The outcome changes the weights of the components; the variance between components is
averaged over outcomes drawn from the posterior predictive distribution.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tissuq.inference.gaussian_mixture import GaussianMixture

__all__ = ["Variances", "expected_variances"]

FloatArray = NDArray[np.float64]

MAX_ARRAY_VALUES = 4_000_000
"""Largest number of values in an array over components, outcomes and measurements, which bounds the memory."""


@dataclass(frozen=True, eq=False)
class Variances:
    """Variances of targets (t,) before and after measurements, and the effective number of components after them.

    Those within and between components add up to ``expected``; the former is exact.
    """

    prior: FloatArray
    within_components: FloatArray
    between_components: FloatArray
    effective: float

    @property
    def expected(self) -> FloatArray:
        """The expected variances after the measurements."""
        return self.within_components + self.between_components


def expected_variances(mixture: GaussianMixture, noise_sd: FloatArray, uniforms: FloatArray) -> Variances:
    """Return the variances of targets that are expected after measurements.

    Parameters
    ----------
    mixture : GaussianMixture
        The n stresses to be measured, without the errors of single measurements, followed by the t targets.
    noise_sd : (M, n) array
        Standard deviations of these errors in each component.
    uniforms : (S, 1 + r + n) array
        Evenly spread points of the unit cube, from which S outcomes follow; unused where there is one component.
    """
    # Whitened, with T'T = I + B'B, the Gaussian given an outcome has the root T^-1 in the coordinates of the mixture's.
    count, n = noise_sd.shape
    (mean, target_mean), (root, target_root) = ((array[:, :n], array[:, n:]) for array in (mixture.mean, mixture.root))
    r = root.shape[2]
    scaled = root / noise_sd[:, :, None]
    stacked = np.concatenate([scaled, np.broadcast_to(np.eye(r), (count, r, r))], axis=1)
    triangle = np.asarray(np.linalg.qr(stacked, mode="r"))
    posterior_root = np.linalg.solve(triangle.swapaxes(1, 2), target_root.swapaxes(1, 2))
    within_components = mixture.weights @ (posterior_root**2).sum(axis=1)
    prior = np.diag(mixture.moments()[1])[n:]
    if count == 1:
        return Variances(prior, within_components, np.zeros_like(within_components), 1.0)
    outcomes = _outcomes(mixture.weights, mean, root, noise_sd, uniforms)
    log_density, shift = np.empty((count, len(outcomes))), np.empty((count, len(outcomes), posterior_root.shape[2]))
    for block in _blocks(count, len(outcomes) * max(scaled.shape[1:])):
        residual = (outcomes - mean[block, None]) / noise_sd[block, None]
        projected = np.linalg.solve(triangle[block].swapaxes(1, 2), (residual @ scaled[block]).swapaxes(1, 2))
        square = (residual**2).sum(axis=2) - (projected**2).sum(axis=1)
        size = np.log(np.abs(np.einsum("mrr->mr", triangle[block]))).sum(axis=1)
        size += np.log(noise_sd[block]).sum(axis=1)
        log_density[block] = -0.5 * square - size[:, None]
        shift[block] = projected.swapaxes(1, 2) @ posterior_root[block]
    with np.errstate(divide="ignore"):  # a component may have no weight
        log_weights = np.log(mixture.weights)[:, None] + log_density
    weights = np.exp(log_weights - log_weights.max(axis=0))
    weights /= weights.sum(axis=0)
    centres = target_mean[:, None] + shift
    mean_of_outcome = np.einsum("ms,mst->st", weights, centres)
    between_components = np.einsum("ms,mst->t", weights, (centres - mean_of_outcome) ** 2) / len(outcomes)
    return Variances(prior, within_components, between_components, float((1 / (weights**2).sum(axis=0)).mean()))


def _outcomes(
    weights: FloatArray, mean: FloatArray, root: FloatArray, noise_sd: FloatArray, uniforms: FloatArray
) -> FloatArray:
    """Return measurements (S, n) as the mixture predicts them."""
    from scipy.special import ndtri

    r = root.shape[2]
    edges = np.cumsum(weights)
    component = np.minimum(np.searchsorted(edges, uniforms[:, 0] * edges[-1], side="right"), len(edges) - 1)
    scores = ndtri(np.clip(uniforms[:, 1:], 1e-12, 1 - 1e-12))
    signal = np.einsum("snr,sr->sn", root[component], scores[:, :r])
    return np.asarray(mean[component] + signal + noise_sd[component] * scores[:, r:])


def _blocks(count: int, size: int) -> Iterator[slice]:
    """Yield slices of so many components, of a size each, that fit into memory together."""
    step = max(1, MAX_ARRAY_VALUES // size)
    for start in range(0, count, step):
        yield slice(start, start + step)
