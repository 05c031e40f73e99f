"""How a fit was made, as sentences for the methods section of a paper."""

from __future__ import annotations

from importlib.metadata import version
from typing import TYPE_CHECKING

from tissuq.report.measured import errors_in_words, noise_in_words, tests_in_words
from tissuq.report.result import Section
from tissuq.report.summary import parameter_rows
from tissuq.report.tables import interval

if TYPE_CHECKING:
    from tissuq.model.statistical_model import StatisticalModel
    from tissuq.studies.specimen import SpecimenStudy

__all__ = ["methods_section"]

INTRODUCTION = (
    "The material model {material}, with the strain-energy density W = {formula} ({source}), was fitted by Bayesian "
    "inference with tissuq {version} to {count}: {tests}."
)
INTERVALS = "Posterior means, with 95 % highest-density intervals of {meaning}: {numbers}."
WHOLE_TESTS = "Errors of whole tests were included with these standard deviations: {sizes}."
NO_DISCREPANCY = "The measured stress was taken as the sum of the material's stress and noise: the material is right."
DISCREPANCY = "The measured stress was taken as the sum of the material's stress, a discrepancy and noise. "
ENERGY = (
    "The discrepancy is the stress of a further free energy of the invariants without initial stiffness, before the "
    "data a Gaussian process of zero mean ('{name}' of tissuq), averaged over its forms by their evidence."
)
OTHER_FORM = "The discrepancy is {formula} ('{name}' of tissuq; {source})."


def methods_section(study: SpecimenStudy) -> Section:
    """Return the text, of the discrepancy that answers: model, data, errors, priors, computation and result."""
    posterior, unit, tests = study.posteriors[study.main], study.unit, study.experiment.tests
    material, diagnostics = posterior.model.material, posterior.diagnostics
    introduction = INTRODUCTION.format(
        material=material.name,
        formula=material.formula,
        source=material.source,
        version=version("tissuq"),
        count="a test" if len(tests) == 1 else f"{len(tests)} tests",
        tests="; ".join(tests_in_words(study.experiment)),
    )
    priors = ", ".join(
        f"{row['parameter']} {row['prior']}{' ' * bool(row['unit'])}{row['unit']}"
        for row in parameter_rows({study.main: posterior})
    )
    sizes = errors_in_words(posterior.model.tolerances, unit)
    numbers = []
    for name, *values in study.answer.estimates:
        mean, low, high = (value / unit.to_mpa for value in values)
        sd = (high - low) / 4
        numbers.append(f"{name} {interval(mean, mean, sd)[0]} ({' to '.join(interval(low, high, sd))}) {unit.name}")
    sentences = (
        introduction,
        _discrepancy_in_words(posterior.model, study.main),
        f"Noise: {noise_in_words(study, posterior)}.",
        WHOLE_TESTS.format(sizes=sizes) if sizes else "",
        f"Priors: {priors}.",
        f"Computation: {posterior.how}.",
        "" if diagnostics is None else diagnostics.verdict,
        INTERVALS.format(meaning=posterior.model.meaning, numbers=", ".join(numbers)),
    )
    return Section("Text for the methods section of a paper", (" ".join(filter(None, sentences)),))


def _discrepancy_in_words(model: StatisticalModel, name: str) -> str:
    discrepancy = model.discrepancy
    if not discrepancy.parameters:
        return NO_DISCREPANCY
    if model.energy_symbols:
        return DISCREPANCY + ENERGY.format(name=name)
    return DISCREPANCY + OTHER_FORM.format(name=name, formula=discrepancy.formula, source=discrepancy.source)
