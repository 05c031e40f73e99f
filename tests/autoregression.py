"""Errors of consecutive measurements that are correlated."""

from __future__ import annotations

import numpy as np


def autoregressive_errors(count, lag, seed):
    """Return errors (count,) of first-order autoregression with unit variance."""
    score = np.random.default_rng(seed).standard_normal(count)
    errors = [score[0]]
    for new in score[1:]:
        errors.append(lag * errors[-1] + np.sqrt(1 - lag**2) * new)
    return np.array(errors)
