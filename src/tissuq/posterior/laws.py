"""Which law: several materials fitted to the same tests with the same discrepancy, side by side and averaged."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from concurrent.futures import Executor, as_completed
from contextlib import closing, suppress
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property, partial
from time import perf_counter
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike

from tissuq.assessment.evidence import warnings_of_evidence
from tissuq.assessment.shares import shares_of_discrepancy
from tissuq.assessment.stability import stable_ranges
from tissuq.drawing.panels import panels
from tissuq.errors import ConvergenceError, InputError, ModelError
from tissuq.experiments.checked_arrays import in_unit
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import LoadingMode
from tissuq.experiments.reading.options import PythonOptions
from tissuq.experiments.reading.tests_in_file import measurements
from tissuq.experiments.units import stress_unit
from tissuq.inference.marginal import Marginal, blended
from tissuq.mechanics import Material, material_named
from tissuq.mechanics.material import materials
from tissuq.parameters.checks import one_or_several
from tissuq.pictures.parameters import intervals
from tissuq.posterior.fitting import OPTIONS, fit
from tissuq.posterior.least_squares import LeastSquares, least_squares
from tissuq.posterior.plots import ROW
from tissuq.posterior.posterior import Posterior
from tissuq.prediction.bands import predict_bands
from tissuq.result_warning import ResultWarning

if TYPE_CHECKING:
    import pandas as pd

ALL_LAWS = "all"
"""In place of names: every law that is the same in all directions."""
WITHOUT_EVIDENCE = ("nuts", "joint")
"""Methods that do not say how probable the data are under a law."""
BEYOND_FACTOR = 1.5
"""Of the largest measured I1 - 3 and I2 - 3, up to which stability is looked at beyond the measurements."""
NEGLIGIBLE_PROBABILITY = 1e-4
"""Of a law that is left out of averages."""


@dataclass(frozen=True, eq=False)
class LawFit:
    """One law fitted to the tests, and what is said of it.

    Attributes
    ----------
    posterior : Posterior
        Of the law with the discrepancy.
    alone : LeastSquares or None
        How near the law comes to the measurements by itself; None where it has no stress at some of them.
    row : mapping of str to number
        Of the law in the table of all.
    """

    posterior: Posterior
    alone: LeastSquares | None
    row: Mapping[str, Any]

    @classmethod
    def of(cls, data: Experiment, law: Material, priors: Mapping[str, Any], options: Mapping[str, Any]) -> LawFit:
        """Fit a law to tests."""
        start = perf_counter()
        fitted = fit(data, material=law, priors=priors, **options)
        posterior = replace(fitted, solution=copy(fitted.solution))  # without what it was computed from
        seconds, best_fit = perf_counter() - start, None
        with suppress(ModelError):
            best_fit = least_squares(data, law, posterior.model.priors)
        row = _row(posterior, best_fit) | {"seconds": seconds}
        # What every comparison asks for, computed while laws are fitted side by side.
        _ = posterior.left_out, posterior.warnings
        return cls(posterior, best_fit, row)


@dataclass(frozen=True, eq=False)
class LawComparison:
    """Fits of several laws to the same tests.

    Attributes
    ----------
    laws : mapping of str to LawFit
        By the name of the law.
    skipped : mapping of str to str
        Laws that could not be fitted, and why.
    """

    laws: Mapping[str, LawFit]
    skipped: Mapping[str, str]

    def __repr__(self) -> str:
        return f"<LawComparison of {', '.join(self.laws)}>"

    @property
    def fits(self) -> dict[str, Posterior]:
        """The posterior of every law, with the discrepancy."""
        return {name: law.posterior for name, law in self.laws.items()}

    @property
    def alone(self) -> dict[str, LeastSquares]:
        """How near each law comes to the measurements by itself, of those that have a stress at all of them."""
        return {name: law.alone for name, law in self.laws.items() if law.alone is not None}

    @property
    def table(self) -> pd.DataFrame:
        """The laws side by side, the most probable first, with moduli in the unit of the measurements.

        - parameters: number of parameters of the law.
        - log_evidence, log_evidence_error; probability of the law, were all as probable before the data.
        - elpd: expected log density of new measurements, each left out in turn; elpd_difference: by how much it falls
          short of the best, and the standard error of that.
        - r_squared, nrmse: of the law by itself, fitted by least squares; the root mean square error is over the root
          mean square of the measured stress. Missing where it has no stress at some measurement.
        - discrepancy_share, _low, _high: the part of the stress that the discrepancy carries: mean and 95 % interval.
        - stable, stable_beyond: probability of stability over the range of the invariants that was measured, and up to
          1.5 times these; in the least stable loading mode. Missing where the energy does not tell.
        - modulus, modulus_low, modulus_high: mean and 95 % HDI of the law's initial shear modulus.
        - seconds: how long the fit took.

        The unit of the moduli stands at the head of the columns; `table_in` gives another one.
        """
        return self.table_in(self._unit)

    def table_in(self, unit: str) -> pd.DataFrame:
        """Return `table` with moduli in a unit of stress, such as ``"MPa"``.

        Raises
        ------
        InputError
            When it is none.
        """
        return in_unit(self._table, ["modulus", "modulus_low", "modulus_high"], unit)

    @property
    def _unit(self) -> str:
        """The unit of stress of the measurements."""
        return next(iter(self.fits.values())).unit().name

    @cached_property
    def _table(self) -> pd.DataFrame:
        """The laws side by side, moduli in MPa."""
        import pandas as pd

        table = pd.DataFrame([law.row for law in self.laws.values()], list(self.laws))
        table.insert(3, "probability", [self.probabilities[name] for name in self.laws])
        densities = [law.posterior.left_out.log_density for law in self.laws.values()]
        best = max(densities, key=np.sum)
        differences = [best - density for density in densities]
        table.insert(4, "elpd", [float(density.sum()) for density in densities])
        table.insert(5, "elpd_difference", [float(difference.sum()) for difference in differences])
        errors = [float(np.sqrt(len(difference)) * difference.std()) for difference in differences]
        table.insert(6, "elpd_difference_error", errors)
        return table.sort_values("log_evidence", ascending=False)

    @cached_property
    def probabilities(self) -> Mapping[str, float]:
        """The posterior probability of each law, were all as probable before the data; they sum to one.

        Raises
        ------
        InputError
            When none has an evidence.
        """
        log_evidences = {name: posterior.log_evidence for name, posterior in self.fits.items()}
        evidences = np.array([np.nan if evidence is None else evidence for evidence in log_evidences.values()])
        if np.isnan(evidences).all():
            raise InputError("no fit has an evidence, by which laws are weighted: use the method 'auto' or 'exact'.")
        weights = np.nan_to_num(np.exp(evidences - np.nanmax(evidences)))
        return dict(zip(log_evidences, (weights / weights.sum()).tolist(), strict=True))

    @property
    def warnings_of_evidence(self) -> tuple[ResultWarning, ...]:
        """The warning that errors of the integration may order the laws, if they may."""
        return warnings_of_evidence(
            {name: (fit.log_evidence, fit.log_evidence_error) for name, fit in self.fits.items()}
        )

    @cached_property
    def modulus(self) -> Marginal:
        """The initial shear modulus, MPa: the mixture of the laws' posteriors by their probabilities."""
        likely = [(weight, self._moduli[name]) for name, weight in self._likely.items()]
        return blended(likely, (-np.inf, np.inf))

    @property
    def between(self) -> float:
        """The share of the modulus's variance that is between the laws."""
        means = np.array([self._moduli[name].mean for name in self._likely])
        weights = np.array(list(self._likely.values()))
        return float(weights @ (means - weights @ means) ** 2 / self.modulus.sd**2)

    def predict(
        self, stretch: ArrayLike, *, mode: str | LoadingMode | None = None, prob: float = 0.95, noise: bool = True
    ) -> pd.DataFrame:
        """Return median, low and high of the stress, averaged over the laws by their probabilities.

        Parameters are those of `Posterior.predict`; stresses are in the unit of the measurements.
        """
        import pandas as pd

        weighted = [(weight, self.fits[name].solution) for name, weight in self._likely.items()]
        (band,) = predict_bands(weighted, stretch, (noise,), mode=mode, prob=prob)
        table = pd.DataFrame(vars(band))
        return in_unit(table, ["median", "low", "high"], self._unit)

    def plot(self, ax: Any = None, *, unit: str | None = None) -> Any:
        """Draw the initial shear modulus of every law, the most probable on top, and their average.

        Bars are 95 % highest-density intervals, and the law's probability stands beside its name.

        Parameters
        ----------
        ax : Axes, optional
            Unless given, a new figure is made in `matplotlib.pyplot`.
        unit : str, optional
            Of the modulus; that of the measurements, unless given.

        Returns
        -------
        Axes
        """
        shown = stress_unit(unit or self._unit)
        named = {f"{name} ({_percent(self.probabilities[name])})": self._moduli[name] for name in self._in_order}
        with panels(ax, 1, height=ROW * (len(named) + 1) + 0.3) as drawn:
            intervals(drawn.axes[0], named, self.modulus, f"initial shear modulus [{shown.name}]", shown.to_mpa)
        return drawn.result

    def _repr_html_(self) -> str:
        """Return probability and modulus of every law as a table, which notebooks show; `table` has all else."""
        import pandas as pd

        rows = []
        for name in self._in_order:
            modulus = self._moduli[name]
            low, high = modulus.hdi()
            rows.append((self.probabilities[name], modulus.mean, low, high))
        columns = ["probability", "modulus", "modulus_low", "modulus_high"]
        table = in_unit(pd.DataFrame(rows, self._in_order, columns), columns[1:], self._unit)
        return str(table.to_html(float_format="{:.4g}".format))

    @property
    def _in_order(self) -> list[str]:
        """The laws, the most probable first."""
        return sorted(self.fits, key=lambda name: -self.probabilities[name])

    @property
    def _moduli(self) -> Mapping[str, Marginal]:
        """The initial shear modulus of each law, MPa."""
        return {name: law.posterior.initial_shear_modulus for name, law in self.laws.items()}

    @property
    def _likely(self) -> Mapping[str, float]:
        """The laws that are probable at all, with weights that sum to one."""
        likely = {name: p for name, p in self.probabilities.items() if p > NEGLIGIBLE_PROBABILITY}
        return {name: p / sum(likely.values()) for name, p in likely.items()}


def fit_laws(
    experiment: Any,
    laws: str | Sequence[str | Material] = ALL_LAWS,
    *,
    priors: Mapping[str, Any] | None = None,
    step: Callable[[str], None] = lambda name: None,
    pool: Executor | None = None,
    **options: Any,
) -> LawComparison:
    """Fit several laws to the same tests, with the same discrepancy and noise.

    Parameters
    ----------
    experiment : Experiment, str, path or table, or sequence of these
        As of `tissuq.fit`.
    laws : str or sequence of str or Material
        ``"all"``: every law that is the same in all directions; or names, as `tissuq.fit` takes them, or laws.
    priors : mapping of str to Prior, optional
        By parameter; a law takes those of its own.
    step : callable
        Is told the name of each law before it is fitted, or how many of those in the pool are done.
    pool : Executor, optional
        Processes among which the laws are divided, such as ``concurrent.futures.ProcessPoolExecutor(2)``; laws and
        options must then be such as can be sent to them.
    options
        As of `tissuq.fit`.

    Returns
    -------
    LawComparison
        Of ``"all"``, laws that cannot be fitted are in its ``skipped``.

    Raises
    ------
    InputError, ModelError, ConvergenceError
        When a law that was named cannot be fitted, or of all none; or a prior is of no law.

    Examples
    --------
    >>> import numpy as np
    >>> import tissuq as tq
    >>> stretch = np.linspace(0.7, 1.8, 20)
    >>> data = tq.simulate("mooney-rivlin", {"C10": 0.5, "C01": 0.1}, stretch, noise_sd=0.02, seed=1)
    >>> found = tq.fit_laws(data, ["neo-hookean", "mooney-rivlin"], discrepancy="none", noise_sd=0.02)
    >>> found.table.index[0]
    'mooney-rivlin'
    >>> low, high = found.modulus.hdi()
    >>> bool(low < 1.2 < high)
    True
    """
    if (method := options.get("method")) in WITHOUT_EVIDENCE:
        raise InputError(f"the method '{method}' gives no evidence, by which laws are weighted: use 'auto' or 'exact'.")
    reading = {name: options.pop(name) for name in [*options] if name in PythonOptions.__annotations__}
    data = measurements(experiment, OPTIONS, **cast(PythonOptions, reading))
    candidates, is_all = laws_named(laws), laws == ALL_LAWS
    symbols, skipped = {p.symbol for law in candidates.values() for p in law.parameters}, dict[str, str]()
    tasks = dict[str, Callable[[], LawFit]]()
    for name, law in candidates.items():
        foreign_symbols = symbols - {parameter.symbol for parameter in law.parameters}
        chosen_priors = {symbol: prior for symbol, prior in (priors or {}).items() if symbol not in foreign_symbols}
        tasks[name] = partial(LawFit.of, data, law, chosen_priors, options)
    fits = dict[str, LawFit]()
    with closing(_carried_out(tasks, step, pool)) as results:
        for name, result in results:
            try:
                fits[name] = result()
            except (ConvergenceError, ModelError, InputError) as error:
                if not is_all or (not fits and isinstance(error, InputError)):
                    raise
                skipped[name] = str(error)
    fits = {name: fits[name] for name in tasks if name in fits}
    skipped = {name: skipped[name] for name in tasks if name in skipped}
    if not fits:
        name, reason = next(iter(skipped.items()))
        raise ModelError(f"no law can be fitted, not even '{name}': {reason}")
    return LawComparison(fits, skipped)


def _carried_out(
    tasks: dict[str, Callable[[], LawFit]], step: Callable[[str], None], pool: Executor | None
) -> Generator[tuple[str, Callable[[], LawFit]]]:
    """Yield what gives the fit of every law or raises why there is none, in a pool those first that are done."""
    if pool is None:
        for number, (name, task) in enumerate(tasks.items(), 1):
            step(f"law {number} of {len(tasks)}: {name}")
            yield name, task
        return
    names = {pool.submit(tasks[name]): name for name in reversed(tasks)}  # those of most parameters take longest
    step(f"0 of {len(names)} laws")
    try:
        for done, future in enumerate(as_completed(names), 1):
            step(f"{done} of {len(names)} laws")
            yield names[future], future.result
    finally:
        for future in names:
            future.cancel()


def _row(posterior: Posterior, best_fit: LeastSquares | None) -> dict[str, Any]:
    """Return what a table says of a law, moduli in MPa."""
    share, _ = shares_of_discrepancy(posterior.solution)
    modulus = posterior.initial_shear_modulus
    stable = [of_mode.probability for of_mode in posterior.stable_ranges.values()]
    ranges_beyond = stable_ranges(posterior.solution, BEYOND_FACTOR).values()
    return {
        "parameters": len(posterior.model.material.parameters),
        "log_evidence": np.nan if posterior.log_evidence is None else posterior.log_evidence,
        "log_evidence_error": np.nan if posterior.log_evidence_error is None else posterior.log_evidence_error,
        "r_squared": np.nan if best_fit is None else best_fit.r_squared,
        "nrmse": np.nan if best_fit is None else best_fit.nrmse,
        **dict(zip(("discrepancy_share", "discrepancy_share_low", "discrepancy_share_high"), share, strict=True)),
        "stable": min(stable, default=np.nan),
        "stable_beyond": min((of_mode.probability for of_mode in ranges_beyond), default=np.nan),
        "modulus": modulus.mean,
        **dict(zip(("modulus_low", "modulus_high"), modulus.hdi(), strict=True)),
    }


def _percent(share: float) -> str:
    return "< 0.1 %" if share < 0.001 else f"{100 * share:.{int(share < 0.1)}f} %"


LAWS = "laws must be 'all', or names of materials, such as 'yeoh', or objects of tissuq.Material"
"""What may be compared."""


def laws_named(laws: str | Sequence[str | Material]) -> dict[str, Material]:
    """Return laws by their names, those with few parameters first where all are asked for.

    Raises
    ------
    InputError, ModelError
        When there is no such law, or one is named twice.
    """
    if laws == ALL_LAWS:
        all_laws = [kind() for kind in materials().values()]
        return {law.name: law for law in sorted(all_laws, key=lambda law: len(law.parameters)) if law.is_isotropic}
    named_laws = list(map(material_named, one_or_several(laws, (str, Material), LAWS)))
    if not named_laws:
        raise InputError(f"{LAWS}, and one at least.")
    by_name = {law.name: law for law in named_laws}
    if len(by_name) < len(named_laws):
        raise InputError("a law is named twice: name each of the laws once.")
    return by_name
