"""Rays of Hencky strain: where they leave a range, and how an energy goes on along them, against other computations."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import fractional_matrix_power
from scipy.optimize import brentq
from scipy.stats import t as student_t

from loading import MEASURED
from tissuq.experiments.modes import loading_mode
from tissuq.mechanics import material_named
from tissuq.mechanics.rays import (
    DIRECTIONS,
    INNER_SHARE,
    MAX_CORNER_EXCESS,
    MAX_EXPONENT,
    MIN_EXPONENT,
    TRANSITION,
    Range,
    Rays,
    direction_of_angle,
    drawn_back,
    ends_of,
    log_growth,
    scores,
    share_to_end,
    share_within,
    through,
    with_errors,
)
from tissuq.mechanics.stress import stresses_at

UNIAXIAL, PLANAR, EQUIBIAXIAL = np.array([2, -1, -1]), np.array([1, 0, -1]), np.array([1, 1, -2])


def random_logs(count, largest, seed):
    """Logarithmic stretches (count, 3) of isochoric states, up to that Hencky strain."""
    generator = np.random.default_rng(seed)
    logs = generator.standard_normal((count, 3))
    logs -= logs.mean(axis=1, keepdims=True)
    return logs * (largest * generator.random(count) / np.linalg.norm(logs, axis=1))[:, None]


def random_ranges(count, seed):
    """Ranges of which some limits are infinite."""
    generator = np.random.default_rng(seed)
    for _ in range(count):
        sizes = 10 ** generator.uniform(-3, 0.7, 4)
        sizes[generator.random(4) < 0.4] = np.inf
        yield Range(sizes[0], sizes[1], (-sizes[2], sizes[3]))


def largest_ratio(share, logs, limits):
    """The largest ratio of what is limited to its limit, at a share of the way to a state."""
    low, high = limits.logarithms
    x, y = (np.exp(sign * share * logs).sum() - 3 for sign in (2, -2))
    highest, lowest = share * logs.max(), share * logs.min()
    return max(x / limits.invariant_1, y / limits.invariant_2, highest / high, lowest / low)


def slope(function, at):
    """The derivative of a function, by an imaginary step."""
    return function(at + 1e-30j).imag / 1e-30


def invariant_along(direction):
    """I1 - 3 as function of the Hencky strain along a ray."""
    unit = direction / np.linalg.norm(direction)
    return lambda strain: np.exp(2 * strain * unit).sum() - 3


@pytest.mark.parametrize("largest", [0.1, 1.0, 4.0])
def test_the_share_within_is_the_root_of_the_first_limit_that_is_reached(largest):
    logs, generator = random_logs(40, largest, seed=1), np.random.default_rng(2)
    is_inside = []
    for limits in random_ranges(30, generator):
        shares = share_within(logs, limits)
        for state, share in zip(logs, shares, strict=True):
            is_inside.append(largest_ratio(1.0, state, limits) <= 1)
            if is_inside[-1]:
                assert share == 1
            else:
                root = brentq(lambda s, state=state, limits=limits: largest_ratio(s, state, limits) - 1, 1e-9, 1)
                assert share == pytest.approx(root, rel=1e-8)
    assert 0.02 < np.mean(is_inside) < 0.98


def test_states_at_rest_stay_where_they_are():
    for limits in [*random_ranges(20, seed=3), Range()]:
        np.testing.assert_array_equal(share_within(np.zeros((2, 3)), limits), 1.0)


def test_without_limits_every_state_is_within():
    np.testing.assert_array_equal(share_within(random_logs(50, 4.0, seed=4), Range()), 1.0)


def test_a_state_at_the_end_is_within_and_one_just_beyond_is_not():
    logs = np.log([[1.5, 1.5**-0.5, 1.5**-0.5]])
    limit = 1.5**2 + 2 / 1.5 - 3
    shares = [share_within(logs * factor, Range(invariant_1=limit))[0] for factor in (1, 1 + 1e-6)]
    assert shares[0] == 1
    assert shares[1] == pytest.approx(1 / (1 + 1e-6), abs=1e-9)


def test_what_lies_in_two_ranges_is_within_both():
    logs, ranges = random_logs(60, 1.5, seed=5), list(random_ranges(12, seed=6))
    for first, second in zip(ranges[::2], ranges[1::2], strict=True):
        expected = np.minimum(share_within(logs, first), share_within(logs, second))
        np.testing.assert_allclose(share_within(logs, first.within(second)), expected, rtol=1e-8)


def test_states_through_logarithmic_stretches_have_these_and_their_rates():
    logs, rates = random_logs(7, 1.0, seed=7), random_logs(7, 3.0, seed=8)
    states = through(logs, rates)
    assert len(states) == 7
    np.testing.assert_allclose(states.log_stretches[0], logs, atol=1e-15)
    np.testing.assert_allclose(states.log_stretches[1], rates, atol=1e-15)


@pytest.mark.parametrize(
    ("law", "values"),
    [("yeoh", [0.7, -0.1, 0.02]), ("mooney-rivlin", [0.4, 0.2]), ("ogden-2", [0.7, 0.2, 3.1, -2.3])],
)
def test_the_stress_through_logarithmic_stretches_is_the_work_on_the_rates(law, values):
    material = material_named(law)
    logs, rates = random_logs(7, 0.8, seed=9), random_logs(7, 3.0, seed=10)
    energy = [material.energy(tuple(np.exp(logs + step * rates).T), values) for step in (1e-5, -1e-5)]
    expected = (energy[0] - energy[1]) / 2e-5
    np.testing.assert_allclose(stresses_at(material, through(logs, rates), values), expected, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("mode", ["uniaxial", "equibiaxial", "planar", "simple-shear"])
def test_common_modes_follow_one_ray(mode):
    loading = loading_mode(mode)
    states = loading.at(loading.excursion(np.array([0.05, 0.2, 0.5, 0.9])))
    for vectors in states.log_stretches:
        units = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
        np.testing.assert_allclose(units, np.broadcast_to(units[0], units.shape), atol=1e-12)


@pytest.mark.parametrize("direction", [UNIAXIAL, -UNIAXIAL, PLANAR, EQUIBIAXIAL, np.array([5, -2, -3])])
@pytest.mark.parametrize("exponent", [-0.5, 0.0, 0.7, 2.0, 4.9])
def test_the_last_exponent_and_the_growth_of_a_power_law_are_its_own(direction, exponent):
    # W = x^(n+1) / (n+1), so that V = x^n, and the stress along the ray is x^n dx/dr.
    unit, end, strains = direction / np.linalg.norm(direction), 0.3, [0.31, 0.6, 1.5]
    x = invariant_along(direction)

    def stress(strain):
        return slope(lambda r: x(r) ** (exponent + 1) / (exponent + 1), strain)

    rays = Rays(np.tile(end * unit, (3, 1)), np.outer(strains, unit))
    at_end, farther_in = np.full(3, stress(end)), np.full(3, stress(INNER_SHARE * end))
    np.testing.assert_allclose(rays.last_exponents(at_end, farther_in), exponent, atol=1e-10)
    growth = rays.growth(np.full(3, exponent), np.zeros(3))
    np.testing.assert_allclose(growth, [stress(strain) / stress(end) for strain in strains], rtol=1e-10)


def test_the_last_states_are_the_ends_and_others_farther_in_with_the_stress_along_the_ray():
    units = np.array([UNIAXIAL, PLANAR, EQUIBIAXIAL]) / np.sqrt([[6], [2], [6]])
    rays = Rays(0.4 * units, 0.9 * units)
    logs, rates = rays.last_states.log_stretches
    np.testing.assert_allclose(logs, np.vstack([0.4 * units, 0.4 * INNER_SHARE * units]), atol=1e-15)
    np.testing.assert_allclose(rates, np.vstack([units, units]), atol=1e-14)
    expected = [slope(invariant_along(unit), 0.4) for unit in units]
    np.testing.assert_allclose(rays.end_rate, expected, rtol=1e-12)


def test_the_last_exponent_is_zero_unless_both_stresses_are_positive():
    rays = Rays(np.tile(0.3 * UNIAXIAL, (6, 1)), np.tile(0.5 * UNIAXIAL, (6, 1)))
    at_end, farther_in = np.array([1.0, -1, -1, 0, 1, np.nan]), np.array([-1.0, 1, -1, 1, 0, 1])
    np.testing.assert_array_equal(rays.last_exponents(at_end, farther_in), 0)


def test_exponents_of_many_draws_are_those_of_single_ones():
    ends, generator = random_logs(5, 0.5, seed=11), np.random.default_rng(12)
    rays, stresses = Rays(ends, 2 * ends), generator.uniform(-0.2, 1, (2, 4, 5))
    single = [rays.last_exponents(*pair) for pair in stresses.swapaxes(0, 1)]
    np.testing.assert_array_equal(rays.last_exponents(*stresses), single)


def test_the_stress_of_a_neo_hookean_material_goes_on_as_it_is():
    stretch, end = np.array([1.2, 1.7, 3.0]), 1.15
    logs = np.log(stretch)[:, None] * [1, -0.5, -0.5]
    growth = Rays(np.tile(np.log(end) * np.array([1, -0.5, -0.5]), (3, 1)), logs).growth(np.zeros(3), np.zeros(3))
    # The stress l (l - l^-2), over the logarithm of the stretch along the ray.
    np.testing.assert_allclose(growth, (stretch**2 - 1 / stretch) / (end**2 - 1 / end), rtol=1e-12)


def test_growth_is_the_stated_formula():
    s, a, b, d = 1.3, 0.4, -0.7, TRANSITION
    assert log_growth(s, a, b) == pytest.approx(a * s + b * s**2 / (s + d), rel=1e-14)


def test_the_exponent_is_at_first_that_of_the_range_and_far_away_that_with_its_error():
    def local(s, step):
        return (log_growth(s + step, 0.8, -1.1) - log_growth(s - step, 0.8, -1.1)) / (2 * step)

    assert local(1e-6, 1e-7) == pytest.approx(0.8, abs=1e-5)
    assert local(1e4, 1.0) == pytest.approx(-0.3, abs=1e-6)
    assert (np.diff(local(np.linspace(0.01, 8, 200), 1e-3)) < 0).all()


@pytest.mark.parametrize("last", [-3.0, MIN_EXPONENT, -0.2, 0.0, 0.6, 2.0, MAX_EXPONENT, 7.0])
def test_errors_of_exponents_grow_with_these_and_both_together_stay_between_their_limits(last):
    score = np.linspace(-25, 25, 2001)
    exponent, error = with_errors(np.full(2001, last), score)
    (low, middle, high) = with_errors(np.zeros(3), np.array([-0.1, 0.0, 0.1]))[1]
    assert high - middle == pytest.approx(middle - low)
    assert high > middle
    within = min(max(last, MIN_EXPONENT), MAX_EXPONENT)
    wanted = within + (1 + abs(within)) * (middle + (high - middle) / 0.1 * score)
    np.testing.assert_array_equal(exponent, within)
    far = exponent + error
    assert (far.min(), far.max()) == pytest.approx((MIN_EXPONENT, MAX_EXPONENT), abs=1e-12)
    is_free = (wanted > MIN_EXPONENT) & (wanted < MAX_EXPONENT)
    assert is_free.any()
    np.testing.assert_allclose(far[is_free], wanted[is_free], atol=1e-12)
    assert (np.diff(far) >= -1e-12).all()


def test_an_error_of_many_draws_is_one_along_all_rays():
    last = np.random.default_rng(13).uniform(-1, 3, (4, 5))
    score = np.array([-2.0, -0.1, 0.5, 3.0])
    exponent, error = with_errors(last, score[:, None])
    assert exponent.shape == error.shape == (4, 5)
    for row, number in enumerate(score):
        np.testing.assert_array_equal((exponent + error)[row], np.sum(with_errors(last[row], number), axis=0))


def test_scores_are_students_quantiles_without_the_outermost_tails():
    probability = np.concatenate([[0, 1e-9, 1 - 1e-9, 1], np.random.default_rng(14).random(1000)])
    expected = student_t(2).ppf(0.001 + 0.998 * probability)
    np.testing.assert_allclose(scores(probability), expected, rtol=1e-9, atol=1e-12)
    assert np.isfinite(scores(np.array([0.0, 1.0]))).all()


def test_scores_grow_with_their_probability_and_are_symmetric():
    probability = np.linspace(0, 1, 4001)
    assert (np.diff(scores(probability)) > 0).all()
    np.testing.assert_allclose(scores(probability), -scores(1 - probability), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("direction", [UNIAXIAL, PLANAR, EQUIBIAXIAL, -UNIAXIAL])
def test_at_the_least_exponent_the_stress_at_small_strains_does_not_fall(direction):
    # x grows with the square of a small strain r, so that V = x^(-1/2) has the stress V dx/dr of a constant. Its first
    # derivative at r = 0 is (2/3) sum u^3, below zero between planar and equibiaxial tension.
    unit = direction / np.linalg.norm(direction)
    strains = np.array([1e-3, 2e-3, 5e-3, 1e-2])
    rays = Rays(np.tile(1e-3 * unit, (4, 1)), np.outer(strains, unit))
    growth = rays.growth(np.full(4, MIN_EXPONENT), np.zeros(4))
    np.testing.assert_allclose(growth, 1 + (strains - 1e-3) * 2 / 3 * (unit**3).sum(), atol=1e-4)


@pytest.mark.parametrize("direction", [UNIAXIAL, np.array([4, -1, -3]), PLANAR])
def test_from_uniaxial_to_planar_tension_the_stress_never_falls(direction):
    unit, strains = direction / np.linalg.norm(direction), np.geomspace(0.011, 2.5, 300)
    rays = Rays(np.tile(0.01 * unit, (300, 1)), np.outer(strains, unit))
    for last, score in ((-0.5, 0.0), (-0.5, -30.0), (0.0, -30.0), (2.0, -30.0), (0.3, -1.0), (1.0, 4.0)):
        exponents = with_errors(np.full(300, last), np.full(300, score))
        assert (np.diff(rays.growth(*exponents)) > -1e-9).all()


@pytest.mark.parametrize(
    ("limits", "corner"),
    [
        (Range(logarithms=(-0.2, 0.4)), 0.0),  # of a test in uniaxial tension
        (Range(logarithms=(-0.4, 0.2)), np.pi / 3),  # in equibiaxial tension
        (Range(logarithms=(-0.4, 0.4)), np.pi / 6),  # in planar tension
        (Range(invariant_1=0.4), None),
        (Range(0.5, 0.45, (-0.5, 0.3)), None),
    ],
)
def test_corners_of_a_range_are_rounded_from_outside(limits, corner):
    angles = np.arccos(DIRECTIONS) / 3
    excess = np.log(ends_of(limits)) - np.log(3 * share_within(3 * direction_of_angle(angles), limits))
    assert excess.min() > -1e-9
    assert excess.max() < 1.05 * MAX_CORNER_EXCESS
    if corner is not None:
        assert excess[np.abs(angles - corner).argmin()] == pytest.approx(0, abs=1e-9)
    fine = np.linspace(0.01, np.pi / 3 - 0.01, 4000)
    slopes = np.gradient(np.log(share_to_end(3 * direction_of_angle(fine), limits)), fine)
    bends = np.abs(np.diff(slopes)) / np.diff(fine)
    assert np.median(bends) < 5
    assert bends.max() < 3 / 0.04  # where it is sharp, it has the angle 1.7 over 0.04 and more instead of nothing


def test_a_range_without_limits_has_no_end():
    assert share_to_end(direction_of_angle(np.array([0.0, 0.5])) * 2.9, Range()).tolist() == [1.0, 1.0]
    assert share_to_end(np.zeros((1, 3)), Range(invariant_1=0.1)).tolist() == [1.0]


@pytest.mark.parametrize("measured", MEASURED, ids=str)
def test_states_drawn_back_are_powers_of_their_deformation(measured):
    states = measured.path.at(measured.points)
    for share in (0.3, 1.0):
        drawn = drawn_back(states, np.full(len(states), share))
        strains, _ = drawn.axis_strains
        for point, along_axes, logs in zip(measured.points, strains, drawn.log_stretches[0], strict=True):
            F = measured.gradient(point)
            power = fractional_matrix_power(F.T @ F, share)
            assert np.allclose(1 + along_axes, np.diag(power)[:2], atol=1e-12)
            assert np.allclose(np.sort(2 * logs), np.log(np.linalg.eigvalsh(power)), atol=1e-12)
    # Where nothing is drawn back, every strain changes at the rate that it has on the path.
    for name in ("axis_strains", "log_stretches"):
        assert np.allclose(getattr(drawn, name)[1], getattr(states, name)[1], atol=1e-9), name


@pytest.mark.parametrize("dispersion", [0.0, 0.2])
def test_rays_end_where_a_strain_along_an_axis_does(dispersion):
    limits = Range(along_axes=((dispersion, -0.06, 0.15),))

    def strain(F, share):
        C = fractional_matrix_power(F.T @ F, share).real
        sizes = [
            np.trace((dispersion * np.eye(3) + (1 - 3 * dispersion) * np.diag(axis)) @ C) - 1 for axis in np.eye(3)[:2]
        ]
        return np.maximum(np.array(sizes) / 0.15, np.array(sizes) / -0.06).max()

    count = 0
    for measured in MEASURED:
        points = measured.points
        states = measured.path.at(points)
        shares = share_to_end(states.log_stretches[0], limits, states.tilt[0])
        for point, share in zip(points, shares, strict=True):
            F = measured.gradient(point)
            if share == 1:
                assert strain(F, 1.0) <= 1 + 1e-9
            else:
                count += 1
                assert strain(F, share) == pytest.approx(1, rel=1e-6)
                assert strain(F, 1.0) > 1 or dispersion  # with a dispersion, a strain may turn back
    assert count > 50
