"""Random small models: the routes against each other, and the exact one against dense quadrature."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import Phase, assume, given, settings
from hypothesis import strategies as st

import tissuq as tq
from against import both, columns_of, parts
from dense import Axis, Linear, integrate
from marks import slow_but

EXAMPLES = pytest.mark.parametrize("examples", slow_but([8], [8, 30]))
QUIET = settings(deadline=None, derandomize=True, database=None, phases=[Phase.explicit, Phase.generate])
SEED = st.integers(0, 2**32 - 1)
SCALE = st.floats(-1.5, 1.5).map(lambda power: 10.0**power)


def measured(seed, points, c10, bend, noise_sd):
    generator = np.random.default_rng(seed)
    stretch = np.sort(generator.uniform(0.6, 2.0, points))
    assume(np.diff(stretch).min() > 1e-3)
    stress = columns_of({"C10": c10, "C20": bend}, stretch) + noise_sd * generator.standard_normal(points)
    return stretch, stress


def assert_evidence_and_moments(posterior, problem):
    """Hold the exact route against dense quadrature: within three stated errors where points make them, else one."""
    truth, rough = integrate(problem), integrate(problem, refine=0.75)
    own = 3 * abs(truth.log_evidence - rough.log_evidence) + 1e-9 * (1 + abs(truth.log_evidence))
    assume(own < 1e-4)
    errors = 3 if posterior.log_evidence_error > 1e-4 else 1
    assert abs(posterior.log_evidence - truth.log_evidence) <= errors * posterior.log_evidence_error + own
    c10 = posterior.solution.marginals["C10"]
    tolerance = 0.02 if "bounds of the linear parameters" in posterior.solution.reason else 2e-3
    assert abs(c10.mean - truth.mean) <= tolerance * truth.sd
    assert abs(c10.sd / truth.sd - 1) <= tolerance


@EXAMPLES
def test_without_nonlinear_parameters(examples):
    @settings(QUIET, max_examples=examples)
    @given(
        SEED, st.integers(6, 25), st.floats(0.0, 3.0), st.floats(-0.3, 0.3), SCALE, st.booleans(), st.floats(0.3, 30)
    )
    def holds(seed, points, c10, bend, noise, is_normal, width):
        stretch, stress = measured(seed, points, c10, bend, 0.1 * noise)
        linear = {"C10": Linear(0.0, width, 1.0, 0.5) if is_normal else Linear(0.0, width)}
        assume(stress.any())
        posterior, problem = both("none", stretch, stress, 0.1 * noise, linear, {})
        assert_evidence_and_moments(posterior, problem)

    holds()


@EXAMPLES
def test_with_one_nonlinear_parameter(examples):
    @settings(QUIET, max_examples=examples)
    @given(
        SEED,
        st.sampled_from(["constant", "mooney-rivlin"]),
        st.integers(6, 25),
        st.floats(0.0, 3.0),
        st.floats(-0.3, 0.3),
        SCALE,
        st.booleans(),
    )
    def holds(seed, discrepancy, points, c10, bend, noise, is_normal):
        stretch, stress = measured(seed, points, c10, bend, 0.1 * noise)
        linear, _ = parts(discrepancy)
        if is_normal:
            linear |= {"C10": Linear(0.0, np.inf, 1.0, 0.7)}
        axes = {"S": Axis(0, 3, min(0.02, 0.1 * noise))}
        posterior, problem = both(discrepancy, stretch, stress, 0.1 * noise, linear, axes)
        assert_evidence_and_moments(posterior, problem)

    holds()


@EXAMPLES
def test_with_unknown_noise(examples):
    @settings(QUIET, max_examples=examples)
    @given(SEED, st.integers(6, 25), st.floats(0.1, 3.0), st.floats(-0.3, 0.3), SCALE)
    def holds(seed, points, c10, bend, noise):
        stretch, stress = measured(seed, points, c10, bend, 0.1 * noise)
        linear, _ = parts("none")
        axes = {"noise_sd": Axis(1e-4, 10, 0.02)}
        posterior, problem = both("none", stretch, stress, None, linear, axes, noise="unknown")
        assert_evidence_and_moments(posterior, problem)

    holds()


KINDS = {
    "constant": {"C10": tq.Normal(1, 1), "m0": tq.Normal(0, 1), "S": tq.HalfNormal(0.5)},
    "gp": {"C10": tq.Uniform(0, 6), "c": tq.Uniform(0, 2), "psi": tq.Uniform(0.1, 2)},
}


@pytest.mark.slow
@pytest.mark.parametrize("discrepancy", KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_exact_nuts_and_smc_agree(discrepancy, seed):
    """The short version of NUTS is in `test_sampled.py`."""
    # Five standard errors for every number: 6 cases, fewer than 8 numbers each, false chance below 1e-4.
    generator = np.random.default_rng([seed, 8])
    stretch = np.linspace(0.7, generator.uniform(1.3, 2.0), 10)
    stress = columns_of({"C10": generator.uniform(0.3, 2), "C20": generator.normal(0, 0.1)}, stretch)
    data = tq.Experiment("uniaxial", stretch, stress + 0.1 * generator.standard_normal(10))
    options = {"discrepancy": discrepancy, "noise_sd": 0.1, "priors": KINDS[discrepancy]}
    exact, *all_sampled = (tq.fit(data, method=method, seed=seed, **options) for method in ("exact", "nuts", "smc"))
    smc = all_sampled[-1]
    error = np.hypot(smc.log_evidence_error, exact.log_evidence_error)
    assert error < 0.3
    assert abs(smc.log_evidence - exact.log_evidence) < 5 * error
    reference = exact.summary()
    for sampled in all_sampled:
        table = sampled.summary()
        error = reference["sd"] / np.sqrt(table["ess"])
        assert (np.abs(table["mean"] - reference["mean"]) < 5 * error).all()
        # The sd of a sample of effective size m is right to 1/sqrt(2m) for a Gaussian, to 2/sqrt(m) with heavy tails.
        assert (np.abs(table["sd"] / reference["sd"] - 1) < 10 / np.sqrt(table["ess"])).all()
