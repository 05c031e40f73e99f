"""Recompute the reference posteriors and compare them with the stored numbers, or store these anew."""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy is imported
os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import json
import math
import multiprocessing
import re
import statistics
import sys
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from frozen.cases import CASES, STATED_ERROR, Numbers

STORED = Path(__file__).with_name("numbers.json")
TOLERANCE = 1e-8
"""Relative deviation that is allowed where nothing is sampled."""
STANDARD_ERRORS = 5.0
"""Deviation that is allowed where the numbers are sampled, in Monte Carlo standard errors of one run."""
SEEDS = 16
"""Runs from which these standard errors are computed."""
ROUNDING = 1e-14
"""Relative change of the measured stresses, whose effect is stored beside the numbers."""
ROUNDING_MARGIN = 10.0
"""Multiple of this effect, or of another processor's, that is allowed where it is more than the tolerance."""
OLDER_PROCESSORS = (
    {"OPENBLAS_CORETYPE": "Sandybridge", "XLA_FLAGS": "--xla_cpu_max_isa=AVX", "NPY_DISABLE_CPU_FEATURES": "AVX2 FMA3"},
    {"OPENBLAS_CORETYPE": "Haswell", "XLA_FLAGS": "--xla_cpu_max_isa=AVX2", "NPY_DISABLE_CPU_FEATURES": "X86_V4"},
)
"""Environments in which the libraries take the instructions of older processors, and so round otherwise."""

Stored = Mapping[str, Any]


@dataclass(frozen=True)
class Comparison:
    """The number of a case that is farthest from the stored one, for what is allowed.

    Attributes
    ----------
    deviation, allowed : float
        Relative, or in standard errors where the numbers are sampled.
    number : str
    missing : tuple of str
        Numbers that are in one of the two alone.
    """

    deviation: float
    allowed: float
    number: str
    missing: tuple[str, ...] = ()

    @property
    def holds(self) -> bool:
        """Whether no number has moved."""
        return not self.missing and self.deviation <= self.allowed


def compared(numbers: Numbers, stored: Stored, tolerance: float = TOLERANCE) -> Comparison:
    """Compare the numbers of a case with the stored ones.

    Sampled numbers are compared with their mean over seeds, in standard errors of one run. All others are compared
    relative to their value or, where that is larger, to the posterior's spread; where a rounding error of the data or
    another processor moves a number by more than the tolerance (a discrete choice within the integration), ten times
    as much is allowed.
    """
    expected = stored["numbers"]
    worst = Comparison(0.0, STANDARD_ERRORS if stored["is_sampled"] else tolerance, "")
    for name in sorted(numbers.keys() & expected.keys() - {STATED_ERROR}):
        reference, size, *sensitivity = expected[name]
        difference = abs(numbers[name].value - reference)
        if stored["is_sampled"]:
            error = max(size * math.sqrt(1 + 1 / SEEDS), TOLERANCE * abs(reference))
            one = Comparison(difference / error, STANDARD_ERRORS, name)
        else:
            allowed = max(tolerance, ROUNDING_MARGIN * sensitivity[0])
            one = Comparison(difference / max(abs(reference), size), allowed, name)
        if not one.deviation / one.allowed <= worst.deviation / worst.allowed:  # also where it is not a number
            worst = replace(one, deviation=math.inf) if math.isnan(one.deviation) else one
    return replace(worst, missing=tuple(sorted(numbers.keys() ^ expected.keys())))


def computed(name: str, seed: int = 0, rounding: float = 0.0) -> tuple[Numbers, float]:
    """Return the numbers of a case and the seconds that they took."""
    start = time.perf_counter()
    numbers = CASES[name].compute(seed, rounding)
    return numbers, time.perf_counter() - start


def sampled_entry(runs: Sequence[Numbers]) -> Stored:
    """Return what is stored of a sampled case: the mean over seeds and the standard error of one run."""
    values = {name: [run[name].value for run in runs] for name in runs[0]}
    numbers = {name: [statistics.fmean(several), statistics.stdev(several)] for name, several in values.items()}
    return {"is_sampled": True, "numbers": numbers}


def exact_entry(run: Numbers, perturbed: Sequence[Numbers]) -> Stored:
    """Return what is stored of any other case: value, scale, and relative change by rounding, of the data or within."""
    numbers = {}
    for name, number in run.items():
        change = max(abs(other[name].value - number.value) for other in perturbed)
        relative = change / max(abs(number.value), number.scale)
        numbers[name] = [number.value, number.scale, float(f"{relative:.1e}")]
    return {"is_sampled": False, "numbers": numbers}


def computed_on(processor: Mapping[str, str], names: Sequence[str]) -> dict[str, Numbers]:
    """Return the numbers of cases with the instructions of another processor."""
    before = dict(os.environ)
    os.environ.update(processor)  # of the processes that are started here
    try:
        with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
            return {name: numbers for name, (numbers, _) in zip(names, pool.map(computed, names), strict=True)}
    finally:
        os.environ.clear()
        os.environ.update(before)


def write(names: Sequence[str], pool: ProcessPoolExecutor) -> None:
    """Compute the numbers of cases anew and store them."""
    runs = {
        name: [pool.submit(computed, name, seed) for seed in range(SEEDS if CASES[name].is_sampled else 1)]
        for name in names
    }
    exact = [name for name in names if not CASES[name].is_sampled]
    perturbed = {name: [pool.submit(computed, name, 0, sign * ROUNDING) for sign in (-1, 1)] for name in exact}
    on_older = [computed_on(processor, exact) for processor in OLDER_PROCESSORS]
    stored = json.loads(STORED.read_text()) if STORED.exists() else {}
    for name in names:
        results = [run.result()[0] for run in runs[name]]
        if CASES[name].is_sampled:
            stored[name] = sampled_entry(results)
        else:
            others = [run.result()[0] for run in perturbed[name]] + [numbers[name] for numbers in on_older]
            stored[name] = exact_entry(results[0], others)
        print(f"{name:<28} {len(results[0])} numbers", flush=True)
    store({name: stored[name] for name in CASES if name in stored})


def widen(names: Sequence[str], pool: ProcessPoolExecutor) -> None:
    """Add to the stored changes by rounding those by this processor; the code is to be the one that stored them."""
    stored = json.loads(STORED.read_text())
    exact = [name for name in names if not stored[name]["is_sampled"]]
    for name, (run, _) in zip(exact, pool.map(computed, exact), strict=True):
        for number, entry in stored[name]["numbers"].items():
            relative = abs(run[number].value - entry[0]) / max(abs(entry[0]), entry[1])
            entry[2] = max(entry[2], float(f"{relative:.1e}"))
    store(stored)


def store(numbers: Mapping[str, Stored]) -> None:
    """Write the numbers of cases, each number in a line."""
    text = json.dumps(numbers, indent=1)
    STORED.write_text(re.sub(r"\[[^\]]*\]", lambda values: " ".join(values[0].split()), text) + "\n")


def check(names: Sequence[str], pool: ProcessPoolExecutor, tolerance: float) -> bool:
    """Print how far every case is from its stored numbers; return whether none has moved."""
    stored = json.loads(STORED.read_text())
    unknown = [name for name in names if name not in stored]
    if unknown:
        print(
            f"no numbers are stored for {', '.join(unknown)}: python {sys.argv[0]} --write --only {' '.join(unknown)}"
        )
        return False
    # What takes longest first, so that no process waits at the end.
    first = sorted(names, key=lambda name: not CASES[name].is_sampled)
    running = {name: pool.submit(computed, name) for name in first}
    print(f"{'case':<28}{'worst':>9} {'allowed':>9} {'rounding':>9} {'stated':>9} {'s':>6}  number")
    moved = []
    for name in names:
        try:
            numbers, seconds = running[name].result()
        except Exception as error:
            print(f"{name:<28} failed: {type(error).__name__}: {error}", flush=True)
            moved.append(name)
            continue
        found = compared(numbers, stored[name], tolerance)
        unit = "se" if CASES[name].is_sampled else ""
        values = stored[name]["numbers"]
        rounding = math.nan if CASES[name].is_sampled else max(value[2] for value in values.values())
        stated = values.get(STATED_ERROR, [math.nan])[0]
        print(
            f"{name:<28}{found.deviation:>9.1e} {found.allowed:>7.0e}{unit:<2} {rounding:>9.0e} {stated:>9.0e} "
            f"{seconds:>6.1f}  {found.number}{'' if found.holds else '  <-- MOVED'}",
            flush=True,
        )
        if found.missing:
            print(f"{'':<28} in one of the two alone: {', '.join(found.missing)}")
        if not found.holds:
            moved.append(name)
    if moved:
        print(f"\n{len(moved)} of {len(names)} reference posteriors moved: {', '.join(moved)}")
    else:
        print(f"\nall {len(names)} reference posteriors are as stored")
    return not moved


def main() -> int:
    """Check, or write, the numbers."""
    parser = argparse.ArgumentParser(
        description=__doc__,
        epilog="Columns: the worst relative deviation and what is allowed (se: standard errors of one sampled run), "
        f"the deviation after a relative change of the data by {ROUNDING:g}, and the error that the integration states "
        "of the log evidence.",
    )
    parser.add_argument("--only", nargs="+", metavar="NAME", choices=list(CASES), help="these cases alone")
    parser.add_argument("--quick", action="store_true", help="the cases of the test suite alone")
    parser.add_argument("--write", action="store_true", help="store the numbers anew instead of comparing them")
    parser.add_argument(
        "--widen", action="store_true", help="add what this processor rounds otherwise to what is allowed"
    )
    parser.add_argument(
        "--tolerance", type=float, default=TOLERANCE, help=f"relative, where nothing is sampled [{TOLERANCE:g}]"
    )
    parser.add_argument("--workers", type=int, default=2, help="processes [2]")
    given = parser.parse_args()
    names = [
        name for name, case in CASES.items() if name in (given.only or CASES) and (case.is_quick or not given.quick)
    ]
    with ProcessPoolExecutor(given.workers, multiprocessing.get_context("spawn")) as pool:
        if given.write:
            write(names, pool)
            return 0
        if given.widen:
            widen(names, pool)
            return 0
        return 0 if check(names, pool, given.tolerance) else 1


if __name__ == "__main__":
    sys.exit(main())
