"""Tables in memory are read as files with the same cells are."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pint
import pytest
import xarray as xr

import tissuq as tq
from tissuq.experiments.reading.options import PARTS
from tissuq.experiments.reading.tables import read_table
from tissuq.experiments.reading.vocabulary import DIMENSION_NAMES, ROLES_OF_TUBE

Q = pint.UnitRegistry().Quantity
STRETCH = np.r_[np.linspace(1, 1.3, 14), np.linspace(1.28, 1, 14)]
STRESS = 100 * (STRETCH - STRETCH**-2)  # kPa
FRAME = pd.DataFrame(
    {
        "t (s)": np.arange(28) / 3,
        "lambda": STRETCH,
        "P [kPa]": STRESS,
        "true stress [kPa]": STRESS * STRETCH,
        "position (mm)": 20 * (STRETCH - 1),
        "Force (mN)": STRESS * 8,
        "cycle": np.repeat([1, 2], 14),
        "Specimen": ["A"] * 28,
    }
)
DIMENSIONS = {"length": "20 mm", "area": "8 mm2"}
TWO = pd.concat([FRAME, FRAME.assign(Specimen="B", **{"P [kPa]": 2 * STRESS})], ignore_index=True)
READINGS = {
    "names": (FRAME[["lambda", "P [kPa]"]], {}),
    "role": (FRAME, {"stress": "P [kPa]"}),
    "number": (FRAME, {"stress": 3, "stretch": "lambda", "branch": "loading", "every": 2}),
    "unit": (FRAME[["lambda"]].assign(stress=STRESS), {"unit": "kPa"}),
    "strain": (FRAME[["P [kPa]"]].assign(**{"strain (%)": 100 * (STRETCH - 1)}), {"mode": "planar", "cycle": "last"}),
    "force": (FRAME[["position (mm)", "Force (mN)"]], DIMENSIONS | {"preload": "0.02 N"}),
    "cauchy": (FRAME, {"stress": "true stress [kPa]", "stress_type": "cauchy"}),
    "peak": (FRAME, {"stress": "P [kPa]", "until_peak": True}),
    "only": (TWO, {"stress": "P [kPa]", "only": {"Specimen": "B"}}),
}


@pytest.mark.parametrize("name", READINGS)
def test_a_data_frame_is_read_as_the_file_of_it_is_to_the_last_bit(name, tmp_path):
    frame, options = READINGS[name]
    frame.to_csv(tmp_path / "test.csv", index=False)
    data, of_file = tq.read(frame, **options), tq.read(tmp_path / "test.csv", **options)
    assert data.has_measurements_of(of_file)
    assert (data.stress_unit, len(data)) == ("kPa", len(of_file))
    rows = of_file.source.count("lines"), data.source.count("rows (rows")
    assert rows == (1 + of_file.source.count("between lines"), 1)


def test_options_by_themselves_are_those_of_columns_dimensions_and_unit():
    frame = FRAME[["position (mm)", "Force (mN)"]].set_axis(["u", "F"], axis=1)
    units = {"force_unit": "mN", "displacement_unit": "mm"}
    columns = {"displacement": "u", "force": "F"}
    short = tq.read(frame, **columns, length="20 mm", width="4 mm", thickness="2 mm", **units)
    long = tq.read(frame, columns=columns, dimensions={"length": "20 mm", "area": "8 mm2"}, **units)
    assert short.has_measurements_of(long)
    np.testing.assert_allclose(short.stress, STRESS * 1e-3, rtol=1e-12)


def test_indices_and_levels_of_names_and_rows_of_units_are_read():
    expected = tq.Experiment("uniaxial", STRETCH, STRESS, stress_unit="kPa")
    levels = pd.MultiIndex.from_tuples([("Stretch", "Unnamed: 0_level_1"), ("Stress", "[kPa]")])
    unit_row = pd.DataFrame(
        [["-", "kPa"], *zip(map(str, STRETCH), map(str, STRESS), strict=True)], columns=["λ", "Stress"]
    )
    for table in (
        FRAME.set_index("lambda")["P [kPa]"],
        FRAME[["lambda", "P [kPa]"]].set_index("lambda"),
        pd.DataFrame(np.column_stack([STRETCH, STRESS]), columns=levels),
        FRAME[["lambda", "P [kPa]"]].convert_dtypes(),
        unit_row,
    ):
        assert tq.read(table).has_measurements_of(expected)


def test_units_of_pint_and_of_xarray_are_those_of_the_columns():
    expected = tq.Experiment("uniaxial", STRETCH, STRESS, stress_unit="kPa")
    dataset = xr.Dataset(
        {"stress": ("row", STRESS, {"units": "kPa"})},
        {"stretch": ("row", STRETCH, {"units": "dimensionless"})},
    )
    for table in (
        dataset,
        dataset["stress"],
        {"stretch": STRETCH, "stress": Q(STRESS, "kPa")},
        {"stretch": Q(STRETCH, "dimensionless"), "stress": Q(STRESS, "kN/m**2")},
    ):
        data = tq.read(table)
        assert data.has_measurements_of(expected)
    force = {"displacement": Q(20 * (STRETCH - 1), "mm"), "force": Q(STRESS * 8, "mN")}
    by_force = tq.read(force, length=Q(2.0, "cm"), area=Q(0.08, "cm**2"))
    np.testing.assert_allclose(by_force.stress, STRESS * 1e-3, rtol=1e-12)


def test_all_tests_in_a_data_frame_are_read():
    first, second = tq.read_tests(TWO, stress="P [kPa]", branch="loading")
    assert (first.name, second.name) == ("A", "B")
    assert first.has_measurements_of(tq.read(FRAME, stress="P [kPa]", branch="loading"))
    np.testing.assert_allclose(second.stress, 2 * first.stress, rtol=1e-12)


def test_a_data_frame_of_polars_is_read_as_that_of_pandas():
    polars = pytest.importorskip("polars", reason="polars is not installed")
    frame = polars.DataFrame({name: FRAME[name].tolist() for name in FRAME})
    for table in (frame, frame.lazy()):
        assert tq.read(table, stress="P [kPa]").has_measurements_of(tq.read(FRAME, stress="P [kPa]"))


def test_quantities_in_a_data_frame_are_read_with_their_units():
    pytest.importorskip("pint_pandas", reason="pint-pandas is not installed")
    frame = pd.DataFrame({"stretch": STRETCH, "stress": pd.Series(STRESS, dtype="pint[kPa]")})
    assert tq.read(frame).has_measurements_of(tq.Experiment("uniaxial", STRETCH, STRESS, stress_unit="kPa"))


@pytest.mark.slow
def test_a_long_data_frame_is_taken_as_numbers_and_many_gaps_in_it_are_refused():
    values = np.random.default_rng(1).random((20_000, 3))
    frame = pd.DataFrame(values, columns=["time", "stretch", "stress"])
    assert np.array_equal(np.column_stack(read_table(frame).numbers([0, 1, 2])), values)
    assert np.array_equal(np.column_stack(read_table(frame.assign(name="a")).numbers([0, 1, 2])), values)
    frame.loc[12_345::2, "stress"] = np.nan
    with pytest.raises(tq.InputError, match=r"^DataFrame, row 12345, column 'stress': 'nan' is not a finite number"):
        tq.read(frame, unit="kPa")


@pytest.mark.parametrize(
    ("data", "options", "message"),
    [
        (None, {}, r"measurements are needed: .*Not None"),
        (42, {}, r"measurements are needed: .*Not 42"),
        (
            "rubber-treloar-planar",
            {},
            r"no such file\. The data set .*tissuq\.datasets\.load\('rubber-treloar-planar'\)",
        ),
        ([1.0, 1.1], {}, r"measurements are needed: .*Not 1\.0"),
        (np.eye(2), {}, r"measurements are needed: .*makes of arrays"),
        (FRAME[["lambda"]], {}, r"^DataFrame: expected a column of stretches and one of stresses"),
        (FRAME[:0], {}, r"rows: 0"),
        ({"stretch": [1.0, 1.1], "stress": [0.0]}, {}, r"^table: the columns differ in length: 'stretch' has 2"),
        ({"stretch": [1.0, 1.1], "stress": [[0.0]]}, {}, r"'stress' must be one-dimensional"),
        (FRAME, {"strech": "lambda"}, r"no option 'strech'. Did you mean 'stretch'"),
        (FRAME, {"matreial": "gent"}, r"no option 'matreial'. Did you mean 'material'"),
        (FRAME, {"estimand": "as-tested"}, r"no option 'estimand'. Did you mean 'tolerances'"),
        (FRAME, {"stress": STRESS}, r"stress must be the name of a column.*not of type ndarray"),
        (FRAME, {"displacement": "position (mm)", "length": 20}, r"the length '20' has no unit"),
        (FRAME, {"unit": "kPa", "stress_unit": "kPa"}, r"unit and stress_unit are the same"),
        (FRAME, {"stress": "P [kPa]", "columns": {"stress": "x"}}, r"stress is given by itself and in columns"),
        (FRAME, {"sheet": 1}, r"^DataFrame is no file: leave sheet, table and skip_rows out"),
        (tq.Experiment("uniaxial", STRETCH, STRESS), {"unit": "kPa"}, r"^unit: .*which has been read"),
    ],
)
def test_what_cannot_be_fitted_is_said_in_one_message(data, options, message):
    with pytest.raises(tq.InputError, match=message):
        tq.fit(data, **options)


def test_several_tests_in_a_table_are_fitted_together():
    with pytest.raises(tq.InputError, match="names several tests: 'A', 'B'"):
        tq.read(TWO, stress="P [kPa]")
    posterior = tq.fit(TWO, stress="P [kPa]", discrepancy="none", noise_sd="0.05 kPa")
    assert [test.name for test in posterior.model.experiment.tests] == ["A", "B"]
    apart = tq.fit(tq.read_tests(TWO, stress="P [kPa]"), discrepancy="none", noise_sd="0.05 kPa")
    assert posterior.marginals["C10"].mean == apart.marginals["C10"].mean


def test_all_tests_of_a_table_say_what_was_assumed():
    table = {"stretch": [1.0, 1.1, 1.2], "stress": [0.0, 20.0, 40.0]}
    with pytest.warns(UserWarning, match="MPa was assumed"):
        tq.read_tests(table)


def test_an_inspection_of_a_data_frame_speaks_of_its_rows():
    text = str(tq.inspect(FRAME, stress="P [kPa]"))
    assert "table     8 columns; rows 0 to 27, counted from 0" in text
    assert "'P [kPa]' is stress" in text
    assert "rows 0 to 27)" in text
    assert "lines" not in text


@pytest.mark.parametrize("is_file", [True, False])
def test_a_fit_of_files_and_tables_is_that_of_their_experiments(is_file, tmp_path):
    FRAME.to_csv(tmp_path / "test.csv", index=False)
    data, options = tmp_path / "test.csv" if is_file else FRAME, {"stress": "P [kPa]", "branch": "loading"}
    expected = tq.fit(tq.read(FRAME, **options), discrepancy="none", noise_sd=1e-3)
    found = tq.fit(data, discrepancy="none", noise_sd=1e-3, **options)
    assert found.marginals["C10"].mean == expected.marginals["C10"].mean
    laws = tq.fit_laws(data, ["neo-hookean"], discrepancy="none", noise_sd=1e-3, **options)
    assert laws.fits["neo-hookean"].marginals["C10"].mean == expected.marginals["C10"].mean
    (of_many,) = tq.fit_many([[data]], discrepancy="none", noise_sd=1e-3, **options)
    assert of_many.marginals["C10"].mean == expected.marginals["C10"].mean


def test_every_role_of_a_tube_and_every_dimension_is_an_option_of_its_own():
    assert PARTS.keys() >= {*ROLES_OF_TUBE, *DIMENSION_NAMES}


def test_cells_with_their_unit_are_read_as_those_of_a_file():
    cells = {"stretch": [1.0, 1.1, 1.2], "stress": ["0 kPa", "1.2 kPa", "2.5 kPa"]}
    with pytest.warns(UserWarning, match="read as numbers in kPa"):
        assert tq.read(cells).stress.tolist() == pytest.approx([0, 0.0012, 0.0025])


@pytest.mark.parametrize("reader", [tq.read, tq.read_tests, tq.inspect])
@pytest.mark.parametrize("data", [None, 3, [FRAME]])
def test_what_is_neither_file_nor_table_is_refused(reader, data):
    with pytest.raises(tq.InputError, match=r"a file \('test.csv'\) or a table .* is needed, not "):
        reader(data)
