"""The derivative of a strain energy without a compiler: an imaginary step, exact to rounding, for few points."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tissuq.experiments.modes import States
from tissuq.experiments.modes.path import STEP
from tissuq.mechanics.material import Material

__all__ = ["MOST_VALUES", "complex_step_stress"]

FloatArray = NDArray[np.float64]

MOST_VALUES = 10_000
"""Stresses from which compiled derivatives are quicker."""
REAL_STEP = 1e-5
AGREEMENT = 1e-6
"""Relative difference from a real difference quotient beyond which an energy is not differentiable this way."""


def complex_step_stress(material: Material, states: States, values: FloatArray) -> FloatArray | None:
    """Return engineering stresses (m, n) at states (n,) for parameter values (m, k), or None.

    None where there are many, or where the energy is not analytic arithmetic of NumPy arrays: written with jax.numpy,
    or with absolute values, branches or the like, which a real difference quotient tells.
    """
    if len(states) * len(values) > MOST_VALUES:
        return None
    parameters = values.T[:, :, None]

    def energy_at(step: Any) -> Any:
        return material.energy_of(states.moved(step), parameters)

    try:
        with np.errstate(all="ignore"):
            at_step, above, below = (energy_at(step) for step in (1j * STEP, REAL_STEP, -REAL_STEP))
    except (TypeError, ValueError):
        return None
    energies = at_step, above, below
    if not all(isinstance(energy, np.ndarray) for energy in energies) or not np.iscomplexobj(at_step):
        return None
    slope = np.broadcast_to(at_step.imag / STEP, (len(values), len(states)))
    quotient = np.broadcast_to((above - below) / (2 * REAL_STEP), slope.shape)
    size = np.maximum(np.abs(slope), np.abs(slope).max(axis=1, keepdims=True, initial=0.0) * 1e-2)
    if not (np.abs(slope - quotient) <= AGREEMENT * size + 1e-300).all():
        return None
    return np.asarray(slope / states.loaded_axes)
