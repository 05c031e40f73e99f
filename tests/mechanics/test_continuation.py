"""Energies beyond the range of their data, against closed forms, quadrature, root finding and differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import t as student_t

import tissuq as tq
from tissuq.experiments.modes import loading_mode
from tissuq.finite_elements.material import distortional_energy
from tissuq.mechanics.draws import continuations, rays_to_ends, sum_of_energies
from tissuq.mechanics.rays import INNER_SHARE, MAX_EXPONENT, MIN_EXPONENT, TRANSITION, Range, share_to_end, with_errors

TRUTH = {"C10": 0.5, "C20": 0.1, "C30": 0.05}
STRETCH = np.linspace(0.8, 1.4, 24)
IMAGINARY = 1e-30
"""Imaginary step of the Hencky strain for derivatives of energies."""
DIRECTIONS = [1.0, 0.97, 0.5, 0.1234, 0.0, -0.4321, -0.77, -1.0]
"""From uniaxial (1) over planar (0) to equibiaxial tension (-1), in the c of `Continuation`."""
RANGES = {
    "first invariant": Range(invariant_1=0.4),
    "second invariant": Range(invariant_2=0.3),
    "stretches": Range(logarithms=(-0.3, 0.25)),
    "all": Range(0.5, 0.45, (-0.5, 0.4)),
}
DISCREPANCIES = ["taylor", "second-invariant", "hencky", "taylor+second-invariant", "log+hencky", "auto"]


def unit_along(c):
    """Return the unit vector (3,) of logarithmic stretches in a direction: a third of the angle of cosine c."""
    return np.sqrt(2 / 3) * np.cos(np.arccos(c) / 3 + 2 * np.pi / 3 * np.array([0, -1, 1]))


def unit_across(unit):
    """Return the isochoric unit vector at right angles to another."""
    return np.cross(unit, np.ones(3)) / np.sqrt(3)


def stretches_of(logs):
    return tuple(np.exp(np.asarray(logs)).T)


def derivative(energy, logs, direction):
    """Return the derivative of an energy along logarithmic stretches, by an imaginary step."""
    return float(np.imag(energy(stretches_of(logs + 1j * IMAGINARY * direction))) / IMAGINARY)


def end_along(unit, limits):
    """Return the Hencky strain at which a ray leaves a range with rounded corners, which test_rays.py verifies."""
    return 4 * float(share_to_end(4 * unit[None], limits)[0])


def invariant(strain, unit):
    return np.expm1(2 * strain * unit).sum()


def invariant_rate(strain, unit):
    return (2 * unit * np.exp(2 * strain * unit)).sum()


def end_of_ray(energy, unit, end):
    """Return V = dW/dx at the end of a ray, and the last exponent within."""
    V, inner_V = (
        derivative(energy, strain * unit, unit) / invariant_rate(strain, unit) for strain in (end, INNER_SHARE * end)
    )
    if V <= 0 or inner_V <= 0:
        return V, 0.0
    return V, np.log(V / inner_V) / np.log(invariant(end, unit) / invariant(INNER_SHARE * end, unit))


def slope_beyond(unit, end, V, exponent, error):
    """Return the derivative of the stated energy as function of the Hencky strain along a ray."""

    def slope(strain):
        s = np.log(invariant(strain, unit) / invariant(end, unit))
        growth = np.exp(exponent * s + error * s**2 / (s + TRANSITION))
        return V * growth * invariant_rate(strain, unit)

    return slope


class PowerLaw:
    """W = C x^(n + 1) / (n + 1), x = I1 - 3."""

    def __init__(self, n):
        self.n = n

    def energy(self, stretches, values):
        x = sum(stretch * stretch for stretch in stretches) - 3
        return values[0] * x ** (self.n + 1) / (self.n + 1)


def continued(material, values, limits, score=None):
    """Return the energy of a material that is known within limits, and goes on with an error of that score or none."""

    def within(stretches):
        return material.energy(stretches, values)

    rays = rays_to_ends(limits)
    states = rays.last_states
    logs, rates = states.log_stretches
    stresses = np.imag(within(stretches_of(logs + 1j * IMAGINARY * rates))) / IMAGINARY
    at_end, farther_in = np.split(stresses[None], 2, axis=1)
    last = rays.last_exponents(at_end, farther_in)
    exponents = (last, np.zeros_like(last)) if score is None else with_errors(last, np.full((1, 1), score))
    (continuation,) = continuations(rays, within(stretches_of(rays.ends))[None], at_end, *exponents)
    return lambda stretches: sum_of_energies([material], [values], stretches, None, continuation)


def fitted(discrepancy, stretch=STRETCH, mode="uniaxial"):
    data = tq.simulate("yeoh", TRUTH, stretch, noise_sd=0.01, seed=3, mode=mode)
    return tq.fit(data, discrepancy=discrepancy, noise_sd=0.01)


def ranges_of(posterior):
    """Return the ranges of the data of the posterior's members."""
    return [limits for limits, _ in posterior.model.by_limits(posterior.solution.mixture.member)]


def score_of(exponent, error):
    """Return the score of an error of an exponent, of which it is a linear function where nothing is clipped."""
    at_zero, at_tenth = (with_errors(exponent, score)[1] for score in (0.0, 0.1))
    return 0.1 * (error - at_zero) / (at_tenth - at_zero)


@pytest.fixture(scope="module")
def posteriors():
    return {discrepancy: fitted(discrepancy) for discrepancy in DISCREPANCIES}


@pytest.fixture(scope="module")
def draws(posteriors):
    return {name: posterior.ensemble(8, admissible=False).draws for name, posterior in posteriors.items()}


def without_continuation(draw):
    """Return the energy of a draw as it is within the range of its data."""
    return replace(draw, continuation=None).energy


def end_of(draw, unit, ranges):
    """Return the Hencky strain at which a draw goes on by its continuation: that of one of the ranges."""
    ends = [end_along(unit, limits) for limits in ranges]
    within = without_continuation(draw)

    def is_continued(strain):
        stretches = stretches_of(strain * unit)
        return draw.energy(stretches) != within(stretches)

    return next(end for end in sorted(ends) if is_continued(1.0005 * end))


@pytest.mark.parametrize("limits", RANGES.values(), ids=RANGES)
@pytest.mark.parametrize("n", [-0.4, 0.0, 0.8, 2.5])
def test_a_power_law_goes_on_as_it_is(n, limits):
    energy, law, generator = continued(PowerLaw(n), [0.7], limits), PowerLaw(n), np.random.default_rng(1)
    for c in np.append(generator.uniform(-1, 1, 12), [-1, 0, 1]):
        unit = unit_along(c)
        for strain in end_along(unit, limits) * np.array([0.5, 1.01, 1.3, 2.0, 3.5]):
            expected = law.energy(stretches_of(strain * unit), [0.7])
            assert energy(stretches_of(strain * unit)) == pytest.approx(expected, rel=1e-5)
            slope = 0.7 * invariant(strain, unit) ** n * invariant_rate(strain, unit)
            assert derivative(energy, strain * unit, unit) == pytest.approx(slope, rel=1e-5)
            across = derivative(energy, strain * unit, unit_across(unit))
            exact = derivative(lambda s: law.energy(s, [0.7]), strain * unit, unit_across(unit))
            assert across == pytest.approx(exact, abs=1e-3 * slope)


def test_a_neo_hookean_material_goes_on_as_it_is_in_every_mode():
    material, limits = tq.materials()["neo-hookean"](), RANGES["all"]
    energy = continued(material, [0.5], limits)
    for stretch in ([2.0, 2**-0.5, 2**-0.5], [1.9, 1.0, 1 / 1.9], [1.6, 1.6, 1.6**-2], [1.7, 1.2, 1 / 2.04]):
        assert energy(tuple(stretch)) == pytest.approx(0.5 * (np.square(stretch).sum() - 3), rel=1e-7)


@pytest.mark.parametrize("score", [-1.5, 0.0, 0.6, 4.0, -40.0, 40.0])
@pytest.mark.parametrize("c", DIRECTIONS)
def test_along_a_ray_the_slope_of_the_energy_is_the_stated_formula(c, score):
    # V = 1 + x of W = x + x^2 / 2; here all that is a function of the direction is constant but for the exponent.
    material, limits, unit = tq.materials()["yeoh"](), Range(invariant_1=0.4), unit_along(c)
    energy = continued(material, [1.0, 0.5, 0.0], limits, score)
    end = end_along(unit, limits)
    last_x, inner_x = invariant(end, unit), invariant(INNER_SHARE * end, unit)
    assert last_x == pytest.approx(0.4, rel=0.02)
    last = np.log((1 + last_x) / (1 + inner_x)) / np.log(last_x / inner_x)
    slope = slope_beyond(unit, end, 1 + last_x, *with_errors(last, score))
    for strain in end * np.array([1.05, 1.4, 2.0, 3.0]):
        assert derivative(energy, strain * unit, unit) == pytest.approx(slope(strain), rel=1e-6)
        expected = last_x + last_x**2 / 2 + quad(slope, end, strain, epsabs=0, epsrel=1e-11)[0]
        assert energy(stretches_of(strain * unit)) == pytest.approx(expected, rel=1e-6)


def score_of_draw(draw, ranges):
    """Return the score of a draw, from one stress in uniaxial tension; not a number where its error is clipped."""
    unit = unit_along(1.0)
    end = end_of(draw, unit, ranges)
    V, last = end_of_ray(without_continuation(draw), unit, end)
    exponent, strain = with_errors(last, 0.0)[0], 1.5 * end
    s = np.log(invariant(strain, unit) / invariant(end, unit))
    ratio = derivative(draw.energy, strain * unit, unit) / invariant_rate(strain, unit) / V
    error = (np.log(ratio) - exponent * s) * (s + TRANSITION) / s**2
    is_free = MIN_EXPONENT + 1e-4 < exponent + error < MAX_EXPONENT - 1e-4
    return score_of(exponent, error) if is_free else np.nan


@pytest.mark.parametrize("discrepancy", DISCREPANCIES)
def test_a_draw_goes_on_by_the_stated_formula_with_one_score_in_all_directions(posteriors, draws, discrepancy):
    ranges = ranges_of(posteriors[discrepancy])
    scored = [(draw, score_of_draw(draw, ranges)) for draw in draws[discrepancy]]
    scored = [(draw, score) for draw, score in scored if np.isfinite(score)]
    assert len(scored) > len(draws[discrepancy]) / 2
    for draw, score in scored:
        within = without_continuation(draw)
        for c in (1.0, 0.5, 0.0, -0.5, -1.0):
            unit = unit_along(c)
            end = end_of(draw, unit, ranges)
            V, last = end_of_ray(within, unit, end)
            slope = slope_beyond(unit, end, V, *with_errors(last, score))
            for strain in end * np.array([1.02, 1.5, 2.2]):
                assert derivative(draw.energy, strain * unit, unit) == pytest.approx(slope(strain), rel=1e-3)
                expected = within(stretches_of(end * unit)) + quad(slope, end, strain)[0]
                assert draw.energy(stretches_of(strain * unit)) == pytest.approx(expected, rel=1e-3)


@pytest.mark.slow
def test_scores_of_draws_have_students_distribution_without_the_outermost_tails(posteriors):
    # By the shares of 1024 quasi-random draws below scores at which no exponent here is clipped: right within 0.01.
    posterior, unit = posteriors["taylor"], unit_along(1.0)
    (limits,) = ranges_of(posterior)
    end = end_along(unit, limits)
    strains = end * np.array([INNER_SHARE, 1.0, 1.5])
    x, rates = (np.array([f(strain, unit) for strain in strains]) for f in (invariant, invariant_rate))
    energies = [(draw.energy, without_continuation(draw)) for draw in posterior.ensemble(1024, admissible=False)]
    logs = strains[:, None] * unit + 1j * IMAGINARY * unit
    V = np.imag(
        [np.append(within(stretches_of(logs[:2])), whole(stretches_of(logs[2:]))) for whole, within in energies]
    )
    V /= IMAGINARY * rates
    a = np.log(V[:, 1] / V[:, 0]) / np.log(x[1] / x[0])
    s = np.log(x[2] / x[1])
    b = (np.log(V[:, 2] / V[:, 1]) - a * s) * (s + TRANSITION) / s**2
    score = score_of(a, b)
    for wanted in (-1.0, -0.5, 0.0, 0.5, 1.0, 2.0):
        expected = (student_t(2).cdf(wanted) - 0.001) / 0.998
        assert np.mean(score < wanted) == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize("discrepancy", DISCREPANCIES)
def test_energy_and_gradient_of_a_draw_are_continuous_at_the_end_of_its_range(posteriors, draws, discrepancy):
    ranges = ranges_of(posteriors[discrepancy])
    for c in DIRECTIONS:
        unit = unit_along(c)
        across = unit_across(unit)
        for draw in draws[discrepancy]:
            end = end_of(draw, unit, ranges)
            states = [end * (1 + step) * unit for step in (-1e-5, 1e-5)]
            energy = [float(draw.energy(stretches_of(logs))) for logs in states]
            along = [derivative(draw.energy, logs, unit) for logs in states]
            sideways = [derivative(draw.energy, logs, across) for logs in states]
            assert energy[1] - energy[0] == pytest.approx(2e-5 * end * along[0], rel=0.02)
            assert along[1] == pytest.approx(along[0], rel=3e-4)
            assert sideways[1] == pytest.approx(sideways[0], abs=3e-4 * abs(along[0]))


CORNERS = {
    "uniaxial": (np.linspace(1.02, 1.5, 24), 1.0),
    "equibiaxial": (np.linspace(1.02, 1.3, 24), -1.0),
    "planar": (np.linspace(1.02, 1.5, 24), 0.0),
}
"""Tests of one mode, whose state of largest stretch is in a corner of the limits of the stretches; its direction."""
NEAR = np.array([-0.02, -0.003, -0.002, -0.0007, 0, 0.0007, 0.002, 0.003, 0.02])
"""Differences from that direction; the pieces between which functions of the direction meet are 0.005 long."""


@pytest.fixture(scope="module")
def corner_draws():
    cases = [(mode, discrepancy) for mode in CORNERS for discrepancy in ("taylor", "hencky")]
    posteriors = {(mode, name): fitted(name, CORNERS[mode][0], mode) for mode, name in cases}
    return {case: (*ranges_of(post), post.ensemble(6, admissible=False).draws) for case, post in posteriors.items()}


@pytest.mark.parametrize("discrepancy", ["taylor", "hencky"])
@pytest.mark.parametrize("mode", CORNERS)
def test_energy_and_gradient_are_continuous_near_the_direction_of_the_test(corner_draws, mode, discrepancy):
    # Just beyond the end, energy and gradient differ from those within, continued, by the square of the distance and
    # by the distance: of 1.2 %, about 2e-4 of the energy and a few thousandths of the stress.
    limits, draws = corner_draws[mode, discrepancy]
    for c in np.clip(CORNERS[mode][1] + NEAR, -1, 1):
        unit = unit_along(c)
        logs = 1.012 * end_along(unit, limits) * unit
        for draw in draws:
            within = without_continuation(draw)
            before, beyond = within(stretches_of(logs)), draw.energy(stretches_of(logs))
            assert beyond == pytest.approx(before, rel=5e-4)
            stress = derivative(within, logs, unit)
            sideways = [derivative(energy, logs, unit_across(unit)) for energy in (draw.energy, within)]
            assert sideways[0] == pytest.approx(sideways[1], abs=0.02 * stress)


@pytest.mark.parametrize("discrepancy", ["taylor", "hencky"])
@pytest.mark.parametrize("mode", CORNERS)
def test_the_energy_has_no_ridge_along_the_ray_of_the_test(corner_draws, mode, discrepancy):
    # Second derivatives across the ray, from differences of 0.005 in the Hencky strain.
    limits, draws = corner_draws[mode, discrepancy]
    unit = unit_along(CORNERS[mode][1])
    across, end, step = unit_across(unit), end_along(unit, limits), 5e-3

    def curvature(draw, strain):
        slopes = [derivative(draw.energy, strain * unit + sign * step * across, across) for sign in (1, -1)]
        return (slopes[0] - slopes[1]) / (2 * step)

    inside, beyond = (np.abs([curvature(draw, factor * end) for draw in draws]).max() for factor in (0.9, 1.2))
    stress = max(derivative(draw.energy, 1.2 * end * unit, unit) for draw in draws)
    assert beyond < 3 * (inside + stress / (1.2 * end))


@pytest.mark.parametrize("discrepancy", DISCREPANCIES)
def test_imaginary_and_real_steps_have_one_derivative(draws, discrepancy):
    generator = np.random.default_rng(5)
    for draw in draws[discrepancy][:4]:
        for _ in range(30):
            logs, direction = generator.standard_normal((2, 3)) * 0.35
            logs, direction = logs - logs.mean(), direction - direction.mean()
            steps = [logs + sign * 1e-6 * direction for sign in (1, -1)]
            ahead, behind = (float(draw.energy(stretches_of(state))) for state in steps)
            expected = (ahead - behind) / 2e-6
            scale = derivative(draw.energy, logs, logs) / np.linalg.norm(logs)
            assert derivative(draw.energy, logs, direction) == pytest.approx(expected, rel=1e-5, abs=1e-6 * abs(scale))


@pytest.mark.parametrize("mode", ["uniaxial", "equibiaxial", "planar", "simple-shear"])
def test_the_stress_of_draws_beyond_is_the_derivative_of_their_energy(posteriors, mode):
    ensemble, loading = posteriors["auto"].ensemble(16, admissible=False), loading_mode(mode)
    points = loading.excursion(np.array([0.2, 0.45, 0.8, 1.3]))
    (path,) = loading.paths
    stretches = [path.moved(points, step).stretches for step in (1e-6, -1e-6)]
    expected = [(draw.energy(stretches[0]) - draw.energy(stretches[1])) / 2e-6 / path.loaded_axes for draw in ensemble]
    stress = ensemble.stress(loading, points)
    np.testing.assert_allclose(stress, expected, rtol=1e-6, atol=1e-6 * np.abs(stress).max())
    np.testing.assert_allclose(
        [tq.engineering_stress(draw, loading, points, ()) for draw in ensemble], stress, rtol=1e-9, atol=1e-12
    )


def test_energies_of_many_states_are_those_of_single_ones(draws):
    logs = np.random.default_rng(6).standard_normal((40, 3)) * 0.3
    logs -= logs.mean(axis=1, keepdims=True)
    for draw in draws["auto"]:
        expected = [float(draw.energy(stretches_of(state))) for state in logs]
        np.testing.assert_allclose(draw.energy(stretches_of(logs)), expected, rtol=1e-13)


def test_a_discrepancy_without_a_range_is_not_continued():
    posterior = fitted("zero-modulus")
    for draw in posterior.ensemble(4, admissible=False):
        for c in DIRECTIONS:
            stretches = stretches_of(2.9 * unit_along(c))
            assert draw.energy(stretches) == without_continuation(draw)(stretches)


@pytest.mark.parametrize(
    ("discrepancy", "mode", "stretch", "limiting_invariant"),
    [
        ("zero-modulus", "uniaxial", np.linspace(1.02, 1.8, 20), 4.0),
        ("second-invariant", "equibiaxial", np.linspace(1.02, 1.4, 20), 3.0),
    ],
)
def test_a_material_that_locks_within_the_limits_of_another_direction_has_draws(
    discrepancy, mode, stretch, limiting_invariant
):
    data = tq.simulate("gent", {"mu": 1.0, "Jm": limiting_invariant}, stretch, noise_sd=0.03, seed=3, mode=mode)
    priors = {"Jm": tq.Uniform(0.9 * limiting_invariant, 1.1 * limiting_invariant)}
    posterior = tq.fit(data, material="gent", discrepancy=discrepancy, noise_sd=0.03, priors=priors)
    draws = posterior.ensemble(4, admissible=False)
    loading = loading_mode(mode)
    band = posterior.predict([stretch[-1]], mode=mode, noise=False)
    assert draws.stress(loading, stretch[-1:]).mean() == pytest.approx(band["median"].iloc[0], rel=0.05)
    gradient, hessian = distortional_energy(draws[0]).derivatives(np.array([[1.2], [1.2**-0.5], [1.2**-0.5]]))
    assert np.isfinite(gradient).all()
    assert np.isfinite(hessian).all()


def states_of_elements(ranges, draw):
    """Return stretches (3, n): at rest and near, inside, at the end of a draw's range and beyond, not isochoric."""
    logs = [np.zeros(3), 1e-12 * unit_along(0.3), 1e-8 * unit_along(1.0), -1e-6 * unit_along(1.0)]
    for c in (1.0, 0.9713, 0.5013, 0.1234, 0.0013, -0.4321, -0.7713, -1.0):  # off the knots, where Hessians jump
        unit = unit_along(c)
        end = end_of(draw, unit, ranges)
        logs += [end * factor * unit for factor in (0.3, 0.999, 1 - 1e-9, 1.0, 1 + 1e-9, 1.001, 1.5, 3.0)]
    volumes = np.random.default_rng(7).uniform(0.95, 1.05, len(logs))
    volumes[:4] = 1
    return np.exp(np.array(logs)).T * volumes ** (1 / 3)


def isochoric(draw, stretches):
    """Return the energy (n,) of a draw at stretches (3, n) of the same shape and no change of volume."""
    return np.array([draw.energy(tuple(state / np.prod(state) ** (1 / 3))) for state in stretches.T])


@pytest.mark.parametrize("discrepancy", ["taylor+second-invariant", "hencky", "auto"])
def test_gradients_and_hessians_of_elements_are_finite_and_derivatives_of_the_draws_energy(
    posteriors, draws, discrepancy
):
    for draw in draws[discrepancy][:3]:
        stretches, energy = states_of_elements(ranges_of(posteriors[discrepancy]), draw), distortional_energy(draw)
        gradient, hessian = energy.derivatives(stretches)
        assert np.isfinite(gradient).all()
        assert np.isfinite(hessian).all()
        np.testing.assert_allclose(hessian, hessian.swapaxes(0, 1), atol=1e-9 * np.abs(hessian).max())
        assert (hessian[0, 0, 0] - hessian[1, 0, 0]) / 2 == pytest.approx(2 * draw.values["C10"], rel=1e-6)
        np.testing.assert_allclose(energy(stretches), isochoric(draw, stretches), rtol=1e-10, atol=1e-18)
        is_end = np.isin(np.arange(stretches.shape[1] - 4) % 8, [2, 3, 4])
        is_end = np.concatenate([np.zeros(4, dtype=bool), is_end])  # where rounding decides on which side a state is
        for axis, direction in enumerate(np.eye(3)[:, :, None]):
            imaginary = isochoric(draw, stretches + 1j * IMAGINARY * direction).imag / IMAGINARY
            tolerance = np.where(is_end, 1e-6, 1e-10) * (np.abs(imaginary) + np.abs(imaginary).max())
            assert (np.abs(gradient[axis] - imaginary) < tolerance).all()
            step = 1e-6 * direction
            ahead, behind = (isochoric(draw, stretches + sign * step) for sign in (1, -1))
            error = np.abs(gradient[axis] - (ahead - behind) / 2e-6)[~is_end]
            assert error.max() < 1e-6 * np.abs(gradient).max()
            slopes = [energy.derivatives(stretches + sign * step)[0] for sign in (1, -1)]
            second = ((slopes[0] - slopes[1]) / 2e-6)[:, ~is_end]
            assert np.abs(hessian[:, axis][:, ~is_end] - second).max() < 1e-5 * np.abs(hessian).max()
