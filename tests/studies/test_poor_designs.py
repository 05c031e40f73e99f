"""Data that say little: wide intervals and a warning, never a crash or a confident number."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq

TRUTH = {"C10": 0.5, "C20": 0.1, "C30": 0.0}
FAR = np.concatenate([np.linspace(0.5, 0.75, 8), np.linspace(1.25, 2.0, 8)])
DESIGNS = {
    "two points": ([0.8, 1.3], 0.02, "2 measurements are too few"),
    "three points": ([0.8, 1.2, 1.3], 0.02, "3 measurements are too few"),
    "one stretch": ([1.3] * 10, 0.02, "extrapolated"),
    "nothing near": (FAR, 0.02, "extrapolated"),
    "noise above the signal": (np.linspace(0.7, 1.6, 15), 5.0, "determine C10 poorly"),
}


@pytest.mark.slow
@pytest.mark.parametrize(("noise", "seeds"), [("known", 3), ("unknown", 1)])
@pytest.mark.parametrize("design", list(DESIGNS))
def test_the_interval_is_wide_and_a_warning_says_what_to_measure(design, noise, seeds):
    stretch, noise_sd, words = DESIGNS[design]
    for seed in range(seeds):  # with unknown noise such posteriors are wide, and take seconds
        data = tq.simulate("yeoh", TRUTH, stretch, noise_sd=noise_sd, seed=seed)
        posterior = tq.fit(data, discrepancy="auto", noise_sd=noise_sd if noise == "known" else "unknown")
        c10 = posterior.summary().loc["C10"]
        assert c10["hdi_low"] < TRUTH["C10"] < c10["hdi_high"]  # wide enough that no seed should miss it
        told = [text for text in posterior.warnings if words in text]
        assert told
        assert all("easure" in text for text in told)


@pytest.mark.slow
def test_two_points_say_next_to_nothing():
    """The short version has two points with known noise, among the designs above."""
    data = tq.simulate("yeoh", TRUTH, [0.8, 1.3], noise_sd=0.02, seed=1)
    assert any("determine C10 poorly" in text for text in tq.fit(data, discrepancy="auto").warnings)


def test_one_point_is_refused_with_a_reason():
    data = tq.Experiment("uniaxial", [1.3], [0.5])
    for noise_sd in (0.02, "unknown"):
        with pytest.raises(tq.InputError, match="measure more"):
            tq.fit(data, discrepancy="auto", noise_sd=noise_sd)
