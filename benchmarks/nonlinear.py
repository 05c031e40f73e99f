"""A nonlinear posterior: three-term Ogden with a Yeoh discrepancy and unknown noise, by three no-U-turn samplers.

Each library samples in a process of its own, in turn, with several seeds. Compilation is told apart: of JAX by the
events that it reports itself, of nutpie by the clock around its compile call.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from results import begin, median_and_range, table, write_section

STRETCH = np.linspace(0.6, 5.0, 60)
TRUTH = {"mu1": 0.4095, "mu2": 0.003, "mu3": 0.01, "alpha1": 1.3, "alpha2": 5.0, "alpha3": -2.0}
"""Ogden's values for Treloar's rubber (MPa), as 2 mu/alpha^2: his mu = 0.63, 0.0012, -0.01 times alpha / 2."""
NOISE_SD = 0.02

NORMAL = {"mu1": 2.0, "mu2": 2.0, "mu3": 2.0, "C20": 0.1, "C30": 0.1}
"""Standard deviations of the Gaussian priors about zero, MPa."""
UNIFORM = {"alpha1": (0.5, 3.0), "alpha2": (3.0, 8.0), "alpha3": (-6.0, -0.5), "S": (0.0, 1.0), "noise_sd": (0.0, 1.0)}
SYMBOLS = (*NORMAL, *UNIFORM)
MAX_RHAT = 1.01


def mean_stress(stretch: Any, values: Mapping[str, Any]) -> Any:
    """Return the engineering stress (MPa) of the material and of the discrepancy's Yeoh terms, in plain arithmetic."""
    ogden: Any = 0.0
    for i in "123":
        mu, alpha = values[f"mu{i}"], values[f"alpha{i}"]
        ogden = ogden + 2 * mu / alpha * (stretch ** (alpha - 1) - stretch ** (-alpha / 2 - 1))
    x = stretch**2 + 2 / stretch - 3
    slope = 2 * (stretch - stretch**-2)
    return ogden + slope * (2 * values["C20"] * x + 3 * values["C30"] * x**2)


EXACT = mean_stress(STRETCH, TRUTH | {"C20": 0.0, "C30": 0.0})
STRESS = EXACT + NOISE_SD * np.random.default_rng(1).standard_normal(len(STRETCH))


def of_tissuq(seed: int) -> dict[str, Any]:
    """Sample with the linear parameters integrated in closed form."""
    compiling = compile_clock()
    import tissuq as tq

    data = tq.Experiment(mode="uniaxial", stretch=STRETCH, stress=STRESS)
    priors = {s: tq.Normal(0.0, sd) for s, sd in NORMAL.items()} | {s: tq.Uniform(*b) for s, b in UNIFORM.items()}
    start = perf_counter()
    posterior = tq.fit(
        data, material="ogden-3", discrepancy="yeoh", noise="unknown", priors=priors, method="nuts", seed=seed
    )
    found = posterior.summary()
    seconds = perf_counter() - start
    quality = {symbol: (found.loc[symbol, "ess"], found.loc[symbol, "rhat"]) for symbol in SYMBOLS}
    means = {symbol: (found.loc[symbol, "mean"], found.loc[symbol, "sd"]) for symbol in SYMBOLS}
    return outcome(quality, means, seconds, compiling())


def of_numpyro(seed: int) -> dict[str, Any]:
    """Sample the full joint density with NumPyro."""
    compiling = compile_clock()
    import numpyro
    from numpyro import distributions as dist

    from peers.numpyro_ import jnp, sample

    def model() -> None:
        values = {symbol: numpyro.sample(symbol, dist.Normal(0.0, sd)) for symbol, sd in NORMAL.items()}
        values |= {symbol: numpyro.sample(symbol, dist.Uniform(*bounds)) for symbol, bounds in UNIFORM.items()}
        sd = jnp.sqrt(values["S"] ** 2 + values["noise_sd"] ** 2)
        numpyro.sample("stress", dist.Normal(mean_stress(STRETCH, values), sd), obs=STRESS)

    start = perf_counter()
    chains = sample(model, SYMBOLS, seed=seed)
    return of_chains(chains, perf_counter() - start, compiling())


def of_nutpie(seed: int) -> dict[str, Any]:
    """Sample the full joint density with PyMC and nutpie."""
    import pymc as pm
    import pytensor.tensor as pt

    from peers.nutpie_ import compiled, sample

    start = perf_counter()
    with pm.Model() as model:
        values = {symbol: pm.Normal(symbol, 0.0, sd) for symbol, sd in NORMAL.items()}
        values |= {symbol: pm.Uniform(symbol, *bounds) for symbol, bounds in UNIFORM.items()}
        sd = pt.sqrt(values["S"] ** 2 + values["noise_sd"] ** 2)
        pm.Normal("stress", mean_stress(pt.as_tensor(STRETCH), values), sd, observed=STRESS)
    program = compiled(model)
    compile_seconds = perf_counter() - start
    chains = sample(program, SYMBOLS, seed=seed)
    return of_chains(chains, perf_counter() - start, compile_seconds)


LIBRARIES: dict[str, tuple[str, Callable[[int], dict[str, Any]], tuple[str, ...]]] = {
    "tissuq": ("tissuq", of_tissuq, ("tissuq",)),
    "numpyro": ("NumPyro NUTS", of_numpyro, ("numpyro", "jax")),
    "nutpie": ("PyMC + nutpie (Numba)", of_nutpie, ("pymc", "nutpie", "numba")),
}


def of_chains(chains: Any, seconds: float, compile_seconds: float) -> dict[str, Any]:
    """Return the outcome of Markov chains."""
    ess, rhat = chains.quality
    quality = dict(zip(SYMBOLS, zip(ess, rhat, strict=True), strict=True))
    flat = chains.values.reshape(-1, len(SYMBOLS))
    means = dict(zip(SYMBOLS, zip(flat.mean(0), flat.std(0), strict=True), strict=True))
    return outcome(quality, means, seconds, compile_seconds)


def outcome(
    quality: Mapping[str, Sequence[float]], means: Mapping[str, Sequence[float]], seconds: float, compile_seconds: float
) -> dict[str, Any]:
    """Return what is compared: the parameter with the least ESS, the worst R-hat, the seconds, means and sds."""
    worst = min(quality, key=lambda symbol: quality[symbol][0])
    return {
        "worst": worst,
        "ess": float(quality[worst][0]),
        "rhat": float(max(rhat for _, rhat in quality.values())),
        "seconds": seconds,
        "compile_seconds": compile_seconds,
        "means": {symbol: [float(number) for number in pair] for symbol, pair in means.items()},
    }


def compile_clock() -> Callable[[], float]:
    """Return a function that says for how long JAX has traced and compiled since now."""
    import jax

    spans: list[tuple[float, float]] = []

    def listen(event: str, seconds: float, **_: object) -> None:
        if event.startswith("/jax/core/compile"):
            spans.append((perf_counter() - seconds, perf_counter()))

    jax.monitoring.register_event_duration_secs_listener(listen)

    def total() -> float:
        covered, end = 0.0, 0.0
        for first, last in sorted(spans):
            covered += max(0.0, last - max(first, end))
            end = max(end, last)
        return covered

    return total


def run(library: str, seed: int) -> dict[str, Any]:
    """Sample in a process of its own, with empty compile caches."""
    with tempfile.TemporaryDirectory() as caches:
        environment = os.environ | {"PYTENSOR_FLAGS": f"base_compiledir={caches}", "NUMBA_CACHE_DIR": caches}
        ended = subprocess.run(
            [sys.executable, Path(__file__).name, "--library", library, "--seed", str(seed)],
            cwd=Path(__file__).parent, env=environment, capture_output=True, text=True, check=False,
        )  # fmt: skip
    if ended.returncode:
        raise SystemExit(f"{library} failed:\n{ended.stderr}")
    return json.loads(ended.stdout.splitlines()[-1])


def main() -> None:
    """Run all libraries in turn and write RESULTS.md."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=3, help="seeds")
    parser.add_argument("--library", choices=LIBRARIES, help="sample once in this process and print JSON")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    if given.library:
        print(json.dumps(LIBRARIES[given.library][1](given.seed)))
        return
    packages = dict.fromkeys(package for _, _, needed in LIBRARIES.values() for package in needed)
    measured = begin("python benchmarks/nonlinear.py", (*packages, "pytensor", "blackjax", "arviz-stats"))
    missing = {name: next((p for p in entry[2] if find_spec(p) is None), "") for name, entry in LIBRARIES.items()}
    absent = [
        f"Absent: {LIBRARIES[name][0]} ({package} is not installed)." for name, package in missing.items() if package
    ]
    runs: dict[str, list[dict[str, Any]]] = {name: [] for name, package in missing.items() if not package}
    for seed in range(1, given.repeats + 1):
        for library, found in runs.items():
            found.append(run(library, seed))
            print(library, {key: value for key, value in found[-1].items() if key != "means"}, flush=True)
    write_section("A nonlinear posterior", measured, NOTES, *absent, table(HEADER, rows(runs)))


HEADER = (
    "library",
    "seconds",
    "of them compiling",
    "least ESS",
    "of",
    "worst R-hat",
    "converged",
    "ESS/s",
    "ESS/s without compiling",
    "tissuq's ESS/s over its",
    "the same without compiling",
)
NOTES = """Three-term Ogden with a Yeoh discrepancy, S and noise_sd unknown (10 parameters), 60 points of Ogden's rubber
with noise of 0.02 MPa. Four chains of 1000 draws after 1000 of warm-up on the full joint density; tissuq with its
defaults for `method="nuts"`. ESS is the least over the parameters of ArviZ's bulk and tail values. A run has converged
if every R-hat is below 1.01; if not, its ESS says nothing but that the run is of no use. Median and range over seeds,
every run in a new process with empty compile caches; imports are left out."""


def rows(runs: Mapping[str, Sequence[Mapping[str, Any]]]) -> list[list[str]]:
    """Return a row for every library."""
    full = {name: [run["ess"] / run["seconds"] for run in found] for name, found in runs.items()}
    bare = {name: [r["ess"] / (r["seconds"] - r["compile_seconds"]) for r in found] for name, found in runs.items()}
    cells = []
    for name, found in runs.items():
        converged = sum(run["rhat"] < MAX_RHAT for run in found)
        gains = [_gain(rates, name) if converged else "not converged" for rates in (full, bare)]
        cells.append(
            [
                LIBRARIES[name][0],
                median_and_range([run["seconds"] for run in found]),
                median_and_range([run["compile_seconds"] for run in found]),
                median_and_range([run["ess"] for run in found], 0),
                ", ".join(dict.fromkeys(run["worst"] for run in found)),
                median_and_range([run["rhat"] for run in found], 3),
                f"{converged} of {len(found)}",
                median_and_range(full[name]),
                median_and_range(bare[name]),
                *gains,
            ]
        )
    return cells


def _gain(rates: Mapping[str, Sequence[float]], name: str) -> str:
    """Return how many times the rate of a library tissuq reaches."""
    return f"{statistics.median(rates['tissuq']) / statistics.median(rates[name]):.1f}"


if __name__ == "__main__":
    main()
