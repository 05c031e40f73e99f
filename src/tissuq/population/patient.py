"""Stress of a new patient: a material from the population, and the model error of a specimen that was measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tissuq.assessment.stability import calibrated_range
from tissuq.experiments.modes import LoadingMode, loading_mode
from tissuq.inference.solution import Components
from tissuq.mechanics import Material, engineering_stress, initial_shear_modulus
from tissuq.population.coordinates import Coordinates
from tissuq.posterior import Posterior
from tissuq.prediction.moments import drawn_curves, values_of

__all__ = ["matching_draws", "patient_curves"]

FloatArray = NDArray[np.float64]

SMALL = 1e-3
"""Of the stretch, for the initial slope."""
LEAST_MODULUS = 0.1
"""Of the median initial modulus of a specimen: a draw nearer to zero does not scale its model error."""


def matching_draws(posterior: Posterior, coordinates: Coordinates, places: FloatArray) -> Components:
    """Return the draws of a specimen by itself, as points, whose pooled parameters come nearest to places (N, d)."""
    from scipy.spatial import KDTree

    every = posterior.solution.components
    chosen, drawn = every.drawn(posterior.seed)
    which, linear, width = chosen.ravel(), drawn.reshape(-1, drawn.shape[2]), every.root.shape[1:]
    points = replace(every[which], mean=linear, root=np.broadcast_to(np.zeros(width), (len(which), *width)))
    own = coordinates.to_line(values_of(posterior.model, points, coordinates.symbols)[0])
    own = np.maximum(own, -1e3)  # a modulus of zero
    spread = own.std(axis=0) + 1e-300
    return points[KDTree(own / spread).query(places / spread)[1]]


def patient_curves(
    posterior: Posterior,
    coordinates: Coordinates,
    draws: Components,
    new: FloatArray,
    stretch: FloatArray,
    *,
    mode: LoadingMode,
    channel: int,
    discrepancy: bool,
) -> FloatArray:
    """Return stresses (N, g) of new patients whose model error is that of one specimen.

    They are nan where the specimen was not measured; and in other modes than its own if its error is not an energy.

    Parameters
    ----------
    posterior : Posterior
        The specimen by itself.
    coordinates : Coordinates
    draws : Components
        N draws of the specimen.
    new : (N, d) array
        The pooled parameters of the patients; what is not pooled is the specimen's.
    stretch : (g,) array
    mode : LoadingMode
    channel : int
        Which of its stresses.
    discrepancy : bool
        Add the specimen's discrepancy in the same draw, in proportion to the patient's initial modulus.
    """
    model = posterior.model
    own, _ = values_of(model, draws, model.material_symbols)
    values = own.copy()
    values[:, [model.material_symbols.index(symbol) for symbol in coordinates.symbols]] = new
    curves = engineering_stress(model.material, mode.channels[channel], stretch, values)
    if not discrepancy:
        return curves
    was_measured = mode in model.experiment.modes
    if not was_measured and not model.discrepancy.is_energy:
        return np.full_like(curves, np.nan)
    path, points = model.experiment.along(mode, stretch, channel)
    _, error = drawn_curves(model, draws, points, mode=None if was_measured else path)
    before, after = (_initial_modulus(model.material, each) for each in (own, values))
    curves = curves + error * (after / np.maximum(before, LEAST_MODULUS * np.median(before)))[:, None]
    low, high = calibrated_range(model.experiment, mode)
    return np.where((stretch < low - SMALL) | (stretch > high + SMALL), np.nan, curves)


def _initial_modulus(material: Material, values: FloatArray) -> FloatArray:
    """Return the initial shear moduli (N,) of material parameters (N, p)."""
    if not material.is_isotropic:
        return np.array([initial_shear_modulus(material, each) for each in values])
    slope = engineering_stress(material, loading_mode("uniaxial"), np.array([1 + SMALL]), values)
    return np.asarray(slope[:, 0] / (3 * SMALL))
