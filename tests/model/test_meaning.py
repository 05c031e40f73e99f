"""What intervals are said to be of."""

import numpy as np
import pytest

import tissuq as tq

STRETCH = np.array([1.05, 1.1, 1.2, 1.3])


@pytest.mark.parametrize(
    ("standard_error", "estimand", "words"),
    [
        (None, "as-tested", "this specimen as tested, errors of the test not included"),
        (0.01, "as-tested", "the mean of the measured specimens as tested, errors of the test not included"),
        (0.01, "specimen", "the mean of the measured specimens, errors of the test included"),
        (0.01, "tissue", "the tissue (the mean of its specimens), errors of the test included"),
    ],
)
def test_data_with_standard_errors_are_of_the_mean_of_specimens(standard_error, estimand, words):
    errors = None if standard_error is None else np.full(4, standard_error)
    data = tq.Experiment("uniaxial", STRETCH, STRETCH - STRETCH**-2, standard_error=errors)
    posterior = tq.fit(data, discrepancy="none", noise_sd=0.02, tolerances=tq.Tolerances(estimand))
    assert posterior.answer.meaning == words
    assert posterior.data.attrs["intervals_of"] == words
