"""Every test predicted from the others: whether what was learnt in some modes holds in another."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments.experiment import Experiment
from tissuq.fitting import fit
from tissuq.posterior import Posterior

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["held_out_tests", "prediction_of"]


def held_out_tests(tests: Sequence[Experiment], **options: Any) -> pd.DataFrame:
    """Predict every test from a fit of the others.

    Parameters
    ----------
    tests : sequence of Experiment
        Two or more, in any modes.
    options
        Those of `tissuq.fit`; noise of each test is not taken.

    Returns
    -------
    pandas.DataFrame
        One row a test, as `prediction_of` describes it, and median and 95 % interval of the headline parameter from the
        others.

    Raises
    ------
    InputError
        When there are fewer than two tests.

    Examples
    --------
    >>> import tissuq as tq
    >>> stretch = [1.05, 1.1, 1.15, 1.2, 1.25, 1.3, 1.35, 1.4]
    >>> modes = ["uniaxial", "planar", "equibiaxial"]
    >>> tests = [tq.simulate("neo-hookean", {"C10": 0.5}, stretch, 0.01, mode=mode, seed=2) for mode in modes]
    >>> found = tq.held_out_tests(tests, discrepancy="none", noise_sd=0.01)
    >>> found["inside"].min() > 0.8
    True
    """
    import pandas as pd

    if len(tests) < 2:
        raise InputError("to predict a test from the others there must be two or more.")
    rows = []
    for place, test in enumerate(tests):
        posterior = fit([other for number, other in enumerate(tests) if number != place], **options)
        headline = posterior.summary(parameters=[posterior.model.headline]).iloc[0]
        own = {f"{posterior.model.headline}_{name}": headline[name] for name in ("median", "hdi_low", "hdi_high")}
        rows += [each | own for each in prediction_of(posterior, test)]
    return pd.DataFrame(rows)


def prediction_of(posterior: Posterior, test: Experiment, prob: float = 0.95) -> list[dict[str, Any]]:
    """Return how a posterior predicts a test that it has not seen, a row for each of its stresses.

    Returns
    -------
    list of dict
        test, mode, measured; ``inside``, the share of measurements in the predictive band; ``half_width`` and
        ``error``, root mean squares of the band's half width and of the error of its mean, over that of the stress; and
        ``half_width_median``, the median of the half width over the predicted stress. Measurements at which nothing is
        stressed are left out, and the band is one with an error of the whole test.
    """
    rows = []
    for number, stress in enumerate(test.stress.reshape(len(test), -1).T):
        used = stress != 0
        band = posterior.predict(test.stretch[used], mode=test.mode, channel=number, prob=prob)
        measured, half = stress[used], 0.5 * (band["high"] - band["low"]).to_numpy()
        mean, size = band["mean"].to_numpy(), float(np.sqrt((measured**2).mean()))
        rows.append(
            {
                "test": test.name,
                "mode": test.mode.name,
                "measured": test.mode.stresses[number],
                "inside": float(np.mean(np.abs(measured - 0.5 * (band["high"] + band["low"])) <= half)),
                "half_width": float(np.sqrt((half**2).mean())) / size,
                "half_width_median": float(np.median(half / np.abs(mean))),
                "error": float(np.sqrt(((mean - measured) ** 2).mean())) / size,
            }
        )
    return rows
