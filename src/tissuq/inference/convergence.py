"""Draws of a sampler by chain, the diagnostics of their quality, and the verdict in words."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.errors import InputError

MAX_RHAT = 1.01
"""Of any parameter, for draws that count as converged."""


@dataclass(frozen=True)
class Draws(ABC):
    """Draws from a posterior; a sampler adds what it knows of them, what may have failed, and what to try then.

    Parameters
    ----------
    values : (chains, draws, d) array
        Parameter values, in the unit of each.
    names : tuple of str
        What the messages call the d parameters.

    References
    ----------
    Vehtari, Gelman, Simpson, Carpenter & Bürkner (2021), Bayesian Analysis 16, 667-718 (R-hat, effective
    sample sizes).
    """

    values: FloatArray
    names: tuple[str, ...]

    @cached_property
    def rhat(self) -> FloatArray:
        """Rank-normalised split R-hat of each parameter, the larger of bulk and tail: (d,) array."""
        return diagnostic("rhat", self.values)

    @cached_property
    def ess_bulk(self) -> FloatArray:
        """Effective sample size for the centre of each marginal: (d,) array."""
        return self._limited(diagnostic("ess", self.values, method="bulk"))

    @cached_property
    def ess_tail(self) -> FloatArray:
        """Effective sample size for the 5 % and 95 % quantiles, the smaller of both: (d,) array."""
        return self._limited(diagnostic("ess", self.values, method="tail", prob=0.05))

    def of(self, values: FloatArray, names: tuple[str, ...]) -> Self:
        """Return the same run with other quantities (chains, draws, k) that follow from its draws."""
        return replace(self, values=values, names=names)

    @property
    def converged(self) -> bool:
        """Whether every diagnostic passes its threshold."""
        return not self._failures()

    @property
    def verdict(self) -> str:
        """One sentence that says so, or what failed, and then what to try."""
        failures = self._failures()
        if failures:
            faults, remedies = zip(*failures, strict=True)
            return f"Not converged: {'; '.join(faults)}. Try {', or '.join(dict.fromkeys(remedies))}."
        return (
            f"Converged: R-hat at most {self.rhat.max():.4f}, effective sample sizes at least "
            f"{self.ess_bulk.min():.0f} (bulk) and {self.ess_tail.min():.0f} (tail), {self._quality()}."
        )

    @abstractmethod
    def _quality(self) -> str:
        """Return what else is good about a run that has converged."""

    @abstractmethod
    def _failures(self) -> list[tuple[str, str]]:
        """Return what failed and its remedy; a diagnostic that is not a number fails."""

    def _limited(self, sizes: FloatArray) -> FloatArray:
        """Return effective sample sizes, cut down where the sampler knows them to be too large."""
        return sizes

    def _small_sizes(self, minimum: float, remedy: str) -> list[tuple[str, str]]:
        """Return the failures of effective sample sizes that must exceed a least one."""
        failures = []
        for region, sizes in (("bulk", self.ess_bulk), ("tail", self.ess_tail)):
            worst = int(np.argmin(sizes))
            if not sizes[worst] > minimum:
                fault = f"the {region} effective sample size is {sizes[worst]:.0f} for {self.names[worst]}"
                failures.append((f"{fault} and must exceed {minimum}", remedy))
        return failures


def check_minima(sampler: str, settings: object, **minima: int) -> None:
    """Refuse settings of a sampler that are below their least values."""
    for name, minimum in minima.items():
        if getattr(settings, name) < minimum:
            raise InputError(f"{sampler} {name}: {getattr(settings, name)} is too few; use at least {minimum}.")


def diagnostic(statistic: str, draws: FloatArray, **options: Any) -> FloatArray:
    """Return one of ArviZ's diagnostics, imported when first needed, of a (chains, draws, ...) array."""
    from arviz_stats.base import array_stats

    values = getattr(array_stats, statistic)(draws, chain_axis=0, draw_axis=1, **options)
    return np.asarray(values, dtype=np.float64)
