"""Pressure and diameter of a tube, against thick walls whose pressure is summed in the deformed state."""

from __future__ import annotations

from functools import cache

import numpy as np
import pint
import pytest
from scipy.integrate import quad

import tissuq as tq
from tissuq.errors import InputError
from tissuq.experiments.reading.tube import Tube
from tissuq.experiments.units import PRESSURE, looks_like_unit
from written_files import message, text_file, written

MMHG = 133.322387415e-6  # MPa
INNER, OUTER = 1.25, 1.5  # mm
SIZES = {"diameter": "3 mm", "thickness": "0.25 mm"}
STRETCH = np.linspace(1.0, 1.5, 41)
NAMES = "Pressure (mmHg),Outer diameter (um)"


def neo_hookean(hoop):
    """Return the difference of the principal Cauchy stresses, hoop and radial, of C10 = 20 kPa at axial stretch 1."""
    return 0.04 * (hoop**2 - hoop**-2)


def mooney_rivlin(hoop):
    """Return that of C10 = 20 kPa and C01 = 5 kPa: 2 C10 (l1^2 - l3^2) - 2 C01 (1/l1^2 - 1/l3^2)."""
    return 0.04 * (hoop**2 - hoop**-2) - 0.01 * (hoop**-2 - hoop**2)


def yeoh(hoop):
    """Return 2 (l1^2 - l3^2) dW/dI1 of W = C10 (I1 - 3) + C20 (I1 - 3)^2."""
    return 2 * (hoop**2 - hoop**-2) * (0.02 + 2 * 0.02 * (hoop**2 + hoop**-2 - 2))


def ogden(hoop):
    """Return mu (l1^alpha - l3^alpha) of alpha = 8."""
    return 0.01 * (hoop**8 - hoop**-8)


def demiray(hoop):
    """Return 2 (l1^2 - l3^2) dW/dI1 of W = a/(2 b) (exp(b (I1 - 3)) - 1), b = 2."""
    return 0.02 * (hoop**2 - hoop**-2) * np.exp(2 * (hoop**2 + hoop**-2 - 2))


def fung(hoop):
    """Return l1 dW/dl1 of W = c/2 (exp(a E^2) - 1) with Green's strain E of the hoop, a = 6."""
    strain = (hoop**2 - 1) / 2
    return 0.02 * 6 * strain * np.exp(6 * strain**2) * hoop**2


LAWS = (neo_hookean, mooney_rivlin, yeoh, ogden, demiray, fung)


@cache
def pressures(law, inner, outer):
    """Return the pressures in a wall: the integral of (s_hoop - s_radial)/r over its deformed radii."""
    middle = np.sqrt(inner * outer)

    def pressure(stretch):
        added = middle**2 * (stretch**2 - 1)
        faces = np.sqrt(inner**2 + added), np.sqrt(outer**2 + added)
        return quad(lambda r: law(r / np.sqrt(r**2 - added)) / r, *faces, epsabs=1e-14, epsrel=1e-11)[0]

    return np.array([pressure(stretch) for stretch in STRETCH])


def outer_radius(stretch, inner, outer):
    return np.sqrt(outer**2 + inner * outer * (stretch**2 - 1))


def stress_in_middle(tube, stretch, mean):
    return tube.engineering_stresses(stretch, np.ones(len(stretch)), mean[None])[0]


def wall(ratio):
    """Return the radii of a wall so many times as thick as the radius of its middle, which is 1 mm."""
    outer = (ratio + np.sqrt(ratio**2 + 4)) / 2
    return 1 / outer, outer


def artery(folder, names=NAMES, law=fung, pressure_to=1 / MMHG, diameter_to=1e3, inner=False):
    pressure = pressures(law, INNER, OUTER) * pressure_to
    radius = outer_radius(STRETCH, INNER, OUTER)
    diameter = 2 * (np.sqrt(radius**2 - OUTER**2 + INNER**2) if inner else radius) * diameter_to
    return written(folder, names, pressure, diameter, name="artery.csv")


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("ratio", [0.1, 0.2, 0.4, 0.5])
def test_the_stress_in_the_middle_of_the_wall_is_that_of_the_law(law, ratio):
    """The errors of docs/measures.md, in shares of the largest stress: with the correction, and without it."""
    inner, outer = wall(ratio)
    tube, pressure = Tube(inner, outer), pressures(law, inner, outer)
    stretch = tube.stretch(outer_radius(STRETCH, inner, outer), outer)
    np.testing.assert_allclose(stretch, STRETCH, rtol=1e-12)
    stress = law(STRETCH) / STRETCH
    found = stress_in_middle(tube, stretch, pressure / tube.log_ratio)
    bound, without = {0.1: (0.0003, 0.07), 0.2: (0.001, 0.33), 0.4: (0.0035, 2.4), 0.5: (0.005, 6.6)}[ratio]
    is_exact = law in (neo_hookean, mooney_rivlin)
    np.testing.assert_allclose(found, stress, rtol=0, atol=(1e-8 if is_exact else bound) * stress.max())
    if law is fung:
        assert pressure[-1] / tube.log_ratio * STRETCH[-1] / stress[-1] - 1 == pytest.approx(without, rel=0.05)


@pytest.mark.parametrize("law", LAWS)
def test_without_the_correction_the_error_is_of_second_order_in_the_thickness(law):
    """And it is h^2/6 times the second derivative of S by the logarithm of x, over S, with h = ln(B/A)."""

    def second(x):
        return law(np.sqrt(1 + x)) / (1 + x)

    x, step, errors = 1.0, 1e-3, []
    curvature = (second(x * np.exp(step)) - 2 * second(x) + second(x * np.exp(-step))) / step**2 / second(x)
    for ratio in (0.02, 0.04):
        inner, outer = wall(ratio)
        tube, added = Tube(inner, outer), x * inner * outer
        faces = np.sqrt(inner**2 + added), np.sqrt(outer**2 + added)
        pressure = quad(lambda r: law(r / np.sqrt(r**2 - added)) / r, *faces, epsrel=1e-12)[0]  # noqa: B023
        errors.append(pressure / tube.log_ratio / second(x) - 1)
        assert errors[-1] == pytest.approx(tube.log_ratio**2 / 6 * curvature, rel=0.02)
    assert errors[1] / errors[0] == pytest.approx(4, rel=0.02)


@pytest.mark.parametrize("law", LAWS)
def test_noise_of_the_pressure_is_not_made_much_larger(law):
    """The largest error of 20 curves with noise of half a percent stays below 5 % of the largest stress."""
    inner, outer = wall(0.4)
    tube, random = Tube(inner, outer), np.random.default_rng(1)
    mean, stress = pressures(law, inner, outer) / tube.log_ratio, law(STRETCH) / STRETCH
    for _ in range(20):
        noisy = mean + 0.005 * mean.max() * random.standard_normal(len(mean))
        assert np.abs(stress_in_middle(tube, STRETCH, noisy) - stress).max() < 0.05 * stress.max()


@pytest.mark.parametrize(
    ("names", "to_file", "inner"),
    [
        (NAMES, (1 / MMHG, 1e3), False),
        ("Pressure [kPa],OD (mm)", (1e3, 1.0), False),
        ("Transmural pressure (mm Hg),Diameter (µm)", (1 / MMHG, 1e3), False),
        ("Innendruck [mbar],Außendurchmesser [mm]", (1e4, 1.0), False),
        ("Druck (kPa),Durchmesser (mm)", (1e3, 1.0), False),
        ("Pression (cmH2O),Diamètre externe (mm)", (1e6 / 98.0665, 1.0), False),
        ("presión (Pa),diámetro (um)", (1e6, 1e3), False),
        ("p_lumen (mmHg),outer_diameter (um)", (1 / MMHG, 1e3), False),
        ("Luminal pressure (mmHg),Lumen diameter (um)", (1 / MMHG, 1e3), True),
        ("压力 (kPa),内径 (mm)", (1e3, 1.0), True),
    ],
)
def test_pressure_and_diameter_are_recognised_and_converted(tmp_path, names, to_file, inner):
    data = tq.read(artery(tmp_path, names, fung, *to_file, inner), mode="planar", **SIZES)
    np.testing.assert_allclose(data.stretch, STRETCH, atol=1e-8)
    stress = fung(STRETCH) / STRETCH
    np.testing.assert_allclose(data.stress, stress, rtol=0, atol=0.005 * stress.max())
    assert data.stress_unit == "kPa"
    assert "A = 1.25 mm and B = 1.5 mm (undeformed radii; diameter as given, thickness as given)" in data.source


def test_columns_are_named_in_python(tmp_path):
    file = artery(tmp_path, "q1,q2")
    options = {"pressure": "q1", "outer_diameter": 2, "force_unit": "mmHg", "displacement_unit": "um"}
    data = tq.read(file, mode="planar", **options, **SIZES)
    np.testing.assert_array_equal(data.stress, tq.read(artery(tmp_path), mode="planar", **SIZES).stress)


def test_the_outer_diameter_goes_before_the_inner_one(tmp_path):
    file = artery(tmp_path, law=neo_hookean)
    lines = file.read_text().splitlines()
    radius = np.sqrt(outer_radius(STRETCH, INNER, OUTER) ** 2 - OUTER**2 + INNER**2)
    both = [f"{line},{2e3 * r:.10g}" for line, r in zip(lines[1:], radius, strict=True)]
    file.write_text("\n".join([f"{lines[0]},Inner diameter (um)", *both]))
    by_outer = tq.read(file, mode="planar", **SIZES)
    assert "B^2" in by_outer.source
    by_inner = tq.read(file, mode="planar", inner_diameter=3, pressure=1, **SIZES)
    assert "A^2" in by_inner.source
    np.testing.assert_allclose(by_inner.stretch, by_outer.stretch, atol=1e-8)


def test_the_modulus_of_a_tube_is_found(tmp_path):
    posterior = tq.fit(
        artery(tmp_path, law=neo_hookean),
        mode="planar",
        noise_sd="0.1 kPa",
        discrepancy="none",
        **SIZES,
    )
    assert float(posterior.summary()["mean"].iloc[0]) == pytest.approx(0.02e3, rel=0.02)


@pytest.mark.parametrize("unit", ["mmHg", "cmH2O", "mmH2O", "torr", "mbar", "bar", "atm", "kPa", "psi"])
def test_units_of_pressure_are_those_of_pint(unit):
    assert PRESSURE.factor(unit) == pytest.approx(pint.UnitRegistry().Quantity(1.0, unit).to("MPa").magnitude, rel=1e-6)
    assert looks_like_unit(unit)


def test_what_is_taken_of_the_tube_is_said(tmp_path):
    notes = tq.inspect(artery(tmp_path), mode="planar", **SIZES).warnings
    assert any("taken as held at its undeformed length" in note for note in notes)
    assert not any("as thick as the radius" in note for note in notes)
    thick = tq.inspect(artery(tmp_path), mode="planar", diameter="3 mm", thickness="0.6 mm").warnings
    assert any("as thick as the radius of its middle, beyond the 0.5" in note for note in thick)


@pytest.mark.parametrize("diameter", ["2.9 mm", "3.1 mm"])
def test_a_tube_that_is_not_as_wide_as_said_without_pressure_is_noted(tmp_path, diameter):
    notes = tq.inspect(artery(tmp_path), mode="planar", diameter=diameter, thickness="0.25 mm").warnings
    assert any("in line 2 the tube has hardly any pressure" in note for note in notes)
    assert not any("hardly any" in note for note in tq.inspect(artery(tmp_path), mode="planar", **SIZES).warnings)


@pytest.mark.parametrize(
    ("names", "options", "words"),
    [
        (NAMES, {}, '--mode planar --diameter "3 mm" --thickness "0.5 mm"'),
        (
            NAMES,
            {"mode": "uniaxial", **SIZES},
            "is of a tube under pressure ('Pressure (mmHg)' and 'Outer diameter (um)')",
        ),
        (NAMES, {"mode": "planar"}, "give its undeformed outer diameter and the thickness of its wall"),
        (NAMES, {"mode": "planar", "diameter": "3 mm"}, "thickness of its wall"),
        (
            NAMES,
            {"mode": "planar", "diameter": "3 mm", "thickness": "1.5 mm"},
            "does not fit into an outer diameter of 3",
        ),
        (NAMES, {"mode": "planar", "length": "20 mm", **SIZES}, "which need no length"),
        (NAMES, {"mode": "planar", "diameter": "3.2 mm", "thickness": "0.25 mm"}, "narrower than undeformed"),
        (NAMES, {"mode": "planar", "diameter": "4 cm", "thickness": "0.25 mm"}, "would be closed"),
        (NAMES, {"mode": "planar", "preload": "5 mmHg", **SIZES}, "does not go with the pressure in a tube"),
        (NAMES, {"mode": "planar", "compression_positive": True, **SIZES}, "has no meaning for a pressure"),
        (NAMES, {"mode": "planar", "stress_type": "cauchy", **SIZES}, "read as a pressure, which is no cauchy stress"),
        (NAMES, {"mode": "planar", "zero": "first", **SIZES}, "which is for displacements"),
        (NAMES, {"mode": "planar", "pressure": 1, "stretch": 2, **SIZES}, "which do not go together"),
        (NAMES, {"mode": "simple-shear", "pressure": 1}, "is of a tube under pressure"),
        ("Pressure,Diameter (mm)", {"mode": "planar", **SIZES}, "states no unit of pressure; give force_unit"),
        ("Pressure (mPa),Diameter (mm)", {"mode": "planar", **SIZES}, "'mPa' is not a unit of pressure"),
        ("Pressure (mmHg),Diameter", {"mode": "planar", **SIZES}, "states no unit of length; give displacement_unit"),
        ("Pressure (mmHg),Width (mm)", {"mode": "planar", "pressure": 1}, "recognised as the outer diameter of a tube"),
        ("Pressure (mmHg),Width (mm)", {"mode": "planar"}, "is a pressure. For a tube"),
        ("Load,Diameter (mm)", {"mode": "planar", "outer_diameter": 2}, "recognised as the pressure of a tube"),
    ],
)
def test_what_is_missing_or_wrong_is_said(tmp_path, names, options, words):
    assert words in message(artery(tmp_path, names, neo_hookean), **options)


def test_a_pressure_that_falls_as_the_tube_widens_is_refused(tmp_path):
    file = artery(tmp_path)
    head, *rows = file.read_text().splitlines()
    file.write_text("\n".join([head, *(f"-{row}" for row in rows)]))
    with pytest.raises(InputError, match="not wider where the pressure is larger"):
        tq.read(file, mode="planar", **SIZES)


@pytest.mark.parametrize("name", ["Axial stretch", "lambda_z", "Stretch z"])
def test_a_tube_that_is_stretched_axially_is_refused_as_planar(tmp_path, name):
    file = artery(tmp_path)
    head, *rows = file.read_text().splitlines()
    file.write_text("\n".join([f"{head},{name}", *(f"{row},1.5" for row in rows)]))
    with pytest.raises(InputError, match=r"the axial stretch is 1\.5, and in loading mode 'planar' a tube keeps its"):
        tq.read(file, mode="planar", **SIZES)
    file.write_text("\n".join([f"{head},{name}", *(f"{row},1.0" for row in rows)]))
    assert len(tq.read(file, mode="planar", **SIZES)) == len(STRETCH)


def test_a_stress_goes_before_a_pressure_and_a_diameter(tmp_path):
    """As in a test in a bath whose pressure is recorded, with a specimen that becomes thinner."""
    rows = [f"{0.01 * k},{2.0 * k},{100 + 0.1 * k},{4 - 0.01 * k}" for k in range(30)]
    file = text_file(tmp_path / "bath.csv", "Strain,Stress (kPa),Pressure (kPa),Diameter (mm)", *rows)
    assert tq.read(file).mode.name == "uniaxial"


def test_options_for_means_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"not for the pressure in a tube"):
        tq.read(artery(tmp_path), mode="planar", mean_of=6, **SIZES)


def test_a_curve_of_many_rows_is_fitted_to_some_of_them():
    tube, stretch = Tube(INNER, OUTER), np.repeat(STRETCH, 200)
    few = stress_in_middle(tube, STRETCH, pressures(fung, INNER, OUTER) / tube.log_ratio)
    many = stress_in_middle(tube, stretch, np.repeat(pressures(fung, INNER, OUTER), 200) / tube.log_ratio)
    np.testing.assert_allclose(many, np.repeat(few, 200), rtol=0, atol=1e-3 * few.max())
