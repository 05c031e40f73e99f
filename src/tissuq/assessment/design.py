"""What a test leaves open by its design, and what to measure next."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes.mode import SHEAR

__all__ = ["design_warnings"]

FEW = 12
NEAR = 0.15
"""Share of the largest strain within which a measurement is near the reference."""


def design_warnings(experiment: Experiment) -> Iterator[str]:
    """Yield what the design of a test leaves open, each with what to measure next."""
    strain = np.concatenate(
        [path.abscissa(part.stretch) - _at_rest(part) for part in experiment.parts for path in part.mode.channels]
    )
    reach = float(np.abs(strain).max())
    has_directions = len(experiment.modes) == 1 and experiment.modes[0].controls[0] != SHEAR
    if has_directions and not ((strain > 1e-9).any() and (strain < -1e-9).any()):
        done, other = ("tension", "compression") if (strain > 0).any() else ("compression", "tension")
        yield (
            f"there is {done} only, which leaves the initial modulus about twice as uncertain as both directions: "
            f"measure in {other}, too, if the specimen bears it."
        )
    near = (np.abs(strain) <= NEAR * reach) & (strain != 0)
    if not near.any():
        control = experiment.parts[0].mode.controls[0]
        nearest = control.reference + strain[np.abs(strain) > 0][np.abs(strain[np.abs(strain) > 0]).argmin()]
        yield (
            f"nothing is measured near the reference (the nearest {control.name} is {nearest:.4g}), so the initial "
            f"modulus is extrapolated: measure within {NEAR * reach:.2g} of {control.name} {control.reference:g}."
        )
    if len(experiment) < FEW:
        yield (
            f"{len(experiment)} measurements say little of how the stress deviates from the material: "
            f"measure at {FEW} stretches or more."
        )


def _at_rest(test: Experiment) -> float:
    """Return the value of a test's first control where nothing is deformed."""
    return test.mode.controls[0].reference
