"""The comparison of laws from a user's files: settings, and what comes of them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from tissuq.assessment.measurements import measurement_warnings
from tissuq.assessment.uses import MIN_OFTEN_STABLE
from tissuq.errors import InputError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.reading.experiment_file import Reading
from tissuq.experiments.units import StressUnit
from tissuq.mechanics import Material
from tissuq.mechanics.user_law import LAW
from tissuq.posterior.laws import ALL_LAWS, LawComparison, fit_laws
from tissuq.result_warning import ResultWarning, merged, most_severe_first
from tissuq.studies.fit_settings import LawSettings
from tissuq.studies.specimen import priors_in_mpa, shared_options, warnings_beside
from tissuq.studies.stream import open_pool

SIGNIFICANT_ERRORS = 2.0
"""Standard errors of a difference of elpd beyond which it counts."""
MIN_DIVIDED = 4
"""Laws from which starting processes takes less time than it saves."""


@dataclass(frozen=True)
class LawStudy:
    """Results of a comparison of laws.

    Attributes
    ----------
    settings : LawSettings
    experiment : Experiment
    comparison : LawComparison
    """

    settings: LawSettings
    experiment: Experiment
    comparison: LawComparison

    @property
    def unit(self) -> StressUnit:
        """The unit in which stresses are shown."""
        return self.experiment.shown_unit

    @property
    def skipped(self) -> Mapping[str, str]:
        """Laws that could not be fitted, and why."""
        return self.comparison.skipped

    @property
    def not_converged(self) -> list[str]:
        """Laws of which sampling has not converged."""
        return [name for name, posterior in self.comparison.fits.items() if posterior.solution.is_approximate]

    @property
    def close(self) -> list[str]:
        """The laws that predict left-out measurements as well as the best, the most probable first."""
        table = self.comparison.table_in("MPa")
        is_close = table.elpd_difference < SIGNIFICANT_ERRORS * table.elpd_difference_error
        return [str(name) for name in table.index[is_close | (table.elpd_difference == 0)]]

    @property
    def recommended(self) -> str:
        """The law to continue with.

        Of those that predict left-out measurements as well as the best it is the most probable one that is more often
        stable than not over the measured range, or the one that most probably is.
        """
        table = self.comparison.table_in("MPa").loc[self.close]
        stable = table[~(table.stable < MIN_OFTEN_STABLE)]
        return str(table.stable.idxmax() if stable.empty else stable.index[0])

    @property
    def warnings(self) -> list[ResultWarning]:
        """Warnings about data and fits, each once with the laws that it concerns, the severest first.

        Those of other laws than the recommended one are notes.
        """
        fits, law = self.comparison.fits, self.recommended
        of_fits = [*merged({law: fits[law].warnings_of_fit}, named=True), *warnings_beside(law, fits)]
        of_data = measurement_warnings(self.experiment)
        return most_severe_first([*of_data, *self.comparison.warnings_of_evidence, *of_fits])


def run_laws(
    settings: LawSettings,
    folder: Path = Path(),
    step: Callable[[str], None] = lambda text: None,
    own: Mapping[str, Material] | None = None,
    found: Sequence[Reading | None] = (),
    workers: int | None = 1,
) -> LawStudy:
    """Read the file, or those of several tests, and fit every chosen law.

    What has been read of every test may be given as ``found``.

    Settings may come from a file, so that laws of the user's own which they name are not run; these are given as
    ``own``, by the names in the settings. Laws are divided among so many ``workers``, processes on this machine, or
    where that is None one for each core from `MIN_DIVIDED` laws; beside a law in a file of the user, which other
    processes do not know, they are not divided.

    Raises
    ------
    InputError, ModelError, ConvergenceError
        When file or settings cannot be used, or a law that was named cannot be fitted.
    """
    experiment = settings.experiment(folder, found)
    (discrepancy,) = settings.discrepancies
    laws, is_all = settings.fitted_laws(own or {}), settings.laws == (ALL_LAWS,)
    one_a_core = 1 if len(laws) < MIN_DIVIDED else os.cpu_count() or 1
    processes = 1 if any(map(LAW.search, settings.laws)) else min(workers or one_a_core, len(laws))
    with _loss_in_words(), open_pool(processes) as pool:
        comparison = fit_laws(
            experiment,
            ALL_LAWS if is_all else list(laws.values()),
            discrepancy=discrepancy,
            priors=priors_in_mpa(settings, laws.values(), experiment),
            step=step,
            pool=pool,
            **shared_options(settings, experiment),
        )
    fitted_experiment = next(iter(comparison.fits.values())).model.experiment
    return LawStudy(settings, fitted_experiment, comparison)


@contextmanager
def _loss_in_words() -> Iterator[None]:
    """Say in words that a process was ended from outside."""
    try:
        yield
    except BrokenProcessPool as error:
        raise InputError(
            "a process that fitted laws was ended from outside, perhaps for want of memory: use fewer of them "
            "(--workers 1), or compare fewer laws (--material NAME, once for each)."
        ) from error
