"""tissuq alone: many data sets, single warm fits, and a million measurements in memory."""

from __future__ import annotations

import json
import resource
import statistics
import subprocess
import sys
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from results import begin, median_and_range, table, write_section

FORMULATIONS = ("none", "constant", "linear", "quadratic", "mooney-rivlin", "yeoh", "gp")
NOISE_SD = 0.5
DATA_SETS = 200
FITS = 20
MANY, FEW = 10**6, 10**3
REPEATS = 3


def measurements(count: int, seed: int) -> Any:
    """Return synthetic measurements of the paper's Yeoh material."""
    import tissuq as tq

    stretch, stress = arrays(count, seed)
    return tq.Experiment(mode="uniaxial", stretch=stretch, stress=stress)


def arrays(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return stretches and noisy engineering stresses (MPa)."""
    stretch = np.linspace(0.5, 4.25, count)
    x = stretch**2 + 2 / stretch - 3
    exact = 2 * (stretch - stretch**-2) * (1.2 + x * (2 * -0.057 + x * 3 * 0.004))
    return stretch, exact + NOISE_SD * np.random.default_rng(seed).standard_normal(count)


def setting(formulation: str) -> dict[str, Any]:
    """Return the arguments of a fit of the paper."""
    import tissuq as tq
    from peers.problem import BOUNDS
    from peers.problem import FORMULATIONS as SYMBOLS

    priors = {symbol: tq.Uniform(*BOUNDS[symbol]) for symbol in SYMBOLS[formulation]}
    return {"material": "neo-hookean", "discrepancy": formulation, "noise_sd": NOISE_SD, "priors": priors}


def read(posterior: Any) -> tuple[float, float, float, float]:
    """Read out what a study keeps: C10's mean and 95 % interval, and the log evidence."""
    C10 = posterior.summary(parameters=["C10"]).loc["C10"]
    return C10["mean"], C10["hdi_low"], C10["hdi_high"], posterior.log_evidence


def many() -> dict[str, float]:
    """Fit 200 data sets with all seven formulations; the caller times the process."""
    import tissuq as tq

    data_sets = [measurements(30, seed) for seed in range(1, DATA_SETS + 1)]
    seconds = {}
    for name in FORMULATIONS:
        start = perf_counter()
        found = [read(posterior) for posterior in tq.fit_many(data_sets, **setting(name))]
        seconds[name] = perf_counter() - start
        if len(found) != DATA_SETS or not np.isfinite(found).all():
            raise SystemExit(f"{name}: a posterior is missing or not finite")
    return seconds


def warm() -> dict[str, list[float]]:
    """Time single fits in a process that has fitted before."""
    import tissuq as tq

    seconds: dict[str, list[float]] = {}
    for name in FORMULATIONS:
        for seed in range(FITS + 1):
            data = measurements(41 if name == "gp" else 30, 1000 + seed)
            start = perf_counter()
            read(tq.fit(data, **setting(name)))
            seconds.setdefault(name, []).append(perf_counter() - start)
    return {name: times[1:] for name, times in seconds.items()}


def large() -> dict[str, list[float]]:
    """Time fits of very many measurements, and of one measurement more."""
    import tissuq as tq

    fits: dict[str, list[float]] = {}
    read(tq.fit(measurements(FEW, 0), **setting("yeoh")).update(measurements(1, 1)))
    for count in (FEW, MANY):
        for seed in range(REPEATS):
            data, more = measurements(count, seed), measurements(1, 100 + seed)
            start = perf_counter()
            posterior = tq.fit(data, **setting("yeoh"))
            read(posterior)
            fitted = perf_counter()
            read(posterior.update(more))
            fits.setdefault(f"fit {count}", []).append(fitted - start)
            fits.setdefault(f"update {count}", []).append(perf_counter() - fitted)
    return fits


def memory() -> dict[str, float]:
    """Return the most memory that a fit of a million measurements held beyond its arrays, in bytes."""
    import tissuq as tq

    read(tq.fit(measurements(FEW, 0), **setting("yeoh")))
    stretch, stress = arrays(MANY, 1)
    Path("/proc/self/clear_refs").write_text("5")  # the largest resident set starts again from what is resident now
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    if "--trace" in sys.argv:
        tracemalloc.start()
    read(tq.fit(tq.Experiment(mode="uniaxial", stretch=stretch, stress=stress), **setting("yeoh")))
    data = stretch.nbytes + stress.nbytes
    peak = tracemalloc.get_traced_memory()[1] if tracemalloc.is_tracing() else 0
    grown = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
    return {"data": data, "traced": peak, "resident": grown, "process": 1024 * before + grown}


PARTS: dict[str, Callable[[], Any]] = {part.__name__: part for part in (many, warm, large, memory)}


def run(part: str, *options: str) -> tuple[Any, float]:
    """Carry out a part in a process of its own; return what it printed and its wall time."""
    start = perf_counter()
    ended = subprocess.run(
        [sys.executable, Path(__file__).name, part, *options],
        cwd=Path(__file__).parent, capture_output=True, text=True, check=False,
    )  # fmt: skip
    wall = perf_counter() - start
    if ended.returncode:
        raise SystemExit(f"the part '{part}' failed:\n{ended.stderr}")
    return json.loads(ended.stdout.splitlines()[-1]), wall


def main() -> None:
    """Run every part and write RESULTS.md."""
    measured = begin("python benchmarks/engine.py", ("tissuq", "numpy", "scipy", "jax", "jaxlib"))
    runs = [run("many") for _ in range(REPEATS)]
    walls = [wall for _, wall in runs]
    rows = [
        [f"{DATA_SETS} data sets with 7 formulations, whole process", median_and_range(walls, 2)],
        *([f"- of it {n}, with read-out", median_and_range([s[n] for s, _ in runs], 3)] for n in FORMULATIONS),
    ]
    for name, times in run("warm")[0].items():
        points = 41 if name == "gp" else 30
        rows.append([f"one warm fit, {name}, n = {points} ({FITS} fits)", _milliseconds(times)])
    for name, times in run("large")[0].items():
        kind, count = name.split()
        what = "fit and read-out" if kind == "fit" else "one measurement more by `update`, and read-out"
        rows.append([f"{what}, yeoh, n = {int(count):.0e}", _milliseconds(times)])
    held, traced = run("memory")[0], run("memory", "--trace")[0]["traced"]
    beyond = [
        ["data in memory", f"{held['data'] / 2**20:.1f} MiB"],
        ["allocated by Python and NumPy at most (tracemalloc)", f"{traced / held['data']:.1f} times the data"],
        ["growth of the largest resident set", f"{held['resident'] / held['data']:.1f} times the data"],
        ["largest resident set during the fit, all of the process", f"{held['process'] / 2**20:.0f} MiB"],
    ]
    write_section(
        "Engine",
        measured,
        "Read-out: mean and 95 % highest-density interval of C10, and the log evidence. Median and range.",
        table(["what", "seconds"], rows),
        "Memory of a fit of 1e6 measurements (yeoh), beyond the given arrays:",
        table(["what", "size"], beyond),
    )


def _milliseconds(times: list[float]) -> str:
    return f"{statistics.median(times):.4f} ({min(times):.4f} to {max(times):.4f})"


if __name__ == "__main__":
    if len(sys.argv) > 1:
        print(json.dumps(PARTS[sys.argv[1]]()))
    else:
        main()
