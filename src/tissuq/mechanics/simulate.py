"""Synthetic experiments: a known material, measured with known noise."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from tissuq.errors import InputError
from tissuq.experiments.checked_arrays import checked_points
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import LoadingMode, loading_mode
from tissuq.mechanics.material import Material
from tissuq.mechanics.named import material_named
from tissuq.mechanics.stress import engineering_stress


def simulate(
    material: str | Material,
    parameters: Mapping[str, float],
    stretch: ArrayLike,
    noise_sd: float = 0.0,
    seed: int = 0,
    mode: str | LoadingMode = "uniaxial",
) -> Experiment:
    """Return an experiment on a known material: its engineering stress plus independent Gaussian noise.

    Parameters
    ----------
    material : str or Material
        The true material.
    parameters : mapping of str to float
        One value for each of its parameters (MPa; exponents have no unit).
    stretch : (n,) or (n, c) array, dimensionless
        Where to measure: the controls of the mode.
    noise_sd : float, MPa
        Standard deviation of the noise, zero or more.
    seed : int
        Seed of the noise.
    mode : str or LoadingMode
        How the specimen is loaded.

    Raises
    ------
    InputError
        When a parameter is missing or unknown, or the noise is negative.

    Examples
    --------
    >>> import tissuq as tq
    >>> truth = {"C10": 1.2, "C20": -0.057, "C30": 0.004}
    >>> data = tq.simulate("yeoh", truth, stretch=[0.5, 1.0, 2.0])
    >>> data.stress.round(3).tolist()
    [-7.534, 0.0, 3.57]
    """
    true_material = material_named(material)
    true_mode = loading_mode(mode)
    symbols = [parameter.symbol for parameter in true_material.parameters]
    if sorted(parameters) != sorted(symbols):
        raise InputError(
            f"material '{true_material.name}' needs the parameters {', '.join(symbols)}; "
            f"it was given {', '.join(parameters) or 'none'}."
        )
    if not noise_sd >= 0:
        raise InputError(f"noise_sd must be zero or positive, not {noise_sd}.")
    points = checked_points(true_mode, stretch)
    values = [parameters[symbol] for symbol in symbols]
    stresses = [engineering_stress(true_material, path, points, values) for path in true_mode.paths]
    stress = stresses[0] if len(stresses) == 1 else np.column_stack(stresses)
    noise = noise_sd * np.random.default_rng(seed).standard_normal(stress.shape)
    recipe = ", ".join(
        f"{p.symbol} = {value:g} {p.unit}".strip() for p, value in zip(true_material.parameters, values, strict=True)
    )
    source = f"synthetic: {true_material.name} ({recipe}), noise sd {noise_sd:g} MPa, seed {seed}"
    return Experiment(true_mode, points, stress + noise, name=f"synthetic {true_material.name}", source=source)
