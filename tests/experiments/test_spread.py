"""Columns of standard deviations and standard errors beside the mean stress of several specimens."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import t

import tissuq as tq
from tissuq.errors import InputError
from tissuq.experiments.reading.headings import of_spread
from tissuq.experiments.reading.read import read_experiment
from written_files import by_name, message, text_file

STRETCH = np.linspace(1.0, 1.3, 7)
STRESS = 100 * (STRETCH - STRETCH**-2)  # kPa
SPREAD = 0.1 * STRESS + 0.2
OF_SIX = t.ppf(0.975, 5) / 1.959963984540054


@pytest.mark.parametrize(
    ("names", "options", "error"),
    [
        (("Stretch", "Stress (kPa)", "SEM (kPa)"), {}, SPREAD * 1e-3),
        (("Stretch", "Stress (kPa)", "sem"), {}, SPREAD * 1e-3),
        (("Stretch", "Stress (kPa)", "Standard error (Pa)"), {}, SPREAD * 1e-6),
        (("Stretch", "Stress (kPa)", "Stress_std_err [kPa]"), {}, SPREAD * 1e-3),
        (("Stretch", "Stress (kPa)", "Standardfehler"), {}, SPREAD * 1e-3),
        (("Stretch", "stress_mean [kPa]", "stress_sd [kPa]"), {"mean_of": 6}, SPREAD * 1e-3 * OF_SIX / 6**0.5),
        (("Stretch", "Stress (kPa)", "SD"), {"mean_of": 6}, SPREAD * 1e-3 * OF_SIX / 6**0.5),
        (("Stretch", "Average stress (kPa)", "Stress StdDev (kPa)"), {"mean_of": 6}, SPREAD * 1e-3 * OF_SIX / 6**0.5),
        (("Stretch", "Mean (kPa)", "Std (kPa)"), {"mean_of": 6}, SPREAD * 1e-3 * OF_SIX / 6**0.5),
        (("Stretch", "Stress (kPa)", "écart-type (kPa)"), {"mean_of": 6}, SPREAD * 1e-3 * OF_SIX / 6**0.5),
        (("Stretch", "Stress (kPa)", "±"), {"columns": {"sem": "±"}}, SPREAD * 1e-3),
        (("Stretch", "Stress (kPa)", "w"), {"columns": {"sd": "w"}, "mean_of": 6}, SPREAD * 1e-3 * OF_SIX / 6**0.5),
    ],
)
def test_the_spread_of_a_mean_becomes_its_standard_error(tmp_path, names, options, error):
    data = read_experiment(by_name(tmp_path, **dict(zip(names, (STRETCH, STRESS, SPREAD), strict=True))), **options)
    np.testing.assert_allclose(data.stress, STRESS * 1e-3, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(data.standard_error, error, rtol=1e-9)


def test_one_standard_error_for_all_rows_is_read(tmp_path):
    data = read_experiment(by_name(tmp_path, Stretch=STRETCH, **{"Stress (kPa)": STRESS, "SEM": np.full(7, 0.5)}))
    np.testing.assert_allclose(data.standard_error, 0.5e-3, rtol=1e-9)


def test_the_number_of_specimens_may_stand_in_a_column(tmp_path):
    counts = np.array([6, 6, 6, 6, 5, 5, 4])
    file = by_name(tmp_path, Stretch=STRETCH, **{"Stress (kPa)": STRESS, "SD (kPa)": SPREAD}, n=counts)
    expected = SPREAD * 1e-3 * t.ppf(0.975, counts - 1) / 1.959963984540054 / np.sqrt(counts)
    np.testing.assert_allclose(read_experiment(file).standard_error, expected, rtol=1e-9)


def test_numbers_of_rows_are_no_numbers_of_specimens(tmp_path):
    file = by_name(tmp_path, n=np.arange(2, 9), Stretch=STRETCH, **{"Stress (kPa)": STRESS, "SD (kPa)": SPREAD})
    assert not read_experiment(file).standard_error.any()


def test_the_spread_of_the_strain_is_not_that_of_the_stress(tmp_path):
    columns = {
        "Strain (%)": 100 * (STRETCH - 1),
        "Strain SD (%)": SPREAD,
        "Stress (kPa)": STRESS,
        "Stress SEM (kPa)": SPREAD,
    }
    data = read_experiment(by_name(tmp_path, **columns))
    np.testing.assert_allclose(data.standard_error, SPREAD * 1e-3, rtol=1e-9)
    del columns["Stress SEM (kPa)"]
    assert not read_experiment(by_name(tmp_path, **columns)).standard_error.any()


def test_of_two_without_a_unit_the_one_beside_the_stress_is_its_spread(tmp_path):
    file = text_file(tmp_path / "test.csv", "Strain,SEM,Stress (kPa),SEM\n0,0.01,0,0.1\n0.1,0.02,2,0.3\n0.2,0.03,5,0.5")
    np.testing.assert_allclose(read_experiment(file).standard_error, [1e-4, 3e-4, 5e-4])


def test_a_spread_of_forces_is_over_the_area_and_is_converted_with_the_stress(tmp_path):
    file = by_name(tmp_path, **{"Disp (mm)": 10 * (STRETCH - 1), "Load (N)": STRESS, "Load SEM (mN)": 1e3 * SPREAD})
    data = read_experiment(file, dimensions={"length": "10 mm", "area": "4 mm2"})
    np.testing.assert_allclose(data.standard_error, SPREAD / 4, rtol=1e-9)
    file = by_name(tmp_path, **{"Stretch": STRETCH, "True stress (kPa)": STRESS, "SEM (kPa)": SPREAD})
    np.testing.assert_allclose(read_experiment(file).standard_error, SPREAD / STRETCH * 1e-3, rtol=1e-9)


def test_rows_that_are_dropped_take_their_errors_along(tmp_path):
    file = by_name(tmp_path, **{"Stretch": STRETCH, "Stress (kPa)": STRESS, "SEM (kPa)": SPREAD})
    data = read_experiment(file, every=3)
    np.testing.assert_allclose(data.standard_error, SPREAD[::3] * 1e-3, rtol=1e-9)
    np.testing.assert_allclose(data.where(np.array([False, True, True])).standard_error, SPREAD[3::3] * 1e-3, rtol=1e-9)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("SD (kPa)", "give the number of specimens (--mean-of 6)"),
        ("±", "may hold standard deviations or standard errors"),
        ("Stress error (kPa)", "may hold standard deviations or standard errors"),
    ],
)
def test_a_spread_that_cannot_be_used_is_said_and_the_file_is_read_all_the_same(tmp_path, name, words):
    file = by_name(tmp_path, **{"Stretch": STRETCH, "Stress (kPa)": STRESS, name: SPREAD})
    inspection = tq.inspect(file)
    assert any(words in text for text in inspection.warnings)
    assert not inspection.reading.experiment.standard_error.any()


@pytest.mark.parametrize(
    ("upper", "lower", "half"),
    [
        ("Upper", "Lower", "half of 'Upper' - 'Lower'"),
        ("Mean + SD (kPa)", "Mean - SD (kPa)", "half of 'Mean + SD (kPa)' - 'Mean - SD (kPa)'"),
        ("+SEM", "-SEM", "half of '+SEM' - '-SEM'"),
        ("Upper error", "Lower error", "the mean of 'Upper error' and 'Lower error'"),
    ],
)
@pytest.mark.parametrize("name", ["Stress (kPa)", "Mean stress (kPa)"])
def test_ends_of_error_bars_are_no_standard_deviations_and_are_said(tmp_path, upper, lower, half, name):
    above, below = (SPREAD, SPREAD) if "error" in upper else (STRESS + SPREAD, STRESS - SPREAD)
    file = by_name(tmp_path, **{"Stretch": STRETCH, name: STRESS, upper: above, lower: below, "n": STRETCH * 0 + 8})
    inspection = tq.inspect(file)
    assert any("error bars of the stress" in text and half in text for text in inspection.warnings)
    assert not inspection.reading.experiment.standard_error.any()


def test_beside_ends_of_error_bars_a_standard_error_is_read(tmp_path):
    columns = {"Stretch": STRETCH, "Stress (kPa)": STRESS, "max": STRESS + SPREAD, "min": STRESS - SPREAD}
    data = read_experiment(by_name(tmp_path, **columns, SEM=SPREAD))
    np.testing.assert_allclose(data.standard_error, SPREAD * 1e-3, rtol=1e-9)


@pytest.mark.parametrize(
    ("line", "name", "words"),
    [
        ("# n = 8", "SD", "--mean-of 8, if that is what line 1 means by 'n = 8'"),
        ("mean of 12 specimens", "SD", "--mean-of 12, if that is what line 1 means by 'mean of 12'"),
        ("porcine brain", "SD (n=7)", "--mean-of 7, if that is what line 2 means by 'n=7'"),
        ("# n = 8", "±", "--mean-of 8, if that is what line 1 means by 'n = 8'"),
        ("Speed n = 0.5 mm/s", "SD", "--mean-of 6)"),
    ],
)
def test_a_number_of_specimens_that_the_file_states_is_proposed(tmp_path, line, name, words):
    file = by_name(tmp_path, **{"Stretch": STRETCH, "Stress (kPa)": STRESS, name: SPREAD})
    file.write_text(f"{line}\n{file.read_text()}")
    assert any(words in text for text in tq.inspect(file).warnings)


def test_a_cell_that_is_no_number_leaves_the_column_out_with_a_note(tmp_path):
    file = text_file(tmp_path / "test.csv", "Strain,Stress (kPa),SEM (kPa)\n0,0,-\n0.1,2,0.3\n0.2,5,0.5")
    assert any("line 2, column 'SEM (kPa)'" in text for text in tq.inspect(file).warnings)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"mean_of": 1}, "must be a number of specimens, 2 or more"),
        ({"mean_of": 6}, "no column is recognised as such"),
        ({"columns": {"sd": "w"}}, "give the number of specimens"),
        ({"columns": {"sem": "below"}}, "is negative, which no standard error is"),
        ({"columns": {"sd": "w", "n": "below"}}, "holds no numbers of specimens"),
    ],
)
def test_options_that_cannot_be_used_are_refused(tmp_path, options, words):
    file = by_name(tmp_path, **{"Stretch": STRETCH, "Stress (kPa)": STRESS, "w": SPREAD, "below": -SPREAD})
    assert words in message(file, **options)


def test_inspect_shows_the_column_and_the_error(tmp_path):
    file = by_name(tmp_path, **{"Stretch": STRETCH, "Stress (kPa)": STRESS, "SD (kPa)": 0.1 * STRESS})
    text = str(tq.inspect(file, mean_of=6))
    assert "'SD (kPa)' is standard deviation of the stress" in text
    assert f"error     {0.1 * OF_SIX / 6**0.5:.2g} of the stress (standard error of the mean)" in text
    assert "/ sqrt(n) x t(n - 1)/1.96 (Student's t at 97.5 %), n = 6 (as given)" in " ".join(text.split())


@pytest.mark.parametrize(
    ("quantity", "kind"),
    [
        ("sd", "sd"), ("std", "sd"), ("std dev", "sd"), ("stdev", "sd"), ("stddev", "sd"), ("standardabweichung", "sd"),
        ("desviación estándar", "sd"), ("标准差", "sd"), ("s.d.", "sd"), ("std error", "sem"), ("stderr", "sem"),
        ("erreur type", "sem"), ("standard error of the mean", "sem"), ("±", "open"), ("+/", "open"),
        ("standardkraft", ""), ("standard force", ""), ("stress", ""), ("sdx", ""), ("displacement", ""),
    ],
)  # fmt: skip
def test_words_for_spreads_are_known_in_several_languages(quantity, kind):
    assert of_spread(quantity)[0] == kind


@pytest.mark.parametrize(
    ("error", "words"),
    [
        ([0.1, 0.2], "one standard error for every stress"),
        ([-0.1, 0.1, 0.1], "none negative"),
        ([0.1, np.nan, 0.1], "nan"),
    ],
)
def test_standard_errors_that_are_none_are_refused_in_python(error, words):
    with pytest.raises(InputError, match=words):
        tq.Experiment("uniaxial", [1.0, 1.1, 1.2], [0.0, 0.1, 0.2], standard_error=error)


def test_python_takes_standard_errors_in_the_unit_of_the_stresses_and_joins_them():
    both = [[1.1, 1.0], [1.2, 1.1]]
    data = tq.Experiment("biaxial", both, both, stress_unit="kPa", standard_error=[[1.0, 2.0], [3.0, 4.0]])
    assert data.standard_error.tolist() == [0.001, 0.003, 0.002, 0.004]
    assert data.joined(tq.Experiment("biaxial", both, both)).standard_error.tolist() == [
        0.001, 0.003, 0.0, 0.0, 0.002, 0.004, 0.0, 0.0
    ]  # fmt: skip


@pytest.mark.parametrize("sign", [" ± ", "±", " +/- ", " +- "])
@pytest.mark.parametrize(
    ("name", "options", "error"),
    [
        ("Stress, mean ± SEM [kPa]", {}, SPREAD * 1e-3),
        ("Stress (kPa) ± SE", {}, SPREAD * 1e-3),
        ("Stress ± SD (kPa)", {"mean_of": 6}, SPREAD * 1e-3 * OF_SIX / 6**0.5),
        ("Stress (mean ± std dev) (kPa)", {"mean_of": 6}, SPREAD * 1e-3 * OF_SIX / 6**0.5),
    ],
)
def test_a_mean_and_its_spread_may_stand_in_one_cell(tmp_path, sign, name, options, error):
    rows = zip(STRETCH, STRESS, SPREAD, strict=True)
    lines = [f"Stretch;{name}", *(f"{stretch:.12g};{mean:.12g}{sign}{spread:.12g}" for stretch, mean, spread in rows)]
    (path := tmp_path / "test.csv").write_text("\n".join(lines), encoding="utf-8")
    data = read_experiment(path, **options)
    np.testing.assert_allclose(data.stress, STRESS * 1e-3, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(data.standard_error, error, rtol=1e-9)


def test_a_spread_in_the_cell_of_a_mean_that_says_not_what_it_is_is_asked_about(tmp_path):
    rows = zip(STRETCH, STRESS, SPREAD, strict=True)
    lines = ["Stretch,Stress (kPa)", *(f"{stretch:.12g},{mean:.12g} ± {spread:.12g}" for stretch, mean, spread in rows)]
    (path := tmp_path / "test.csv").write_text("\n".join(lines), encoding="utf-8")
    with pytest.warns(UserWarning, match=r'columns=\{"sem": "stress ± \(kPa\)"\}'):
        data = read_experiment(path)
    np.testing.assert_allclose(data.stress, STRESS * 1e-3, rtol=1e-9, atol=1e-15)
    assert not data.standard_error.any()
    data = read_experiment(path, columns={"sem": "stress ± (kPa)"})
    np.testing.assert_allclose(data.standard_error, SPREAD * 1e-3, rtol=1e-9)
