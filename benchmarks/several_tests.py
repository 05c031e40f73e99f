"""How often the 95 % interval of C10 holds when tests of different specimens differ in stress.

Random materials of the coverage study's families; tension, compression and planar tension of three specimens, 20
points each, noise of 1 % of the largest stress of each test, unknown to the fit; every test's stress is multiplied by
a normal factor about one. `python benchmarks/several_tests.py` prints the share, and the interval's half width.
"""

from __future__ import annotations

import argparse

import numpy as np

import tissuq as tq
from tissuq.experiments.modes import loading_mode
from tissuq.validation.coverage.truths import FAMILIES, draw_truth

DESIGN = (
    ("uniaxial", np.linspace(1.02, 1.6, 20)),
    ("uniaxial", np.linspace(0.6, 0.98, 20)),
    ("planar", np.linspace(1.02, 1.6, 20)),
)
NOISE = 0.01


def simulated(number: int, seed: int, spread: float) -> tuple[float, list[tq.Experiment]]:
    """Return the true C10 of a material and its tests."""
    truth = draw_truth(tuple(FAMILIES)[number % len(FAMILIES)], (seed, number))
    generator, tests = np.random.default_rng([seed + 4, number]), []
    for mode, stretch in DESIGN:
        stress = truth.stress(loading_mode(mode), stretch) * (1 + spread * generator.standard_normal())
        noise = NOISE * np.abs(stress).max() * generator.standard_normal(len(stretch))
        tests.append(tq.Experiment(mode, stretch, stress + noise, f"test {len(tests) + 1}"))
    return truth.C10, tests


def main() -> None:
    """Fit every data set, and print what was found so far after each dozen."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--spread", type=float, default=0.15)
    options = parser.parse_args()
    held, scores, widths = [], [], []
    for number in range(options.count):
        truth, tests = simulated(number, options.seed, options.spread)
        found = tq.fit(tests).marginals["C10"]
        low, high = found.hdi()
        held.append(low <= truth <= high)
        scores.append((found.mean - truth) / found.sd)
        widths.append(0.5 * (high - low) / truth)
        if (number + 1) % 12 == 0 or number + 1 == options.count:
            print(
                f"{number + 1} materials: {np.mean(held):.1%} held; (mean - truth) / sd has mean {np.mean(scores):.2f} "
                f"and sd {np.std(scores):.2f}; half width over truth, median {np.median(widths):.1%}",
                flush=True,
            )


if __name__ == "__main__":
    main()
