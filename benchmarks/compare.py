"""tissuq beside what a user would pick instead: seven posteriors in whole cold processes, one after the other.

Each library runs once with empty compile caches, then again and again in turn with the others. The wall time is that
of the process from start to exit, imports and compilation included, without the diagnostics that this benchmark adds.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from time import perf_counter
from typing import Any

from peers.problem import FORMULATIONS
from results import begin, median_and_range, table, write_section

SLOW = 60.0
"""Seconds beyond which a library is timed once."""


@dataclass
class Peer:
    """One library: the module that fits, the packages it needs, and its runs."""

    label: str
    module: str
    packages: tuple[str, ...]
    first: float = 0.0
    """Wall time with empty compile caches."""
    walls: list[float] = field(default_factory=list)
    """Wall times with full caches."""
    processor: list[float] = field(default_factory=list)
    """Processor times of the same runs, all cores together."""
    fits: dict[str, dict[str, Any]] = field(default_factory=dict)

    @property
    def missing(self) -> str:
        """The first package that it needs and that is not installed."""
        return next((package for package in self.packages if find_spec(package) is None), "")

    @property
    def is_slow(self) -> bool:
        """Whether one timed run must do."""
        return bool(self.walls) and self.walls[-1] > SLOW

    def run(self, environment: Mapping[str, str]) -> tuple[float, float]:
        """Fit all seven in a process of its own and return its wall and processor time."""
        command = [sys.executable, "-m", f"peers.{self.module}"]
        start, used = perf_counter(), processor_seconds()
        ended = subprocess.run(
            command, cwd=Path(__file__).parent, env=environment, capture_output=True, text=True, check=False
        )
        wall, used = perf_counter() - start, processor_seconds() - used
        if ended.returncode:
            raise SystemExit(f"{self.label} failed:\n{ended.stderr}")
        found = json.loads(ended.stdout.splitlines()[-1])
        self.fits = found["fits"]
        return wall - found["diagnostics_seconds"], used - found["diagnostics_seconds"]

    def worst(self, quantity: str) -> list[float]:
        """Return a quantity of every formulation that has it."""
        return [fit[quantity] for fit in self.fits.values() if fit[quantity] is not None]


PEERS = (
    Peer("tissuq", "tissuq_", ("tissuq",)),
    Peer("NumPyro NUTS", "numpyro_", ("numpyro", "jax")),
    Peer("PyMC + nutpie (Numba)", "nutpie_", ("pymc", "nutpie", "numba")),
    Peer("PyMC NUTS", "pymc_", ("pymc",)),
    Peer("BlackJAX NUTS", "blackjax_", ("blackjax", "jax")),
    Peer("emcee", "emcee_", ("emcee",)),
    Peer("dynesty", "dynesty_", ("dynesty",)),
    Peer("UltraNest", "ultranest_", ("ultranest",)),
)
OTHERS = ("numpy", "scipy", "jaxlib", "pytensor", "llvmlite", "arviz-stats")


def main() -> None:
    """Run, print the tables and write them to RESULTS.md."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=3, help="timed runs of each library that is not slow")
    parser.add_argument("--only", nargs="+", metavar="LIBRARY", help="such as numpyro; the default is all")
    given = parser.parse_args()
    asked = [peer for peer in PEERS if not given.only or peer.module.rstrip("_") in ("tissuq", *given.only)]
    present, absent = [p for p in asked if not p.missing], [p for p in asked if p.missing]
    for peer in absent:
        print(f"{peer.label} is absent: {peer.missing} is not installed.")
    packages = dict.fromkeys((*(package for peer in present for package in peer.packages), *OTHERS))
    measured = begin("python benchmarks/compare.py", packages)
    run_all(present, given.repeats)
    notes = [f"Absent: {peer.label} ({peer.missing} is not installed)." for peer in absent]
    if given.only:
        print(table(HEADER, summary(present)))
        return
    write_section("Seven posteriors of the paper", measured, NOTES, *notes, *tables(present))


def run_all(peers: Sequence[Peer], repeats: int) -> None:
    """Run every peer once with empty caches, then in turn as often as asked."""
    with tempfile.TemporaryDirectory() as caches:
        environment = os.environ | {
            "PYTENSOR_FLAGS": f"base_compiledir={caches}/pytensor",
            "NUMBA_CACHE_DIR": f"{caches}/numba",
        }
        for peer in peers:
            peer.first, _ = peer.run(environment)
            print(f"{peer.label}: {peer.first:.1f} s with empty caches", flush=True)
        for _ in range(repeats):
            for peer in peers:
                if not peer.is_slow:
                    wall, used = peer.run(environment)
                    peer.walls.append(wall)
                    peer.processor.append(used)
                    print(f"{peer.label}: {wall:.1f} s, {used:.1f} s of processor time", flush=True)


def processor_seconds() -> float:
    """Return the processor time of all processes that were started from here and have ended."""
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime


HEADER = (
    "library",
    "wall time, s",
    "times tissuq",
    "processor time, s",
    "times tissuq",
    "first run ever, s",
    "log evidence",
    "worst C10 mean off, sd",
    "worst R-hat",
    "least ESS",
    "least ESS of C10",
    "least C10 ESS/s",
)
NOTES = """Each library as its documentation recommends: four chains of 1000 draws after 1000 of warm-up for NUTS, 32
walkers of 5000 steps for emcee, defaults for nested sampling; on the cores that it uses by itself. Wall time is that of
the whole process (imports, compilation, seven fits), median and range; compile caches on disk are full except in the
column "first run ever". Processor time adds up all cores and depends less on what else runs. "Times tissuq" spans the
extremes of both. "Log evidence" is the largest difference from tissuq's over the seven, in nats, and in the library's
own standard errors. ESS is the lesser of ArviZ's bulk and tail values, over all parameters or of C10 alone; of nested
samples it is Kish's. tissuq's draws are independent, so theirs is their number."""


def tables(peers: Sequence[Peer]) -> Iterator[str]:
    """Yield the summary and the formulations one by one."""
    yield table(HEADER, summary(peers))
    for title, cell in {
        "Seconds of each fit in the last process (the first includes what is compiled once)": _seconds,
        "C10, mean and standard deviation (MPa)": _c10,
        "Effective sample size of C10": _ess,
        "Log evidence": _evidence,
    }.items():
        rows = [[peer.label, *(cell(peer.fits[name]) for name in FORMULATIONS)] for peer in peers]
        yield f"### {title}"
        yield table(["library", *FORMULATIONS], [row for row in rows if set(row[1:]) != {"none"}])


def summary(peers: Sequence[Peer]) -> Iterator[list[str]]:
    """Yield a row for every library; tissuq comes first."""
    reference = peers[0]
    for peer in peers:
        rates = [fit["ess_C10"] / fit["seconds"] for fit in peer.fits.values()]
        off = [abs(fit["mean"] - reference.fits[n]["mean"]) / reference.fits[n]["sd"] for n, fit in peer.fits.items()]
        yield [
            peer.label,
            median_and_range(peer.walls),
            "1" if peer is reference else _ratio(peer.walls, reference.walls),
            median_and_range(peer.processor),
            "1" if peer is reference else _ratio(peer.processor, reference.processor),
            f"{peer.first:.1f}",
            _evidence_off(peer, reference),
            "0" if peer is reference else f"{max(off):.3f}",
            f"{max(peer.worst('rhat')):.3f}" if peer.worst("rhat") else "none",
            f"{min(peer.worst('ess')):.0f}",
            f"{min(peer.worst('ess_C10')):.0f}",
            f"{min(rates):.0f}",
        ]


def _ratio(walls: Sequence[float], reference: Sequence[float]) -> str:
    middle = statistics.median(walls) / statistics.median(reference)
    return f"{middle:.1f} ({min(walls) / max(reference):.1f} to {max(walls) / min(reference):.1f})"


def _evidence_off(peer: Peer, reference: Peer) -> str:
    if peer is reference:
        return "yes"
    if not peer.worst("log_evidence"):
        return "none"
    off = {n: abs(fit["log_evidence"] - reference.fits[n]["log_evidence"]) for n, fit in peer.fits.items()}
    errors = max(off[name] / fit["log_evidence_error"] for name, fit in peer.fits.items())
    return f"yes, within {max(off.values()):.2f} ({errors:.1f} errors)"


def _seconds(fit: Mapping[str, float]) -> str:
    return f"{fit['seconds']:.2f}"


def _c10(fit: Mapping[str, float]) -> str:
    return f"{fit['mean']:.4f}, {fit['sd']:.4f}"


def _ess(fit: Mapping[str, float]) -> str:
    return f"{fit['ess_C10']:.0f}"


def _evidence(fit: Mapping[str, float | None]) -> str:
    if fit["log_evidence"] is None:
        return "none"
    error = f" ± {fit['log_evidence_error']:.2f}" if fit["log_evidence_error"] else ""
    return f"{fit['log_evidence']:.2f}{error}"


if __name__ == "__main__":
    main()
