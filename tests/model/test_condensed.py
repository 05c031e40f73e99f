"""Very many measurements, condensed: what inference and prediction make of them is what all rows would give."""

from dataclasses import replace

import numpy as np
import pytest

import tissuq as tq
from marks import slow_but
from tissuq.assessment.sensitivity import power_scaling
from tissuq.model.statistical_model import StatisticalModel
from tissuq.model.statistics import NODES_PER_PIECE
from tissuq.prediction.bands import inside_band, predict_band
from tissuq.prediction.densities import left_out_log_density

COUNT = 20_000
EVERY_ROW = {"tolerances": "as-tested"}
"""Without errors of the test, measurements are not averaged."""


def measured(seed: int = 1) -> tq.Experiment:
    """Many rows of a Yeoh material in random order, with noise of 0.2 MPa."""
    generator = np.random.default_rng(seed)
    stretch = generator.uniform(0.6, 2.0, COUNT)
    exact = 2.4 * (stretch - stretch**-2) - 0.228 * (stretch**3 - 3 * stretch + 1 + 3 * stretch**-2 - 2 * stretch**-3)
    return tq.Experiment("uniaxial", stretch, exact + generator.normal(0, 0.2, COUNT))


@pytest.fixture(scope="module")
def solution():
    """A fit of condensed measurements."""
    return tq.fit(measured(), discrepancy="yeoh", **EVERY_ROW).solution


@pytest.fixture
def as_rows(monkeypatch):
    """Return a function after which no model condenses its measurements."""
    return lambda: monkeypatch.setattr(StatisticalModel, "condensed", property(lambda self: None))


def test_scalar_products_of_condensed_rows_are_those_of_all_measurements():
    data = measured()
    model = StatisticalModel(data, tq.materials()["yeoh"](), tq.discrepancies()["auto"]())
    stretch = data.stretch
    columns = np.column_stack([2 * (stretch - stretch**-2), data.stress])  # the first column is that of C10
    rows = np.column_stack([model.design[:, 0], model.stress])
    assert len(rows) < COUNT / 100
    np.testing.assert_allclose(rows.T @ rows, columns.T @ columns, rtol=1e-12)
    features = model.energy_members[0].stress_features(data.states)[0]
    own = model.energy_features(0)[0]
    exact = features.T @ columns
    np.testing.assert_allclose(own.T @ rows, exact, atol=1e-9 * np.abs(exact).max())


def test_measurements_that_a_process_or_noise_ties_to_each_other_stay_rows():
    data = measured()
    for discrepancy, noise in (("gp", "unknown"), ("none", "proportional")):
        kind = tq.discrepancies()[discrepancy]()
        assert StatisticalModel(data, tq.materials()["yeoh"](), kind, noise).condensed is None


def test_functions_that_are_not_smooth_are_not_condensed():
    model = StatisticalModel(measured(), tq.materials()["yeoh"](), tq.discrepancies()["spline"]())
    assert model.condensed is None


def test_one_pass_serves_the_model_with_discrepancy_and_the_one_without():
    data = measured()
    both = [
        StatisticalModel(data, tq.materials()["yeoh"](), tq.discrepancies()[name]()).condensed
        for name in ("auto", "none")
    ]
    assert both[0] is both[1]
    assert len(both[0].points) % NODES_PER_PIECE == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("material", "discrepancy"),
    slow_but(
        [("neo-hookean", "taylor"), ("ogden-1", "none")],
        [("neo-hookean", "taylor"), ("neo-hookean", "auto"), ("ogden-1", "none")],
    ),
)
def test_posterior_is_that_of_all_rows(as_rows, material, discrepancy):
    data = measured()
    few = tq.fit(data, material=material, discrepancy=discrepancy, **EVERY_ROW)
    found = few.summary().to_numpy(), few.log_evidence
    as_rows()
    every = tq.fit(data, material=material, discrepancy=discrepancy, **EVERY_ROW)
    np.testing.assert_allclose(found[0], every.summary().to_numpy(), rtol=1e-8)
    assert found[1] == pytest.approx(every.log_evidence, abs=1e-6)


def test_measurements_left_out_have_the_density_that_all_rows_give(as_rows, solution):
    some = solution.mixture.thinned(4)
    found = left_out_log_density(solution.model, some)
    as_rows()
    np.testing.assert_allclose(found, left_out_log_density(replace(solution.model), some), atol=1e-7)


@pytest.mark.slow
def test_coverage_counts_measurements_inside_the_band_at_their_own_stretches(solution):
    data = solution.model.experiment
    band = predict_band(solution, data.stretch, discrepancy=True)
    inside = ((band.low <= data.stress) & (data.stress <= band.high)).mean()
    masks = [inside_band(solution, curve, discrepancy=True) for curve in solution.model.experiment.curves]
    assert np.concatenate(masks).mean() == pytest.approx(inside, abs=3e-4)


def test_power_scaling_needs_no_thinning_of_condensed_measurements(solution):
    assert power_scaling(solution) is not None


@pytest.mark.slow
def test_sampled_posterior_of_condensed_measurements_is_the_exact_one():
    exact, sampled = (
        tq.fit(measured(), material="ogden-1", discrepancy="none", method=m, **EVERY_ROW) for m in ("exact", "nuts")
    )
    sds = exact.summary()["sd"]
    away = (sampled.summary()["mean"] - exact.summary()["mean"]).abs() / sds
    assert (away < 0.25).all()  # about 1000 effective draws: 0.25 sd is eight standard errors
