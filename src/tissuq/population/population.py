"""Several specimens together: the population, every specimen within it, and what is to be expected of a new patient."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tissuq.errors import InputError
from tissuq.experiments.modes import LoadingMode
from tissuq.population.coordinates import Coordinates
from tissuq.population.labelled import labelled
from tissuq.population.patient import matching_draws, patient_curves
from tissuq.posterior import Posterior
from tissuq.prediction.bands import asked_for

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from tissuq.inference.nuts import NutsDraws
    from tissuq.population.hierarchy import Hierarchy

__all__ = ["Population"]

FloatArray = NDArray[np.float64]

LEAST_EFFECTIVE = 0.5
"""Share of draws that must stay effective when they are corrected."""
FEW = 5
"""Specimens below which the prior of the spread has its say."""
ENDS = ["median", "hdi_low", "hdi_high"]


class Population:
    """What `tissuq.fit_population` returns: no pooling, partial pooling and complete pooling of the same specimens.

    Attributes
    ----------
    posteriors : dict of str to Posterior
        Every specimen by itself: no pooling.
    complete : Posterior
        The measurements of all specimens taken for one specimen: complete pooling.
    coordinates : Coordinates
        What is pooled, and in which form: logarithms of positive parameters.
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
    def diagnostics(self) -> NutsDraws:
        """R-hat and effective sample sizes of the population and of every specimen, and a verdict."""
        return self.hierarchy.diagnostics

    @property
    def converged(self) -> bool:
        """Whether sampling of the population, and of every specimen by itself, has converged."""
        fits = (*self.posteriors.values(), self.complete)
        is_corrected = self.hierarchy.effective > LEAST_EFFECTIVE
        return self.diagnostics.converged and is_corrected and not any(fit.solution.is_approximate for fit in fits)

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """What a reader must know, in sentences."""
        found = []
        if not self.diagnostics.converged:
            found.append(self.diagnostics.verdict)
        if self.hierarchy.effective <= LEAST_EFFECTIVE:
            found.append(
                f"only {self.hierarchy.effective:.0%} of the draws stay effective when corrected for the form in which "
                "specimens were sampled: the specimens' posteriors are too far from few Gaussians."
            )
        failed = [name for name, fit in self.posteriors.items() if fit.solution.is_approximate]
        if failed:
            found.append(
                f"sampling has not converged for {', '.join(failed)} alone: the population rests on these, too."
            )
        if len(self.names) < FEW:
            found.append(
                f"{len(self.names)} specimens hardly tell a spread: its prior, half-normal with sd "
                f"{self.spread_prior:g} of the logarithm, has its say in the interval of a new patient, too."
            )
        return tuple(found)

    def summary(self, prob: float = 0.95) -> pd.DataFrame:
        """Return what is said of every pooled parameter (MPa), by partial and by complete pooling.

        Parameters
        ----------
        prob : float
            Probability inside the intervals.

        Returns
        -------
        pandas.DataFrame
            Indexed by parameter and quantity: ``median`` (of the population), ``spread`` (between specimens: sd of the
            logarithm, or of a parameter of either sign itself), ``new patient``, and ``complete pooling``, whose
            interval is one for specimens that were all the same: it is no range of patients. Columns median, hdi_low
            and hdi_high.
        """
        import pandas as pd

        _check_probability(prob)
        rows = {}
        for place, symbol in enumerate(self.symbols):
            for name, draws in (("median", self.median), ("spread", self.spread), ("new patient", self.new)):
                rows[symbol, name] = _interval(draws[..., place], prob)
            alone = self.complete.marginals[symbol]
            rows[symbol, "complete pooling"] = (float(alone.quantile(0.5)), *alone.hdi(prob))
        return pd.DataFrame.from_dict(rows, orient="index", columns=ENDS).set_index(
            pd.MultiIndex.from_tuples(rows, names=["parameter", "quantity"])
        )

    def specimen_summary(self, prob: float = 0.95) -> pd.DataFrame:
        """Return every specimen's parameters (MPa) by itself and within the population.

        Returns
        -------
        pandas.DataFrame
            Indexed by specimen and parameter: median, hdi_low and hdi_high with partial pooling, and the same with no
            pooling (``alone_median`` and so on).
        """
        import pandas as pd

        _check_probability(prob)
        rows, draws = {}, self.specimens
        for i, (name, posterior) in enumerate(self.posteriors.items()):
            for place, symbol in enumerate(self.symbols):
                alone = posterior.marginals[symbol]
                own = float(alone.quantile(0.5)), *alone.hdi(prob)
                rows[name, symbol] = (*_interval(draws[..., i, place], prob), *own)
        index = pd.MultiIndex.from_tuples(rows, names=["specimen", "parameter"])
        return pd.DataFrame(list(rows.values()), index, [*ENDS, *(f"alone_{end}" for end in ENDS)])

    def correlations(self, prob: float = 0.95) -> pd.DataFrame:
        """Return the correlation between specimens of every pair of parameters, on the line of `coordinates`."""
        import pandas as pd

        _check_probability(prob)
        found, count = self.hierarchy.correlation, len(self.symbols)
        pairs = [(i, j) for i in range(count) for j in range(i + 1, count)]
        names = [f"{self.symbols[i]}, {self.symbols[j]}" for i, j in pairs]
        rows = [_interval(found[..., i, j], prob) for i, j in pairs]
        return pd.DataFrame(np.reshape(rows, (len(rows), 3)), pd.Index(names, name="parameters"), ENDS)

    def new_patient(
        self,
        stretch: ArrayLike,
        *,
        mode: str | LoadingMode | None = None,
        channel: int = 0,
        discrepancy: bool = True,
        prob: float = 0.95,
    ) -> pd.DataFrame:
        """Return the engineering stress that is to be expected of a patient who has not been measured.

        The material is drawn from the population. Nothing is known of a new patient's model error but that it is like
        those that were seen: at every stretch it is the discrepancy of one at random of the specimens that were
        measured there, in proportion to the initial modulus, from the same draw as that specimen's parameters.

        Parameters
        ----------
        stretch : (g,) array, dimensionless
        mode : str or LoadingMode, optional
            Which loading mode, where the data are in several; another one than theirs, where the discrepancy is an
            energy or left out. One with several controls is not predicted.
        channel : int
            Which of the mode's stresses, from 0, where it has several.
        discrepancy : bool
            With the model error, or of the material alone.
        prob : float
            Probability between low and high, equal tails.

        Returns
        -------
        pandas.DataFrame
            Columns stretch, median, low, high; MPa.
        """
        import pandas as pd

        options: dict[str, Any] = {"discrepancy": discrepancy, "mode": mode, "channel": channel}
        asked, points = asked_for([self.complete.solution], stretch, prob=prob, **options)
        if len(asked.controls) > 1:
            names = ", ".join(control.name for control in asked.controls)
            raise InputError(
                f"the stress of a new patient is predicted in loading modes with one control, and '{asked.name}' has "
                f"{names}."
            )
        chains, draws, count, size = self.hierarchy.specimens.shape
        places, new = self.hierarchy.specimens.reshape(-1, count, size), self.new.reshape(-1, size)
        curves = []
        for i, posterior in enumerate(self.posteriors.values()):
            own = np.arange(i, chains * draws, count)
            matching = matching_draws(posterior, self.coordinates, places[own, i])
            given = posterior, self.coordinates, matching, new[own], points
            curves.append(patient_curves(*given, mode=asked, channel=channel, discrepancy=discrepancy))
        found = np.concatenate(curves)
        unseen = np.isnan(found).all(axis=0)
        if unseen.any():
            raise InputError(
                f"no specimen was measured at {asked.controls[0].name} {points[unseen][0]:g}, so that nothing is "
                "known of the model error there: predict nearer to the data, or with discrepancy=False."
            )
        low, median, high = np.nanquantile(found, [0.5 - prob / 2, 0.5, 0.5 + prob / 2], axis=0)
        return pd.DataFrame({"stretch": points, "median": median, "low": low, "high": high})

    @cached_property
    def data(self) -> xr.DataTree:
        """Everything as labelled arrays that ArviZ reads.

        Groups posterior (of the population and the specimens), new_patient, no_pooling, complete_pooling,
        observed_data and constant_data.
        """
        return labelled(self)

    def save(self, path: str | Path) -> None:
        """Write `data` as NetCDF, which ArviZ and xarray open."""
        Path(path).write_bytes(bytes(self.data.to_netcdf(engine="h5netcdf")))

    def __repr__(self) -> str:
        material = self.complete.model.material.name
        return f"<Population of {', '.join(self.symbols)}: {len(self.names)} specimens, {material}>"


def _interval(draws: FloatArray, prob: float) -> tuple[float, float, float]:
    """Return the median of draws and the ends of the shortest interval that holds a share of them."""
    values = np.sort(draws, axis=None)
    inside = round(prob * len(values))
    start = int((values[inside:] - values[: len(values) - inside]).argmin())
    return float(np.median(values)), float(values[start]), float(values[start + inside])


def _check_probability(prob: float) -> None:
    if not 0 < prob < 1:
        raise InputError(f"prob must be between 0 and 1, not {prob}.")
