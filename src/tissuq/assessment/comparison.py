"""Fits of the same data side by side: evidence, predictive density, and weights for predictions."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["compare"]


def compare(fits: Mapping[str, Any]) -> pd.DataFrame:
    """Return fits of the same measurements side by side, that with the most evidence first.

    Parameters
    ----------
    fits : mapping of str to Posterior or xarray.DataTree
        By name; trees are those of `Posterior.data`, as saved files hold them.

    Returns
    -------
    pandas.DataFrame
        Indexed by name. log_evidence; log_bayes_factor against the best; probability, were all as probable before the
        data; elpd, the expected log density of new measurements by leave-one-out (PSIS, conditional on the others in
        closed form where the discrepancy is a process), elpd_difference to the best and its standard error; and
        stacking, weights for an average of *predictions*: they say nothing of parameters. Where no evidence is known,
        it and what follows from it are missing. is_rough marks leave-one-out values that importance sampling cannot
        tell.

    Raises
    ------
    InputError
        When there are fewer than two fits, or they are not of the same data.

    References
    ----------
    Vehtari, Gelman & Gabry (2017), Statistics and Computing 27, 1413-1432 (PSIS-LOO); Yao, Vehtari, Simpson & Gelman
    (2018), Bayesian Analysis 13, 917-1007 (stacking).

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
    import xarray as xr
    from arviz_stats import compare as compare_by_loo

    trees = {name: fit if isinstance(fit, xr.DataTree) else fit.data for name, fit in fits.items()}
    _check(trees)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what they say is in the column is_rough
        by_loo = compare_by_loo(trees)
    by_loo = by_loo.loc[list(trees)]
    evidence = pd.Series({name: float(tree.attrs.get("log_evidence", np.nan)) for name, tree in trees.items()})
    factor = evidence - evidence.max()
    table = pd.DataFrame(
        {
            "log_evidence": evidence,
            "log_bayes_factor": factor,
            "probability": np.exp(factor) / np.exp(factor).sum(),
            "elpd": by_loo["elpd"].astype(float),
            "elpd_difference": by_loo["elpd_diff"].astype(float),
            "elpd_difference_error": by_loo["dse"].astype(float),
            "stacking": by_loo["weight"].astype(float),
            "is_rough": by_loo["warning"].astype(bool),
        }
    )
    return table.sort_values(["log_evidence", "elpd"], ascending=False)


def _check(trees: Mapping[str, Any]) -> None:
    if len(trees) < 2:
        raise InputError("give two fits or more to compare.")
    names = list(trees)
    for name, tree in trees.items():
        if not {"observed_data", "constant_data", "log_likelihood"} <= set(tree.children):
            raise InputError(f"'{name}' is no posterior of tissuq: it has no measurements or no log likelihood.")
    first = trees[names[0]]
    for name in names[1:]:
        if trees[name].attrs.get("loading_mode") != first.attrs.get("loading_mode"):
            raise InputError(f"'{names[0]}' and '{name}' are fits of different loading modes.")
        for group, variable in (("observed_data", "stress"), ("constant_data", "stretch")):
            one, other = first[group][variable].to_numpy(), trees[name][group][variable].to_numpy()
            if one.shape != other.shape or not np.array_equal(one, other):
                raise InputError(
                    f"'{names[0]}' and '{name}' are fits of different measurements: only those of the same compare."
                )
