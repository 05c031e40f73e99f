"""Several specimens together: the population, every specimen within it, and the prediction of a new patient."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tissuq.drawing.panels import Panels, panels
from tissuq.errors import InputError
from tissuq.experiments.headed_tables import headed, in_unit
from tissuq.experiments.modes import LoadingMode
from tissuq.experiments.units import StressUnit, stress_unit
from tissuq.population.likelihoods import Coordinates
from tissuq.population.patient import matching_draws, patient_curves, patient_posterior
from tissuq.population.picture import draw_specimens, height_of
from tissuq.posterior.posterior import Posterior
from tissuq.prediction.bands import asked_for

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from tissuq.inference.enumerators.nuts import NutsDraws
    from tissuq.population.hierarchy import Hierarchy

__all__ = ["Population"]

FloatArray = NDArray[np.float64]

MIN_EFFECTIVE_SHARE = 0.5
"""Smallest share of draws that must remain effective when they are corrected."""
MIN_SPECIMENS_FOR_SPREAD = 5
"""Smallest number of specimens for which the prior of the spread has little influence."""
INTERVAL_COLUMNS = ["median", "hdi_low", "hdi_high"]


class Population:
    """What `tissuq.fit_population` returns: no pooling, partial pooling and complete pooling of the same specimens.

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
    """

    def __init__(
        self,
        posteriors: Mapping[str, Posterior],
        complete: Posterior,
        coordinates: Coordinates,
        hierarchy: Hierarchy,
        spread_prior: float,
        seed: int,
    ) -> None:
        self.posteriors, self.complete = dict(posteriors), complete
        self.coordinates, self.hierarchy = coordinates, hierarchy
        self.spread_prior, self.seed = spread_prior, seed

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
        return self.coordinates.from_line(self.hierarchy.new(np.random.default_rng([self.seed, 5])))

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
        posteriors = tuple(self.posteriors.values())
        return patient_posterior(posteriors, self.complete, self.coordinates, self.hierarchy, self.new)

    @cached_property
    def diagnostics(self) -> NutsDraws:
        """R-hat and effective sample sizes of the population and of every specimen, and a verdict."""
        return self.hierarchy.diagnostics

    @property
    def converged(self) -> bool:
        """Whether sampling of the population, and of every separate fit of a specimen, has converged."""
        fits = (*self.posteriors.values(), self.complete)
        is_corrected = self.hierarchy.effective > MIN_EFFECTIVE_SHARE
        return self.diagnostics.converged and is_corrected and not any(fit.solution.is_approximate for fit in fits)

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """Warnings that the user must read, in sentences."""
        sentences = []
        if not self.diagnostics.converged:
            sentences.append(self.diagnostics.verdict)
        if self.hierarchy.effective <= MIN_EFFECTIVE_SHARE:
            sentences.append(
                f"only {self.hierarchy.effective:.0%} of the draws remain effective when they are corrected for the "
                "approximation of the specimens' posteriors by a few Gaussians: the approximation is too poor."
            )
        failed = [name for name, fit in self.posteriors.items() if fit.solution.is_approximate]
        if failed:
            sentences.append(
                f"sampling has not converged for the separate fit of {', '.join(failed)}, on which the population "
                "depends."
            )
        if len(self.names) < MIN_SPECIMENS_FOR_SPREAD:
            sentences.append(
                f"{len(self.names)} specimens determine the spread poorly: its prior, half-normal with sd "
                f"{self.spread_prior:g} of the logarithm, influences the interval of a new patient, too."
            )
        return tuple(sentences)

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
            Indexed by parameter and quantity: ``median`` (of the population), ``spread`` (between specimens: sd of the
            logarithm, or of a parameter of either sign itself), ``new patient``, and ``complete pooling``, whose
            interval is one for specimens that were all the same: it is no range of patients. Columns median, hdi_low
            and hdi_high; the unit of stresses stands at their head.
        """
        import pandas as pd

        _check_probability(prob)
        rows = {}
        for index, (symbol, is_log) in enumerate(zip(self.symbols, self.coordinates.is_log, strict=True)):
            factor = self.unit_of(symbol, self.unit(unit)).to_mpa
            for name, draws in (("median", self.median), ("spread", self.spread), ("new patient", self.new)):
                is_ratio = name == "spread" and is_log
                rows[symbol, name] = np.array(_interval(draws[..., index], prob)) / (1.0 if is_ratio else factor)
            marginal = self.complete.marginals[symbol]
            rows[symbol, "complete pooling"] = np.array([marginal.quantile(0.5), *marginal.hdi(prob)]) / factor
        index_of_rows = pd.MultiIndex.from_tuples(rows, names=["parameter", "quantity"])
        return headed(pd.DataFrame(list(rows.values()), index_of_rows, INTERVAL_COLUMNS), self.unit(unit))

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

        _check_probability(prob)
        rows, draws = {}, self.specimens
        for i, (name, posterior) in enumerate(self.posteriors.items()):
            for column, symbol in enumerate(self.symbols):
                marginal = posterior.marginals[symbol]
                single = float(marginal.quantile(0.5)), *marginal.hdi(prob)
                factor = self.unit_of(symbol, self.unit(unit)).to_mpa
                rows[name, symbol] = np.array([*_interval(draws[..., i, column], prob), *single]) / factor
        index = pd.MultiIndex.from_tuples(rows, names=["specimen", "parameter"])
        columns = [*INTERVAL_COLUMNS, *(f"alone_{end}" for end in INTERVAL_COLUMNS)]
        return headed(pd.DataFrame(list(rows.values()), index, columns), self.unit(unit))

    def correlations(self, prob: float = 0.95) -> pd.DataFrame:
        """Return the correlation between specimens of every pair of parameters, on the line of `coordinates`."""
        import pandas as pd

        _check_probability(prob)
        correlation, count = self.hierarchy.correlation, len(self.symbols)
        pairs = [(i, j) for i in range(count) for j in range(i + 1, count)]
        names = [f"{self.symbols[i]}, {self.symbols[j]}" for i, j in pairs]
        rows = [_interval(correlation[..., i, j], prob) for i, j in pairs]
        return pd.DataFrame(np.reshape(rows, (len(rows), 3)), pd.Index(names, name="parameters"), INTERVAL_COLUMNS)

    def new_patient(
        self,
        stretch: ArrayLike,
        *,
        mode: str | LoadingMode | None = None,
        channel: int = 0,
        discrepancy: bool = True,
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

        options: dict[str, Any] = {"discrepancy": discrepancy, "mode": mode, "channel": channel}
        loading, points = asked_for([self.complete.solution], stretch, prob=prob, **options)
        if len(loading.controls) > 1:
            names = ", ".join(control.name for control in loading.controls)
            raise InputError(
                f"the stress of a new patient is predicted in loading modes with one control, and '{loading.name}' has "
                f"{names}."
            )
        chains, draws, count, size = self.hierarchy.specimens.shape
        line_values, new = self.hierarchy.specimens.reshape(-1, count, size), self.new.reshape(-1, size)
        curves = []
        for i, posterior in enumerate(self.posteriors.values()):
            rows = np.arange(i, chains * draws, count)
            matching = matching_draws(posterior, self.coordinates, line_values[rows, i])
            arguments = posterior, self.coordinates, matching, new[rows], points
            curves.append(patient_curves(*arguments, mode=loading, channel=channel, discrepancy=discrepancy))
        stresses = np.concatenate(curves)
        unseen = np.isnan(stresses).all(axis=0)
        if unseen.any():
            raise InputError(
                f"no specimen was measured at {loading.controls[0].name} {points[unseen][0]:g}, so that the model "
                "error there is unknown: predict nearer to the data, or with discrepancy=False."
            )
        low, median, high = np.nanquantile(stresses, [0.5 - prob / 2, 0.5, 0.5 + prob / 2], axis=0)
        table = pd.DataFrame({"stretch": points, "median": median, "low": low, "high": high})
        return in_unit(table, ["median", "low", "high"], self.unit(unit).name)

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
        draw_specimens(drawn, self.summary(unit=unit.name), self.specimen_summary(unit=unit.name), units)

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
        from tissuq.population.hierarchy import labelled

        labels: dict[str, str | float] = {
            "spread_prior": f"half-normal({self.spread_prior:g})",
            "seed": self.seed,
            "converged": str(self.converged),
        }
        return labelled(self.posteriors, self.complete, self.coordinates, self.hierarchy, self.new, labels)

    def save(self, path: str | Path) -> None:
        """Write `data` as NetCDF, which ArviZ and xarray open."""
        Path(path).write_bytes(bytes(self.data.to_netcdf(engine="h5netcdf")))

    def __repr__(self) -> str:
        material = self.complete.model.material.name
        return f"<Population of {', '.join(self.symbols)}: {len(self.names)} specimens, {material}>"


def _interval(draws: FloatArray, prob: float) -> tuple[float, float, float]:
    """Return the median of draws and the ends of the shortest interval that holds a share of them."""
    values = np.sort(draws, axis=None)
    count = round(prob * len(values))
    start = int((values[count:] - values[: len(values) - count]).argmin())
    return float(np.median(values)), float(values[start]), float(values[start + count])


def _check_probability(prob: float) -> None:
    if not 0 < prob < 1:
        raise InputError(f"prob must be between 0 and 1, not {prob}.")
