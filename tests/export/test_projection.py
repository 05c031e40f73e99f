"""The nearest material of a family: exact where it can be, its error as stated, its modulus that of the draw."""

from __future__ import annotations

import re
from math import comb

import numpy as np
import pytest

import tissuq as tq
from card_readers import PATHS, READERS, stress
from tissuq.export import CardSettings, card_format
from tissuq.export.draw_stresses import DrawStresses
from tissuq.export.projection import (
    LADDER,
    MixtureFit,
    OgdenFit,
    PolynomialFit,
    ReducedFit,
    full_terms,
    projections,
    reduced_terms,
)
from tissuq.export.states import SeenStates

FITS = [PolynomialFit(full_terms(3)), ReducedFit(reduced_terms(4)), OgdenFit(3), OgdenFit(6), MixtureFit(4)]


def stretches(low, high):
    """Thirty equal steps to either end."""
    return np.concatenate([1 + (end - 1) * np.arange(1, 31) / 30 for end in (low, high)])


@pytest.mark.slow
@pytest.mark.parametrize("code", READERS)
def test_the_error_that_is_stated_is_the_error_of_the_numbers_in_the_card(auto, code):
    cards = card_format(code).cards(auto, CardSettings())
    for draw, text, row in zip(auto, cards.files.values(), cards.index, strict=True):
        energy = READERS[code](text).energy
        for mode in PATHS:
            own = stretches(*auto.ranges[mode])
            truth = tq.engineering_stress(draw, tq.loading_modes()[mode](), own, ())
            apart = stress(energy, mode, own) / truth - 1
            assert row[f"error_{mode}_max"] == pytest.approx(np.abs(apart).max(), rel=1e-3, abs=1e-6)
            assert row[f"error_{mode}_rms"] == pytest.approx(np.sqrt((apart**2).mean()), rel=1e-3, abs=1e-6)
            (told,) = re.findall(rf" {mode}: (\S+) %, (\S+) %", text)
            assert [float(each) / 100 for each in told] == pytest.approx(
                [np.abs(apart).max(), np.sqrt((apart**2).mean())], rel=1e-2, abs=1e-6
            )


@pytest.mark.slow
@pytest.mark.parametrize("fit", FITS, ids=lambda fit: fit.material.name)
def test_the_initial_modulus_is_that_of_the_draw(auto, fit):
    law = fit.law(DrawStresses(auto))
    for draw, row in zip(auto, law.values, strict=True):
        own = tq.initial_shear_modulus(law.material, row)
        assert own == pytest.approx(2 * draw.values["C10"], rel=1e-8)


@pytest.mark.parametrize(
    ("fit", "name", "values"),
    [
        (PolynomialFit(full_terms(3)), "rivlin:C10,C01,C11,C12", [0.4, 0.1, 0.02, 0.003]),
        (ReducedFit(reduced_terms(3)), "yeoh", [0.5, -0.02, 0.004]),
    ],
)
def test_a_member_of_the_family_is_found_again(given, fit, name, values):
    (found,) = fit.law(DrawStresses(given([(name, values)]))).values
    wanted = dict(zip((p.symbol for p in tq.mechanics.material_named(name).parameters), values, strict=True))
    assert found == pytest.approx([wanted.get(term, 0.0) for term in fit.terms], abs=1e-7)


def test_ogden_terms_on_the_ladder_are_found_again(given):
    like = given([("neo-hookean", [1.0])])
    farthest = np.abs(np.log(DrawStresses(like).states.base)).max()
    step = 4.0 / (LADDER[-1] * farthest)  # the second of the ladders that are tried
    exponents = [-2 * step, step, 3 * step]
    (found,) = OgdenFit(3).law(DrawStresses(given([("ogden-3", [0.2, 0.5, 0.1, *exponents])]))).values
    assert found == pytest.approx([0.2, 0.5, 0.1, *exponents], rel=1e-6)


@pytest.mark.slow
def test_a_single_ogden_term_finds_its_exponent_closely(given):
    # neo-Hooke is alpha = 2 and mu = 2 C10; the exponents tried lie a 64th of the first ladder's largest apart.
    like = given([("neo-hookean", [0.5])])
    step = 2.0 / np.abs(np.log(DrawStresses(like).states.base)).max() / 64
    ((mu, alpha),) = OgdenFit(1).law(DrawStresses(like)).values
    assert abs(alpha - 2) < step
    assert mu == pytest.approx(1.0, rel=1e-6)


def test_a_projection_is_near_in_every_state_and_not_only_along_the_modes(auto):
    """General biaxial states, in which both stresses are compared, by a mode that shares nothing with the fit."""
    cards = card_format("calculix").cards(auto, CardSettings())
    for draw, text, row in zip(auto, cards.files.values(), cards.index, strict=True):
        energy = READERS["calculix"](text).energy
        for one, two in ((1.3, 1.1), (1.4, 0.9), (1.2, 1.15), (0.8, 1.05)):
            for axis in (0, 1):
                truth, found = (_work(each, one, two, axis) for each in (draw.energy, energy))
                assert abs(found - truth) <= 2 * row["error_states_max"] * abs(truth)


def _work(energy, one, two, axis):
    """Return the engineering stress along one of two axes of a biaxial test."""
    moved = [complex(one), complex(two)]
    moved[axis] += 1e-30j
    return complex(energy((moved[0], moved[1], 1 / (moved[0] * moved[1])))).imag / 1e-30


@pytest.mark.slow
def test_the_default_of_a_free_energy_is_near_and_mostly_stable(auto):
    # Where single stretches leave their measured range, a draw goes on with an exponent of heavy tails, which a
    # polynomial follows less closely than the smooth function that was measured.
    cards = card_format("abaqus").cards(auto, CardSettings())
    assert all(row["card_is_stable"] for row in cards.index)
    assert np.median([row["error_states_rms"] for row in cards.index]) < 0.01
    assert max(row["error_within_1_rms"] for row in cards.index) < 0.05


def test_an_energy_of_the_first_invariant_cannot_hold_the_second(given):
    ensemble = given([("mooney-rivlin", [0.1, 0.4])])
    (row,) = card_format("abaqus").cards(ensemble, CardSettings(law="reduced-polynomial", order=5)).index
    assert row["error_states_max"] > 0.2
    (row,) = card_format("abaqus").cards(ensemble, CardSettings(law="polynomial", order=2)).index
    assert row["error_states_max"] < 1e-7


def test_a_card_that_is_not_stable_is_told(given):
    """A draw that is not stable itself has a card that is not, whether it is projected or the draw's own law."""
    ensemble = given([("yeoh", [0.5, -0.2, 0.0])], [("yeoh", [0.5, 0.1, 0.0])])
    own = card_format("abaqus").cards(ensemble, CardSettings())
    assert [row["card_is_stable"] for row in own.index] == [False, True]
    assert any("draw 1 are NOT stable" in warning for warning in own.warnings)
    cards = card_format("abaqus").cards(ensemble, CardSettings(law="ogden", order=6))
    assert [row["card_is_stable"] for row in cards.index] == [False, True]
    assert any("draw 1 are NOT stable" in warning for warning in cards.warnings)
    assert "NOT stable" in cards.files["draw-1.inp"]
    assert "NOT stable" not in cards.files["draw-2.inp"]


def test_a_card_that_is_far_from_its_draw_is_told_with_what_would_be_nearer(given):
    ensemble = given([("mooney-rivlin", [0.1, 0.4])])
    cards = card_format("abaqus").cards(ensemble, CardSettings(law="reduced-polynomial", order=2))
    assert "off in a state that was measured" in cards.files["draw-1.inp"]
    (told,) = [warning for warning in cards.warnings if "more than 1 % off" in warning]
    assert "draw 1 of 1" in told
    (law, order) = re.findall(r"--law (\S+) --order (\d+) 1 of all", told)[0]
    (row,) = card_format("abaqus").cards(ensemble, CardSettings(law=law, order=int(order))).index
    assert row["error_within_1_max"] < 0.01
    near = card_format("abaqus").cards(ensemble, CardSettings(law="polynomial", order=1))
    assert not any("off in some" in warning for warning in near.warnings)


def test_a_draw_of_the_codes_own_law_that_loses_stability_beyond_the_range_is_told(given):
    """Yeoh, 2 (l - l^-2) (C10 + 2 C20 x): its stress falls in tension somewhere between x = 2 and 3."""
    cards = card_format("abaqus").cards(given([("yeoh", [0.5, -0.028, 0.0])]), CardSettings())
    (row,) = cards.index
    assert row["card_is_stable"]
    assert not row["card_is_stable_within_1.5"]
    assert any("1.5 times the measured invariants: a model" in warning for warning in cards.warnings)


def test_orders_name_the_coefficients_as_fe_codes_do():
    assert full_terms(3) == ("C10", "C01", "C20", "C11", "C02", "C30", "C21", "C12", "C03")
    assert reduced_terms(3) == ("C10", "C20", "C30")
    assert {name: kind.of_order(2).material.name for name, kind in projections().items()} == {
        "reduced-polynomial": "rivlin:C10,C20",
        "polynomial": "rivlin:C10,C01,C20,C11,C02",
        "ogden": "ogden-2",
        "mixture": "rivlin:C10,C20+ogden-2",
    }


def test_every_choice_of_exponents_is_looked_at(auto):
    assert sum(1 for _ in OgdenFit(3).candidates(SeenStates(auto.most))) == 4 * comb(8, 3)
