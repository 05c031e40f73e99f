"""A posterior whose draws have a discrepancy in their energy."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq

MODULUS = 2e-3
"""MPa, of a soft tissue."""


@pytest.fixture(scope="session")
def posterior():
    return tq.fit(_stiffening(), noise_sd=2e-5)


@pytest.fixture(scope="session")
def without():
    return tq.fit(_stiffening(), discrepancy="none")


@pytest.fixture(scope="session")
def draws(posterior):
    return posterior.ensemble(4)


def _stiffening():
    stretch = np.array([0.7, 0.75, 0.8, 0.85, 0.9, 0.95, 1.05, 1.1, 1.15, 1.2, 1.25, 1.3])
    truth = {"C10": MODULUS / 2, "C20": MODULUS, "C30": 0.0}
    return tq.simulate("yeoh", truth, stretch, noise_sd=2e-5, seed=1)
