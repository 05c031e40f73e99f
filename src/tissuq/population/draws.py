"""The draws of a population, what they are made from, effects of covariates, and all as labelled arrays."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.experiments.checked_arrays import headed
from tissuq.experiments.units import StressUnit, stress_unit
from tissuq.parameters.checks import check_probability
from tissuq.population.covariates import Covariates, covariates_of
from tissuq.population.likelihoods import Coordinates
from tissuq.posterior.netcdf import LabelledGroup
from tissuq.posterior.posterior import Posterior

if TYPE_CHECKING:
    import pandas as pd

    from tissuq.population.hierarchy import Hierarchy

INTERVAL_COLUMNS = ["median", "hdi_low", "hdi_high"]
"""What `interval` returns, as tables of a population have it."""
ALL_COVARIATES = "all covariates"
"""In place of a covariate, of the share that they explain together."""


class PopulationDraws:
    """Separate fits of specimens, their fit as one specimen, and draws of the population with every specimen in it.

    Attributes
    ----------
    posteriors : dict of str to Posterior
        Separate fit of every specimen: no pooling.
    complete : Posterior
        The measurements of all specimens taken as those of one specimen: complete pooling.
    coordinates : Coordinates
        The pooled parameters and their form: logarithms of positive ones.
    hierarchy : Hierarchy
        Draws of the population and of the specimens within it, in these coordinates: partial pooling.
    spread_prior : float
        Sd of the half-normal prior of the spreads on the line.
    seed : int
    covariates : Covariates
        What is known of the specimens beside their tests.
    patient_covariates : dict of str to object
        What is known of the new patient; the other covariates are at the mean of the specimens (numbers) or at the
        reference level (words), as they are for the median of the population.
    shared_covariance : (d, d) array, optional
        Covariance, on the line, of the bias in the draws by a discrepancy that all specimens share; None where these
        have their own.
    """

    def __init__(
        self,
        posteriors: Mapping[str, Posterior],
        complete: Posterior,
        coordinates: Coordinates,
        hierarchy: Hierarchy,
        spread_prior: float,
        seed: int,
        covariates: Covariates | None = None,
        patient_covariates: Mapping[str, Any] = MappingProxyType({}),
        shared_covariance: FloatArray | None = None,
    ) -> None:
        self.posteriors, self.complete = dict(posteriors), complete
        self.coordinates, self.hierarchy, self.spread_prior, self.seed = coordinates, hierarchy, spread_prior, seed
        self.covariates = covariates or covariates_of(None, tuple(posteriors))
        self.patient_covariates, self.shared_covariance = dict(patient_covariates), shared_covariance

    @property
    def symbols(self) -> tuple[str, ...]:
        """The pooled parameters."""
        return self.coordinates.symbols

    @property
    def names(self) -> tuple[str, ...]:
        """The specimens."""
        return tuple(self.posteriors)

    @property
    def median(self) -> FloatArray:
        """Draws (chains, draws, d) of the population's median of every parameter."""
        return self.coordinates.from_line(self.hierarchy.mean)

    @property
    def spread(self) -> FloatArray:
        """Draws (chains, draws, d) of the spread between specimens: sd of the logarithm, or of the parameter itself."""
        return self.hierarchy.tau * self.coordinates.scale

    @property
    def specimens(self) -> FloatArray:
        """Draws (chains, draws, I, d) of every specimen's parameters, given the data of all."""
        return self.coordinates.from_line(self.hierarchy.specimens)

    @cached_property
    def new(self) -> FloatArray:
        """Draws (chains, draws, d) of a new patient's parameters."""
        columns = self.covariates.row(self.patient_covariates)
        return self.coordinates.from_line(self.hierarchy.new(np.random.default_rng([self.seed, 5]), columns))

    @property
    def explained_share(self) -> FloatArray:
        """Draws (chains, draws, d) of the share of the variance between specimens that covariates explain.

        It is that of B x_i over the specimens, over its sum with tau squared (Gelman & Pardoe 2006).
        """
        explained = np.einsum("ik,cdkj->cdij", self.covariates.design, self.hierarchy.effects).var(axis=2)
        return np.asarray(explained / (explained + self.hierarchy.tau**2))

    def unit(self, name: str | None = None) -> StressUnit:
        """Return the unit of stress of that name, or that of the measurements; MPa where theirs differ."""
        units = {posterior.unit().name for posterior in self.posteriors.values()}
        return stress_unit(name or (units.pop() if len(units) == 1 else "MPa"))

    def unit_of(self, symbol: str, unit: StressUnit) -> StressUnit:
        """Return the unit of a parameter where stresses are in a unit: that one, or none of a plain number."""
        parameters = self.complete.model.parameters
        return unit if next(p for p in parameters if p.symbol == symbol).unit else StressUnit("", 1.0)

    def summary(self, prob: float = 0.95, unit: str | None = None) -> pd.DataFrame:
        """Return median and interval of every pooled parameter, by partial and by complete pooling.

        Parameters
        ----------
        prob : float
            Probability inside the intervals.
        unit : str, optional
            Unit of stress; that of the measurements unless given, MPa where theirs differ.

        Returns
        -------
        pandas.DataFrame
            Indexed by parameter and quantity: ``median`` (of the population; with covariates at the mean of numbers and
            at reference levels, also where those of the new specimen are given), ``spread`` (between specimens: sd of
            the logarithm, or of a parameter of either sign itself), ``new specimen``, and ``complete pooling``, whose
            interval is one for specimens that were all the same: it is no range of patients. Columns median, hdi_low
            and hdi_high; the unit of stresses stands at their head.
        """
        import pandas as pd

        check_probability(prob)
        rows = {}
        for index, (symbol, is_log) in enumerate(zip(self.symbols, self.coordinates.is_log, strict=True)):
            factor = self.unit_of(symbol, self.unit(unit)).to_mpa
            for name, draws in (("median", self.median), ("spread", self.spread), ("new specimen", self.new)):
                is_ratio = name == "spread" and is_log
                rows[symbol, name] = np.array(interval(draws[..., index], prob)) / (1.0 if is_ratio else factor)
            marginal = self.complete.marginals[symbol]
            rows[symbol, "complete pooling"] = np.array([marginal.quantile(0.5), *marginal.hdi(prob)]) / factor
        index_of_rows = pd.MultiIndex.from_tuples(rows, names=["parameter", "quantity"])
        return headed(pd.DataFrame(list(rows.values()), index_of_rows, INTERVAL_COLUMNS), self.unit(unit))


def interval(draws: FloatArray, prob: float) -> tuple[float, float, float]:
    """Return the median of draws and the ends of the shortest interval that holds a share of them."""
    values = np.sort(draws, axis=None)
    count = round(prob * len(values))
    start = int((values[count:] - values[: len(values) - count]).argmin())
    return float(np.median(values)), float(values[start]), float(values[start + count])


def effect_table(population: PopulationDraws, prob: float, unit: StressUnit) -> pd.DataFrame:
    """Return `Population.effects`, differences of stresses in a unit."""
    import pandas as pd

    covariates, coordinates = population.covariates, population.coordinates
    slopes = population.hierarchy.effects / covariates.sizes[:, None]
    rows: dict[tuple[str, str], list[Any]] = {}
    for j, (symbol, is_log) in enumerate(zip(population.symbols, coordinates.is_log, strict=True)):
        scale = coordinates.scale[j] / population.unit_of(symbol, unit).to_mpa
        for k, (name, per) in enumerate(covariates.effects):
            draws = np.exp(slopes[..., k, j]) if is_log else slopes[..., k, j] * scale
            positive = float((slopes[..., k, j] > 0).mean())
            rows[symbol, name] = ["factor" if is_log else "difference", per, *interval(draws, prob), positive]
        if covariates:
            share = interval(population.explained_share[..., j], prob)
            rows[symbol, ALL_COVARIATES] = ["share", "of the variance", *share, np.nan]
    index = pd.MultiIndex.from_tuples(rows, names=["parameter", "covariate"]) if rows else None
    table = pd.DataFrame(list(rows.values()), index, ["kind", "per", *INTERVAL_COLUMNS, "positive"])
    return headed(table, unit)


def labelled_arrays(population: PopulationDraws, labels: Mapping[str, str | float]) -> dict[str, LabelledGroup]:
    """Return draws and data of a population, with the names of specimens and parameters, and further attributes."""
    coordinates, hierarchy, covariates = population.coordinates, population.hierarchy, population.covariates
    symbols, posteriors = list(population.symbols), population.posteriors.values()
    chains, draws = hierarchy.mean.shape[:2]
    sample = {"chain": np.arange(chains), "draw": np.arange(draws)}
    parameter, specimen = {"parameter": symbols}, {"specimen": list(population.names)}
    by_parameter, by_pair = ("chain", "draw", "parameter"), ("chain", "draw", "parameter", "other_parameter")
    of_specimen = ("chain", "draw", "specimen", "parameter")
    no_pooling = np.stack([_drawn(posterior, symbols, (chains, draws)) for posterior in posteriors], axis=2)
    complete_pooling = _drawn(population.complete, symbols, (chains, draws))
    data = [posterior.model.experiment for posterior in posteriors]
    columns = {"covariate": [name for name, _ in covariates.effects]} if covariates else {}
    arrays: dict[str, Any] = {
        "median": (by_parameter, population.median),
        "spread": (by_parameter, population.spread),
        "correlation": (by_pair, hierarchy.correlation),
        "specimens": (of_specimen, population.specimens),
    }
    if covariates:
        effects = hierarchy.effects / covariates.sizes[:, None] * coordinates.scale
        arrays["effect"] = (("chain", "draw", "covariate", "parameter"), effects)
    groups = {
        "/": LabelledGroup(attrs=_labels(population) | dict(labels)),
        "posterior": LabelledGroup(arrays, sample | parameter | specimen | {"other_parameter": symbols} | columns),
        "new_patient": LabelledGroup({"parameters": (by_parameter, population.new)}, sample | parameter),
        "no_pooling": LabelledGroup({"specimens": (of_specimen, no_pooling)}, sample | parameter | specimen),
        "complete_pooling": LabelledGroup({"parameters": (by_parameter, complete_pooling)}, sample | parameter),
        "observed_data": LabelledGroup(
            {"stress": ("measurement", np.concatenate([test.measured for test in data]), {"units": "MPa"})}
        ),
        "constant_data": LabelledGroup(
            {
                "stretch": ("measurement", np.concatenate([test.states.abscissa for test in data])),
                "specimen": ("measurement", np.repeat(np.arange(len(data)), [test.size for test in data])),
                "mode": (
                    "measurement",
                    [curve.mode.name for test in data for curve in test.curves for _ in range(len(curve))],
                ),
            }
        ),
    }
    if covariates:
        design = (("specimen", "covariate"), covariates.design)
        groups["covariates"] = LabelledGroup({"design": design}, columns | specimen)
    return groups


def _labels(population: PopulationDraws) -> dict[str, str | float]:
    model, diagnostics = population.complete.model, population.hierarchy.diagnostics
    return {
        "inference_library": "tissuq",
        "material": model.material.name,
        "discrepancy": model.discrepancy.name,
        "noise": str(model.noise),
        "loading_mode": ", ".join(mode.name for mode in model.experiment.modes),
        "stress_unit": model.experiment.stress_unit,
        "logarithms": ", ".join(np.array(population.symbols)[population.coordinates.is_log]),
        "verdict": diagnostics.verdict,
        "effective": population.hierarchy.effective,
        "spread_prior": f"half-normal({population.spread_prior:g})",
        "seed": population.seed,
    }


def _drawn(posterior: Posterior, symbols: list[str], shape: tuple[int, int]) -> FloatArray:
    """Return draws (chains, draws, d) of a posterior, evenly thinned from its own."""
    draws = np.column_stack([posterior.solution.draws[symbol].ravel() for symbol in symbols])
    rows = np.linspace(0, len(draws) - 1, shape[0] * shape[1]).round().astype(int)
    return np.asarray(draws[rows].reshape(*shape, len(symbols)))
