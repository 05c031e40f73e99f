"""The study of measured files: a material fitted with each discrepancy, and each test predicted from the others."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from tissuq.assessment import Assessment, measurement_warnings
from tissuq.assessment.answer import Answer
from tissuq.assessment.evidence import warnings_of_evidence
from tissuq.assessment.stability import measured_states
from tissuq.errors import ConvergenceError, InputError, ModelError, TissuqError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.reading.experiment_file import Reading
from tissuq.experiments.reading.tests_in_file import measurements
from tissuq.experiments.units import StressUnit, stress_unit
from tissuq.mechanics import Material, material_named
from tissuq.model.discrepancy import (
    Auto,
    ConditionedProcess,
    EnergyDiscrepancy,
    discrepancies,
    discrepancy_named,
)
from tissuq.parameters.parameter import Parameter
from tissuq.parameters.priors import Prior, prior_from
from tissuq.posterior.fitting import fit
from tissuq.posterior.posterior import Posterior
from tissuq.prediction.scores import judged
from tissuq.result_warning import ResultWarning, Severity, merged, most_severe_first
from tissuq.studies.fit_settings import ALL, SpecimenSettings

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class SpecimenStudy:
    """Results of a fit: a posterior and an assessment for each discrepancy, and why others do not apply.

    Sampled posteriors are not assessed, which would sample them again.
    """

    settings: SpecimenSettings
    experiment: Experiment
    posteriors: dict[str, Posterior]
    seconds: dict[str, float]
    skipped: dict[str, str]
    assessments: dict[str, Assessment]
    held_out: tuple[dict[str, Any], ...] = ()
    """How each test is predicted from the others, if requested."""

    @property
    def unit(self) -> StressUnit:
        """The unit in which stresses are shown."""
        return self.experiment.shown_unit

    @property
    def warnings(self) -> list[ResultWarning]:
        """Warnings about data and fits, the severest first.

        Those of fits beside the one that answers stand once with their names, and are notes: they concern a comparison.
        """
        of_main, beside = self.posteriors[self.main].warnings_of_fit, warnings_beside(self.main, self.posteriors)
        of_evidence = warnings_of_evidence(
            {name: (fit.log_evidence, fit.log_evidence_error) for name, fit in self.posteriors.items()}
        )
        of_comparison = [warning.as_note() for warning in of_evidence]
        of_data = measurement_warnings(self.experiment)
        return most_severe_first([*of_data, *of_main, *of_comparison, *beside])

    @property
    def main(self) -> str:
        """The discrepancy whose posterior answers: the one that decides from the data, or the first."""
        return Auto.name if Auto.name in self.posteriors else next(iter(self.posteriors))

    @property
    def answer(self) -> Answer:
        """The answer of the main posterior."""
        return self.posteriors[self.main].answer

    @property
    def headline(self) -> str:
        """The parameter that summaries put first."""
        return next(iter(self.posteriors.values())).model.headline

    @property
    def not_converged(self) -> list[str]:
        """Discrepancies with which sampling has not converged."""
        return [name for name, posterior in self.posteriors.items() if posterior.solution.is_approximate]


def warnings_beside(answering: str, fits: Mapping[str, Posterior]) -> list[ResultWarning]:
    """Return the warnings of other fits than the one that answers, each once with their names: notes, but problems."""
    of_others = merged({name: fit.warnings_of_fit for name, fit in fits.items() if name != answering}, named=True)
    return [warning if warning.severity is Severity.PROBLEM else warning.as_note() for warning in of_others]


def steps_of(settings: SpecimenSettings) -> int:
    """Return the number of steps that `run_specimen` announces."""
    return len(_names(settings)) * (2 if settings.held_out else 1) + 1


def run_specimen(
    settings: SpecimenSettings,
    folder: Path = Path(),
    step: Callable[[str], None] = lambda text: None,
    law: Material | None = None,
    found: Sequence[Reading | None] = (),
    early: Callable[[SpecimenStudy], None] = lambda study: None,
) -> SpecimenStudy:
    """Read the file, or those of several tests, and fit the material with every chosen discrepancy.

    What has been read of every test may be given as ``found``. ``early`` is given the study when all is fitted and
    nothing is assessed yet: its answer is there.

    Settings may come from a file, so that a law of the user's own which they name is not run; it is given as ``law``.

    Raises
    ------
    InputError, ModelError, ConvergenceError
        When file or settings cannot be used. A discrepancy that cannot be fitted is an error when it was named, and
        is skipped with the reason when all were asked for.
    """
    experiment = settings.experiment(folder, found)
    (material,) = settings.fitted_laws({settings.material: law} if law else {}).values()
    is_all, names = settings.discrepancies == (ALL,), _names(settings)
    symbols = {name: parameters_of(settings, material, name, experiment) for name in names}
    priors_in_mpa(settings, [material], experiment)  # refuses those of no parameter
    posteriors, seconds, skipped = {}, {}, {}
    for name in names:
        step(name)
        start = perf_counter()
        parameter_names = {p.symbol for p in symbols[name]}
        if is_all and experiment.size < len(parameter_names):
            skipped[name] = (
                f"{experiment.size} measurements are too few for the parameters {', '.join(sorted(parameter_names))}."
            )
            continue
        try:
            options = _options(settings, material, symbols[name], experiment)
            posteriors[name] = fit(experiment, discrepancy=name, **options)
            seconds[name] = perf_counter() - start
        except (ConvergenceError, ModelError) as error:
            if not is_all:
                raise
            skipped[name] = str(error)
    if not posteriors:
        simplest, reason = next(iter(skipped.items()))
        raise ModelError(f"no discrepancy can be fitted, not even '{simplest}': {reason}")
    experiment = next(iter(posteriors.values())).model.experiment
    study = SpecimenStudy(settings, experiment, posteriors, seconds, skipped, {})
    early(study)
    step("assessing")
    assessments = {
        name: posterior.assess()
        for name, posterior in posteriors.items()
        if name != "none" and not posterior.diagnostics
    }
    held_out: list[dict[str, Any]] = []
    for name in posteriors if settings.held_out else ():
        step(f"{name}: each test predicted from the others")
        if discrepancy_named(name).adapted_to(material, experiment).parameters != discrepancy_named(name).parameters:
            skipped[f"{name}, each test predicted from the others"] = (
                "this discrepancy is a separate error of the stress in each test."
            )
            continue
        options = _options(settings, material, symbols[name], experiment)
        fitted = posteriors[name].model
        options |= {"tolerances": fitted.tolerances, "discrepancy": fitted.discrepancy}
        try:
            predictions = held_out_tests(experiment.tests, **options).to_dict("records")
        except TissuqError as error:
            skipped[f"{name}, each test predicted from the others"] = str(error)
            continue
        held_out += [
            {"formulation": name} | {str(key): None if value != value else value for key, value in row.items()}
            for row in predictions
        ]
    return replace(study, assessments=assessments, held_out=tuple(held_out))


def fitted(
    settings: SpecimenSettings, discrepancy: str, folder: Path = Path(), law: Material | None = None
) -> Posterior:
    """Return the posterior under one discrepancy of the measurements and the material of a study.

    Raises
    ------
    InputError, ModelError, ConvergenceError
        As `run_specimen`.
    """
    experiment = settings.experiment(folder)
    material = law or material_named(settings.material)
    parameters = parameters_of(settings, material, discrepancy, experiment)
    return fit(experiment, discrepancy=discrepancy, **_options(settings, material, parameters, experiment))


def _options(
    settings: SpecimenSettings, material: Material, parameters: Iterable[Parameter], experiment: Experiment
) -> dict[str, Any]:
    """Return the options of a fit but the discrepancy."""
    priors = _priors(settings, parameters, stress_unit(experiment.stress_unit))
    return {"material": material, "priors": priors, **shared_options(settings, experiment)}


def shared_options(settings: SpecimenSettings, experiment: Experiment) -> dict[str, Any]:
    """Return the options of a fit that do not depend on material and discrepancy."""
    stated = {name: getattr(settings, name) for name in ("method", "stable_in", "seed")}
    units = [stress_unit(test.stress_unit) for test in experiment.tests]
    return {"noise": settings.noise_in(*units), "tolerances": settings.tolerances_in(units[0]), **stated}


def _names(settings: SpecimenSettings) -> list[str]:
    """Return the discrepancies that are asked for."""
    return _every() if settings.discrepancies == (ALL,) else list(dict.fromkeys(settings.discrepancies))


def _every() -> list[str]:
    excluded = EnergyDiscrepancy, ConditionedProcess
    return [name for name, kind in discrepancies().items() if kind is Auto or not issubclass(kind, excluded)]


def parameters_of(
    settings: SpecimenSettings, material: Material, discrepancy: str, experiment: Experiment
) -> tuple[Parameter, ...]:
    """Return the parameters of a fit: of the material, the discrepancy and the noise."""
    noise = settings.noise_in(stress_unit("MPa")).parameters
    error_model = discrepancy_named(discrepancy)
    with suppress(ModelError):  # which the fit itself raises
        error_model = error_model.adapted_to(material, experiment)
    return (*material.parameters, *error_model.parameters, *noise)


def priors_in_mpa(settings: SpecimenSettings, laws: Iterable[Material], experiment: Experiment) -> Mapping[str, Prior]:
    """Return the chosen priors in MPa and stretch.

    Raises
    ------
    InputError
        When there is one of a parameter that no fit has.
    """
    of_fits = (parameters_of(settings, law, name, experiment) for law in laws for name in _names(settings))
    parameters = list(chain.from_iterable(of_fits))
    symbols = dict.fromkeys(parameter.symbol for parameter in parameters)
    if unknown := sorted(settings.priors.keys() - symbols.keys()):
        raise InputError(
            f"there is a prior for '{unknown[0]}', but the parameters of this fit are {', '.join(symbols)}."
        )
    return _priors(settings, parameters, stress_unit(experiment.stress_unit))


def _priors(settings: SpecimenSettings, parameters: Iterable[Parameter], unit: StressUnit) -> dict[str, Prior]:
    """Return those of the chosen priors that are of some parameters, from a unit of stress in MPa and stretch."""
    scales = {p.symbol: unit.to_mpa if p.unit else 1.0 for p in parameters}
    chosen = {symbol: prior for symbol, prior in settings.priors.items() if symbol in scales}
    return {symbol: prior_from(prior).scaled(scales[symbol]) for symbol, prior in chosen.items()}


def held_out_tests(tests: Sequence[Experiment] | Experiment, **options: Any) -> pd.DataFrame:
    """Predict every test from a fit of the others.

    Parameters
    ----------
    tests : sequence of Experiment, or an Experiment of several tests
        Two or more, in any modes.
    options
        Those of `tissuq.fit`; noise of each test is not taken.

    Returns
    -------
    pandas.DataFrame
        One row a test, as `prediction_of` describes it, and median and 95 % interval of the headline parameter from the
        others; stresses, scores included, in MPa.

    Raises
    ------
    InputError
        When there are fewer than two tests.

    Examples
    --------
    >>> import tissuq as tq
    >>> stretch = [1.05, 1.1, 1.15, 1.2, 1.25, 1.3, 1.35, 1.4]
    >>> modes = ["uniaxial", "planar", "equibiaxial"]
    >>> tests = [tq.simulate("neo-hookean", {"C10": 0.5}, stretch, 0.01, mode=mode, seed=2) for mode in modes]
    >>> found = tq.held_out_tests(tests, discrepancy="none", noise_sd=0.01)
    >>> bool(found["inside"].min() > 0.8)
    True
    """
    import pandas as pd

    tests = tests if isinstance(tests, list | tuple) else measurements(tests).tests
    if len(tests) < 2:
        raise InputError("predicting a test from the others needs two or more tests.")
    if isinstance(options.get("noise_sd"), Sequence) and not isinstance(options["noise_sd"], str):
        raise InputError("to predict a test from the others give one noise_sd for all tests, or leave it unknown.")
    if isinstance(options.get("tolerances"), Mapping | None):  # those of all tests, of which one alone has none
        model = fit(tests, **options).model
        options |= {"tolerances": model.tolerances, "discrepancy": model.discrepancy}
    rows = []
    for index, test in enumerate(tests):
        posterior = fit([training_test for number, training_test in enumerate(tests) if number != index], **options)
        headline = posterior.summary(parameters=[posterior.model.headline], unit="MPa").iloc[0]
        estimates = {f"{posterior.model.headline}_{name}": headline[name] for name in ("median", "hdi_low", "hdi_high")}
        rows += [row | estimates for row in prediction_of(posterior, test)]
    return pd.DataFrame(rows)


def prediction_of(posterior: Posterior, test: Experiment) -> list[dict[str, Any]]:
    """Return how a posterior predicts a test that it has not seen, a row for each of its stresses.

    Returns
    -------
    list of dict
        test, mode, measured; ``inside``, the share of measurements in the predictive band; ``beyond``, the share of
        them whose state is beyond those in the data of the posterior; and of the others the further
        scores of `tissuq.prediction.scores.Judged.summary`. Measurements without stress are left out, and the band is
        that of a new test with an error of its own.
    """
    measured, rows = measured_states(posterior.model, is_directed=posterior.solution.is_directed), []
    for curve in test.curves:
        judged_all = judged(posterior.solution, curve)
        calibrated = measured.contain(curve.path.at(judged_all.points))
        labels: dict[str, Any] = {"test": curve.name, "mode": curve.mode.name, "measured": curve.quantity}
        shares = {"inside": float(judged_all.is_inside.mean()), "beyond": float(1 - calibrated.mean())}
        rows.append(labels | judged_all.where(calibrated).summary() | shares)
    return rows
