"""Coverage of intervals from an emulated finite-element model: what its error, the discrepancy and the noise do.

A flat punch is pressed into a disc of soft tissue (1.7 s a run). Every case takes its true materials from runs that the
emulator has not seen, adds noise that is a share of the largest force, and counts how often the 95 % intervals hold the
truth; where the model is wrong, that of C10, half the initial shear modulus.

    python benchmarks/expensive_models.py --runs-in runs/indentation --replicates 96

With --closed-form the disc is compressed as a whole, whose force has a closed form, so that the runs cost nothing:

    python benchmarks/expensive_models.py --closed-form --replicates 60
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import tissuq as tq
from tissuq.emulation import Emulator, ForwardRuns, emulate
from tissuq.emulation.forward import as_forward
from tissuq.emulation.problem import pose
from tissuq.emulation.runs import space_filling
from tissuq.studies.calibrate import runs_of

Forward = Callable[[dict[str, float], NDArray[np.float64]], NDArray[np.float64]]

DEPTH = np.linspace(0.06, 0.9, 15)
"""mm; the punch has a radius of 0.75 mm, the disc a height of 5 mm."""
KILO = 1e-3


def neo_hooke(parameters: dict[str, float], depth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return forces in mN of a neo-Hookean block; C10 in kPa."""
    return _force("neo-hookean", [parameters["C10"]], depth)


def yeoh(parameters: dict[str, float], depth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return forces in mN of a Yeoh block without C30; C10 and C20 in kPa."""
    return _force("yeoh", [parameters["C10"], parameters["C20"], 0.0], depth)


def energy(parameters: dict[str, float], depth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return forces in mN of a neo-Hookean block whose error is an energy, two further terms of Yeoh's; all in kPa."""
    return _force("yeoh", [parameters["C10"], parameters["C20"], parameters["C30"]], depth)


def ogden(parameters: dict[str, float], depth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return forces in mN of an Ogden block; mu, the initial shear modulus, in kPa."""
    from tissuq.finite_elements import indentation_force

    return indentation_force("ogden-1", [KILO * parameters["mu"], parameters["alpha"]], depth) / KILO


def _force(material: str, values: list[float], depth: NDArray[np.float64]) -> NDArray[np.float64]:
    from tissuq.finite_elements import indentation_force

    return indentation_force(material, KILO * np.array(values), depth) / KILO


MAX_I1 = 0.35
"""About I1 - 3 of the disc that is compressed as a whole, at the largest depth."""


def nearly_neo_hooke(parameters: dict[str, float], depth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return forces in mN of a Yeoh block whose second term is a small share of the first at the largest depth."""
    return yeoh(_with_c20(parameters), depth)


def _with_c20(parameters: dict[str, float]) -> dict[str, float]:
    return {"C10": parameters["C10"], "C20": parameters["share"] * parameters["C10"] / (2 * MAX_I1)}


SOFTENING_DEPTH = 0.3
"""mm, over which a block softens, a third of the largest depth."""


def softening(parameters: dict[str, float], depth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return forces in mN of a neo-Hookean block that soon carries a share less than at the beginning."""
    return _softened(neo_hooke, parameters, depth)


def _softened(forward: Forward, parameters: dict[str, float], depth: NDArray[np.float64]) -> NDArray[np.float64]:
    return forward(parameters, depth) * (1 - parameters["share"] * -np.expm1(-((depth / SOFTENING_DEPTH) ** 2)))


HEIGHT = 3.0
"""mm, of the disc that is compressed as a whole: by up to 30 %."""


def compressed_neo_hooke(parameters: dict[str, float], depth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return forces in mN of a neo-Hookean disc of 1 mm2 without friction; C10 in kPa."""
    return compressed_yeoh(parameters | {"C20": 0.0}, depth)


def compressed_yeoh(parameters: dict[str, float], depth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return forces in mN of a Yeoh disc."""
    stretch = 1 - depth / HEIGHT
    x = stretch**2 + 2 / stretch - 3  # I1 - 3
    slope = parameters["C10"] + 2 * parameters["C20"] * x + 3 * parameters.get("C30", 0.0) * x**2
    return np.asarray(2 * slope * (stretch**-2 - stretch))


def compressed_nearly_neo_hooke(parameters: dict[str, float], depth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return forces in mN of a disc that is nearly neo-Hookean."""
    return compressed_yeoh(_with_c20(parameters), depth)


def compressed_softening(parameters: dict[str, float], depth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return forces in mN of a neo-Hookean disc that softens."""
    return _softened(compressed_neo_hooke, parameters, depth)


def compressed_ogden(parameters: dict[str, float], depth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return forces in mN of an Ogden disc."""
    mu, alpha, stretch = parameters["mu"], parameters["alpha"], 1 - depth / HEIGHT
    return np.asarray(2 * mu / alpha * (stretch ** (-alpha / 2 - 1) - stretch ** (alpha - 1)))


PRIORS = {
    "neo-hooke": {"C10": tq.Uniform(0.05, 4)},
    "yeoh": {"C10": tq.Uniform(0.2, 2), "C20": tq.Uniform(0, 2)},
    "nearly": {"C10": tq.Uniform(0.05, 4), "share": tq.Uniform(0.01, 0.03)},
    "softening": {"C10": tq.Uniform(0.05, 4), "share": tq.Uniform(0.05, 0.2)},
    "energy": {"C10": tq.Uniform(0.05, 4), "C20": tq.HalfNormal(10), "C30": tq.HalfNormal(50)},
    "ogden": {"mu": tq.Uniform(0.4, 4), "alpha": tq.Uniform(-20, -3)},
}
FORWARD: dict[str, Forward] = {
    "neo-hooke": neo_hooke,
    "nearly": nearly_neo_hooke,
    "softening": softening,
    "yeoh": yeoh,
    "energy": energy,
    "ogden": ogden,
}
CLOSED_FORM: dict[str, Forward] = {
    "neo-hooke": compressed_neo_hooke,
    "nearly": compressed_nearly_neo_hooke,
    "softening": compressed_softening,
    "yeoh": compressed_yeoh,
    "energy": compressed_yeoh,
    "ogden": compressed_ogden,
}


@dataclass(frozen=True)
class Case:
    """A truth, a model, and what is told of its error."""

    truth: str
    model: str
    runs: int
    discrepancy: str = "none"
    has_error: bool = True
    design_varies: bool = False
    """Whether every data set gets an emulator from runs of its own, chosen at random."""
    noise: float = 0.01
    """Of the largest force."""

    @property
    def label(self) -> str:
        """What a table calls it."""
        error = "yes" if self.has_error else "no"
        return f"{self.truth} | {self.model} | {self.runs} | {self.discrepancy} | {self.noise:.1%} | {error}"


CASES = [
    Case("neo-hooke", "neo-hooke", 8),
    Case("yeoh", "yeoh", 24),
    Case("ogden", "ogden", 24),
    *(Case(truth, "neo-hooke", 8, kind) for truth in ("nearly", "softening") for kind in ("none", "gp-pinned")),
    *(Case(truth, "neo-hooke", 8, kind) for truth in ("yeoh", "ogden") for kind in ("none", "gp", "gp-pinned")),
    *(Case(truth, "energy", 40, kind) for truth in ("yeoh", "ogden") for kind in ("none", "gp-pinned")),
    *(Case(name, name, runs, "gp-pinned") for name, runs in (("neo-hooke", 8), ("yeoh", 24), ("ogden", 24))),
    *(Case(name, name, 8, "none", error, True, 0.001) for name in ("yeoh", "ogden") for error in (True, False)),
]


def main() -> None:
    """Print a table of coverage, and of the intervals' widths."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--runs-in", type=Path, default=Path("runs/indentation"))
    options.add_argument("--pool", type=int, default=120, help="runs of each model")
    options.add_argument("--replicates", type=int, default=96)
    options.add_argument("--workers", type=int, default=1)
    options.add_argument("--closed-form", action="store_true", help="of a disc that is compressed as a whole")
    options.add_argument("--model", help="only rows with this model")
    asked = options.parse_args()
    if asked.closed_form:
        FORWARD.update(CLOSED_FORM)
        asked.runs_in = asked.runs_in.with_name(f"{asked.runs_in.name}-closed-form")
    cases = [case for case in CASES if asked.model in (None, case.model)]
    needed = {name for case in cases for name in (case.truth, case.model)}
    pools = {name: _pool(name, asked) for name in FORWARD if name in needed}
    print(
        "truth | model | runs | discrepancy | noise | emulator error | parameter | coverage | median width / truth | n"
    )
    for case in cases:
        for symbol, rows in _counted(case, pools, asked.replicates).items():
            inside, width = np.array(rows).T
            error = np.sqrt(inside.mean() * (1 - inside.mean()) / len(inside))
            print(
                f"{case.label} | {symbol} | {inside.mean():.1%} ± {error:.1%} | {np.median(width):.3f} | {len(inside)}",
                flush=True,
            )


def _pool(name: str, asked: argparse.Namespace) -> ForwardRuns:
    """Return runs of a model over its priors, from disk where they are."""
    count = 24 if name == "neo-hooke" else asked.pool
    problem = pose(DEPTH, np.ones_like(DEPTH), PRIORS[name])
    points = space_filling(PRIORS[name], count, seed=1)
    with runs_of(as_forward(FORWARD[name]), problem, asked.runs_in / name, asked.workers, lambda *_: None) as run:
        found = run(points)
    print(f"{name}: {len(found)} runs of {np.median(found.seconds):.1f} s. {found.failure_summary or 'None failed.'}")
    return found


def _counted(case: Case, pools: dict[str, ForwardRuns], replicates: int) -> dict[str, list[tuple[bool, float]]]:
    """Return, for every parameter, whether the interval held the truth and its width over the truth."""
    found: dict[str, list[tuple[bool, float]]] = {}
    own = pools[case.model]
    generator = np.random.default_rng(7)
    fixed = None if case.design_varies else emulate(_some(own, np.arange(case.runs)), DEPTH, priors=PRIORS[case.model])
    others = np.flatnonzero(~pools[case.truth].failed)
    others = others[others >= case.runs] if case.truth == case.model and fixed is not None else others
    for number in range(replicates):
        truth = int(generator.choice(others))
        emulator = fixed or _random_emulator(own, case.runs, truth, generator, PRIORS[case.model])
        force = pools[case.truth].outputs[truth]
        noise = case.noise * force.max()
        measured = force + noise * generator.standard_normal(len(force))
        calibration = tq.calibrate(DEPTH, measured, FORWARD[case.model], PRIORS[case.model], emulator=emulator,
                                   discrepancy=case.discrepancy, noise_sd=noise, seed=number)  # fmt: skip
        calibration = calibration if case.has_error else calibration.without_emulator_error
        known = _truths(case, dict(zip(PRIORS[case.truth], pools[case.truth].points[truth], strict=True)))
        for symbol, value in known.items():
            low, high = calibration.marginals[symbol].hdi()
            found.setdefault(symbol, []).append((low <= value <= high, (high - low) / abs(value)))
    return found


def _truths(case: Case, parameters: dict[str, float]) -> dict[str, float]:
    """Return the true values of the model's parameters: outside its family, of the initial shear modulus alone."""
    if case.truth == case.model:
        return parameters
    return {"C10": parameters["C10"] if "C10" in parameters else 0.5 * parameters["mu"]}


def _random_emulator(
    runs: ForwardRuns, count: int, but: int, generator: np.random.Generator, priors: dict[str, tq.Prior]
) -> Emulator:
    able = np.flatnonzero(~runs.failed)
    chosen = generator.choice(able[able != but], count, replace=False)
    return emulate(_some(runs, chosen), DEPTH, priors=priors)


def _some(runs: ForwardRuns, chosen: NDArray[np.intp]) -> ForwardRuns:
    errors = tuple(runs.errors[k] for k in chosen)
    return ForwardRuns(runs.symbols, runs.points[chosen], runs.outputs[chosen], errors, runs.seconds[chosen])


if __name__ == "__main__":
    main()
