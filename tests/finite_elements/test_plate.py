"""A plate with a hole: its volume, the closed form without a hole, and a finer mesh."""

from __future__ import annotations

import numpy as np
import pytest

from tissuq.errors import InputError
from tissuq.experiments.modes import loading_mode
from tissuq.finite_elements import PlateWithHole, respond, simulate
from tissuq.finite_elements.solver import Solver
from tissuq.mechanics import engineering_stress, material_named

pytest.importorskip("felupe", reason="FElupe is not installed")

YEOH, VALUES = material_named("yeoh"), [1e-3, 2e-3, 1e-3]


@pytest.mark.parametrize("fineness", [0.25, 0.3, 1.0])
def test_the_volume_is_half_of_the_square_without_the_polygon_of_the_hole(fineness):
    case = PlateWithHole(width=12.0, thickness=3.0, hole_radius=2.0, fineness=fineness)
    volumes = Solver(case, YEOH, VALUES, 100.0)._volumes
    assert volumes.min() > 0
    rim = np.linalg.norm(case.mesh().points[:, :2], axis=1) < 2.0 + 1e-9
    sides = len(np.unique(case.mesh().points[rim, :2].round(9), axis=0)) - 1
    polygon = 4 * sides * 2.0**2 * np.sin(np.pi / 2 / sides) / 2
    assert volumes.sum() == pytest.approx(3.0 * (12.0**2 - polygon) / 2, rel=1e-12)


def test_around_a_tiny_hole_the_plate_is_a_strip_in_tension():
    case = PlateWithHole(elongation=3.0, width=10.0, thickness=1.5, hole_radius=0.05, fineness=0.25)
    found = respond(case, YEOH, VALUES, steps=2, bulk_ratio=1e4)
    stretch = 1 + found.travel / 10.0
    expected = engineering_stress(YEOH, loading_mode("uniaxial"), stretch, [VALUES]) * 10.0 * 1.5
    np.testing.assert_allclose(found.force, np.ravel(expected), rtol=1e-3)
    assert np.median(found.fields.largest) == pytest.approx(1.3, rel=2e-3)


@pytest.mark.finite_elements
def test_the_force_for_cells_without_size_is_that_of_a_finer_mesh(posterior):
    """Its error is less than a tenth of what the mesh of the draws has."""
    found = simulate(posterior, PlateWithHole(elongation=1.0, fineness=0.5), draws=2, steps=1)
    fine = simulate(posterior, PlateWithHole(elongation=1.0, fineness=1.5), draws=2, steps=1, check_mesh=False)
    truth, (row,) = fine.forces["complete"].mean(), found.table().to_dict("records")
    ninth = (row["mean"] - truth) / 9  # left on a mesh three times as fine
    assert abs(row["mesh_free_mean"] - (truth - ninth)) < 0.1 * (row["mean"] - truth)


def test_a_hole_is_smaller_than_the_plate():
    with pytest.raises(InputError, match=r"hole \(radius 5 mm\) must be smaller than the plate \(width 10 mm\)"):
        PlateWithHole(width=10.0, hole_radius=5.0)
