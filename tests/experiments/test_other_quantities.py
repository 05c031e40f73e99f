"""Columns of other quantities that have the units of stresses, forces and strains are asked about, and never taken."""

from __future__ import annotations

import re
import shlex
import warnings

import numpy as np
import pytest

import tissuq as tq
from machine_files import neo_hookean, ramp
from tissuq.errors import InputError
from written_files import check_curve, written

L = ramp()
P = 1e3 * neo_hookean(L)  # kPa


def proposed(message):
    """Return what the first ``--column ROLE=NAME`` in a message gives, as a shell takes it apart."""
    option = shlex.split(message[message.index("--column") :])[1]
    return dict([option.rstrip(".").split("=", 1)])


@pytest.mark.parametrize(
    ("name", "what"),
    [
        ("Hardness", "hardness"),
        ("Stiffness", "stiffness"),
        ("Tangent Strength", "strength"),
        ("E", "modulus"),
        ("Yield stress", "yield"),
        ("Flexural stress", "bending"),
        ("Biegespannung", "bending"),
        ("Indentation stress", "indentation"),
        ("von Mises stress", "von Mises"),
        ("Stress amplitude", "amplitude"),
        ("Stress offset", "offset"),
        ("dStress/dStrain", "derivative"),
        ("log10 stress", "logarithm"),
        ("G*", "modulus"),
        ("Predicted stress", "model"),
        ("Stress difference", "difference"),
        ("Failure stress", "failure"),
    ],
)
def test_what_is_no_stress_is_read_as_one_only_where_one_says_so(tmp_path, name, what):
    path = written(tmp_path, f"Strain (%),{name} (kPa)", 100 * (L - 1), P)
    with pytest.raises(InputError, match=re.escape(what)) as refusal:
        tq.read(path)
    columns = proposed(str(refusal.value))
    assert columns == {"stress": f"{name} (kPa)"}
    test = tq.read(path, columns=columns, stress_type="engineering")
    np.testing.assert_allclose(test.stress, 1e-3 * P, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "what"),
    [
        ("Progress", "progress"),
        ("RH", "humidity"),
        ("Humidity", "humidity"),
        ("Porosity", "porosity"),
        ("Swelling", "swelling"),
        ("Volumetric strain", "volume"),
        ("Lateral strain", "another direction"),
        ("Transverse strain", "another direction"),
        ("Residual strain", "remains"),
        ("Area reduction", "area"),
        ("Flexural strain", "bending"),
        ("Plastic strain", "remains"),
        ("Mineral density", "concentration"),
        ("Poisson ratio", "another direction"),
    ],
)
def test_what_is_no_strain_is_read_as_one_only_where_one_says_so(tmp_path, name, what):
    path = written(tmp_path, f"{name} (%),Stress (kPa)", 100 * (L - 1), P)
    with pytest.raises(InputError, match=what) as refusal:
        tq.read(path)
    columns = proposed(str(refusal.value))
    assert columns == {"strain": f"{name} (%)"}
    np.testing.assert_allclose(tq.read(path, columns=columns).stretch, L, rtol=1e-6)


@pytest.mark.parametrize("name", ["Crack length (mm)", "Peel extension (mm)"])
def test_lengths_that_are_no_displacement_are_refused(tmp_path, name):
    path = written(tmp_path, f"{name},Load (N)", 10 * (L - 1), P)
    with pytest.raises(InputError, match=r"is of a crack|is of peeling"):
        tq.read(path, length="10 mm", area="1 mm2")


@pytest.mark.parametrize("name", ["Peel force (N)", "Friction force (N)", "Pull-out force (N)"])
def test_forces_of_other_tests_are_refused(tmp_path, name):
    path = written(tmp_path, f"Displacement (mm),{name}", 10 * (L - 1), P)
    with pytest.raises(InputError, match=r"is of (peeling|friction|pulling out)"):
        tq.read(path, length="10 mm", area="1 mm2")


def test_other_quantities_beside_those_of_the_test_do_not_matter(tmp_path):
    head = "RH (%),Lateral strain (%),Axial strain (%),Tangent stiffness (kPa),Stress (kPa)"
    path = written(tmp_path, head, 50 + L, -50 * (L - 1), 100 * (L - 1), P / L, P)
    test = tq.read(path)
    check_curve(test, L, 1e-3 * P, rtol=1e-6, stress_atol=1e-9)


def test_a_column_that_only_its_unit_tells_is_named_first_with_how_to_say_another(tmp_path):
    path = written(tmp_path, "Foo (%),Bar (kPa)", 100 * (L - 1), P)
    with pytest.warns(UserWarning, match="check the column") as warned:
        tq.read(path)
    columns = {"strain": "Foo (%)", "stress": "Bar (kPa)"}
    for warning, (role, name) in zip(warned, columns.items(), strict=True):
        assert f'{role}="{name}"' in str(warning.message)
    assert [proposed(text.replace(";", " ")) for text in tq.inspect(path).warnings] == [
        {role: name} for role, name in columns.items()
    ]
    assert str(tq.inspect(path)).startswith("ATTENTION check the column: 'Foo (%)'")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        test = tq.read(path, columns=columns)
    np.testing.assert_allclose(test.stretch, L, rtol=1e-6)


@pytest.mark.parametrize(
    "name",
    ["Stress x 10^-3", "Stress × 10⁻³", "stress*10^3", "Stress x10-3", "Stress x 1e-3", "10^-3 Stress", "Stress / 10³"],
)
def test_a_power_of_ten_in_a_name_is_asked_about(tmp_path, name):
    """It may be of the unit or of the numbers: a thousand times as much either way."""
    path = tmp_path / "test.csv"
    path.write_text(f"stretch,{name} (MPa)\n" + "".join(f"{1 + k / 10},{k}\n" for k in range(6)), encoding="utf-8")
    with pytest.raises(tq.InputError, match="a multiple by a power of ten, which belongs into its unit"):
        tq.read(path)
    path.write_text(path.read_text(encoding="utf-8").replace(f"{name} (MPa)", "Stress (10^-3 MPa)"), encoding="utf-8")
    assert tq.read(path).stress[-1] == pytest.approx(5e-3)
