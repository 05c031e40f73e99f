"""What was measured, what intervals include, and how fits were computed, in words: for pages, and for a paper."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.metadata import version
from typing import TYPE_CHECKING

from tissuq.experiments.experiment import Experiment
from tissuq.experiments.units import StressUnit
from tissuq.report.result import Block, Section
from tissuq.report.summary import FOLLOWS, parameter_rows
from tissuq.report.tables import interval

if TYPE_CHECKING:
    from tissuq.model.discrepancy import Discrepancy
    from tissuq.model.statistical_model import StatisticalModel
    from tissuq.model.tolerances import Tolerances
    from tissuq.posterior.posterior import Posterior
    from tissuq.studies.laws import LawStudy
    from tissuq.studies.specimen import SpecimenStudy

LONGEST_NAME = 40
"""Letters of the names of several tests in a title; of more these are counted."""
PRIORS = (
    "Default priors are uniform and wide: boxes ten times as large as a least-squares fit requires (for the material's "
    "parameters: least squares with the material alone), random errors up to the largest stress. Amplitudes of "
    "energies are half-Cauchy, with the typical C10 of the data as their scale; such a posterior may have no mean or "
    "sd, so none is given."
)
METHODS = "Text for the methods section of a paper"
SPECIMENS = "The data and the model of every specimen"
LAW = "The material model {0.name}, with the strain-energy density W = {0.formula} ({0.source}), was fitted"
INTRODUCTION = "{law} by Bayesian inference with tissuq {version} to {data}."
INTERVALS = "Posterior means, with 95 % highest-density intervals of {meaning}: {numbers}."
WHOLE_TESTS = "Errors of whole tests were included with these standard deviations: {sizes}."
WITHOUT_LATERAL_STRESS = (
    "Lateral stretches of tests with free sides are those without lateral stress; {derived} follows from the ratio to "
    "the stiffness of the matrix."
)
NO_DISCREPANCY = "The measured stress was taken as the sum of the material's stress and noise: the material is right."
DISCREPANCY = "The measured stress was taken as the sum of the material's stress, a discrepancy and noise. "
ENERGY = (
    "The discrepancy is the stress of a further free energy of the invariants without initial stiffness, before the "
    "data a Gaussian process of zero mean ('{name}' of tissuq), averaged over its forms by their evidence."
)


def named(experiment: Experiment) -> str:
    """Return what a title calls what was measured: the test with its specimen, or how many tests of what."""
    specimens = list(dict.fromkeys(test.specimen for test in experiment.tests if test.specimen))
    count = len(experiment.tests)
    name = experiment.name if count == 1 or len(experiment.name) <= LONGEST_NAME else f"{count} tests"
    return f"{name}, specimen {specimens[0]}" if len(specimens) == 1 and specimens[0] not in name else name


def subject_of(experiment: Experiment) -> str:
    """Return in a line what was measured: the test, or how many there are."""
    tests = tests_in_words(experiment)
    return tests[0] if len(tests) == 1 else f"{len(tests)} tests"


def tests_in_words(experiment: Experiment) -> list[str]:
    """Return every test in a few words: its mode, measurements and range."""
    texts = []
    for test in experiment.tests:
        control, values = test.mode.controls[0].name, test.stretch.reshape(len(test), -1)[:, 0]
        specimen_words = f" of specimen {test.specimen}" if test.specimen else ""
        ends = f"{values.min():.4g} to {values.max():.4g}"
        texts.append(f"{test.mode.name} test{specimen_words}, {len(test)} {test.rows_name}, {control} {ends}")
    return texts


def data_section(study: SpecimenStudy | LawStudy, posterior: Posterior) -> Section:
    """Return where the data are from, and which errors the intervals of a study include."""
    tests, tolerances = tests_in_words(study.experiment), posterior.model.tolerances
    blocks: list[Block] = [tuple(tests)] if len(tests) > 1 else []
    blocks += [f"{study.experiment.source}.", f"Intervals are of {posterior.model.meaning}."]
    if words := errors_in_words(tolerances, study.unit):
        blocks.append(
            f"Errors of whole tests (standard deviations): {words}. An error in stress that all tests share cannot be "
            "determined from the data and is included in the intervals; the bands are those of a new test with its own "
            "error."
        )
    blocks.append(f"Noise: {noise_in_words(study, posterior)}.")
    return Section("The data and what intervals include", tuple(blocks))


def specimens_section(
    tests: Mapping[str, Sequence[Experiment]], fits: Mapping[str, Posterior], unit: StressUnit
) -> Section:
    """Return how the files of specimens were read, and as what their stress was taken in their separate fits."""
    model = next(iter(fits.values())).model
    sources = tuple(f"**{name}**: {test.source}." for name, of_one in tests.items() for test in of_one)
    discrepancy = discrepancy_in_words(model, model.discrepancy.name)
    law = f"{LAW.format(model.material)} to every specimen. {discrepancy} {noise_of_specimens(fits, unit)}"
    return Section(SPECIMENS, (sources, law))


def noise_of_specimens(fits: Mapping[str, Posterior], unit: StressUnit) -> str:
    """Return what the random errors of measurements of specimens are taken to be."""
    specimens: dict[str, list[str]] = {}
    for name, fit in fits.items():
        noise, text = fit.model.noise, f"{fit.model.noise.description}{_ratios_of_tests(fit.model)}"
        if not noise.parameters:
            sds = dict.fromkeys(f"{sd / unit.to_mpa:.4g}" for sd in noise.of_tests(fit.model.experiment))
            text = f"known standard deviation {', '.join(sds)} {unit.name}"
        specimens.setdefault(text, []).append(name)
    of_groups = [f"of {', '.join(names)}: {text}" for text, names in specimens.items()]
    return f"Noise: {'; '.join(of_groups if len(specimens) > 1 else specimens)}."


def noise_in_words(study: SpecimenStudy | LawStudy, posterior: Posterior) -> str:
    """Return what the random errors of single measurements are taken to be."""
    noise, lag = posterior.model.noise, posterior.model.fitted_errors.lag
    if noise.parameters:
        of_lag = f" (lag-1 correlation {lag:.2f})" if lag else ""
        return f"{noise.description}{of_lag}{_ratios_of_tests(posterior.model)}"
    values = [test.noise_sd for test in study.settings.tests if test.noise_sd is not None]
    units = [test.stress_unit for test in study.experiment.tests]
    sizes = f"{', '.join(f'{value:g}' for value in values) or f'{study.settings.noise_sd:g}'} {units[0]}"
    if len({*units}) > 1:
        sizes = ", ".join(f"{value:g} {unit}" for value, unit in zip(values, units, strict=True))
    of_means = " of single measurements, of means that over the root of their number"
    return f"sd {sizes}{of_means * (study.experiment.averaged_at_most > 1)}"


def _ratios_of_tests(model: StatisticalModel) -> str:
    """Return what goes without saying of one test: in what ratios unknown noises of several are."""
    is_told = len(model.experiment.tests) > 1 and not model.noise.depends_on_level
    return ", of several tests in the proportions in which they scatter about smooth curves" * is_told


def errors_in_words(tolerances: Tolerances, unit: StressUnit) -> str:
    """Return the standard deviations of the errors of whole tests in words; empty if there are none."""
    texts = []
    for error, size in tolerances:
        value = f"{size / unit.to_mpa:.3g} {unit.name}" if error.is_stress else f"{size:.3g}"
        texts.append(f"{value} {error.description}")
    return ", ".join(texts)


def computed_section(
    posteriors: Mapping[str, Posterior],
    skipped: Mapping[str, str],
    *more: str,
    seconds: Mapping[str, float] | None = None,
) -> Section:
    """Return how posteriors were computed, under which priors, and what was not fitted, beside ``more`` paragraphs."""
    times = {name: f" It took {duration:.2f} s." for name, duration in (seconds or {}).items()}
    methods = tuple(
        f"**{name}**: {_method_of(posterior)}{times.get(name, '')}" for name, posterior in posteriors.items()
    )
    reasons = [f"Not fitted: {' '.join(f'{name} ({reason})' for name, reason in skipped.items())}"] * bool(skipped)
    return Section("How it was computed", (methods, PRIORS, *more, *reasons))


def _method_of(posterior: Posterior) -> str:
    """Return by which method a posterior was computed, how accurately, and whether it converged."""
    diagnostics, error = posterior.diagnostics, posterior.log_evidence_error
    text = f"method {posterior.method}. {posterior.how}."
    text += "" if error is None else f" Error of the log evidence: {error:.0e}."
    return text if diagnostics is None else f"{text} {diagnostics.verdict}"


def methods_section(study: SpecimenStudy) -> Section:
    """Return the text, of the discrepancy that answers: model, data, errors, priors, computation and result."""
    posterior, unit, tests = study.posteriors[study.main], study.unit, study.experiment.tests
    diagnostics = posterior.diagnostics
    count = "a test" if len(tests) == 1 else f"{len(tests)} tests"
    introduction = INTRODUCTION.format(
        law=LAW.format(posterior.model.material),
        version=version("tissuq"),
        data=f"{count}: {'; '.join(tests_in_words(study.experiment))}",
    )
    priors = ", ".join(
        f"{row['parameter']} {row['prior']}{' ' * bool(row['unit'])}{row['unit']}"
        for row in parameter_rows({study.main: posterior})
        if row["prior"] != FOLLOWS
    )
    derived = ", ".join(parameter.symbol for parameter in posterior.model.derived_parameters)
    sizes = errors_in_words(posterior.model.tolerances, unit)
    numbers = []
    for name, *values in study.answer.estimates:
        mean, low, high = (value / unit.to_mpa for value in values)
        sd = (high - low) / 4
        numbers.append(f"{name} {interval(mean, mean, sd)[0]} ({' to '.join(interval(low, high, sd))}) {unit.name}")
    sentences = (
        introduction,
        f"{study.experiment.source}." if study.experiment.source else "",
        discrepancy_in_words(posterior.model, study.main),
        f"Noise: {noise_in_words(study, posterior)}.",
        WHOLE_TESTS.format(sizes=sizes) if sizes else "",
        WITHOUT_LATERAL_STRESS.format(derived=derived) if derived else "",
        f"Priors: {priors}.",
        f"Computation: {posterior.how}.",
        "" if diagnostics is None else diagnostics.verdict,
        INTERVALS.format(meaning=posterior.model.meaning, numbers=", ".join(numbers)),
    )
    return Section(METHODS, (" ".join(filter(None, sentences)),))


def discrepancy_in_words(model: StatisticalModel, name: str) -> str:
    """Return of what the measured stress is taken to be the sum."""
    discrepancy = model.discrepancy
    if not discrepancy.parameters:
        return NO_DISCREPANCY
    if model.energy_symbols:
        return DISCREPANCY + ENERGY.format(name=name)
    return DISCREPANCY + other_form(discrepancy, name)


def other_form(discrepancy: Discrepancy, name: str) -> str:
    """Return what a discrepancy that is no energy is."""
    verb = "is a Gaussian process with the covariance" if discrepancy.is_correlated else "is"
    return f"The discrepancy {verb} {discrepancy.formula} ('{name}' of tissuq; {discrepancy.source})."
