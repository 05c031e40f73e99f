"""Time a population of 50 specimens with 100 measurements each, under the default discrepancy."""

from __future__ import annotations

import resource
from time import perf_counter, process_time

import numpy as np

import tissuq as tq

SPECIMENS, POINTS = 50, 100
SPREAD = 0.3
NOISE_SD = 0.01


def main() -> None:
    """Print seconds, diagnostics and whether the truth was found."""
    generator = np.random.default_rng(1)
    specimens = {}
    for place in range(SPECIMENS):
        C10, stiffening = 0.5 * np.exp(SPREAD * generator.standard_normal(2))
        truth = {"C10": C10, "C20": 0.2 * C10 * stiffening, "C30": 0.0}
        stretch = np.linspace(0.7 + 0.1 * generator.random(), 1.4 + 0.2 * generator.random(), POINTS)
        specimens[f"s{place}"] = tq.simulate("yeoh", truth, stretch, noise_sd=NOISE_SD, seed=place)
    for material in ("neo-hookean", "yeoh"):
        start, own = perf_counter(), process_time()
        found = tq.fit_population(specimens, material=material)
        took, used, size = perf_counter() - start, process_time() - own, resource.getrusage(resource.RUSAGE_SELF)
        print(f"{material}: {took:.0f} s, {used:.0f} s of a processor, at most {size.ru_maxrss / 1e6:.1f} GB")
        print(found.diagnostics.verdict)
        print(f"{found.hierarchy.effective:.1%} of the draws effective after correction")
        print(found.summary().loc["C10"].round(3).to_string())


if __name__ == "__main__":
    main()
