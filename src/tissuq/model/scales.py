"""Units that follow from the data: default priors of parameters, and their supports."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.errors import ModelError
from tissuq.experiments.experiment import Experiment
from tissuq.mechanics.invariants import invariant_rates, largest_invariants
from tissuq.parameters.parameter import Parameter
from tissuq.parameters.priors import Prior, Uniform

MAX_SCORE = 8.0
"""Standard deviations beyond which probabilities round to one."""
BOX_MARGIN = 10.0
"""Default boxes of linear parameters reach this many times further than least squares could."""


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


def default_boxes(
    parameters: Sequence[Parameter], material_count: int, triangle: FloatArray, shortest: FloatArray | None
) -> dict[str, Prior]:
    """Return uniform priors of linear parameters that hold the least-squares solution with a margin, in any unit.

    |b_j| <= ||row j of pinv(X)|| ||y|| bounds every least-squares coefficient. The material's boxes come from its own
    columns alone, so that they are the same for every discrepancy. Where these depend on exponents, the shortest column
    over the prior of the exponents takes the place of the row: 1 / ||x_j|| is its length when the columns are
    orthogonal, and exponents that nearly agree would make it infinite.

    Parameters
    ----------
    parameters : sequence of Parameter
        All k linear ones, those of the material first.
    material_count : int
        Number of the material's parameters.
    triangle : (k + 1, k + 1) array
        Of the columns and the stress.
    shortest : (material_count,) array, optional
        Least lengths of the material's columns, where these depend on exponents.
    """
    of_material, of_all = (np.linalg.inv(triangle[:k, :k]) for k in (material_count, len(parameters)))
    lengths = np.array([np.linalg.norm(row) for row in (*of_material, *of_all[material_count:])])
    if shortest is not None:
        lengths[:material_count] = 1 / shortest
    size = float(np.linalg.norm(triangle[:, -1]))
    boxes: dict[str, Prior] = {}
    for parameter, length in zip(parameters, lengths, strict=True):
        reach = BOX_MARGIN * float(length) * size
        low, high = parameter.support
        boxes[parameter.symbol] = Uniform(max(low, -reach), min(high, reach))
    return boxes


def off_zero(prior: Prior, probability: float) -> float:
    """Return a quantile, or where that is zero, by which laws may divide, one nearby."""
    return float(prior.quantile(probability)) or float(prior.quantile(probability + 0.005))


def at_scores(priors: Sequence[Prior], scores: FloatArray) -> FloatArray:
    """Return the values (N, d) of parameters at coordinates (N, d) that are standard normal under their priors.

    None is zero, as of `off_zero`.
    """
    from scipy.special import ndtr

    probabilities, values = ndtr(np.clip(scores, -MAX_SCORE, MAX_SCORE)), np.empty(scores.shape)
    for side, prior in enumerate(priors):
        values[:, side] = prior.quantile(probabilities[:, side])
        for row in np.flatnonzero(values[:, side] == 0):
            values[row, side] = off_zero(prior, float(probabilities[row, side]))
    return values


def support(parameter: Parameter, data: Experiment) -> tuple[float, float]:
    """Return the lowest and highest value that a parameter can have; a limit lies beyond every measurement."""
    return (_unit(parameter, data), inf) if parameter.dimension == "limit" else parameter.support


def _unit(parameter: Parameter, data: Experiment) -> float:
    match parameter.dimension:
        case "stress":
            return float(np.abs(data.measured).max())
        case "modulus":
            return _pilot_modulus(data)
        case "stretch" if not _range_of_stretch(data):
            raise ModelError(
                f"experiment '{data.name}' has one stretch only, so the {parameter.description} {parameter.symbol} "
                "cannot be identified: measure at other stretches, or choose another discrepancy."
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
    return max(float(np.ptp(curve.abscissa)) for curve in data.curves)


def _largest_strain(data: Experiment) -> float:
    """Return the largest I1 - 3 of the data; a specimen at rest counts as one that was stretched by a millionth."""
    return max(largest_invariants(data.states)[0], 1e-12)


def _pilot_modulus(data: Experiment) -> float:
    """Return a rough C10 of the data, MPa: the median of stress over that of a neo-Hookean material with C10 = 1.

    It only sets the scale of priors: the same data in another unit give the same answer in that unit.
    """
    unit, _ = invariant_rates(data.states)
    used = (np.abs(unit) > 1e-3 * np.abs(unit).max()) & (data.measured != 0)
    return float(np.median(np.abs(data.measured[used] / unit[used])))
