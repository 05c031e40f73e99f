"""A posterior as labelled arrays, which ArviZ and xarray read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.assessment import known_evidence_changes
from tissuq.assessment.modulus import derived_marginal, modulus
from tissuq.errors import InputError
from tissuq.experiments.units import StressUnit
from tissuq.inference.solution import Solution
from tissuq.model.prior_draws import draw_from_prior
from tissuq.model.statistical_model import StatisticalModel
from tissuq.parameters.checks import check_count, check_probability, one_or_several
from tissuq.parameters.parameter import Parameter
from tissuq.posterior.netcdf import LabelledGroup
from tissuq.prediction.densities import LeaveOneOut, pointwise_log_likelihood, replicate_data, stride

OF_VALUES = ("mean", "sd", "median", "hdi_low", "hdi_high")
"""Numbers of a summary that have the unit of their parameter."""


def labelled_arrays(
    solution: Solution, seed: int, unit: StressUnit, left_out: LeaveOneOut | None
) -> dict[str, LabelledGroup]:
    """Return draws, replicated data, densities and measurements; the groups are those of `Posterior.data`.

    Stresses, and parameters that are stresses, are in the unit; densities are those of data in MPa in any.
    """
    experiment = solution.model.experiment
    point = {"measurement": np.arange(experiment.size)}
    chains, draws = (np.arange(size) for size in solution.shape)
    sample = {"chain": chains, "draw": draws}
    thinned_sample = {"chain": chains, "draw": draws[:: stride(solution)]}
    in_stress, of_mpa = {"units": unit.name}, {"density_of": "stresses in MPa"}
    coordinates = {"stretch": ("measurement", experiment.states.abscissa, {"units": "1"})}
    if len(experiment.tests) > 1:
        coordinates["test"] = (
            "measurement",
            [curve.name for curve in experiment.curves for _ in range(len(curve))],
            {},
        )
    groups = {
        "posterior": LabelledGroup(_labelled(_draws(solution, seed), solution.model.reported_parameters, unit), sample),
        "observed_data": LabelledGroup(
            {"stress": ("measurement", experiment.measured / unit.to_mpa, in_stress)}, point
        ),
        "constant_data": LabelledGroup(coordinates, point),
    }
    if left_out is None:  # it is the posterior of somebody who was not measured
        return groups
    stress = ("chain", "draw", "measurement")
    groups |= {
        "posterior_predictive": LabelledGroup(
            {"stress": (stress, replicate_data(solution, seed) / unit.to_mpa, in_stress)}, thinned_sample | point
        ),
        "log_likelihood": LabelledGroup(
            {"stress": (stress, pointwise_log_likelihood(solution), of_mpa)}, thinned_sample | point
        ),
        "leave_one_out": LabelledGroup(
            {
                "log_density": ("measurement", left_out.log_density, of_mpa),
                "is_rough": ("measurement", left_out.is_rough.astype(np.int8)),
            },
            point,
        ),
    }
    return groups


def prior_arrays(model: StatisticalModel, draws: int, seed: int, unit: StressUnit) -> dict[str, LabelledGroup]:
    """Return draws of parameters from their priors, and of the measurements: the groups ``prior`` and its predictive.

    Stresses, and parameters that are stresses, are in the unit.
    """
    check_count(draws, "draws must be one or more")
    generator = np.random.default_rng([seed, 4])
    drawn, stresses = zip(*(draw_from_prior(model, generator) for _ in range(draws)), strict=True)
    sample = {"chain": np.arange(1), "draw": np.arange(draws)}
    values = {symbol: np.array([[one[symbol] for one in drawn]]) for symbol in model.symbols}
    dimensions, point = ("chain", "draw", "measurement"), {"measurement": np.arange(model.experiment.size)}
    stress = np.array([stresses]) / unit.to_mpa
    return {
        "prior": LabelledGroup(_labelled(values, model.parameters, unit), sample),
        "prior_predictive": LabelledGroup({"stress": (dimensions, stress, {"units": unit.name})}, sample | point),
    }


def labels_of(solution: Solution, seed: int) -> dict[str, str | float]:
    """Return what was fitted, how, and what came out, in short: the attributes of the arrays."""
    model = solution.model
    labels: dict[str, str | float] = {
        "inference_library": "tissuq",
        "experiment": model.experiment.name,
        "loading_mode": ", ".join(mode.name for mode in model.experiment.modes),
        "material": model.material.name,
        "discrepancy": model.discrepancy.name,
        "noise": str(model.noise),
        "method": solution.route,
        "method_reason": solution.reason,
        "seed": seed,
    }
    labels |= {"headline": model.headline, "stress_unit": model.experiment.stress_unit}
    for label, marginal in (("headline", solution.marginals[model.headline]), ("modulus", modulus(solution))):
        low, high = marginal.hdi()
        labels |= {f"{label}_median": float(marginal.quantile(0.5))}
        labels |= {f"{label}_hdi_low": low, f"{label}_hdi_high": high}
    labels["intervals_of"] = model.meaning
    labels |= {f"evidence_change_{name}": change for name, change in known_evidence_changes(solution).items()}
    units = {parameter.symbol: ", in MPa" if parameter.unit else "" for parameter in model.parameters}
    labels |= {f"prior_{symbol}": f"{prior}{units[symbol]}" for symbol, prior in model.priors.items()}
    if solution.stable_in:
        labels["stable_in"] = ", ".join(solution.stable_in)
    if solution.diagnostics is not None:
        diagnostics = solution.diagnostics
        labels |= {"converged": str(diagnostics.converged), "verdict": diagnostics.verdict}
        labels |= {} if diagnostics.divergences is None else {"divergences": diagnostics.divergences}
        labels |= {} if diagnostics.least_bfmi is None else {"least_bfmi": diagnostics.least_bfmi}
    evidence = {"log_evidence": solution.log_evidence, "log_evidence_error": solution.log_evidence_error}
    return labels | {name: value for name, value in evidence.items() if value is not None}


def summaries(
    solution: Solution, prob: float = 0.95, parameters: Sequence[str] | None = None
) -> dict[str, dict[str, float]]:
    """Return mean, sd, median and interval of the parameters that are asked for, in MPa; see `Posterior.summary`."""
    model = solution.model
    check_probability(prob)
    symbols = tuple(parameter.symbol for parameter in model.reported_parameters)
    wanted = symbols if parameters is None else one_or_several(parameters, str, "parameters must be symbols")
    unknown = [symbol for symbol in wanted if symbol not in symbols]
    if unknown:
        raise InputError(f"there is no parameter '{unknown[0]}'; there are {', '.join(symbols)}.")
    return {symbol: _numbers(solution, symbol, prob) for symbol in wanted}


def summaries_in(
    unit: StressUnit, solution: Solution, prob: float = 0.95, parameters: Sequence[str] | None = None
) -> dict[str, dict[str, float]]:
    """Return `summaries` with parameters that are stresses in a unit."""
    scales = {p.symbol: unit.to_mpa if p.unit else 1.0 for p in solution.model.reported_parameters}
    return {
        symbol: {name: value / scales[symbol] if name in OF_VALUES else value for name, value in numbers.items()}
        for symbol, numbers in summaries(solution, prob, parameters).items()
    }


def _numbers(solution: Solution, symbol: str, prob: float) -> dict[str, float]:
    """Return mean and sd (nan where there may be none), median, ends of the interval, and how well it is sampled."""
    model, is_derived = solution.model, symbol not in solution.model.symbols
    marginal = derived_marginal(solution, symbol) if is_derived else solution.marginals[symbol]
    diagnostics = None if is_derived else solution.diagnostics
    has_moments = symbol not in model.energy_symbols or model.priors[symbol].has_moments
    mean, sd = (marginal.mean, marginal.sd) if has_moments else (np.nan, np.nan)
    low, high = marginal.hdi(prob)
    numbers = {"mean": mean, "sd": sd, "median": float(marginal.quantile(0.5)), "hdi_low": low, "hdi_high": high}
    if diagnostics is None:
        return numbers
    ess = min(diagnostics.ess_bulk[symbol], diagnostics.ess_tail[symbol])
    return numbers | {"ess": ess, "rhat": diagnostics.rhat[symbol]}


def _labelled(draws: Mapping[str, FloatArray], parameters: Sequence[Parameter], unit: StressUnit) -> dict[str, Any]:
    """Return draws (chains, draws) of parameters with their dimensions and units, those that are stresses in a unit."""
    arrays, is_stress = {}, {parameter.symbol: bool(parameter.unit) for parameter in parameters}
    for symbol, values in draws.items():
        scale, units = (unit.to_mpa, unit.name) if is_stress[symbol] else (1.0, "1")
        arrays[symbol] = (("chain", "draw"), values / scale, {"units": units})
    return arrays


def _draws(solution: Solution, seed: int) -> dict[str, FloatArray]:
    """Return the draws of every parameter, those of stresses with the error that all tests have in common."""
    model, drawn = solution.model, dict(solution.draws)
    if model.common_error:
        score = np.random.default_rng([seed, 19]).standard_normal(solution.shape)
        factor = 1 + model.common_error * score
        drawn = {
            symbol: values * (factor if symbol in model.column_symbols else 1.0) for symbol, values in drawn.items()
        }
    if not model.derived_parameters:
        return drawn
    plain_values = model.material.plain_values([drawn[symbol] for symbol in model.material_symbols])
    plain = {p.symbol: values for p, values in zip(model.material.plain.parameters, plain_values, strict=True)}
    return drawn | plain
