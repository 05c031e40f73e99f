"""The answer first: the modulus with its interval, for what the result can be used, and the one thing to do next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from tissuq.arrays import BoolArray
from tissuq.assessment.extent import has_energy
from tissuq.assessment.modulus import modulus
from tissuq.assessment.next_step import Step, next_step
from tissuq.assessment.shares import shares_of_discrepancy
from tissuq.assessment.stability import StableRange, measured_states
from tissuq.assessment.uses import PRECISE, Use, Verdict, uses_of
from tissuq.errors import TissuqError
from tissuq.experiments.modes import LoadingMode, loading_mode
from tissuq.experiments.units import StressUnit, stress_unit
from tissuq.inference.marginal import Marginal
from tissuq.inference.solution import Solution
from tissuq.mechanics.invariants import farthest_stretch
from tissuq.prediction.bands import predict_band
from tissuq.result_warning import ResultWarning, has_code

NOTABLE_SHARE = 0.05
"""Of the stress, from which the discrepancy is worth a word."""
MIN_SHEET_STRAIN = 0.01
"""Strain of both axes that must have been reached, so that stresses differ from noise."""
TOGETHER = "Use it with the discrepancy, as exported cards do."


class Estimate(NamedTuple):
    """A stress parameter: its name, mean and the ends of its 95 % highest-density interval, MPa."""

    name: str
    mean: float
    low: float
    high: float


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


@dataclass(frozen=True)
class Answer:
    """What a posterior says, before everything else.

    Attributes
    ----------
    estimates : tuple of Estimate
        The initial shear modulus first, then the headline parameter.
    meaning : str
        What the intervals are of.
    uses : tuple of Use
        Reporting the modulus; predicting the measured tests, and other loading modes; finite elements.
    next_step : Step
    unit : str
        Unit of stress in which it is printed.
    law : str
        Where the law by itself does not describe the measurements: how much of the stress the discrepancy carries.
    sheet : SheetStresses, optional
        Of a sheet with a preferred direction, of which one modulus says little.
    """

    estimates: tuple[Estimate, ...]
    meaning: str
    uses: tuple[Use, ...]
    next_step: Step
    unit: str = "MPa"
    law: str = ""
    sheet: SheetStresses | None = None

    @property
    def sentences(self) -> list[str]:
        """What numbers and intervals are, and what they do not say of a sheet with a direction and of the law."""
        along_axes = self.sheet.in_words(stress_unit(self.unit)) if self.sheet else ""
        return list(filter(None, (f"Means, and intervals for {self.meaning}.", along_axes, self.law)))

    def __str__(self) -> str:
        """Return the answer as lines, in its unit, with what to do next as typed in Python."""
        scale = stress_unit(self.unit).to_mpa
        lines = [
            f"{name} {mean / scale:.3g} {self.unit}, 95 % interval {low / scale:.3g} to {high / scale:.3g}"
            for name, mean, low, high in self.estimates
        ]
        lines += self.sentences
        lines += [f"{use.verdict.upper()}: {use.purpose}: {use.reason}" for use in self.uses]
        return "\n".join([*lines, f"Next: {self.next_step.python}"])


def answer_of(
    solution: Solution,
    ranges: Mapping[str, StableRange],
    warnings: Sequence[ResultWarning],
    inside: BoolArray,
) -> Answer:
    """Return the answer that a posterior gives.

    Parameters
    ----------
    solution : Solution
    ranges : mapping of str to StableRange
        Stable range by loading mode.
    warnings : sequence of ResultWarning
        Those that the posterior carries, and those about its measurements where they are known; the severest first.
    inside : (n,) array of bool
        Which measurements are inside their 95 % predictive bands.
    """
    model, stiffness = solution.model, modulus(solution)
    uses = uses_of(solution, stiffness, ranges, warnings, inside)
    has_stress_at_rest = has_code(warnings, "stress-at-rest")  # which is no law's
    headline = model.headline
    return Answer(
        (_estimate("initial shear modulus", stiffness), _estimate(headline, solution.marginals[headline])),
        model.meaning,
        uses,
        next_step(solution, uses, ranges, warnings),
        model.experiment.shown_unit.name,
        _law_in_words(solution, has_stress_at_rest, all(uses[number].verdict is not Verdict.NO for number in (1, 3))),
        sheet_stresses(solution),
    )


def _law_in_words(solution: Solution, has_stress_at_rest: bool, serves_together: bool) -> str:
    """Return in words how far the law by itself is from the measurements; nothing where it describes them.

    That it is to be used with the discrepancy, as in cards, is said where both together describe the measurements and
    serve finite elements.
    """
    (mean, low, high), _ = shares_of_discrepancy(solution)
    if not has_energy(solution.model) or mean <= NOTABLE_SHARE:
        return ""
    law, together = solution.model.material.name, f" {TOGETHER}" * serves_together
    if has_stress_at_rest:
        return f"There is stress at rest, so that it cannot be said how far {law} alone is off."
    if mean <= PRECISE:
        return f"{law} alone is off by {100 * mean:.0f} % of the stress.{together}"
    if high < 1:
        return (
            f"{law} alone is wrong here: the discrepancy carries {100 * mean:.0f} % of the stress (95 % interval "
            f"{100 * low:.0f} % to {100 * high:.0f} %).{together}"
        )
    if low > 1:
        return (
            f"{law} alone is wrong here: the discrepancy opposes it with {100 * mean:.0f} % of the stress (95 % "
            f"interval {100 * low:.0f} % to {100 * high:.0f} %).{together}"
        )
    return f"How much of the stress is {law}'s and how much the discrepancy's is not determined.{together}"


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
    if stretch < 1 + MIN_SHEET_STRAIN:
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


def _estimate(name: str, marginal: Marginal) -> Estimate:
    return Estimate(name, marginal.mean, *map(float, marginal.hdi()))
