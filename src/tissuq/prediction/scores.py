"""How well measurements that a posterior has not seen are predicted: coverage, scores and errors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tissuq.arrays import BoolArray, FloatArray
from tissuq.errors import InputError
from tissuq.experiments.curve import Curve
from tissuq.inference.solution import Solution
from tissuq.prediction.bands import asked_for, centre_and_ends, predictive_mixtures


def interval_score(low: FloatArray, high: FloatArray, values: FloatArray, prob: float) -> FloatArray:
    """Return the width of central intervals, and 2 / (1 - prob) times by how far values lie outside; small is good.

    References
    ----------
    Gneiting & Raftery (2007), Strictly proper scoring rules, prediction, and estimation, Journal of the American
    Statistical Association 102, 359-378, eq. 43.
    """
    outside = np.maximum(low - values, 0) + np.maximum(values - high, 0)
    return np.asarray(high - low + 2 / (1 - prob) * outside)


@dataclass(frozen=True, eq=False)
class Judged:
    """Measurements of one stress beside what was predicted of each, all of shape (n,) and in MPa.

    Attributes
    ----------
    points : (n,) or (n, c) array
        Of the loading mode.
    measured, median, low, high, crps : (n,) array
        The measurement; median and ends of the predictive interval; the score of the distribution (`Mixtures.crps`).
    prob : float
        Probability of the interval.
    """

    points: FloatArray
    measured: FloatArray
    median: FloatArray
    low: FloatArray
    high: FloatArray
    crps: FloatArray
    prob: float

    @property
    def is_inside(self) -> BoolArray:
        """Which measurements (n,) lie in the interval."""
        return np.asarray((self.low <= self.measured) & (self.measured <= self.high))

    def times(self, ratio: FloatArray) -> Judged:
        """Return the same of stresses that are so many times (n,) those here."""
        names = ("measured", "median", "low", "high", "crps")
        return replace(self, **{name: getattr(self, name) * ratio for name in names})

    def where(self, selected: BoolArray) -> Judged:
        """Return some of them."""
        columns = {name: value[selected] for name, value in vars(self).items() if name != "prob"}
        return Judged(**columns, prob=self.prob)

    def summary(self) -> dict[str, float]:
        """Return the scores of all together; nan where there are no measurements.

        ``inside``, the share of measurements in the interval; root mean squares of the interval's half width
        (``half_width``) and of the median's error (``error``), over that of the measurements; and the means of ``crps``
        and ``interval_score``, MPa.
        """
        if not len(self.measured):
            return dict.fromkeys(("inside", "half_width", "error", "crps", "interval_score"), np.nan)
        size = root_mean_square(self.measured)
        return {
            "inside": float(self.is_inside.mean()),
            "half_width": root_mean_square(0.5 * (self.high - self.low)) / size,
            "error": root_mean_square(self.median - self.measured) / size,
            "crps": float(self.crps.mean()),
            "interval_score": float(interval_score(self.low, self.high, self.measured, self.prob).mean()),
        }


def judged(solution: Solution, curve: Curve, *, discrepancy: bool = True, prob: float = 0.95) -> Judged:
    """Return the measurements of a curve beside the predictions of a new test with noise.

    Measurements without stress are left out: at rest it is zero by definition. Where the posterior is of means of
    several measurements, means of as many are predicted.

    Raises
    ------
    InputError, ModelError
        When the posterior cannot predict the test's mode, or nothing is left.
    """
    curve = curve.in_means_of(solution.model.experiment.averaged_at_most)
    points, measured = curve.points[curve.stress != 0], curve.stress[curve.stress != 0]
    if not len(measured):
        raise InputError(f"experiment '{curve.name}' has no stress other than zero, and nothing to compare with.")
    options: dict[str, Any] = {"discrepancy": discrepancy}
    mode, _ = asked_for([solution], points, **options, prob=prob, mode=curve.mode, channel=curve.channel)
    rows, start = [], 0
    blocks = predictive_mixtures([(1.0, solution)], points, mode, curve.channel, **options, noises=(True,))
    for (mixture,) in blocks:
        block = measured[start : start + mixture.means.shape[1]]
        start += len(block)
        rows.append([*map(mixture.quantile, centre_and_ends(prob)), mixture.crps(block)])
    median, low, high, crps = np.concatenate(rows, axis=1)
    return Judged(points, measured, median, low, high, crps, prob)


def root_mean_square(values: FloatArray) -> float:
    """Return the root of the mean of the squares of values."""
    return float(np.sqrt((values**2).mean()))
