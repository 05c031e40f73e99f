"""Parameters of a material that its tests cannot tell apart, because others of them give the same stresses."""

from __future__ import annotations

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.inference.solution import Solution
from tissuq.model.statistical_model import StatisticalModel
from tissuq.prediction.moments import coefficients, values_of

COMPONENTS = 4
"""Places of the posterior at which the stresses are looked at."""
STEP = 1e-4
"""Of a parameter, over its value, by which the stress changes are found."""
LARGEST_CHANGE = 1e-6
"""Of the stresses, over those of each parameter alone, below which a change of several together is none."""
LEAST_SHARE = 0.1
"""Of a parameter in such a change, over the largest, with which it is named."""


def inseparable_parameters(solution: Solution) -> tuple[str, ...]:
    """Return the parameters of the material that can change together without any measured stress changing.

    To first order, at all places of the posterior that are looked at; of one path in planar tension the angle of
    fibres and both their stiffnesses. None of a material whose stress is linear in its parameters.
    """
    model = solution.model
    if not model.bent_symbols:
        return ()
    mixture = solution.few_components(COMPONENTS)
    linear = [symbol for symbol in model.column_symbols if symbol in model.material_symbols]
    columns = [model.column_symbols.index(symbol) for symbol in linear]
    sizes, bent = coefficients(model, mixture)[0][:, columns], values_of(model, mixture, model.bent_symbols)[0]
    symbols, shares = np.array([*linear, *model.bent_symbols]), np.zeros(len(linear) + len(model.bent_symbols))
    for size, values in zip(sizes, bent, strict=True):
        _, changes, together = np.linalg.svd(_unit_changes(model, columns, size, values), full_matrices=False)
        if not changes[-1] < LARGEST_CHANGE:
            return ()
        shares = np.maximum(shares, np.abs(together[-1]) / np.abs(together[-1]).max())
    return tuple(str(symbol) for symbol in symbols[shares > LEAST_SHARE])


def _unit_changes(model: StatisticalModel, columns: list[int], size: FloatArray, bent: FloatArray) -> FloatArray:
    """Return by what the stresses (n, k) change with each parameter, linear ones first, as columns of length one."""
    steps = STEP * np.abs(bent) * np.eye(len(bent))
    up, down, middle = (
        model.basis(model.states, values)[:, :, columns] for values in (bent + steps, bent - steps, bent[None])
    )
    changes = np.column_stack([middle[0], ((up - down) @ size).T])
    lengths = np.linalg.norm(changes, axis=0)
    return np.asarray(changes / np.where(lengths > 0, lengths, 1.0))
