"""What a user must know of a population before its numbers are used."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from statistics import median

from tissuq.population.draws import PopulationDraws
from tissuq.result_warning import ResultWarning, Severity, has_code, merged, most_severe_first

MIN_EFFECTIVE_SHARE = 0.5
"""Smallest share of draws that must remain effective when they are corrected."""
FAR_FACTOR = 50.0
"""Between the modulus of a specimen and that of the others, from which its unit may be wrong."""
MIN_SPECIMENS_FOR_SPREAD = 5
"""Smallest number of specimens for which the prior of the spread has little influence."""
MAX_WARNINGS_OF_TESTS = 8
"""Number of different warnings about the measurements that are shown."""


def warnings_of(population: PopulationDraws) -> tuple[str, ...]:
    """Return the warnings, in sentences: about the population, and about the measurements of its specimens."""
    sentences = [*_equal_specimens(population), *_far_specimens(population)]
    if not population.hierarchy.diagnostics.converged:
        sentences.append(population.hierarchy.diagnostics.verdict)
    if population.hierarchy.effective <= MIN_EFFECTIVE_SHARE:
        sentences.append(
            f"only {100 * population.hierarchy.effective:.0f} % of the draws remain effective when they are corrected "
            "for the approximation of the specimens' posteriors by a few Gaussians: the approximation is too poor."
        )
    failed = [name for name, fit in population.posteriors.items() if fit.solution.is_approximate]
    if failed:
        sentences.append(
            f"sampling has not converged for the separate fit of {', '.join(failed)}, on which the population depends."
        )
    columns = len(population.covariates.effects)
    if has_few_specimens(population):
        beside = f" beside {columns} effects of covariates" * bool(columns)
        sentences.append(
            f"{len(population.names)} specimens determine the spread poorly{beside}: its prior, half-normal with sd "
            f"{population.spread_prior:g} of the logarithm, influences the interval of a new specimen, too."
        )
    if extrapolated := population.covariates.beyond(population.patient_covariates):
        sentences.append(
            f"the new specimen is beyond the specimens: {', '.join(extrapolated)}. That effects go on so is assumed."
        )
    of_tests = most_severe_first(merged(warnings_of_tests(population), everyone="all specimens"))
    omitted = len(of_tests) - MAX_WARNINGS_OF_TESTS
    more = [f"{omitted} more warnings about the data; see tissuq inspect FILE."] if omitted > 0 else []
    return (*sentences, *of_tests[:MAX_WARNINGS_OF_TESTS], *more)


def warnings_of_tests(population: PopulationDraws) -> Mapping[str, tuple[ResultWarning, ...]]:
    """Return what was implausible when the tests of every specimen were read."""
    return {name: fit.model.experiment.warnings for name, fit in population.posteriors.items()}


def specimens_with(population: PopulationDraws, code: str) -> list[str]:
    """Return the specimens with a warning of that code about their measurements."""
    return [name for name, warnings in warnings_of_tests(population).items() if has_code(warnings, code)]


def has_converged(population: PopulationDraws) -> bool:
    """Return whether sampling of the population, and of every separate fit of a specimen, has converged."""
    fits = (*population.posteriors.values(), population.complete)
    hierarchy = population.hierarchy
    is_corrected = hierarchy.effective > MIN_EFFECTIVE_SHARE
    return hierarchy.diagnostics.converged and is_corrected and not any(fit.solution.is_approximate for fit in fits)


def has_few_specimens(population: PopulationDraws) -> bool:
    """Return whether there are so few specimens that the prior of the spread has much influence."""
    return len(population.names) - len(population.covariates.effects) < MIN_SPECIMENS_FOR_SPREAD


def _equal_specimens(population: PopulationDraws) -> Iterator[str]:
    """Yield a warning about specimens with the same measurements: files or rows that were copied."""
    experiments = {name: posterior.model.experiment for name, posterior in population.posteriors.items()}
    alike = [
        [name for name, same in experiments.items() if experiment.has_measurements_of(same)]
        for experiment in experiments.values()
    ]
    copies = dict.fromkeys(" and ".join(names) for names in alike if len(names) > 1)
    if copies:
        yield (
            f"the measurements of {'; of '.join(copies)} are equal, as copies are: keep one of "
            "them, for copies make the spread between specimens smaller than it is."
        )


def far_specimens(population: PopulationDraws) -> dict[str, float]:
    """Return the specimens whose stiffness may be that of others in another unit, with their modulus over the usual."""
    moduli = {name: posterior.initial_shear_modulus.mean for name, posterior in population.posteriors.items()}
    middle = median([modulus for modulus in moduli.values() if modulus > 0] or [0.0])
    return {
        name: modulus / middle
        for name, modulus in moduli.items()
        if modulus > 0 and not 1 / FAR_FACTOR < modulus / middle < FAR_FACTOR
    }


def _far_specimens(population: PopulationDraws) -> Iterator[str]:
    """Yield a problem about each specimen that is far from the others."""
    for name, times in far_specimens(population).items():
        yield ResultWarning(
            f"the initial modulus of {name} is {times:.2g} times that of the other specimens, and widens the range of "
            "new ones: see whether the unit of its stresses and its area are right, and whether it begins slack; if it "
            f"is no such specimen, leave it out (--without {name}).",
            severity=Severity.PROBLEM,
        )
