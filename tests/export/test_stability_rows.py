"""The inequalities of stability: stiffness of Ogden terms in closed form, and what breaks them."""

from __future__ import annotations

import numpy as np

from tissuq.export.stability_rows import LODE_ANGLES, MIN_SLOPE, MIN_TANGENT, StabilityRows, StabilityStates
from tissuq.mechanics.laws import Ogden, Rivlin

MOST = (0.5, 0.6)
WANTED = np.full(len(StabilityStates(MOST).logs), 2 * MIN_TANGENT)
AXES = np.array([[1.0, 0.0, -1.0], [-1.0, 2.0, -1.0]]) / np.sqrt([[2.0], [6.0]])


def log_strains(most):
    """Logarithmic strains along the Lode angles up to where an invariant is the largest."""
    logs = []
    for angle in np.radians(LODE_ANGLES):
        direction = np.cos(angle - 2 * np.pi / 3 * np.array([0.0, 1.0, -1.0]))
        sizes = np.linspace(0, 2, 200001)
        first, second = (np.exp(sign * 2 * np.outer(sizes, direction)).sum(axis=1) - 3 for sign in (1, -1))
        end = sizes[np.flatnonzero((first <= most[0]) & (second <= most[1]))[-1]]
        logs.append(np.outer(end * np.sin(np.linspace(0, np.pi / 2, 31)[1:]), direction))
    return logs


def test_the_stiffness_is_that_of_ogdens_closed_form():
    """W = sum of 2 mu / alpha^2 exp(alpha e_i): its Hessian along two strains is 2 mu sum of u_i v_i exp(alpha e_i)."""
    rows = StabilityRows.of(Ogden(2), (3.0, -4.0), StabilityStates(MOST))
    logs = np.concatenate(log_strains(MOST))
    for column, alpha in enumerate((3.0, -4.0)):
        weights = 2 * np.exp(alpha * logs)
        wanted = np.stack([weights @ (u * v) for u, v in ((AXES[0], AXES[0]), (AXES[1], AXES[1]), (AXES[0], AXES[1]))])
        np.testing.assert_allclose(rows.tangents[:, :, column], wanted, rtol=1e-4, atol=1e-5)


def test_the_slopes_are_those_of_engineering_stresses():
    """Neo-Hookean: 2 C10 (l - l^-2) rises by 2 C10 (1 + 2 l^-3), which is 4 C10 or more below one, 2 C10 above."""
    rows = StabilityRows.of(Rivlin(("C10",)), (), StabilityStates(MOST))
    uniaxial = rows.slopes[:80, 0]
    assert uniaxial[:40].min() > 6
    assert 2 < uniaxial[40:].min() < uniaxial[40:].max() < 6


def test_a_convex_energy_breaks_nothing_and_a_negative_term_does():
    rows = StabilityRows.of(Rivlin(("C10", "C20")), (), StabilityStates(MOST))
    assert not len(rows.broken(np.array([0.5, 0.1]), 1.0, WANTED)[0])
    broken, bounds = rows.broken(np.array([0.5, -0.6]), 1.0, WANTED)
    assert len(broken)
    assert (broken @ [0.5, -0.6] < bounds).all()
    assert set(bounds) == {2 * MIN_TANGENT, MIN_SLOPE}
    # Uniaxial stress of it is 2 (l - l^-2)(C10 + 2 C20 (I1 - 3)), which has fallen to zero at I1 - 3 = 0.417.
    assert (rows.slopes @ [0.5, -0.6]).min() < 0


def test_what_is_asked_for_along_the_weakest_direction_is_the_smallest_eigenvalue():
    rows = StabilityRows.of(Rivlin(("C10", "C01", "C20")), (), StabilityStates(MOST))
    values = np.array([0.6, -0.1, -0.8])
    broken, _ = rows.broken(values, 1.0, WANTED)
    along_1, along_2, mixed = rows.tangents @ values
    matrices = np.moveaxis(np.array([[along_1, mixed], [mixed, along_2]]), -1, 0)
    smallest = np.linalg.eigvalsh(matrices)[:, 0]
    smallest = smallest[smallest < 2 * MIN_TANGENT]
    assert len(smallest) > 3
    np.testing.assert_allclose((broken @ values)[: len(smallest)], smallest, atol=1e-9)
