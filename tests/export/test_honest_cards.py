"""Beyond the measured range: cards are stable, state how far they are off there, and say what is out of reach."""

from __future__ import annotations

import re

import numpy as np
import pytest

import tissuq as tq
from card_readers import READERS
from tissuq.export import CardSettings, card_format

STEP = 1e-4


def states(most, factor, angles=(0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0), shares=(0.5, 0.8, 1.0)):
    """Logarithmic strains at angles of their own, up to so many times the measured invariants."""
    logs = []
    for angle in np.radians(angles):
        direction = np.cos(angle - 2 * np.pi / 3 * np.array([0.0, 1.0, -1.0]))
        sizes = np.linspace(0, 3, 30001)
        first, second = (np.exp(sign * 2 * np.outer(sizes, direction)).sum(axis=1) - 3 for sign in (1, -1))
        end = sizes[np.flatnonzero((first <= factor * most[0]) & (second <= factor * most[1]))[-1]]
        logs += [share * end * direction for share in shares]
    return np.array(logs)


def principal_differences(energy, logs):
    """The three differences of principal Cauchy stresses, by complex steps."""
    found = []
    for i, j in ((0, 1), (0, 2), (1, 2)):
        moved = logs.astype(complex)
        moved[:, i] += 1e-30j
        moved[:, j] -= 1e-30j
        found.append([np.imag(complex(energy(tuple(np.exp(row))))) / 1e-30 for row in moved])
    return np.array(found)


@pytest.mark.slow
@pytest.mark.parametrize("code", ["calculix", "febio"])
def test_the_error_beyond_the_range_is_the_one_that_is_stated(auto, code):
    cards = card_format(code).cards(auto, CardSettings())
    for draw, text, row in zip(auto, cards.files.values(), cards.index, strict=True):
        energy = READERS[code](text).energy
        for reach in (1.0, 1.25, 1.5):
            logs = states(auto.most, reach)
            truth, found = (principal_differences(each, logs) for each in (draw.energy, energy))
            apart = (np.abs(found - truth).max(axis=0) / np.abs(truth).max(axis=0)).max()
            told = row[f"error_within_{reach:g}_max"]
            assert 0.5 * told <= apart <= 1.2 * told + 1e-6  # at other angles
        (said,) = re.findall(r"to 1.5 times the measured invariants: (\S+) %", text)
        assert float(said) / 100 == pytest.approx(row["error_within_1.5_max"], rel=1e-2)


def hessians(energy, logs):
    """The Hessians of an energy in logarithmic strains of unchanged volume, by differences."""
    along = np.array([[1.0, 0.0, -1.0], [-1.0, 2.0, -1.0]]) / np.sqrt([[2.0], [6.0]])
    found = np.zeros((len(logs), 2, 2))
    for number, row in enumerate(logs):
        for i in range(2):
            for j in range(2):
                corners = [(a, b) for a in (1, -1) for b in (1, -1)]
                values = [
                    a * b * float(energy(tuple(np.exp(row + STEP * (a * along[i] + b * along[j]))))) for a, b in corners
                ]
                found[number, i, j] = sum(values) / (4 * STEP**2)
    return found


def test_a_card_is_stable_to_half_again_the_measured_invariants_where_free_least_squares_is_not(given, monkeypatch):
    """A single Ogden term that hardens in compression alone, which two coefficients of I1 follow by softening."""
    ensemble = given([("ogden-1", [1.0, -9.0])])
    settings = CardSettings(law="reduced-polynomial", order=2)
    rows = card_format("abaqus").cards(ensemble, settings)
    free = []
    monkeypatch.setattr("tissuq.export.nearest_law.fit_within", lambda *_: None)
    for text in card_format("abaqus").cards(ensemble, settings).files.values():
        free.append(np.linalg.eigvalsh(hessians(READERS["abaqus"](text).energy, states(ensemble.most, 1.5))).min())
    assert min(free) < 0
    for text, row in zip(rows.files.values(), rows.index, strict=True):
        assert row["card_is_stable_within_1.5"]
        least = np.linalg.eigvalsh(hessians(READERS["abaqus"](text).energy, states(ensemble.most, 1.5))).min()
        assert least > 0


def test_cards_that_do_not_follow_their_draws_are_not_to_be_computed_with(given):
    """Against one Ogden term of exponent 9, neo-Hooke of the same initial modulus; one of exponent 2 is neo-Hooke."""
    ensemble = given([("ogden-1", [1.0, 9.0])], [("ogden-1", [1.0, 2.0])])
    cards = card_format("abaqus").cards(ensemble, CardSettings(law="reduced-polynomial", order=1))
    stretch = np.linspace(0.7, 2.0, 26)
    draw = 2 / 9 * (stretch**8 - stretch**-5.5)
    apart = (stretch - stretch**-2) / draw - 1
    assert np.sqrt((apart**2).mean()) > 0.3
    wrong, right = cards.files.values()
    assert "the card does NOT stand for the draw: do not compute with it" in wrong
    assert "do not compute" not in right
    assert cards.warnings[0].startswith("Do NOT compute with the cards of draw 1 of 2: their stresses are off by ")


def test_what_of_a_discrepancy_is_in_the_draws_and_what_is_not_is_said(data):
    """The terms of 'yeoh' are in the cards; its scatter S, in the predicted stress alone, is not."""
    posterior = tq.fit(data, noise_sd=0.02, discrepancy="yeoh", tolerances="as-tested")
    cards = card_format("abaqus").cards(posterior.ensemble(3), CardSettings(unit="kPa"))
    for row, text in zip(cards.index, cards.files.values(), strict=True):
        constants = [row[f"C{n}0"] for n in (1, 2, 3)]
        assert [row[f"card_C{n}0"] for n in (1, 2, 3)] == pytest.approx(constants)
        assert row["initial_shear_modulus"] == pytest.approx(2 * row["C10"])
        words = " ".join(text.replace("** ", " ").split())
        assert f"C20 = {row['C20']:.6g}, C30 = {row['C30']:.6g}" in words
        assert "energy of the draws: material and discrepancy" in words
        assert "The scatter S of the discrepancy 'yeoh' about its mean is in no draw" in words
    assert "spreads less than the stress that the fit predicts" in cards.warnings[0]
    band = posterior.predict([1.5], noise=False)
    spread = np.ptp(
        np.quantile(posterior.ensemble(200, admissible=False).stress("uniaxial", np.array([1.5])), [0.025, 0.975])
    )
    assert spread < (band["high"] - band["low"])[0]
