"""How far several tests are apart: the errors of their stresses, as the data tell them."""

from __future__ import annotations

import numpy as np

from tissuq.inference.solution import Solution
from tissuq.prediction.moments import mean_curve

__all__ = ["factors_of_tests"]


def factors_of_tests(solution: Solution) -> dict[str, float]:
    """Return by what factor the stress of every test is larger than the common material says, by the tests' names.

    Tests of one name are numbered.
    Posterior means, relative to all specimens' mean, which no data tell; empty where tests have no error of stress of
    their own, or consecutive errors are correlated.
    """
    model = solution.model
    white, parts = model.whitening, model.experiment.parts
    if white is None or not model.tolerances.stress or not len(white.spread) or model.lag:
        return {}
    curve = mean_curve(solution)
    residual = model.experiment.stress - curve
    noise = white.size**2 * white.transposed(white(residual))
    ends = np.cumsum([part.stress.size for part in parts])[:-1]
    pairs = zip(np.split(residual - noise, ends), np.split(curve, ends), strict=True)
    names = [part.name for part in parts]
    labels = [f"{name} ({place})" if names.count(name) > 1 else name for place, name in enumerate(names, 1)]
    return {label: 1 + float(error @ own / (own @ own)) for label, (error, own) in zip(labels, pairs, strict=True)}
