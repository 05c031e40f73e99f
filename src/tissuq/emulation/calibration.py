"""The posterior of an expensive model's parameters: marginals, predictions, warnings, and labelled arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.emulation.emulator import Emulator
from tissuq.emulation.problem import Problem
from tissuq.emulation.runs import EmulatorCheck, ForwardRuns
from tissuq.emulation.warnings import calibration_warnings
from tissuq.inference.marginal import Marginal
from tissuq.parameters.checks import check_probability, check_switches
from tissuq.posterior.netcdf import LabelledGroup, save_groups, tree_of
from tissuq.prediction.bands import Mixtures
from tissuq.result_warning import ResultWarning

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from tissuq.emulation.likelihood import Likelihood
    from tissuq.emulation.problem import Method
    from tissuq.emulation.sampling import SampledPosterior
    from tissuq.mechanics import Material
    from tissuq.posterior.posterior import Posterior

PREDICTION_DRAWS = 1000
"""Number of draws of the posterior in predictions."""
ERROR_DRAWS = 128
"""Number of draws over which the emulator's error is averaged."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """The posterior of an expensive model's parameters, as `tissuq.calibrate` returns it.

    Attributes
    ----------
    problem : Problem
        Measurements, priors, discrepancy and noise.
    emulator : Emulator
        Emulator in place of the model; ``emulator.check()`` gives its errors.
    posterior : SampledPosterior
        Weighted points and equally weighted draws of all parameters, and whether they have converged.
    held_out : tuple of EmulatorCheck
        Further runs, predicted before the emulator was made from them, batch by batch.
    seed : int
    method : str
        Requested method that finds the posterior.
    """

    problem: Problem
    emulator: Emulator
    posterior: SampledPosterior
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
        """Whether the sampler has converged."""
        return self.posterior.converged

    @cached_property
    def check(self) -> EmulatorCheck:
        """The emulator at each of its runs, predicted from the others."""
        return self.emulator.check()

    @property
    def leave_one_out(self) -> pd.DataFrame:
        """Every run predicted from the others: a row for each, the worst first.

        Columns: the parameters; error, the root mean square over the outputs, as a share of that of all runs; sd, what
        the emulator says of it; and standardised, the root mean square of the errors in standard deviations (about 1).
        """
        import pandas as pd

        check = self.check
        size = np.sqrt((check.computed**2).mean())
        table = pd.DataFrame(check.points, columns=list(self.runs.symbols))
        table["error"] = np.sqrt(((check.computed - check.predicted) ** 2).mean(axis=1)) / size
        table["sd"] = np.sqrt((check.sd**2).mean(axis=1)) / size
        table["standardised"] = np.sqrt((check.standardised**2).mean(axis=1))
        return table.sort_values("error", ascending=False, ignore_index=True)

    @cached_property
    def sensitivity(self) -> pd.DataFrame:
        """The share of the outputs' variance over the priors that each parameter explains (`Emulator.sensitivity`)."""
        return self.emulator.sensitivity(self.problem.forward_priors)

    @cached_property
    def likelihood(self) -> Likelihood:
        """The likelihood of the measurements."""
        from tissuq.emulation.likelihood import Likelihood

        return Likelihood(self.problem, self.emulator)

    @cached_property
    def warnings(self) -> tuple[ResultWarning, ...]:
        """Warnings that the user must read: sentences, each with a code and a severity."""
        exact = self.without_emulator_error.posterior
        sentences = calibration_warnings(
            self.problem,
            self.emulator,
            self.check,
            self.posterior,
            exact,
            self.emulator_share,
            dict(zip(self.problem.forward_symbols, self.sensitivity["total"].tolist(), strict=True)),
            self.likelihood,
        )
        return tuple(sentences)

    @cached_property
    def without_emulator_error(self) -> Calibration:
        """The same as if the emulator were exact: for comparison, not for use."""
        from tissuq.emulation.likelihood import Likelihood
        from tissuq.emulation.sampling import sample_posterior

        exact = Likelihood(self.problem, self.emulator, has_error=False)
        # Of a comparison the effective points need not be many.
        method = "importance" if self.posterior.method == "importance" else self.method
        calibration = replace(self, posterior=sample_posterior(exact, self.seed, method))
        calibration.__dict__["likelihood"] = exact
        return calibration

    @cached_property
    def emulator_share(self) -> dict[str, float]:
        """The share of every parameter's posterior variance that is due to the emulator's error.

        One minus the variance without that error over the variance with it, but not below zero, nor above
        `error_ratio`: more is the sampling error of the two variances. Where the emulator's error is large, it also
        shifts the posterior, and the share is of little meaning.
        """
        pairs = zip(self.marginals.items(), self.without_emulator_error.marginals.values(), strict=True)
        shares = {symbol: 1 - (exact.sd / marginal.sd) ** 2 for (symbol, marginal), exact in pairs}
        return {symbol: min(max(0.0, share), self.error_ratio) for symbol, share in shares.items()}

    @cached_property
    def error_ratio(self) -> float:
        """The largest variance of the emulator's error over that of noise and discrepancy, in any direction.

        The mean over the posterior: an upper bound of the error's effect, often far above it.
        """
        return self.likelihood.error_ratio(self.draws(ERROR_DRAWS))

    def draws(self, count: int) -> FloatArray:
        """Return equally probable draws (count, D) of all parameters."""
        return self.posterior.thinned(count)

    def summary(self, prob: float = 0.95) -> pd.DataFrame:
        """Return mean, sd, median and highest-density interval of every parameter, in the forward model's units.

        Returns
        -------
        pandas.DataFrame
            Indexed by parameter: mean, sd, median, hdi_low, hdi_high, ess, rhat (nan where no chains were run) and
            emulator_share, the share of the variance that is due to the emulator's error.
        """
        import pandas as pd

        check_probability(prob)
        rows = [
            (marginal.mean, marginal.sd, float(marginal.quantile(0.5)), *marginal.hdi(prob), self.posterior.ess[symbol],
             self.posterior.rhat.get(symbol, np.nan), self.emulator_share[symbol])
            for symbol, marginal in self.marginals.items()
        ]  # fmt: skip
        names = ["mean", "sd", "median", "hdi_low", "hdi_high", "ess", "rhat", "emulator_share"]
        return pd.DataFrame(rows, pd.Index(self.problem.symbols, name="parameter"), names)

    def predict(self, *, discrepancy: bool = True, noise: bool = True, prob: float = 0.95) -> pd.DataFrame:
        """Return the predicted outputs at the measured controls.

        Parameters
        ----------
        discrepancy : bool
            Add the discrepancy to the forward model.
        noise : bool
            Predict a new measurement, with its noise, in place of the quantity itself.
        prob : float
            Probability between low and high, equal tails.

        Returns
        -------
        pandas.DataFrame
            Columns control, mean, low, high; and quantity, where several were measured.
        """
        import pandas as pd

        check_probability(prob)
        check_switches(discrepancy=discrepancy, noise=noise)
        mean, variance = self.likelihood.predictions(self.draws(PREDICTION_DRAWS), discrepancy=discrepancy, noise=noise)
        mixture = Mixtures(np.full(len(mean), 1 / len(mean)), mean, variance)
        low, high = (mixture.quantile(tail) for tail in (0.5 - 0.5 * prob, 0.5 + 0.5 * prob))
        table = pd.DataFrame({"control": self.problem.control, "mean": mixture.mean, "low": low, "high": high})
        if len(self.problem.quantities) > 1:
            counts = [stop - start for start, stop in self.problem.quantities.values()]
            table.insert(0, "quantity", np.repeat(list(self.problem.quantities), counts))
        return table

    def predictive_coverage(self, *, discrepancy: bool = True, prob: float = 0.95) -> float:
        """Return the share of the measurements inside their predictive band (a check of the fit, not of parameters)."""
        band = self.predict(discrepancy=discrepancy, prob=prob)
        measured = self.problem.measured
        return float(((band["low"].to_numpy() <= measured) & (measured <= band["high"].to_numpy())).mean())

    @cached_property
    def data(self) -> xr.DataTree:
        """Everything as labelled arrays that ArviZ reads.

        Groups posterior and posterior_predictive (chain, draw), observed_data, constant_data, and forward_runs
        (parameters, outputs, errors).
        """
        return tree_of(self._groups)

    @cached_property
    def _groups(self) -> dict[str, LabelledGroup]:
        return labelled_arrays(self)

    def posterior_of(
        self, material: str | Material, stretch: tuple[float, float], *, mode: str = "uniaxial", unit: str = "MPa"
    ) -> Posterior:
        """Return the posterior of the material whose parameters these are, as `tissuq.fit` gives one of a test.

        It can be saved, loaded (`tissuq.load`), predicted from, exported and handed to finite elements. The
        discrepancy is one of what was measured, and no part of it.

        Parameters
        ----------
        material : str or Material
            The law in the forward model, all parameters of which were calibrated by their names.
        stretch : (float, float)
            Smallest and largest stretch in the forward model: the range in which the material counts as calibrated.
        mode : str
            The loading mode of that range.
        unit : str
            Unit of stress of the forward model's parameters.

        Raises
        ------
        InputError
            When a parameter of the material was not calibrated, or the range is none.

        Examples
        --------
        >>> import numpy as np
        >>> import tissuq as tq
        >>> depth = np.linspace(0.1, 1, 8)
        >>> found = tq.calibrate(depth, 30 * depth + 0.1 * np.sin(9 * depth), lambda p, x: 2 * p["C10"] * x,
        ...                      {"C10": tq.Uniform(5, 40)}, noise_sd=0.1, runs=8)  # C10 in kPa
        >>> posterior = found.posterior_of("neo-hookean", (0.7, 1.3), unit="kPa")
        >>> float(posterior.predict([1.2], noise=False)["median"].iloc[0].round(1))  # 2 C10 (l - 1 / l^2), kPa
        15.2
        """
        from tissuq.emulation.material_posterior import material_posterior

        return material_posterior(
            self.problem, self.posterior, material, stretch, mode=mode, unit=unit, runs=len(self.runs), seed=self.seed
        )

    def save(self, path: str | Path) -> None:
        """Write `data` as NetCDF, which ArviZ and xarray open."""
        save_groups(self._groups, Path(path))

    def __repr__(self) -> str:
        return (
            f"<Calibration of {', '.join(self.problem.symbols)}: discrepancy {self.problem.discrepancy.name}, "
            f"{len(self.problem.measured)} measurements, {len(self.runs)} runs, {self.posterior.method}>"
        )


PREDICTIVE_STRIDE = 4
"""Stride of the draws for which measurements are simulated."""


def labelled_arrays(calibration: Calibration) -> dict[str, LabelledGroup]:
    """Return draws, measurements as simulated and as made, and forward runs: the groups of `Calibration.data`."""
    problem, runs, drawn = calibration.problem, calibration.runs, calibration.posterior.draws
    chains, draws = np.arange(drawn.shape[0]), np.arange(drawn.shape[1])
    sample, thinned_sample = {"chain": chains, "draw": draws}, {"chain": chains, "draw": draws[::PREDICTIVE_STRIDE]}
    thinned = drawn[:, ::PREDICTIVE_STRIDE]
    flat = thinned.reshape(-1, drawn.shape[2])
    scores = np.random.default_rng([calibration.seed, 59]).standard_normal((len(flat), len(problem.measured)))
    simulated = calibration.likelihood.replicates(flat, scores).reshape(*thinned.shape[:2], -1)
    point, run = {"measurement": np.arange(len(problem.measured))}, {"run": np.arange(len(runs))}
    columns = enumerate(problem.symbols)
    return {
        "/": LabelledGroup(attrs=_labels(calibration)),
        "posterior": LabelledGroup(
            {symbol: (("chain", "draw"), drawn[:, :, column]) for column, symbol in columns}, sample
        ),
        "posterior_predictive": LabelledGroup(
            {"measured": (("chain", "draw", "measurement"), simulated)}, thinned_sample | point
        ),
        "observed_data": LabelledGroup({"measured": ("measurement", problem.measured)}, point),
        "constant_data": LabelledGroup({"control": ("measurement", problem.control)}, point),
        "forward_runs": LabelledGroup(
            {
                "parameters": (("run", "parameter"), runs.points),
                "outputs": (("run", "measurement"), runs.outputs),
                "error": ("run", np.array(runs.errors, dtype=str)),
                "seconds": ("run", runs.seconds),
            },
            point | run | {"parameter": list(runs.symbols)},
        ),
    }


def _labels(calibration: Calibration) -> dict[str, str | float]:
    problem, posterior = calibration.problem, calibration.posterior
    labels: dict[str, str | float] = {
        "inference_library": "tissuq",
        "discrepancy": problem.discrepancy.name,
        "noise_sd": ", ".join(str(sd or "unknown") for sd in problem.noise_sd.values()),
        "method": posterior.method,
        "converged": str(posterior.converged),
        "verdict": posterior.verdict,
        "seed": calibration.seed,
        "emulator_check": str(calibration.check),
    }
    labels |= {f"prior_{symbol}": str(prior) for symbol, prior in problem.priors.items()}
    return labels if posterior.log_evidence is None else labels | {"log_evidence": posterior.log_evidence}
