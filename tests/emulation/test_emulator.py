"""The emulator beside models whose outputs are known everywhere."""

import numpy as np
import pytest

from forward_models import DEPTH, OGDEN, designed, neo_hooke, ogden, runs_at
from tissuq.emulation import ForwardRuns, emulate
from tissuq.emulation.output_basis import basis_of, output_moments
from tissuq.emulation.runs import space_filling
from tissuq.errors import InputError, ModelError
from tissuq.parameters.priors import LogNormal, LogUniform, Normal, Uniform


def elsewhere(function, priors, count=200):
    points = np.random.default_rng(5).random((count, len(priors)))
    points = np.column_stack([prior.quantile(column) for prior, column in zip(priors.values(), points.T, strict=True)])
    return points, runs_at(function, list(priors), points).outputs


@pytest.mark.slow
@pytest.mark.parametrize("prior", [Uniform(0.2, 5.0), LogUniform(0.01, 100.0)])
def test_outputs_proportional_to_a_parameter_are_emulated_to_rounding(prior):
    emulator = emulate(designed(neo_hooke, {"C10": prior}, 8), DEPTH)
    assert emulator.check(*elsewhere(neo_hooke, {"C10": prior})).relative_error < 1e-12


@pytest.mark.slow
def test_a_force_and_its_logarithm_are_told_apart():
    emulator = emulate(designed(ogden, OGDEN, 16), DEPTH)
    found = emulator.check(*elsewhere(ogden, OGDEN))
    assert emulator.logarithms == ("mu",)  # log force = log mu + a function of alpha
    assert emulator.basis.is_log
    assert found.relative_error < 1e-4
    assert found.share_inside > 0.9


@pytest.mark.parametrize("kernel", ["squared-exponential", pytest.param("matern-5/2", marks=pytest.mark.slow)])
def test_errors_are_about_as_large_as_the_emulator_says(kernel):
    def wavy(parameters):
        return np.sin(DEPTH * 8 * parameters["b"]) * (1 + parameters["a"] ** 2)

    priors = {"a": Uniform(-1.0, 1.0), "b": Uniform(0.0, 3.0)}
    emulator = emulate(designed(wavy, priors, 18), DEPTH, kernel)
    for check in (emulator.check(), emulator.check(*elsewhere(wavy, priors))):
        assert 0.8 < check.share_inside <= 1
        assert 0.1 < check.rms_standardised < 1.6


def wave(parameters):
    return np.sin(4 * parameters["b"]) * DEPTH


@pytest.mark.parametrize(
    ("function", "priors", "counts", "point"),
    [
        (wave, {"b": Uniform(0.0, 3.0)}, (6, 12), {"b": 1.3}),
        pytest.param(ogden, OGDEN, (8, 20), {"mu": 1.0, "alpha": -9.0}, marks=pytest.mark.slow),
    ],
)
def test_few_runs_are_less_sure_than_many(function, priors, counts, point):
    few, many = (emulate(designed(function, priors, count), DEPTH) for count in counts)
    assert few.predict(point)["sd"].max() > 5 * many.predict(point)["sd"].max()


def test_what_the_directions_leave_out_is_part_of_the_error():
    outputs = np.random.default_rng(0).random((12, 1)) * np.linspace(1, 2, 5)
    outputs += 1e-6 * np.random.default_rng(1).standard_normal(outputs.shape)
    basis = basis_of(outputs)
    assert basis.directions.shape == (5, 1)
    rest = basis.residuals(outputs)
    np.testing.assert_allclose(basis.truncated, rest.T @ rest / 11, atol=1e-18)


def test_moments_of_logarithms_are_those_of_a_log_normal():
    outputs = np.exp(np.random.default_rng(0).standard_normal((9, 1)) * [0.5, 0.2]) * [1, -1]
    basis = basis_of(outputs, is_log=True)
    variance = np.full(basis.directions.shape[1], 0.3)
    mean, cov = output_moments(basis.arrays, np.zeros_like(variance), variance)
    scores = np.sqrt(0.3) * np.random.default_rng(1).standard_normal((400_000, len(variance)))
    drawn = np.array([1, -1]) * np.exp(basis.mean + scores @ basis.directions.T)
    np.testing.assert_allclose(mean, drawn.mean(axis=0), rtol=0.01)
    np.testing.assert_allclose(cov, np.cov(drawn.T), rtol=0.03, atol=1e-3)


def test_failed_runs_are_left_out_and_too_few_are_refused():
    runs = designed(ogden, OGDEN, 16)
    errors = tuple("it broke" if k % 2 else "" for k in range(16))
    outputs = np.where(np.array(errors)[:, None] != "", np.nan, runs.outputs)
    half = ForwardRuns(runs.symbols, runs.points, outputs, errors, runs.seconds)
    assert len(emulate(half, DEPTH).check().points) == 8
    most = ForwardRuns(runs.symbols, runs.points, np.full_like(outputs, np.nan), ("it broke",) * 16, runs.seconds)
    with pytest.raises(ModelError, match=r"needs 7 runs that succeed, and there are 0\. 16 of 16 runs.*it broke"):
        emulate(most, DEPTH)


def test_a_model_that_does_not_depend_on_its_parameters_is_refused():
    with pytest.raises(ModelError, match="same outputs at all parameters"):
        emulate(designed(lambda parameters: DEPTH, {"C10": Uniform(0.1, 1.0)}, 8), DEPTH)


@pytest.mark.parametrize("design", ["sobol", "latin"])
def test_a_design_fills_the_priors_evenly(design):
    priors = {"a": Uniform(1.0, 3.0), "b": LogUniform(0.01, 100.0), "c": Normal(0.0, 1.0), "d": LogNormal(1.0, 0.5)}
    points = space_filling(priors, 64, seed=3, design=design)
    for prior, column in zip(priors.values(), points.T, strict=True):
        below = [(column < prior.quantile(level)).mean() for level in (0.25, 0.5, 0.75)]
        assert below == pytest.approx([0.25, 0.5, 0.75], abs=0.04)
        assert column.min() < prior.quantile(0.05) < prior.quantile(0.95) < column.max()


def test_a_longer_design_begins_with_the_shorter_one():
    np.testing.assert_array_equal(space_filling(OGDEN, 20, seed=2)[:9], space_filling(OGDEN, 9, seed=2)[:9])


def test_unknown_choices_are_refused():
    runs = designed(neo_hooke, {"C10": Uniform(0.2, 5.0)}, 8)
    with pytest.raises(InputError, match="kernel must be one of"):
        emulate(runs, DEPTH, "cubic")
    with pytest.raises(InputError, match="design must be one of"):
        space_filling(OGDEN, 8, design="grid")


@pytest.mark.slow
def test_sensitivities_are_those_of_the_closed_form():
    """Of a + 2 b + 4 (b - 1/2) (c - 1/2): variances 3, 12 and 4 (of b and c together) of 19."""
    priors = {symbol: Uniform(0.0, 1.0) for symbol in "abc"}

    def function(p):
        return (p["a"] + 2 * p["b"] + 4 * (p["b"] - 0.5) * (p["c"] - 0.5)) * DEPTH

    found = emulate(designed(function, priors, 40), DEPTH).sensitivity(priors)
    np.testing.assert_allclose(found["first"] * 19, [3, 12, 0], atol=0.4)
    np.testing.assert_allclose(found["total"] * 19, [3, 16, 4], atol=0.4)


@pytest.mark.slow
def test_sensitivities_follow_the_priors():
    def function(p):
        return (p["a"] + p["b"]) * DEPTH

    priors = {"a": Uniform(0.0, 1.0), "b": Uniform(0.0, 3.0)}
    found = emulate(designed(function, priors, 12), DEPTH).sensitivity({**priors, "b": Normal(1.5, 0.5)})
    assert found.loc["b", "first"] == pytest.approx(0.25 / (0.25 + 1 / 12), abs=0.02)


@pytest.mark.slow
def test_eight_parameters_are_emulated_and_those_without_effect_are_seen():
    priors = {f"p{k}": Uniform(0.5, 1.5) for k in range(8)}

    def function(p):
        return p["p0"] * np.expm1(p["p1"] * DEPTH * 4) + 4 * p["p2"] * p["p3"] * DEPTH + 0.2 * p["p4"] * DEPTH**2

    emulator = emulate(designed(function, priors, 60), DEPTH)
    check = emulator.check(*elsewhere(function, priors))
    spread = np.sqrt(((check.computed - check.computed.mean(axis=0)) ** 2).mean())
    assert np.sqrt(((check.computed - check.predicted) ** 2).mean()) < spread / 8
    assert check.share_inside > 0.85
    found = emulator.sensitivity(priors)
    assert found["total"].iloc[[5, 6, 7]].max() < 0.02 < found["total"].iloc[:4].min()
