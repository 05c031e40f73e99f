import re

import numpy as np
import pytest

import tissuq as tq
from machine_files import biotester, cycles, instron, neo_hookean, wintest
from tissuq.experiments.reading.inspection import noise_between_neighbours
from written_files import text_file, written


@pytest.fixture
def inspected(tmp_path):
    def inspect(stretch, stress, heading="stretch,stress [kPa]", **options):
        return tq.inspect(written(tmp_path, heading, stretch, stress, form="{:.9g}".format), **options)

    return inspect


def notes(inspection):
    return " ".join(inspection.warnings)


def curve(top=1.4, rows=100):
    stretch = np.linspace(1, top, rows)
    return stretch, 1e3 * neo_hookean(stretch)


@pytest.mark.parametrize("seed", range(3))
def test_the_noise_is_estimated_within_its_error(seed):
    """The median of |r| over n neighbours has a relative error of about 1.2 / sqrt(n), correlation included: 2 %."""
    random = np.random.default_rng(seed)
    stretch, stress = curve(rows=4000)
    sd = noise_between_neighbours(stretch, stress + random.normal(0, 0.3, len(stress)))
    assert sd == pytest.approx(0.3, rel=0.1)


def test_turning_points_do_not_raise_the_noise():
    stretch, _ = cycles([1.3] * 5, rows=100)
    random = np.random.default_rng(1)
    sd = noise_between_neighbours(stretch, 1e3 * neo_hookean(stretch) + random.normal(0, 0.2, len(stretch)))
    assert sd == pytest.approx(0.2, rel=0.15)


def test_few_measurements_do_not_tell_the_noise(inspected):
    assert inspected(*curve(rows=20)).noise_sd is None
    assert "not told" in str(inspected(*curve(rows=20)))


def test_what_is_printed_tells_columns_rows_ranges_steps_and_cycles(tmp_path):
    file = wintest()
    text = str(tq.inspect(file.written(tmp_path), **file.options))
    for words in (
        "3 columns, separated by commas; rows in lines 5 to 299, 4 lines above them",
        "'Elapsed Time' not read, 'Disp' is displacement, 'Load' is force",
        "41 of 295 used; 245 dropped: not loading of cycle 3 of 3; 9 dropped: carrying less than 0.01 N",
        "stretch   1.00043 to 1.23264",
        "stress    1.71767 to 24.4 kPa",
        "step 4    stretch counted from 1.05465, where the preload 0.01 N is reached between lines 209 and 210",
        "3         201 to 299               1.0000       1.3000       1.0000",
    ):
        assert words in text


def test_a_plain_curve_raises_no_doubt(inspected, tmp_path):
    assert inspected(*curve()).warnings == ()
    assert tq.inspect(instron().written(tmp_path)).warnings == ()


@pytest.mark.parametrize(
    ("stretch", "stress", "words"),
    [
        (curve()[0], 1e9 * curve()[1], "check the units of force and area"),
        (30 * curve()[0] - 29, curve()[1], "the largest stretch is 13"),
        (100 * curve()[0], curve()[1], "where these are in percent, write % in its heading, as in 'stretch (%)'"),
        (curve()[0] + 0.2, curve()[1], "begin at stretch 1.2, not near 1"),
        (curve()[0], curve()[1] + 5, "at stretch 1 the stress is already 5 kPa, 12 % of the largest"),
        (curve()[0], np.maximum(curve()[1] - 20, 0), "rows carry no load that shows, until the stretch is 1.19"),
    ],
)
def test_what_is_strange_is_said(inspected, stretch, stress, words):
    assert words in notes(inspected(stretch, stress))


def test_a_reference_between_measurements_is_no_late_beginning(inspected):
    stretch = np.linspace(0.75, 1.4, 30)[::2]
    assert np.abs(stretch - 1).min() > 0.05 * np.abs(stretch - 1).max()
    assert "not near" not in notes(inspected(stretch, 1e3 * neo_hookean(stretch)))


@pytest.mark.parametrize("first", [0.9855, 1.0145])
@pytest.mark.parametrize("offset", [0.0, 8.0, -8.0])
def test_a_stress_next_to_the_reference_is_a_preload_only_where_the_curve_misses_zero(inspected, first, offset):
    stretch = np.linspace(first, 1.3, 15)
    stress = 1e3 * neo_hookean(stretch)
    assert abs(stress[0]) > 0.05 * stress.max()
    assert ("the stress is already" in notes(inspected(stretch, stress + offset))) is (offset != 0)


def test_a_reading_that_strays_as_others_do_is_no_preload_and_the_zero_is_that_of_a_line(inspected):
    stretch = np.linspace(0.88, 1.2, 18)
    stress = 1.6 * (stretch - stretch**-2) + np.random.default_rng(3).normal(0, 0.05, 18)
    stress[6] = -0.2024  # 2.7 standard deviations off, beside stretch 1
    assert "the stress is already" not in notes(inspected(stretch, stress))
    said = notes(inspected(stretch, stress + 0.5))
    (zero,) = re.findall(r'--load-zero "(\S+) kPa"', said)
    assert abs(float(zero) - 0.5) < 0.12


@pytest.mark.parametrize(
    ("slack", "words"), [(0.05, "--load-zero first --preload auto"), (0.0, "--load-zero first takes")]
)
def test_slack_under_a_load_zero_is_told_with_it(tmp_path, slack, words):
    stretch = np.linspace(1, 1.4, 41)
    stress = 1e3 * neo_hookean(np.maximum(stretch - slack, 1.0)) + 20 + np.random.default_rng(5).normal(0, 1, 41)
    rows = zip(stretch.tolist(), stress.tolist(), strict=True)
    path = text_file(tmp_path / "zero.csv", "stretch,stress [kPa]\n" + "".join(f"{x:.4f},{y:.2f}\n" for x, y in rows))
    (said,) = [text for text in tq.inspect(path).warnings if "the stress is already" in text]
    assert words in said
    assert ("and slack: without it the first" in said) == bool(slack)


def test_cycles_that_are_all_used_and_hysteresis_are_said(inspected):
    stretch, _ = cycles([1.3, 1.3], rows=50)
    unloads = np.diff(stretch, append=1.0) < 0
    stress = 1e3 * neo_hookean(stretch) * np.where(unloads, 0.7, 1.0)
    text = notes(inspected(stretch, stress))
    assert "all 2 cycles are used, and loading and unloading differ by up to" in text
    assert "give --cycle last --branch loading." in text
    assert text.count("loading and unloading differ") == 1
    assert "% of the largest stress, and an elastic material has one curve" in text
    assert inspected(stretch, stress, cycle="last", branch="loading").warnings == ()


def test_by_how_much_the_peaks_of_equal_cycles_fall_is_said(inspected):
    stretch, _ = cycles([1.3, 1.3, 1.3], rows=50)
    number = np.cumsum(np.r_[False, (np.diff(stretch)[1:] > 0) & (np.diff(stretch)[:-1] <= 0), False])
    softer = np.select([number == 0, number == 1], [1.0, 0.9], 0.8)
    text = notes(inspected(stretch, 1e3 * neo_hookean(stretch) * softer))
    assert "all 3 cycles are used, at whose peaks the stress falls by 20 % of the largest from the first to the" in text
    growing, _ = cycles([1.2, 1.25, 1.3], rows=50)
    assert "peaks" not in notes(inspected(growing, 1e3 * neo_hookean(growing)))


@pytest.mark.parametrize(("stiffer", "is_unloaded"), [(1.4, False), (1.4, True), (1.0, False), (0.8, False)])
def test_tests_beneath_one_another_may_be_of_several_specimens(inspected, stiffer, is_unloaded):
    """Of cycles that were unloaded, and of curves that agree, nothing is said; one goes further than the other."""
    ups = np.linspace(1, 1.3, 50), np.linspace(1, 1.25, 50)
    way = [np.concatenate([up, up[::-1][1:]]) if is_unloaded else up for up in ups]
    stress = np.concatenate([1e3 * neo_hookean(way[0]), 1e3 * stiffer * neo_hookean(way[1])])
    text = notes(inspected(np.concatenate(way), stress))
    assert "all 2 cycles are used" in text
    is_said = "may be tests of several specimens: then name the specimen of every row in a column 'specimen'" in text
    assert is_said == (stiffer != 1 and not is_unloaded)


@pytest.mark.parametrize("repeats", [1, 2])
def test_a_protocol_of_several_ratios_is_no_repetition(tmp_path, repeats):
    ratios = np.repeat([(1, 1), (1, 0.5), (0.5, 1)], repeats, axis=0)
    strains = np.concatenate([np.outer(np.linspace(0, 0.2, 15), ratio) for ratio in ratios])
    first, second = 1 + strains.T
    third = 1 / (first * second)
    stress = [2 * (along - third**2 / along) for along in (first, second)]
    path = written(tmp_path, "stretch x,stretch y,stress x (kPa),stress y (kPa)", first, second, *stress)
    warnings = tq.inspect(path).warnings
    assert "--cycle last" not in " ".join(warnings)
    assert any("all 6 cycles are used, which have 3 ratios" in text for text in warnings) is (repeats == 2)


def test_a_table_in_any_order_is_not_taken_for_cycles(inspected):
    stretch, stress = curve(rows=30)
    order = np.random.default_rng(5).permutation(30)
    assert "cycles" not in notes(inspected(stretch[order], stress[order]))


def test_an_assumed_unit_is_said(inspected):
    assert "so MPa was assumed" in notes(inspected(*curve(), heading="stretch,stress"))


def test_a_biaxial_test_read_as_uniaxial_is_doubted(tmp_path):
    file = biotester()
    path = file.written(tmp_path)
    options = {**file.options, "mode": "uniaxial"}
    assert "column 'YForce_mN' carries force, too" in notes(tq.inspect(path, **options))
    assert "carries force" not in notes(tq.inspect(path, **file.options))


@pytest.mark.parametrize(("ratio", "is_doubted"), [(-1.0, True), (0.0, True), (0.5, False), (0.3, False)])
@pytest.mark.parametrize("heading", ["stretch y", "strain y [%]", "strain yy"])
def test_a_stretch_of_the_other_axis_that_is_not_free_is_doubted(tmp_path, ratio, is_doubted, heading):
    along = np.linspace(1, 1.3, 20)
    across = along**-ratio
    column = {"stretch y": across, "strain y [%]": 100 * (across - 1), "strain yy": across - 1}[heading]
    path = written(tmp_path, f"stretch x,{heading},stress x (kPa)", along, column, 1e3 * (along - along**-2))
    text = notes(tq.inspect(path, axis="x", mode="uniaxial"))
    assert ("does not become narrower" in text) is is_doubted


def test_compression_after_tension_from_the_reference_is_no_unloading(tmp_path):
    text = "stretch,stress_kPa\n"
    for end in (1.1, 0.9):
        text += "".join(f"{x:.5f},{1e3 * (x - x**-2):.6f}\n" for x in np.linspace(1, end, 17))
    path = text_file(tmp_path / "both.csv", text)
    assert "loading and unloading differ" not in str(tq.inspect(path))
    down = np.linspace(1.1, 1, 17)[1:]
    path.write_text(
        text.split("\n1.00000", 2)[0]
        + "\n"
        + "".join(
            [f"{x:.5f},{1e3 * (x - x**-2):.6f}\n" for x in np.linspace(1, 1.1, 17)]
            + [f"{x:.5f},{900 * (x - x**-2):.6f}\n" for x in down]
        )
    )
    assert "loading and unloading differ" in str(tq.inspect(path))
