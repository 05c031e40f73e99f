"""Measures of stress that files hold, a row of a registry each: its names, and the engineering stress for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import InputError
from tissuq.experiments.modes import LoadingMode
from tissuq.experiments.modes.mode import SHEAR
from tissuq.experiments.reading.uneven_stress import Tube, rim_stress

__all__ = ["STRESS_MEASURES", "StressMeasure", "measure_of_tube"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class StressMeasure:
    """A measure of stress.

    Parameters
    ----------
    name : str
        What ``stress_type`` calls it.
    words : str
        Regular expression of the words in a heading, in lower case, that say it.
    engineering : callable, optional
        The engineering stresses (k, n) for a loading mode, its points (n,) or (n, c), and stresses (k, n) of this
        measure; none where they are the same.
    step : str
        How, in words.
    is_of_file : bool
        Whether stretches count from where they do in the file, and not from where a preload makes the specimen taut.
    """

    name: str
    words: str
    engineering: Callable[[LoadingMode, FloatArray, FloatArray], FloatArray] | None = None
    step: str = ""
    is_of_file: bool = False


def _from_cauchy(mode: LoadingMode, points: FloatArray, stress: FloatArray) -> FloatArray:
    return np.asarray(stress / np.stack([path.cauchy_ratio(points) for path in mode.paths]))


def _from_torsion(mode: LoadingMode, points: FloatArray, stress: FloatArray) -> FloatArray:
    if mode.controls != (SHEAR,) or len(mode.stresses) > 1:
        raise InputError(
            "stress_type='torsion' (--stress-type torsion) is for a twisted disc: give --mode simple-shear."
        )
    return rim_stress(points, stress[0])[None]


STRESS_MEASURES = {
    measure.name: measure
    for measure in (
        StressMeasure(
            name="engineering",
            words=r"engineering|eng\.?|nominal\w*|nominell\w*|technisch\w*|conventionnelle|ingenieril|工程|公称|инженерн\w+|номинальн\w+|условн\w+|"
            r"pk ?1|(1st|first|1\.) (pk|piola( kirchhoff)?)",
        ),
        StressMeasure(
            name="cauchy",
            words=r"cauchy|true|kirchhoff|wahre?[rs]?|vraie?|r[ée]elle|verdader[ao]|real|ver[ao]|verdadeir[ao]|"
            r"werkelijke|真实|真實|真|истинн\w+|коши",
            engineering=_from_cauchy,
            step="Cauchy stress divided by stretch to engineering stress",
        ),
        StressMeasure(
            name="second-piola-kirchhoff",
            words=r"(2nd|second|2\.|zweite) (pk|piola( kirchhoff)?)|pk ?2|s? ?2 ?pk|pk ?ii",
            engineering=lambda mode, points, stress: mode.from_second_piola_kirchhoff(points, stress),
            step="second Piola-Kirchhoff stress times the deformation gradient to engineering stress",
            is_of_file=True,
        ),
        StressMeasure(
            name="torsion",
            words=r"apparent|scheinbare?|apparente?",
            engineering=_from_torsion,
            step="apparent stress at the rim of a twisted disc times (3 + d ln T / d ln g)/4 to the stress there",
        ),
    )
}
"""Every measure of stress by its name: force over undeformed area P, over deformed area P F', F^-1 P (no change of
volume), and 2 T / (pi R^3) of the torque T of a disc with the radius R."""


def measure_of_tube(tube: Tube) -> StressMeasure:
    """Return the measure of mean stresses p / ln(B/A) of a tube's wall."""
    return StressMeasure(
        name="inflation",
        words="",
        engineering=lambda mode, points, stress: tube.engineering_stress(points, stress[0])[None],
        step="mean stress of the wall times the hoop stretch, and times the stress in its middle over the mean, to "
        "engineering stress",
        is_of_file=True,
    )
