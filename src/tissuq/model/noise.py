"""The measurement noise: independent and Gaussian, of a size that is known, unknown, or grows with the stress."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf
from numbers import Real
from typing import Any, ClassVar

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.errors import InputError
from tissuq.experiments.checked_arrays import stress_in_mpa
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.smoothing import scatter, smoothed
from tissuq.parameters.parameter import Parameter
from tissuq.parameters.priors import Uniform
from tissuq.registry import plugins, variants

MIN_SD_MPA, MAX_SD_MPA = 1e-150, 1e150
"""Known standard deviations whose squares can be computed lie between these."""
NOISE_SD = Parameter.scale("noise_sd", "standard deviation of the measurement noise")
NOISE_SHARE = Parameter(
    "noise_share", "noise per measured stress", "number", (0.0, inf), is_linear=False, relative_prior=Uniform(0.0, 1.0)
)
MIN_RELATIVE_SCATTER = 0.005
"""Smallest scatter over a test's root mean square stress: averaged and digitised curves are smooth but not exact."""
LEVELS_MPA = np.append(0.0, np.logspace(-6, 3, 10))
"""Stresses at which it is seen whether a noise depends on them."""
MAX_LEVELS = 200
"""Largest number of stress levels into which many measurements are sorted."""


@dataclass(frozen=True)
class Noise(ABC):
    """Independent Gaussian errors of measurement.

    A new noise is one subclass: its parameters and its standard deviation, which may depend on the level of the
    stress. Arithmetic only, so that NumPy and JAX values both pass through.
    """

    entry_point_group: ClassVar[str] = "tissuq.noises"
    name: ClassVar[str]
    description: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    shares_discrepancy: ClassVar[bool] = False
    """Whether measurements at one stretch share the independent part of the discrepancy (S), too."""
    is_consecutive: ClassVar[bool] = False
    """Whether the errors of consecutive measurements are correlated."""

    @abstractmethod
    def sd(self, values: Mapping[str, Any], level: Any) -> Any:
        """Return the standard deviation (MPa) for parameter values, at absolute stresses (MPa)."""

    @property
    def depends_on_level(self) -> bool:
        """Whether the standard deviation changes with the level of the stress."""
        return bool(np.ptp(self._sd_at_ones()) > 0)

    @property
    def problem(self) -> str:
        """What is wrong with its standard deviations, in words; nothing where they are numbers, one for each level."""
        sd = self._sd_at_ones()
        if sd.shape not in ((), LEVELS_MPA.shape):
            return f"sd has the shape {sd.shape} at {len(LEVELS_MPA)} stresses: it must be one number, or one for each"
        return "" if np.all((sd >= 0) & np.isfinite(sd)) else f"sd is {sd} at parameters of one, not positive"

    def __str__(self) -> str:
        return self.name

    def _sd_at_ones(self) -> FloatArray:
        return np.asarray(self.sd({p.symbol: 1.0 for p in self.parameters}, LEVELS_MPA))

    def of_tests(self, experiment: Experiment) -> FloatArray:
        """Return the noise (tests,) of each of several tests as known or about, MPa; their ratios are taken as known.

        Here by the scatter of each test about a smooth curve, and half a percent of its stress at least. That of a test
        that tells none, as it has few points or two controls, is as large beside its stress as the geometric mean of
        the others'.
        """
        sizes = np.array([float(np.sqrt((test.stress**2).mean())) for test in experiment.tests])
        smallest = MIN_RELATIVE_SCATTER * sizes
        scatters = np.maximum([_scatter_of(test) for test in experiment.tests], smallest)
        is_told = scatters > 0
        typical = np.exp(np.log(scatters[is_told] / sizes[is_told]).mean()) if is_told.any() else MIN_RELATIVE_SCATTER
        return np.where(is_told, scatters, typical * sizes)


@dataclass(frozen=True)
class KnownNoise(Noise):
    """The same known standard deviation everywhere."""

    value: float

    name = "known"
    description = "known standard deviation"

    def __post_init__(self) -> None:
        if not isinstance(self.value, Real) or self.value is True or not MIN_SD_MPA < self.value < MAX_SD_MPA:
            raise InputError(
                f"noise_sd must be a positive number of MPa or 'unknown', not {self.value!r}. "
                "Noise of zero would make every measurement exact; if it is not known, give 'unknown'."
            )

    def sd(self, values: Mapping[str, Any], level: Any) -> Any:
        return self.value

    def of_tests(self, experiment: Experiment) -> FloatArray:
        return np.full(len(experiment.tests), self.value)

    def __str__(self) -> str:
        return str(self.value)


@dataclass(frozen=True)
class KnownNoises(KnownNoise):
    """Known standard deviations, one for each of several tests; ``value`` is their geometric mean."""

    sds: tuple[float, ...] = ()

    def of_tests(self, experiment: Experiment) -> FloatArray:
        if len(self.sds) != len(experiment.tests):
            raise InputError(
                f"noise_sd has {len(self.sds)} values for {len(experiment.tests)} tests: give one for each, or one "
                "number for all."
            )
        return np.array(self.sds)

    def __str__(self) -> str:
        return ", ".join(map(str, self.sds))


class UnknownNoise(Noise):
    """The same standard deviation everywhere, a parameter.

    Beside errors of the test, `tissuq.fit` takes autoregressive noise for it where the data are far more probable so.
    """

    name = "unknown"
    description = "unknown standard deviation; of consecutive measurements correlated where the data say so"
    parameters: ClassVar[tuple[Parameter, ...]] = (NOISE_SD,)

    def sd(self, values: Mapping[str, Any], level: Any) -> Any:
        return values["noise_sd"]


class IndependentNoise(UnknownNoise):
    """The same standard deviation everywhere, a parameter, and errors that are independent whatever the data say."""

    name = "independent"
    description = "unknown standard deviation, the errors of consecutive measurements independent"


class ProportionalNoise(UnknownNoise):
    """Standard deviation noise_sd + noise_share |stress|, both parameters.

    The stress is that of a smoothing spline through the data, so that it is the same for every model and for
    repeated measurements: a plug-in, which leaves the stress linear in its parameters.
    """

    name = "proportional"
    description = "noise_sd + noise_share |stress|"
    parameters = (NOISE_SD, NOISE_SHARE)

    def sd(self, values: Mapping[str, Any], level: Any) -> Any:
        return values["noise_sd"] + values["noise_share"] * level


class RepeatNoise(UnknownNoise):
    """Unknown standard deviation, determined by the scatter of repeated measurements at the same stretch.

    The discrepancy is a function of the stretch (eq. 15), so repeated measurements share all of it, its
    independent error S included: what differs between them is noise. It separates the two, which `unknown` cannot.
    """

    name = "repeats"
    description = "unknown, determined by repeated measurements at the same stretch"
    shares_discrepancy = True


class AutoregressiveNoise(UnknownNoise):
    """The same unknown standard deviation everywhere, the errors of consecutive measurements correlated.

    Their correlation, that of first-order autoregression in the order of the measurements, is the one under which the
    data are most probable, everything else integrated (`tissuq.fit` finds it): a plug-in.
    """

    name = "autoregressive"
    description = "unknown, the errors of consecutive measurements correlated"
    is_consecutive = True


def noise_named(noise: Any) -> Noise:
    """Return the noise of that name, or of known standard deviation, or of one for each of several tests.

    A standard deviation is a number of MPa, a text with a unit, or a quantity of pint; a noise is returned as it is.

    Raises
    ------
    InputError
        When no noise has that name, or the number is not positive, or its unit is none of stress.
    """
    try:
        noise = stress_in_mpa(noise)
    except InputError as error:
        raise InputError(f"noise {noise!r}: {error} Noise in proportion to the stress is 'proportional'.") from error
    if isinstance(noise, Noise):
        return noise
    if isinstance(noise, (Sequence, np.ndarray)) and not isinstance(noise, str):
        sds = tuple(float(KnownNoise(stress_in_mpa(sd)).value) for sd in noise)
        return KnownNoises(float(np.exp(np.log(sds).mean())), sds)
    if not isinstance(noise, str):
        return KnownNoise(noise)
    return unknown_noise_named(noise)


def unknown_noise_named(name: str) -> Noise:
    """Return the noise of unknown standard deviation of that name, of tissuq or of another package.

    Raises
    ------
    InputError
        When no noise has that name.
    """
    kinds = {kind.name: kind for kind in variants(Noise).values() if not issubclass(kind, KnownNoise)}
    for kind in [kinds[name]] if name in kinds else plugins(Noise, name):
        return kind()
    raise InputError(
        f"there is no noise named '{name}': choose one of {', '.join(kinds)}, or give a standard deviation, a positive "
        "number, as noise_sd."
    )


def stress_level(experiment: Experiment) -> FloatArray:
    """Return the size (n,) of the stress at every measurement, MPa: a smoothing spline through each test.

    Many measurements are sorted into two hundred levels, half a percent of the range apart.
    """
    level = np.concatenate([_level_of(test) for test in experiment.tests])
    if len(level) > MAX_LEVELS and np.ptp(level) > 0:
        step = np.ptp(level) / MAX_LEVELS
        level = level.min() + np.minimum((level - level.min()) // step, MAX_LEVELS - 1) * step + 0.5 * step
    return np.asarray(level)


def _level_of(test: Experiment) -> FloatArray:
    if test.stretch.ndim > 1:
        return np.asarray(np.abs(test.stress.T.ravel()))
    return np.concatenate([np.abs(smoothed(curve.abscissa, curve.stress).stress) for curve in test.curves])


def _scatter_of(test: Experiment) -> float:
    """Return the scatter (MPa) of a test about a smooth curve; nan where it tells none."""
    curves = () if test.stretch.ndim > 1 else test.curves
    told = [found for curve in curves if (found := scatter(curve.abscissa, curve.stress)) is not None]
    return max(told, default=np.nan)
