"""Energy blocks: nothing at the reference, the same energy in every loading mode, variance as their features say."""

from __future__ import annotations

import numpy as np
import pytest

from loading import MEASURED
from tissuq.experiments.modes import loading_mode
from tissuq.mechanics import MooneyRivlin, stress_basis
from tissuq.mechanics.invariants import invariant_rates, invariants
from tissuq.model.discrepancy.blocks import Coordinates, EnergyBlock
from tissuq.registry import variants

BLOCKS = variants(EnergyBlock)
ISOTROPIC = [name for name, block in BLOCKS.items() if block.is_isotropic]
STRETCH = np.linspace(0.6, 2.5, 40)
EVERY_STRESS = pytest.mark.parametrize("measured", MEASURED, ids=str)


def of(name):
    return BLOCKS[name]()


def settings(block, path, points=STRETCH):
    reach = block.reach(path.at(points))
    return [(reach, length) for length in block.lengths]


@EVERY_STRESS
def test_rates_are_the_stresses_of_the_invariants(measured):
    path, points = measured.path, measured.points
    basis = stress_basis(MooneyRivlin(), path.at(points))
    assert np.allclose(np.column_stack(invariant_rates(path.at(points))), basis, rtol=1e-12, atol=1e-12)
    C = np.array([measured.gradient(point).T @ measured.gradient(point) for point in points])
    assert np.allclose(invariants(path.at(points))[0], np.trace(C, axis1=1, axis2=2) - 3, atol=1e-12)
    assert np.allclose(invariants(path.at(points))[1], np.trace(np.linalg.inv(C), axis1=1, axis2=2) - 3, atol=1e-12)
    assert np.allclose(np.sort(2 * path.at(points).log_stretches[0]), np.log(np.linalg.eigvalsh(C)), atol=1e-12)


@EVERY_STRESS
@pytest.mark.parametrize("name", ISOTROPIC)
def test_stress_and_modulus_vanish_at_the_reference_for_random_draws(name, measured):
    block, path = of(name), measured.path
    step = 1e-3
    near = measured.mode.excursion([-step, 0.0, step])
    for reach, length in settings(block, path, measured.points):
        features = block.stress_features(path.at(near), reach, length)
        u = np.random.default_rng(0).standard_normal((features.shape[1], 20))
        stress = features @ u
        size = np.abs(block.stress_features(path.at(measured.points), reach, length) @ u).max(axis=0)
        assert np.abs(stress[1]).max() < 1e-12 * size.max() + 1e-14
        slope = (stress[2] - stress[0]) / (2 * step)
        assert (np.abs(slope) < 1e-2 * size + 1e-9).all()  # two blocks have no stress in some modes


@EVERY_STRESS
@pytest.mark.parametrize("name", BLOCKS)
def test_features_make_up_the_variance_within_the_reach(name, measured):
    block, path, points = of(name), measured.path, measured.points
    for reach, length in settings(block, path, points):
        features = block.stress_features(path.at(points), reach, length)
        variance = block.stress_variance(path.at(points), reach, length)
        tolerance = 1e-8 if name != "spline" else 1e-5
        assert np.allclose((features**2).sum(axis=1), variance, atol=tolerance * variance.max())


@pytest.mark.parametrize("name", ISOTROPIC)
def test_one_energy_acts_in_every_mode(name):
    # The work along two paths to one and the same state is the same: equibiaxial at l is uniaxial at l^-2.
    block = of(name)
    uniaxial, equibiaxial = loading_mode("uniaxial"), loading_mode("equibiaxial")
    reach, length = settings(block, uniaxial)[0]
    ends = np.array([1.1, 1.2])
    nodes, weights = np.polynomial.legendre.leggauss(40)

    def energy(mode, end):
        points = 1 + 0.5 * (end - 1) * (1 + nodes)
        features = block.stress_features(mode.at(points), reach, length)
        return mode.path.loaded_axes * 0.5 * (end - 1) * weights @ features

    for end in ends:
        first, second = energy(equibiaxial, end), energy(uniaxial, end**-2)
        assert np.allclose(first, second, rtol=1e-5, atol=1e-5 * np.abs(first).max())


def by_chain_rule(block, path, points, reach, length):
    """Stresses (n, q) of a block's terms from their slopes, which are functions of I1, of I2 and of ln l alone."""
    (x, y), (logs, log_rates) = invariants(path.at(points)), path.at(points).log_stretches
    first, second = invariant_rates(path.at(points))
    found = block.slopes(Coordinates(x, y, logs.ravel()), reach, length)
    of_logs = np.einsum("nmq,nm->nq", found.logarithm.reshape(len(points), 3, -1), log_rates)
    return found.invariant_1 * first[:, None] + found.invariant_2 * second[:, None] + of_logs


@pytest.mark.parametrize("mode", ["uniaxial", "equibiaxial", "planar"])
@pytest.mark.parametrize("name", ISOTROPIC)
def test_stresses_follow_from_slopes_along_the_invariants_and_logarithms(name, mode):
    block, path = of(name), loading_mode(mode)
    for reach, length in settings(block, path):
        features = block.stress_features(path.at(STRETCH), reach, length)
        found = by_chain_rule(block, path, STRETCH, reach, length)
        assert np.allclose(found, features, rtol=1e-9, atol=1e-9 * np.abs(features).max())
