"""Prior distributions of one parameter: normalised densities on a support, by name.

They are written here so that the exact route needs no probabilistic-programming library, whose import alone takes
longer than all seven posteriors of the paper. The tests compare them with SciPy.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import MISSING, dataclass, fields, replace
from math import inf, isnan, log, pi, sqrt
from numbers import Real
from typing import Any, ClassVar, Self

import numpy as np

from tissuq.errors import InputError
from tissuq.parameters.normal_interval import interval_quantile, log_interval
from tissuq.registry import find

SEEN_PROBABILITIES = np.array([0.25, 0.5, 0.75])
STEP_OF_PROBABILITY = 1e-3
SAME_DENSITY = 0.02
"""Where a prior is looked at: at these quantiles its density is that of their differences, but for so much."""


@dataclass(frozen=True)
class Prior(ABC):
    """A normalised density of one parameter.

    A new prior is one subclass with its log density inside the support, its quantile function, and the names of the
    fields that carry the parameter's unit. Arithmetic only, so that NumPy and JAX arrays both pass through.
    """

    entry_point_group: ClassVar[str] = "tissuq.priors"
    name: ClassVar[str]
    with_unit: ClassVar[tuple[str, ...]]
    """Fields that scale with the unit of the parameter."""
    has_moments: ClassVar[bool] = True
    """Whether it has a mean and a standard deviation."""

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not isinstance(value, Real) or isnan(value) or (abs(value) == inf and field.default is MISSING):
                raise InputError(f"prior {self.name}: {field.name} must be a finite number, not {value!r}.")
        self._check()

    def _check(self) -> None:
        if getattr(self, self.with_unit[-1]) <= 0:
            raise InputError(f"prior {self}: {self.with_unit[-1]} must be positive.")

    @property
    @abstractmethod
    def support(self) -> tuple[float, float]:
        """The lowest and highest value with positive density."""

    @property
    def gaussian(self) -> tuple[float, float, float] | None:
        """Mean, precision and log of the factor of exp(-precision (x - mean)^2 / 2) inside the support.

        Flat and uniform densities have precision zero; None where the density is not of this form.
        """
        return None

    @abstractmethod
    def log_density(self, value: Any) -> Any:
        """Return the log of the normalised density at values inside the support."""

    @abstractmethod
    def quantile(self, probability: Any) -> Any:
        """Return the values below which the given probabilities lie."""

    @property
    def problem(self) -> str:
        """What is wrong with it, in words; nothing where its density is the derivative of its probability.

        Examples
        --------
        >>> HalfCauchy(2.0).problem
        ''
        """
        values = self.quantile(SEEN_PROBABILITIES + np.array([[-1], [0], [1]]) * STEP_OF_PROBABILITY)
        ratios = np.exp(self.log_density(values[1])) * (values[2] - values[0]) / (2 * STEP_OF_PROBABILITY)
        if np.allclose(ratios, 1.0, rtol=0.0, atol=SAME_DENSITY):
            return ""
        return f"its density is {ratios.round(2)} times that of its quantiles, not normalised or not of the same law"

    def within(self, support: tuple[float, float]) -> Self:
        """Return the prior for a parameter that can only take values in ``support``.

        Raises
        ------
        InputError
            When the prior reaches beyond this range and cannot be truncated.
        """
        if self.support[0] < support[0] or self.support[1] > support[1]:
            raise InputError(
                f"the prior {self} reaches beyond the range of the parameter, {support[0]:g} to {support[1]:g}."
            )
        return self

    def scaled(self, factor: float) -> Self:
        """Return the same prior for the parameter expressed in a unit ``factor`` times smaller."""
        return replace(self, **{field: getattr(self, field) * factor for field in self.with_unit})

    def as_dict(self) -> dict[str, float | str]:
        """Return the plain form that configuration files hold."""
        return {"distribution": self.name} | self._arguments()

    def __str__(self) -> str:
        optional = {field.name for field in fields(self) if field.default is not MISSING}
        arguments = (
            f"{name}={value:.6g}" if name in optional else f"{value:.6g}" for name, value in self._arguments().items()
        )
        return f"{self.name}({', '.join(arguments)})"

    def _arguments(self) -> dict[str, float]:
        """Return the arguments, without infinite bounds at the end."""
        values = {field.name: float(getattr(self, field.name)) for field in fields(self)}
        return {name: value for name, value in values.items() if abs(value) != inf}


@dataclass(frozen=True)
class Interval(Prior):
    """The same density everywhere between two bounds."""

    low: float
    high: float

    with_unit = ("low", "high")

    def _check(self) -> None:
        _check_order(self, self.low, self.high)

    @property
    def support(self) -> tuple[float, float]:
        return self.low, self.high

    @property
    def gaussian(self) -> tuple[float, float, float]:
        return 0.0, 0.0, self._height

    @property
    @abstractmethod
    def _height(self) -> float:
        """The log of the density."""

    def log_density(self, value: Any) -> Any:
        return self._height + 0.0 * value


@dataclass(frozen=True)
class Uniform(Interval):
    """Constant density between two bounds: p(x) = 1 / (high - low)."""

    name = "uniform"

    @property
    def _height(self) -> float:
        return -log(self.high - self.low)

    def quantile(self, probability: Any) -> Any:
        return self.low + (self.high - self.low) * probability


@dataclass(frozen=True)
class Flat(Interval):
    """Density one between bounds that may be infinite: improper, for linear parameters only, and without evidence."""

    low: float = -inf
    high: float = inf

    name = "flat"
    problem = ""
    _height = 0.0

    def within(self, support: tuple[float, float]) -> Self:
        return replace(self, low=max(self.low, support[0]), high=min(self.high, support[1]))

    def quantile(self, probability: Any) -> Any:
        raise InputError(
            f"the prior {self} is improper: it has no quantiles, and cannot be used for a nonlinear parameter."
        )


@dataclass(frozen=True)
class Normal(Prior):
    """Gaussian density with a mean and a standard deviation, between bounds when they are given (and normalised)."""

    mean: float
    sd: float
    low: float = -inf
    high: float = inf

    name = "normal"
    with_unit = ("mean", "low", "high", "sd")

    def _check(self) -> None:
        super()._check()
        _check_order(self, self.low, self.high)

    @property
    def support(self) -> tuple[float, float]:
        return self.low, self.high

    def within(self, support: tuple[float, float]) -> Self:
        return replace(self, low=max(self.low, support[0]), high=min(self.high, support[1]))

    @property
    def gaussian(self) -> tuple[float, float, float]:
        return self.mean, self.sd**-2, -log(self.sd * sqrt(2 * pi)) - float(log_interval(*self._ends))

    def log_density(self, value: Any) -> Any:
        return -0.5 * ((value - self.mean) / self.sd) ** 2 + self.gaussian[2]

    def quantile(self, probability: Any) -> Any:
        return self.mean + self.sd * interval_quantile(probability, *self._ends)[0]

    @property
    def _ends(self) -> tuple[float, float]:
        """The bounds in standard deviations from the mean."""
        return (self.low - self.mean) / self.sd, (self.high - self.mean) / self.sd


@dataclass(frozen=True)
class HalfNormal(Prior):
    """The positive half of a Gaussian with mean zero."""

    sd: float

    name = "half-normal"
    with_unit = ("sd",)
    support = 0.0, inf

    @property
    def gaussian(self) -> tuple[float, float, float]:
        return 0.0, self.sd**-2, 0.5 * log(2 / pi) - log(self.sd)

    def log_density(self, value: Any) -> Any:
        return -0.5 * (value / self.sd) ** 2 + self.gaussian[2]

    def quantile(self, probability: Any) -> Any:
        from scipy.special import ndtri

        return self.sd * ndtri(0.5 + 0.5 * np.asarray(probability))


@dataclass(frozen=True)
class HalfCauchy(Prior):
    """The positive half of a Cauchy density: p(x) = 2 / (pi scale (1 + (x / scale)^2))."""

    scale: float

    name = "half-cauchy"
    with_unit = ("scale",)
    has_moments = False
    support = 0.0, inf

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
    support = 0.0, inf

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
    support = 0.0, inf

    def _check(self) -> None:
        if self.median <= 0 or self.sd_log <= 0:
            raise InputError(f"prior {self}: median and sd_log must be positive.")

    def log_density(self, value: Any) -> Any:
        logarithm = _log(value)
        centred = (logarithm - log(self.median)) / self.sd_log
        return -0.5 * centred**2 - logarithm - log(self.sd_log) - 0.5 * log(2 * pi)

    def quantile(self, probability: Any) -> Any:
        from scipy.special import ndtri

        return self.median * np.exp(self.sd_log * ndtri(probability))


@dataclass(frozen=True)
class LogUniform(Prior):
    """Density whose logarithm is uniform between two positive bounds: p(x) = 1 / (x log(high / low))."""

    low: float
    high: float

    name = "log-uniform"
    with_unit = ("low", "high")

    def _check(self) -> None:
        if self.low <= 0:
            raise InputError(f"prior {self}: low must be positive.")
        _check_order(self, self.low, self.high)

    @property
    def support(self) -> tuple[float, float]:
        return self.low, self.high

    def log_density(self, value: Any) -> Any:
        return -_log(value) - log(log(self.high / self.low))

    def quantile(self, probability: Any) -> Any:
        return self.low * (self.high / self.low) ** np.asarray(probability)


def prior_from(settings: dict[str, Any]) -> Prior:
    """Return the prior that a mapping with ``distribution`` and its arguments describes.

    Raises
    ------
    InputError
        When the distribution or one of its arguments is unknown.
    """
    arguments = dict(settings)
    name = arguments.pop("distribution", "uniform")
    kind = find(Prior, "prior distribution", str(name), InputError)
    expected = [field.name for field in fields(kind)]
    needed = [field.name for field in fields(kind) if field.default is MISSING]
    if set(arguments) - set(expected) or set(needed) - set(arguments):
        stated = ", ".join(arguments) or "nothing"
        optional_names = [option for option in expected if option not in needed]
        optional = f" (and may have {' and '.join(optional_names)})" if optional_names else ""
        raise InputError(f"a {name} prior needs {' and '.join(needed)}{optional}; it was given {stated}.")
    return kind(**arguments)


def _check_order(prior: Prior, low: float, high: float) -> None:
    if low >= high:
        raise InputError(f"prior {prior}: low must be less than high.")


def _log(value: Any) -> Any:
    """Take the logarithm with the library that the array belongs to."""
    array = value if hasattr(value, "__array_namespace__") else np.asarray(value)
    return array.__array_namespace__().log(array)
