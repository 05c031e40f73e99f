"""What pages say of the data: how every file was read, as what the stress was taken, and its random errors."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from tissuq.experiments.units import stress_unit
from tissuq.report.measured import noise_in_words, noise_of_specimens, specimens_section


@pytest.mark.parametrize(
    ("discrepancy", "noise_sd", "words"),
    [
        ("none", {"L1": 1e-5, "L2": 1e-5}, "the material is right. Noise: known standard deviation 0.01 kPa."),
        (
            "none",
            {"L1": 1e-5, "L2": "unknown"},
            "Noise: of L1: known standard deviation 0.01 kPa; of L2: unknown standard deviation",
        ),
        (
            "gp",
            dict.fromkeys(("L1", "L2"), "unknown"),
            "is a Gaussian process with the covariance c^2 exp(-(l - l')^2 / (2 psi^2)) ('gp' of tissuq",
        ),
    ],
)
def test_a_page_of_specimens_says_how_they_were_read_and_what_was_fitted(tmp_path, discrepancy, noise_sd, words):
    tests = {}
    for name in ("L1", "L2"):
        path = tmp_path / f"{name}.csv"
        stretch = np.linspace(1, 1.3, 8)
        rows = [f"{a:.4f},{1e3 * b:.5f}" for a, b in zip(stretch, stretch - stretch**-2, strict=True)]
        path.write_text("\n".join(["stretch,stress (kPa)", *rows]))
        tests[name] = [tq.read(path)]
    fits = {name: tq.fit(test, discrepancy=discrepancy, noise_sd=noise_sd[name]) for name, test in tests.items()}
    sources, law = specimens_section(tests, fits, stress_unit("kPa")).blocks
    assert [source.partition(": ")[0] for source in sources] == ["**L1**", "**L2**"]
    assert "engineering stress from column 'stress (kPa)' in kPa" in sources[1]
    assert "W = C10 (I1 - 3) (Treloar 1943), was fitted to every specimen." in law
    assert words in law


@pytest.mark.parametrize("noise", ["independent", "proportional"])
def test_unknown_noise_of_several_tests_is_said_to_be_in_proportion_to_their_scatter(noise):
    stretch = np.linspace(1.02, 1.4, 12)
    tests = [tq.simulate("neo-hookean", {"C10": 0.5}, stretch, noise_sd=0.01, seed=seed) for seed in (1, 2)]
    fits = [tq.fit(tests[:count], discrepancy="none", noise=noise, tolerances="as-tested") for count in (1, 2)]
    words = ", of several tests in the proportions in which they scatter about smooth curves"
    of_one, of_two = (noise_in_words(None, fit) for fit in fits)
    assert of_two == of_one + words * (noise == "independent")
    assert noise_of_specimens({"L1": fits[1]}, stress_unit("kPa")) == f"Noise: {of_two}."
