"""Simulation-based calibration: whether posteriors are what their priors and the data make them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator, model_validator

from tissuq.arrays import FloatArray
from tissuq.errors import TissuqError
from tissuq.experiments.experiment import Experiment
from tissuq.inference.marginal import Marginal
from tissuq.mechanics import material_named
from tissuq.model.discrepancy import discrepancy_named
from tissuq.model.prior_draws import draw_from_prior
from tissuq.model.scales import default_prior
from tissuq.model.statistical_model import StatisticalModel
from tissuq.parameters.priors import Flat, HalfCauchy, Normal, Prior, Uniform, prior_from
from tissuq.studies.campaign_settings import SbcOptions, each_once
from tissuq.studies.stream import Campaign, TaskOfFields
from tissuq.validation.coverage.fitted import fit_all, model_of, parameters_of
from tissuq.validation.coverage.settings import BLOCK, Design

if TYPE_CHECKING:
    import pandas as pd

PRIORS: dict[str, Prior] = {
    "C10": Uniform(0.5, 1.5),
    **{symbol: Normal(0, 0.3) for symbol in ("m0", "m1", "m2", "C01")},
    "C20": Normal(0, 0.2),
    "C30": Normal(0, 0.1),
    "S": Uniform(0, 0.5),
    "c": Uniform(0, 1),
    "psi": Uniform(0.2, 2),
    "c1": HalfCauchy(0.1),
    "c2": HalfCauchy(0.1),
    "noise_sd": Uniform(0.05, 0.5),
}
POSITIVE, ABOUT_ZERO = Uniform(0.5, 1.5), Normal(0, 0.3)
"""Priors of a material's linear parameters that have none above, MPa."""


class SbcSettings(SbcOptions):
    """Formulations x noise x replicates of a material; in each, parameters from the priors, data, and a fit.

    The priors (MPa; psi in stretch) are the same for every data set: none is taken from the data. Known noise is that
    of the design.
    """

    design: Design = Design(low=0.6, high=2.0, points=30, noise_sd=0.2)
    priors: dict[str, dict[str, Any]] = Field(default_factory=lambda: {s: p.as_dict() for s, p in PRIORS.items()})

    _once = field_validator("formulations", "noise")(each_once)

    @model_validator(mode="after")
    def _possible(self) -> Self:
        try:
            priors = self.chosen_priors
            for formulation in self.formulations:
                parameters = (*material_named(self.material).parameters, *discrepancy_named(formulation).parameters)
                missing = [p.symbol for p in parameters if isinstance(priors.get(p.symbol, Flat()), Flat)]
                if missing:
                    raise ValueError(f"'{formulation}' needs proper priors of {', '.join(missing)} to be drawn from")
                for noise in self.noise:
                    self.model(formulation, noise)
            symbols = parameters_of(self.formulations, material_named(self.material))
            for symbol in self.priors.keys() - symbols - PRIORS.keys():
                raise ValueError(
                    f"priors: there is no parameter '{symbol}'; those of the material, the formulations and the noise "
                    f"are {', '.join(sorted(symbols))}"
                )
        except TissuqError as error:
            raise ValueError(str(error)) from error
        return self

    @property
    def chosen_priors(self) -> dict[str, Prior]:
        """The given priors, and ours for what is not given.

        Those of a material's other parameters are positive about 1 MPa or normal about zero where they are linear, and
        otherwise its default priors on this design.
        """
        priors = PRIORS | {symbol: prior_from(prior) for symbol, prior in self.priors.items()}
        stretch = self.design.stretch
        scale = Experiment(self.design.mode, stretch, np.ones(len(stretch)))
        for parameter in material_named(self.material).parameters:
            if parameter.symbol not in priors:
                linear = POSITIVE if parameter.support[0] >= 0 else ABOUT_ZERO
                priors[parameter.symbol] = linear if parameter.is_linear else default_prior(parameter, scale)
        return priors

    def model(self, formulation: str, noise: str) -> StatisticalModel:
        """Return the model of a formulation, on data that do not matter."""
        noise_sd = self.design.noise_sd if noise == "known" else noise
        law = material_named(self.material)
        return model_of(formulation, self.design.mode, self.design.stretch, noise_sd, self.chosen_priors, law)


@dataclass(frozen=True)
class Task(TaskOfFields):
    """Some data sets of one formulation and noise, by their indices in the settings."""

    formulation: int
    noise: int
    start: int
    count: int
    label: str


def tasks_of(settings: SbcSettings) -> list[Task]:
    """Return all tasks, in their order."""
    starts = range(0, settings.replicates, BLOCK)
    return [
        Task(formulation, noise, start, min(BLOCK, settings.replicates - start), settings.formulations[formulation])
        for noise, start, formulation in product(range(len(settings.noise)), starts, range(len(settings.formulations)))
    ]


def carry_out(settings: SbcSettings, task: Task) -> dict[str, Any]:
    """Return the posterior probability below the true value of every parameter; null where a fit failed."""
    formulation, noise = settings.formulations[task.formulation], settings.noise[task.noise]
    model = settings.model(formulation, noise)
    truths, scores, data = [], [], []
    for replicate in range(task.start, task.start + task.count):
        generator = np.random.default_rng((settings.seed, 3, task.formulation, task.noise, replicate))
        values, stress = draw_from_prior(model, generator)
        truths.append(values)
        scores.append(generator.uniform(size=len(values)))
        data.append(Experiment(model.experiment.mode, model.experiment.stretch, stress))
    noise_sd = settings.design.noise_sd if noise == "known" else noise
    fits = fit_all(data, formulation, [noise_sd] * len(data), settings.chosen_priors, model.material)
    ranks: dict[str, list[float | None]] = {symbol: [None] * len(data) for symbol in model.symbols}
    for index, fit in fits:
        for symbol, uniform in zip(model.symbols, scores[index], strict=True):
            if fit is not None:
                marginal = fit.marginals[symbol]
                ranks[symbol][index] = probability_below(marginal, truths[index][symbol], uniform)
    return {"formulation": task.formulation, "noise": task.noise, "below": ranks}


run_sbc = Campaign(tasks_of, carry_out)
"""Carries out simulation-based calibration."""


def probability_below(marginal: Marginal, value: float, uniform: float) -> float:
    """Return the posterior probability below a value; a random part of that of zero where this is the value.

    An amplitude is zero with a probability where a discrepancy may lack its block.
    """
    if value == 0.0:
        return float(uniform * marginal.cumulative[0])
    return float(np.interp(value, marginal.points, marginal.cumulative))


POINTS = 100
SIMULATIONS = 9_999


def ecdf_band(count: int, prob: float = 0.95) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return probabilities, and the band that with ``prob`` holds the whole ECDF of ``count`` uniform values there.

    Between quantiles of the binomial distribution at each place, as wide as it takes for all places together.

    References
    ----------
    Säilynoja, Bürkner & Vehtari (2022), Statistics and Computing 32:32; the level is found by simulation.
    """
    from scipy.stats import binom

    grid = _places()
    level = np.quantile(_least_of_uniform(count), 1 - prob, method="lower")
    return grid, binom.ppf(0.5 * level, count, grid) / count, binom.isf(0.5 * level, count, grid) / count


def shape_p_value(probabilities: FloatArray) -> float:
    """Return the p value of values being uniform, by how far their ECDF leaves it anywhere; exact but for ties."""
    counts = (probabilities[:, None] <= _places()).sum(axis=0)
    lowest = _least(counts[None], len(probabilities))[0]
    smaller = int((_least_of_uniform(len(probabilities)) <= lowest * (1 + 1e-9)).sum())
    return (1 + smaller) / (1 + SIMULATIONS)


def spread_p_value(probabilities: FloatArray) -> float:
    """Return the p value (two-sided) of the normal scores of values having unit variance: too narrow, too wide."""
    from scipy.special import ndtri
    from scipy.stats import chi2

    scores = ndtri(np.clip(probabilities, 1e-9, 1 - 1e-9))
    squares = float(scores @ scores)
    return float(2 * min(chi2.cdf(squares, len(scores)), chi2.sf(squares, len(scores))))


def _places() -> FloatArray:
    return np.arange(1, POINTS) / POINTS


@lru_cache(maxsize=64)
def _least_of_uniform(count: int) -> FloatArray:
    """Return the test statistic of simulated uniform values."""
    generator = np.random.default_rng(0)
    counts = generator.multinomial(count, np.full(POINTS, 1 / POINTS), size=SIMULATIONS).cumsum(axis=1)[:, :-1]
    return _least(counts, count)


def _least(counts: NDArray[np.int64], count: int) -> FloatArray:
    """Return the least of the two-sided binomial probabilities of counts below each place (m, POINTS - 1)."""
    from scipy.stats import binom

    hits = np.arange(count + 1)[:, None]
    tails = 2 * np.minimum(binom.cdf(hits, count, _places()), binom.sf(hits - 1, count, _places()))
    return np.asarray(tails[counts, np.arange(POINTS - 1)].min(axis=1))


SIZE = 0.05
"""Probability that any parameter is marked if all are calibrated."""


def probabilities_of(
    settings: SbcSettings, results: Sequence[dict[str, Any]]
) -> Mapping[tuple[str, str, str], FloatArray]:
    """Return the probabilities below the truth by formulation, noise and parameter; nan where a fit failed."""
    ranks: dict[tuple[str, str, str], list[float]] = {}
    for result in results:
        setting = settings.formulations[result["formulation"]], settings.noise[result["noise"]]
        for symbol, probabilities in result["below"].items():
            ranks.setdefault((*setting, symbol), []).extend(
                np.nan if value is None else value for value in probabilities
            )
    return {setting: np.array(values) for setting, values in ranks.items()}


def summarise_ranks(settings: SbcSettings, results: Sequence[dict[str, Any]]) -> pd.DataFrame:
    """Return one row a formulation, noise and parameter.

    Columns: fits, failed; mean, of the posterior probability below the truth (0.5 when right); spread, the standard
    deviation of its normal score (1 when right; more, posteriors are too narrow); p_shape and p_spread, of the tests
    in `tissuq.validation.sbc`; calibrated, whether both are at least 0.05 over the number of all tests, so
    that the chance is 5 % at most that any row is marked when all is right.
    """
    import pandas as pd
    from scipy.special import ndtri

    rows = []
    for (formulation, noise, symbol), ranks in probabilities_of(settings, results).items():
        valid = ranks[np.isfinite(ranks)]
        rows.append(
            {
                "formulation": formulation,
                "noise": noise,
                "parameter": symbol,
                "fits": len(valid),
                "failed": len(ranks) - len(valid),
                "mean": valid.mean(),
                "spread": np.sqrt(np.mean(ndtri(np.clip(valid, 1e-9, 1 - 1e-9)) ** 2)),
                "p_shape": shape_p_value(valid),
                "p_spread": spread_p_value(valid),
            }
        )
    table = pd.DataFrame(rows)
    table["calibrated"] = table[["p_shape", "p_spread"]].min(axis=1) >= SIZE / (2 * len(table))
    return table
