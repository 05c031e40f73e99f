"""Cases against solutions that are known: a punch on a layer, and a cylinder whose ends slide."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from tissuq.errors import ConvergenceError, InputError, ModelError
from tissuq.experiments.modes import loading_mode
from tissuq.finite_elements import (
    Case,
    ClampedBar,
    Indentation,
    Supports,
    bar_force,
    case_forces,
    cases,
    indentation_force,
    respond,
)
from tissuq.finite_elements.bodies import graded, grid
from tissuq.finite_elements.solver import Solver
from tissuq.mechanics import engineering_stress, material_named

pytest.importorskip("felupe", reason="FElupe is not installed")

MODULUS = 2e-3
"""MPa, of a soft tissue."""
NEO_HOOKEAN = material_named("neo-hookean")


def layer_factor(ratio, points=400, waves=4000):
    """The factor kappa of a flat punch without friction on an incompressible layer that is bonded to a rigid base.

    F = 8 mu a d kappa. The integral equation of Hayes et al. (1972) and Lebedev and Ufliand (1958) for the radius over
    the height, phi(t) - (1/pi) int M(t, s) phi(s) ds = 1 on 0 < t, s < 1, with kappa = int phi.
    """
    u = np.linspace(0, 30, waves)
    with np.errstate(invalid="ignore", over="ignore"):
        L = (2 * np.sinh(2 * u) - 4 * u) / (2 * np.cosh(2 * u) + 2 + 4 * u**2)
    missing = np.where(u < 15, 1 - L, 0.0)
    nodes, weights = np.polynomial.legendre.leggauss(points // 10)
    t, w = (nodes + 1) / 2, weights / 2
    cosines = np.cos(ratio * np.outer(t, u))
    quadrature = np.full(waves, u[1])
    quadrature[[0, -1]] /= 2
    kernel = 2 * ratio / np.pi * (cosines * missing * quadrature) @ cosines.T
    return float(w @ np.linalg.solve(np.eye(len(t)) - kernel * w, np.ones(len(t))))


@pytest.mark.parametrize(("ratio", "kappa"), [(0.2, 1.281), (0.6, 2.211), (1.0, 3.609)])
def test_the_integral_equation_has_the_factors_of_hayes(ratio, kappa):
    """Hayes et al. (1972), table 1, Poisson's ratio 0.5."""
    assert layer_factor(ratio) == pytest.approx(kappa, rel=3e-3)


@pytest.mark.finite_elements
@pytest.mark.parametrize(("ratio", "near"), [(0.1, 0.02), (1.0, 0.02)])
def test_a_shallow_punch_has_the_force_of_a_layer(ratio, near):
    """The mesh is too stiff, and less so when it is finer; a thick layer is also a little too small to be infinite."""
    sizes = {"punch_radius": 1.0, "height": 1 / ratio, "radius": 25.0 if ratio < 1 else 8.0, "contact": "frictionless"}
    exact = 8 * MODULUS * 1.0 * 1e-3 * layer_factor(ratio)
    coarse, fine = (
        indentation_force(NEO_HOOKEAN, [MODULUS / 2], [1e-3], **sizes, fineness=fineness)[0] for fineness in (1.0, 2.0)
    )
    assert fine == pytest.approx(exact, rel=near)
    assert exact * 0.995 < fine < coarse < 1.05 * exact


@dataclass(frozen=True)
class Cylinder(Case):
    """A cylinder whose ends slide on plates: every part of it is in the same state."""

    name = "cylinder between lubricated plates"
    description = "a test"
    travel_name = "elongation"

    elongation: float = 0.3
    height: float = 2.0
    radius: float = 1.5

    @property
    def travel(self):
        return self.elongation

    def mesh(self):
        return grid(np.linspace(0, self.height, 3), np.linspace(0, self.radius, 4))

    def supports(self, points):
        bottom, top = points[:, 0] < 1e-9, points[:, 0] > self.height - 1e-9
        return Supports(np.stack([bottom, points[:, 1] < 1e-9], axis=-1), top, 1.0)


@pytest.mark.finite_elements
def test_a_case_of_ones_own_has_the_engineering_stress_of_a_draw(draws):
    found = respond(Cylinder(), draws[0], steps=3, bulk_ratio=1e4)
    expected = engineering_stress(draws[0], loading_mode("uniaxial"), 1 + found.travel / 2.0, ()) * np.pi * 1.5**2
    np.testing.assert_allclose(found.force, expected, rtol=1e-3)
    np.testing.assert_allclose(found.fields.largest, 1.15, rtol=1e-3)
    np.testing.assert_allclose(found.fields.first_invariant, 1.15**2 + 2 / 1.15 - 3, rtol=5e-3)
    np.testing.assert_allclose(found.fields.second_invariant, 1.15**-2 + 2 * 1.15 - 3, rtol=5e-3)
    np.testing.assert_allclose(found.fields.von_mises, expected[-1] / (np.pi * 1.5**2) * 1.15, rtol=2e-3)


def test_the_weights_of_the_cells_are_the_volumes_of_rings():
    """By Pappus' theorem: the area of a rectangle, times the way of its centre."""
    case = Indentation(depth=0.1)
    points, cells = case.mesh()[:2]
    corners = points[cells]
    area = np.ptp(corners[..., 0], axis=1) * np.ptp(corners[..., 1], axis=1)
    volumes = Solver(case, NEO_HOOKEAN, [0.5], 100.0)._volumes.sum(axis=0)
    np.testing.assert_allclose(volumes, 2 * np.pi * corners[..., 1].mean(axis=1) * area, rtol=1e-10)
    assert volumes.sum() == pytest.approx(np.pi * case.radius**2 * case.height, rel=1e-10)


@pytest.mark.finite_elements
def test_the_share_beyond_the_measurements_is_all_or_nothing_in_a_uniform_state(draws):
    max_invariants = (1.1**2 + 2 / 1.1 - 3, np.inf)
    found = respond(Cylinder(), draws[0], steps=3, max_invariants=max_invariants)
    np.testing.assert_array_equal(found.volume_beyond, [0, 0, 1])
    np.testing.assert_array_equal(found.energy_beyond, [0, 0, 1])


@pytest.mark.finite_elements
def test_forces_grow_with_the_modulus_and_with_the_square_of_all_lengths():
    one = bar_force("yeoh", [1e-3, 2e-3, 1e-3], [0.5, 1.0], fineness=0.5)
    stiff = bar_force("yeoh", [3e-3, 6e-3, 3e-3], [0.5, 1.0], fineness=0.5)
    large = bar_force("yeoh", [1e-3, 2e-3, 1e-3], [1.0, 2.0], bar_length=20.0, bar_radius=5.0, fineness=0.5)
    np.testing.assert_allclose(stiff, 3 * one, rtol=1e-7)
    np.testing.assert_allclose(large, 4 * one, rtol=1e-7)


def test_forces_do_not_depend_on_the_steps_on_the_way():
    every = indentation_force("neo-hookean", [MODULUS / 2], [0.1, 0.2, 0.3], fineness=0.5)
    last = indentation_force("neo-hookean", [MODULUS / 2], [0.3], fineness=0.5)
    assert every[-1] == pytest.approx(last[0], rel=1e-7)


@pytest.mark.finite_elements
def test_a_clamped_bar_necks_in_and_is_stiffer_than_one_whose_ends_slide():
    bar = ClampedBar()
    found = respond(bar, NEO_HOOKEAN, [MODULUS / 2], steps=2)
    sliding = engineering_stress(NEO_HOOKEAN, loading_mode("uniaxial"), [1.1], [MODULUS / 2])[0] * np.pi * 2.5**2
    assert 1.02 * sliding < found.force[-1] < 1.4 * sliding
    points, moved = bar.mesh().points, found.fields.displacement
    rim = np.isclose(points[:, 1], 2.5)
    assert moved[rim & np.isclose(points[:, 0], 5.0), 1] == pytest.approx(0.0, abs=1e-12)
    assert (moved[rim & (points[:, 0] < 4.0), 1] < -0.03).all()


@pytest.mark.finite_elements
def test_a_finer_bar_changes_the_force_by_little():
    coarse, fine = (bar_force("neo-hookean", [1e-3], [1.0], fineness=fineness)[0] for fineness in (1.0, 2.0))
    assert 0 < coarse / fine - 1 < 1e-3


@pytest.mark.finite_elements
def test_what_ends_early_says_where_and_why():
    coarse = {"fineness": 0.4, "height": 1.0}
    found = respond(Indentation(depth=0.99, **coarse), NEO_HOOKEAN, [1e-3], steps=4)
    assert found.problem
    assert 0 < found.reached < 0.99
    done = found.travel <= found.reached
    assert np.isfinite(found.force[done]).all()
    assert np.isnan(found.force[~done]).all()
    with pytest.raises(ConvergenceError, match=r"ended at a depth of 0\.\d+ mm"):
        case_forces(Indentation(depth=0.99, **coarse), "neo-hookean", [1e-3], found.travel)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Indentation(depth=-1.0), "depth must be a positive number"),
        (lambda: Indentation(depth=6.0), "less than the height"),
        (lambda: Indentation(depth=5.0), "less than the height"),
        (lambda: Indentation(punch_radius=8.0), "less than the radius"),
        (lambda: Indentation(punch_radius=7.5), "less than the radius"),
        (lambda: Indentation(contact="glued"), "bonded or frictionless"),
        (lambda: indentation_force("neo-hookean", [1e-3], [0.2, 0.1]), "larger than the one before"),
    ],
)
def test_sizes_that_are_not_possible_are_refused(make, words):
    with pytest.raises(InputError, match=words):
        make()


@pytest.mark.parametrize("values", [[3e-4, -8e-4], [3e-4, -3e-4]])
def test_a_material_without_initial_stiffness_has_no_force(values):
    with pytest.raises(ModelError, match="has an initial shear modulus of"):
        respond(ClampedBar(fineness=0.5), material_named("mooney-rivlin"), values, steps=1)


def test_the_cases_are_known_by_name():
    assert {"indentation": Indentation, "bar": ClampedBar}.items() <= cases().items()


def test_a_graded_mesh_fills_its_length():
    places = graded(7.5, 0.1, 1.3)
    steps = np.diff(places)
    assert (places[0], places[-1]) == (0, 7.5)
    assert steps[0] <= 0.1
    np.testing.assert_allclose(steps[1:] / steps[:-1], 1.3)
