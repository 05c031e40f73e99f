"""Every card, read as its code's manual says, has the stress of the draw it was written from."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

import tissuq as tq
from card_readers import PATHS, READERS, stress
from marks import slow_but
from tissuq.export import CardSettings, FECode, card_format, card_formats

STRETCH = {"uniaxial": [0.7, 0.9, 1.2, 1.9], "equibiaxial": [0.8, 1.1, 1.3], "planar": [0.7, 1.2, 1.6]}
POLYNOMIALS = [
    ("neo-hookean", [0.5]),
    ("mooney-rivlin", [0.3, 0.2]),
    ("yeoh", [0.5, -0.02, 0.004]),
    ("isihara", [0.3, 0.1, 0.05]),
    ("biderman", [0.3, 0.1, 0.05, -0.01]),
]
OGDEN = [
    ("ogden-1", [0.9, -8.0]),
    ("ogden-2", [0.9, 0.2, 3.0, -4.0]),
    ("ogden-3", [0.4, 0.02, 0.1, 1.3, 5.0, -2.0]),
]
KEYWORDS = {
    "abaqus": [
        "NEO HOOKE", "MOONEY-RIVLIN", "YEOH", "POLYNOMIAL, N=2", "POLYNOMIAL, N=3",
        "OGDEN, N=1", "OGDEN, N=2", "OGDEN, N=3",
    ],
    "ansys": ["NEO", "MOONEY", "YEOH", "MOONEY", "MOONEY", "OGDEN", "OGDEN", "OGDEN"],
    "febio": ["Mooney-Rivlin", "Mooney-Rivlin", "Yeoh", None, None, "Ogden", "Ogden", "Ogden"],
    "ls-dyna": ["*MAT_HYPERELASTIC_RUBBER_TITLE"] * 5 + ["*MAT_OGDEN_RUBBER_TITLE"] * 3,
}  # fmt: skip
KEYWORDS["calculix"] = KEYWORDS["abaqus"]
MORE = [
    ("abaqus", [("rivlin:C10,C20", [0.5, 0.1])], "REDUCED POLYNOMIAL, N=2"),
    ("abaqus", [("rivlin:C10,C01,C11", [0.3, 0.1, 0.02])], "POLYNOMIAL, N=2"),
    ("abaqus", [("rivlin:C10,C12", [0.3, 0.02])], "POLYNOMIAL, N=3"),
    ("abaqus", [("ogden-5", [0.2, 0.1, 0.1, 0.1, 0.1, 0.7, 2.0, 6.0, -1.0, -4.0])], "OGDEN, N=5"),
    ("abaqus", [("van-der-waals", [0.9, 0.2, 30.0])], "VAN DER WAALS"),
    ("abaqus", [("ogden-1+mooney-rivlin", [0.9, -8.0, 0.2, 0.1])], "OGDEN, N=3"),
    ("abaqus", [("neo-hookean", [0.5]), ("yeoh", [0.0, 0.04, 0.01])], "YEOH"),
    ("calculix", [("mooney-rivlin", [0.3, 0.1]), ("yeoh", [0.0, 0.04, 0.01])], "POLYNOMIAL, N=3"),
    ("ansys", [("rivlin:C10,C20,C40", [0.5, 0.04, 0.001])], "YEOH"),
    ("ansys", [("gent", [0.9, 30.0])], "GENT"),
    ("febio", [("gent", [0.9, 30.0])], "Gent"),
    ("febio", [("veronda-westmann", [0.9, 0.4])], "Veronda-Westmann"),
    ("ls-dyna", [("rivlin:C10,C11,C02", [0.5, 0.04, 0.001])], "*MAT_HYPERELASTIC_RUBBER_TITLE"),
]
CASES = [
    (code, [part], keyword)
    for code, keywords in KEYWORDS.items()
    for part, keyword in zip(POLYNOMIALS + OGDEN, keywords, strict=True)
    if keyword
] + MORE
CODES = [name for name, kind in card_formats().items() if issubclass(kind, FECode)]


def relative_errors(ensemble, cards, code, factor=1.0):
    """Return the largest relative difference of stress of every card from its draw."""
    found = []
    for draw, text in zip(ensemble, cards.files.values(), strict=True):
        read = READERS[code](text)
        apart = []
        for mode, stretch in STRETCH.items():
            truth = factor * tq.engineering_stress(draw, tq.loading_modes()[mode](), stretch, ())
            apart.append(np.abs(stress(read.energy, mode, np.array(stretch)) / truth - 1).max())
        found.append(max(apart))
    return np.array(found)


def test_every_code_is_read_here():
    assert set(CODES) == set(READERS) == set(KEYWORDS)


@pytest.mark.parametrize(("code", "parts", "keyword"), CASES, ids=lambda each: str(each)[:40])
def test_a_law_that_the_code_has_is_written_exactly(given, code, parts, keyword):
    less = [(name, [values[0] * 0.8, *values[1:]]) for name, values in parts]
    ensemble = given(parts, less)
    cards = card_format(code).cards(ensemble, CardSettings())
    assert [READERS[code](text).law for text in cards.files.values()] == [keyword] * 2
    assert relative_errors(ensemble, cards, code).max() < 1e-8
    assert "exactly" in cards.warnings[0]
    assert all(row["error_states_max"] < 1e-8 for row in cards.index)


def test_the_bulk_modulus_of_a_mixture_is_its_own_and_not_of_its_solids(given):
    ensemble = given([("rivlin:C10,C20+ogden-2", [0.4, 0.05, 0.1, 1.3, 0.05, 5.0])])
    cards = card_format("febio").cards(ensemble, CardSettings(law="mixture", bulk_modulus=700.0))
    (read,) = map(READERS["febio"], cards.files.values())
    assert read.law == "uncoupled solid mixture"
    assert read.bulk == pytest.approx(700, rel=1e-6)


@pytest.mark.parametrize(("code", "name"), [("abaqus", "van-der-waals"), ("ansys", "gent")])
def test_the_volumetric_energy_that_is_stated_is_that_of_the_form(given, code, name):
    """Both manuals give these two laws another volumetric energy than the rest, with the same bulk modulus."""
    values = {"van-der-waals": [0.9, 0.2, 30.0], "gent": [0.9, 30.0]}[name]
    (text,) = card_format(code).cards(given([(name, values)]), CardSettings()).files.values()
    assert "((J^2 - 1)/2 - ln J)" in " ".join(text.split())


@pytest.mark.parametrize("code", CODES)
def test_a_unit_scales_stresses_and_nothing_else(given, code):
    ensemble = given([("ogden-2", [0.9, 0.2, 3.0, -4.0])])
    for unit, factor in (("kPa", 1e3), ("Pa", 1e6)):
        cards = card_format(code).cards(ensemble, CardSettings(unit=unit, bulk_modulus=700.0 * factor))
        assert relative_errors(ensemble, cards, code, factor).max() < 1e-8
        assert READERS[code](cards.files["draw-1" + card_format(code).suffix]).bulk == pytest.approx(
            700 * factor, rel=1e-6
        )
        assert cards.index[0]["mu1"] == pytest.approx(0.9 * factor)
        assert cards.index[0]["alpha1"] == 3.0
        assert cards.index[0]["initial_shear_modulus"] == pytest.approx(1.1 * factor)


@pytest.mark.parametrize("code", CODES)
def test_the_bulk_modulus_is_that_of_all_draws_or_follows_from_poissons_ratio(given, code):
    ensemble = given([("yeoh", [0.5, 0.1, 0.0])], [("yeoh", [0.7, 0.1, 0.0])])

    def bulk(**settings):
        cards = card_format(code).cards(ensemble, CardSettings(**settings))
        return [READERS[code](text).bulk for text in cards.files.values()]

    assert bulk() == pytest.approx([1200.0] * 2, rel=1e-5)  # 1000 times the mean of 1.0 and 1.4 MPa
    assert bulk(bulk_modulus=50.0) == pytest.approx([50.0] * 2, rel=1e-6)
    nu = 0.49
    wanted = [2 * mu * (1 + nu) / (3 * (1 - 2 * nu)) for mu in (1.0, 1.4)]
    assert bulk(poisson=nu) == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize(
    ("code", "name"),
    slow_but(
        [
            *((code, "hencky") for code in CODES),
            *(("abaqus", name) for name in ("demiray", "arruda-boyce", "gent+mooney-rivlin")),
        ],
        product(CODES, ["demiray", "arruda-boyce", "hencky", "gent+mooney-rivlin"]),
    ),
)
def test_a_law_that_no_code_has_is_never_called_exact(given, code, name):
    values = {"demiray": [1.0, 0.5], "arruda-boyce": [1.0, 30.0], "hencky": [1.0]}.get(name, [0.5, 30.0, 0.1, 0.1])
    cards = card_format(code).cards(given([(name, values)]), CardSettings())
    assert "nearest" in cards.warnings[0]
    (text,) = cards.files.values()
    assert "PROJECTION" in text


@pytest.mark.slow
@pytest.mark.parametrize("code", CODES)
def test_every_file_says_where_it_comes_from(auto, code):
    cards = card_format(code).cards(auto, CardSettings(source="run -- brain", unit="kPa", name="CORTEX"))
    assert len(cards.files) == len(cards.index) == len(auto)
    for number, (name, text) in enumerate(cards.files.items(), start=1):
        plain = " ".join(text.split())
        for words in (
            f"draw {number} of 6", "run - brain", "kPa", "CORTEX", "0.7 to 2", "admissible", "neo-hookean",
            "discrepancy auto", "PROJECTION", "extrapolation", "bulk modulus",
        ):  # fmt: skip
            assert words in plain, words
        assert cards.index[number - 1]["file"] == name
        READERS[code](text)


def test_calculix_is_not_given_what_it_would_replace(given):
    ensemble = given([("neo-hookean", [0.5])])
    assert card_format("abaqus").cards(ensemble, CardSettings(bulk_modulus=1e11)).files
    with pytest.raises(tq.InputError, match=r"too small for CalculiX.*larger unit"):
        card_format("calculix").cards(ensemble, CardSettings(bulk_modulus=1e11))


def test_numbers_fit_in_the_places_that_calculix_reads(auto):
    for text in card_format("calculix").cards(auto, CardSettings()).files.values():
        rows = [line.split(",") for line in text.splitlines() if not line.startswith("*")]
        assert max(len(word.strip()) for row in rows for word in row) <= 20


def test_draws_without_stiffness_have_no_card(given):
    with pytest.raises(tq.InputError, match="not positive"):
        card_format("abaqus").cards(given([("neo-hookean", [-0.5])]), CardSettings())


def test_a_draw_without_stiffness_has_no_bulk_modulus_by_poissons_ratio(given):
    ensemble = given([("neo-hookean", [0.5])], [("neo-hookean", [-0.1])])
    assert len(card_format("abaqus").cards(ensemble, CardSettings(bulk_modulus=3.0)).files) == 2
    with pytest.raises(tq.InputError, match="--bulk-modulus"):
        card_format("abaqus").cards(ensemble, CardSettings(poisson=0.49))


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"unit": "psi"}, "MPa, kPa, Pa"),
        ({"bulk_modulus": 1.0, "poisson": 0.4}, "not both"),
        ({"bulk_modulus": 0.0}, "must be positive"),
        ({"poisson": 0.5}, "between 0 and 0.5"),
        ({"order": 3}, "give the law"),
        ({"name": "my tissue"}, "cannot name a material"),
        ({"name": "2nd"}, "a letter first"),
    ],
)
def test_settings_without_meaning_are_refused(settings, words):
    with pytest.raises(tq.InputError, match=words):
        CardSettings(**settings)


@pytest.mark.parametrize(
    ("code", "settings", "words"),
    [
        ("febio", {"law": "polynomial"}, "mixture, ogden, reduced-polynomial"),
        ("abaqus", {"law": "gent"}, "no law 'gent'"),
        ("calculix", {"law": "ogden", "order": 4}, "another order"),
        ("abaqus", {"law": "polynomial", "order": 9}, "from 1 to 4"),
        ("abaqus", {"law": "ogden", "order": 0}, "from 1 to 8"),
    ],
)
def test_laws_that_a_code_has_not_are_refused(auto, code, settings, words):
    with pytest.raises(tq.InputError, match=words):
        card_format(code).cards(auto, CardSettings(**settings))


def test_an_unknown_format_is_refused_with_those_there_are():
    with pytest.raises(tq.InputError, match=r"'abacus'.*Did you mean 'abaqus'.*febio"):
        card_format("abacus")


def test_the_modes_of_the_readers_are_those_of_the_index(auto):
    (row, *_) = card_format("abaqus").cards(auto, CardSettings()).index
    assert {name[len("error_") : -len("_max")] for name in row if name.endswith("_max")} == {
        *PATHS,
        "states",
        *(f"within_{reach}" for reach in ("1", "1.25", "1.5")),
    }


def test_a_bulk_modulus_near_zero_is_refused_and_a_small_one_is_warned_of(given):
    ensemble = given([("neo-hookean", [0.5])])  # an initial shear modulus of 1 MPa
    for bulk in (1e-9, 0.1, 0.66):
        with pytest.raises(tq.InputError, match=r"Poisson's ratio that is not positive.*give 20 MPa or more"):
            card_format("febio").cards(ensemble, CardSettings(bulk_modulus=bulk))
    cards = card_format("febio").cards(ensemble, CardSettings(bulk_modulus=0.7))
    assert "down to 0.7 times the initial shear modulus" in cards.warnings[-1]
    assert len(card_format("febio").cards(ensemble, CardSettings(bulk_modulus=20.0)).warnings) == 1


def test_a_material_has_the_number_that_it_has_in_the_model(given):
    ensemble, settings = given([("yeoh", [0.5, 0.1, 0.0])]), CardSettings(number=7)
    texts = {code: next(iter(card_format(code).cards(ensemble, settings).files.values())) for code in CODES}
    assert '<material id="7" name="TISSUE"' in texts["febio"]
    assert "\nTB,HYPER,7,1," in texts["ansys"]
    data = [line for line in texts["ls-dyna"].splitlines() if line[0] not in "$*"]
    assert data[1][:20].strip() == "7"
    for code, text in texts.items():
        assert READERS[code](text).law, code
    with pytest.raises(tq.InputError, match="1 or more, not 0"):
        CardSettings(number=0)
