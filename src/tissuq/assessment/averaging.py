"""Fits of the same data averaged by their evidence: one posterior of the material's parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from tissuq.errors import InputError
from tissuq.experiments.modes import LoadingMode
from tissuq.inference.marginal import Marginal, blended
from tissuq.inference.solution import Marginals, Solution
from tissuq.prediction.bands import predict_average

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Average", "average"]

NEGLIGIBLE_WEIGHT = 1e-9
"""Weight below which a fit is omitted from marginals and predictions."""


@dataclass(frozen=True, eq=False)
class Average:
    """A mixture of posteriors of the same material's parameters, from the same data.

    Attributes
    ----------
    weights : dict of str to float
        Posterior probabilities of the fits, were all as probable before the data; they sum to one.
    solutions : dict of str to Solution
        The fits.
    """

    weights: Mapping[str, float]
    solutions: Mapping[str, Solution]

    @cached_property
    def marginals(self) -> Mapping[str, Marginal]:
        """The marginal posterior of every parameter of the material: density, quantiles, HDI."""
        solution = next(iter(self.solutions.values()))
        return Marginals(solution.model.material_symbols, self._marginal)

    def summary(self, prob: float = 0.95) -> pd.DataFrame:
        """Return mean, sd and the highest-density interval of every parameter of the material.

        Parameters
        ----------
        prob : float
            Probability inside the interval.

        Returns
        -------
        pandas.DataFrame
            Indexed by parameter: mean, sd, hdi_low, hdi_high.
        """
        import pandas as pd

        if not 0 < prob < 1:
            raise InputError(f"prob must be between 0 and 1, not {prob}.")
        rows = [(marginal.mean, marginal.sd, *marginal.hdi(prob)) for marginal in self.marginals.values()]
        index = pd.Index(list(self.marginals), name="parameter")
        return pd.DataFrame(np.array(rows), index, ["mean", "sd", "hdi_low", "hdi_high"])

    def predict(
        self,
        stretch: ArrayLike,
        *,
        discrepancy: bool = True,
        noise: bool = True,
        prob: float = 0.95,
        mode: str | LoadingMode | None = None,
    ) -> pd.DataFrame:
        """Return the predicted engineering stress at new stretches; arguments and table are those of a posterior's."""
        import pandas as pd

        options: dict[str, Any] = {"discrepancy": discrepancy, "noise": noise, "prob": prob, "mode": mode}
        return pd.DataFrame(vars(predict_average(self._weighted_fits, stretch, **options)))

    def __repr__(self) -> str:
        return f"<Average of {', '.join(f'{name} {weight:.0%}' for name, weight in self.weights.items())}>"

    @property
    def _weighted_fits(self) -> list[tuple[float, Solution]]:
        """The fits that matter, with weights that sum to one."""
        weighted = [
            (self.weights[name], solution)
            for name, solution in self.solutions.items()
            if self.weights[name] > NEGLIGIBLE_WEIGHT
        ]
        total = sum(weight for weight, _ in weighted)
        return [(weight / total, solution) for weight, solution in weighted]

    def _marginal(self, symbol: str) -> Marginal:
        ends = np.array([solution.model.priors[symbol].support for _, solution in self._weighted_fits])
        marginals = [(weight, solution.marginals[symbol]) for weight, solution in self._weighted_fits]
        return blended(marginals, (float(ends[:, 0].min()), float(ends[:, 1].max())))


def average(fits: Mapping[str, Any]) -> Average:
    """Return the average of fits of the same data by their evidence, each as probable as the others before the data.

    The parameters keep their meaning in the fits: a fit whose discrepancy takes a share of the initial stiffness
    contributes that to the average with its weight.

    Parameters
    ----------
    fits : mapping of str to Posterior
        By name: the same material on the same measurements, with other discrepancies, noises or priors.

    Raises
    ------
    InputError
        When there are fewer than two fits, one has no evidence or has not converged, or they are of other data or
        another material.

    References
    ----------
    Hoeting, Madigan, Raftery & Volinsky (1999), Bayesian model averaging: a tutorial, Statistical Science 14, 382-417.

    Examples
    --------
    >>> import tissuq as tq
    >>> stretch = [0.7, 0.8, 0.9, 1.1, 1.2, 1.3, 1.4, 1.6, 1.8]
    >>> data = tq.simulate("neo-hookean", {"C10": 0.5}, stretch, noise_sd=0.05, seed=1)
    >>> found = tq.average({name: tq.fit(data, discrepancy=name, noise_sd=0.05) for name in ("none", "constant")})
    >>> found.weights["none"] > found.weights["constant"]
    True
    >>> list(found.summary().columns)
    ['mean', 'sd', 'hdi_low', 'hdi_high']
    """
    _check(fits)
    evidence = np.array([fit.log_evidence for fit in fits.values()])
    weights = np.exp(evidence - evidence.max())
    weights /= weights.sum()
    solutions = {name: fit.solution for name, fit in fits.items()}
    return Average(dict(zip(fits, weights.tolist(), strict=True)), solutions)


def _check(fits: Mapping[str, Any]) -> None:
    if len(fits) < 2:
        raise InputError("give two fits or more to average.")
    for name, fit in fits.items():
        if fit.log_evidence is None:
            raise InputError(
                f"'{name}' has no evidence, by which the average is weighted: fit it with the method 'auto', 'exact' "
                "or 'smc', and with no flat prior."
            )
        if fit.solution.is_approximate:
            raise InputError(f"'{name}' has not converged: leave it out, or fit it with another method.")
    first_name, first_fit = next(iter(fits.items()))
    for name, fit in fits.items():
        if not fit.model.experiment.has_measurements_of(first_fit.model.experiment):
            raise InputError(f"'{first_name}' and '{name}' are fits of different data: average fits of the same data.")
        if fit.model.material != first_fit.model.material:
            raise InputError(
                f"'{first_name}' and '{name}' are fits of different materials ({first_fit.model.material.name} and "
                f"{fit.model.material.name}), whose parameters mean different things: average fits of one material."
            )
