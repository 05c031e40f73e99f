"""What is to be identified from what: measurements, priors, discrepancy and noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import inf, isfinite
from numbers import Real
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tissuq.discrepancy.discrepancy import Discrepancy
from tissuq.discrepancy.gaussian_process import GaussianProcess
from tissuq.discrepancy.none import NoDiscrepancy
from tissuq.discrepancy.pinned import PinnedProcess
from tissuq.errors import InputError, ModelError
from tissuq.noise import NOISE_SD
from tissuq.parameters import Parameter
from tissuq.priors import Flat, Prior

__all__ = ["DISCREPANCIES", "Method", "Problem", "pose"]

FloatArray = NDArray[np.float64]

Method = Literal["auto", "importance", "nuts"]
"""Of finding the posterior: importance sampling, NUTS, or the latter where the former fails."""

DISCREPANCIES: dict[str, type[Discrepancy]] = {
    kind.name: kind for kind in (NoDiscrepancy, GaussianProcess, PinnedProcess)
}
"""Those that need to know nothing of a material."""


@dataclass(frozen=True, eq=False)
class Problem:
    """Measured = forward model + discrepancy + noise.

    Parameters
    ----------
    control, measured : (n,) arrays
        What was set, and what was measured there; in the forward model's units.
    forward_priors : mapping of str to Prior
        Of the parameters of the forward model.
    other_priors : mapping of str to Prior
        Of the discrepancy's parameters and of an unknown noise.
    discrepancy : Discrepancy
    noise_sd : float or None
        None where it is unknown.
    """

    control: FloatArray
    measured: FloatArray
    forward_priors: Mapping[str, Prior]
    other_priors: Mapping[str, Prior]
    discrepancy: Discrepancy
    noise_sd: float | None

    @cached_property
    def priors(self) -> dict[str, Prior]:
        """Of all parameters, those of the forward model first."""
        return {**self.forward_priors, **self.other_priors}

    @property
    def symbols(self) -> tuple[str, ...]:
        """All parameters."""
        return tuple(self.priors)

    @property
    def forward_symbols(self) -> tuple[str, ...]:
        """Those of the forward model."""
        return tuple(self.forward_priors)


def pose(
    control: ArrayLike,
    measured: ArrayLike,
    priors: Mapping[str, Prior],
    discrepancy: str | Discrepancy = "none",
    noise_sd: float | str = "unknown",
    zero_load: float = 0.0,
) -> Problem:
    """Return the problem, checked, with the priors that were not given.

    Parameters
    ----------
    control, measured : (n,) arrays
    priors : mapping of str to Prior
        One for each parameter of the forward model; and, to replace the usual ones, of ``c``, ``psi`` and ``noise_sd``.
    discrepancy : str or Discrepancy
        ``"none"``, ``"gp"`` or ``"gp-pinned"``, a process of the control.
    noise_sd : float or str
        Standard deviation of the noise in the unit of what was measured, or ``"unknown"``.
    zero_load : float
        The control at zero load, where ``gp-pinned`` is zero with its slope.

    Raises
    ------
    InputError, ModelError
        When something is missing or does not fit.
    """
    at, values = _column("control", control), _column("measured", measured)
    if len(at) != len(values):
        raise InputError(f"there are {len(at)} controls and {len(values)} measured values; give one for every other.")
    if not values.any():
        raise InputError("everything that was measured is zero: nothing can be identified.")
    form = _discrepancy(discrepancy, zero_load)
    own = (*form.parameters, *(() if noise_sd != "unknown" else (NOISE_SD,)))
    if noise_sd != "unknown" and not (isinstance(noise_sd, Real) and 0 < float(noise_sd) < inf):
        raise InputError(f"noise_sd must be a positive number or 'unknown', not {noise_sd!r}.")
    others = {each.symbol: priors.get(each.symbol) or _usual(each, at, values) for each in own}
    forward = {symbol: prior for symbol, prior in priors.items() if symbol not in others}
    _check_priors(forward, others, own)
    return Problem(at, values, forward, others, form, None if noise_sd == "unknown" else float(noise_sd))


def _column(name: str, values: ArrayLike) -> FloatArray:
    try:
        found = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} must be an array of numbers: {error}.") from error
    if found.ndim != 1 or not found.size:
        raise InputError(f"{name} must be a one-dimensional array with values, not of shape {found.shape}.")
    if not np.isfinite(found).all():
        raise InputError(f"{name} is {found[~np.isfinite(found)][0]} somewhere; every value must be a finite number.")
    found.flags.writeable = False
    return found


def _discrepancy(asked: str | Discrepancy, zero_load: float) -> Discrepancy:
    name = asked.name if isinstance(asked, Discrepancy) else asked
    if name not in DISCREPANCIES:
        raise ModelError(
            f"discrepancy '{name}' cannot stand beside a forward model, of which only the outputs are known: choose "
            f"one of {', '.join(DISCREPANCIES)}."
        )
    if not isfinite(zero_load):
        raise InputError(f"the control at zero load must be a finite number, not {zero_load}.")
    if name == PinnedProcess.name:
        return PinnedProcess(reference=float(zero_load))
    return DISCREPANCIES[name]()


def _usual(parameter: Parameter, control: FloatArray, measured: FloatArray) -> Prior:
    """Return the usual prior of a parameter, in units of the data."""
    is_length = parameter.dimension == "stretch"
    unit = float(np.ptp(control) if is_length else np.abs(measured).max())
    if not unit:
        raise ModelError(
            f"all measurements are at one control, so that nothing tells the {parameter.description} "
            f"{parameter.symbol}: choose the discrepancy 'none'."
        )
    assert parameter.relative_prior is not None  # noqa: S101  (those of scales and lengths have one)
    return parameter.relative_prior.scaled(unit)


def _check_priors(forward: Mapping[str, Prior], others: Mapping[str, Prior], own: tuple[Parameter, ...]) -> None:
    if not forward:
        raise InputError("give a prior for every parameter of the forward model, such as C10=uniform(0, 5).")
    for symbol, prior in {**forward, **others}.items():
        if not isinstance(prior, Prior):
            raise InputError(f"the prior of {symbol} must be a prior such as tissuq.Uniform(0, 5), not {prior!r}.")
        if isinstance(prior, Flat):
            raise InputError(f"the prior of {symbol} is flat and improper; an expensive model needs a proper one.")
    for parameter in own:
        others[parameter.symbol].within(parameter.support)
