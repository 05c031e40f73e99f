"""Simple tests of a known law with the errors of a laboratory, in what is measured and not to first order."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import loading_mode
from tissuq.mechanics import engineering_stress, material_named
from tissuq.validation.structures.settings import KnownLaw, StructureStudySettings

__all__ = ["simulated_tests"]

FloatArray = NDArray[np.float64]

SMOOTH_LENGTH = 1 / 3
"""Correlation length of smooth errors, in ranges of the stretch."""


def simulated_tests(settings: StructureStudySettings, truth: KnownLaw, seed: list[int]) -> list[Experiment]:
    """Return a test in every mode of one specimen of a law.

    The stress is that at the true stretch; what is recorded is a stretch with errors of length and slack, and a stress
    with a factor of the specimen (``stress``), one of the test (``test``), a smooth relative error, a zero, the
    resolution of the load cell and noise: normal, with the standard deviations of the settings' tolerances.
    """
    generator, sizes = np.random.default_rng(seed), settings.tolerances.sizes
    law, specimen = material_named(truth.material), _factor(generator, sizes, "stress")
    tests = []
    for mode in settings.modes:
        loading = loading_mode(mode)
        low = max(settings.low, 1.0) if mode != "uniaxial" else settings.low
        stretch = np.linspace(low, settings.high, settings.points + 1)
        stretch = stretch[np.abs(stretch - 1) > 1e-6][: settings.points]
        stress = engineering_stress(law, loading.paths[0], stretch, np.array([truth.values]))[0]
        largest = float(np.abs(stress).max())
        measured = stress * specimen * _factor(generator, sizes, "test") * _smooth(generator, sizes, stretch)
        scatter = np.hypot(settings.noise, sizes.get("resolution", 0.0)) * largest
        measured = measured + sizes.get("zero", 0.0) * generator.standard_normal()
        measured = measured + scatter * generator.standard_normal(len(stretch))
        recorded = 1 + (stretch - 1) * _factor(generator, sizes, "length")
        recorded = recorded + sizes.get("slack", 0.0) * generator.standard_normal()
        tests.append(Experiment(loading, recorded, measured).labelled(name=mode, specimen="simulated"))
    return tests


def _factor(generator: np.random.Generator, sizes: Mapping[str, float], name: str) -> float:
    return float(1 + sizes.get(name, 0.0) * generator.standard_normal())


def _smooth(generator: np.random.Generator, sizes: Mapping[str, float], stretch: FloatArray) -> FloatArray:
    """Return factors (n,) that vary smoothly along a test."""
    distance = (stretch[:, None] - stretch) / (SMOOTH_LENGTH * np.ptp(stretch))
    root = np.linalg.cholesky(np.exp(-0.5 * distance**2) + 1e-9 * np.eye(len(stretch)))
    return np.asarray(1 + sizes.get("smooth", 0.0) * (root @ generator.standard_normal(len(stretch))))
