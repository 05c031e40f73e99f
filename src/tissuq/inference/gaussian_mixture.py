"""A distribution as weighted settings of the nonlinear parameters, the linear ones Gaussian given each setting."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tissuq.arrays import FloatArray, IndexArray
from tissuq.inference.marginal import Marginal, marginal_of_mixture
from tissuq.inference.quasi_monte_carlo import systematic

CHAINS, DRAWS = 4, 1000
"""Number of chains of draws from a mixture, and of draws in each chain."""
NEGLIGIBLE_WEIGHT = 1e-7
"""Share of the total weight that the components left out by `GaussianMixture.thinned` have together, at most."""


@dataclass(frozen=True, eq=False)
class GaussianMixture:
    """M weighted settings of the nonlinear parameters, and a Gaussian of the linear ones given each.

    Attributes
    ----------
    weights : (M,) array
        Non-negative, sum one.
    settings : (M, d) array
        Values of the nonlinear parameters.
    mean : (M, p) array
        Means of the linear parameters.
    root : (M, p, r) array
        Roots of their covariances, R R'; zero where a component is a point. Square in posteriors.
    member : (M,) array, optional
        Where a discrepancy is an average, which of its members; its weights then follow the linear parameters.
    """

    weights: FloatArray
    settings: FloatArray
    mean: FloatArray
    root: FloatArray
    member: IndexArray | None = None

    @classmethod
    def of_points(cls, settings: FloatArray, values: FloatArray, member: IndexArray | None = None) -> GaussianMixture:
        """Return points of one weight without extent: settings (M, d) and values (M, p) of the linear parameters."""
        count, p = values.shape
        return cls(np.full(count, 1 / count), settings, values, np.broadcast_to(0.0, (count, p, p)), member)

    @classmethod
    def of_covariances(cls, weights: FloatArray, mean: FloatArray, covariance: FloatArray) -> GaussianMixture:
        """Return Gaussians of linear parameters alone, of covariances (M, p, p), which may be singular."""
        values, vectors = np.linalg.eigh(covariance)
        root = vectors * np.sqrt(np.maximum(values, 0.0))[:, None]
        return cls(weights, np.zeros((len(weights), 0)), mean, root)

    @classmethod
    def of_all(cls, mixtures: Sequence[GaussianMixture], count: int | None = None) -> GaussianMixture:
        """Return the components of several mixtures, or at most ``count`` equally weighted ones that stand for all.

        Where they have different numbers of linear parameters, those that are missing are zero.
        """
        weights = np.concatenate([mixture.weights for mixture in mixtures])
        if count is not None and len(weights) > count:
            representatives, ends = systematic(weights[None], count)[0], np.cumsum([len(m) for m in mixtures])
            indices_of_mixtures = np.split(representatives, np.searchsorted(representatives, ends[:-1]))
            mixtures = [
                mixtures[i][indices - ends[i] + len(mixtures[i])] for i, indices in enumerate(indices_of_mixtures)
            ]
            weights = np.full(count, weights.sum() / count)
        p, r = (max(mixture.root.shape[axis] for mixture in mixtures) for axis in (1, 2))
        mean, root = np.zeros((len(weights), p)), np.zeros((len(weights), p, r))
        start = 0
        for mixture in mixtures:
            size, parameters, scores = mixture.root.shape
            mean[start : start + size, :parameters] = mixture.mean
            root[start : start + size, :parameters, :scores] = mixture.root
            start += size
        members = [mixture.member for mixture in mixtures if mixture.member is not None]
        return cls(
            weights,
            np.concatenate([mixture.settings for mixture in mixtures]),
            mean,
            root,
            np.concatenate(members) if len(members) == len(mixtures) else None,
        )

    def __getitem__(self, index: NDArray[Any] | slice) -> GaussianMixture:
        member = None if self.member is None else self.member[index]
        return GaussianMixture(self.weights[index], self.settings[index], self.mean[index], self.root[index], member)

    def __len__(self) -> int:
        return len(self.weights)

    @property
    def covariance(self) -> FloatArray:
        """The covariances (M, p, p) of the components."""
        return np.asarray(self.root @ self.root.swapaxes(1, 2))

    def moments(self) -> tuple[FloatArray, FloatArray]:
        """Return the mean (p,) and the covariance (p, p) of the linear parameters."""
        weights = self.weights / self.weights.sum()
        mean = weights @ self.mean
        spread = np.concatenate([self.root, (self.mean - mean)[:, :, None]], axis=2) * np.sqrt(weights)[:, None, None]
        flat = spread.swapaxes(0, 1).reshape(len(mean), -1)
        return mean, flat @ flat.T

    def marginal(self, index: int) -> Marginal:
        """Return the marginal of the linear parameter with an index; no component may be a point."""
        sds = np.sqrt((self.root[:, index] ** 2).sum(axis=1))
        return marginal_of_mixture(self.weights, self.mean[:, index], sds)

    def draw(self, seed: int) -> tuple[IndexArray, FloatArray]:
        """Return the component (chains, draws) of every draw, and its linear parameters (chains, draws, p)."""
        generator = np.random.default_rng(seed)
        component = generator.choice(len(self.weights), size=(CHAINS, DRAWS), p=self.weights)
        noise = generator.standard_normal((CHAINS, DRAWS, self.root.shape[2]))
        return component, self.mean[component] + np.einsum("cdij,cdj->cdi", self.root[component], noise)

    def weighted(self, weights: FloatArray) -> GaussianMixture:
        """Return the same components with other weights (M,)."""
        return replace(self, weights=weights)

    def along_main_axis(self) -> GaussianMixture:
        """Return the same components along the first principal axis of settings and means, each over its sd."""
        values = np.hstack([self.settings, self.mean])
        sd = values.std(axis=0)
        scores = (values - values.mean(axis=0))[:, sd > 0] / sd[sd > 0]
        axis = np.linalg.eigh(scores.T @ scores)[1][:, -1:].sum(axis=1)
        return self[np.argsort(scores @ axis, kind="stable")]

    def thinned(self, count: int) -> GaussianMixture:
        """Return few components that stand for all, their weights summing to one.

        The lightest, together less than 1e-7 of all, are left out; if more than ``count`` remain, systematic
        resampling in their order, which keeps neighbours apart, picks equally weighted ones.
        """
        order = np.argsort(self.weights)
        heavy = np.sort(order[np.cumsum(self.weights[order]) > NEGLIGIBLE_WEIGHT * self.weights.sum()])
        weights = self.weights[heavy] / self.weights[heavy].sum()
        if len(heavy) <= count:
            return self[heavy].weighted(weights)
        picked = self[heavy[systematic(weights[None], count)[0]]]
        return picked.weighted(np.full(count, 1 / count))

    def resampled(self, count: int | None) -> GaussianMixture:
        """Return at most ``count`` equally weighted components that stand for all, of the same weight together."""
        if count is None or len(self.weights) <= count:
            return self
        representatives = self[systematic(self.weights[None], count)[0]]
        return representatives.weighted(np.full(count, self.weights.sum() / count))

    def merged(self) -> GaussianMixture:
        """Return the same distribution, components that equal their predecessor merged with it."""
        first_of_equals = self._first_of_equals()
        return self[first_of_equals].weighted(np.add.reduceat(self.weights, first_of_equals))

    def _first_of_equals(self) -> IndexArray:
        """Return the indices of the components that differ from their predecessor in more than the weight."""
        is_new = np.zeros(len(self), dtype=bool)
        is_new[0] = True
        for array in (self.settings, self.mean, self.member, self.root):
            if array is not None:
                candidates = np.flatnonzero(~is_new)
                is_new[candidates] = (array[candidates] != array[candidates - 1]).any(axis=tuple(range(1, array.ndim)))
        return np.flatnonzero(is_new)

    def to_arrays(self) -> dict[str, tuple[tuple[str, ...], NDArray[Any]]]:
        """Return its arrays by name, with their dimensions, without those that are empty.

        A component that equals its predecessor in all but the weight is counted, not repeated. Of the roots, which are
        triangular and padded with zeros where members have different numbers of weights, there are the entries that
        are not zero and a bit for every entry that tells which these are.
        """
        first_of_equals = self._first_of_equals()
        distinct = self[first_of_equals]
        is_nonzero = distinct.root != 0
        arrays: dict[str, tuple[tuple[str, ...], NDArray[Any]]] = {
            "weights": (("component",), self.weights),
            "copies": (("distinct",), np.diff(first_of_equals, append=len(self))),
            "settings": (("distinct", "nonlinear"), distinct.settings),
            "mean": (("distinct", "linear"), distinct.mean),
            "root": (("entry",), distinct.root[is_nonzero]),
            "root_is_nonzero": (("eight_entries",), np.packbits(is_nonzero)),
            "root_shape": (("axis",), np.array(is_nonzero.shape)),
        }
        if distinct.member is not None:
            arrays["member"] = (("distinct",), distinct.member)
        return {name: (dims, array) for name, (dims, array) in arrays.items() if array.size}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> GaussianMixture:
        """Return the mixture whose arrays `to_arrays` gave."""
        empty = np.zeros((len(arrays["copies"]), 0))
        root = np.zeros(arrays["root_shape"])
        if "root" in arrays:
            is_nonzero = np.unpackbits(arrays["root_is_nonzero"], count=root.size).astype(bool)
            root[is_nonzero.reshape(root.shape)] = arrays["root"]
        settings, mean = (arrays.get(name, empty) for name in ("settings", "mean"))
        distinct = cls(np.ones(len(empty)), settings, mean, root, arrays.get("member"))
        return distinct[np.repeat(np.arange(len(distinct)), arrays["copies"])].weighted(arrays["weights"])
