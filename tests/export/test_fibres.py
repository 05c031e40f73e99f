"""Cards of fibres, read as the codes' manuals and sources describe them, have the stresses of the draws."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

import tissuq as tq
from card_readers import febio_solid
from febio_grammar import refusals
from one_element import CCX, FREE, calculix, reference
from tissuq.experiments.modes import Deformation
from tissuq.export import CardSettings, card_format
from tissuq.mechanics import material_named

POINTS = [(1 + a * share, 1 + b * share) for a, b in ((0.3, 0.3), (0.3, 0.1), (0.1, 0.3)) for share in (0.4, 0.7, 1)]
EXPONENTIAL = ("holzapfel-gasser-ogden", [0.02, 0.05, 2.0, 0.6])
DISPERSED = ("gasser-ogden-holzapfel", [0.02, 0.05, 2.0, 0.1, 0.6])
QUADRATIC = ("standard-reinforcing", [0.02, 0.05, 1.0])
ALONG = ("neo-hookean+exponential-fibres:one@0", [0.02, 0.05, 2.0])
TILTED = ("neo-hookean+exponential-fibres:one@30", [0.02, 0.05, 2.0])
LOADS = [(1.3, FREE, FREE), (0.85, FREE, FREE), (1.2, 1.2, FREE), (1.25, 1.0, FREE), (1.3, 0.9, FREE)]
NAMES = "uniaxial tension and compression along axis 1, equibiaxial, planar, biaxial"


@pytest.fixture(scope="module")
def given():
    """Return the function that gives an ensemble of draws of a material of fibres, for rows of its values."""
    name = "neo-hookean+standard-fibres@40"
    data = tq.simulate(name, {"C10": 0.02, "k": 0.05}, POINTS, mode="biaxial", noise_sd=2e-4, seed=1)
    like = tq.fit(data, material=name, noise_sd=2e-4, discrepancy="none").ensemble(1)

    def ensemble(material, *rows):
        parts = (((material_named(material), tuple(values)),) for values in rows)
        return replace(like, draws=tuple(tq.EnergyDraw(number, part, None) for number, part in enumerate(parts)))

    return ensemble


def abaqus(text):
    """C10, k1, k2, kappa, directions and D, as the keyword manual of Abaqus describes them."""
    lines = [line for line in text.splitlines() if not line.startswith("**")]
    assert lines[0].startswith("*ORIENTATION, NAME=TISSUE-AXES, LOCAL DIRECTIONS=")
    assert lines[1:3] == ["1., 0., 0., 0., 1., 0.", "3, 0."]
    families = int(lines[0][-1])
    vectors = [np.array([float(word) for word in line.split(",")]) for line in lines[3 : 3 + families]]
    assert lines[3 + families : 5 + families] == [
        "*MATERIAL, NAME=TISSUE", f"*ANISOTROPIC HYPERELASTIC, HOLZAPFEL, LOCAL DIRECTIONS={families}",
    ]  # fmt: skip
    c10, d, k1, k2, kappa = map(float, lines[-1].split(","))
    return c10, [(k1, k2, kappa, vector) for vector in vectors], 2 / d


def calculix_card(text):
    """The same of CalculiX's ELASTIC_FIBER, after umat_elastic_fiber.f."""
    head, keyword, *rows = [line for line in text.splitlines() if not line.startswith("**")]
    assert head == "*MATERIAL, NAME=ELASTIC_FIBER_TISSUE"
    words = [word.strip() for row in rows for word in row.split(",")]
    assert keyword == f"*USER MATERIAL, CONSTANTS={len(words)}"
    assert all(len(row.split(",")) <= 8 for row in rows)
    assert max(map(len, words)) <= 20
    c10, d, *rest = map(float, words)
    fibres = []
    for x, y, k1, k2 in np.reshape(rest, (-1, 4)):
        assert x * x + y * y <= 1  # else it stops
        fibres.append((k1, k2, 0.0, np.array([x, y, np.sqrt(1 - x * x - y * y)])))
    return c10, fibres, 2 / d


def febio(text):
    """The same of FEBio's Holzapfel-Gasser-Ogden."""
    (material,) = ElementTree.fromstring(text.encode()).find("Material")
    return febio_fibres(material)


def febio_fibres(material):
    """The same of an element of that type, after FEHolzapfelGasserOgden.cpp."""
    assert material.get("type") == "Holzapfel-Gasser-Ogden"
    known = {each.tag: float(each.text) for each in material}
    angle = np.radians(known["gamma"])
    vectors = [np.array([np.cos(angle), sign * np.sin(angle), 0.0]) for sign in (1, -1)]
    fibres = [(known["k1"], known["k2"], known["kappa"], vector) for vector in vectors]
    return known["c"] / 2, fibres, known.get("k")


READERS = {"abaqus": abaqus, "calculix": calculix_card, "febio": febio}


def energy(card, C):
    """W of the isochoric C that the codes state, from what their readers read."""
    c10, fibres, _ = card
    C = C / np.linalg.det(C) ** (1 / 3)
    total = c10 * (np.trace(C) - 3)
    for k1, k2, kappa, vector in fibres:
        strain = kappa * (np.trace(C) - 3) + (1 - 3 * kappa) * (vector @ C @ vector - 1)
        total += k1 / (2 * k2) * np.expm1(k2 * max(strain, 0.0) ** 2)
    return total


def biaxial_stresses(card, point):
    """Engineering stresses dW/dl1 and dW/dl2 of an incompressible sheet, by differences."""

    def along(one, two):
        return energy(card, np.diag([one**2, two**2, 1 / (one * two) ** 2]))

    (one, two), step = point, 1e-6
    return [
        (along(one + step, two) - along(one - step, two)) / (2 * step),
        (along(one, two + step) - along(one, two - step)) / (2 * step),
    ]


CASES = [
    *(("abaqus", case) for case in (EXPONENTIAL, DISPERSED, QUADRATIC, ALONG, TILTED)),
    *(("calculix", case) for case in (EXPONENTIAL, QUADRATIC, ALONG, TILTED)),
    *(("febio", case) for case in (EXPONENTIAL, DISPERSED, QUADRATIC, ALONG)),
]


@pytest.mark.parametrize(("code", "case"), CASES, ids=lambda each: str(each)[:30])
def test_a_card_of_fibres_has_the_stresses_of_its_draw(given, code, case):
    name, values = case
    draws = given(name, values, [0.7 * values[0], *values[1:]])
    cards = card_format(code).cards(draws, CardSettings(unit="kPa"))
    points = np.array([(1.3, 1.1), (1.05, 1.3), (1.2, 0.9), (0.9, 1.25), (0.9, 0.95)])
    paths = tq.loading_modes()["biaxial"]().paths
    for draw, text in zip(draws, cards.files.values(), strict=True):
        card = READERS[code](text)
        wanted = np.stack([1e3 * tq.engineering_stress(draw, path, points, ()) for path in paths], axis=1)
        assert np.array([biaxial_stresses(card, point) for point in points]) == pytest.approx(wanted, rel=1e-5)
        assert "axis 1 is the first local axis" in " ".join(
            word for word in text.split() if word not in ("**", "<!--", "-->")
        )
    assert "exactly" in cards.warnings[0]
    assert ("Quadratic" in " ".join(cards.warnings)) == (case is QUADRATIC)
    assert {"card_k1", "card_k2", "card_degrees", "bulk_modulus", "card_is_stable"} <= set(cards.index[0])
    families = 1 if ":one" in name else 2
    stiffness = [2e3 * row + families * 4 / 3 * 50 for row in (values[0], 0.7 * values[0])]
    assert cards.index[0]["bulk_modulus"] == pytest.approx(1e3 * np.mean(stiffness), rel=1e-3)
    assert READERS[code](text)[2] == pytest.approx(cards.index[0]["bulk_modulus"], rel=1e-6)


@pytest.mark.parametrize(
    ("code", "case", "words"),
    [
        ("calculix", DISPERSED, "without dispersion.*abaqus or febio"),
        ("febio", TILTED, "abaqus or calculix"),
        ("ansys", EXPONENTIAL, "abaqus or calculix or febio"),
        ("ls-dyna", EXPONENTIAL, r"fields of its \*MAT_295.*abaqus or calculix or febio"),
        ("abaqus", ("demiray+exponential-fibres@30", [0.02, 1.0, 0.05, 2.0]), "nothing beside.*cards for febio"),
        ("abaqus", ("demiray+exponential-fibres:one@30", [0.02, 1.0, 0.05, 2.0]), "no code here has all of it"),
        ("table", EXPONENTIAL, "W1 and W2 do not tell"),
    ],
)
def test_fibres_that_a_code_has_not_are_refused_with_the_codes_that_have_them(given, code, case, words):
    with pytest.raises(tq.InputError, match=words):
        card_format(code).cards(given(case[0], case[1]), CardSettings())


@pytest.fixture(scope="module")
def of_free_energy():
    """Return draws of fibres with the free energy of a discrepancy beside them."""
    name = "mooney-rivlin+exponential-fibres@40"
    truth = {"C10": 0.01, "C01": 0.01, "k1": 0.05, "k2": 2.0}
    data = tq.simulate(name, truth, POINTS, mode="biaxial", noise_sd=5e-4, seed=1)
    return tq.fit(data, material="neo-hookean+exponential-fibres@40", noise_sd=5e-4).ensemble(4)


@pytest.mark.slow
def test_febio_adds_fibres_to_the_nearest_mixture_of_a_free_energy(of_free_energy):
    cards = card_format("febio").cards(of_free_energy, CardSettings(unit="kPa"))
    assert "all but that of the fibres, which is exact" in cards.warnings[0]
    points = np.array([(1.3, 1.1), (1.05, 1.3), (1.2, 1.2), (1.1, 1.3)])
    paths, step = tq.loading_modes()["biaxial"]().paths, 1e-6
    for draw, row, text in zip(of_free_energy, cards.index, cards.files.values(), strict=True):
        assert refusals(text) == []
        (material,) = ElementTree.fromstring(text.encode()).find("Material")
        assert row["bulk_modulus"] == pytest.approx(float(material.find("k").text), rel=1e-6)
        *matrix, fibres = material.findall("solid")
        known, solids = febio_fibres(fibres), [febio_solid(solid) for solid in matrix]
        assert known[0] == 0

        def of_card(one, two, *, known=known, solids=solids):
            stretches = np.array([one, two, 1 / (one * two)])
            return energy(known, np.diag(stretches**2)) + sum(solid.energy(stretches) for solid in solids)

        for axis, path in enumerate(paths):
            wanted = 1e3 * tq.engineering_stress(draw, path, points, ())
            nudge = step * np.eye(2)[axis]
            found = [(of_card(*(point + nudge)) - of_card(*(point - nudge))) / (2 * step) for point in points]
            # The error that is stated is a share of the stress without fibres, which is less.
            assert np.abs(found - wanted).max() < 2 * row["error_within_1_max"] * np.abs(wanted).max()
    assert cards.index[0]["bulk_modulus"] > 1e3 * 2 * 4 / 3 * 25


def test_a_free_energy_beside_fibres_goes_to_febio_or_felupe_or_is_left_out(of_free_energy):
    with pytest.raises(tq.InputError, match=r"cards for febio\. Or fit without.*--discrepancy none.*FElupeMaterial"):
        card_format("calculix").cards(of_free_energy, CardSettings())
    with pytest.raises(tq.InputError, match="can be of the laws mixture"):
        card_format("febio").cards(of_free_energy, CardSettings(law="ogden"))


def test_fibres_are_not_projected_on_isotropic_laws(given):
    with pytest.raises(tq.InputError, match="--law"):
        card_format("calculix").cards(given(*EXPONENTIAL), CardSettings(law="ogden"))


def test_abaqus_says_what_its_material_alone_does_not_hold(given):
    name, values = EXPONENTIAL
    draws = given(name, values, [*values[:-1], 0.7])
    assert "*ORIENTATION" in card_format("abaqus").cards(draws, CardSettings()).outside
    assert not card_format("abaqus").cards(given(name, values, values), CardSettings()).outside
    assert not card_format("calculix").cards(draws, CardSettings()).outside


@pytest.mark.skipif(CCX is None, reason="CalculiX (ccx) is not installed: make system")
@pytest.mark.parametrize("case", [EXPONENTIAL, QUADRATIC, ALONG], ids=lambda each: each[0])
def test_calculix_computes_the_stress_of_fibres(given, tmp_path, case):
    draws = given(*case)
    cards = card_format("calculix").cards(draws, CardSettings())
    (text,) = cards.files.values()
    bulk = cards.index[0]["bulk_modulus"]

    def energy(stretches):
        return draws[0].energy_of(Deformation.along_axes(stretches))

    wanted = [reference(energy, bulk, load) for load in LOADS]
    assert calculix(text, LOADS, tmp_path) == pytest.approx(wanted, rel=1e-5), NAMES
    across = [(1.3, FREE, FREE), (1.2, 1.0, FREE)]  # of a cube whose material axes are turned by 90 degrees
    turned = text + "*ORIENTATION, NAME=TURNED\n0., 1., 0., -1., 0., 0.\n"
    found = calculix(turned, across, tmp_path, orientation="TURNED")
    swapped = [tuple(load[axis] for axis in (1, 0, 2)) for load in across]
    wanted = [reference(energy, bulk, load, 1) for load in swapped]
    assert found == pytest.approx(wanted, rel=1e-5)
