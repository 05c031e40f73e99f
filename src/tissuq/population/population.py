"""Several specimens together: the population, every specimen within it, and the prediction of a new patient."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from tissuq.drawing.panels import Panels, panels
from tissuq.experiments.checked_arrays import headed, in_unit
from tissuq.experiments.modes import LoadingMode
from tissuq.experiments.units import StressUnit
from tissuq.parameters.checks import check_probability
from tissuq.population.answer import PopulationAnswer, answer_of_population, patient_in_words
from tissuq.population.draws import INTERVAL_COLUMNS, PopulationDraws, effect_table, interval, labelled_arrays
from tissuq.population.patient import patient_band, patient_posterior
from tissuq.population.picture import draw_specimens, height_of
from tissuq.population.sample_size import needed_table
from tissuq.population.shared_error import shared_covariance, width_table
from tissuq.population.warnings import has_converged, warnings_of
from tissuq.posterior.netcdf import LabelledGroup, save_groups, tree_of
from tissuq.posterior.posterior import Posterior
from tissuq.prediction.bands import asked_for

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from tissuq.inference.enumerators.nuts import NutsDraws


class Population(PopulationDraws):
    """What `tissuq.fit_population` returns: no pooling, partial pooling and complete pooling of the same specimens.

    What it is made of, and its draws, are those of `tissuq.population.draws.PopulationDraws`.
    """

    def given(self, covariates: Mapping[str, Any]) -> Population:
        """Return the same population with a new patient of whom covariates are known, such as ``{"age": 60}``.

        The median of the population stays where it is: at the mean of the numbers and at the reference levels.

        Raises
        ------
        InputError
            When there is no such covariate, or no such level of it.
        """
        self.covariates.row(covariates)
        fitted = self.posteriors, self.complete, self.coordinates, self.hierarchy, self.spread_prior, self.seed
        return Population(*fitted, self.covariates, covariates, self.shared_covariance)

    @cached_property
    def patient(self) -> Posterior:
        """The posterior of the material of a patient who has not been measured, for predictions, cards and simulations.

        It has no discrepancy: the model error of a new patient is known along measured curves only (`new_patient`).
        Parameters that are not pooled, and the noise, are those of a random specimen.

        Examples
        --------
        >>> import tissuq as tq
        >>> stretch = [0.8, 0.9, 1.1, 1.2, 1.3]
        >>> moduli = {"a": 0.4, "b": 0.5, "c": 0.6, "d": 0.7, "e": 0.45}
        >>> specimens = {name: tq.simulate("neo-hookean", {"C10": modulus}, stretch, noise_sd=0.01, seed=seed)
        ...              for seed, (name, modulus) in enumerate(moduli.items())}
        >>> patient = tq.fit_population(specimens, discrepancy="none", noise_sd=0.01).patient
        >>> len(patient.ensemble(20))
        20
        """
        return patient_posterior(self)

    @cached_property
    def diagnostics(self) -> NutsDraws:
        """R-hat and effective sample sizes of the population and of every specimen, and a verdict."""
        return self.hierarchy.diagnostics

    @property
    def converged(self) -> bool:
        """Whether sampling of the population, and of every separate fit of a specimen, has converged."""
        return has_converged(self)

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """Warnings that the user must read, in sentences."""
        return warnings_of(self)

    @cached_property
    def answer(self) -> PopulationAnswer:
        """What it says before everything else: a new specimen, the law, and for what both can be used.

        Examples
        --------
        >>> import tissuq as tq
        >>> stretch = [0.8, 0.9, 1.1, 1.2, 1.3]
        >>> moduli = {"a": 0.4, "b": 0.5, "c": 0.6, "d": 0.7, "e": 0.45, "f": 0.55}
        >>> specimens = {name: tq.simulate("neo-hookean", {"C10": modulus}, stretch, noise_sd=0.01, seed=seed)
        ...              for seed, (name, modulus) in enumerate(moduli.items())}
        >>> answer = tq.fit_population(specimens, discrepancy="none", noise_sd=0.01).answer
        >>> answer.estimates[0].name, [str(use.verdict) for use in answer.uses]
        ('initial shear modulus of a new specimen', ['with care', 'no', 'no'])
        """
        return answer_of_population(self)

    def specimen_summary(self, prob: float = 0.95, unit: str | None = None) -> pd.DataFrame:
        """Return every specimen's parameters from its separate fit and within the population.

        Parameters are those of `summary`.

        Returns
        -------
        pandas.DataFrame
            Indexed by specimen and parameter: median, hdi_low and hdi_high with partial pooling, and the same with no
            pooling (``alone_median`` and so on); the unit of stresses stands at their head.
        """
        import pandas as pd

        check_probability(prob)
        rows, draws = {}, self.specimens
        for i, (name, posterior) in enumerate(self.posteriors.items()):
            for column, symbol in enumerate(self.symbols):
                marginal = posterior.marginals[symbol]
                single = float(marginal.quantile(0.5)), *marginal.hdi(prob)
                factor = self.unit_of(symbol, self.unit(unit)).to_mpa
                rows[name, symbol] = np.array([*interval(draws[..., i, column], prob), *single]) / factor
        index = pd.MultiIndex.from_tuples(rows, names=["specimen", "parameter"])
        columns = [*INTERVAL_COLUMNS, *(f"alone_{end}" for end in INTERVAL_COLUMNS)]
        return headed(pd.DataFrame(list(rows.values()), index, columns), self.unit(unit))

    def correlations(self, prob: float = 0.95) -> pd.DataFrame:
        """Return the correlation between specimens of every pair of parameters, on the line of `coordinates`."""
        import pandas as pd

        check_probability(prob)
        correlation, count = self.hierarchy.correlation, len(self.symbols)
        pairs = [(i, j) for i in range(count) for j in range(i + 1, count)]
        names = [f"{self.symbols[i]}, {self.symbols[j]}" for i, j in pairs]
        rows = [interval(correlation[..., i, j], prob) for i, j in pairs]
        return pd.DataFrame(np.reshape(rows, (len(rows), 3)), pd.Index(names, name="parameters"), INTERVAL_COLUMNS)

    def effects(self, prob: float = 0.95, unit: str | None = None) -> pd.DataFrame:
        """Return the effect of every covariate on every parameter, and the share of the spread that they explain.

        The parameters are those of `summary`.

        Returns
        -------
        pandas.DataFrame
            Indexed by parameter and covariate (of a word with its level). Column ``kind`` says what the numbers are:
            ``factor`` of a positive parameter, ``difference`` of another; both as ``per`` says (a unit of the number,
            or against the reference level); ``share``, of the variance between specimens that the covariates explain
            together. Median, hdi_low and hdi_high, and the probability that the effect is ``positive``.
        """
        check_probability(prob)
        return effect_table(self, prob, self.unit(unit))

    def median_half_widths(self, prob: float = 0.95) -> pd.DataFrame:
        """Return half the width of the interval of the population's median, over the median, for every parameter.

        Columns ``independent`` (specimens' discrepancies are) and ``shared`` (all have the same); equal without one.
        """
        stored = self.shared_covariance
        covariance = shared_covariance(list(self.posteriors.values()), self.coordinates) if stored is None else stored
        return width_table(self, covariance, prob)

    def specimens_needed(self, aim: float, prob: float = 0.95, assurance: float = 0.8) -> pd.DataFrame:
        """Return how many specimens like these it takes until intervals are as narrow as is aimed at.

        Parameters
        ----------
        aim : float
            Half the width of the interval over the median: 0.1 for 10 %.
        prob : float
            Probability inside the interval.
        assurance : float
            Probability that so many specimens reach the aim, whatever they will be.

        Returns
        -------
        pandas.DataFrame
            Indexed by parameter and quantity (``median``, ``new specimen``). Half the width over the median ``now``,
            and its ``floor`` with any number of specimens (it is lower with probability ``assurance``); how many
            ``specimens`` it takes in all, and how many ``more``: nan where the floor is above the aim, or more than a
            thousand are needed.
        """
        return needed_table(self, aim, prob, assurance)

    def new_patient(
        self,
        stretch: ArrayLike,
        *,
        mode: str | LoadingMode | None = None,
        channel: int = 0,
        discrepancy: bool = True,
        covariates: Mapping[str, Any] | None = None,
        prob: float = 0.95,
        unit: str | None = None,
    ) -> pd.DataFrame:
        """Return the engineering stress that is expected of a patient who has not been measured.

        The material is drawn from the population. A new patient's model error is taken to be like those of the
        specimens: at every stretch it is the discrepancy of a random specimen that was measured there, in proportion
        to the initial modulus, from the same draw as that specimen's parameters.

        Parameters
        ----------
        stretch : (g,) array, dimensionless
        mode : str or LoadingMode, optional
            Which loading mode, where the data are in several; another one than theirs, where the discrepancy is an
            energy or left out. One with several controls is not predicted.
        channel : int
            Which of the mode's stresses, from 0, where it has several.
        discrepancy : bool
            Add the model error to the material's stress.
        covariates : mapping of str to object, optional
            What is known of the patient instead of `patient_covariates`; as of `given`.
        prob : float
            Probability between low and high, equal tails.
        unit : str, optional
            As of `summary`.

        Returns
        -------
        pandas.DataFrame
            Columns stretch, median, low, high, with the unit of the latter at their head.
        """
        import pandas as pd

        if covariates is not None:
            of_patient: dict[str, Any] = {"mode": mode, "channel": channel, "discrepancy": discrepancy, "prob": prob}
            return self.given(covariates).new_patient(stretch, **of_patient, unit=unit)
        options: dict[str, Any] = {"discrepancy": discrepancy, "mode": mode, "channel": channel}
        loading, points = asked_for([self.complete.solution], stretch, prob=prob, **options)
        band = patient_band(self, loading, points, prob, channel=channel, discrepancy=discrepancy)
        return in_unit(pd.DataFrame(vars(band)), ["median", "low", "high"], self.unit(unit).name)

    def plot(self, ax: Any = None, *, unit: str | None = None) -> Any:
        """Draw the parameters of every specimen, by itself and within the population: a panel for each of `symbols`.

        Behind them the median of the population, where a new patient may be, and what complete pooling would say.

        Parameters
        ----------
        ax : Axes, or array of Axes, optional
            As many as there are parameters; unless given, a new figure is made in `matplotlib.pyplot`.
        unit : str, optional
            Of stresses; that of the measurements, unless given.

        Returns
        -------
        Axes, or (d,) array of Axes
        """
        with panels(ax, len(self.symbols), height=height_of(len(self.names), 0.8)) as drawn:
            self.draw(drawn, self.unit(unit))
        return drawn.result

    def draw(self, drawn: Panels, unit: StressUnit) -> None:
        """Draw `plot` on panels, one a parameter as far as there are panels, with stresses in a unit."""
        units = {symbol: self.unit_of(symbol, unit).name for symbol in self.symbols[: len(drawn.axes)]}
        whose = patient_in_words(self), patient_in_words(self, {})
        draw_specimens(drawn, self.summary(unit=unit.name), self.specimen_summary(unit=unit.name), units, whose)

    def _repr_html_(self) -> str:
        """Return the population's parameters in the unit of the measurements as a table, which notebooks show."""
        shown = self.summary().to_html(float_format="{:.4g}".format)
        return f"<p>{escape(repr(self))}; the spread of a positive parameter is the sd of its logarithm</p>{shown}"

    @cached_property
    def data(self) -> xr.DataTree:
        """Everything as labelled arrays that ArviZ reads.

        Groups posterior (of the population and the specimens), new_patient, no_pooling, complete_pooling,
        observed_data and constant_data.
        """
        return tree_of(self._groups)

    @cached_property
    def _groups(self) -> dict[str, LabelledGroup]:
        shared = {"shared_discrepancy": "True"} if self.shared_covariance is not None else {}
        return labelled_arrays(self, {"converged": str(self.converged)} | shared)

    def save(self, path: str | Path) -> None:
        """Write `data` as NetCDF, which ArviZ and xarray open."""
        save_groups(self._groups, Path(path))

    def __repr__(self) -> str:
        material = self.complete.model.material.name
        return f"<Population of {', '.join(self.symbols)}: {len(self.names)} specimens, {material}>"
