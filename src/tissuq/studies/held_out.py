"""Each test predicted from the others: whether what is learnt in some modes holds in another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from tissuq.assessment.stability import measured_states
from tissuq.errors import InputError
from tissuq.experiments.experiment import Experiment
from tissuq.posterior.fitting import fit
from tissuq.posterior.posterior import Posterior
from tissuq.prediction.scores import judged

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["held_out_tests", "prediction_of"]


def held_out_tests(tests: Sequence[Experiment] | Experiment, **options: Any) -> pd.DataFrame:
    """Predict every test from a fit of the others.

    Parameters
    ----------
    tests : sequence of Experiment, or an Experiment of several tests
        Two or more, in any modes.
    options
        Those of `tissuq.fit`; noise of each test is not taken.

    Returns
    -------
    pandas.DataFrame
        One row a test, as `prediction_of` describes it, and median and 95 % interval of the headline parameter from the
        others, MPa.

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
    >>> bool(found["inside"].min() > 0.8)
    True
    """
    import pandas as pd

    tests = tests.tests if isinstance(tests, Experiment) else tests
    if len(tests) < 2:
        raise InputError("predicting a test from the others needs two or more tests.")
    if isinstance(options.get("noise_sd"), Sequence) and not isinstance(options["noise_sd"], str):
        raise InputError("to predict a test from the others give one noise_sd for all tests, or leave it unknown.")
    if isinstance(options.get("tolerances"), Mapping | None):  # those of all tests, of which one alone has none
        model = fit(tests, **options).model
        options |= {"tolerances": model.tolerances, "discrepancy": model.discrepancy}
    rows = []
    for index, test in enumerate(tests):
        posterior = fit([training_test for number, training_test in enumerate(tests) if number != index], **options)
        headline = posterior.summary(parameters=[posterior.model.headline], unit="MPa").iloc[0]
        estimates = {f"{posterior.model.headline}_{name}": headline[name] for name in ("median", "hdi_low", "hdi_high")}
        rows += [row | estimates for row in prediction_of(posterior, test)]
    return pd.DataFrame(rows)


def prediction_of(posterior: Posterior, test: Experiment) -> list[dict[str, Any]]:
    """Return how a posterior predicts a test that it has not seen, a row for each of its stresses.

    Returns
    -------
    list of dict
        test, mode, measured; ``inside``, the share of measurements in the predictive band; ``beyond``, the share of
        them whose state is beyond those in the data of the posterior; and of the others the further
        scores of `tissuq.prediction.scores.Judged.summary`. Measurements without stress are left out, and the band is
        that of a new test with an error of its own.
    """
    measured, rows = measured_states(posterior.model, is_directed=posterior.solution.is_directed), []
    for curve in test.curves:
        judged_all = judged(posterior.solution, curve)
        calibrated = measured.contain(curve.path.at(judged_all.points))
        labels: dict[str, Any] = {"test": curve.name, "mode": curve.mode.name, "measured": curve.quantity}
        shares = {"inside": float(judged_all.is_inside.mean()), "beyond": float(1 - calibrated.mean())}
        rows.append(labels | judged_all.where(calibrated).summary() | shares)
    return rows
