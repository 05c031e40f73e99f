"""The posterior of an expensive model's parameters, as a user meets it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tissuq.emulation.cautions import warnings_about
from tissuq.emulation.checks import EmulatorCheck
from tissuq.emulation.emulator import Emulator
from tissuq.emulation.labelled import labelled_arrays
from tissuq.emulation.problem import Problem
from tissuq.emulation.runs import ForwardRuns
from tissuq.errors import InputError
from tissuq.inference.marginal import Marginal
from tissuq.prediction.mixture import Mixtures

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from tissuq.emulation.likelihood import Likelihood
    from tissuq.emulation.problem import Method
    from tissuq.emulation.sampling import Sampled

__all__ = ["Calibration"]

FloatArray = NDArray[np.float64]

MANY = 1000
"""Draws that stand for the posterior in predictions."""
SOME = 128
"""Draws over which the emulator's error is averaged."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """What `tissuq.calibrate` returns.

    Attributes
    ----------
    problem : Problem
        Measurements, priors, discrepancy and noise.
    emulator : Emulator
        That stands for the model; ``emulator.check()`` says how well.
    posterior : Sampled
        Weighted points and equally weighted draws of all parameters, and whether they can be used.
    held_out : tuple of EmulatorCheck
        Runs at which the emulator was tried before it learnt them, batch by batch.
    seed : int
    method : str
        By which the posterior was asked for.
    """

    problem: Problem
    emulator: Emulator
    posterior: Sampled
    held_out: tuple[EmulatorCheck, ...] = ()
    seed: int = 0
    method: Method = "auto"

    @property
    def marginals(self) -> Mapping[str, Marginal]:
        """The marginal posterior of every parameter: mean, sd, density, quantiles, HDI."""
        return self.posterior.marginals

    @property
    def runs(self) -> ForwardRuns:
        """All runs of the forward model, failed ones included."""
        return self.emulator.runs

    @property
    def log_evidence(self) -> float | None:
        """Log of p(measured), priors normalised; None where the sampler gives none."""
        return self.posterior.log_evidence

    @property
    def converged(self) -> bool:
        """Whether the sampler's result can be used."""
        return self.posterior.converged

    @cached_property
    def check(self) -> EmulatorCheck:
        """The emulator at each of its runs, predicted from the others."""
        return self.emulator.check()

    @cached_property
    def likelihood(self) -> Likelihood:
        """Of the measurements."""
        from tissuq.emulation.likelihood import Likelihood

        return Likelihood(self.problem, self.emulator)

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """What a reader must know, in sentences."""
        return tuple(warnings_about(self))

    @cached_property
    def without_emulator_error(self) -> Calibration:
        """The same as if the emulator were exact: for comparison, not for use."""
        from tissuq.emulation.likelihood import Likelihood
        from tissuq.emulation.sampling import sampled

        exact = Likelihood(self.problem, self.emulator, has_error=False)
        found = replace(self, posterior=sampled(exact, self.seed, self.method))
        found.__dict__["likelihood"] = exact
        return found

    @cached_property
    def emulator_share(self) -> dict[str, float]:
        """The share of every parameter's posterior variance that is owed to the emulator's error.

        One minus the variance without that error over the variance with it, zero at least: where the emulator is far
        off, the posterior without its error also lies elsewhere, and the share says little.
        """
        pairs = zip(self.marginals.items(), self.without_emulator_error.marginals.values(), strict=True)
        return {symbol: max(0.0, 1 - (exact.sd / own.sd) ** 2) for (symbol, own), exact in pairs}

    @cached_property
    def error_ratio(self) -> float:
        """The largest variance of the emulator's error over that of noise and discrepancy, in any direction.

        The mean over the posterior. It bounds what the error can do, and is often far above it.
        """
        return self.likelihood.error_ratio(self.draws(SOME))

    def draws(self, count: int) -> FloatArray:
        """Return equally probable draws (count, D) of all parameters."""
        every = self.posterior.draws.reshape(-1, len(self.problem.symbols))
        return np.asarray(every[np.linspace(0, len(every) - 1, count).round().astype(int)])

    def summary(self, prob: float = 0.95) -> pd.DataFrame:
        """Return mean, sd, median and highest-density interval of every parameter, in the forward model's units.

        Returns
        -------
        pandas.DataFrame
            Indexed by parameter: mean, sd, median, hdi_low, hdi_high, ess, rhat (nan where no chains were run) and
            emulator_share, the share of the variance that is owed to the emulator's error.
        """
        import pandas as pd

        _check_probability(prob)
        rows = [
            (own.mean, own.sd, float(own.quantile(0.5)), *own.hdi(prob), self.posterior.ess[symbol],
             self.posterior.rhat.get(symbol, np.nan), self.emulator_share[symbol])
            for symbol, own in self.marginals.items()
        ]  # fmt: skip
        names = ["mean", "sd", "median", "hdi_low", "hdi_high", "ess", "rhat", "emulator_share"]
        return pd.DataFrame(rows, pd.Index(self.problem.symbols, name="parameter"), names)

    def predict(self, *, discrepancy: bool = True, noise: bool = True, prob: float = 0.95) -> pd.DataFrame:
        """Return the predicted outputs at the measured controls.

        Parameters
        ----------
        discrepancy : bool
            With the discrepancy's share, or the forward model alone.
        noise : bool
            For a new measurement, or for the quantity itself.
        prob : float
            Probability between low and high, equal tails.

        Returns
        -------
        pandas.DataFrame
            Columns control, mean, low, high.
        """
        import pandas as pd

        _check_probability(prob)
        mean, variance = self.likelihood.predictions(self.draws(MANY), discrepancy=discrepancy, noise=noise)
        found = Mixtures(np.full(len(mean), 1 / len(mean)), mean, variance)
        low, high = (found.quantile(tail) for tail in (0.5 - 0.5 * prob, 0.5 + 0.5 * prob))
        return pd.DataFrame({"control": self.problem.control, "mean": found.mean, "low": low, "high": high})

    def predictive_coverage(self, *, discrepancy: bool = True, prob: float = 0.95) -> float:
        """Return the share of the measurements inside their predictive band (a check of the fit, not of parameters)."""
        band = self.predict(discrepancy=discrepancy, prob=prob)
        measured = self.problem.measured
        return float(((band["low"].to_numpy() <= measured) & (measured <= band["high"].to_numpy())).mean())

    @cached_property
    def data(self) -> xr.DataTree:
        """Everything as labelled arrays that ArviZ reads.

        Groups posterior and posterior_predictive (chain, draw), observed_data, constant_data, and forward_runs: the
        design, its outputs and what failed.
        """
        return labelled_arrays(self)

    def save(self, path: str | Path) -> None:
        """Write `data` as NetCDF, which ArviZ and xarray open."""
        # The HDF5 library must not meet a full disk itself: it then fails at a place where no one can catch it.
        content = bytes(self.data.to_netcdf(engine="h5netcdf"))
        Path(path).write_bytes(content)

    def __repr__(self) -> str:
        return (
            f"<Calibration of {', '.join(self.problem.symbols)}: discrepancy {self.problem.discrepancy.name}, "
            f"{len(self.problem.measured)} measurements, {len(self.runs)} runs, {self.posterior.method}>"
        )


def _check_probability(prob: float) -> None:
    if not 0 < prob < 1:
        raise InputError(f"prob must be between 0 and 1, not {prob}.")
