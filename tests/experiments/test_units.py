import subprocess
import sys

import pytest

import tissuq as tq
from tissuq.errors import InputError
from tissuq.experiments import units
from tissuq.experiments.units import FORCE, LENGTH, looks_like_unit, strain_factor, stress_unit
from written_files import text_file

MPA = {
    "MPa": 1.0,
    "kPa": 1e-3,
    "Pa": 1e-6,
    "GPa": 1e3,
    "hPa": 1e-4,
    "KPa": 1e-3,
    "kpa": 1e-3,
    "KPA": 1e-3,
    "Mpa": 1.0,
    "MPA": 1.0,
    "mpa": 1.0,
    " kPa ": 1e-3,
    "N/mm2": 1.0,
    "N/mm^2": 1.0,
    "N/mm**2": 1.0,
    "N/mm²": 1.0,
    "N / mm²": 1.0,
    "N·mm⁻²": 1.0,
    "N.mm-2": 1.0,
    "N mm^-2": 1.0,
    "mN/mm2": 1e-3,
    "µN/µm²": 1.0,
    "kN/m2": 1e-3,
    "kgf/cm2": 0.0980665,
    "kgf/cm^2": 0.0980665,
    "kp/cm2": 0.0980665,
    "gf/mm2": 9.80665e-3,
    "psi": 4.4482216152605 / 25.4**2,
    "lbf/in2": 4.4482216152605 / 25.4**2,
    "ksi": 4.4482216152605e3 / 25.4**2,
    "dyn/cm2": 1e-7,
    "dyne/cm^2": 1e-7,
    "bar": 0.1,
    "atm": 0.101325,
    "mmHg": 1.33322387415e-4,
    "mm Hg": 1.33322387415e-4,
    "Torr": 0.101325 / 760,
    "kilopascal": 1e-3,
    "mJ/mm3": 1.0,
}


@pytest.mark.parametrize(("text", "factor"), MPA.items())
def test_a_stress_unit_is_converted_to_mpa(text, factor):
    assert stress_unit(text).to_mpa == pytest.approx(factor, rel=1e-9)


def test_a_stress_unit_keeps_the_spelling_of_the_user():
    assert stress_unit("N/mm²").name == "N/mm²"


@pytest.mark.parametrize(
    ("unit", "largest", "shown"),
    [("MPa", 0.11, "MPa"), ("MPa", 0.09, "kPa"), ("N/mm2", 0.002, "kPa"), ("MPa", 9e-5, "Pa"), ("kPa", 2e-4, "kPa"),
     ("kPa", 9e-5, "Pa"), ("Pa", 1e-9, "Pa"), ("psi", 1e-5, "psi"), ("MPa", 0.0, "MPa"), ("MPa", 9e-8, "MPa")],
)  # fmt: skip
def test_small_stresses_are_read_in_a_smaller_unit(unit, largest, shown):
    readable = stress_unit(unit).readable(largest)
    assert readable.name == shown
    assert readable.to_mpa == stress_unit(shown).to_mpa


def test_the_millipascal_must_be_written_in_full():
    assert stress_unit("millipascal").to_mpa == pytest.approx(1e-9)
    with pytest.raises(InputError, match="write MPa for megapascal, or millipascal in full"):
        stress_unit("mPa")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("N", "'N' is a force, not a stress.*undeformed cross-section"),
        ("mm", "'mm' is not a unit of stress"),
        ("%", "'%' is not a unit of stress"),
        ("MPa/s", "'MPa/s' is not a unit of stress"),
        ("degC", "'degC' is not a unit of stress"),
        ("g/cm2", "'g/cm2' is a mass over an area.*gf/mm2"),
        ("kg/cm^2", "'kg/cm\\^2' is a mass over an area.*kgf/cm2"),
        ("furlongs per fortnight", "'furlongs per fortnight' is not a unit of stress"),
        ("nominal", "the unit 'nominal' is not known.*kPa"),
        ("10 kPa", "the unit '10 kPa' is not known"),
        ("", "the unit '' is not known"),
        ("((", "is not known"),
        ("MPa" * 100, "is not known"),
    ],
)
def test_what_is_not_a_stress_is_refused(text, words):
    with pytest.raises(InputError, match=words):
        stress_unit(text)


@pytest.mark.parametrize(
    ("text", "factor"),
    [
        *[("", 1), ("1", 1), ("-", 1), ("mm/mm", 1), ("mm / mm", 1), ("%", 0.01), ("percent", 0.01), ("‰", 0.001)],
        *[("\N{MICRO SIGN}ε", 1e-6), ("\N{GREEK SMALL LETTER MU}ε", 1e-6), ("microstrain", 1e-6)],
        *[("mε", 1e-3), ("millistrain", 1e-3), ("permille", 1e-3), ("mm/m", 1e-3)],
    ],
)
def test_a_strain_unit_is_converted_to_a_ratio(text, factor):
    assert strain_factor(text) == factor


def test_an_unknown_strain_unit_is_refused():
    with pytest.raises(InputError, match="'mm' is not a unit of strain; write '%', or '1'"):
        strain_factor("mm")


@pytest.mark.parametrize("text", ["[anything]", "(kPa)", "N/mm²", "mm/min", "s", "%", "°C", "1/s", "-", "1", ""])
def test_cells_of_a_units_row_look_like_units(text):
    assert looks_like_unit(text)


@pytest.mark.parametrize(
    "quantity", [units.LENGTH, units.FORCE, units.TORQUE, units.PRESSURE, units.ANGLE, units.TIME], ids=lambda q: q.name
)
def test_every_unit_that_is_converted_looks_like_one(quantity):
    assert all(map(looks_like_unit, quantity.factors))


@pytest.mark.parametrize(
    ("cells", "stretch", "stress"),
    [
        ("microstrain,kilopascals", 1.001, 2e-3),
        ("µε,kPa", 1.001, 2e-3),
        ("permille,Megapascal", 2.0, 2.0),
        ("Millistrain,N/mm2", 2.0, 2.0),
    ],
)
def test_a_row_of_units_in_words_stands_beneath_the_names(tmp_path, cells, stretch, stress):
    path = text_file(tmp_path / "test.csv", f"strain,stress\n{cells}\n0,0\n500,1\n1000,2")
    data = tq.read(path)
    assert data.stretch[-1] == pytest.approx(stretch)
    assert data.stress[-1] == pytest.approx(stress)


def test_forces_and_displacements_have_units_in_words(tmp_path):
    path = text_file(tmp_path / "test.csv", "Displacement,Force\nmillimeters,Millinewtons\n0,0\n0.5,1\n1,2")
    data = tq.read(path, length="10 mm", area="2 mm2")
    assert data.stretch[-1] == pytest.approx(1.1)
    assert data.stress[-1] == pytest.approx(1e-3)


@pytest.mark.parametrize("text", ["stress", "Time", "lambda", "A17", "n/a", "0.5", "--", "start"])
def test_names_and_values_do_not_look_like_units(text):
    assert not looks_like_unit(text)


def test_common_units_need_no_units_library():
    code = (
        "import sys; from tissuq.experiments.units import stress_unit\n"
        "for unit in ['MPa', 'kPa', 'Pa', 'KPa', 'N/mm2', 'N/mm²', 'psi']: stress_unit(unit)\n"
        "sys.exit('pint' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize("unit", ["9**9**9*Pa", "Pa**9**9", "9^9^9^9 Pa", "(9**9)**9*Pa", "Pa*99**99999999"])
def test_arithmetic_of_numbers_in_a_unit_is_not_carried_out(unit, monkeypatch):
    monkeypatch.setattr("tissuq.experiments.pint_units._pint_registry", lambda: pytest.fail("it was evaluated"))
    with pytest.raises(InputError, match="is not known"):
        stress_unit(unit)


@pytest.mark.parametrize(
    ("quantity", "text", "factor"),
    [
        *[(LENGTH, text, 1e-3) for text in ("micron", "Microns", "µm", "micrometre")],
        *[(LENGTH, text, 25.4) for text in ("in", "inch", "Inches")],
        *[(FORCE, text, 0.45359237 * 9.80665) for text in ("lbf", "lbF", "LBF")],
        *[(FORCE, text, 9.80665) for text in ("kgf", "KGF")],
        *[(FORCE, text, factor) for text, factor in (("mN", 1e-3), ("kN", 1e3), ("newtons", 1.0))],
    ],
)
def test_other_spellings_of_units_have_their_size(quantity, text, factor):
    assert quantity.factor(text) == pytest.approx(factor, rel=1e-12)


def test_capital_letters_tell_prefixes_apart():
    assert FORCE.factor_or_none("MN") is None
    assert LENGTH.factor_or_none("MM") is None
