"""Prior distributions of one parameter: normalised densities on a support, by name.

They are small enough to be written here: the exact route then needs no probabilistic-programming library,
whose import alone takes longer than all seven posteriors of the paper. The tests hold them against SciPy.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields, replace
from math import inf, isfinite, log, pi
from typing import Any, ClassVar, Self

import numpy as np

from tissuq.errors import InputError
from tissuq.registry import find, variants

__all__ = ["Exponential", "HalfCauchy", "HalfNormal", "LogNormal", "Normal", "Prior", "Uniform", "prior_from"]


@dataclass(frozen=True)
class Prior(ABC):
    """A normalised density of one parameter.

    A new prior is one subclass with its log density inside the support, its quantile function, and the names of the
    fields that carry the parameter's unit. Arithmetic only, so that NumPy and JAX arrays both pass through.
    """

    name: ClassVar[str]
    with_unit: ClassVar[tuple[str, ...]]
    """Fields that scale with the unit of the parameter."""

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not isinstance(value, int | float) or not isfinite(value):
                raise InputError(f"prior {self}: {field.name} must be a finite number.")
        self._check()

    def _check(self) -> None:
        if getattr(self, self.with_unit[-1]) <= 0:
            raise InputError(f"prior {self}: {self.with_unit[-1]} must be positive.")

    @property
    @abstractmethod
    def support(self) -> tuple[float, float]:
        """The lowest and highest value with positive density."""

    @abstractmethod
    def log_density(self, value: Any) -> Any:
        """Return the log of the normalised density at values inside the support."""

    @abstractmethod
    def quantile(self, probability: Any) -> Any:
        """Return the values below which the given probabilities lie."""

    def scaled(self, factor: float) -> Self:
        """Return the same prior for the parameter expressed in a unit ``factor`` times smaller."""
        return replace(self, **{field: getattr(self, field) * factor for field in self.with_unit})

    def as_dict(self) -> dict[str, float | str]:
        """Return the plain form that configuration files hold."""
        return {"distribution": self.name} | {f.name: float(getattr(self, f.name)) for f in fields(self)}

    def __str__(self) -> str:
        return f"{self.name}({', '.join(f'{getattr(self, f.name):.6g}' for f in fields(self))})"


@dataclass(frozen=True)
class Uniform(Prior):
    """Constant density between two bounds: p(x) = 1 / (high - low)."""

    low: float
    high: float

    name = "uniform"
    with_unit = ("low", "high")

    def _check(self) -> None:
        if self.low >= self.high:
            raise InputError(f"prior {self}: low must be less than high.")

    @property
    def support(self) -> tuple[float, float]:
        return self.low, self.high

    def log_density(self, value: Any) -> Any:
        return -log(self.high - self.low) + 0.0 * value

    def quantile(self, probability: Any) -> Any:
        return self.low + (self.high - self.low) * probability


@dataclass(frozen=True)
class Normal(Prior):
    """Gaussian density with a mean and a standard deviation."""

    mean: float
    sd: float

    name = "normal"
    with_unit = ("mean", "sd")

    @property
    def support(self) -> tuple[float, float]:
        return -inf, inf

    def log_density(self, value: Any) -> Any:
        return -0.5 * ((value - self.mean) / self.sd) ** 2 - log(self.sd) - 0.5 * log(2 * pi)

    def quantile(self, probability: Any) -> Any:
        from scipy.special import ndtri

        return self.mean + self.sd * ndtri(probability)


@dataclass(frozen=True)
class HalfNormal(Prior):
    """The positive half of a Gaussian with mean zero."""

    sd: float

    name = "half-normal"
    with_unit = ("sd",)

    @property
    def support(self) -> tuple[float, float]:
        return 0.0, inf

    def log_density(self, value: Any) -> Any:
        return -0.5 * (value / self.sd) ** 2 - log(self.sd) + 0.5 * log(2 / pi)

    def quantile(self, probability: Any) -> Any:
        from scipy.special import ndtri

        return self.sd * ndtri(0.5 + 0.5 * np.asarray(probability))


@dataclass(frozen=True)
class HalfCauchy(Prior):
    """The positive half of a Cauchy density: p(x) = 2 / (pi scale (1 + (x / scale)^2))."""

    scale: float

    name = "half-cauchy"
    with_unit = ("scale",)

    @property
    def support(self) -> tuple[float, float]:
        return 0.0, inf

    def log_density(self, value: Any) -> Any:
        return log(2 / (pi * self.scale)) - _log(1 + (value / self.scale) ** 2)

    def quantile(self, probability: Any) -> Any:
        return self.scale * np.tan(0.5 * pi * np.asarray(probability))


@dataclass(frozen=True)
class Exponential(Prior):
    """Exponential density with a mean: p(x) = exp(-x / mean) / mean."""

    mean: float

    name = "exponential"
    with_unit = ("mean",)

    @property
    def support(self) -> tuple[float, float]:
        return 0.0, inf

    def log_density(self, value: Any) -> Any:
        return -value / self.mean - log(self.mean)

    def quantile(self, probability: Any) -> Any:
        return -self.mean * np.log1p(-np.asarray(probability))


@dataclass(frozen=True)
class LogNormal(Prior):
    """Density whose logarithm is Gaussian: a median with the parameter's unit, and the sd of the logarithm."""

    median: float
    sd_log: float

    name = "log-normal"
    with_unit = ("median",)

    def _check(self) -> None:
        if self.median <= 0 or self.sd_log <= 0:
            raise InputError(f"prior {self}: median and sd_log must be positive.")

    @property
    def support(self) -> tuple[float, float]:
        return 0.0, inf

    def log_density(self, value: Any) -> Any:
        logarithm = _log(value)
        centred = (logarithm - log(self.median)) / self.sd_log
        return -0.5 * centred**2 - logarithm - log(self.sd_log) - 0.5 * log(2 * pi)

    def quantile(self, probability: Any) -> Any:
        from scipy.special import ndtri

        return self.median * np.exp(self.sd_log * ndtri(probability))


def prior_from(settings: dict[str, Any]) -> Prior:
    """Return the prior that a mapping with ``distribution`` and its arguments describes.

    Raises
    ------
    InputError
        When the distribution is unknown or its arguments are not its own.
    """
    arguments = dict(settings)
    name = arguments.pop("distribution", "uniform")
    kind = find(Prior, "prior distribution", name, InputError)
    expected = [field.name for field in fields(kind)]
    if sorted(arguments) != sorted(expected):
        given = ", ".join(arguments) or "nothing"
        raise InputError(f"a {name} prior needs {' and '.join(expected)}; it was given {given}.")
    return kind(**arguments)


def distributions() -> dict[str, type[Prior]]:
    """Return every prior distribution by name."""
    return variants(Prior)


def _log(value: Any) -> Any:
    """Take the logarithm with the library that the array belongs to."""
    array = value if hasattr(value, "__array_namespace__") else np.asarray(value)
    return array.__array_namespace__().log(array)
