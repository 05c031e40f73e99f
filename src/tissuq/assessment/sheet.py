"""A sheet with a preferred direction in numbers: the stress along either axis where both are stretched alike."""

from __future__ import annotations

from typing import NamedTuple

from tissuq.assessment.stability import measured_states
from tissuq.errors import TissuqError
from tissuq.experiments.modes import loading_mode
from tissuq.experiments.modes.mode import LoadingMode
from tissuq.experiments.units import StressUnit
from tissuq.inference.solution import Solution
from tissuq.mechanics.invariants import farthest_stretch
from tissuq.prediction.bands import predict_band

__all__ = ["SheetStresses", "sheet_stresses"]

MIN_STRAIN = 0.01
"""Strain of both axes that must have been reached, so that stresses differ from noise."""


class SheetStresses(NamedTuple):
    """Stresses along the axes of a sheet at equal stretches: name, median and ends of the 95 % interval, MPa."""

    stretch: float
    stresses: tuple[tuple[str, float, float, float], ...]

    def in_words(self, unit: StressUnit) -> str:
        """Return a sentence in a unit."""
        texts = []
        for name, *values in self.stresses:
            median, low, high = (value / unit.to_mpa for value in values)
            texts.append(f"{name} {median:.3g} {unit.name} ({low:.3g} to {high:.3g})")
        return f"Where both axes are stretched to {self.stretch:.3f}: {', '.join(texts)}."


def sheet_stresses(solution: Solution) -> SheetStresses | None:
    """Return the stresses at the largest equal stretches up to which states were measured.

    None where the tissue has no preferred direction, no test measured two stresses at two stretches, or both stretches
    were never reached together.
    """
    model = solution.model
    is_sheet = solution.is_directed or not model.material.is_isotropic
    if not is_sheet or not (mode := next(filter(_has_two_axes, model.experiment.modes), None)):
        return None
    states = measured_states(model, is_directed=True)
    stretch = farthest_stretch(loading_mode("equibiaxial"), states, 1)
    if stretch < 1 + MIN_STRAIN:
        return None
    stresses = []
    for channel, name in enumerate(mode.stresses):
        try:
            band = predict_band(solution, [[stretch, stretch]], noise=False, mode=mode, channel=channel)
        except TissuqError:
            return None
        stresses.append((name, float(band.median[0]), float(band.low[0]), float(band.high[0])))
    return SheetStresses(stretch, tuple(stresses))


def _has_two_axes(mode: LoadingMode) -> bool:
    return len(mode.controls) == len(mode.stresses) == 2
