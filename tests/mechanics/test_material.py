"""What a class must write to be a material, and where it is then found."""

from __future__ import annotations

import pytest

import tissuq as tq
from tissuq.experiments.modes import Uniaxial
from tissuq.mechanics import Material, StretchMaterial


def test_without_an_energy_a_material_is_abstract():
    for base in (Material, StretchMaterial):
        kind = type("Nothing", (base,), {"name": "nothing"})
        assert "nothing" not in tq.materials()
        with pytest.raises(TypeError, match="abstract"):
            kind()


def of_invariants():
    class OfInvariants(Material):
        """W = C (I1 - 3), written as users do."""

        name = "of-invariants"
        formula = "C (I1 - 3)"
        source = "this test"
        parameters = (tq.Parameter("C", "half the initial shear modulus"),)

        def strain_energy(self, I1, I2, values):
            return values[0] * (I1 - 3)

    return OfInvariants()


def of_stretches():
    class OfStretches(StretchMaterial):
        """The same in principal stretches."""

        name = "of-stretches"
        formula = "C (l1^2 + l2^2 + l3^2 - 3)"
        source = "this test"
        parameters = (tq.Parameter("C", "half the initial shear modulus"),)

        def energy(self, stretches, values):
            return values[0] * (sum(stretch**2 for stretch in stretches) - 3)

    return OfStretches()


@pytest.mark.parametrize("make", [of_invariants, of_stretches])
def test_one_energy_is_all_that_a_material_writes(make):
    material = make()
    assert tq.materials()[material.name] is type(material)
    stress = tq.engineering_stress(material, Uniaxial(), [0.5, 2.0], [1.5])
    assert stress == pytest.approx([3 * (0.5 - 4), 3 * (2 - 0.25)], rel=1e-14)
    assert tq.initial_shear_modulus(material, [1.5]) == pytest.approx(3.0, rel=1e-14)
    assert material.strain_energy(5.0, 4.0, [1.5]) == pytest.approx(3.0, rel=1e-14)
