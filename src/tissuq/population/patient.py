"""Stress of a new specimen: a material from the population, and the model error of a specimen that was measured."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tissuq.arrays import BoolArray, FloatArray
from tissuq.assessment.stability import calibrated_range
from tissuq.errors import InputError
from tissuq.experiments.modes import LoadingMode, loading_mode
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.inference.marginal import marginal_of_points
from tissuq.inference.solution import Diagnostics, Marginals, Representation, Solution
from tissuq.mechanics import Material, engineering_stress, initial_shear_modulus
from tissuq.model.discrepancy import NoDiscrepancy
from tissuq.model.statistical_model import StatisticalModel
from tissuq.population.draws import PopulationDraws
from tissuq.population.likelihoods import Coordinates
from tissuq.posterior.posterior import Posterior
from tissuq.prediction.bands import Band
from tissuq.prediction.moments import drawn_curves, values_of

if TYPE_CHECKING:
    from tissuq.population.hierarchy import Hierarchy

STRETCH_STEP = 1e-3
"""Step of the stretch for the initial slope."""
MIN_MODULUS_RATIO = 0.1
"""Smallest initial modulus by which a model error is divided, as a share of the specimen's median modulus."""


def matching_draws(posterior: Posterior, coordinates: Coordinates, targets: FloatArray) -> GaussianMixture:
    """Return draws of a specimen's separate fit, as points, whose pooled parameters are nearest to targets (N, d)."""
    from scipy.spatial import KDTree

    components = posterior.solution.mixture
    selected, drawn = components.draw(posterior.seed)
    rows, linear, width = selected.ravel(), drawn.reshape(-1, drawn.shape[2]), components.root.shape[1:]
    points = replace(components[rows], mean=linear, root=np.broadcast_to(np.zeros(width), (len(rows), *width)))
    line_values = coordinates.to_line(values_of(posterior.model, points, coordinates.symbols)[0])
    line_values = np.maximum(line_values, -1e3)  # a modulus of zero
    spread = line_values.std(axis=0) + 1e-300
    return points[KDTree(line_values / spread).query(targets / spread)[1]]


def patient_posterior(population: PopulationDraws) -> Posterior:
    """Return the posterior of the material of a patient who has not been measured, without discrepancy.

    Parameters that are not pooled, and the noise, are those of a random specimen, from the draw whose pooled parameters
    are nearest to the specimen's.
    """
    coordinates, hierarchy, full = population.coordinates, population.hierarchy, population.complete.model
    used = {p.symbol for p in (*full.material.parameters, *full.noise.parameters)}
    chosen_priors = {symbol: prior for symbol, prior in full.chosen_priors.items() if symbol in used}
    model = StatisticalModel(full.experiment, full.material, NoDiscrepancy(), full.noise, chosen_priors)
    chains, draws, count, size = hierarchy.specimens.shape
    on_line, values = hierarchy.specimens.reshape(-1, count, size), np.empty((chains * draws, len(model.symbols)))
    for i, posterior in enumerate(population.posteriors.values()):
        rows = np.arange(i, chains * draws, count)
        matching = matching_draws(posterior, coordinates, on_line[rows, i])
        is_unknown = np.isin(model.symbols, posterior.model.symbols)
        unknown = [symbol for symbol in model.symbols if symbol in posterior.model.symbols]
        values[rows[:, None], np.flatnonzero(is_unknown)], _ = values_of(posterior.model, matching, unknown)
        if len(unknown) < len(model.symbols):  # the noise of this specimen is known
            values[rows[:, None], np.flatnonzero(~is_unknown)] = posterior.model.noise_of_tests[1]
    values[:, [model.symbols.index(symbol) for symbol in coordinates.symbols]] = population.new.reshape(-1, size)
    columns = dict(zip(model.symbols, values.T, strict=True))
    settings, linear = (
        np.array([columns[symbol] for symbol in symbols]).reshape(-1, chains * draws).T
        for symbols in (model.nonlinear, model.linear)
    )
    mixture = GaussianMixture.of_points(settings, linear)
    support = {parameter.symbol: parameter.support for parameter in model.parameters}
    names = f"{count} specimens, pooled in {', '.join(coordinates.symbols)}"
    covariates = population.covariates.described(population.patient_covariates)
    names += f" (the patient: {covariates})" * bool(covariates)
    is_exact = full.discrepancy.name == NoDiscrepancy.name
    left_out = "" if is_exact else f", and their model error ({full.discrepancy.name}) is left out"
    solution = Solution(
        model,
        "population",
        f"a new specimen of the population of {names}; what is not pooled is that of a random specimen{left_out}",
        Representation.of(mixture),
        Marginals.of(model, lambda symbol: marginal_of_points(columns[symbol], mixture.weights, support[symbol])),
        sampled=linear.reshape(chains, draws, -1),
        diagnostics=_diagnostics(hierarchy, values.reshape(chains, draws, -1), model.symbols),
        is_of_data=False,
    )
    return Posterior(solution, population.complete.solver)


def check_one_control(loading: LoadingMode) -> None:
    """Refuse a loading mode with several controls, in which the stress of a new specimen is not predicted.

    Raises
    ------
    InputError
        With its controls.
    """
    if len(loading.controls) > 1:
        names = ", ".join(control.name for control in loading.controls)
        raise InputError(
            f"the stress of a new specimen is predicted in loading modes with one control, and '{loading.name}' has "
            f"{names}."
        )


def patient_band(
    population: PopulationDraws,
    loading: LoadingMode,
    points: FloatArray,
    prob: float,
    *,
    channel: int,
    discrepancy: bool,
) -> Band:
    """Return the stress of a new specimen, whose model error is a random specimen's.

    At every point it is that of one of the specimens that were measured there, which share all draws among them.

    Parameters
    ----------
    population : PopulationDraws
    loading : LoadingMode
        With one control.
    points : (g,) array
        Where.
    prob : float
        Between low and high.
    channel, discrepancy
        As of `patient_curves`.

    Raises
    ------
    InputError
        When the loading mode has several controls, or no specimen was measured at a point.
    """
    check_one_control(loading)
    coordinates, specimens = population.coordinates, population.hierarchy.specimens
    chains, draws, count, size = specimens.shape
    line_values, patients = specimens.reshape(-1, count, size), population.new.reshape(-1, size)
    posteriors = list(population.posteriors.values())
    is_known = np.array([_knows_error(posterior, loading, points) for posterior in posteriors]) | (not discrepancy)
    if not is_known.any(axis=0).all():
        raise InputError(
            f"no specimen was measured at {loading.controls[0].name} {points[~is_known.any(axis=0)][0]:g}, so that the "
            "model error there is unknown: predict nearer to the data, or with discrepancy=False."
        )
    stresses = np.full((chains * draws, len(points)), np.nan)
    patterns, pattern_of = np.unique(is_known, axis=1, return_inverse=True)
    for i, posterior in enumerate(posteriors):
        matching = matching_draws(posterior, coordinates, line_values[:, i])
        for number in np.flatnonzero(patterns[i]):
            members, columns = np.flatnonzero(patterns[:, number]), np.flatnonzero(pattern_of.ravel() == number)
            rows = np.arange(int(np.searchsorted(members, i)), chains * draws, len(members))
            stresses[rows[:, None], columns] = patient_curves(
                posterior, coordinates, matching[rows], patients[rows], points[columns], mode=loading, channel=channel,
                discrepancy=discrepancy,
            )  # fmt: skip
    low, median, high = np.quantile(stresses, [0.5 - prob / 2, 0.5, 0.5 + prob / 2], axis=0)
    return Band(points, median, low, high)


def _knows_error(posterior: Posterior, mode: LoadingMode, points: FloatArray) -> BoolArray:
    """Return at which points (g,) of a mode the model error of a specimen is known: where it was measured.

    That is nowhere in other modes than its own if its error is not an energy.
    """
    model = posterior.model
    if mode not in model.experiment.modes and not model.discrepancy.is_energy:
        return np.zeros(len(points), dtype=bool)
    low, high = calibrated_range(model, mode)
    return np.asarray((points >= low - STRETCH_STEP) & (points <= high + STRETCH_STEP))


def patient_curves(
    posterior: Posterior,
    coordinates: Coordinates,
    draws: GaussianMixture,
    new: FloatArray,
    stretch: FloatArray,
    *,
    mode: LoadingMode,
    channel: int,
    discrepancy: bool,
) -> FloatArray:
    """Return stresses (N, g) of new specimens whose model error is that of one specimen, where that is known.

    Parameters
    ----------
    posterior : Posterior
        Separate fit of the specimen.
    coordinates : Coordinates
    draws : GaussianMixture
        N draws of the specimen.
    new : (N, d) array
        The pooled parameters of the patients; what is not pooled is the specimen's.
    stretch : (g,) array
    mode : LoadingMode
    channel : int
        Which of its stresses.
    discrepancy : bool
        Add the specimen's discrepancy in the same draw, in proportion to the patient's initial modulus.
    """
    model = posterior.model
    specimen_values, _ = values_of(model, draws, model.material_symbols)
    values = specimen_values.copy()
    values[:, [model.material_symbols.index(symbol) for symbol in coordinates.symbols]] = new
    curves = engineering_stress(model.material, mode.paths[channel], stretch, values)
    if not discrepancy:
        return curves
    _, error = drawn_curves(model, draws, model.experiment.states_at(stretch, mode, channel))
    specimen_modulus, patient_modulus = (
        _initial_modulus(model.material, parameters) for parameters in (specimen_values, values)
    )
    least = MIN_MODULUS_RATIO * np.median(specimen_modulus)
    return np.asarray(curves + error * (patient_modulus / np.maximum(specimen_modulus, least))[:, None])


def _diagnostics(hierarchy: Hierarchy, values: FloatArray, symbols: tuple[str, ...]) -> Diagnostics:
    """Return how well draws (chains, draws, k) of the parameters are known; converged where the population has."""
    population, patient = hierarchy.diagnostics, Diagnostics.of(hierarchy.sampled.of(values, symbols))
    return replace(patient, converged=population.converged, verdict=population.verdict)


def _initial_modulus(material: Material, values: FloatArray) -> FloatArray:
    """Return the initial shear moduli (N,) of material parameters (N, p)."""
    if not material.is_isotropic:
        return np.array([initial_shear_modulus(material, parameters) for parameters in values])
    slope = engineering_stress(material, loading_mode("uniaxial"), np.array([1 + STRETCH_STEP]), values)
    return np.asarray(slope[:, 0] / (3 * STRETCH_STEP))
