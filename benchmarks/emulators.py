"""Emulators of known functions: error and coverage at held-out points, and the processor time to build each.

Every function has twelve outputs. Every emulator is built in a process of its own that has one thread, and so with all
imports and compilations; surmise's PCGP stands beside tissuq's where it is installed.

    python benchmarks/emulators.py
    PYTHONPATH=EARLIER/src python benchmarks/emulators.py --libraries tissuq    # another version of tissuq
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from time import perf_counter, process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from results import table

FloatArray = NDArray[np.float64]

CONTROL = np.linspace(0.05, 0.6, 12)
HELD_OUT = 400
LIBRARIES = {"tissuq": "tissuq", "surmise": "surmise"}
"""Emulators and the packages that they need."""
ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
NORMAL_QUANTILE_975 = 1.959963984540054


def smooth(values: FloatArray) -> FloatArray:
    """Return a stiffening force, mu (exp(b x) - 1) + k x^2."""
    mu, b, k = values
    return np.asarray(mu * np.expm1(b * CONTROL) + k * CONTROL**2)


def log_like(values: FloatArray) -> FloatArray:
    """Return the force of an Ogden block of some thickness in compression."""
    mu, alpha, thickness = values
    stretch = 1 - CONTROL / (1 + thickness)
    return np.asarray(2 * mu / alpha * (stretch ** (-alpha / 2 - 1) - stretch ** (alpha - 1)))


def anisotropic(values: FloatArray) -> FloatArray:
    """Return a function that varies fast with one parameter, slowly with the second and hardly with the third."""
    a, b, c = values
    return np.asarray(CONTROL * (1 + 0.5 * np.sin(7 * a + 3 * CONTROL)) + 0.2 * b * CONTROL**2 + 0.002 * c)


def kinked(values: FloatArray) -> FloatArray:
    """Return the force of contact after a gap: zero up to there, then stiffening."""
    stiffness, gap, power = values
    return np.asarray(0.1 * CONTROL + stiffness * np.maximum(CONTROL - gap, 0) ** power)


def nearly_linear(values: FloatArray) -> FloatArray:
    """Return a linear function with an interaction of one percent."""
    a, b, c = values
    return np.asarray(CONTROL * a + CONTROL**2 * b + c + 0.01 * a * b * CONTROL)


def noisy(values: FloatArray) -> FloatArray:
    """Return the smooth function with a solver's noise of a thousandth, the same in every call."""
    seed = int(np.abs(np.asarray(values) * 2**30).astype(np.int64).sum())
    return smooth(values) * (1 + 1e-3 * np.random.default_rng(seed).standard_normal(len(CONTROL)))


def eight(values: FloatArray) -> FloatArray:
    """Return the force on two layers, each of modulus, stiffening and thickness, with friction and an offset."""
    moduli, rates, sizes, (friction, offset) = values[:2], values[2:4], values[4:6], values[6:]
    strains = CONTROL * sizes[:, None] / sizes.sum()
    layers = moduli[:, None] * np.expm1(rates[:, None] * strains) / rates[:, None]
    return np.asarray(layers.sum(axis=0) * (1 + friction * CONTROL) + offset)


@dataclass(frozen=True)
class Case:
    """A function of parameters in a box."""

    function: Callable[[FloatArray], FloatArray]
    low: tuple[float, ...]
    high: tuple[float, ...]
    runs: int = 40


CASES = {
    "smooth": Case(smooth, (0.5, 0.5, 0.0), (1.5, 3.5, 1.0)),
    "log-like": Case(log_like, (0.2, -20, 0.5), (6.0, -3, 2.0)),
    "anisotropic": Case(anisotropic, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)),
    "kinked": Case(kinked, (0.5, 0.05, 1.0), (1.5, 0.35, 2.0)),
    "nearly linear": Case(nearly_linear, (1.0, 0.1, 0.1), (2.0, 1.0, 1.0)),
    "noisy solver": Case(noisy, (0.5, 0.5, 0.0), (1.5, 3.5, 1.0)),
    "eight parameters": Case(
        eight, (0.5, 0.5, 1.0, 1.0, 0.5, 0.5, 0.0, 0.0), (2.5, 2.5, 3.0, 3.0, 1.5, 1.5, 0.3, 0.05), 80
    ),
}


def by_tissuq(points: FloatArray, outputs: FloatArray, held_out: FloatArray) -> Callable[[], tuple[FloatArray, ...]]:
    """Build tissuq's emulator, and return what predicts."""
    from tissuq.emulation import emulate, gathered

    symbols = [f"p{k}" for k in range(points.shape[1])]
    results = [
        {"parameters": dict(zip(symbols, point, strict=True)), "outputs": output, "error": "", "seconds": 0.0}
        for point, output in zip(points, outputs, strict=True)
    ]
    emulator = emulate(gathered(symbols, results, outputs.shape[1]), CONTROL)

    def predict() -> tuple[FloatArray, ...]:
        mean, cov = emulator.moments(held_out)
        return mean, np.sqrt(np.diagonal(cov, axis1=1, axis2=2))

    return predict


def by_surmise(points: FloatArray, outputs: FloatArray, held_out: FloatArray) -> Callable[[], tuple[FloatArray, ...]]:
    """Build surmise's emulator of principal components, and return what predicts."""
    from surmise import set_RNG
    from surmise.emulation import emulator as surmise_emulator

    set_RNG(np.random.default_rng(0))
    emulator = surmise_emulator(x=CONTROL[:, None], theta=points, f=outputs.T, method="PCGP", args={"epsilon": 1e-10})

    def predict() -> tuple[FloatArray, ...]:
        prediction = emulator.predict(x=CONTROL[:, None], theta=held_out)
        return prediction.mean().T, np.sqrt(np.maximum(prediction.var().T, 0))

    return predict


def build(library: str, name: str, seed: int) -> dict[str, float]:
    """Return how an emulator of a case does and what it took, imports and compilations included."""
    case = CASES[name]
    from scipy.stats import qmc

    low, width = np.array(case.low), np.subtract(case.high, case.low)
    points = low + width * qmc.Sobol(len(low), rng=np.random.default_rng(seed)).random(128)[: case.runs]
    held_out = low + width * np.random.default_rng(99).random((HELD_OUT, len(low)))
    outputs, truth = (np.array([case.function(point) for point in rows]) for rows in (points, held_out))
    clock, processor = perf_counter(), process_time()
    builder = {"tissuq": by_tissuq, "surmise": by_surmise}[library]
    predict = builder(points, outputs, held_out)
    clock, processor = perf_counter() - clock, process_time() - processor
    mean, sd = predict()
    error = mean - truth
    sd = np.maximum(sd, 1e-9 * np.abs(truth).max())
    return {
        "error": float(np.sqrt((error**2).mean() / truth.var(axis=0).mean())),
        "inside": float((np.abs(error) < NORMAL_QUANTILE_975 * sd).mean()),
        "standardised": float(np.sqrt(((error / sd) ** 2).mean())),
        "clock": clock,
        "processor": processor,
    }


def main() -> None:
    """Print a table of all functions and libraries."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--libraries", nargs="+", choices=LIBRARIES, default=list(LIBRARIES))
    options.add_argument("--functions", nargs="+", choices=CASES, default=list(CASES))
    options.add_argument("--seeds", type=int, default=3, help="sets of runs")
    options.add_argument("--one", nargs=3, metavar=("LIBRARY", "FUNCTION", "SEED"), help="build one, and print JSON")
    asked = options.parse_args()
    if asked.one:
        print(json.dumps(build(asked.one[0], asked.one[1], int(asked.one[2]))))
        return
    rows = []
    for name in asked.functions:
        for library in (library for library in asked.libraries if find_spec(LIBRARIES[library])):
            found = [_in_process(library, name, seed) for seed in range(asked.seeds)]
            middle = {key: float(np.median([outcome[key] for outcome in found])) for key in found[0]}
            worst = max(outcome["error"] for outcome in found)
            inside = min(outcome["inside"] for outcome in found)
            rows.append([
                f"{name} ({len(CASES[name].low)}, {CASES[name].runs})", library,
                f"{middle['error']:.1e} ({worst:.1e})", f"{middle['inside']:.0%} ({inside:.0%})",
                f"{middle['standardised']:.2f}", f"{middle['processor']:.2f}", f"{middle['clock']:.2f}",
            ])  # fmt: skip
            print(rows[-1], file=sys.stderr)
    header = ["function (parameters, runs)", "emulator", "error (worst)", "inside 95 % (worst)", "standardised",
              "processor, s", "clock, s"]  # fmt: skip
    print(table(header, rows))


def _in_process(library: str, name: str, seed: int) -> dict[str, Any]:
    command = [sys.executable, __file__, "--one", library, name, str(seed)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=os.environ | ONE_THREAD)
    if done.returncode:
        raise SystemExit(f"{library} on {name}: {done.stderr}")
    outcome: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return outcome


if __name__ == "__main__":
    main()
