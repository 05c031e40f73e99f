"""Tables of a population and of laws in the unit of the measurements, against the same fits in MPa."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq

STRETCH = [0.8, 0.9, 1.1, 1.2, 1.3]
MODULI = [0.4, 0.5, 0.6, 0.45, 0.55]
"""As many as specimens in other tests, so that the sampler is compiled once."""


def specimens(unit, moduli=MODULI):
    return {
        f"s{place}": tq.simulate(
            "yeoh", {"C10": c, "C20": 0.2, "C30": 0.0}, STRETCH, noise_sd=0.01, seed=place
        ).labelled(stress_unit=unit)
        for place, c in enumerate(moduli)
    }


def population_in(unit):
    options = {"material": "yeoh", "parameters": ("C10", "C20"), "discrepancy": "none", "noise_sd": 0.01}
    return tq.fit_population(specimens(unit), **options)


@pytest.fixture(scope="module")
def in_mpa():
    return population_in("MPa")


@pytest.fixture(scope="module", params=["kPa", "Pa"])
def both(request, in_mpa):
    return request.param, in_mpa, population_in(request.param)


@pytest.mark.slow
def test_tables_of_a_population_are_in_the_unit_of_the_data(both):
    unit, in_mpa, found = both
    factor = {"kPa": 1e3, "Pa": 1e6}[unit]
    for method in ("summary", "specimen_summary"):
        plain, table = getattr(in_mpa, method)(), getattr(found, method)()
        is_log = plain.index.isin([("C10", "spread")])
        expected = plain.to_numpy() * np.where(is_log, 1.0, factor)[:, None]
        np.testing.assert_allclose(table.to_numpy(), expected, rtol=1e-10)
        assert (plain.columns.name, table.columns.name) == ("stresses in MPa", f"stresses in {unit}")
        np.testing.assert_allclose(getattr(found, method)(unit="MPa").to_numpy(), plain.to_numpy(), rtol=1e-10)
    band, plain = found.new_patient([1.1, 1.2]), in_mpa.new_patient([1.1, 1.2])
    np.testing.assert_allclose(band["low"], factor * plain["low"], rtol=1e-10)
    assert band["stretch"].tolist() == [1.1, 1.2]


def test_specimens_in_different_units_are_summed_up_in_mpa():
    mixed = specimens("kPa") | {"other": specimens("Pa", [0.65])["s0"].labelled(name="other")}
    found = tq.fit_population(mixed, material="neo-hookean", discrepancy="none", noise_sd=0.01)
    assert found.summary().columns.name == "stresses in MPa"


def test_the_moduli_of_laws_are_in_the_unit_of_the_data():
    data, laws = specimens("kPa")["s1"], ["neo-hookean", "mooney-rivlin"]
    found = tq.fit_laws(data, laws, discrepancy="none", noise_sd=0.01)
    modulus = found.fits["neo-hookean"].summary(unit="kPa").loc["C10", "median"] * 2
    assert found.table.loc["neo-hookean", "modulus"] == pytest.approx(modulus, rel=1e-6)
    assert found.table.columns.name == "stresses in kPa"
    moduli = ["modulus", "modulus_low", "modulus_high"]
    np.testing.assert_allclose(found.table[moduli], 1e3 * found.table_in("MPa")[moduli], rtol=1e-12)
    others = [name for name in found.table if name not in moduli]
    np.testing.assert_array_equal(found.table[others], found.table_in("MPa")[others])
