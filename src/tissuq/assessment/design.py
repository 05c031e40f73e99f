"""What a test leaves open by its design, and what to measure next."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tissuq.experiments.experiment import Experiment

__all__ = ["design_warnings"]

FEW = 12
NEAR = 0.15
"""Share of the largest strain within which a measurement is near the reference."""


def design_warnings(experiment: Experiment) -> Iterator[str]:
    """Yield what the design of a test leaves open, each with what to measure next."""
    strain = np.concatenate(
        [path.abscissa(part.stretch) - 1 for part in experiment.parts for path in part.mode.channels]
    )
    reach = float(np.abs(strain).max())
    if len(experiment.modes) == 1 and not ((strain > 1e-9).any() and (strain < -1e-9).any()):
        done, other = ("tension", "compression") if (strain > 0).any() else ("compression", "tension")
        yield (
            f"there is {done} only, which leaves the initial modulus about twice as uncertain as both directions: "
            f"measure in {other}, too, if the specimen bears it."
        )
    near = (np.abs(strain) <= NEAR * reach) & (strain != 0)
    if not near.any():
        nearest = 1 + strain[np.abs(strain) > 0][np.abs(strain[np.abs(strain) > 0]).argmin()]
        yield (
            f"nothing is measured near the reference (the nearest stretch is {nearest:.4g}), so the initial modulus is "
            f"extrapolated: measure within {NEAR * reach:.2g} of stretch 1."
        )
    if len(experiment) < FEW:
        yield (
            f"{len(experiment)} measurements say little of how the stress deviates from the material: "
            f"measure at {FEW} stretches or more."
        )
