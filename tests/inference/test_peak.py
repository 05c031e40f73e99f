"""The search for the largest value of a function that costs much, against functions whose peak is known."""

import numpy as np
import pytest

from tissuq.inference.peak import highest

COUNT, NOISE_SD = 40, 0.3


def log_likelihood(log_sd: float) -> float:
    """Return that of the noise of as many errors as `COUNT`, of the sample sd `NOISE_SD`."""
    return -COUNT * (log_sd + 0.5 * (NOISE_SD / np.exp(log_sd)) ** 2)


@pytest.mark.parametrize("start", [-3.5, -1.5, np.log(NOISE_SD), 0.5, 1.2])
def test_the_noise_of_a_sample_is_found_from_afar_by_few_evaluations(start):
    evaluated = []

    def counted(log_sd):
        evaluated.append(log_sd)
        return log_likelihood(log_sd)

    place, value = highest(counted, start, 0.4, 3.0, 0.01)
    assert place == pytest.approx(np.log(NOISE_SD), abs=0.04)
    assert value == pytest.approx(log_likelihood(np.log(NOISE_SD)), abs=0.05)
    assert len(evaluated) == len(set(evaluated)) <= 16


def test_where_the_function_still_rises_at_the_end_of_its_reach_the_end_is_the_result():
    assert highest(lambda x: 2 * x, 1.0, 0.4, 3.0, 0.1) == (4.0, 8.0)
    assert highest(lambda x: -2 * x, 1.0, 0.4, 3.0, 0.1) == (-2.0, 4.0)


def test_a_function_that_is_the_same_everywhere_is_highest_at_the_start():
    place, value = highest(lambda _: 1.0, 0.0, 0.4, 3.0, 0.1)
    assert abs(place) <= 3.0
    assert value == 1.0
