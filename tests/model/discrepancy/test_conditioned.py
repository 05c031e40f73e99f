"""Processes in stress that are conditioned on something: against dense conditioning, and what they promise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import simpson

import conditioned as oracle
import tissuq as tq
from tissuq.mechanics import NeoHookean, Yeoh, stress_basis
from tissuq.mechanics.material import materials
from tissuq.model.discrepancy import ConditionedProcess, ScaledProcess, discrepancy_named
from tissuq.registry import variants

NAMES = sorted(variants(ConditionedProcess))
STRETCH = np.linspace(0.6, 2.0, 30)
RANGE = 1.4
ENDS = (0.6, 2.0)
LENGTHS = [0.02 * RANGE, 0.1 * RANGE, 0.7 * RANGE, 3.0 * RANGE]
"""From end to end of the default prior of psi."""
UNIAXIAL = {
    "C10": lambda x: 2 * (x - x**-2),
    "C20": lambda x: 4 * (x**3 - 3 * x + 1 + 3 * x**-2 - 2 * x**-3),
    "C30": lambda x: 6 * (x**5 - 6 * x**3 + 3 * x**2 + 9 * x - 6 - 9 * x**-2 + 12 * x**-3 - 4 * x**-4),
}


def adapted(name, material=None, mode="uniaxial", stretch=STRETCH):
    data = tq.Experiment(mode, stretch, stretch)
    return discrepancy_named(name).adapted_to(material or NeoHookean(), data)


def expected(name, stretch, psi):
    if name == "gp-pinned":
        return oracle.pinned(stretch, psi)
    if name == "gp-orthogonal":
        return oracle.orthogonal(stretch, psi, ENDS, [UNIAXIAL["C10"]])
    return oracle.scaled(stretch, psi, ENDS, 10 * np.sqrt(len(STRETCH)))


def drawn(process, stretch, psi, count=20):
    """Return draws (n, count) of the process at unit c."""
    values, vectors = np.linalg.eigh(process.kernel(0, stretch, stretch, {"psi": psi}))
    return (vectors * np.sqrt(np.maximum(values, 0))) @ np.random.default_rng(1).standard_normal((len(values), count))


@pytest.mark.parametrize("psi", LENGTHS)
@pytest.mark.parametrize("name", NAMES)
def test_the_covariance_is_that_of_dense_conditioning_within_the_data_and_beyond(name, psi):
    points = np.linspace(0.5, 2.4, 23)
    found = adapted(name).kernel(0, points, points, {"psi": psi})
    rough = name == "gp-scaled" and psi == LENGTHS[0]  # 96 nodes are less than two for each psi there
    np.testing.assert_allclose(found, expected(name, points, psi), atol=1e-5 if rough else 1e-9)


@pytest.mark.parametrize("psi", LENGTHS)
def test_the_pinned_covariance_keeps_its_digits_where_it_is_tiny(psi):
    points = np.array([0.6, 0.97, 1.03, 1.2, 2.0])  # 1e-9 of the process's variance at the shortest distance
    found = adapted("gp-pinned").kernel(0, points, points, {"psi": psi})
    truth = oracle.pinned(points, psi)
    scale = np.sqrt(np.diag(truth))
    np.testing.assert_allclose(found / np.outer(scale, scale), truth / np.outer(scale, scale), atol=1e-8)


@pytest.mark.parametrize("psi", LENGTHS)
def test_a_pinned_process_has_no_stress_and_no_stiffness_at_the_reference(psi):
    step = 1e-4
    near = np.array([1 - step, 1.0, 1 + step])
    covariance = adapted("gp-pinned").kernel(0, np.append(STRETCH, near), near, {"psi": psi})
    np.testing.assert_allclose(covariance[:, 1], 0, atol=1e-15)
    slope = (covariance[:, 2] - covariance[:, 0]) / (2 * step)
    np.testing.assert_allclose(slope, 0, atol=10 * step**2 / psi**3)


def test_a_process_of_a_shear_stress_is_pinned_where_there_is_no_shear():
    stretch, psi = np.linspace(-0.4, 0.6, 11), 0.3
    found = adapted("gp-pinned", mode="simple-shear", stretch=stretch).kernel(0, stretch, stretch, {"psi": psi})
    np.testing.assert_allclose(found, oracle.pinned(1 + stretch, psi), atol=1e-12)


@pytest.mark.parametrize("psi", LENGTHS)
@pytest.mark.parametrize("mode", ["uniaxial", "equibiaxial", "planar"])
@pytest.mark.parametrize("material", [NeoHookean(), Yeoh()], ids=lambda material: material.name)
def test_orthogonal_draws_have_no_integral_with_the_stresses_of_the_material(material, mode, psi):
    line = np.linspace(*ENDS, 401)
    process = adapted("gp-orthogonal", material, mode)
    paths = drawn(process, line, psi)
    free = drawn(discrepancy_named("gp"), line, psi)
    for stress in stress_basis(material, tq.loading_modes()[mode]().at(line)).T:
        size = np.abs(simpson(free.T * stress, x=line)).max()
        assert np.abs(simpson(paths.T * stress, x=line)).max() < 1e-5 * size  # roots of rounding errors of 1e-16


@pytest.mark.slow
def test_the_least_squares_material_of_an_orthogonal_draw_is_zero():
    line = np.linspace(*ENDS, 2001)
    path = drawn(adapted("gp-orthogonal"), line, 0.5, count=1)[:, 0]
    best = np.linalg.lstsq(UNIAXIAL["C10"](line)[:, None], path)[0]
    assert abs(best[0]) < 2e-3 * np.abs(path).max()  # sums for integrals
    assert np.abs(path).max() > 0.3


@pytest.mark.parametrize("psi", LENGTHS)
def test_a_weak_penalty_leaves_the_process_alone_and_a_strong_one_nothing_of_it(psi):
    values, line = {"psi": psi}, np.linspace(*ENDS, 101)
    process = adapted("gp-scaled")
    free = discrepancy_named("gp").kernel(0, line, line, values)
    weak, strong = replace(process, penalty=1e-12), replace(process, penalty=1e10)
    np.testing.assert_allclose(weak.kernel(0, line, line, values), free, atol=1e-9)
    assert simpson(strong.kernel_diagonal(0, line, values), x=line) / RANGE < 1e-4


@pytest.mark.parametrize("psi", LENGTHS)
def test_no_direction_of_a_scaled_process_is_larger_than_its_penalty_allows(psi):
    line = np.linspace(*ENDS, 401)
    weights = simpson(np.eye(401), x=line, axis=1) / RANGE
    root = np.sqrt(weights)
    covariance = adapted("gp-scaled").kernel(0, line, line, {"psi": psi})
    largest = np.linalg.eigvalsh(root[:, None] * covariance * root)[-1]
    penalty = 10 * np.sqrt(len(STRETCH))
    free = np.linalg.eigvalsh(root[:, None] * oracle.squared_exponential(line, line, psi) * root)[-1]
    assert largest == pytest.approx(free / (1 + penalty * free), rel=1e-6)
    assert largest < 1 / penalty


@pytest.mark.parametrize("psi", LENGTHS)
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("material", [NeoHookean(), Yeoh()], ids=lambda material: material.name)
def test_covariances_are_symmetric_and_positive(name, material, psi):
    points = np.linspace(0.4, 2.6, 120)
    covariance = adapted(name, material).kernel(0, points, points, {"psi": psi})
    np.testing.assert_allclose(covariance, covariance.T, atol=1e-12)
    assert np.linalg.eigvalsh(covariance)[0] > -1e-12 * len(points)


@pytest.mark.parametrize("psi", LENGTHS)
@pytest.mark.parametrize("name", ["gp", *NAMES])
def test_the_relative_variance_is_the_diagonal(name, psi):
    points, process = np.linspace(0.5, 2.4, 41), adapted(name)
    diagonal = np.diag(process.kernel(0, points, points, {"psi": psi}))
    np.testing.assert_allclose(process.kernel_diagonal(0, points, {"psi": psi}), diagonal, atol=1e-12)
    assert diagonal.max() <= 1 + 1e-12


def test_the_model_adapts_a_discrepancy_to_its_own_data():
    first = tq.simulate("neo-hookean", {"C10": 1.0}, np.linspace(0.8, 1.3, 9), 0.05, seed=1)
    more = tq.simulate("neo-hookean", {"C10": 1.0}, np.linspace(1.4, 1.9, 9), 0.05, seed=2)
    for name in ("gp-orthogonal", "gp-scaled"):
        before = tq.fit(first, discrepancy=name, noise_sd=0.05)
        after, whole = before.update(more), tq.fit(first.joined(more), discrepancy=name, noise_sd=0.05)
        assert before.model.discrepancy.ranges == ((0.8, 1.3),)
        assert after.model.discrepancy == whole.model.discrepancy
        assert after.log_evidence == pytest.approx(whole.log_evidence, abs=1e-9)


@pytest.mark.parametrize("name", ["gp-orthogonal", "gp-scaled"])
def test_a_process_over_a_range_is_refused_before_it_knows_the_range(name):
    with pytest.raises(tq.ModelError, match=f"'{name}' depends on the experiment"):
        discrepancy_named(name).kernel(0, STRETCH, STRETCH, {"psi": 1.0})


def test_materials_with_exponents_have_no_orthogonal_process_and_say_so():
    for name in ("ogden-1", "ogden-2"):
        with pytest.raises(tq.ModelError, match=f"that of material '{name}' is not in alpha1"):
            adapted("gp-orthogonal", materials()[name]())
        assert isinstance(adapted("gp-scaled", materials()[name]()), ScaledProcess)


def test_what_is_estimated_is_told_with_the_result():
    data = tq.simulate("yeoh", {"C10": 1.0, "C20": 0.1, "C30": 0.0}, STRETCH, 0.1, seed=1)
    for name in ("gp-orthogonal", "gp-scaled"):
        posterior = tq.fit(data, discrepancy=name, noise_sd=0.1)
        assert "not the initial modulus" in posterior.warnings[0]
    assert not any("best fits" in text for text in tq.fit(data, discrepancy="gp-pinned", noise_sd=0.1).warnings)
