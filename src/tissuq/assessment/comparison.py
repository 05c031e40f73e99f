"""Fits of the same data side by side, and averaged by their evidence."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tissuq.arrays import BoolArray, FloatArray
from tissuq.assessment.named_fits import named_fits
from tissuq.assessment.sensitivity import SCALE_FACTORS
from tissuq.assessment.stability import is_calibrated
from tissuq.errors import InputError
from tissuq.experiments.checked_arrays import FOUR_DIGITS, agree, headed, in_unit
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import LoadingMode
from tissuq.experiments.units import StressUnit, stress_unit
from tissuq.inference.marginal import Marginal, blended
from tissuq.inference.solution import Marginals, Solution
from tissuq.parameters.checks import check_probability
from tissuq.prediction.bands import predict_bands, stress_ratio
from tissuq.prediction.densities import MAX_KHAT
from tissuq.prediction.scores import judged

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

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
            Indexed by parameter: mean, sd, hdi_low, hdi_high; in the unit of the measurements.
        """
        import pandas as pd

        check_probability(prob)
        rows = [(marginal.mean, marginal.sd, *marginal.hdi(prob)) for marginal in self.marginals.values()]
        parameters = next(iter(self.solutions.values())).model.material.parameters
        scales = [[self._unit.to_mpa if parameter.unit else 1.0] for parameter in parameters]
        index = pd.Index(list(self.marginals), name="parameter")
        table = pd.DataFrame(np.array(rows) / np.array(scales), index, ["mean", "sd", "hdi_low", "hdi_high"])
        return headed(table, self._unit)

    def predict(
        self,
        stretch: ArrayLike,
        *,
        discrepancy: bool = True,
        noise: bool = True,
        prob: float = 0.95,
        mode: str | LoadingMode | None = None,
    ) -> pd.DataFrame:
        """Return the predicted engineering stress at new stretches, as a posterior does."""
        import pandas as pd

        options: dict[str, Any] = {"discrepancy": discrepancy, "prob": prob, "mode": mode}
        (band,) = predict_bands(self._weighted_fits, stretch, (noise,), **options)
        table = pd.DataFrame(vars(band))
        return in_unit(table, ["median", "low", "high"], self._unit.name)

    def _repr_html_(self) -> str:
        """Return weights and summary, which notebooks show."""
        return f"<p>{escape(repr(self))}</p>{self.summary().to_html(float_format='{:.4g}'.format)}"

    def __repr__(self) -> str:
        return f"<Average of {', '.join(f'{name} {100 * weight:.0f} %' for name, weight in self.weights.items())}>"

    @property
    def _unit(self) -> StressUnit:
        """The unit of stress of the measurements."""
        return stress_unit(next(iter(self.solutions.values())).model.experiment.stress_unit)

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


def average(fits: Mapping[str, Any] | Sequence[Any]) -> Average:
    """Return the average of fits of the same data by their evidence, each as probable as the others before the data.

    The parameters keep their meaning in the fits: a fit whose discrepancy takes a share of the initial stiffness
    contributes that to the average with its weight.

    Parameters
    ----------
    fits : mapping of str to Posterior, or sequence of Posterior
        By name, or as of `named_fits`: the same material on the same measurements, with other discrepancies, noises or
        priors.

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
    fits = named_fits(fits)
    _check_average(fits)
    evidence = np.array([fit.log_evidence for fit in fits.values()])
    weights = np.exp(evidence - evidence.max())
    weights /= weights.sum()
    solutions = {name: fit.solution for name, fit in fits.items()}
    return Average(dict(zip(fits, weights.tolist(), strict=True)), solutions)


def _check_average(fits: Mapping[str, Any]) -> None:
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


INITIAL_SHEAR_MODULUS = "initial shear modulus"
COMPARED = {"observed_data": {"stress"}, "constant_data": {"stretch"}, "leave_one_out": {"log_density", "is_rough"}}
"""What is compared of trees: arrays by group."""
EVIDENCE_CHANGES = (*SCALE_FACTORS, "boxes")
"""Changes of priors for which the change of the log evidence is given."""


def compare(fits: Mapping[str, Any] | Sequence[Any], unit: str | None = None) -> pd.DataFrame:
    """Return fits of the same measurements side by side, that with the most evidence first.

    Parameters
    ----------
    fits : mapping of str to Posterior or xarray.DataTree, or sequence of these
        By name, those of a sequence named by material and discrepancy; trees are those of `Posterior.data`, as saved
        files hold them.
    unit : str, optional
        Of stress, such as ``"MPa"``; that of the measurements of the first, unless given. It stands at the head of the
        columns.

    Returns
    -------
    pandas.DataFrame
        Indexed by name; unknown numbers are missing, such as all that follow from an unknown evidence.

        - log_evidence and log_evidence_error, that of its integration; log_bayes_factor against the best, and
          probability, were all as probable before the data.
        - log_bayes_factor_low and _high: its least and largest values with the prior scales of the discrepancies'
          random parts a quarter or fourfold, and with the uniform boxes of linear parameters four times as wide, each
          in all fits at once. evidence_change_quarter, _fourfold and _boxes are the changes of the log evidence from
          which they come. Other fits of the same data give the first two, unless a sampler would be needed; of saved
          trees they are known where the tree has an attribute of that name.
        - elpd, the expected log density of new measurements by leave-one-out; elpd_difference, by how much it falls
          short of the best, and its standard error. Each measurement's density given the others is a closed form
          at given nonlinear parameters, whose posterior without it follows by importance weights
          (`tissuq.prediction.densities`). is_rough marks fits in which too few of these weights are effective.
        - stacking: weights for an average of *predictions*, not of parameters.
        - parameter, median, hdi_low, hdi_high: the material's first parameter and its 95 % interval, in the unit; the
          initial shear modulus where materials differ, as their parameters mean different things.
        - intervals_of: what the interval is of.

    Raises
    ------
    InputError
        When there are fewer than two fits, or they are not of the same data.

    References
    ----------
    Vehtari, Gelman & Gabry (2017), Statistics and Computing 27, 1413-1432 (leave-one-out); Yao, Vehtari, Simpson &
    Gelman (2018), Bayesian Analysis 13, 917-1007 (stacking).

    Examples
    --------
    >>> import tissuq as tq
    >>> stretch = [0.7, 0.8, 0.9, 1.1, 1.2, 1.3, 1.4, 1.6, 1.8]
    >>> data = tq.simulate("yeoh", {"C10": 0.5, "C20": 0.1, "C30": 0.0}, stretch, noise_sd=0.05, seed=1)
    >>> table = tq.compare({name: tq.fit(data, discrepancy=name, noise_sd=0.05) for name in ("none", "auto")})
    >>> list(table.index)
    ['auto', 'none']
    """
    import pandas as pd

    trees = {name: _tree(fit) for name, fit in named_fits(fits).items()}
    _check_comparable(trees)
    evidence = _numbers(trees, "log_evidence")
    factor = evidence - np.nanmax([*evidence, -np.inf])
    changes = {f"evidence_change_{name}": _numbers(trees, f"evidence_change_{name}") for name in EVIDENCE_CHANGES}
    best = int(np.argmax(np.nan_to_num(factor, nan=-np.inf)))
    factors = np.array([factor, *(factor + change - change[best] for change in changes.values())])
    table = pd.DataFrame(
        {
            "log_evidence": evidence,
            "log_evidence_error": _numbers(trees, "log_evidence_error"),
            "log_bayes_factor": factor,
            "log_bayes_factor_low": factors.min(axis=0),
            "log_bayes_factor_high": factors.max(axis=0),
            "probability": np.exp(factor) / np.nansum(np.exp(factor)),
            **changes,
            **_by_leave_one_out(trees),
            **_parameter(trees),
            "intervals_of": [tree.attrs.get("intervals_of", "") for tree in trees.values()],
        },
        list(trees),
    )
    ordered = table.sort_values(["log_evidence", "elpd"], ascending=False)
    measured = next(iter(trees.values()))["observed_data"]["stress"].attrs.get("units", "MPa")
    return in_unit(ordered, ["median", "hdi_low", "hdi_high"], unit or measured)


def _tree(fit: Any) -> xr.DataTree:
    """Return a fit as a tree; for one in memory, with the changes of its evidence from other fits of its data."""
    import xarray as xr

    if isinstance(fit, xr.DataTree):
        return fit
    tree: xr.DataTree = fit.data.copy()
    if fit.diagnostics is None and not all(f"evidence_change_{name}" in tree.attrs for name in EVIDENCE_CHANGES):
        tree.attrs |= {f"evidence_change_{name}": value for name, value in fit.assess().evidence_changes.items()}
    return tree


def _numbers(trees: Mapping[str, xr.DataTree], name: str) -> FloatArray:
    """Return a number that the fits' attributes give; nan where they do not."""
    found = {fit: tree.attrs.get(name, np.nan) for fit, tree in trees.items()}
    for fit, number in found.items():
        if isinstance(number, str):
            raise InputError(f"the attribute '{name}' of '{fit}' is no number, but '{number}': run the fit again.")
    return np.array([float(number) for number in found.values()])


def _parameter(trees: Mapping[str, xr.DataTree]) -> dict[str, Any]:
    """Return the first parameter of the material of all fits, or their initial shear modulus where materials differ."""
    is_one_material = len({tree.attrs.get("material") for tree in trees.values()}) == 1
    names = [tree.attrs.get("headline", "") if is_one_material else INITIAL_SHEAR_MODULUS for tree in trees.values()]
    label = "headline" if is_one_material else "modulus"
    return {"parameter": names} | {
        name: _numbers(trees, f"{label}_{name}") for name in ("median", "hdi_low", "hdi_high")
    }


def _by_leave_one_out(trees: Mapping[str, xr.DataTree]) -> dict[str, NDArray[Any]]:
    """Return ArviZ's comparison of fits by leave-one-out densities."""
    from arviz_stats import compare as compare_by_loo
    from arviz_stats.utils import ELPDData

    elpds = {}
    for name, tree in trees.items():
        density, is_rough = tree["leave_one_out"]["log_density"], tree["leave_one_out"]["is_rough"]
        n = density.size
        elpd, error = float(density.sum()), float(np.sqrt(n * density.var()))
        rough = bool(is_rough.any())
        elpds[name] = ELPDData("loo", elpd, error, np.nan, 0, n, "log", rough, MAX_KHAT, density)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the column is_rough has their content
        table = compare_by_loo(elpds).loc[list(trees)]
    return {
        "elpd": table["elpd"].to_numpy(float),
        "elpd_difference": table["elpd_diff"].to_numpy(float),
        "elpd_difference_error": table["dse"].to_numpy(float),
        "stacking": table["weight"].to_numpy(float),
        "is_rough": table["warning"].to_numpy(bool),
    }


def _check_comparable(trees: Mapping[str, Any]) -> None:
    if len(trees) < 2:
        raise InputError("give two fits or more to compare.")
    names = list(trees)
    for name, tree in trees.items():
        has_all = all(group in tree.children and held <= set(tree[group].variables) for group, held in COMPARED.items())
        if not has_all or tree["leave_one_out"]["log_density"].size != tree["observed_data"]["stress"].size:
            raise InputError(
                f"'{name}' is no fit of measured stresses, of which each was left out in turn: compare runs of tissuq "
                "fit of the same measurements."
            )
    first_tree = trees[names[0]]
    for name in names[1:]:
        if trees[name].attrs.get("loading_mode") != first_tree.attrs.get("loading_mode"):
            raise InputError(f"'{names[0]}' and '{name}' are fits of different loading modes.")
        for group, variable in (("observed_data", "stress"), ("constant_data", "stretch")):
            values, other_values = (values_in_mpa(tree[group][variable]) for tree in (first_tree, trees[name]))
            if not agree(values, other_values, FOUR_DIGITS):
                raise InputError(
                    f"'{names[0]}' and '{name}' are fits of different measurements: compare fits of the same ones."
                )


def values_in_mpa(values: Any) -> FloatArray:
    """Return values of a saved array, those of a stress in MPa, in which earlier files have them.

    A unit is that of all stresses.
    """
    units = values.attrs.get("units", "1")
    return np.asarray(values.to_numpy() * (1.0 if units == "1" else stress_unit(units).to_mpa))


def scores_of(
    solution: Solution, test: Experiment, *, discrepancy: bool, prob: float, stress_type: str
) -> pd.DataFrame:
    """Return the scores of a test, or of several joined; `Posterior.scores` defines them."""
    import pandas as pd

    rows: list[dict[str, Any]] = []
    for curve in test.curves:
        ratio = stress_ratio(stress_type, curve.mode, curve.channel)
        predicted = judged(solution, curve, discrepancy=discrepancy, prob=prob)
        predicted = predicted.times(ratio(predicted.points))
        labels = {"test": curve.name, "mode": curve.mode.name, "measured": curve.quantity}
        is_measured = is_calibrated(solution.model, curve.mode, predicted.points, is_directed=solution.is_directed)
        for name, in_range in _ranges(is_measured).items():
            rows.append(labels | {"range": name, "count": int(in_range.sum())} | predicted.where(in_range).summary())
    return pd.DataFrame(rows)


def _ranges(calibrated: BoolArray) -> dict[str, BoolArray]:
    """Return all measurements, and where some are beyond the calibrated range those on either side of its ends."""
    all_points = {"all": np.ones_like(calibrated)}
    ranges = {"calibrated": calibrated, "beyond": ~calibrated}
    return (
        all_points
        if calibrated.all()
        else all_points | {name: in_range for name, in_range in ranges.items() if in_range.any()}
    )
