"""What is expected of a further test, against closed forms written out here and against fits of simulated outcomes."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from tissuq.next_test.next_test import NextTest
from tissuq.next_test.targets import target_named
from tissuq.prediction.moments import drawn_curves

STRETCH = np.array([0.75, 0.85, 0.95, 1.1, 1.25, 1.4])
NOISE = 0.02


def neo_hooke(mode, stretch):
    """Return the stress of C10 = 1."""
    return 2 * (stretch - stretch ** {"uniaxial": -2.0, "planar": -3.0, "equibiaxial": -5.0}[mode])


def data_of(count=1, mode="uniaxial"):
    return [tq.simulate("neo-hookean", {"C10": 0.5}, STRETCH, NOISE, seed=s, mode=mode) for s in range(count)]


def asked_of(posterior, *targets, specimen=None):
    return NextTest(posterior.solution, [target_named(each, posterior.model) for each in targets], specimen)


@pytest.fixture(scope="module")
def known():
    return tq.fit(data_of()[0], discrepancy="none", noise_sd=NOISE)


def test_with_known_noise_it_is_the_closed_form(known):
    x, z = neo_hooke("uniaxial", STRETCH), neo_hooke("planar", np.array([1.1, 1.3]))
    now, after = NOISE / np.sqrt(x @ x), NOISE / np.sqrt(x @ x + z @ z)
    found = asked_of(known, "C10", "modulus", "equibiaxial:1.2").expected(tq.Candidate("planar", [1.1, 1.3]))
    factors = np.array([1.0, 2.0, neo_hooke("equibiaxial", 1.2)])
    np.testing.assert_allclose(found.sd_now, now * factors, rtol=1e-8)
    np.testing.assert_allclose(found.sd_after, after * factors, rtol=1e-8)
    assert (found.error == 0).all()


def test_two_parameters_have_the_closed_form_of_least_squares():
    truth = {"C10": 0.4, "C01": 0.1}
    data = tq.simulate("mooney-rivlin", truth, STRETCH, NOISE, seed=1)
    posterior = tq.fit(data, material="mooney-rivlin", discrepancy="none", noise_sd=NOISE)

    def design(stretch):  # uniaxial: closed forms of C10 = 1 and C01 = 1
        return np.column_stack([2 * (stretch - stretch**-2), 2 * (1 - stretch**-3)])

    new = np.array([0.6, 0.7, 0.8])
    X, Z, sums = design(STRETCH), design(new), np.array([2.0, 2.0])
    found = asked_of(posterior, "C01", "modulus").expected(tq.Candidate("uniaxial", new))
    for rows, sds in ((X, found.sd_now), (np.vstack([X, Z]), found.sd_after)):
        covariance = NOISE**2 * np.linalg.inv(rows.T @ rows)
        np.testing.assert_allclose(sds**2, [covariance[1, 1], sums @ covariance @ sums], rtol=1e-8)


def test_many_measurements_are_stood_for_by_few(known):
    many = np.linspace(0.8, 1.3, 3000)
    x, z = neo_hooke("uniaxial", STRETCH), neo_hooke("uniaxial", many)
    found = asked_of(known, "C10").expected(tq.Candidate("uniaxial", many))
    assert found.sd_after[0] == pytest.approx(NOISE / np.sqrt(x @ x + z @ z), rel=2e-3)


@pytest.mark.parametrize("tests", [1, 3])
@pytest.mark.parametrize("zero", [0.0, 0.05])
def test_other_specimens_have_errors_of_their_own(zero, tests):
    # y = (1 + e) C10 x + z + noise, e of 18 % and z of some MPa for each specimen; the tissue's C10 is wanted.
    new, share = np.array([1.1, 1.3]), 0.18
    tolerances = tq.Tolerances(stress=share, zero=zero)
    posterior = tq.fit(data_of()[0], discrepancy="none", noise_sd=NOISE, tolerances=tolerances)
    found = asked_of(posterior, "C10").expected(tq.Candidate("planar", new, tests=tests))
    of_specimens = [neo_hooke("uniaxial", STRETCH), *[neo_hooke("planar", new)] * tests]
    X = np.zeros((sum(map(len, of_specimens)), 1 + 2 * len(of_specimens)))  # C10, then e and z of each, to first order
    start = 0
    for number, unit_stress in enumerate(of_specimens):
        rows, start = slice(start, start + len(unit_stress)), start + len(unit_stress)
        X[rows, 0], X[rows, 1 + 2 * number], X[rows, 2 + 2 * number] = unit_stress, 0.5 * unit_stress, 1.0
    prior = np.diag([0, *[share**-2, max(zero, 1e-9) ** -2] * len(of_specimens)])
    sds = [np.sqrt(np.linalg.inv(rows.T @ rows / NOISE**2 + prior)[0, 0]) for rows in (X[: len(STRETCH)], X)]
    np.testing.assert_allclose([found.sd_now[0], found.sd_after[0]], sds, rtol=0.02)  # e counts there to second order


def test_of_several_specimens_another_one_is_the_next():
    several = tq.fit([*data_of(2), data_of(1, "planar")[0]], discrepancy="none", noise_sd=NOISE)
    asked = asked_of(several, "C10")
    assert asked.specimen == "other"
    assert asked.sd_now[0] == pytest.approx(several.marginals["C10"].sd, rel=1e-3)
    # Nearly all of it is how specimens differ.
    found = asked.expected(tq.Candidate("planar", STRETCH)).sd_after[0]
    assert found == pytest.approx(asked.sd_now[0] * np.sqrt(3 / 4), rel=0.02)


def simulated(posterior, candidate, count, seed=2):
    """Return outcomes of a test in the mode of the data, from one draw of the posterior for each."""
    model, generator = posterior.model, np.random.default_rng(seed)
    parts = posterior.solution.mixture
    parts = parts[generator.choice(len(parts.weights), count, p=parts.weights / parts.weights.sum())]
    alone, other = drawn_curves(model, parts, model.experiment.states_at(candidate.stretch, candidate.mode), seed)
    values = {symbol: own[:, None] for symbol, own in zip(model.nonlinear, parts.settings.T, strict=True)}
    sd = np.sqrt(np.broadcast_to(model.white_variance(values), alone.shape))
    stress = alone + other + sd * generator.standard_normal(alone.shape)
    return [tq.Experiment(candidate.mode, candidate.stretch, own) for own in stress]


@pytest.mark.parametrize(
    ("discrepancy", "noise_sd", "count"),
    [("none", "unknown", 200), ("yeoh", NOISE, 100), ("taylor+hencky", NOISE, 24)],
)
def test_fits_of_simulated_outcomes_have_the_expected_variance(discrepancy, noise_sd, count):
    data = tq.simulate("yeoh", {"C10": 0.5, "C20": 0.05, "C30": 0.0}, np.linspace(0.75, 1.5, 12), NOISE, seed=1)
    posterior = tq.fit(data, discrepancy=discrepancy, noise_sd=noise_sd, tolerances="as-tested")
    candidate = tq.Candidate("uniaxial", np.linspace(0.76, 1.4, 12))
    expected = asked_of(posterior, "C10").expected(candidate)
    both = [data.joined(test) for test in simulated(posterior, candidate, count)]
    priors = posterior.model.priors
    options = {"noise_sd": noise_sd, "priors": priors, "tolerances": "as-tested"}
    after = tq.fit_many(both, discrepancy=discrepancy, **options)
    variance = np.array([each.marginals["C10"].sd ** 2 for each in after])
    error = np.hypot(
        variance.std(ddof=1) / np.sqrt(count), 2 * expected.sd_after[0] * expected.error[0] * expected.sd_now[0]
    )
    # Wrong by chance in 1 of 10,000, with the variances as heavy-tailed as they are.
    assert abs(variance.mean() - expected.sd_after[0] ** 2) < 4.5 * error
    assert variance.mean() < 0.9 * expected.sd_now[0] ** 2
    assert expected.sd_now[0] == pytest.approx(posterior.marginals["C10"].sd, rel=0.02)


def test_a_process_in_stress_has_the_closed_form_of_its_covariance():
    data = tq.simulate("yeoh", {"C10": 0.5, "C20": 0.05, "C30": 0.0}, STRETCH, NOISE, seed=1)
    priors = {"c": tq.Uniform(0.1, 0.10001), "psi": tq.Uniform(0.3, 0.30001)}
    posterior = tq.fit(data, discrepancy="gp", noise_sd=NOISE, priors=priors)
    new, at = np.array([0.9, 1.2]), 1.3
    found = asked_of(posterior, "C10", f"uniaxial:{at}").expected(tq.Candidate("uniaxial", new))
    for rows, sds in ((STRETCH, found.sd_now), (np.concatenate([STRETCH, new]), found.sd_after)):
        K = 0.1**2 * np.exp(-((rows[:, None] - rows) ** 2) / (2 * 0.3**2)) + NOISE**2 * np.eye(len(rows))
        x, cross = neo_hooke("uniaxial", rows), 0.1**2 * np.exp(-((rows - at) ** 2) / (2 * 0.3**2))
        weight = np.linalg.solve(K, np.column_stack([x, cross]))
        of_c10 = 1 / (x @ weight[:, 0])
        slope = neo_hooke("uniaxial", at) - cross @ weight[:, 0]
        of_stress = 0.1**2 - cross @ weight[:, 1] + slope**2 * of_c10
        np.testing.assert_allclose(sds**2, [of_c10, of_stress], rtol=2e-3)


def test_the_best_range_has_the_largest_sum_of_squares(known):
    tests = [tq.Candidate("uniaxial", np.linspace(low, high, 8)) for low, high in ((0.8, 1.0), (0.7, 1.3), (1.0, 1.5))]
    reductions = [asked_of(known, "C10").expected(test).reduction[0] for test in tests]
    sizes = [float((neo_hooke("uniaxial", test.stretch) ** 2).sum()) for test in tests]
    assert np.argsort(reductions).tolist() == np.argsort(sizes).tolist()


def test_noise_that_grows_with_the_stress_makes_large_stretches_worth_less():
    data = tq.simulate("neo-hookean", {"C10": 0.5}, np.linspace(0.7, 1.5, 25), 0.002, seed=1)
    rng = np.random.default_rng(0)
    loud = data.stress * (1 + 0.05 * rng.standard_normal(len(data)))
    data = tq.Experiment("uniaxial", data.stretch, loud)
    gains = {}
    for noise in ("unknown", "proportional"):
        posterior = tq.fit(data, discrepancy="none", noise=noise, tolerances="as-tested")
        asked = asked_of(posterior, "C10")
        near, far = (
            asked.expected(tq.Candidate("uniaxial", np.linspace(low, high, 10))).reduction[0]
            for low, high in ((1.05, 1.2), (1.3, 1.45))
        )
        gains[noise] = far / near
    assert gains["unknown"] > 2 * gains["proportional"]


@pytest.mark.parametrize(
    ("options", "test", "words"),
    [
        ({"discrepancy": "gp"}, tq.Candidate("planar", [1.1]), "another, unknown one of the planar stress"),
        ({"discrepancy": "auto"}, tq.Candidate("planar", [1.1, 3.0]), "choose a range within"),
        ({"discrepancy": "none", "tolerances": tq.Tolerances(length=0.02)}, tq.Candidate("planar", [1.1]), "share"),
    ],
)
def test_what_the_posterior_does_not_say_is_refused(options, test, words):
    stretch, generator = np.linspace(0.75, 1.4, 12), np.random.default_rng(1)
    noise = np.convolve(generator.standard_normal(14), [1, 1, 1], "valid") * NOISE
    data = tq.Experiment("uniaxial", stretch, 0.5 * neo_hooke("uniaxial", stretch) + noise)
    posterior = tq.fit(data, **({"noise_sd": NOISE} | options))
    with pytest.raises(tq.InputError, match=words):
        asked_of(posterior, "C10", specimen="same").expected(test)


def test_correlated_errors_tell_as_little_as_larger_independent_ones():
    # Against the covariance of first-order autoregression in the further test, sampled as densely as the data.
    stretch, generator = np.linspace(0.75, 1.4, 200), np.random.default_rng(1)
    score, errors = generator.standard_normal(200), [0.0]
    for new in score[1:]:
        errors.append(0.6 * errors[-1] + 0.8 * new)
    data = tq.Experiment("uniaxial", stretch, 0.5 * neo_hooke("uniaxial", stretch) + NOISE * np.array(errors))
    posterior = tq.fit(data, discrepancy="none", noise="autoregressive", priors={"C10": tq.Uniform(0, 50)})
    expected = asked_of(posterior, "C10", specimen="same").expected(tq.Candidate("planar", stretch)).sd_after[0]
    lag, x = posterior.model.fitted_errors.lag, neo_hooke("planar", stretch)
    sd = posterior.summary().loc[["C10", "noise_sd"], ["mean", "sd"]].to_numpy()
    apart = np.abs(np.subtract.outer(np.arange(200), np.arange(200)))
    information = x @ np.linalg.solve(sd[1, 0] ** 2 * lag**apart, x)
    assert expected == pytest.approx((sd[0, 1] ** -2 + information) ** -0.5, rel=0.03)
