"""Pressure and diameter of a tube that was stretched along its axis, against the work that inflates a thick wall."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import tissuq as tq
from thick_tubes import (
    INNER,
    LAWS,
    MMHG,
    OUTER,
    SIZES,
    demiray,
    fibres,
    gent,
    mooney_rivlin,
    neo_hookean,
    ogden,
    slope,
    wall,
    yeoh,
)
from tissuq.errors import InputError, ModelError
from tissuq.experiments.reading.tube import Tube
from written_files import message, text_file

ISOTROPIC = (neo_hookean, mooney_rivlin, yeoh, ogden, gent, demiray)
ROWS = 31


def pressure(law, hoop, axial, inner, outer):
    """Return the pressure at a hoop stretch of the middle: the change of the energy of the wall over that of volume.

    A ring of the radius R has the radius r with axial (r^2 - a^2) = R^2 - A^2. With the inner radius a the energy of
    the wall and the volume within, over an undeformed length, are 2 pi times the integral of W R dR and pi a^2 axial.
    """
    added = inner * outer * (axial * hoop**2 - 1)

    def change(radius):
        stretch = np.sqrt((radius**2 + added) / axial) / radius
        return slope(law, stretch, axial) * radius / (axial * radius**2 * stretch)  # dr = a/r da, with da left out

    return quad(lambda radius: change(radius), inner, outer, epsabs=1e-14, epsrel=1e-11)[0]


@cache
def inflation(law, axial, inner, outer, largest=1.5):
    """Return the hoop stretches of the middle from where there is no pressure, and the pressures (MPa)."""
    lowest = np.sqrt((1 - 0.98 * inner / outer) / axial)
    start = brentq(lambda hoop: pressure(law, hoop, axial, inner, outer), lowest, 1.1 / np.sqrt(axial), xtol=1e-12)
    stretch = np.linspace(start, largest / np.sqrt(axial), ROWS)
    return stretch, np.array([pressure(law, hoop, axial, inner, outer) for hoop in stretch])


def diameter(stretch, axial):
    return 2 * np.sqrt((OUTER**2 + INNER * OUTER * (axial * stretch**2 - 1)) / axial)


def rows_of(law, axial, noise=0.0, seed=0):
    """Return lines of pressure (mmHg) and outer diameter (um), with noise as a share of the largest pressure."""
    stretch, pressures = inflation(law, axial, INNER, OUTER)
    random = np.random.default_rng(seed)
    measured = pressures + noise * pressures.max() * random.standard_normal(len(pressures))
    return [f"{p / MMHG:.10g},{1e3 * d:.10g}" for p, d in zip(measured, diameter(stretch, axial), strict=True)]


def written(folder, axial, law=neo_hookean, name="artery.csv", **options):
    return text_file(folder / name, "Pressure (mmHg),Outer diameter (um)", *rows_of(law, axial, **options))


def written_with_column(folder, stretches, law=neo_hookean, heading="Axial stretch", scale=1, **options):
    rows = [f"{row},{scale * axial:g}" for axial in stretches for row in rows_of(law, axial, **options)]
    return text_file(folder / "artery.csv", f"Pressure (mmHg),Outer diameter (um),{heading}", *rows)


def expected(law, stretches):
    """Return points (n, 2) and engineering stresses (n,)."""
    points = np.concatenate(
        [np.column_stack([inflation(law, z, INNER, OUTER)[0], np.full(ROWS, z)]) for z in stretches]
    )
    return points, slope(law, *points.T)


@pytest.mark.parametrize("law", ISOTROPIC)
def test_a_tube_without_pressure_is_as_narrow_as_a_rod_that_is_stretched(law):
    assert inflation(law, 1.5, INNER, OUTER)[0][0] == pytest.approx(1.5**-0.5, rel=1e-9)


def test_the_pressure_of_a_neo_hookean_tube_is_that_of_the_textbook():
    """p = C10/z (2 ln(aB/(Ab)) + B^2/(z b^2) - A^2/(z a^2)), the closed form of the integral of the stress."""
    axial, added = 1.5, INNER * OUTER * (1.5 * 1.1**2 - 1)
    a, b = (np.sqrt((radius**2 + added) / axial) for radius in (INNER, OUTER))
    closed = 2 * np.log(a * OUTER / (INNER * b)) + (OUTER / b) ** 2 / axial - (INNER / a) ** 2 / axial
    assert pressure(neo_hookean, 1.1, axial, INNER, OUTER) == pytest.approx(0.02 / axial * closed, rel=1e-9)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("axial", [0.9, 1.2, 1.5])
def test_the_stress_in_the_middle_of_the_wall_is_that_of_the_law(law, axial):
    """The errors of docs/measures.md, in shares of the largest stress."""
    for ratio, bound in ((0.1, 0.0003), (0.2, 0.001), (0.4, 0.0035), (0.5, 0.005)):
        inner, outer = wall(ratio)
        tube, (stretch, pressures) = Tube(inner, outer), inflation(law, axial, inner, outer)
        stress = slope(law, stretch, axial)
        (found,) = tube.engineering_stresses(stretch, np.full(ROWS, axial), pressures[None] / tube.log_ratio)
        is_exact = law in (neo_hookean, mooney_rivlin)
        np.testing.assert_allclose(found, stress, rtol=0, atol=(1e-8 if is_exact else bound) * stress.max())


@pytest.mark.parametrize("law", LAWS)
def test_noise_of_the_pressure_is_not_made_much_larger(law):
    """The largest error of 20 curves with noise of half a percent stays below 2.5 % of the largest stress."""
    inner, outer = wall(0.4)
    tube, (stretch, pressures), random = Tube(inner, outer), inflation(law, 1.4, inner, outer), np.random.default_rng(1)
    stress, mean = slope(law, stretch, 1.4), pressures / tube.log_ratio
    for _ in range(20):
        noisy = mean + 0.005 * mean.max() * random.standard_normal(ROWS)
        (found,) = tube.engineering_stresses(stretch, np.full(ROWS, 1.4), noisy[None])
        assert np.abs(found - stress).max() < 0.025 * stress.max()


@pytest.mark.parametrize("law", LAWS)
def test_at_the_undeformed_length_everything_is_as_in_planar_tension(tmp_path, law):
    file = written(tmp_path, 1.0, law)
    planar = tq.read(file, mode="planar", **SIZES)
    tube = tq.read(file, mode="inflated-tube", axial_stretch=1, **SIZES)
    np.testing.assert_array_equal(tube.stretch, np.column_stack([planar.stretch, np.ones(ROWS)]))
    np.testing.assert_array_equal(tube.stress, planar.stress)


@pytest.mark.parametrize("law", LAWS)
def test_tubes_at_several_axial_stretches_are_read_from_one_file(tmp_path, law):
    stretches = (1.2, 1.35, 1.5)
    data = tq.read(written_with_column(tmp_path, stretches, law), **SIZES)
    points, stress = expected(law, stretches)
    assert data.mode.name == "inflated-tube"
    np.testing.assert_allclose(data.stretch, points, atol=1e-8)
    np.testing.assert_allclose(data.stress, stress, rtol=0, atol=0.006 * stress.max())


@pytest.mark.parametrize(
    ("heading", "scale"), [("lambda_z", 1), ("Longitudinal stretch ratio (-)", 1), ("Axial stretch (%)", 100)]
)
def test_the_column_of_the_axial_stretch_is_known_by_its_name(tmp_path, heading, scale):
    data = tq.read(written_with_column(tmp_path, [1.5], heading=heading, scale=scale), **SIZES)
    np.testing.assert_allclose(data.stretch[:, 1], 1.5)


def test_the_axial_stretch_is_given_for_all_rows_or_as_a_column(tmp_path):
    points, stress = expected(neo_hookean, [1.5])
    by_number = tq.read(written(tmp_path, 1.5), axial_stretch=1.5, **SIZES)
    by_column = tq.read(
        written_with_column(tmp_path, [1.5], heading="held"), columns={"axial_stretch": "held"}, **SIZES
    )
    for data in (by_number, by_column):
        assert data.mode.name == "inflated-tube"
        np.testing.assert_allclose(data.stretch, points, atol=1e-8)
        np.testing.assert_allclose(data.stress, stress, rtol=0, atol=1e-7 * stress.max())
    assert "axial stretch 1.5 (as given)" in by_number.source
    assert "axial stretch = column 'held'" in by_column.source


def test_an_inner_diameter_is_read(tmp_path):
    file, (stretch, pressures) = tmp_path / "artery.csv", inflation(fibres, 1.4, INNER, OUTER)
    inside = 2 * np.sqrt(diameter(stretch, 1.4) ** 2 / 4 - (OUTER**2 - INNER**2) / 1.4)
    rows = [f"{1e3 * p:.10g},{d:.10g}" for p, d in zip(pressures, inside, strict=True)]
    file.write_text("\n".join(["Pressure (kPa),Lumen diameter (mm)", *rows]))
    data = tq.read(file, axial_stretch=1.4, **SIZES)
    np.testing.assert_allclose(data.stretch[:, 0], stretch, atol=1e-8)


def test_stresses_and_stretches_are_read_in_the_mode_too():
    frame = {"lambda": [0.9, 1.0, 1.1], "stress [kPa]": [1.0, 5.0, 9.0]}
    data = tq.read(frame, mode="inflated-tube", axial_stretch=1.3)
    assert data.stretch.tolist() == [[0.9, 1.3], [1.0, 1.3], [1.1, 1.3]]
    cauchy = tq.read(frame, mode="inflated-tube", axial_stretch=1.3, stress_type="cauchy")
    np.testing.assert_allclose(cauchy.stress, data.stress / data.stretch[:, 0])


@pytest.mark.parametrize("stretches", [[1.4], [1.2, 1.4, 1.6]])
def test_the_modulus_is_found_under_noise_of_one_percent(tmp_path, stretches):
    """Standard errors are below half a percent."""
    posterior = tq.fit(
        written_with_column(tmp_path, stretches, noise=0.01), discrepancy="none", tolerances=tq.Tolerances("as-tested"),
        **SIZES,
    )  # fmt: skip
    assert float(posterior.summary()["mean"].iloc[0]) == pytest.approx(20.0, rel=0.02)


def test_a_posterior_of_stretched_tubes_predicts_other_modes(tmp_path):
    posterior = tq.fit(written_with_column(tmp_path, [1.3, 1.5]), discrepancy="none", noise_sd="0.05 kPa", **SIZES)
    uniaxial = posterior.predict([1.2], mode="uniaxial", discrepancy=False)
    assert float(uniaxial["median"].iloc[0]) == pytest.approx(40 * (1.2 - 1.2**-2), rel=0.02)
    tube = posterior.predict([[1.0, 1.4]], mode="inflated-tube", discrepancy=False)
    assert float(tube["median"].iloc[0]) == pytest.approx(40 * (1 - 1.4**-2), rel=0.02)


def test_what_is_taken_of_the_tube_is_said(tmp_path):
    inspection = tq.inspect(written_with_column(tmp_path, [1.3, 1.5]), **SIZES)
    assert any("held at 1.3 and 1.5 times its undeformed length" in note for note in inspection.warnings)
    assert any("Its axial stress is not read" in note for note in inspection.warnings)
    text = " ".join(str(inspection).split())
    assert "'Axial stretch' is axial stretch" in text
    assert "(hoop), axial stretch 1.3 and 1.5" in text
    assert "cycles" not in " ".join(inspection.warnings)


def test_sizes_of_the_stretched_tube_are_doubted(tmp_path):
    """Where they are given as those of the undeformed one, so that it has a hoop stretch of 1 without pressure."""
    narrow = diameter(1.5**-0.5, 1.5)
    notes = tq.inspect(written(tmp_path, 1.5), axial_stretch=1.5, diameter=f"{narrow} mm", thickness="0.2 mm").warnings
    assert any("hardly any pressure, and the hoop stretch" in note for note in notes)
    assert not any("hardly any" in n for n in tq.inspect(written(tmp_path, 1.5), axial_stretch=1.5, **SIZES).warnings)


def test_a_tube_with_fibres_may_be_narrower_under_pressure_than_a_rod(tmp_path):
    data = tq.read(written(tmp_path, 1.5, fibres), axial_stretch=1.5, **SIZES)
    assert data.stretch[0, 0] < 1.5**-0.5
    assert (np.diff(data.stress) > 0).all()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"mode": "inflated-tube"}, "say at which axial stretch the tube was held"),
        ({"mode": "planar", "axial_stretch": 1.5}, "in loading mode 'planar' a tube keeps its undeformed length"),
        ({"mode": "inflated-tube", "axial_stretch": 0.0}, "must be a deformed over an undeformed length such as 1.5"),
        ({"mode": "inflated-tube", "axial_stretch": 150}, "must be a deformed over an undeformed length such as 1.5"),
        ({"mode": "uniaxial", "axial_stretch": 1.5}, "is of a tube under pressure"),
        ({"axial_stretch": 1.5, "preload": "auto"}, "does not go with loading mode 'inflated-tube'"),
        ({"axial_stretch": 0.4, "thickness": "0.9 mm"}, "the axial stretch, and the unit of the column"),
        ({}, "--mode inflated-tube --axial-stretch 1.5"),
    ],
)
def test_what_is_missing_or_wrong_is_said(tmp_path, options, words):
    assert words in message(written(tmp_path, 1.2), **(SIZES | options))


@pytest.mark.parametrize(
    ("column", "options", "words"),
    [
        ("150", {}, "150 is no axial stretch"),
        ("-1.5", {}, "-1.5 is no axial stretch"),
        ("1.5", {"axial_stretch": 1.4}, "the axial stretch is 1.5 there, and --axial-stretch says 1.4"),
    ],
)
def test_a_column_that_is_none_of_axial_stretches_is_refused(tmp_path, column, options, words):
    rows = [f"{row},{column}" for row in rows_of(neo_hookean, 1.5)]
    file = text_file(tmp_path / "artery.csv", "Pressure (mmHg),Outer diameter (um),Axial stretch", *rows)
    assert words in message(file, **SIZES, **options)


def test_an_axial_stretch_that_goes_on_during_the_inflation_is_refused(tmp_path):
    rows = [f"{row},{1.4 + 0.005 * number}" for number, row in enumerate(rows_of(neo_hookean, 1.5))]
    file = text_file(tmp_path / "artery.csv", "Pressure (mmHg),Outer diameter (um),Axial stretch", *rows)
    with pytest.raises(InputError, match=r"the axial stretch changes from 1\.4 to 1\.55 while the tube is inflated"):
        tq.read(file, **SIZES)


def test_a_small_drift_of_the_axial_stretch_is_read_row_by_row(tmp_path):
    rows = [f"{row},{1.5 + 0.0001 * number}" for number, row in enumerate(rows_of(neo_hookean, 1.5))]
    file = text_file(tmp_path / "artery.csv", "Pressure (mmHg),Outer diameter (um),Axial stretch", *rows)
    data = tq.read(file, **SIZES)
    np.testing.assert_allclose(data.stretch[:, 1], 1.5 + 0.0001 * np.arange(ROWS))


def test_a_pressure_that_falls_as_the_tube_widens_is_refused(tmp_path):
    file = written(tmp_path, 1.5)
    head, *rows = file.read_text().splitlines()
    file.write_text("\n".join([head, *(f"-{row}" for row in rows)]))
    with pytest.raises(InputError, match="not wider where the pressure is larger"):
        tq.read(file, axial_stretch=1.5, **SIZES)


def test_fibres_of_a_known_angle_are_found(tmp_path):
    """Two families at 45 degrees with k1 = 10 kPa and k2 = 1, from three axial stretches."""
    posterior = tq.fit(
        written_with_column(tmp_path, [1.2, 1.4, 1.6], fibres), material="neo-hookean+exponential-fibres@45",
        discrepancy="none", noise_sd="0.05 kPa", tolerances=tq.Tolerances("as-tested"), **SIZES,
    )  # fmt: skip
    assert posterior.summary()["mean"][["C10", "k1", "k2"]].tolist() == pytest.approx([20, 10, 1], rel=0.03)


def test_an_angle_that_the_hoop_stress_does_not_tell_beside_a_discrepancy_is_refused(tmp_path):
    file = written_with_column(tmp_path, [1.2, 1.5], fibres)
    with pytest.raises(ModelError, match=r"fibres across carry none of the stress that was measured.*fibres@45"):
        tq.fit(file, material="holzapfel-gasser-ogden", discrepancy="auto", **SIZES)


@pytest.mark.parametrize("law", ISOTROPIC)
def test_the_note_says_how_thick_a_wall_is_undeformed_that_was_measured_stretched(tmp_path, law):
    """A wall that keeps its volume, at the diameter that it has without pressure, by the roots of the other file."""
    axial, inner, outer = 1.5, 1.0, 1.2
    stretch, loads = inflation(law, axial, inner, outer)
    added = inner * outer * (axial * stretch**2 - 1)
    faces = [np.sqrt((radius**2 + added) / axial) for radius in (inner, outer)]
    rows = "".join(f"{1e3 * p:.8g},{2 * b:.8g}\n" for p, b in zip(loads, faces[1], strict=True))
    (tmp_path / "artery.csv").write_text(f"pressure [kPa],outer diameter [mm]\n{rows}", encoding="utf-8")
    seen = tq.inspect(
        tmp_path / "artery.csv", mode="inflated-tube", axial_stretch=axial, diameter="2.4 mm", thickness="0.2 mm"
    )
    (note,) = [text for text in seen.warnings if "times as thick undeformed" in text]
    said = float(note.split("is about ")[1].split(" times")[0])
    assert said == pytest.approx(0.2 / (faces[1] - faces[0])[0], rel=0.03)
