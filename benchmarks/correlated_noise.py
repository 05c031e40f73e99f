"""How often the 95 % interval of C10 holds when the errors of consecutive measurements are correlated.

Random materials of the coverage study's families, 60 points of one ramp between stretches 0.6 and 2, noise of 3 % of
the largest stress by first-order autoregression; fitted with the noise `independent`, `unknown` (which of the other
two the data say) and `autoregressive`, errors of the test included.
"""

from __future__ import annotations

import argparse

import numpy as np

import tissuq as tq
from tissuq.experiments.modes import loading_mode
from tissuq.validation.coverage.truths import FAMILIES, draw_truth

STRETCH = np.linspace(0.6, 2.0, 60)
NOISE = 0.03
KINDS = ("independent", "unknown", "autoregressive")


def simulated(number: int, seed: int, lag: float) -> tuple[float, tq.Experiment]:
    """Return the true C10 of a material and its test."""
    truth = draw_truth(tuple(FAMILIES)[number % len(FAMILIES)], (seed, number))
    stress = truth.stress(loading_mode("uniaxial"), STRETCH)
    score = np.random.default_rng([seed + 4, number]).standard_normal(len(STRETCH))
    for place in range(1, len(score)):
        score[place] = lag * score[place - 1] + np.sqrt(1 - lag**2) * score[place]
    return truth.C10, tq.Experiment("uniaxial", STRETCH, stress + NOISE * np.abs(stress).max() * score)


def main() -> None:
    """Fit every data set, and print what was found so far after each dozen."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=96)
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--lag", type=float, default=0.8)
    options = parser.parse_args()
    held: dict[str, list[bool]] = {kind: [] for kind in KINDS}
    widths: dict[str, list[float]] = {kind: [] for kind in KINDS}
    for number in range(options.count):
        truth, data = simulated(number, options.seed, options.lag)
        for kind in KINDS:
            low, high = tq.fit(data, noise=kind, tolerances="specimen").marginals["C10"].hdi()
            held[kind].append(low <= truth <= high)
            widths[kind].append(0.5 * (high - low) / truth)
        if (number + 1) % 12 == 0 or number + 1 == options.count:
            parts = (
                f"{kind}: {np.mean(held[kind]):.1%} held, half width {np.median(widths[kind]):.1%}" for kind in KINDS
            )
            print(f"{number + 1} materials, lag {options.lag:g}: {'; '.join(parts)}", flush=True)


if __name__ == "__main__":
    main()
