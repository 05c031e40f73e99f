"""How often the 95 % interval of C10 holds when the specimen was preloaded, or the stress has a smooth error.

Random materials of the coverage study's families, 30 points in tension only, between stretches 1.01 and 1.3, with
independent noise of 1 % of the largest stress. Preload: the specimen was stretched by 1 % when its length was measured.
Smooth: a relative error of 2 %, a Gaussian process a third of the range long. Fitted as tested, which is
without errors of the test, and of the specimen, which is with those of a careful laboratory.
"""

from __future__ import annotations

import argparse

import numpy as np

import tissuq as tq
from tissuq.experiments.modes import loading_mode
from tissuq.validation.coverage.truths import FAMILIES, draw_truth

STRETCH = np.linspace(1.01, 1.3, 30)
NOISE, PRELOAD, SMOOTH = 0.01, 0.01, 0.02
ESTIMANDS = "as-tested", "specimen"


def tests_of(number: int, seed: int) -> tuple[float, dict[str, np.ndarray]]:
    """Return the true C10 of a material, and its measured stresses without an error of the test and with each."""
    truth = draw_truth(tuple(FAMILIES)[number % len(FAMILIES)], (seed, number))
    stress, preloaded = (truth.stress(loading_mode("uniaxial"), STRETCH * factor) for factor in (1.0, 1 + PRELOAD))
    generator = np.random.default_rng([seed + 2, number])
    noise = NOISE * np.abs(stress).max() * generator.standard_normal(len(STRETCH))
    distance = (STRETCH[:, None] - STRETCH) / (np.ptp(STRETCH) / 3)
    root = np.linalg.cholesky(np.exp(-0.5 * distance**2) + 1e-9 * np.eye(len(STRETCH)))
    smooth = 1 + SMOOTH * (root @ generator.standard_normal(len(STRETCH)))
    return truth.C10, {"none": stress + noise, "preload": preloaded + noise, "smooth": stress * smooth + noise}


def main() -> None:
    """Fit every test, and print how often the intervals hold and how wide they are."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=48)
    parser.add_argument("--seed", type=int, default=5)
    options = parser.parse_args()
    held: dict[tuple[str, str], list[bool]] = {}
    widths: dict[tuple[str, str], list[float]] = {}
    for number in range(options.count):
        C10, stresses = tests_of(number, options.seed)
        for error, stress in stresses.items():
            for name in ESTIMANDS:
                posterior = tq.fit(tq.Experiment("uniaxial", STRETCH, stress), tolerances=name)
                low, high = posterior.marginals["C10"].hdi()
                held.setdefault((error, name), []).append(low <= C10 <= high)
                widths.setdefault((error, name), []).append(0.5 * (high - low) / C10)
    for (error, name), inside in held.items():
        width = np.median(widths[error, name])
        print(f"error {error}, {name}: {np.mean(inside):.0%} of {options.count} held, half width {width:.1%}")


if __name__ == "__main__":
    main()
