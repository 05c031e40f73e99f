"""To what extent the data need a discrepancy, and what it does to the parameters, in numbers and sentences."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tissuq.assessment.between_tests import factors_of_tests
from tissuq.assessment.design import design_warnings
from tissuq.assessment.modulus import modulus, modulus_symbols
from tissuq.assessment.sensitivity import (
    SCALES,
    PowerScaling,
    known_evidence_changes,
    power_scaling,
    rescaled,
    scale_symbols,
)
from tissuq.assessment.stability import StableRange
from tissuq.discrepancy import discrepancy_named
from tissuq.errors import ConvergenceError, ModelError
from tissuq.experiments.units import stress_unit
from tissuq.inference.marginal import Marginal
from tissuq.inference.resampling import systematic
from tissuq.inference.solution import Solution
from tissuq.model import StatisticalModel
from tissuq.prediction.moments import drawn_curves

__all__ = ["Assessment", "assess", "has_energy"]

FloatArray = NDArray[np.float64]
Solve = Callable[[Sequence[StatisticalModel]], Sequence[Solution]]

DRAWS = 2000
POINTS = 60
"""Measured stretches, at most, over which the share is taken."""
STEP = 1e-4
"""Of the stretch, for the initial slope."""
NOTHING = 1e-3
"""Share of the initial stiffness that is as good as none."""
LITTLE, MUCH = 0.2, 0.5
"""Shifts of the mean, in standard deviations, from which the discrepancy's prior scales matter a little, and much."""


@dataclass(frozen=True)
class Assessment:
    """What a discrepancy does in a posterior.

    Attributes
    ----------
    parameter : str
        The headline parameter, to which the numbers refer.
    share : tuple of float
        Root mean square of the discrepancy's stress over that of the whole, at the measurements: mean, and the ends
        of its 95 % interval.
    initial_share : tuple of float
        Share of the initial stiffness that the discrepancy carries, likewise: what it could have taken from the
        parameter. Zero for an energy discrepancy.
    modulus : tuple of float
        The material's initial shear modulus, MPa: mean, and the ends of its 95 % HDI.
    modulus_symbols, other_symbols : tuple of str
        The material's parameters that it is made of, and the others. Beside an energy discrepancy it keeps its meaning
        (and a parameter that alone makes it), and the others share theirs.
    unit : str
        Of stress, in which sentences speak.
    amplitudes : dict of str to float
        Posterior median of each amplitude of an energy discrepancy over the mean of the parameter.
    members : dict of str to float
        Posterior probabilities of the sums that an average is made of.
    between : float
        Share of the parameter's variance that is between these.
    probability_of_none : float or None
        Of no discrepancy, were it as probable as this one before the data. For information: intervals that drop the
        discrepancy on that ground miss the parameter where a small discrepancy hides in the noise.
    width_against_none : float or None
        Standard deviation of the parameter over that without discrepancy.
    scales : tuple of str
        The parameters that set the size of the discrepancy's random part.
    shifts : dict of float to float
        Shift of the parameter's mean, in standard deviations, when the prior scales of these are multiplied by a
        factor. Empty where that would need other runs of a sampler.
    evidence_changes : dict of str to float
        Change of the log evidence when these scales are a quarter or fourfold, and when the uniform boxes of the linear
        parameters are four times as wide (boxes); without what is not known.
    has_energy : bool
        Whether the discrepancy has an energy, which takes part in the stability.
    stable : dict of str to float
        For every loading mode, the probability that material and energy discrepancy are stable over the measured range;
        empty where the material's energy does not tell.
    factors : dict of str to float
        By what factor the stress of each of several tests is larger than the common material says.
    power_scaling : PowerScaling or None
        Sensitivity of the parameter to the powers of prior and likelihood.
    warnings : tuple of str
        What the design of the test leaves open, and what to measure next.
    """

    parameter: str
    share: tuple[float, float, float]
    initial_share: tuple[float, float, float]
    modulus: tuple[float, float, float]
    modulus_symbols: tuple[str, ...]
    other_symbols: tuple[str, ...]
    unit: str
    amplitudes: Mapping[str, float]
    members: Mapping[str, float]
    between: float
    probability_of_none: float | None
    width_against_none: float | None
    scales: tuple[str, ...]
    shifts: Mapping[float, float]
    evidence_changes: Mapping[str, float]
    has_energy: bool
    stable: Mapping[str, float]
    factors: Mapping[str, float]
    power_scaling: PowerScaling | None
    warnings: tuple[str, ...]

    @property
    def sentences(self) -> list[str]:
        """The numbers as a person reads them."""
        found = [*self._shares(), self._modulus()]
        if self.width_against_none is not None:
            found.append(f"the sd of {self.parameter} is {self.width_against_none:.1f} times that without discrepancy")
        if self.probability_of_none is not None:
            found.append(
                f"were no discrepancy as probable before the data, it would have {_percent(self.probability_of_none)} "
                "now (for information: that is no reason to drop it)"
            )
        if len(self.members) > 1:
            named = ", ".join(f"{name} {weight:.0%}" for name, weight in self.members.items() if weight >= 0.005)
            found.append(f"the energies have the weights {named}; {self.between:.0%} of the variance is between them")
        if self.shifts:
            worst = max(self.shifts, key=lambda factor: abs(self.shifts[factor]))
            found.append(
                f"the prior scale of {' and '.join(self.scales)} {_weight(self.shifts[worst])}: times {worst:g} it "
                f"moves {self.parameter} by {self.shifts[worst]:+.2f} sd"
            )
        if self.stable:
            found.append(self._stability())
        if self.factors:
            named = ", ".join(f"{name} {factor - 1:+.0%}" for name, factor in self.factors.items())
            found.append(f"of the material that they have in common the stresses of the tests differ by {named}")
        if self.power_scaling is not None:
            found.append(self.power_scaling.sentence(self.parameter))
        return [f"{text[0].upper()}{text[1:]}." for text in found]

    def _shares(self) -> Iterator[str]:
        """Yield what the discrepancy carries of the stress and of the initial stiffness, in words."""
        mean, low, high = self.share
        if not high:
            yield (
                "there is no discrepancy: whatever the material lacks is taken for noise, and the interval of "
                f"{self.parameter} knows nothing of it"
            )
            return
        if high < 1:
            yield f"the discrepancy carries {mean:.0%} of the stress (95 % interval {low:.0%} to {high:.0%})"
        else:
            yield (
                "the data do not tell how much of the stress the discrepancy carries (95 % interval "
                f"{low:.0%} to {high:.0%}: it may oppose the material)"
            )
        if max(map(abs, self.initial_share)) < NOTHING:
            yield f"it has no initial stiffness, so none of {self.parameter} can hide in it"
            return
        mean, low, high = self.initial_share
        yield (
            f"it carries {mean:.0%} of the initial stiffness (95 % interval {low:.0%} to {high:.0%}), by which "
            f"{self.parameter} may be off"
        )

    def _stability(self) -> str:
        """Return how probable stability is over the measured range, in words."""
        worst = min(self.stable, key=lambda mode: self.stable[mode])
        what = "material and discrepancy together are" if self.has_energy else "the material is"
        text = f"over the measured range of the invariants {what} stable with a probability of"
        return (
            f"{text} {_percent(self.stable[worst])} (Baker-Ericksen, Drucker, rising stress; least in {worst} loading)"
        )

    def _modulus(self) -> str:
        """Return what is known of the initial shear modulus, in words."""
        mean, low, high = (value / stress_unit(self.unit).to_mpa for value in self.modulus)
        text = f"the material's initial shear modulus is {mean:.3g} {self.unit} (95 % interval {low:.3g} to {high:.3g})"
        if len(self.modulus_symbols) == 1:
            text += f", by {self.modulus_symbols[0]} alone"
        else:
            text += f", by {' and '.join(self.modulus_symbols)} together, which say less one by one"
        if self.amplitudes and self.other_symbols:
            verb = "shares its" if len(self.other_symbols) == 1 else "share their"
            text += f"; {' and '.join(self.other_symbols)} {verb} meaning with the discrepancy"
        return text


def assess(solution: Solution, solve: Solve, ranges: Mapping[str, StableRange]) -> Assessment:
    """Return what the discrepancy does in a posterior.

    Parameters
    ----------
    solution : Solution
    solve : callable
        Returns the solutions of models by the method that gave this one: for the same model without discrepancy, and
        with other prior scales of what sets the discrepancy's size.
    ranges : mapping of str to StableRange
        Where it is stable, by loading mode.
    """
    model, marginal = solution.model, solution.marginals[solution.model.headline]
    none = _without(model, solve)
    share, initial_share = _shares(solution)
    stiffness = modulus(solution)
    scales = scale_symbols(model)
    others = _rescaled(model, solve) if scales and solution.diagnostics is None else {}
    return Assessment(
        parameter=model.headline,
        share=share,
        initial_share=initial_share,
        modulus=(stiffness.mean, *stiffness.hdi()),
        modulus_symbols=(own := modulus_symbols(model)),
        other_symbols=tuple(symbol for symbol in model.material_symbols if symbol not in own),
        unit=model.experiment.stress_unit,
        amplitudes={
            symbol: float(solution.marginals[symbol].quantile(0.5)) / marginal.mean for symbol in model.energy_symbols
        },
        members=dict(solution.members),
        between=_between(solution, marginal),
        probability_of_none=_probability_of_none(solution, none),
        width_against_none=marginal.sd / none.marginals[model.headline].sd if none else None,
        scales=scales,
        shifts={
            SCALES[name]: float((each.marginals[model.headline].mean - marginal.mean) / marginal.sd)
            for name, each in others.items()
        },
        evidence_changes=known_evidence_changes(solution) | _evidence_changes(solution, others),
        has_energy=has_energy(model),
        stable={mode: found.probability for mode, found in ranges.items()},
        factors=factors_of_tests(solution),
        power_scaling=power_scaling(solution),
        warnings=tuple(design_warnings(model.experiment)),
    )


def has_energy(model: StatisticalModel) -> bool:
    """Return whether there is a discrepancy with an energy of its own."""
    return model.discrepancy.is_energy and bool(model.discrepancy.parameters)


def _without(model: StatisticalModel, solve: Solve) -> Solution | None:
    """Return the solution without discrepancy, or None where there is none already."""
    nothing = discrepancy_named("none")
    if model.discrepancy == nothing:
        return None
    kept = (*model.material_symbols, *(parameter.symbol for parameter in model.noise.parameters))
    own = {symbol: prior for symbol, prior in model.priors.items() if symbol in kept}
    try:
        unknown: dict[str, Any] = dict.fromkeys(("known_statistics", "curve", "level", "lag"))
        return solve([replace(model, discrepancy=nothing, chosen_priors=own, **unknown)])[0]
    except ModelError:  # a sampler that was asked for has nothing left to sample, or nothing is stable
        return None


def _rescaled(model: StatisticalModel, solve: Solve) -> dict[str, Solution]:
    """Return the solutions with other prior scales of the discrepancy's random part, where there are any."""
    found = {}
    for name, factor in SCALES.items():
        with suppress(ConvergenceError, ModelError):
            found[name] = solve([rescaled(model, factor)])[0]
    return found


def _evidence_changes(solution: Solution, others: Mapping[str, Solution]) -> dict[str, float]:
    """Return by how much the log evidence of other solutions exceeds that of one, where both have any."""
    known = {name: each.log_evidence for name, each in others.items() if each.log_evidence is not None}
    own = solution.log_evidence
    return {} if own is None else {name: float(value - own) for name, value in known.items()}


def _shares(solution: Solution) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Return the discrepancy's share of the stress and of the initial stiffness: means and ends of 95 % intervals."""
    experiment, components = solution.model.experiment, solution.components
    data = np.unique(experiment.stretch, axis=0)
    some = data[np.linspace(0, len(data) - 1, min(len(data), POINTS)).astype(int)]
    mode = experiment.parts[0].mode
    _, reference = experiment.along(mode, mode.excursion([-STEP, STEP]))
    at = np.concatenate([some, reference])
    alone, other = drawn_curves(solution.model, components[systematic(components.weights[None], DRAWS)[0]], at)
    size = np.sqrt((other[:, :-2] ** 2).mean(axis=1) / ((alone + other)[:, :-2] ** 2).mean(axis=1))
    slope, own = (curve[:, -1] - curve[:, -2] for curve in (other, alone))
    return _mean_and_ends(size), _mean_and_ends(slope / (slope + own))


def _mean_and_ends(values: FloatArray) -> tuple[float, float, float]:
    low, high = np.quantile(values, [0.025, 0.975])
    return float(values.mean()), float(low), float(high)


def _between(solution: Solution, marginal: Marginal) -> float:
    """Return the share of the headline parameter's variance that is between the members of an average."""
    parts = solution.components
    if parts.member is None:
        return 0.0
    model = solution.model
    columns = dict(zip((*model.nonlinear, *model.linear), np.hstack([parts.settings, parts.mean]).T, strict=False))
    values = columns[model.headline]
    names = np.array([member.name for member in model.energy_members])[parts.member]
    explained = 0.0
    for name in np.unique(names):
        own = names == name
        mean = float(np.average(values[own], weights=parts.weights[own]))
        explained += float(parts.weights[own].sum()) * (mean - marginal.mean) ** 2
    return explained / marginal.sd**2


def _probability_of_none(solution: Solution, none: Solution | None) -> float | None:
    if none is None or none.log_evidence is None or solution.log_evidence is None:
        return None
    return float(1 / (1 + np.exp(np.clip(solution.log_evidence - none.log_evidence, -700, 700))))


def _percent(probability: float) -> str:
    if min(probability, 1 - probability) < 0.005:
        return "less than 1 %" if probability < 0.5 else "more than 99 %"
    return f"{probability:.0%}"


def _weight(shift: float) -> str:
    """Return in words how much a shift of some standard deviations matters."""
    return "matters" if abs(shift) > MUCH else "matters a little" if abs(shift) > LITTLE else "hardly matters"
