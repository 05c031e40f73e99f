"""The units that data set: default priors of nonlinear parameters, and what values they can take."""

from __future__ import annotations

from math import inf

import numpy as np

from tissuq.errors import ModelError
from tissuq.experiments.experiment import Experiment
from tissuq.mechanics.path import invariant_rates, invariants
from tissuq.parameters import Parameter
from tissuq.priors import Prior

__all__ = ["default_prior", "support"]


def default_prior(parameter: Parameter, data: Experiment) -> Prior:
    """Return the relative prior of a parameter in units of the data.

    Raises
    ------
    ModelError
        When the parameter has none, or the data do not set its unit.
    """
    if parameter.relative_prior is None:
        raise ModelError(f"parameter {parameter.symbol} has no default prior: give one.")
    return parameter.relative_prior.scaled(_unit(parameter, data))


def support(parameter: Parameter, data: Experiment) -> tuple[float, float]:
    """Return the lowest and highest value that a parameter can have; a limit lies beyond every measurement."""
    return (_unit(parameter, data), inf) if parameter.dimension == "limit" else parameter.support


def _unit(parameter: Parameter, data: Experiment) -> float:
    match parameter.dimension:
        case "stress":
            return float(np.abs(data.stress).max())
        case "modulus":
            return _pilot_modulus(data)
        case "stretch" if not _range_of_stretch(data):
            raise ModelError(
                f"experiment '{data.name}' has one stretch only, so nothing tells the {parameter.description} "
                f"{parameter.symbol}: measure at other stretches, or choose another discrepancy."
            )
        case "stretch":
            return _range_of_stretch(data)
        case "limit":
            return max(parameter.support[0], _largest_strain(data))
        case "rate":
            return 1 / _largest_strain(data)
        case "number":
            return 1.0


def _range_of_stretch(data: Experiment) -> float:
    """Return the range of what the stress is drawn against, the largest of all tests."""
    parts = data.parts
    return max(float(np.ptp(path.abscissa(part.stretch))) for part in parts for path in part.mode.channels)


def _largest_strain(data: Experiment) -> float:
    """Return the largest I1 - 3 of the data; a specimen at rest counts as one that was stretched by a millionth."""
    return max(float(invariants(data.mode, data.stretch)[0].max()), 1e-12)


def _pilot_modulus(data: Experiment) -> float:
    """Return a rough C10 of the data, MPa: the median of stress over that of a neo-Hookean material with C10 = 1.

    It only sets the scale of priors: the same data in another unit give the same answer in that unit.
    """
    unit, _ = invariant_rates(data.mode, data.stretch)
    used = (np.abs(unit) > 1e-3 * np.abs(unit).max()) & (data.stress != 0)
    return float(np.median(np.abs(data.stress[used] / unit[used])))
