"""Least squares: how near a law comes to the measurements by itself, with no prior but where its parameters may be."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.errors import ModelError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import States
from tissuq.inference.quasi_monte_carlo import even_points
from tissuq.mechanics import Material, stress_basis
from tissuq.mechanics.stress import stresses_by_basis
from tissuq.parameters.priors import Prior

STARTS_PER_PARAMETER, REFINED = 64, 8
"""Values of each nonlinear parameter from which the search starts, and how many of the best go on."""
MAX_SEARCHED = 2000
"""Measurements, about, that the search looks at."""
MAX_START, MAX_SCORE = 4.0, 6.0
"""Of a nonlinear parameter in the normal coordinate of its prior: where the search starts, and goes, at the most."""
MISFIT_OF_NOTHING = 1e3
"""Residual over the stress where a law has no stress, as it has locked."""


@dataclass(frozen=True, eq=False)
class LeastSquares:
    """A law with the parameters that come nearest to the measurements.

    Attributes
    ----------
    material : Material
    values : (k,) array
        Its parameters, in MPa where they are stresses.
    r_squared, nrmse : float
        Share of the variance of the stress that it explains (missing where all stresses are the same), and its root
        mean square error over that of the stress.
    """

    material: Material
    values: FloatArray
    r_squared: float
    nrmse: float

    def stress(self, states: States) -> FloatArray:
        """Return the engineering stress (n,) at states, MPa."""
        return np.asarray(stresses_by_basis(self.material, states, self.values[None])[0])


def least_squares(data: Experiment, material: Material, priors: Mapping[str, Prior]) -> LeastSquares:
    """Fit a law to all measurements alike.

    The linear parameters follow from the others, by least squares within their bounds; the others are sought from
    many values all over their priors.

    Parameters
    ----------
    data : Experiment
    material : Material
    priors : mapping of str to Prior
        Of its parameters: where they may be.

    Raises
    ------
    ModelError
        When the law has no stress at some measurement, wherever it was sought.

    Examples
    --------
    >>> import numpy as np
    >>> import tissuq as tq
    >>> data = tq.simulate("ogden-1", {"mu1": 0.4, "alpha1": 3.0}, np.linspace(0.8, 1.6, 9))
    >>> posterior = tq.fit(data, material="ogden-1", discrepancy="none", noise_sd=0.01)
    >>> least_squares(data, posterior.model.material, posterior.model.priors).values.round(4)
    array([0.4, 3. ])
    """
    from scipy.optimize import least_squares as refined
    from scipy.optimize import lsq_linear
    from scipy.special import ndtr

    step = max(1, data.size // MAX_SEARCHED)
    states, stress = data.states.thinned(step), np.concatenate([curve.stress[::step] for curve in data.curves])
    unit = float(np.linalg.norm(stress)) or 1.0  # searches end where gradients are small as numbers
    stress = stress / unit
    is_linear = material.linear_mask
    supports = [
        np.divide(priors[parameter.symbol].support, unit) for parameter in material.parameters if parameter.is_linear
    ]
    bent = [priors[parameter.symbol] for parameter in material.parameters if not parameter.is_linear]

    def values_at(scores: FloatArray) -> FloatArray:
        return np.array([prior.quantile(ndtr(score)) for prior, score in zip(bent, scores.T, strict=True)]).T

    def linear(basis: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the linear parameters and the residual, both over the unit."""
        with np.errstate(over="ignore", invalid="ignore"):
            size = np.maximum(np.linalg.norm(basis, axis=0), 1e-300)
        if not np.isfinite(size).all():
            return np.zeros(basis.shape[1]), MISFIT_OF_NOTHING * stress
        low, high = np.array(supports).T * size
        scaled = lsq_linear(basis / size, stress, (low, high)).x
        return scaled / size, stress - basis @ (scaled / size)

    def residual(scores: FloatArray) -> FloatArray:
        return linear(stress_basis(material, states, values_at(scores[None])[0]))[1]

    scores = np.zeros((1, 0))
    if bent:
        starts = MAX_START * (2 * even_points(len(bent), STARTS_PER_PARAMETER * len(bent)) - 1)
        bases = stress_basis(material, states, values_at(starts))
        misfits = np.array([(linear(basis)[1] ** 2).sum() for basis in bases])
        best = starts[np.argsort(misfits)[:REFINED]]
        optima = [refined(residual, start, bounds=(-MAX_SCORE, MAX_SCORE), x_scale=1.0) for start in best]
        scores = min(optima, key=lambda result: result.cost).x[None]
    values = np.empty(len(is_linear))
    values[~is_linear] = values_at(scores)[0] if bent else []
    values[is_linear] = unit * linear(stress_basis(material, states, values[~is_linear]))[0]
    measured = data.measured
    residuals = measured - stresses_by_basis(material, data.states, values[None])[0]
    if not np.isfinite(residuals).all():
        raise ModelError(f"material '{material.name}' has no stress at some of the measurements.")
    total = ((measured - measured.mean()) ** 2).sum()
    nrmse = float(np.sqrt((residuals**2).mean() / (measured**2).mean()))
    r_squared = float(1 - (residuals**2).sum() / total) if total else np.nan
    return LeastSquares(material, values, r_squared, nrmse)
