"""Data from the model itself: every parameter from its prior, then the stress and its noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import ModelError
from tissuq.model import StatisticalModel

__all__ = ["draw_from_prior"]

FloatArray = NDArray[np.float64]


def draw_from_prior(model: StatisticalModel, generator: np.random.Generator) -> tuple[dict[str, float], FloatArray]:
    """Return values of all parameters, drawn from their priors, and the measured stress (n,), MPa, that they lead to.

    An amplitude of which the drawn member of an energy discrepancy has no block is zero.

    Raises
    ------
    ModelError
        When the noise depends on the data.
    """
    if model.noise.depends_on_level or model.noise.shares_discrepancy:
        raise ModelError(f"noise '{model.noise.name}' depends on the data, so nothing can be drawn before them.")
    values = {symbol: float(prior.quantile(generator.uniform())) for symbol, prior in model.priors.items()}
    stretch = model.experiment.stretch
    design = model.design_at([values[symbol] for symbol in model.bent_symbols])
    stress = design @ [values[symbol] for symbol in model.column_symbols]
    if model.energy_symbols:
        stress = stress + _energy_stress(model, values, generator)
    if model.is_correlated:
        covariance = model.correlated_variance(values) * model.correlation(stretch, stretch, values)
        sizes, vectors = np.linalg.eigh(covariance)
        stress = stress + vectors @ (np.sqrt(np.maximum(sizes, 0.0)) * generator.standard_normal(len(stretch)))
    return values, stress + np.sqrt(model.white_variance(values)) * generator.standard_normal(len(stretch))


def _energy_stress(model: StatisticalModel, values: dict[str, float], generator: np.random.Generator) -> FloatArray:
    """Draw a member and its weights; set the amplitudes that it has not to zero."""
    members = model.energy_members
    chosen = int(generator.choice(len(members), p=[each.probability for each in members]))
    member = members[chosen]
    for place, symbol in enumerate(model.energy_symbols):
        if place not in member.places:
            values[symbol] = 0.0
    stress = np.zeros(len(model.experiment))
    for place, terms in zip(member.places, model.energy_features(chosen), strict=True):
        stress += values[model.energy_symbols[place]] * terms @ generator.standard_normal(terms.shape[1])
    return stress
