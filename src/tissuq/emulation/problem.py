"""The calibration problem: measurements, priors and how they go together, discrepancy and noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import inf, isfinite
from numbers import Real
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from tissuq.arrays import FloatArray
from tissuq.errors import InputError, ModelError
from tissuq.model.discrepancy import Discrepancy, GaussianProcess, NoDiscrepancy, PinnedProcess
from tissuq.model.noise import NOISE_SD
from tissuq.parameters.checks import check_priors
from tissuq.parameters.parameter import Parameter
from tissuq.parameters.priors import Flat, LogNormal, Normal, Prior

Method = Literal["auto", "importance", "nuts"]
"""Method that finds the posterior: importance sampling, NUTS, or (auto) NUTS where importance sampling fails."""

DISCREPANCIES: dict[str, type[Discrepancy]] = {
    kind.name: kind for kind in (NoDiscrepancy, GaussianProcess, PinnedProcess)
}
"""Discrepancies that need no material."""
ERROR_SYMBOLS = {of.symbol for kind in DISCREPANCIES.values() for of in (*kind().parameters, NOISE_SD)}
"""Parameters of the discrepancies and the noise, which a parameter of the model cannot be called."""
PROBABILITIES = 1e-300, 1 - 2 * np.finfo(float).epsneg
"""The least and the largest probability at which a prior's quantile is finite."""


@dataclass(frozen=True)
class PriorCorrelation:
    """The correlation of standard scores: of normal parameters, and of the logarithms of log-normal ones.

    The parameters on that line are jointly normal, so that their density is that of the priors times
    exp(-z' (R^-1 - I) z / 2) / sqrt(det R) with z their scores.

    Attributes
    ----------
    priors : tuple of Prior
        Of all parameters of the forward model, in their order.
    matrix : tuple of tuples of float
        R.
    """

    priors: tuple[Prior, ...]
    matrix: tuple[tuple[float, ...], ...]

    def scores(self, independent: FloatArray) -> FloatArray:
        """Return correlated scores (N, d) of independent ones (N, d)."""
        return np.asarray(independent @ np.linalg.cholesky(np.array(self.matrix)).T)

    def log_density(self, values: Sequence[Any], arrays: Any) -> Any:
        """Return the log of the factor beside the priors at parameters (d,); ``arrays`` is NumPy or jax.numpy."""
        size = len(self.matrix)
        weights = np.linalg.inv(self.matrix) - np.eye(size)
        is_correlated = np.abs(weights).sum(axis=1) > 0
        pairs = zip(self.priors, values, is_correlated, strict=True)
        scores = arrays.stack([_score(prior, value, arrays) if used else 0.0 * value for prior, value, used in pairs])
        return -0.5 * scores @ weights @ scores - 0.5 * np.linalg.slogdet(self.matrix)[1]


def correlated(priors: Mapping[str, Prior], correlations: Mapping[tuple[str, str], float]) -> PriorCorrelation | None:
    """Return the correlation of priors from that of pairs; None where there is none.

    Raises
    ------
    InputError
        When a pair is not one of two parameters with normal or log-normal priors, or the pairs contradict each other.
    """
    if not correlations:
        return None
    if not isinstance(correlations, Mapping):
        raise InputError(
            f"correlations must be by pairs of parameters, such as {{('mu', 'b'): 0.5}}, not {correlations!r}."
        )
    symbols, matrix = list(priors), np.eye(len(priors))
    for pair, value in correlations.items():
        unknown = [symbol for symbol in pair if symbol not in priors]
        if len(pair) != 2 or pair[0] == pair[1] or unknown:
            raise InputError(
                f"the prior correlation of {', '.join(pair)} is not one of two parameters of the model, which are "
                f"{', '.join(symbols)}."
            )
        for symbol in pair:
            if not _is_whole(priors[symbol]):
                raise InputError(
                    f"the prior of {symbol}, {priors[symbol]}, can have no correlation: only normal priors without "
                    "bounds and log-normal ones can."
                )
        if not -1 < value < 1:
            raise InputError(f"the prior correlation of {', '.join(pair)} must lie between -1 and 1, not at {value:g}.")
        i, j = (symbols.index(symbol) for symbol in pair)
        matrix[i, j] = matrix[j, i] = value
    if np.linalg.eigvalsh(matrix)[0] <= 1e-9:
        raise InputError("the prior correlations contradict each other: no parameters have them together.")
    return PriorCorrelation(tuple(priors.values()), tuple(map(tuple, matrix.tolist())))


@dataclass(frozen=True, eq=False)
class Problem:
    """Measured = forward model + discrepancy + noise.

    Parameters
    ----------
    control, measured : (n,) arrays
        Controls that were set, and the values measured there, in the forward model's units.
    forward_priors : mapping of str to Prior
        Priors of the parameters of the forward model.
    error_priors : mapping of str to Prior
        Priors of the discrepancy's parameters and of an unknown noise.
    discrepancy : Discrepancy
    noise_sd : mapping of str to float or None
        Of every quantity that was measured; None where it is unknown.
    quantities : mapping of str to (int, int)
        First and last but one of the measurements of each quantity; the name of a single one is empty.
    correlation : PriorCorrelation or None
        Of the priors of the forward model's parameters.
    """

    control: FloatArray
    measured: FloatArray
    forward_priors: Mapping[str, Prior]
    error_priors: Mapping[str, Prior]
    discrepancy: Discrepancy
    noise_sd: Mapping[str, float | None]
    quantities: Mapping[str, tuple[int, int]]
    correlation: PriorCorrelation | None = None

    @cached_property
    def priors(self) -> dict[str, Prior]:
        """Priors of all parameters, those of the forward model first."""
        return {**self.forward_priors, **self.error_priors}

    @property
    def symbols(self) -> tuple[str, ...]:
        """All parameters."""
        return tuple(self.priors)

    @property
    def forward_symbols(self) -> tuple[str, ...]:
        """The parameters of the forward model."""
        return tuple(self.forward_priors)

    @property
    def without_discrepancy(self) -> tuple[str, ...]:
        """The quantities without a discrepancy, which at one control cannot be told from the model."""
        return tuple(name for name in self.quantities if not has_process(self.discrepancy, name, self.symbols))

    def values_of(self, scores: FloatArray) -> FloatArray:
        """Return parameters (N, D) whose joint prior is that of independent standard normal scores (N, D).

        They are finite, also where proposals with heavy tails have scores of probability zero or one.
        """
        from scipy.special import ndtr

        if self.correlation is not None:
            count = len(self.forward_priors)
            scores = np.hstack([self.correlation.scores(scores[:, :count]), scores[:, count:]])
        pairs = zip(self.priors.values(), scores.T, strict=True)
        return np.column_stack([prior.quantile(np.clip(ndtr(column), *PROBABILITIES)) for prior, column in pairs])


def pose(
    control: ArrayLike | Mapping[str, ArrayLike],
    measured: ArrayLike | Mapping[str, ArrayLike],
    priors: Mapping[str, Prior],
    discrepancy: str | Discrepancy = "gp-pinned",
    noise_sd: float | str | Mapping[str, float | str] = "unknown",
    zero_load: float = 0.0,
    correlations: Mapping[tuple[str, str], float] | None = None,
) -> Problem:
    """Return the problem, checked, with the priors that were not given.

    Parameters
    ----------
    control, measured : (n,) arrays, or mappings of str to array
        Of one quantity, or of several by their names, each with its own noise and discrepancy.
    priors : mapping of str to Prior
        Prior of each parameter of the forward model; and, to replace the defaults, of ``c``, ``psi`` and ``noise_sd``
        (with several quantities ``c_NAME`` and so on).
    discrepancy : str or Discrepancy
        ``"none"``, ``"gp"`` or ``"gp-pinned"``, a process of the control; a quantity at one control alone has none.
    noise_sd : float or str, or a mapping of them
        Standard deviation of the noise in the unit of what was measured, or ``"unknown"``.
    zero_load : float
        The control at zero load, where ``gp-pinned`` is zero with its slope.
    correlations : mapping of (str, str) to float, optional
        Of the priors of pairs of parameters: of their logarithms, where the prior is log-normal.

    Raises
    ------
    InputError, ModelError
        When something is missing or does not fit.
    """
    columns = _columns(control, measured)
    noises = dict(noise_sd) if isinstance(noise_sd, Mapping) else dict.fromkeys(columns, noise_sd)
    if set(noises) != set(columns):
        raise InputError(f"noise_sd is given for {', '.join(noises)}; what was measured is {', '.join(columns)}.")
    form = _discrepancy(discrepancy, zero_load)
    check_priors(priors)
    error_priors: dict[str, Prior] = {}
    for name, (controls, values) in columns.items():
        sd = noises[name]
        if sd != "unknown" and not (isinstance(sd, Real) and 0 < float(sd) < inf):
            raise InputError(f"noise_sd must be a positive number or 'unknown', not {sd!r}.")
        of_process = form.parameters if np.ptp(controls) else ()
        for parameter in (*of_process, *(() if sd != "unknown" else (NOISE_SD,))):
            symbol = symbol_of(parameter.symbol, name)
            error_priors[symbol] = priors.get(symbol) or _default_prior(parameter, controls, values)
            if isinstance(error_priors[symbol], Prior):
                error_priors[symbol].within(parameter.support)
    for name, sd in noises.items():
        if sd != "unknown" and (symbol := symbol_of(NOISE_SD.symbol, name)) in priors:
            raise InputError(
                f"a prior of {symbol} is given, and the noise, too ({sd:g}): leave out one of --prior and --noise-sd."
            )
    if not any(np.ptp(controls) for controls, _ in columns.values()):
        form = NoDiscrepancy()
    forward = {symbol: prior for symbol, prior in priors.items() if symbol not in error_priors}
    _check_priors(forward, error_priors)
    ends = np.cumsum([0, *(len(values) for _, values in columns.values())]).tolist()
    joined_controls, joined_values = (np.concatenate(arrays) for arrays in zip(*columns.values(), strict=True))
    return Problem(
        joined_controls,
        joined_values,
        forward,
        error_priors,
        form,
        {name: None if sd == "unknown" else float(sd) for name, sd in noises.items()},
        dict(zip(columns, pairwise(ends), strict=True)),
        correlated(forward, correlations or {}),
    )


def symbol_of(symbol: str, quantity: str) -> str:
    """Return the symbol of an error's parameter for a quantity, such as c_force; with a single quantity c."""
    return f"{symbol}_{quantity}" if quantity else symbol


def has_process(discrepancy: Discrepancy, quantity: str, symbols: Sequence[str]) -> bool:
    """Return whether a quantity has a process as discrepancy, the parameters of which are among all symbols."""
    return discrepancy.is_correlated and all(symbol_of(of.symbol, quantity) in symbols for of in discrepancy.parameters)


def is_far(control: FloatArray, zero_load: float) -> bool:
    """Return whether a process that is pinned at zero load is as good as free at all controls (n,): one has none."""
    return bool(np.abs(control - zero_load).min() > np.ptp(control) > 0)


def _is_whole(prior: Prior) -> bool:
    """Return whether a prior is a normal one without bounds, or a log-normal one."""
    if isinstance(prior, Normal):
        return prior.support == (-inf, inf)
    return isinstance(prior, LogNormal) and prior.support == (0.0, inf)


def _score(prior: Prior, value: Any, arrays: Any) -> Any:
    """Return how many standard deviations a value is from the middle, on the line of a normal or log-normal prior."""
    if isinstance(prior, LogNormal):
        return (arrays.log(value) - np.log(prior.median)) / prior.sd_log
    assert isinstance(prior, Normal)  # noqa: S101 (others have no correlation)
    return (value - prior.mean) / prior.sd


def _columns(
    control: ArrayLike | Mapping[str, ArrayLike], measured: ArrayLike | Mapping[str, ArrayLike]
) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return controls and measured values by quantity."""
    if isinstance(control, Mapping) != isinstance(measured, Mapping):
        raise InputError("control and measured must both be arrays, or both mappings of quantities to arrays.")
    set_by, measured_by = (values if isinstance(values, Mapping) else {"": values} for values in (control, measured))
    if set(set_by) != set(measured_by) or not set_by:
        raise InputError(f"the controls are of {', '.join(set_by)}, and what was measured is {', '.join(measured_by)}.")
    columns = {}
    for name in set_by:
        label = f" of {name}" if name else ""
        controls, values = _column(f"control{label}", set_by[name]), _column(f"measured{label}", measured_by[name])
        if len(controls) != len(values):
            raise InputError(
                f"there are {len(controls)} controls{label} and {len(values)} measured values; their numbers must be "
                "equal."
            )
        if not values.any():
            raise InputError(f"all measured values{label} are zero: nothing can be identified.")
        columns[name] = controls, values
    return columns


def _column(name: str, values: ArrayLike) -> FloatArray:
    try:
        column = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} must be an array of numbers: {error}.") from error
    if column.ndim != 1 or not column.size:
        raise InputError(f"{name} must be a one-dimensional array with values, not of shape {column.shape}.")
    if not np.isfinite(column).all():
        place = int(np.flatnonzero(~np.isfinite(column))[0])
        raise InputError(f"{name} is {column[place]} at position {place}; every value must be a finite number.")
    column.flags.writeable = False
    return column


def _discrepancy(discrepancy: str | Discrepancy, zero_load: float) -> Discrepancy:
    name = discrepancy.name if isinstance(discrepancy, Discrepancy) else discrepancy
    if name not in DISCREPANCIES:
        raise ModelError(
            f"discrepancy '{name}' cannot be used with a forward model, of which only the outputs are known: choose "
            f"one of {', '.join(DISCREPANCIES)}."
        )
    if not isinstance(zero_load, Real) or not isfinite(zero_load):
        raise InputError(f"the control at zero load must be a finite number, not {zero_load!r}.")
    if name == PinnedProcess.name:
        return PinnedProcess(references=(float(zero_load),))
    return DISCREPANCIES[name]()


def _default_prior(parameter: Parameter, control: FloatArray, measured: FloatArray) -> Prior:
    """Return the default prior of a parameter, in units of the data."""
    is_length = parameter.dimension == "stretch"
    unit = float(np.ptp(control) if is_length else np.abs(measured).max())
    assert parameter.relative_prior is not None  # noqa: S101  (those of scales and lengths have one)
    return parameter.relative_prior.scaled(unit)


def _check_priors(forward: Mapping[str, Prior], error_priors: Mapping[str, Prior]) -> None:
    if not forward:
        raise InputError("give a prior for every parameter of the forward model, such as C10=uniform(0, 5).")
    for symbol, prior in {**forward, **error_priors}.items():
        if not isinstance(prior, Prior):
            raise InputError(f"the prior of {symbol} must be a prior such as tissuq.Uniform(0, 5), not {prior!r}.")
        if isinstance(prior, Flat):
            raise InputError(f"the prior of {symbol} is flat and improper; an expensive model needs a proper one.")
