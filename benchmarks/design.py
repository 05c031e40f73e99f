"""Whether a test lowers the uncertainty by as much as `tissuq design` expects, by simulation and in measured data.

Simulated: outcomes of a candidate test are drawn from what the posterior predicts of it, data and outcome are fitted
together with the same priors, and the root mean square of the standard deviations is held against the expected one.
Measured: uniaxial data sets that come with planar and equibiaxial ones of the same material are fitted alone and with
the one or the other. `python benchmarks/design.py` prints both.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import tissuq as tq
from tissuq.assessment.modulus import modulus
from tissuq.inference.quasi_monte_carlo import systematic
from tissuq.next_test.candidates import reach_of
from tissuq.next_test.expected_variance import joint_stresses, states_of
from tissuq.next_test.next_test import NextTest
from tissuq.next_test.targets import target_named

TRUTH = {"C10": 0.5, "C20": 0.05, "C30": 0.0}
STRETCH = np.linspace(0.75, 1.5, 20)
NONE = tq.Tolerances()


@dataclass(frozen=True)
class Case:
    """Data, how they are fitted, and the test that is to come."""

    name: str
    data: tq.Experiment
    candidate: tq.Candidate
    target: str = "modulus"
    options: dict[str, Any] = field(default_factory=dict)


def cases() -> Iterator[Case]:
    """Yield what is simulated."""
    data = tq.simulate("yeoh", TRUTH, STRETCH, noise_sd=0.02, seed=1)
    brain = tq.datasets.load("brain-cortex-uniaxial")
    again, planar = tq.Candidate("uniaxial", STRETCH), tq.Candidate("planar", np.linspace(1.02, 1.45, 20))
    far = tq.Candidate("uniaxial", np.linspace(0.68, 1.6, 20))
    known = {"noise_sd": 0.02}
    yield Case("yeoh mean, noise unknown", data, again, options={"discrepancy": "yeoh", "noise_sd": "unknown"})
    yield Case("gp in stress, noise known", data, again, "C10", known | {"discrepancy": "gp"})
    yield Case("auto, noise known", data, again, options=known)
    yield Case("auto, noise unknown", data, again)
    yield Case("auto, noise known, planar", data, planar, options=known)
    yield Case("auto, noise known, planar, stress there", data, planar, "planar:1.4", known)
    yield Case("auto, noise known, planar, equibiaxial stress", data, planar, "equibiaxial:1.2", known)
    yield Case("auto, noise unknown, planar", data, planar)
    yield Case("auto, noise known, beyond the data", data, far, options=known)
    yield Case("brain cortex, auto, noise unknown", brain, tq.Candidate("uniaxial", np.linspace(0.9, 1.1, 34)))
    yield Case("brain cortex, auto, noise unknown, planar", brain, tq.Candidate("planar", np.linspace(0.92, 1.09, 34)))


def outcomes(posterior: tq.Posterior, candidate: tq.Candidate, count: int, seed: int) -> list[tq.Experiment]:
    """Return outcomes of a test as a posterior predicts them, with its noise."""
    model, parts = posterior.model, posterior.solution.mixture
    parts = parts[systematic(parts.weights[None], count)[0]]
    generator = np.random.default_rng(seed)
    mean, root = joint_stresses(model, parts, states_of(model, [(candidate.mode, candidate.stretch)]))
    stress = mean + np.einsum("mgr,mr->mg", root, generator.standard_normal((count, root.shape[2])))
    values = {symbol: own[:, None] for symbol, own in zip(model.nonlinear, parts.settings.T, strict=True)}
    sd = np.sqrt(np.broadcast_to(model.white_variance(values), stress.shape))
    stress = stress + sd * generator.standard_normal(stress.shape)
    return [tq.Experiment(candidate.mode, candidate.stretch, own, "new") for own in stress]


def simulated(case: Case, count: int, seed: int) -> tuple[float, float, float, float]:
    """Return the sd of the target after the test over that before: expected and its error, found and its error."""
    before = tq.fit(case.data, **case.options, tolerances=NONE)
    target = target_named(case.target, before.model)
    asked = NextTest(before.solution, [target])
    expected = asked.expected(case.candidate)
    options = case.options | {"priors": before.model.priors}
    tests = outcomes(before, case.candidate, count, seed)
    same = case.candidate.mode == case.data.mode  # then it is more of the same test
    sets = [case.data.joined(test) if same else [case.data, test] for test in tests]
    after = tq.fit_many(sets, **options, tolerances=NONE)
    variances = np.array([_sd(posterior, case.target) ** 2 for posterior in after]) / asked.sd_now[0] ** 2
    error = variances.std(ddof=1) / np.sqrt(count)
    found = np.sqrt(variances.mean())
    return (
        float(expected.sd_after[0] / expected.sd_now[0]),
        float(expected.error[0]),
        float(found),
        float(error / (2 * found)),
    )


def _sd(posterior: tq.Posterior, target: str) -> float:
    if target in posterior.model.symbols:
        return posterior.marginals[target].sd
    if target == "modulus":
        return modulus(posterior.solution).sd
    return float(NextTest(posterior.solution, [target_named(target, posterior.model)]).sd_now[0])


def measured() -> Iterator[str]:
    """Yield what a second test of rubber and silicone did, against what was expected of it.

    Of the second test only what lies within the invariants of the first one counts; the two as tests of one specimen,
    and of two whose stresses differ by 18 %.
    """
    targets = ("modulus", "equibiaxial:1.5", "planar:1.5")
    for family in ("rubber-treloar", "silicone-meunier"):
        uniaxial = tq.datasets.load(f"{family}-uniaxial")
        before = tq.fit(uniaxial, tolerances=NONE)
        for mode in ("equibiaxial", "planar"):
            whole = tq.datasets.load(f"{family}-{mode}")
            inside = reach_of(uniaxial, whole.mode, whole.stretch) <= 1
            test = tq.Experiment(whole.mode, whole.stretch[inside], whole.stress[inside], whole.name)
            candidate = tq.Candidate(mode, test.stretch)
            for specimen, tolerances in (("same", NONE), ("other", tq.Tolerances(stress=0.18))):
                asked = NextTest(before.solution, [target_named(each, before.model) for each in targets], specimen)
                expected, after = asked.expected(candidate), tq.fit([uniaxial, test], tolerances=tolerances)
                for place, target in enumerate(targets):
                    numbers = expected.sd_now[place], expected.sd_after[place], _sd(after, target)
                    cells = " | ".join(f"{number:.3g}" for number in numbers)
                    yield f"| {family}, {candidate.name} | {specimen} | {target} | {cells} |"


def main() -> None:
    """Print both."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--only", default="")
    parser.add_argument("--measured", action="store_true", help="only the measured ones")
    options = parser.parse_args()
    print("| case | target | expected sd ratio | found |\n|---|---|---|---|")
    for case in cases():
        if options.only in case.name and not options.measured:
            found = simulated(case, options.count, options.seed)
            print("| {} | {} | {:.3f} ± {:.3f} | {:.3f} ± {:.3f} |".format(case.name, case.target, *found), flush=True)
    if not options.only:
        print("\n| test | specimen | target | sd now, MPa | expected | found |\n|---|---|---|---|---|---|")
        for line in measured():
            print(line, flush=True)


if __name__ == "__main__":
    main()
