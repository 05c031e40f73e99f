"""What a user must know of a population before its numbers are used."""

from __future__ import annotations

from tissuq.population.draws import PopulationDraws

__all__ = ["MIN_EFFECTIVE_SHARE", "warnings_of"]

MIN_EFFECTIVE_SHARE = 0.5
"""Smallest share of draws that must remain effective when they are corrected."""
MIN_SPECIMENS_FOR_SPREAD = 5
"""Smallest number of specimens for which the prior of the spread has little influence."""


def warnings_of(population: PopulationDraws) -> tuple[str, ...]:
    """Return the warnings, in sentences."""
    sentences = []
    if not population.hierarchy.diagnostics.converged:
        sentences.append(population.hierarchy.diagnostics.verdict)
    if population.hierarchy.effective <= MIN_EFFECTIVE_SHARE:
        sentences.append(
            f"only {population.hierarchy.effective:.0%} of the draws remain effective when they are corrected for the "
            "approximation of the specimens' posteriors by a few Gaussians: the approximation is too poor."
        )
    failed = [name for name, fit in population.posteriors.items() if fit.solution.is_approximate]
    if failed:
        sentences.append(
            f"sampling has not converged for the separate fit of {', '.join(failed)}, on which the population depends."
        )
    columns = len(population.covariates.effects)
    if len(population.names) - columns < MIN_SPECIMENS_FOR_SPREAD:
        beside = f" beside {columns} effects of covariates" * bool(columns)
        sentences.append(
            f"{len(population.names)} specimens determine the spread poorly{beside}: its prior, half-normal with sd "
            f"{population.spread_prior:g} of the logarithm, influences the interval of a new patient, too."
        )
    if beyond := population.covariates.beyond(population.patient_covariates):
        sentences.append(
            f"the new patient is beyond the specimens: {', '.join(beyond)}. That effects go on so is assumed."
        )
    return tuple(sentences)
