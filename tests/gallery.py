"""Posteriors that many tests look at, each fitted once in a process and changed by none."""

from __future__ import annotations

from typing import Any

import numpy as np

import tissuq as tq

_POSTERIORS: dict[tuple[Any, ...], tuple[tq.Posterior, np.ndarray]] = {}


def fit(data: tq.Experiment, **options: Any) -> tq.Posterior:
    """Return what `tissuq.fit` returns, fitted when it is first asked for; only to be looked at."""
    arrays = data.stretch.tobytes(), data.stress.tobytes()
    key = (data.mode, data.name, data.stress_unit, *arrays, *sorted((name, repr(own)) for name, own in options.items()))
    if key not in _POSTERIORS:
        posterior = tq.fit(data, **options)
        _POSTERIORS[key] = posterior, numbers_of(posterior)
    return _POSTERIORS[key][0]


def sampled_jointly() -> tq.Posterior:
    """Return a posterior of NUTS on all parameters, of data with a measurement at rest."""
    data = tq.simulate("neo-hookean", {"C10": 0.5}, [0.8, 0.9, 1.0, 1.1, 1.2, 1.3], noise_sd=0.05, seed=2)
    return fit(data, discrepancy="none", noise_sd=0.05, method="joint")


def numbers_of(posterior: tq.Posterior) -> np.ndarray:
    """Return the numbers by which a change to a posterior would show."""
    return posterior.summary().to_numpy(dtype=float)


def changed() -> list[tq.Posterior]:
    """Return the posteriors that are not as they were when they were fitted."""
    return [
        own for own, numbers in _POSTERIORS.values() if not np.array_equal(numbers_of(own), numbers, equal_nan=True)
    ]
