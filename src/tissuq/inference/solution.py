"""A posterior by any route of inference, a mixture of Gaussians with draws and marginals; and what finds it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from tissuq.arrays import BoolArray, FloatArray, IndexArray
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.inference.marginal import Marginal, widened
from tissuq.inference.threads import one_thread
from tissuq.model.discrepancy import side_by_side
from tissuq.model.statistical_model import StatisticalModel

if TYPE_CHECKING:
    from tissuq.inference.convergence import Draws

NO_ERROR: Mapping[str, float] = {}
PROBABLE_DIRECTION = 0.5
"""Probability of a preferred direction above which the material counts as one that has it."""


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

    @classmethod
    def of(cls, run: Draws) -> Diagnostics:
        """Return those of draws of a sampler."""
        rhat, ess_bulk, ess_tail = (
            dict(zip(run.names, map(float, column), strict=True)) for column in (run.rhat, run.ess_bulk, run.ess_tail)
        )
        return cls(run.converged, run.verdict, rhat, ess_bulk, ess_tail)


class Marginals(Mapping[str, Marginal]):
    """The marginal posterior of every parameter, each computed when it is first asked for.

    Those of some are widened by an ``error`` (standard deviation, in the parameter's unit).
    """

    def __init__(
        self, symbols: tuple[str, ...], compute: Callable[[str], Marginal], error: Mapping[str, float] = NO_ERROR
    ) -> None:
        self._symbols, self._compute, self._error = symbols, compute, error
        self._computed: dict[str, Marginal] = {}

    @classmethod
    def of(cls, model: StatisticalModel, compute: Callable[[str], Marginal]) -> Marginals:
        """Return those of a model's parameters; of stresses with the error that all tests have in common."""
        return cls(model.symbols, compute, dict.fromkeys(model.column_symbols, model.common_error))

    def __getitem__(self, symbol: str) -> Marginal:
        if symbol not in self._symbols:
            raise KeyError(symbol)
        if symbol not in self._computed:
            self._computed[symbol] = widened(self._compute(symbol), self._error.get(symbol, 0.0))
        return self._computed[symbol]

    def __iter__(self) -> Iterator[str]:
        return iter(self._symbols)

    def __len__(self) -> int:
        return len(self._symbols)


@dataclass(frozen=True, eq=False)
class Representation:
    """A posterior as a mixture of Gaussians, which is computed when it is first asked for.

    Attributes
    ----------
    compute : callable
        Given how many components there may be (None: as many as serve), returns the mixture.
    compute_wide : callable, optional
        The same with components in the tails, too, where importance weights may need them; None where the mixture has
        them.
    """

    compute: Callable[[int | None], GaussianMixture]
    compute_wide: Callable[[int | None], GaussianMixture] | None = None

    @classmethod
    def of(cls, mixture: GaussianMixture, wide: GaussianMixture | None = None) -> Representation:
        """Return that of a posterior which is a mixture, and another one with components in the tails."""
        return cls(mixture.resampled, None if wide is None else wide.resampled)


@dataclass(frozen=True, eq=False)
class Solution:
    """The posterior of one model, by any route.

    Attributes
    ----------
    model : StatisticalModel
    route : str
        Which method was used.
    reason : str
        Why it was taken and what it did.
    representation : Representation
        The posterior as a mixture of Gaussians.
    marginals : mapping of str to Marginal
        One for each parameter, by its symbol.
    seed : int
        Of the draws from the mixture.
    sampled : (chains, draws, p) array, optional
        Linear parameters of the draws of a sampler, in the order of the mixture's components, which then are the
        settings of the draws.
    log_evidence, log_evidence_error : float or None
        Log of p(y) with respect to the normalised priors, y in MPa; None where there is none.
    diagnostics : Diagnostics or None
        Of the sampler; None on the exact route.
    members : mapping of str to float
        Posterior probabilities of the members, where the discrepancy is an average.
    stable_in : tuple of str
        Loading modes in which what is not stable is left out.
    stable_share : float
        Share of the posterior that is stable in these, before the rest is left out.
    stable_prior_share : float or None
        The same of the prior; None where it is not known.
    is_of_data : bool
        Whether it is the posterior given the model's measurements; that of a new patient is of somebody else.
    """

    model: StatisticalModel
    route: str
    reason: str
    representation: Representation
    marginals: Mapping[str, Marginal]
    seed: int = 0
    sampled: FloatArray | None = None
    log_evidence: float | None = None
    log_evidence_error: float | None = None
    diagnostics: Diagnostics | None = None
    members: Mapping[str, float] = field(default_factory=dict)
    stable_in: tuple[str, ...] = ()
    stable_share: float = 1.0
    stable_prior_share: float | None = None
    is_of_data: bool = True

    def __getstate__(self) -> dict[str, Any]:
        """Return what is computed in place of what computes it, so that the posterior can go to another process."""
        representation = Representation.of(self.mixture, self.wide_mixture if self.has_wide_mixture else None)
        return self.__dict__ | {"representation": representation, "marginals": dict(self.marginals)}

    @cached_property
    def mixture(self) -> GaussianMixture:
        """The posterior as a mixture; predictions rest on it."""
        return self.few_components(None)

    @cached_property
    def wide_mixture(self) -> GaussianMixture:
        """The same with components in the tails, too, where importance weights may need them."""
        return self.few_components(None, is_wide=True) if self.has_wide_mixture else self.mixture

    @property
    def has_wide_mixture(self) -> bool:
        """Whether `wide_mixture` is another one than `mixture`."""
        return self.representation.compute_wide is not None

    def thinned(self, count: int) -> GaussianMixture:
        """Return few components of `mixture` that stand for all, as `GaussianMixture.thinned` does.

        Draws of a sampler, which are in no order, are taken along the axis on which they differ most.
        """
        is_unordered = self.sampled is not None and self.mixture.member is None
        return (self.mixture.along_main_axis() if is_unordered else self.mixture).thinned(count)

    def few_components(self, count: int | None, *, is_wide: bool = False) -> GaussianMixture:
        """Return at most so many components that stand for `mixture`, or for `wide_mixture`; neither is kept."""
        with one_thread():
            return ((self.representation.compute_wide if is_wide else None) or self.representation.compute)(count)

    @cached_property
    def draws(self) -> dict[str, FloatArray]:
        """Draws (chains, draws) of every parameter.

        On the exact route they are independent of each other, and those of nonlinear parameters take the values of the
        quadrature's points: for densities and intervals use the marginals.
        """
        component, linear = self._drawn
        columns = np.moveaxis(np.concatenate([self.mixture.settings[component], linear], axis=2), 2, 0)
        symbols = (*self.model.nonlinear, *self.model.linear)  # the weights of an energy discrepancy follow them
        named = dict(zip(symbols, columns, strict=False))
        return {symbol: named[symbol] for symbol in self.model.symbols}

    @property
    def component_of_draw(self) -> IndexArray:
        """The index of every draw's component of `mixture` (chains, draws)."""
        return self._drawn[0]

    @cached_property
    def drawn_discrepancy(self) -> FloatArray | None:
        """The discrepancy's stress (chains, draws, m) at the model's `states` in every draw, whitened, MPa.

        None where it has no weights of its own.
        """
        component, linear = self._drawn
        if self.mixture.member is None:
            return None
        model, members, start = self.model, self.mixture.member[component], len(self.model.linear)
        values = np.zeros((*members.shape, len(model.states)))
        for member in np.unique(members):
            terms = model.energy_members[member].stress_features(model.states)
            features = side_by_side([np.asarray(model.white(term)) for term in terms], values.shape[2])
            drawn = members == member
            values[drawn] = linear[drawn][:, start : start + features.shape[1]] @ features.T
        return values

    @cached_property
    def _drawn(self) -> tuple[IndexArray, FloatArray]:
        """The component of every draw, and its linear parameters and weights."""
        if self.sampled is None:
            return self.mixture.draw(self.seed)
        chains, draws, _ = self.sampled.shape
        return np.arange(chains * draws).reshape(chains, draws), self.sampled

    @cached_property
    def direction_probability(self) -> float | None:
        """Probability of a preferred direction of the material; None where no energy has one."""
        if all(member.is_isotropic for member in self.model.energy_members):
            return None
        weights = self.mixture.weights
        return float(weights[~are_isotropic(self.model, self.mixture)].sum() / weights.sum())

    @property
    def is_directed(self) -> bool:
        """Whether the material has a preferred direction, more probably than not."""
        return (self.direction_probability or 0.0) > PROBABLE_DIRECTION

    @property
    def is_approximate(self) -> bool:
        """Whether the result must not be used as it stands, because sampling has not converged."""
        return self.diagnostics is not None and not self.diagnostics.converged

    @property
    def shape(self) -> tuple[int, int]:
        """The number of chains, and of draws in each."""
        chains, draws = self.component_of_draw.shape
        return chains, draws


def are_isotropic(model: StatisticalModel, mixture: GaussianMixture) -> BoolArray:
    """Return which components (M,) of a posterior have no preferred direction."""
    if mixture.member is None:
        return np.ones(len(mixture.weights), dtype=bool)
    return np.array([member.is_isotropic for member in model.energy_members])[mixture.member]


class Enumerator(Protocol):
    """Finds weighted settings of nonlinear parameters; given each, the linear ones are Gaussian (or points).

    A solution holds the settings and their weights in its `mixture`, the error of its evidence, and diagnostics where
    they are draws.
    """

    def why_not(self, model: StatisticalModel) -> str:
        """Return why it does not serve a model, in words that follow "does not apply: "; nothing where it does."""

    def solve(self, models: Sequence[StatisticalModel], seed: int) -> list[Solution]:
        """Return the posteriors of models with the same parts on the same stretches.

        Raises
        ------
        ConvergenceError
            When they are not found to the enumerator's tolerance.
        """


def shares_of_members(model: StatisticalModel, members: IndexArray, weights: FloatArray) -> dict[str, float]:
    """Return the probability of every sum of blocks, its length scales together, for weighted members (M,)."""
    share_of_name: dict[str, float] = {}
    shares = np.bincount(members, weights, minlength=len(model.energy_members))
    for member, share in zip(model.energy_members, shares, strict=True):
        share_of_name[member.name] = share_of_name.get(member.name, 0.0) + float(share)
    return share_of_name
