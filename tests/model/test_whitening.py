"""Errors of whole tests: covariances written out as matrices, and what whitening makes of them."""

from __future__ import annotations

import numpy as np
import pytest

from tissuq import Experiment, InputError, Tolerances
from tissuq.experiments.modes import Uniaxial
from tissuq.model.error_model import whitening
from tissuq.model.measurement_errors import ErrorPoints
from tissuq.model.tolerances import FittedErrors

STRETCH = [np.array([0.8, 0.9, 1.1]), np.array([1.1, 1.3, 1.5, 1.7])]
CURVE = np.concatenate([2 * (each - each**-2) for each in STRETCH])
SLOPE = np.concatenate([2 * (1 + 2 * each**-3) for each in STRETCH])
NOISE_SD = np.array([0.02, 0.05])
SIZE = np.repeat(NOISE_SD, [3, 4])


def two_tests(*specimens):
    parts = zip(STRETCH, specimens, strict=True)
    return Experiment.of([Experiment("uniaxial", each, each - 1, name="test", specimen=name) for each, name in parts])


def of(tolerances, *specimens, lag=0.0):
    return whitening(two_tests(*specimens), NOISE_SD, 0.03, tolerances, FittedErrors(CURVE, SLOPE[:, None], lag=lag))


def noise(size, lag):
    place = np.arange(7)
    same = np.repeat([0, 1], [3, 4])[:, None] == np.repeat([0, 1], [3, 4])
    return np.outer(size, size) * same * float(lag) ** np.abs(place[:, None] - place)


def covariance(tolerances, *specimens, lag=0.0):
    """Noise, and what the tolerances add: of the stress only the differences between specimens."""
    first = np.repeat([1.0, 0.0], [3, 4])
    same = np.array(specimens)[:, None] == np.array(specimens)
    shared = np.kron(same, np.ones(1))[np.ix_(np.repeat([0, 1], [3, 4]), np.repeat([0, 1], [3, 4]))]
    apart = np.outer(CURVE, CURVE) * (np.outer(2 * first - 1, 2 * first - 1) / 2 if not same.all() else 0.0)
    strain = np.concatenate(STRETCH) - 1
    largest = np.repeat([np.abs(CURVE[:3]).max(), np.abs(CURVE[3:]).max()], [3, 4])
    of_stretch, of_stress = tolerances.sizes.get("stretch", 0.0), tolerances.sizes.get("resolution", 0.0)
    found = (
        noise(np.sqrt(SIZE**2 + (of_stretch * SLOPE) ** 2 + (of_stress * largest) ** 2), lag)
        + tolerances.stress**2 * apart
        + tolerances.sizes.get("zero", 0.0) ** 2 * shared
    )
    sign = 2 * first - 1
    found += tolerances.sizes.get("test", 0.0) ** 2 / 2 * np.outer(sign * CURVE, sign * CURVE)
    found += tolerances.sizes.get("slack", 0.0) ** 2 * shared * np.outer((strain + 1) * SLOPE, (strain + 1) * SLOPE)
    return found + tolerances.sizes.get("length", 0.0) ** 2 * shared * np.outer(strain * SLOPE, strain * SLOPE)


CASES = [
    (Tolerances(), ("a", "b"), 1e-12),
    (Tolerances(stress=0.15), ("a", "b"), 1e-12),
    (Tolerances(stress=0.15, zero=0.01), ("a", "a"), 1e-12),
    (Tolerances(stress=0.3, zero=0.1), ("a", "b"), 1e-12),
    (Tolerances(length=0.02), ("a", "b"), 1e-12),
    (Tolerances(stretch=0.001), ("a", "b"), 1e-12),
    (Tolerances(test=0.1), ("a", "a"), 1e-12),
    (Tolerances(resolution=0.01), ("a", "b"), 1e-12),
]


@pytest.mark.parametrize("lag", [0.0, 0.7])
@pytest.mark.parametrize(("tolerances", "specimens", "within"), CASES)
def test_the_covariance_becomes_that_of_equal_independent_errors(tolerances, specimens, within, lag):
    white, full = of(tolerances, *specimens, lag=lag)(np.eye(7)), covariance(tolerances, *specimens, lag=lag)
    assert np.allclose(white @ full @ white.T, 0.03**2 * np.eye(7), atol=within * 0.03**2)


@pytest.mark.parametrize("lag", [0.0, 0.7])
@pytest.mark.parametrize(("tolerances", "specimens", "within"), CASES)
def test_its_other_faces_are_the_same_matrix(tolerances, specimens, within, lag):
    found = of(tolerances, *specimens, lag=lag)
    white, columns = found(np.eye(7)), np.random.default_rng(1).random((7, 3))
    assert np.allclose(found(columns), white @ columns, rtol=1e-12)
    assert np.allclose(found(columns[:, 0]), white @ columns[:, 0], rtol=1e-12)
    assert np.allclose(found.transposed(columns), white.T @ columns, rtol=1e-12)
    assert np.allclose(found.undone(found(columns)), columns, rtol=1e-10)
    assert np.allclose(found.precisions(np.full((2, 7), 3.0)), 3 * np.diag(white.T @ white), rtol=1e-10)
    assert found.log_determinant == pytest.approx(np.linalg.slogdet(white)[1], rel=1e-12)


def test_equal_tests_without_tolerances_need_none():
    assert whitening(two_tests("a", "b"), np.array([0.03, 0.03]), 0.03, Tolerances(), FittedErrors()) is None


def test_one_specimen_has_all_its_error_of_stress_in_common():
    assert Tolerances(stress=0.2).in_common(two_tests("a", "a")) == 0.2
    assert Tolerances(stress=0.2).in_common(two_tests("a", "b")) == pytest.approx(0.2 / np.sqrt(2))
    assert Tolerances(stress=0.2).in_common(two_tests("", "")) == pytest.approx(0.2 / np.sqrt(2))
    assert Tolerances(stress=0.2, test=0.1).in_common(two_tests("a", "a")) == pytest.approx(np.sqrt(0.045))


def test_the_variance_of_a_new_test_is_that_of_its_errors():
    found = Tolerances(stress=0.1, length=0.02, slack=0.03, zero=0.5).variance(
        ErrorPoints(Uniaxial(), np.array([1.5]), np.array([2.0]), np.array([[4.0]]))
    )
    assert found == pytest.approx(0.2**2 + 0.5**2 + (0.02 * 0.5 * 4) ** 2 + (0.03 * 1.5 * 4) ** 2)


@pytest.mark.parametrize("bad", [-0.1, float("nan"), float("inf"), "15 %", True])
def test_a_tolerance_is_a_number(bad):
    with pytest.raises(InputError, match="the tolerance of the stress must be a number, zero or more"):
        Tolerances(stress=bad)
