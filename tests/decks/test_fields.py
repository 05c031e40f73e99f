"""Fields at the end of a run: the invariants of known deformations, against what was measured."""

from __future__ import annotations

import numpy as np
import pytest

from tissuq.decks.calculix_results import Frd
from tissuq.decks.fields import FinalFields, element_invariants, final_fields, share_beyond

DEFORMATIONS = {
    "uniaxial": (np.diag([1.3, 1.3**-0.5, 1.3**-0.5]), 1.3**2 + 2 / 1.3 - 3, 2 * 1.3 + 1.3**-2 - 3),
    "simple shear": (np.array([[1, 0.4, 0], [0, 1, 0], [0, 0, 1.0]]), 0.16, 0.16),
    "swollen": (1.2 * np.diag([1.1, 1 / 1.1, 1.0]), 1.1**2 + 1.1**-2 - 2, 1.1**2 + 1.1**-2 - 2),
}
"""F, and I1 - 3 and I2 - 3 of F / J^(1/3) in closed form."""
NAMES = {"EXX": (0, 0), "EYY": (1, 1), "EZZ": (2, 2), "EXY": (0, 1), "EYZ": (1, 2), "EZX": (2, 0)}


def two_elements(*steps):
    """Two tetrahedra with a node each of their own, of TISSUE and of FAT; F of both at every step."""
    strains = []
    for time, (first, second) in enumerate(steps, start=1):
        strain = np.array([0.5 * (F.T @ F - np.eye(3)) for F in (*[first] * 4, *[second] * 4)])
        strains.append((float(time), {name: strain[:, row, column] for name, (row, column) in NAMES.items()}))
    cells = {3: (np.arange(8).reshape(2, 4), np.array([1, 2]))}
    zeros = [(float(time), dict.fromkeys(("D1", "D2", "D3"), np.zeros(8))) for time in range(1, len(steps) + 1)]
    fields = {"TOSTRAIN": strains, "DISP": zeros}
    return Frd(np.arange(1, 9), np.zeros((8, 3)), cells, {1: "Tissue", 2: "Fat"}, fields)


@pytest.mark.parametrize("name", DEFORMATIONS)
def test_the_invariants_are_those_of_the_deformation_at_constant_volume(name):
    F, first, second = DEFORMATIONS[name]
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    found = element_invariants(two_elements((F, F @ turn)), 0)
    np.testing.assert_allclose(found, [[first, second]] * 2, atol=1e-12)


def test_the_share_beyond_is_that_of_the_material_that_was_measured():
    small, large = np.diag([1.1, 1.1**-0.5, 1.1**-0.5]), DEFORMATIONS["uniaxial"][0]
    frd = two_elements((small, large), (large, large))
    shares = share_beyond(frd, {"TISSUE": (0.1, 0.1)})
    assert (shares.times.tolist(), shares.values.tolist()) == ([1.0, 2.0], [0.0, 1.0])
    assert share_beyond(frd, {"TISSUE": (0.1, 0.1), "FAT": (0.1, 0.1)}).values.tolist() == [0.5, 1.0]
    assert share_beyond(frd, {"TISSUE": (9.0, 0.1)}).values.tolist() == [0.0, 1.0]
    assert share_beyond(frd, {"MUSCLE": (0.1, 0.1)}) is None


def test_what_is_saved_is_loaded(tmp_path):
    fields = final_fields(two_elements((np.eye(3), np.eye(3))))
    fields.save(tmp_path / "fields.npz")
    loaded = FinalFields.load(tmp_path / "fields.npz")
    assert loaded.materials.tolist() == ["TISSUE", "FAT"]
    np.testing.assert_array_equal(loaded.cells[3], fields.cells[3])
    np.testing.assert_array_equal(loaded.invariants, fields.invariants)
    assert len(loaded.von_mises) == 0
