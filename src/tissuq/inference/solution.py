"""What every route of inference returns: the posterior as a mixture of Gaussians, with draws and marginals."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tissuq.inference.marginal import Marginal, widened
from tissuq.inference.resampling import systematic
from tissuq.model import StatisticalModel

__all__ = ["CHAINS", "Components", "Diagnostics", "Marginals", "Solution"]

FloatArray = NDArray[np.float64]

CHAINS, DRAWS = 4, 1000
"""Of the draws from a mixture."""


@dataclass(frozen=True, eq=False)
class Components:
    """A posterior as M weighted settings of the nonlinear parameters, the linear ones Gaussian given each.

    Attributes
    ----------
    weights : (M,) array
        Non-negative, sum one.
    settings : (M, d) array
        Values of the nonlinear parameters.
    mean : (M, p) array
        Means of the linear parameters.
    root : (M, p, p) array
        Roots of their covariances; zero where a component is a point.
    member : (M,) array, optional
        Where a discrepancy is an average, which of its members; its weights then follow the linear parameters.
    """

    weights: FloatArray
    settings: FloatArray
    mean: FloatArray
    root: FloatArray
    member: NDArray[np.intp] | None = None

    def __getitem__(self, chosen: NDArray[Any]) -> Components:
        member = None if self.member is None else self.member[chosen]
        return Components(self.weights[chosen], self.settings[chosen], self.mean[chosen], self.root[chosen], member)

    def joined(self, other: Components) -> Components:
        """Return these components followed by others; the weights of both together must sum to one."""
        is_average = self.member is not None and other.member is not None
        names = ("weights", "settings", "mean", "root", *(["member"] if is_average else []))
        return Components(*(np.concatenate([getattr(self, name), getattr(other, name)]) for name in names))

    def drawn(self, seed: int) -> tuple[NDArray[np.intp], FloatArray]:
        """Return the component (chains, draws) of every draw, and its linear parameters (chains, draws, p)."""
        generator = np.random.default_rng(seed)
        chosen = generator.choice(len(self.weights), size=(CHAINS, DRAWS), p=self.weights)
        noise = generator.standard_normal((CHAINS, DRAWS, self.root.shape[2]))
        return chosen, self.mean[chosen] + np.einsum("cdij,cdj->cdi", self.root[chosen], noise)

    def weighted(self, weights: FloatArray) -> Components:
        """Return the same components with other weights (M,)."""
        return replace(self, weights=weights)

    def thinned(self, count: int) -> Components:
        """Return few components that stand for all, their weights summing to one.

        The lightest, together less than 1e-7 of all, are left out; if more than ``count`` remain, systematic
        resampling in their order, which keeps neighbours apart, picks equally weighted ones.
        """
        order = np.argsort(self.weights)
        heavy = self[np.sort(order[np.cumsum(self.weights[order]) > 1e-7 * self.weights.sum()])]
        total = heavy.weights.sum()
        if len(heavy.weights) <= count:
            return heavy.weighted(heavy.weights / total)
        picked = heavy.resampled(count)
        return picked.weighted(picked.weights / total)

    def resampled(self, count: int) -> Components:
        """Return at most ``count`` equally weighted components that stand for all, of the same weight together."""
        if len(self.weights) <= count:
            return self
        chosen = self[systematic(self.weights[None], count)[0]]
        return chosen.weighted(np.full(count, self.weights.sum() / count))


@dataclass(frozen=True)
class Diagnostics:
    """Whether sampling converged: R-hat and effective sample sizes by parameter, and a verdict in words."""

    converged: bool
    verdict: str
    rhat: dict[str, float]
    ess_bulk: dict[str, float]
    ess_tail: dict[str, float]
    divergences: int | None = None
    least_bfmi: float | None = None


class Marginals(Mapping[str, Marginal]):
    """The marginal posterior of every parameter, each computed when it is first asked for."""

    def __init__(self, symbols: Sequence[str], compute: Callable[[str], Marginal]) -> None:
        self._symbols, self._compute = tuple(symbols), compute
        self._known: dict[str, Marginal] = {}

    def __getitem__(self, symbol: str) -> Marginal:
        if symbol not in self._symbols:
            raise KeyError(symbol)
        if symbol not in self._known:
            self._known[symbol] = self._compute(symbol)
        return self._known[symbol]

    def __iter__(self) -> Iterator[str]:
        return iter(self._symbols)

    def __len__(self) -> int:
        return len(self._symbols)


class Solution(ABC):
    """The posterior of one model; marginals and draws are computed when they are first asked for.

    Attributes
    ----------
    model : StatisticalModel
    route : str
        Which method was used, and ``reason`` says why it was taken and what it did.
    components : Components
        The posterior as a mixture; predictions rest on it.
    marginals : Marginals
        One for each parameter, by its symbol.
    draws : dict of str to (chains, draws) array
        Draws of every parameter. On the exact route they are independent of each other, and those of nonlinear
        parameters take the values of the quadrature's points: for densities and intervals use the marginals.
    log_evidence, log_evidence_error : float or None
        Log of p(y) with respect to the normalised priors, y in MPa; None where there is none.
    diagnostics : Diagnostics or None
        Of the sampler; None on the exact route.
    drawn_discrepancy : (chains, draws, n) array or None
        The discrepancy's stress at the measurements in every draw, MPa, where it has weights of its own.
    members : mapping of str to float
        Posterior probabilities of the members, where the discrepancy is an average.
    stable_in : tuple of str
        Loading modes in which what is not stable is left out.
    """

    model: StatisticalModel
    route: str
    reason: str
    components: Components
    log_evidence: float | None = None
    log_evidence_error: float | None = None
    diagnostics: Diagnostics | None = None
    drawn_discrepancy: FloatArray | None = None
    members: Mapping[str, float] = MappingProxyType({})
    stable_in: tuple[str, ...] = ()

    @property
    def wide_components(self) -> Components:
        """The posterior as a mixture that has components in the tails, too, where importance weights may need them."""
        return self.components

    @cached_property
    def marginals(self) -> Marginals:
        """The marginal posterior of every parameter; of stresses with the error that all tests have in common."""
        return Marginals(self.model.symbols, self._widened_marginal)

    def _widened_marginal(self, symbol: str) -> Marginal:
        return widened(self._marginal(symbol), self.model.common_error if symbol in self.model.column_symbols else 0.0)

    @abstractmethod
    def _marginal(self, symbol: str) -> Marginal:
        """Return the marginal posterior of one parameter."""

    @property
    @abstractmethod
    def draws(self) -> dict[str, FloatArray]:
        """Draws of every parameter."""

    @property
    @abstractmethod
    def component_of_draw(self) -> NDArray[np.intp]:
        """The place among `components` of every draw (chains, draws)."""

    @property
    def is_approximate(self) -> bool:
        """Whether the result must not be used as it stands, because sampling has not converged."""
        return self.diagnostics is not None and not self.diagnostics.converged

    @property
    def shape(self) -> tuple[int, int]:
        """The number of chains, and of draws in each."""
        chains, draws = next(iter(self.draws.values())).shape
        return chains, draws
