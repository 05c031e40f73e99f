"""Synthetic experiments: a known material, measured with known noise."""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Real

import numpy as np
from numpy.typing import ArrayLike

from tissuq.errors import InputError
from tissuq.experiments.checked_arrays import checked, checked_points, stress_in_mpa
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import LoadingMode, loading_mode
from tissuq.mechanics.material import Material
from tissuq.mechanics.named import material_named
from tissuq.mechanics.stress import engineering_stress
from tissuq.parameters.checks import check_seed


def simulate(
    material: str | Material,
    parameters: Mapping[str, float],
    stretch: ArrayLike,
    noise_sd: float | str = 0.0,
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
    noise_sd : float, MPa, or str such as "0.7 kPa"
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
    if not isinstance(parameters, Mapping) or sorted(parameters) != sorted(symbols):
        given = ", ".join(parameters) if isinstance(parameters, Mapping) else repr(parameters)
        raise InputError(
            f"material '{true_material.name}' needs the parameters {', '.join(symbols)}; "
            f"it was given {given or 'none'}."
        )
    check_seed(seed)
    noise_sd = stress_in_mpa(noise_sd)
    if not isinstance(noise_sd, Real) or not 0 <= noise_sd < np.inf:
        raise InputError(f"noise_sd must be zero or positive, not {noise_sd!r}.")
    points = checked_points(true_mode, stretch)
    values = [float(checked(symbol, [parameters[symbol]], [symbol])[0]) for symbol in symbols]
    stresses = [engineering_stress(true_material, path, points, values) for path in true_mode.paths]
    stress = stresses[0] if len(stresses) == 1 else np.column_stack(stresses)
    noise = noise_sd * np.random.default_rng(seed).standard_normal(stress.shape)
    recipe = ", ".join(
        f"{p.symbol} = {value:g} {p.unit}".strip() for p, value in zip(true_material.parameters, values, strict=True)
    )
    source = f"synthetic: {true_material.name} ({recipe}), noise sd {noise_sd:g} MPa, seed {seed}"
    return Experiment(true_mode, points, stress + noise, name=f"synthetic {true_material.name}", source=source)
