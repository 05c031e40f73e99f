"""To what extent the data need a discrepancy, and what it does to the parameters, in numbers and sentences."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from tissuq.assessment.measurements import factors_of_tests, measurement_warnings
from tissuq.assessment.modulus import modulus, modulus_symbols
from tissuq.assessment.sensitivity import (
    SCALE_FACTORS,
    PowerScaling,
    known_evidence_changes,
    power_scaling,
    rescaled,
    scale_symbols,
)
from tissuq.assessment.shares import shares_of_discrepancy
from tissuq.assessment.stability import StableRange
from tissuq.errors import ConvergenceError, ModelError
from tissuq.experiments.units import stress_unit
from tissuq.inference.enumerators.noise_grid import at_level
from tissuq.inference.marginal import Marginal
from tissuq.inference.solution import PROBABLE_DIRECTION, Solution
from tissuq.model.discrepancy import discrepancy_named
from tissuq.model.statistical_model import StatisticalModel
from tissuq.model.tolerances import FittedErrors
from tissuq.prediction.moments import values_of

Solve = Callable[[Sequence[StatisticalModel]], Sequence[Solution]]

NEGLIGIBLE_INITIAL_SHARE = 1e-3
"""Largest share of the initial stiffness that counts as none."""
MIN_NOTICEABLE_SHIFT, MIN_IMPORTANT_SHIFT = 0.2, 0.5
"""Smallest shifts of the mean, in standard deviations, by which prior scales matter a little, and much."""


@dataclass(frozen=True)
class Assessment:
    """The effect of a discrepancy on a posterior.

    Attributes
    ----------
    parameter : str
        The headline parameter, to which the numbers refer.
    share : tuple of float
        Root mean square of the discrepancy's stress over that of the total stress at the measurements: mean, and the
        ends of its 95 % interval.
    initial_share : tuple of float
        Share of the initial stiffness that the discrepancy carries, likewise: the largest error of the parameter.
        Of several tests, in the one where it is largest; zero for an energy discrepancy.
    modulus : tuple of float
        The material's initial shear modulus, MPa: mean, and the ends of its 95 % HDI.
    modulus_symbols, other_symbols : tuple of str
        The material's parameters on which the modulus depends, and the others. Beside an energy discrepancy the modulus
        keeps its meaning (as does a parameter that alone determines it), and the others share theirs.
    unit : str
        Unit of stress in sentences.
    amplitudes : dict of str to float
        Posterior median of each amplitude of an energy discrepancy over the mean of the parameter.
    members : dict of str to float
        Posterior probabilities of the sums of energies in an average.
    between : float
        Share of the parameter's variance that is between these.
    direction : float or None
        Probability of a preferred direction of the material; None where no energy has one.
    probability_of_none : float or None
        Posterior probability of no discrepancy, if it is as probable as this one before the data. For information:
        intervals that drop the discrepancy for that reason miss the parameter where the noise hides a small one.
    width_against_none : float or None
        Standard deviation of the parameter over that without discrepancy; like the former None where there is none to
        compare with.
    scales : tuple of str
        The parameters that set the size of the discrepancy's random part.
    shifts : dict of float to float
        Shift of the parameter's mean, in standard deviations, when the prior scales of these are multiplied by a
        factor. Empty where that would need further runs of a sampler.
    evidence_changes : dict of str to float
        Change of the log evidence when these scales are a quarter or fourfold, and when the uniform boxes of the linear
        parameters are four times as wide (boxes); unknown changes are missing.
    has_energy : bool
        Whether the discrepancy has an energy, which influences the stability.
    stable : dict of str to float
        For every loading mode, the probability that material and energy discrepancy are stable over the measured range;
        empty where it cannot be computed from the material's energy.
    factors : dict of str to float
        Factor of the stress of each of several tests over that of the common material.
    power_scaling : PowerScaling or None
        Sensitivity of the parameter to the powers of prior and likelihood.
    warnings : tuple of str
        Warnings about the measured range, with advice what to measure next.
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
    direction: float | None
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
        """The numbers in sentences."""
        clauses = [*self._shares(), self._modulus()]
        if self.width_against_none is not None:
            clauses.append(
                f"the sd of {self.parameter} is {self.width_against_none:.1f} times that without discrepancy"
            )
        if self.probability_of_none is not None:
            clauses.append(
                f"if no discrepancy were as probable before the data, its probability would now be "
                f"{_percent(self.probability_of_none)} (for information: that is no reason to drop the discrepancy)"
            )
        if len(self.members) > 1:
            weights = {name: weight for name, weight in self.members.items() if weight >= 0.005}
            named = ", ".join(f"{name} {100 * weight:.0f} %" for name, weight in weights.items())
            between = f"{100 * self.between:.0f} % of the variance is between them"
            clauses.append(f"the energies have the weights {named}; {between}")
        if self.direction is not None:
            clauses.append(
                f"the stresses of the two axes tell of a preferred direction with a probability of "
                f"{_percent(self.direction)}; the initial shear modulus is the mean over all directions"
            )
        if self.shifts:
            worst = max(self.shifts, key=lambda factor: abs(self.shifts[factor]))
            clauses.append(
                f"the prior scale of {' and '.join(self.scales)} {_influence(self.shifts[worst])}: multiplied by "
                f"{worst:g}, it shifts {self.parameter} by {self.shifts[worst]:+z.2f} sd"
            )
        if self.stable:
            clauses.append(self._stability())
        if self.factors:
            named = ", ".join(f"{name} {100 * (factor - 1):+z.0f} %" for name, factor in self.factors.items())
            clauses.append(f"the stresses of the tests differ from those of their common material by {named}")
        if self.power_scaling is not None:
            clauses.append(self.power_scaling.sentence(self.parameter))
        return [f"{text[0].upper()}{text[1:]}." for text in clauses]

    def _shares(self) -> Iterator[str]:
        """Yield the discrepancy's shares of the stress and of the initial stiffness, in words."""
        mean, low, high = self.share
        if not high:
            yield (
                "there is no discrepancy: errors of the material are taken for noise, and the interval of "
                f"{self.parameter} does not include them"
            )
            return
        if high < 1:
            yield (
                f"the discrepancy carries {100 * mean:.0f} % of the stress (95 % interval {100 * low:.0f} % to "
                f"{100 * high:.0f} %)"
            )
        elif low > 1:
            yield (
                f"the discrepancy opposes the material: its stress is {100 * mean:.0f} % of that measured (95 % "
                f"interval {100 * low:.0f} % to {100 * high:.0f} %)"
            )
        else:
            yield (
                "the data do not determine how much of the stress the discrepancy carries (95 % interval "
                f"{100 * low:.0f} % to {100 * high:.0f} %: it may oppose the material)"
            )
        if max(map(abs, self.initial_share)) < NEGLIGIBLE_INITIAL_SHARE:
            yield f"it has no initial stiffness, so it takes none from {self.parameter}"
            return
        mean, low, high = self.initial_share
        meaning = f"by which {self.parameter} may be off"
        if self.direction is not None and self.direction > PROBABLE_DIRECTION:
            meaning = "which along the axes of the tests is another than in the mean over all directions"
        yield (
            f"it carries {100 * mean:.0f} % of the initial stiffness (95 % interval {100 * low:.0f} % to "
            f"{100 * high:.0f} %), {meaning}"
        )

    def _stability(self) -> str:
        """Return the probability of stability over the measured range, in words."""
        worst = min(self.stable, key=lambda mode: self.stable[mode])
        subject = "material and discrepancy together are" if self.has_energy else "the material is"
        text = f"over the measured range of the invariants {subject} stable with a probability of"
        return (
            f"{text} {_percent(self.stable[worst])} (Baker-Ericksen, Drucker, rising stress; least in {worst} loading)"
        )

    def _modulus(self) -> str:
        """Return the initial shear modulus, in words."""
        mean, low, high = (value / stress_unit(self.unit).to_mpa for value in self.modulus)
        text = f"the material's initial shear modulus is {mean:.3g} {self.unit} (95 % interval {low:.3g} to {high:.3g})"
        if len(self.modulus_symbols) == 1:
            text += f", determined by {self.modulus_symbols[0]} alone"
        else:
            text += f", determined by {' and '.join(self.modulus_symbols)} together, each of which is less certain"
        if self.amplitudes and self.other_symbols:
            verb = "shares its" if len(self.other_symbols) == 1 else "share their"
            text += f"; {' and '.join(self.other_symbols)} {verb} meaning with the discrepancy"
        return text


def assess(
    solution: Solution,
    solve: Solve,
    solve_alike: Solve,
    ranges: Mapping[str, StableRange],
) -> Assessment:
    """Return the effect of the discrepancy on a posterior.

    Parameters
    ----------
    solution : Solution
    solve : callable
        Returns the solutions of models: for the same one without discrepancy.
    solve_alike : callable
        Returns them, near enough to see a shift, by the method that gave this one: for other prior scales of the
        discrepancy.
    ranges : mapping of str to StableRange
        Stable range by loading mode.
    """
    model, marginal = solution.model, solution.marginals[solution.model.headline]
    nothing = _without(model)
    none = None if nothing is None else _solved(nothing, solve)
    share, initial_share = shares_of_discrepancy(solution)
    stiffness = modulus(solution)
    scales = scale_symbols(model)
    is_rescaled = bool(scales) and solution.diagnostics is None
    likely = at_level(model)  # where the noise would be summed over, other priors are tried at its level
    reference, rescaled_solutions = solution, dict[str, Solution]()
    if is_rescaled:
        with suppress(ConvergenceError, ModelError):
            models = [likely, *(rescaled(likely, factor) for factor in SCALE_FACTORS.values())]
            reference, *others = [solution, *solve_alike(models[1:])] if likely is model else solve_alike(models)
            rescaled_solutions = dict(zip(SCALE_FACTORS, others, strict=True))
    expected = reference.marginals[model.headline].mean
    return Assessment(
        parameter=model.headline,
        share=share,
        initial_share=initial_share,
        modulus=(stiffness.mean, *stiffness.hdi()),
        modulus_symbols=(symbols := modulus_symbols(model)),
        other_symbols=tuple(symbol for symbol in model.material_symbols if symbol not in symbols),
        unit=model.experiment.shown_unit.name,
        amplitudes={
            symbol: float(solution.marginals[symbol].quantile(0.5)) / marginal.mean for symbol in model.energy_symbols
        },
        members=dict(solution.members),
        between=_between(solution, marginal),
        direction=solution.direction_probability,
        probability_of_none=_probability_of_none(solution, none),
        width_against_none=marginal.sd / none.marginals[model.headline].sd if none else None,
        scales=scales,
        shifts={
            SCALE_FACTORS[name]: float((solution_rescaled.marginals[model.headline].mean - expected) / marginal.sd)
            for name, solution_rescaled in rescaled_solutions.items()
        },
        evidence_changes=known_evidence_changes(solution) | _evidence_changes(reference, rescaled_solutions),
        has_energy=has_energy(model),
        stable={mode: stable_range.probability for mode, stable_range in ranges.items()},
        factors=factors_of_tests(solution),
        power_scaling=power_scaling(solution),
        warnings=tuple(measurement_warnings(model.experiment)),
    )


def has_energy(model: StatisticalModel) -> bool:
    """Return whether there is a discrepancy with an energy."""
    return model.discrepancy.is_energy and bool(model.discrepancy.parameters)


def _without(model: StatisticalModel) -> StatisticalModel | None:
    """Return the model without discrepancy, or None where there is none already."""
    nothing = discrepancy_named("none")
    if model.discrepancy == nothing:
        return None
    retained = (*model.material_symbols, *(parameter.symbol for parameter in model.noise.parameters))
    priors = {symbol: prior for symbol, prior in model.priors.items() if symbol in retained}
    return replace(model, discrepancy=nothing, chosen_priors=priors, fitted_errors=FittedErrors())


def _solved(model: StatisticalModel, solve: Solve) -> Solution | None:
    try:
        return solve([model])[0]
    except ModelError:  # the requested sampler has nothing to sample, or nothing is stable
        return None


def _evidence_changes(solution: Solution, rescaled_solutions: Mapping[str, Solution]) -> dict[str, float]:
    """Return by how much the log evidence of other solutions exceeds that of one, where both have any."""
    evidences = {
        name: rescaled.log_evidence
        for name, rescaled in rescaled_solutions.items()
        if rescaled.log_evidence is not None
    }
    log_evidence = solution.log_evidence
    return {} if log_evidence is None else {name: float(value - log_evidence) for name, value in evidences.items()}


def _between(solution: Solution, marginal: Marginal) -> float:
    """Return the share of the headline parameter's variance that is between the members of an average."""
    mixture = solution.mixture
    if mixture.member is None:
        return 0.0
    model = solution.model
    values = values_of(model, mixture, [model.headline])[0][:, 0]
    names = np.array([member.name for member in model.energy_members])[mixture.member]
    explained = 0.0
    for name in np.unique(names):
        is_member = names == name
        mean = float(np.average(values[is_member], weights=mixture.weights[is_member]))
        explained += float(mixture.weights[is_member].sum()) * (mean - marginal.mean) ** 2
    return explained / marginal.sd**2


def _probability_of_none(solution: Solution, none: Solution | None) -> float | None:
    if none is None or none.log_evidence is None or solution.log_evidence is None:
        return None
    return float(1 / (1 + np.exp(np.clip(solution.log_evidence - none.log_evidence, -700, 700))))


def _percent(probability: float) -> str:
    if min(probability, 1 - probability) < 0.005:
        return "less than 1 %" if probability < 0.5 else "more than 99 %"
    return f"{100 * probability:.0f} %"


def _influence(shift: float) -> str:
    """Return in words how much a shift in standard deviations matters."""
    return (
        "matters"
        if abs(shift) > MIN_IMPORTANT_SHIFT
        else "matters a little"
        if abs(shift) > MIN_NOTICEABLE_SHIFT
        else "matters little"
    )
