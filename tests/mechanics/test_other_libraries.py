"""The same laws in another library."""

from __future__ import annotations

import numpy as np
import pytest

from loading import MEASURED
from tissuq.mechanics import engineering_stress, material_named

felupe = pytest.importorskip("felupe", reason="FElupe is not installed")

LIMIT = 40.0
"""Of I1 - 3: at these points it is at most 15.02."""
PAIRS = [  # a name and values here, a function and its arguments there, and how near it comes
    ("neo-hookean", [0.7], "neo_hooke", {"mu": 1.4}, 1e-10),
    ("mooney-rivlin", [0.7, 0.2], "mooney_rivlin", {"C10": 0.7, "C01": 0.2}, 1e-10),
    ("yeoh", [0.7, -0.1, 0.02], "yeoh", {"C10": 0.7, "C20": -0.1, "C30": 0.02}, 1e-10),
    (
        "rivlin:C10,C01,C11,C20,C30", [0.7, 0.2, 0.03, -0.1, 0.02],
        "third_order_deformation", {"C10": 0.7, "C01": 0.2, "C11": 0.03, "C20": -0.1, "C30": 0.02}, 1e-10,
    ),
    ("ogden-2", [0.7, 0.2, 3.1, -2.3], "ogden", {"mu": [0.7, 0.2], "alpha": [3.1, -2.3]}, 2e-5),  # shifts equal roots
    (
        "extended-tube", [0.7, 0.2, LIMIT, 0.4],
        "extended_tube", {"Gc": 0.7, "Ge": 0.2, "delta": LIMIT**-0.5, "beta": 0.4}, 1e-6,
    ),
    (
        "van-der-waals", [0.7, 0.7 * 0.3, LIMIT],
        "van_der_waals", {"mu": 0.7, "limit": (LIMIT + 3) ** 0.5, "a": 0.3, "beta": 0.0}, 2e-3,  # it adds 1e-4 to I1
    ),
]  # fmt: skip


@pytest.mark.parametrize("measured", MEASURED, ids=str)
@pytest.mark.parametrize(("name", "values", "function", "arguments", "near"), PAIRS, ids=[pair[0] for pair in PAIRS])
def test_felupe_has_the_same_stress(measured, name, values, function, arguments, near):
    law = felupe.Hyperelastic(getattr(felupe, function), **arguments)
    F = np.stack([measured.gradient(point) for point in measured.points], axis=-1)
    P = law.gradient([F[..., None], None])[0][..., 0]
    row, column = measured.component
    inverse = np.linalg.inv(np.moveaxis(F, -1, 0))[:, column, row]
    expected = P[row, column] - P[2, 2] * F[2, 2] * inverse  # the free face gives the pressure
    found = engineering_stress(material_named(name), measured.path, measured.points, values)
    rounding = 1e-14 * np.abs(P).max()  # the normal stress of simple shear is zero for laws of I1
    np.testing.assert_allclose(found, expected, rtol=near, atol=near * np.abs(expected).max() + rounding)
