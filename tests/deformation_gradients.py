"""Deformation gradients to compute stresses and tangents at, their rotations, and differences between them."""

from __future__ import annotations

import numpy as np
from scipy.stats import ortho_group


def gradients(count=6, seed=0):
    """Some deformation gradients (3, 3, count) that stretch by up to a third."""
    return np.eye(3)[:, :, None] + 0.2 * np.random.default_rng(seed).uniform(-1, 1, (3, 3, count))


def rotations(count, seed):
    """Some rotations, each (3, 3)."""
    return [each * np.linalg.det(each) for each in ortho_group(3, seed=seed).rvs(count).reshape(-1, 3, 3)]


def differences(function, F, step=1e-5):
    """Central differences of a function of gradients (3, 3, n), the new axes before the last."""
    columns = []
    for place in np.ndindex(3, 3):
        change = np.zeros((3, 3, 1))
        change[place] = step
        columns.append((function(F + change) - function(F - change)) / (2 * step))
    found = np.stack(columns, axis=-2)
    return found.reshape(*found.shape[:-2], 3, 3, F.shape[-1])
