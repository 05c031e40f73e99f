"""Pressure, diameter and axial force of a tube, against thick walls whose loads are summed in the deformed state."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

import tissuq as tq
from marks import slow_but
from thick_tubes import (
    HEADINGS,
    INNER,
    LAWS,
    MMHG,
    OUTER,
    ROWS,
    SIZES,
    axial_slope,
    borne,
    fibres,
    fung,
    gent,
    hoop_at,
    measured,
    mooney_rivlin,
    neo_hookean,
    radii,
    rows_of,
    slope,
    steeper_fibres,
    wall,
    written,
    yeoh,
)
from tissuq.errors import InputError
from tissuq.experiments.modes import ThinTube
from tissuq.experiments.reading.tube import Tube
from written_files import message


def stresses_of(law, hoop, axial):
    return np.column_stack([slope(law, hoop, axial), axial_slope(law, hoop, axial)])


@pytest.mark.parametrize("law", [mooney_rivlin, fibres])
def test_the_loads_are_those_of_virtual_work(law):
    """With the energy E(v, z) of an undeformed length of wall around the volume v, p = dE/dv and f = dE/dz."""
    hoop, axial = 1.1, 1.4
    volume = np.pi * radii(hoop, axial, INNER, OUTER)[0] ** 2 * axial

    def energy(volume, axial):
        def of_ring(radius):
            return 2 * np.pi * radius * law(np.sqrt((volume / np.pi + radius**2 - INNER**2) / axial) / radius, axial)

        return quad(of_ring, INNER, OUTER, epsabs=1e-14, epsrel=1e-12)[0]

    step = 1e-4
    pressure = (energy(volume + step, axial) - energy(volume - step, axial)) / (2 * step)
    force = (energy(volume, axial + step) - energy(volume, axial - step)) / (2 * step)
    assert (pressure, force) == pytest.approx(borne(law, hoop, axial, INNER, OUTER), rel=1e-6)


def test_the_force_of_a_neo_hookean_rod_is_that_of_the_textbook():
    """A tube without pressure, f = 2 C10 (z - 1/z^2) S."""
    hoop = hoop_at(neo_hookean, 0.0, 1.5, INNER, OUTER)
    force = borne(neo_hookean, hoop, 1.5, INNER, OUTER)[1]
    assert force == pytest.approx(0.04 * (1.5 - 1.5**-2) * np.pi * (OUTER**2 - INNER**2), rel=1e-9)


@pytest.mark.parametrize("law", [*LAWS, steeper_fibres])
@pytest.mark.parametrize(
    "protocol",
    [
        pytest.param({"held": (1.4,), "at_rest": None}, id="one", marks=pytest.mark.slow),
        pytest.param({"at_rest": None}, id="three", marks=pytest.mark.slow),
        pytest.param({"held": ()}, id="extension"),
        pytest.param({"held": (0.9, 1.1)}, id="short", marks=pytest.mark.slow),
        pytest.param({}, id="all"),
    ],
)
def test_the_stresses_in_the_middle_of_the_wall_are_those_of_the_law(law, protocol):
    """The errors of docs/measures.md, in shares of the largest stress."""
    for ratio, bound in ((0.1, 0.0015), (0.2, 0.0045), (0.4, 0.0095), (0.5, 0.0115)):
        inner, outer = wall(ratio)
        hoop, axial, pressure, force = measured(law, inner, outer, **protocol)
        tube, stress = Tube(inner, outer), stresses_of(law, hoop, axial)
        found = tube.engineering_stresses(hoop, axial, np.stack([pressure / tube.log_ratio, force / tube.section])).T
        np.testing.assert_allclose(found, stress, rtol=0, atol=bound * np.abs(stress).max())


@pytest.mark.parametrize(("ratio", "of_hoop", "of_axis"), [(0.1, 0.048, 0.0083), (0.2, 0.21, 0.037), (0.5, 2.96, 0.6)])
def test_as_a_thin_wall_a_thick_one_has_other_stresses(ratio, of_hoop, of_axis):
    """Those of the table in docs/measures.md, of Fung's law at axial stretches of 0.9 and 1.1."""
    inner, outer = wall(ratio)
    hoop, axial, pressure, force = measured(fung, inner, outer, held=(0.9, 1.1))
    stress, points = stresses_of(fung, hoop, axial), np.column_stack([hoop, axial])
    thin = ThinTube.engineering_stresses(points, pressure, force, np.sqrt(inner * outer), outer - inner)
    errors = np.abs(thin - stress).max(axis=0) / np.abs(stress).max()
    assert errors.tolist() == pytest.approx([of_hoop, of_axis], rel=0.02)


@pytest.mark.parametrize("law", slow_but([gent, fung], [*LAWS, steeper_fibres]))
def test_noise_of_the_loads_is_not_made_much_larger(law):
    """The largest errors of 20 tests with noise of half a percent stay below 4 % of the largest stress."""
    inner, outer = wall(0.4)
    tube, (hoop, axial, pressure, force) = Tube(inner, outer), measured(law, inner, outer)
    stress, random = stresses_of(law, hoop, axial), np.random.default_rng(1)
    loads = np.stack([pressure / tube.log_ratio, force / tube.section])
    for _ in range(20):
        noisy = loads + 0.005 * np.abs(loads).max(axis=1, keepdims=True) * random.standard_normal(loads.shape)
        found = tube.engineering_stresses(hoop, axial, noisy).T
        assert np.abs(found - stress).max() < 0.04 * np.abs(stress).max()


@pytest.mark.parametrize("law", [yeoh, fibres])
def test_a_file_with_a_force_is_read_at_once(tmp_path, law):
    data = tq.read(written(tmp_path, rows_of(law)), **SIZES)
    hoop, axial, _, _ = measured(law)
    stress = stresses_of(law, hoop, axial)
    assert (data.mode.name, data.stress_unit) == ("thin-tube", "kPa")
    np.testing.assert_allclose(data.stretch, np.column_stack([hoop, axial]), atol=1e-8)
    np.testing.assert_allclose(data.stress, stress, rtol=0, atol=0.003 * stress.max())
    assert "f / (pi (B^2 - A^2)): f = column 'Axial force (mN)' in mN (from the file)" in data.source


@pytest.mark.parametrize(
    ("headings", "factors", "options"),
    [
        ("p_lumen (mmHg),OD (mm),lambda_z,F_z (N)", (1, 1e-3, 1, 1e-3), {}),
        ("Innendruck (kPa),Durchmesser (mm),Axiale Dehnung (%),Kraft (mN)", (MMHG * 1e3, 1e-3, 100, 1), {}),
        ("Pressure (mmHg),Diameter (um),Axial stretch,Reduced force (gf)", (1, 1, 1, 1 / 9.80665), {}),
        ("Pressure (mmHg),Diameter (um),Axial stretch,Force (g)", (1, 1, 1, 1 / 9.80665), {"force_unit": "gf"}),
        ("Pressure,Diameter (um),Axial stretch,Force (mN)", (1, 1, 1, 1), {"force_unit": "mmHg"}),
        ("Pressure (mmHg),Diameter (um),Length (mm),Force (mN)", (1, 1, 8, 1), {"length": "8 mm"}),
        ("Pressure (mmHg),Diameter (um),Vessel length (um),Force (mN)", (1, 1, 8e3, 1), {"length": "8 mm"}),
        (
            "q1 (mmHg),q2 (um),q3 (mm),q4 (mN)",
            (1, 1, 8, 1),
            {"columns": {"pressure": 1, "outer_diameter": 2, "length": 3, "force": 4}, "length": "0.8 cm"},
        ),
        (
            "q1 (mmHg),q2 (um),q3,q4 (mN)",
            (1, 1, 1, 1),
            {"columns": {"axial_stretch": "q3"}, "pressure": "q1", "outer_diameter": "q2", "force": "q4"},
        ),
    ],
)
def test_columns_and_their_units_are_recognised(tmp_path, headings, factors, options):
    expected = tq.read(written(tmp_path, rows_of(fibres)), **SIZES)
    file = written(tmp_path, rows_of(fibres) * factors, headings, "other.csv")
    data = tq.read(file, **SIZES, **options)
    np.testing.assert_allclose(data.stretch, expected.stretch, rtol=1e-8)
    np.testing.assert_allclose(data.stress, expected.stress, rtol=1e-5, atol=1e-6 * expected.stress.max())


def test_the_undeformed_length_may_stand_above_the_table(tmp_path):
    headings = "Undeformed length: 8 mm\nPressure (mmHg),Diameter (um),Length (mm),Force (mN)"
    data = tq.read(written(tmp_path, rows_of(fibres) * (1, 1, 8, 1), headings), **SIZES)
    np.testing.assert_allclose(data.stretch[:, 1], measured(fibres)[1], rtol=1e-8)
    assert "/ 8 mm (length in line 1)" in data.source


@pytest.mark.parametrize(
    ("name", "column"), [("Axial displacement (mm)", {}), ("Displacement (mm)", {"columns": {"axial_stretch": 3}})]
)
def test_an_axial_displacement_tells_the_axial_stretch_with_the_undeformed_length(tmp_path, name, column):
    rows = rows_of(fibres)
    rows[:, 2] = 8 * (rows[:, 2] - 1)
    file = written(tmp_path, rows, f"Pressure (mmHg),Diameter (um),{name},Force (mN)")
    data = tq.read(file, **SIZES, **column, length="8 mm")
    np.testing.assert_allclose(data.stretch[:, 1], measured(fibres)[1], rtol=1e-8)
    with pytest.raises(InputError, match='--length "8 mm"'):
        tq.read(file, **SIZES, columns={"axial_stretch": 3})


@pytest.mark.parametrize("held", [{"axial_stretch": 1.4}, {"length": "8 mm"}])
def test_the_axial_stretch_of_all_rows_may_be_given(tmp_path, held):
    """As a number, or as a length that is the same in all rows beside the undeformed one."""
    rows = rows_of(fibres, held=(1.4,), at_rest=None)
    file = written(tmp_path, rows * (1, 1, 8, 1), "Pressure (mmHg),Diameter (um),Length (mm),Force (mN)")
    data = tq.read(file, **held, **SIZES)
    np.testing.assert_allclose(data.stretch[:, 1], 1.4)
    np.testing.assert_allclose(data.stress, tq.read(written(tmp_path, rows, name="b.csv"), **SIZES).stress, rtol=1e-9)


def test_an_inner_diameter_is_read(tmp_path):
    rows = rows_of(fibres)
    hoop, axial, _, _ = measured(fibres)
    rows[:, 1] = 2e3 * radii(hoop, axial, INNER, OUTER)[0]
    data = tq.read(written(tmp_path, rows, HEADINGS.replace("Outer", "Inner")), **SIZES)
    np.testing.assert_allclose(data.stretch, np.column_stack([hoop, axial]), atol=1e-8)


def test_a_pressure_may_be_held_while_the_tube_is_stretched(tmp_path):
    rows = rows_of(fibres, held=())
    assert np.ptp(rows[:, 0]) < 1e-6 * rows[0, 0]
    data = tq.read(written(tmp_path, rows.round(6)), **SIZES)
    hoop, axial, _, _ = measured(fibres, held=())
    stress = stresses_of(fibres, hoop, axial)
    np.testing.assert_allclose(data.stress, stress, rtol=0, atol=0.003 * stress.max())


def test_a_tube_may_be_stretched_without_pressure(tmp_path):
    """As a rod: of 2 C10 (z - 1/z^2) along the axis, and of nothing around it."""
    axial = np.linspace(1.05, 1.6, ROWS)
    hoop = [hoop_at(neo_hookean, 0.0, stretch, INNER, OUTER) for stretch in axial]
    force = [borne(neo_hookean, *point, INNER, OUTER)[1] for point in zip(hoop, axial, strict=True)]
    diameter = 2 * radii(np.array(hoop), axial, INNER, OUTER)[1]
    file = written(tmp_path, np.column_stack([0 * axial, 1e3 * diameter, axial, 1e3 * np.array(force)]))
    stress = 0.04 * (axial - axial**-2)
    expected = np.column_stack([0 * axial, stress])
    np.testing.assert_allclose(tq.read(file, **SIZES).stress, expected, rtol=0, atol=1e-6 * stress.max())


@pytest.mark.parametrize("name", ["artery axial.csv", "tension-inflation.csv"])
def test_columns_of_a_tube_go_before_words_in_the_name_of_its_file(tmp_path, name):
    assert tq.read(written(tmp_path, rows_of(fibres), name=name), **SIZES).mode.name == "thin-tube"


def test_a_comment_goes_before_columns_of_a_tube(tmp_path):
    file = written(tmp_path, rows_of(fibres), f"# mode: inflated-tube\n{HEADINGS}")
    assert tq.read(file, every=1, leave_out="78:102", **SIZES).mode.name == "inflated-tube"


def with_label(folder, labels, name="Protocol"):
    lines = written(folder, rows_of(fibres, at_rest=None)).read_text(encoding="utf-8").splitlines()
    rows = [f"{line},{label}" for line, label in zip(lines[1:], np.repeat(labels, ROWS), strict=True)]
    (folder / "labelled.csv").write_text("\n".join([f"{lines[0]},{name}", *rows]))
    return folder / "labelled.csv"


@pytest.mark.parametrize("labels", [["at 1.2", "at 1.4", "at 1.6"], [1, 2, 3]])
def test_parts_of_a_protocol_are_one_test(tmp_path, labels):
    assert len(tq.read(with_label(tmp_path, labels), **SIZES)) == 3 * ROWS


def test_a_pressure_that_was_asked_for_parts_nothing(tmp_path):
    """Of a tube that is stretched at several pressures in turn."""
    pulls = [rows_of(fibres, held=(), at_rest=hoop) for hoop in (0.95, 1.0, 1.05)]
    rows = np.concatenate([np.column_stack([pull, np.full(ROWS, pull[0, 0].round())]) for pull in pulls])
    file = written(tmp_path, rows, f"{HEADINGS},Target pressure (mmHg)")
    assert len(tq.read(file, **SIZES)) == 3 * ROWS


def test_rows_of_several_vessels_are_told_apart(tmp_path):
    with pytest.raises(InputError, match=r"names several tests: 'A', 'B'"):
        tq.read(with_label(tmp_path, ["A", "A", "B"], "Specimen"), **SIZES)


@pytest.mark.parametrize("count", [2, 3, 4])
def test_few_rows_are_read(tmp_path, count):
    rows = rows_of(fibres)[:: len(rows_of(fibres)) // count][:count]
    assert len(tq.read(written(tmp_path, rows), **SIZES)) == count


def test_the_force_of_the_whole_wall_is_less_by_that_of_the_pressure_on_the_ends(tmp_path):
    """N = 2 pi times the integral of s_axial r dr, with s_radial from equilibrium, is f + pi a^2 p."""
    hoop, axial, pressure, force = measured(fibres)
    rows = rows_of(fibres)
    rows[:, 3] = 1e3 * (force + np.pi * radii(hoop, axial, INNER, OUTER)[0] ** 2 * pressure)
    by_name = tq.read(written(tmp_path, rows, HEADINGS.replace("Axial force", "Total force")), **SIZES)
    by_role = tq.read(written(tmp_path, rows), total_force="Axial force (mN)", **SIZES)
    expected = tq.read(written(tmp_path, rows_of(fibres)), **SIZES)
    for data in (by_name, by_role):
        np.testing.assert_allclose(data.stress, expected.stress, rtol=1e-6)
        assert "less the pressure on the ends pi a^2 p" in data.source


def test_which_force_is_taken_is_said(tmp_path):
    text = " ".join(str(tq.inspect(written(tmp_path, rows_of(fibres)), **SIZES)).split())
    assert "mode thin-tube (columns of pressure, diameter and force)" in text
    assert "'Axial force (mN)' is force of axial engineering stress" in text
    assert "'Axial stretch' is axial stretch" in text
    assert "held at 1.1 to 1.6 times its undeformed length" in text
    assert "taken as the reduced one" in text
    assert "give --column total_force=NAME" in text
    assert text.count("Note") == 1


def test_a_force_that_no_wall_bears_beside_the_pressure_is_doubted(tmp_path):
    file = written(tmp_path, rows_of(steeper_fibres))
    notes = tq.inspect(file, total_force="Axial force (mN)", **SIZES).warnings
    assert any("from those that a wall of one elastic material bears" in note for note in notes)
    assert not any("elastic material bears" in note for note in tq.inspect(file, **SIZES).warnings)


def test_the_zero_of_either_load_is_taken_off(tmp_path):
    rows = rows_of(fibres)
    expected = tq.read(written(tmp_path, rows), **SIZES).stress
    for shift, zero in (([3.0, 0, 0, 0], "3 mmHg"), ([0, 0, 0, 5.0], "0.005 N")):
        data = tq.read(written(tmp_path, rows + shift), load_zero=zero, **SIZES)
        np.testing.assert_allclose(data.stress, expected, rtol=1e-6)


@pytest.mark.parametrize("law", [*LAWS, steeper_fibres])
@pytest.mark.parametrize("protocol", [{}, {"held": ()}, {"held": (1.4,), "at_rest": None}])
def test_a_force_of_the_wrong_sign_is_refused_and_may_be_turned(tmp_path, law, protocol):
    rows = rows_of(law, noise=0.01, **protocol)
    expected = tq.read(written(tmp_path, rows), **SIZES)
    file = written(tmp_path, rows * (1, 1, 1, -1))
    with pytest.raises(InputError, match=r"force of the other sign.*--turn load"):
        tq.read(file, **SIZES)
    np.testing.assert_allclose(tq.read(file, turn="load", **SIZES).stress, expected.stress, rtol=1e-9)


@pytest.mark.parametrize("mode", ["inflated-tube", "planar"])
def test_the_force_is_left_alone_in_modes_without_it(tmp_path, mode):
    rows = rows_of(fibres, held=(1.0,), at_rest=None)
    data = tq.read(written(tmp_path, rows), mode=mode, **SIZES)
    assert data.stress.ndim == 1


@pytest.mark.parametrize(
    ("keep", "headings", "options", "words"),
    [
        ([0, 1, 3], "Pressure (mmHg),Diameter (um),Force (mN)", {}, "nothing says its axial stretch"),
        ([0, 1, 2, 3], "Pressure (mmHg),Diameter (um),Length (mm),Force (mN)", {}, '--length "8 mm"'),
        ([0, 1, 2, 3], HEADINGS, {"axial_stretch": 1.3}, "and --axial-stretch says 1.3"),
        ([0, 1, 2, 3], HEADINGS, {"thickness": None}, '--diameter "3 mm" --thickness "0.5 mm"'),
        ([0, 1, 2, 3], HEADINGS, {"diameter": None}, '--diameter "3 mm" --thickness "0.5 mm"'),
        ([0, 1, 2, 3], HEADINGS, {"length": "8 mm"}, "which need no length"),
        ([0, 1, 2, 3], HEADINGS, {"load_zero": "first"}, "whether it is of the pressure or of the axial force"),
        ([0, 1, 2, 3], HEADINGS, {"stress_type": "cauchy"}, "read as a pressure, which is no cauchy stress"),
        ([0, 1, 2, 3], HEADINGS, {"preload": "0.01 N"}, "does not go with loading mode 'thin-tube'"),
        ([0, 1, 2, 3], HEADINGS, {"force": 4, "total_force": 4}, "both force and total_force"),
        ([0, 1, 2, 3], HEADINGS, {"force": 1}, "cannot be the axial force of a tube, too"),
        ([0, 1, 2, 3], HEADINGS, {"mean_of": 5}, "not for the pressure in a tube"),
        ([0, 1, 2, 3], HEADINGS.replace("force (mN)", "force (mmHg)"), {}, "'mmHg' is not a unit of force"),
        ([0, 1, 2], HEADINGS.rpartition(",")[0], {"mode": "thin-tube"}, "recognised as the axial force of a tube"),
        ([0, 1, 2, 3, 3], f"{HEADINGS},Load (mN)", {}, "may each be the axial force of a tube"),
        ([0, 1, 2, 3], HEADINGS.replace("Axial stretch", "Length (m)"), {"length": "8 mm"}, "is no axial stretch"),
    ],
)
def test_what_is_missing_or_wrong_is_said(tmp_path, keep, headings, options, words):
    file = written(tmp_path, rows_of(fibres)[:, keep], headings)
    assert words in message(file, **{name: value for name, value in (SIZES | options).items() if value is not None})


def test_an_axial_stretch_that_is_not_held_needs_the_force(tmp_path):
    file = written(tmp_path, rows_of(fibres, held=()))
    with pytest.raises(InputError, match=r"changes from 1\.1 to 1\.6 while the tube is inflated.*--mode thin-tube"):
        tq.read(file, mode="inflated-tube", **SIZES)


def test_a_pressure_that_is_held_beside_a_force_is_no_tube_without_an_axial_stretch(tmp_path):
    """As in a bath at room pressure, with a specimen that becomes thinner."""
    rows = np.array([[0.01 * k, 2.0 * k, 100, 4 - 0.01 * k] for k in range(30)])
    file = written(tmp_path, rows, "Strain,Force (N),Pressure (kPa),Diameter (mm)")
    assert tq.read(file, area="10 mm2").mode.name == "uniaxial"


def test_rows_that_are_left_out_raise_no_doubt(tmp_path):
    rows = rows_of(fibres)
    rows[40, 0] *= 5
    file = written(tmp_path, rows)
    assert any("elastic material bears" in note for note in tq.inspect(file, **SIZES).warnings)
    assert not any("elastic material bears" in note for note in tq.inspect(file, leave_out="42", **SIZES).warnings)


def test_stretches_beyond_all_numbers_are_refused(tmp_path):
    with pytest.raises(InputError, match="no wall bears such pressures and forces"):
        tq.read(written(tmp_path, rows_of(fibres) * (1, 1e160, 1, 1)), **SIZES)
