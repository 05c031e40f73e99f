"""Draws of parameters from their priors, and of the measurements to which they lead."""

from __future__ import annotations

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.errors import ModelError
from tissuq.model.statistical_model import StatisticalModel


def draw_from_prior(model: StatisticalModel, generator: np.random.Generator) -> tuple[dict[str, float], FloatArray]:
    """Return values of all parameters, drawn from their priors, and the measured stress (n,), MPa, that they lead to.

    An amplitude of which the drawn member of an energy discrepancy has no block is zero. Errors of whole tests are left
    out: it is a test without them.

    Raises
    ------
    ModelError
        When the noise depends on the data.
    """
    if model.noise.depends_on_level or model.noise.shares_discrepancy:
        raise ModelError(f"noise '{model.noise.name}' depends on the data, so data cannot be drawn from the prior.")
    values = {symbol: float(prior.quantile(generator.uniform())) for symbol, prior in model.priors.items()}
    states = model.experiment.states
    design = model.basis(states, [values[symbol] for symbol in model.bent_symbols])
    stress = design @ [values[symbol] for symbol in model.column_symbols]
    if model.energy_symbols:
        stress = stress + _energy_stress(model, values, generator)
    if model.is_correlated:
        covariance = model.correlated_variance(values) * model.correlation(states, states, values)
        sizes, vectors = np.linalg.eigh(covariance)
        stress = stress + vectors @ (np.sqrt(np.maximum(sizes, 0.0)) * generator.standard_normal(len(states)))
    noise = np.sqrt(model.white_variance(values)) * model.relative_noise(states)
    return values, stress + noise * generator.standard_normal(len(states))


def _energy_stress(model: StatisticalModel, values: dict[str, float], generator: np.random.Generator) -> FloatArray:
    """Draw a member and its weights; set the amplitudes that it has not to zero."""
    members = model.energy_members
    number = int(generator.choice(len(members), p=[candidate.probability for candidate in members]))
    member = members[number]
    for block, symbol in enumerate(model.energy_symbols):
        if block not in member.amplitude_indices:
            values[symbol] = 0.0
    stress = np.zeros(model.experiment.size)
    features = member.stress_features(model.experiment.states)
    for block, terms in zip(member.amplitude_indices, features, strict=True):
        stress += values[model.energy_symbols[block]] * terms @ generator.standard_normal(terms.shape[1])
    return stress
