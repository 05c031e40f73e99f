"""Synthetic experiments carry the stress and the noise that were asked for."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq

TRUTH = {"C10": 1.2, "C20": -0.057, "C30": 0.004}


def test_without_noise_it_is_the_closed_form():
    data = tq.simulate("neo-hookean", {"C10": 0.5}, [0.8, 1.0, 1.5])
    np.testing.assert_allclose(data.stress, [0.8 - 0.8**-2, 0.0, 1.5 - 1.5**-2], atol=1e-15)


def test_the_same_seed_gives_the_same_noise_and_another_seed_another():
    first, again, other = (tq.simulate("yeoh", TRUTH, [0.5, 1, 2], 0.5, seed).stress for seed in (1, 1, 2))
    assert (first == again).all()
    assert (first != other).all()


def test_the_noise_has_the_standard_deviation_asked_for():
    stretch = np.linspace(0.5, 4, 4000)
    noise = tq.simulate("yeoh", TRUTH, stretch, 0.5).stress - tq.simulate("yeoh", TRUTH, stretch).stress
    assert noise.std() == pytest.approx(0.5, rel=0.06)  # 5 standard errors


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"parameters": {"C10": 1.0}}, "needs the parameters C10, C20, C30"),
        ({"noise_sd": -0.1}, "zero or positive"),
        ({"material": "yoeh"}, "Did you mean 'yeoh'"),
        ({"stretch": [1.0, -2.0]}, "not positive"),
        ({"mode": "bending"}, "no loading mode"),
    ],
)
def test_bad_input_is_refused_in_words(arguments, words):
    given = {"material": "yeoh", "parameters": TRUTH, "stretch": [1.0, 2.0]} | arguments
    with pytest.raises(tq.TissuqError, match=words):
        tq.simulate(**given)
