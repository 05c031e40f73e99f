"""Tables of W1 and W2."""

from __future__ import annotations

import csv

import numpy as np
import pytest

import tissuq as tq
from tissuq.export import CardSettings, card_format


def table(text):
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    rows = list(csv.DictReader(lines))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def test_w1_and_w2_are_the_derivatives_of_the_energy(given):
    found = table(_only(given([("rivlin:C10,C01,C11,C20", [0.4, 0.1, 0.03, 0.02])]), unit="kPa"))
    x, y = found["I1"] - 3, found["I2"] - 3
    assert found["W1"] == pytest.approx(1e3 * (0.4 + 0.03 * y + 0.04 * x), rel=1e-5)
    assert found["W2"] == pytest.approx(1e3 * (0.1 + 0.03 * x), rel=1e-4)
    assert found["l1"] * found["l2"] * found["l3"] == pytest.approx(np.ones(len(x)))
    squares = found["l1"] ** 2, found["l2"] ** 2, found["l3"] ** 2
    assert found["I1"] == pytest.approx(sum(squares))
    assert found["I2"] == pytest.approx(sum(1 / each for each in squares))


def test_w1_and_w2_of_a_law_of_stretches_give_its_stresses(given):
    """Ogden's Cauchy stresses are 2 mu/alpha l^alpha, less a pressure."""
    found = table(_only(given([("ogden-1", [0.9, -5.0])])))
    one, two, three = (found[name] for name in ("l1", "l2", "l3"))
    for first, last, other in ((one, three, two), (two, three, one), (one, two, three)):
        wanted = 2 * 0.9 / -5.0 * (first**-5.0 - last**-5.0)
        assert 2 * (first**2 - last**2) * (found["W1"] + other**2 * found["W2"]) == pytest.approx(wanted, rel=1e-5)
    assert found["cauchy_1_less_3"] == pytest.approx(2 * 0.9 / -5.0 * (one**-5.0 - three**-5.0))
    assert found["cauchy_2_less_3"] == pytest.approx(2 * 0.9 / -5.0 * (two**-5.0 - three**-5.0), rel=1e-5)


def test_along_a_mode_the_table_has_the_stress_of_a_free_energy(auto):
    cards = card_format("table").cards(auto, CardSettings())
    for draw, text in zip(auto, cards.files.values(), strict=True):
        found = table(text)
        planar = found["lode_angle"] == 30.0
        stretch = found["l1"][planar]
        truth = tq.engineering_stress(draw, tq.loading_modes()["planar"](), stretch, ())
        assert found["cauchy_1_less_3"][planar] / stretch == pytest.approx(truth, rel=1e-6)
        assert found["l2"][planar] == pytest.approx(np.ones(planar.sum()))
    assert [row["file"] for row in cards.index] == list(cards.files)


@pytest.mark.parametrize("unused", [{"law": "ogden", "order": 3}, {"bulk_modulus": 5.0}, {"poisson": 0.49}])
def test_a_table_refuses_what_is_of_cards_alone(given, unused):
    with pytest.raises(tq.InputError, match=f"--{next(iter(unused)).replace('_', '-')}"):
        _only(given([("neo-hookean", [0.4])]), **unused)


def _only(ensemble, **settings):
    (text,) = card_format("table").cards(ensemble, CardSettings(**settings)).files.values()
    return text
