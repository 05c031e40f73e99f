import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tissuq.errors import InputError
from tissuq.inference.coordinates import Box, derivatives_on_line, find_modes, log_density_on_line

KINDS = Box([-np.inf, 2.0, -np.inf, -50.0], [np.inf, np.inf, -3.0, 50.0])


def modes_of(log_density, box, start):
    return find_modes(derivatives_on_line(log_density, box), box, start, np.random.default_rng(0))


@pytest.mark.slow
@pytest.mark.parametrize(
    "point", [[0.0, 3.0, -4.0, 0.0], [-1e6, 2 + 1e-9, -1e9, -50 + 1e-9], [1e6, 1e9, -3 - 1e-9, 49.999]]
)
def test_a_point_returns_from_the_line(point):
    np.testing.assert_allclose(KINDS.from_line(KINDS.to_line(point)), point, rtol=1e-13)


@pytest.mark.parametrize("distance", [1e-3, 1e-30, 1e-300])
def test_a_distance_to_a_bound_at_zero_keeps_its_relative_accuracy(distance):
    box = Box([0.0, -10.0], [10.0, 0.0])
    np.testing.assert_allclose(box.from_line(box.to_line([distance, -distance])), [distance, -distance], rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("far", [-1e3, 1e3])
def test_rounding_never_puts_a_point_on_a_bound(far):
    box = Box([0.0, -50.0, 1e6, -10.0], [10.0, 50.0, 1e6 + 1, 0.0])
    point = np.asarray(box.from_line(jnp.full(4, far)))
    assert np.all((box.lower < point) & (point < box.upper))


@pytest.mark.slow
@pytest.mark.parametrize("line", [[0.3, 0.3, 0.3, 0.3], [-5.0, -9.0, -9.0, -5.0], [700.0, 5.0, 5.0, 5.0]])
def test_the_log_jacobian_is_the_log_of_the_slopes(line):
    slopes = np.diag(jax.jacfwd(KINDS.from_line)(jnp.array(line)))
    assert KINDS.log_jacobian(jnp.array(line)) == pytest.approx(np.log(np.abs(slopes)).sum(), rel=1e-9)


@pytest.mark.slow
def test_slopes_stay_finite_where_an_unused_branch_overflows():
    assert np.isfinite(jax.jacfwd(KINDS.from_line)(jnp.array([1e4, 1.0, 1.0, 1e4]))).all()


@pytest.mark.slow
def test_a_uniform_density_between_two_bounds_becomes_standard_normal():
    on_line = log_density_on_line(lambda x: -jnp.log(10.0), Box([0.0], [10.0]))
    assert on_line(jnp.array([1.7])) == pytest.approx(-0.5 * 1.7**2 - 0.5 * np.log(2 * np.pi), abs=1e-14)


def test_the_mode_and_scale_of_a_normal_density_are_its_mean_and_covariance():
    mean, sds = np.array([3.0, -2e3]), np.array([1e-4, 1e3])
    covariance = np.outer(sds, sds) * [[1.0, 0.9], [0.9, 1.0]]
    precision = np.linalg.inv(covariance)

    def log_density(x):
        return -0.5 * (x - mean) @ precision @ (x - mean)

    (mode,) = modes_of(log_density, Box([-np.inf] * 2, [np.inf] * 2), [0.0, 0.0])
    np.testing.assert_allclose(mode.location, mean, atol=1e-4 * sds.min())
    np.testing.assert_allclose(mode.scale @ mode.scale.T, covariance, rtol=1e-8)
    assert mode.log_mass == pytest.approx(0.5 * np.linalg.slogdet(covariance)[1], abs=1e-7)


def test_whitening_and_its_inverse_cancel():
    (mode,) = modes_of(lambda x: -jnp.sum((x - 1) ** 2), Box([-np.inf] * 3, [np.inf] * 3), [0.0, 0.0, 0.0])
    np.testing.assert_allclose(mode.whiten(mode.unwhiten(np.array([1.0, 2.0, 3.0]))), [1.0, 2.0, 3.0])


@pytest.mark.slow
def test_a_second_mode_with_probability_is_found_and_a_negligible_one_is_not():
    def two_peaks(log_weight):
        def log_density(x):
            return jnp.logaddexp(-50 * (x[0] + 5) ** 2, log_weight - 50 * (x[0] - 5) ** 2)

        return log_density

    box = Box([-10.0], [10.0])
    places = [float(box.from_line(mode.location)[0]) for mode in modes_of(two_peaks(-1.0), box, [1.0])]
    assert places == pytest.approx([-5.0, 5.0], abs=0.02)
    assert len(modes_of(two_peaks(-7.0), box, [1.0])) == 1


def test_a_search_crosses_a_region_that_curves_the_wrong_way():
    (mode,) = modes_of(lambda x: -3 * jnp.log1p(x @ x), Box([-np.inf] * 2, [np.inf] * 2), [40.0, -30.0])
    np.testing.assert_allclose(mode.location, 0.0, atol=1e-4)


def test_bounds_that_cross_are_refused():
    with pytest.raises(InputError, match=r"bounds 1: 2\.0 is not below 2\.0"):
        Box([0.0, 2.0], [1.0, 2.0])


def test_bounds_of_different_lengths_are_refused():
    with pytest.raises(InputError, match="one shape"):
        Box([0.0, 2.0], [1.0])


@pytest.mark.parametrize("point", [[0.0], [1.0], [np.nan]])
def test_a_point_outside_the_open_box_is_refused(point):
    with pytest.raises(InputError, match=r"must lie inside \(0\.0, 1\.0\)"):
        Box([0.0], [1.0]).to_line(point)


def test_a_point_of_another_dimension_is_refused():
    with pytest.raises(InputError, match="1 coordinates"):
        Box([0.0], [1.0]).to_line([0.5, 0.5])


def test_a_start_without_a_finite_density_is_refused():
    with pytest.raises(InputError, match="not finite at"):
        modes_of(lambda x: jnp.log(x[0] - 5), Box([0.0], [10.0]), [1.0])
