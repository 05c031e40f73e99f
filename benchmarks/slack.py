"""How often the 95 % interval of C10 holds where a specimen was slack at first, and how wide it is.

Random materials of the coverage study's families in tension to a stretch of about 1.3, 100 rows, with known noise of
0.5 to 2 % of the largest stress, slack over none to 0.3 of the way. Fitted as recorded; from where load begins
(``preload="auto"``), which is then taken as known; and with its uncertainty, as such a file is fitted.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np

import tissuq as tq
from tissuq.experiments.modes import loading_mode
from tissuq.validation.coverage.truths import FAMILIES, draw_truth

ROWS, FURTHEST = 100, 1.3
NOISES, SLACKS = (0.005, 0.01, 0.02), (0.0, 0.1, 0.2, 0.3)


def recorded(number: int, seed: int, share: float, noise: float, folder: Path) -> tuple[float, Path]:
    """Write the file of a test whose load begins at a share of the way; return its true C10, MPa, and the file."""
    truth = draw_truth(tuple(FAMILIES)[number % len(FAMILIES)], (seed, number))
    way = (FURTHEST - 1) / (1 - share)
    stretch = np.linspace(1, 1 + way, ROWS)
    taut = np.maximum(stretch / (1 + share * way), 1.0)
    stress = truth.stress(loading_mode("uniaxial"), taut)
    generator = np.random.default_rng([seed + 2, number])
    stress = stress + noise * np.abs(stress).max() * generator.standard_normal(ROWS)
    path = folder / "test.csv"
    np.savetxt(path, np.column_stack([stretch, stress]), "%.9g", ",", header="stretch,stress [MPa]", comments="")
    return truth.C10, path


def main() -> None:
    """Fit every test in each way, and print how often the intervals hold and how wide they are."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=12, help="Tests for each share of slack and each noise.")
    parser.add_argument("--seed", type=int, default=5)
    options = parser.parse_args()
    for share in SLACKS:
        outcomes: dict[str, list[tuple[bool, float]]] = {}
        with tempfile.TemporaryDirectory() as folder:
            for noise in NOISES:
                for number in range(options.count):
                    C10, path = recorded(number, options.seed, share, noise, Path(folder))
                    auto, as_recorded = (tq.read_experiment(path, preload=preload) for preload in ("auto", None))
                    as_known = tq.Experiment("uniaxial", auto.stretch, auto.stress)
                    ways = {"as recorded": as_recorded, "auto, as known": as_known, "auto": auto}
                    for name, data in ways.items():
                        posterior = tq.fit(data, noise_sd=noise * float(np.abs(data.stress).max()))
                        low, high = posterior.marginals["C10"].hdi()
                        outcome = bool(low <= C10 <= high), 0.5 * (high - low) / C10
                        outcomes.setdefault(name, []).append(outcome)
                    outcomes.setdefault("slack found", []).append(("slack" in auto.least_errors, 0.0))
        for name, pairs in outcomes.items():
            held, widths = np.array(pairs).T
            width = f", half width {np.median(widths):.1%}" if any(widths) else ""
            print(f"slack {share:.0%}, {name}: {held.mean():.0%} of {len(pairs)}{width}", flush=True)


if __name__ == "__main__":
    main()
