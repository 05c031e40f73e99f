"""CalculiX itself reads the cards and computes tissuq's stresses, on one element and at finite compressibility."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

import tissuq as tq
from card_readers import READERS
from one_element import CCX, FREE, SHEAR, calculix, reference
from tissuq.export import CardSettings, card_format

pytestmark = pytest.mark.skipif(CCX is None, reason="CalculiX (ccx) is not installed: make system")

LOADS = [(1.3, FREE, FREE), (0.8, FREE, FREE), (1.2, 1.2, FREE), (1.25, 1.0, FREE), (1.3, 0.9, FREE), (SHEAR, 0.4)]
NAMES = "uniaxial tension, uniaxial compression, equibiaxial, planar, biaxial, simple shear"
LAWS = {
    "NEO HOOKE": ("neo-hookean", [0.5]),
    "MOONEY-RIVLIN": ("mooney-rivlin", [0.3, 0.2]),
    "YEOH": ("yeoh", [0.5, -0.05, 0.03]),
    "REDUCED POLYNOMIAL, N=2": ("rivlin:C10,C20", [0.5, 0.1]),
    "POLYNOMIAL, N=2": ("rivlin:C10,C01,C11", [0.3, 0.2, 0.1]),
    "POLYNOMIAL, N=3": ("rivlin:C10,C01,C12,C21,C03", [0.3, 0.2, 0.1, 0.05, 0.02]),
    "OGDEN, N=1": ("ogden-1", [0.9, -8.0]),
    "OGDEN, N=2": ("ogden-2", [0.9, 0.2, 3.0, -4.0]),
    "OGDEN, N=3": ("ogden-3", [0.4, 0.02, 0.1, 1.3, 5.0, -2.0]),
}
QUICK = [("YEOH", 20.0), ("POLYNOMIAL, N=2", 1000.0), ("OGDEN, N=2", 1000.0)]
"""Laws and bulk moduli over the initial shear modulus in the quick tests."""
AGREEMENT = 1e-5


@pytest.mark.parametrize(
    ("keyword", "stiffness"),
    [
        (keyword, stiffness)
        if (keyword, stiffness) in QUICK
        else pytest.param(keyword, stiffness, marks=pytest.mark.finite_elements)
        for keyword, stiffness in product(LAWS, [20.0, 1000.0])
    ],
)
def test_calculix_computes_the_stress_of_the_draw(given, tmp_path, keyword, stiffness):
    ensemble = given([LAWS[keyword]])
    bulk = stiffness * card_format("calculix").cards(ensemble, CardSettings()).index[0]["initial_shear_modulus"]
    cards = card_format("calculix").cards(ensemble, CardSettings(bulk_modulus=bulk))
    (text,) = cards.files.values()
    assert f"*HYPERELASTIC, {keyword}\n" in text
    wanted = [reference(ensemble[0].energy, bulk, load) for load in LOADS]
    assert calculix(text, LOADS, tmp_path) == pytest.approx(wanted, rel=AGREEMENT), NAMES


@pytest.mark.slow
@pytest.mark.parametrize("unit", [pytest.param("MPa", marks=pytest.mark.finite_elements), "kPa"])
def test_calculix_computes_the_stress_of_a_free_energy_to_the_error_that_is_stated(auto, tmp_path, unit):
    cards = card_format("calculix").cards(auto, CardSettings(unit=unit))
    factor = {"MPa": 1.0, "kPa": 1e3}[unit]
    for draw, text, row in zip(auto, cards.files.values(), cards.index, strict=True):
        found = calculix(text, LOADS, tmp_path)
        projected = [reference(READERS["calculix"](text).energy, row["bulk_modulus"], load) for load in LOADS]
        assert found == pytest.approx(projected, rel=AGREEMENT), NAMES
        own = [factor * reference(draw.energy, row["bulk_modulus"] / factor, load) for load in LOADS]
        assert np.abs(np.array(found) / own - 1).max() < 1.5 * row["error_states_max"] + 1e-3


@pytest.mark.finite_elements
def test_calculix_follows_to_the_ends_of_what_was_measured(tmp_path):
    """Rubber to a stretch of 7.5, nearly incompressible."""
    draws = tq.fit(tq.datasets.load("rubber-treloar-uniaxial")).ensemble(2)
    end = {mode: high for mode, (_, high) in draws.ranges.items()}
    assert end["uniaxial"] > 7
    loads = [(end["uniaxial"], FREE, FREE), (end["equibiaxial"], end["equibiaxial"], FREE), (end["planar"], 1.0, FREE)]
    cards = card_format("calculix").cards(draws, CardSettings())
    for text, row in zip(cards.files.values(), cards.index, strict=True):
        wanted = [reference(READERS["calculix"](text).energy, row["bulk_modulus"], load) for load in loads]
        assert calculix(text, loads, tmp_path) == pytest.approx(wanted, rel=AGREEMENT)


def test_calculix_would_have_replaced_a_second_d_of_zero(given, tmp_path):
    """Why CalculiX's cards are not Abaqus's: the pressure of a confined Yeoh cube has the term that it adds."""
    ensemble, squeezed = given([LAWS["YEOH"]]), [(0.7, 1.0, 1.0), LOADS[0]]
    settings = CardSettings(bulk_modulus=5.0)
    stress = {}
    for code in ("abaqus", "calculix"):
        (text,) = card_format(code).cards(ensemble, settings).files.values()
        stress[code], _ = calculix(text, squeezed, tmp_path)
    wanted = reference(ensemble[0].energy, 5.0, squeezed[0])
    assert stress["calculix"] == pytest.approx(wanted, rel=AGREEMENT)
    assert abs(stress["abaqus"] / wanted - 1) > 0.1
