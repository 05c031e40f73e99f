"""The posterior of a material whose parameters a forward model was calibrated for: one as `tissuq.fit` gives."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.assessment.stability import measured_range
from tissuq.errors import InputError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import LoadingMode, curve_modes, loading_mode
from tissuq.experiments.units import stress_unit
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.inference.marginal import Marginal
from tissuq.inference.solution import Diagnostics, Marginals, Representation, Solution
from tissuq.mechanics import Material, engineering_stress, material_named
from tissuq.model.discrepancy import NoDiscrepancy
from tissuq.model.noise import KnownNoise
from tissuq.model.statistical_model import StatisticalModel
from tissuq.parameters.priors import Prior
from tissuq.posterior.ensemble import EnergyDraw, Ensemble
from tissuq.posterior.posterior import Posterior
from tissuq.posterior.solver import Solver

if TYPE_CHECKING:
    from tissuq.emulation.problem import Problem
    from tissuq.emulation.sampling import SampledPosterior

POINTS = 20
"""Number of stretches that stand for the range."""
NOISE_SHARE = 1e-6
"""Noise of these over their largest stress: no stress was measured."""
CALIBRATION = "calibration"
"""Route of a posterior that is none of measured stresses."""


def material_posterior(
    problem: Problem,
    sampled: SampledPosterior,
    material: str | Material,
    stretch: tuple[float, float],
    *,
    mode: str,
    unit: str,
    runs: int,
    seed: int,
) -> Posterior:
    """Return the draws of a calibration as the posterior of a material, as `Calibration.posterior_of` says.

    Parameters
    ----------
    problem : Problem
        What was calibrated.
    sampled : SampledPosterior
        The draws of its parameters.
    material, stretch, mode, unit
        As of `Calibration.posterior_of`.
    runs : int
        Of the forward model.
    seed : int

    Raises
    ------
    InputError
        When a parameter of the material was not calibrated, or has a prior beyond its support, or the range is none.
    """
    law, priors = check_material(material, problem.forward_priors, unit)
    loading, factor = loading_mode(mode), stress_unit(unit).to_mpa
    symbols = list(priors)
    factors = {parameter.symbol: factor if parameter.unit else 1.0 for parameter in law.parameters}
    columns = [problem.symbols.index(symbol) for symbol in symbols]
    draws = sampled.draws[:, :, columns] * np.array([factors[symbol] for symbol in symbols])
    chains, count, _ = draws.shape
    experiment = _experiment(law, draws.reshape(chains * count, -1), loading, stretch).labelled(
        name="calibration", source="mean of a calibration of a forward model: nothing was measured", stress_unit=unit
    )
    model = _model(experiment, law, priors)
    by_symbol = {symbol: draws[:, :, k].ravel() for k, symbol in enumerate(symbols)}
    settings, linear = (
        np.array([by_symbol[symbol] for symbol in group]).reshape(-1, chains * count).T
        for group in (model.nonlinear, model.linear)
    )
    mixture = GaussianMixture.of_points(settings, linear)
    marginals = {symbol: _scaled(sampled.marginals[symbol], factors[symbol]) for symbol in symbols}
    ess = {symbol: float(sampled.ess[symbol]) for symbol in symbols}
    rhat = {symbol: float(sampled.rhat.get(symbol, np.nan)) for symbol in symbols}
    solution = Solution(
        model,
        CALIBRATION,
        f"the parameters of a forward model that was calibrated on {len(problem.measured)} measurements "
        f"through an emulator of {runs} runs",
        Representation.of(mixture),
        Marginals.of(model, lambda symbol: marginals[symbol]),
        seed=seed,
        sampled=linear.reshape(chains, count, -1),
        diagnostics=Diagnostics(sampled.converged, sampled.verdict, rhat, ess, ess),
        is_of_data=False,
    )
    return Posterior(solution, Solver(seed=seed))


def card_material(law: Material, values: tuple[float, ...], stretch: tuple[float, float], mode: str) -> Ensemble:
    """Return a law with parameters (MPa) as an ensemble of one draw, which cards are made of, known over a range.

    Raises
    ------
    InputError
        When the range is none.
    """
    experiment = _experiment(law, np.array([values]), loading_mode(mode), stretch)
    model = _model(experiment, law)
    ranges = {loading.name: measured_range(experiment, loading) for loading in curve_modes()}
    return Ensemble((EnergyDraw(0, ((law, values),), None),), model, (), 1, ranges)


def _experiment(law: Material, values: FloatArray, loading: LoadingMode, stretch: tuple[float, float]) -> Experiment:
    """Return the mean stress of parameters (N, k) at points of a range, which stand for what was measured."""
    loading, points = points_of_range(law, loading, stretch)
    stresses = [engineering_stress(law, path, points, values).mean(axis=0) for path in loading.paths]
    return Experiment(loading, points, np.column_stack(stresses) if len(stresses) > 1 else stresses[0])


def _model(experiment: Experiment, law: Material, priors: Mapping[str, Prior] | None = None) -> StatisticalModel:
    """Return the model of a law, all but without noise, of what stands for measurements."""
    noise = KnownNoise(float(NOISE_SHARE * np.abs(experiment.measured).max()))
    return StatisticalModel(experiment, law, NoDiscrepancy(), noise, priors or {})


def points_of_range(
    law: Material, mode: str | LoadingMode, stretch: tuple[float, float]
) -> tuple[LoadingMode, FloatArray]:
    """Return a loading mode and points (n,) or (n, 2) of it, over which a law is known.

    Of a law with fibres these are points of a sheet that is stretched along one axis, the other, and both: most modes
    do not say how it deforms.

    Raises
    ------
    InputError, ModelError
        When there is no such mode, or one with several controls, or the range is none.
    """
    loading = loading_mode(mode)
    if len(loading.controls) != 1:
        raise InputError(f"the mode '{loading.name}' has several controls: give the range in one with one control.")
    low, high = map(float, stretch)
    if not 0 < low < high:
        raise InputError(f"the range of the stretch must be two rising positive numbers, not {low:g}:{high:g}.")
    points = np.linspace(low, high, POINTS)
    points = points[np.abs(points - 1) > 1e-9]
    if not law.is_isotropic:
        if high <= 1:
            raise InputError(
                f"material '{law.name}' has fibres, which bear load where they are stretched: give a range of the "
                f"stretch that goes beyond 1, not {low:g}:{high:g}."
            )
        loading, still = loading_mode("biaxial"), np.ones_like(points)
        points = np.vstack([np.column_stack(axes) for axes in ((points, still), (still, points), (points, points))])
    return loading, points


def check_material(
    material: str | Material, priors: Mapping[str, Prior], unit: str
) -> tuple[Material, dict[str, Prior]]:
    """Return a material and the priors of its parameters in MPa, from those of a forward model's parameters.

    Raises
    ------
    InputError, ModelError
        When there is no such material or unit, a parameter has no prior, or one beyond its support.
    """
    law, factor = material_named(material), stress_unit(unit).to_mpa
    symbols = [parameter.symbol for parameter in law.parameters]
    if missing := [symbol for symbol in symbols if symbol not in priors]:
        raise InputError(
            f"the material {law.name} has the parameters {', '.join(symbols)}, and the forward model was calibrated "
            f"without {', '.join(missing)} (its parameters: {', '.join(priors)}). Let the forward model and the priors "
            "call them as the material does."
        )
    in_mpa = {
        parameter.symbol: priors[parameter.symbol].scaled(factor if parameter.unit else 1.0)
        for parameter in law.parameters
    }
    for parameter in law.parameters:
        in_mpa[parameter.symbol].within(parameter.support)
    return law, in_mpa


def _scaled(marginal: Marginal, factor: float) -> Marginal:
    """Return the marginal of a parameter in a unit ``factor`` times smaller."""
    table = marginal.points * factor, marginal.density / factor, marginal.cumulative
    return Marginal(marginal.mean * factor, marginal.sd * factor, *table)
