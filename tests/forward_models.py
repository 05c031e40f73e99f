"""Cheap models with closed forms, in place of expensive ones."""

import numpy as np

from tissuq.emulation import gathered
from tissuq.emulation.runs import space_filling
from tissuq.parameters.priors import Uniform

DEPTH = np.linspace(0.02, 0.3, 15)
STRETCH = 1 - DEPTH
OGDEN = {"mu": Uniform(0.2, 5.0), "alpha": Uniform(-25.0, -1.0)}


def neo_hooke(parameters):
    """Compression of a cube, mu times (l^-2 - l)."""
    return parameters["C10"] * 2 * (STRETCH**-2 - STRETCH)


def ogden(parameters):
    """Uniaxial compression of an Ogden material, compression positive."""
    mu, alpha = parameters["mu"], parameters["alpha"]
    return 2 * mu / alpha * (STRETCH ** (-alpha / 2 - 1) - STRETCH ** (alpha - 1))


def runs_at(function, symbols, points):
    """Return the runs of a function at parameters."""
    results = [
        {"parameters": dict(zip(symbols, point, strict=True)), "error": "", "seconds": 0.0,
         "outputs": function(dict(zip(symbols, point, strict=True)))}
        for point in points
    ]  # fmt: skip
    return gathered(symbols, results, len(DEPTH))


def designed(function, priors, count, seed=1):
    """Return the runs of a function over its priors."""
    return runs_at(function, list(priors), space_filling(priors, count, seed))
