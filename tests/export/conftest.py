"""Ensembles: of given materials, and of posteriors."""

from __future__ import annotations

from dataclasses import replace

import pytest

import tissuq as tq
from tissuq.mechanics import material_named

STRETCH = [0.7, 0.8, 0.9, 0.95, 1.05, 1.1, 1.2, 1.3, 1.4, 1.5, 1.7, 2.0]
TRUTH = {"C10": 0.5, "C20": 0.1, "C30": 0.0}


@pytest.fixture(scope="session")
def data():
    """A Yeoh material in uniaxial loading."""
    return tq.simulate("yeoh", TRUTH, STRETCH, noise_sd=0.02, seed=1)


@pytest.fixture(scope="session")
def auto(data):
    """Six draws with a free energy."""
    return tq.fit(data, noise_sd=0.02).ensemble(6)


@pytest.fixture(scope="session")
def given(data):
    """Return the function that gives an ensemble of one draw for each row of (name of material, values) pairs."""
    like = tq.fit(data, discrepancy="none", noise_sd=0.02).ensemble(1)

    def ensemble(*rows):
        draws = (
            tq.EnergyDraw(number, tuple((material_named(name), tuple(values)) for name, values in row), None)
            for number, row in enumerate(rows)
        )
        return replace(like, draws=tuple(draws))

    return ensemble
