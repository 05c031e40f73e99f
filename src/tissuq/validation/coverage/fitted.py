"""The fits of a campaign: a material (neo-Hookean) with a formulation of its error, on many data sets."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.assessment import Average, average
from tissuq.errors import ModelError, TissuqError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import loading_mode
from tissuq.inference.enumerators.amplitude_lattice import AmplitudeLattice
from tissuq.mechanics import Material, NeoHookean, engineering_stress
from tissuq.model.discrepancy import discrepancy_named
from tissuq.model.noise import noise_named
from tissuq.model.statistical_model import StatisticalModel
from tissuq.model.tolerances import AS_TESTED
from tissuq.parameters.priors import Prior
from tissuq.posterior.fitting import fit_many
from tissuq.posterior.posterior import Posterior
from tissuq.validation.paper.study import FORMULATIONS

AVERAGES = {"average-of-seven": FORMULATIONS}
"""Averages of fits by their evidence: the paper's seven formulations."""
NoiseSd = float | str
"""In MPa, or ``"unknown"``."""
PLAIN = NeoHookean()


def fit_all(
    data: Sequence[Experiment],
    formulation: str,
    noise_sd: Sequence[NoiseSd],
    priors: Mapping[str, Prior],
    material: Material = PLAIN,
) -> Iterator[tuple[int, Posterior | Average | None]]:
    """Yield the place and the posterior of every data set, None where a fit failed; those of the same noise in a row.

    Data sets of the same noise are fitted together, and one by one where all together fail. Posteriors are large: read
    what is wanted, and let them go.
    """
    for level in dict.fromkeys(noise_sd):
        indices = [index for index, sd in enumerate(noise_sd) if sd == level]
        posteriors = _fit_together([data[index] for index in indices], formulation, level, priors, material)
        yield from zip(indices, posteriors, strict=True)


def parts_of(formulation: str) -> tuple[str, ...]:
    """Return the discrepancies that a formulation averages: itself, where it is one."""
    return AVERAGES.get(formulation, (formulation,))


def model_of(
    formulation: str,
    mode: str,
    stretch: FloatArray,
    noise_sd: NoiseSd,
    priors: Mapping[str, Prior],
    material: Material = PLAIN,
) -> StatisticalModel:
    """Return the model that is fitted to data on these stretches, with a stress that does not matter.

    Raises
    ------
    TissuqError
        When such data cannot be fitted.
    """
    stress = engineering_stress(PLAIN, loading_mode(mode), stretch, [1.0])
    applicable, noise = _applicable_priors(formulation, noise_sd, priors, material), noise_named(noise_sd)
    data = Experiment(loading_mode(mode), stretch, stress)
    model = StatisticalModel(data, material, discrepancy_named(formulation), noise, applicable)
    why = AmplitudeLattice().why_not(model) if model.energy_symbols else ""
    if why:
        raise ModelError(f"'{formulation}' cannot be integrated: {why}")
    return model


def parameters_of(formulations: Sequence[str], material: Material = PLAIN) -> set[str]:
    """Return the symbols of all parameters that the fits of a campaign may have."""
    parameters = [*material.parameters, *noise_named("unknown").parameters]
    for formulation in formulations:
        parameters += [p for name in parts_of(formulation) for p in discrepancy_named(name).parameters]
    return {parameter.symbol for parameter in parameters}


def _applicable_priors(
    formulation: str, noise_sd: NoiseSd, priors: Mapping[str, Prior], material: Material
) -> dict[str, Prior]:
    """Return those priors whose parameters material, formulation or noise have."""
    parameters = (*material.parameters, *discrepancy_named(formulation).parameters, *noise_named(noise_sd).parameters)
    return {p.symbol: priors[p.symbol] for p in parameters if p.symbol in priors}


def _fit_together(
    data: Sequence[Experiment], formulation: str, noise_sd: NoiseSd, priors: Mapping[str, Prior], material: Material
) -> list[Posterior | Average | None]:
    names, noise = parts_of(formulation), noise_named(noise_sd)
    try:
        fits = []
        for name in names:
            applicable = _applicable_priors(name, noise_sd, priors, material)
            of_name = fit_many(
                data, material=material, discrepancy=name, noise=noise, priors=applicable, tolerances=AS_TESTED
            )
            fits.append(of_name)
        if len(names) == 1:
            return list(fits[0])
        return [average(dict(zip(names, fit, strict=True))) for fit in zip(*fits, strict=True)]
    except (TissuqError, np.linalg.LinAlgError):
        if len(data) == 1:
            return [None]
        return [fit for data_set in data for fit in _fit_together([data_set], formulation, noise_sd, priors, material)]
