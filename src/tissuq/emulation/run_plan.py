"""The run plan of an expensive model: parameters spread evenly over their priors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import InputError
from tissuq.parameters.priors import Prior

__all__ = ["PointSet", "space_filling"]

FloatArray = NDArray[np.float64]

PointSet = Literal["sobol", "latin"]
"""Scrambled Sobol points, or a Latin hypercube whose points stay apart."""

TAIL_PROBABILITY = 0.001
"""Probability of an unbounded prior beyond either end of the run plan."""


def space_filling(priors: Mapping[str, Prior], runs: int, seed: int = 0, design: PointSet = "sobol") -> FloatArray:
    """Return the parameters (runs, d) at which to run a model: evenly spread over the quantiles of their priors.

    Uniform and log-uniform priors are covered up to their ends, others up to their quantiles of 0.1 and 99.9 %.

    Parameters
    ----------
    priors : mapping of str to Prior
        Priors of the d parameters.
    runs : int
        Number of points.
    seed : int
        Seed of the points.
    design : str
        ``"sobol"`` (scrambled Sobol points) or ``"latin"`` (a Latin hypercube whose points are moved apart).

    Raises
    ------
    InputError
        When a prior is flat, there is no such design, or the number of runs is below one.

    Examples
    --------
    >>> from tissuq import Uniform
    >>> points = space_filling({"C10": Uniform(0, 2), "C20": Uniform(-1, 1)}, runs=16)
    >>> points.shape, bool((points[:, 0] > 1).sum() == 8)
    ((16, 2), True)
    """
    from scipy.stats import qmc

    if design not in get_args(PointSet):
        raise InputError(f"the design must be one of {', '.join(get_args(PointSet))}, not '{design}'.")
    if runs < 1:
        raise InputError(f"the number of runs must be at least 1, not {runs}.")
    size, generator = len(priors), np.random.default_rng([seed, 41])
    if design == "sobol":
        cube = qmc.Sobol(size, rng=generator).random_base2(int(np.ceil(np.log2(max(runs, 2)))))[:runs]
    else:
        cube = qmc.LatinHypercube(size, optimization="random-cd", rng=generator).random(runs)
    columns = zip(priors.values(), cube.T, strict=True)
    return np.column_stack([_quantiles(prior, column) for prior, column in columns])


def _quantiles(prior: Prior, probability: FloatArray) -> FloatArray:
    is_box = prior.gaussian is not None and prior.gaussian[1] == 0
    is_whole = is_box or prior.name == "log-uniform"
    shrunk = probability if is_whole else TAIL_PROBABILITY + (1 - 2 * TAIL_PROBABILITY) * probability
    return np.asarray(prior.quantile(shrunk), dtype=np.float64)
