"""Stresses along both axes of a sheet with a preferred direction."""

import numpy as np
import pytest

import tissuq as tq
from tissuq.assessment.answer import sheet_stresses
from tissuq.experiments.units import stress_unit

FIBRES, TRUTH = "neo-hookean+exponential-fibres@30", {"C10": 0.002, "k1": 0.004, "k2": 3.0}
SHARES = np.linspace(0, 1, 12)[1:, None]


def sheet(ends, law=FIBRES, truth=TRUTH):
    """Tests of a sheet up to pairs of stretches, with noise of 1e-5 MPa."""
    points = np.vstack([1 + SHARES * (np.array(end) - 1) for end in ends])
    return tq.simulate(law, truth, points, noise_sd=1e-5, mode="biaxial", seed=1)


def true_stresses(stretch, law=FIBRES, truth=TRUTH):
    points = np.array([[stretch, stretch], [1.001, 1.001], [1.002, 1.001]])
    return tq.simulate(law, truth, points, noise_sd=1e-12, mode="biaxial", seed=1).stress[0]


@pytest.mark.parametrize("law", [FIBRES, "neo-hookean"])
def test_they_are_those_of_the_truth_at_the_end_of_what_was_measured(law):
    """Of the law that is right, and of a free energy with a direction beside one that has none."""
    data = sheet([(1.2, 1.2), (1.2, 1.1), (1.1, 1.2)])
    discrepancy = "none" if law == FIBRES else "auto"
    posterior = tq.fit(data, material=law, discrepancy=discrepancy, noise_sd=1e-5, tolerances=None)
    found = sheet_stresses(posterior.solution)
    assert found.stretch == pytest.approx(1.2, abs=1e-3)
    truth = true_stresses(found.stretch)
    assert truth[0] > 1.5 * truth[1]
    for (name, median, low, high), true, number in zip(found.stresses, truth, (1, 2), strict=True):
        assert name == f"engineering stress of axis {number}"
        assert low <= median <= high
        assert low - 1e-5 < true < high + 1e-5
        assert median == pytest.approx(true, rel=0.02)
    words = (
        f"Where both axes are stretched to 1.200: engineering stress of axis 1 {1e3 * found.stresses[0][1]:.3g} kPa ("
    )
    assert found.in_words(stress_unit("kPa")).startswith(words)
    assert found.in_words(stress_unit("kPa")) in str(posterior.answer)  # of stresses of 0.01 MPa


def test_there_are_none_without_a_direction_or_where_both_axes_were_not_stretched():
    options = {"discrepancy": "none", "noise_sd": 1e-5}
    assert sheet_stresses(tq.fit(sheet([(1.2, 1.2)], "neo-hookean", {"C10": 0.5}), **options).solution) is None
    assert sheet_stresses(tq.fit(sheet([(1.2, 1.0)]), material=FIBRES, **options).solution) is None
