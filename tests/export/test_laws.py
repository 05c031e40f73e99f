"""Sums of materials as one law."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from tissuq.export.laws import exact_law

UNIAXIAL = tq.loading_modes()["uniaxial"]()


@pytest.mark.parametrize(
    ("parts", "name", "values"),
    [
        ([("neo-hookean", [0.5])], "rivlin:C10", [0.5]),
        ([("neo-hookean", [0.5]), ("yeoh", [0.0, 0.1, 0.2])], "rivlin:C10,C20,C30", [0.5, 0.1, 0.2]),
        ([("yeoh", [0.5, 0.1, 0.2]), ("mooney-rivlin", [0.0, 0.3])], "rivlin:C10,C01,C20,C30", [0.5, 0.3, 0.1, 0.2]),
        ([("rivlin:C11,C10,C01", [0.3, 0.1, 0.2])], "rivlin:C10,C01,C11", [0.1, 0.2, 0.3]),
        ([("ogden-1", [0.9, 3.0]), ("ogden-2", [0.2, 0.1, 2.0, -4.0])], "ogden-3", [0.9, 0.2, 0.1, 3.0, 2.0, -4.0]),
        ([("ogden-1+rivlin:C01", [0.9, -7.0, 0.2])], "ogden-2", [0.9, 0.4, -7.0, -2.0]),
        ([("gent", [0.9, 20.0])], "gent", [0.9, 20.0]),
    ],
)
def test_sums_are_one_law(given, parts, name, values):
    ensemble = given(parts)
    law = exact_law(ensemble)
    assert law.material.name == name
    assert law.values == pytest.approx(np.array([values]))
    assert law.ensemble(ensemble).stress(UNIAXIAL, np.array([0.8, 1.3])) == pytest.approx(
        ensemble.stress(UNIAXIAL, np.array([0.8, 1.3]))
    )


@pytest.mark.parametrize("name", ["gent+mooney-rivlin", "ogden-1+yeoh", "hencky+neo-hookean"])
def test_sums_of_different_kinds_are_none(given, name):
    count = len(tq.mechanics.material_named(name).parameters)
    assert exact_law(given([(name, np.linspace(0.5, 20, count))])) is None


def test_a_free_energy_is_none(auto):
    assert exact_law(auto) is None
    assert exact_law(auto.alone).material.name == "rivlin:C10"


def test_the_terms_of_a_discrepancy_are_part_of_the_law(data):
    for name, terms in (("yeoh", "C10,C20,C30"), ("mooney-rivlin", "C10,C01")):
        draws = tq.fit(data, discrepancy=name, noise_sd=0.02).ensemble(3, admissible=False)
        law = exact_law(draws)
        assert law.material.name == f"rivlin:{terms}"
        assert law.ensemble(draws).stress(UNIAXIAL, np.array([1.5])) == pytest.approx(
            draws.stress(UNIAXIAL, np.array([1.5]))
        )


def test_a_unit_scales_what_is_a_stress(given):
    law = exact_law(given([("ogden-1", [0.9, -7.0])])).scaled(1000.0)
    assert law.values.tolist() == [[900.0, -7.0]]
