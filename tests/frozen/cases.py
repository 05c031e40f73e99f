"""Reference posteriors, computed with public names alone: what they are made of, and the numbers that describe them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

import tissuq as tq

NORMAL_RANGE = 3.2897
"""Width of the central 90 % of a Gaussian, in standard deviations."""
QUANTILES = (0.05, 0.5, 0.95)
STATED_ERROR = "stated error of log evidence"
"""Shown, not compared: by how much another way of integration may differ."""


@dataclass(frozen=True)
class Number:
    """A value, and the size to which a deviation is compared where the value itself is smaller."""

    value: float
    scale: float


Numbers = dict[str, Number]


@dataclass(frozen=True)
class Case:
    """A reference posterior.

    Attributes
    ----------
    compute : callable
        Returns its numbers for a seed, with the measured stresses changed by a relative rounding error.
    is_sampled : bool
        Whether they depend on the seed, so that they are compared in standard errors.
    is_quick : bool
        Whether the test suite computes it.
    """

    compute: Callable[[int, float], Numbers]
    is_sampled: bool = False
    is_quick: bool = False


# Data ----------------------------------------------------------------------------------------------------------------

YEOH = {"C10": 1.2, "C20": -0.057, "C30": 0.004}
BOUNDS = {
    **{symbol: tq.Uniform(-50, 50) for symbol in ("m0", "m1", "m2", "C01", "C20", "C30")},
    "C10": tq.Uniform(0, 10),
    "S": tq.Uniform(0, 10),
    "c": tq.Uniform(0, 1),
    "psi": tq.Uniform(0.05, 10),
}
PARAMETERS = {
    "none": "",
    "constant": "m0 S",
    "linear": "m0 m1 S",
    "quadratic": "m0 m1 m2 S",
    "mooney-rivlin": "C01 S",
    "yeoh": "C20 C30 S",
    "gp": "c psi",
}


def paper_example() -> tq.Experiment:
    """Return the example of Zeraatpisheh et al. (2021)."""
    return tq.simulate("yeoh", YEOH, np.linspace(0.5, 4.25, 30), noise_sd=0.5, seed=1)


def soft_tissue(mode: str = "uniaxial", seed: int = 2, noise_sd: float = 0.02) -> tq.Experiment:
    """Return a stiffening material at moderate stretches."""
    stretch = np.linspace(0.05, 0.9, 12) if mode == "simple-shear" else np.linspace(0.7, 1.8, 14)
    return tq.simulate("yeoh", {"C10": 0.5, "C20": 0.1, "C30": 0.01}, stretch, noise_sd, seed, mode)


def repeated() -> tq.Experiment:
    """Return three measurements at every stretch."""
    stretch = np.repeat(np.linspace(0.75, 1.7, 8), 3)
    return tq.simulate("yeoh", {"C10": 0.5, "C20": 0.1, "C30": 0.0}, stretch, noise_sd=0.03, seed=3)


def drifting() -> tq.Experiment:
    """Return a test whose consecutive errors are correlated."""
    stretch = np.linspace(0.7, 1.8, 24)
    errors = 0.03 * np.random.default_rng(4).standard_normal(24)
    for number in range(1, 24):
        errors[number] += 0.7 * errors[number - 1]
    exact = tq.simulate("neo-hookean", {"C10": 0.5}, stretch)
    return tq.Experiment("uniaxial", stretch, exact.stress + errors)


def growing() -> tq.Experiment:
    """Return a test whose errors grow with the stress."""
    exact = tq.simulate("neo-hookean", {"C10": 0.5}, np.linspace(0.6, 2.2, 20))
    errors = np.random.default_rng(5).standard_normal(20) * (0.01 + 0.05 * np.abs(exact.stress))
    return tq.Experiment("uniaxial", exact.stretch, exact.stress + errors)


def biaxial() -> tq.Experiment:
    """Return a biaxial test with both stresses."""
    pairs = [(a, b) for a in (0.95, 1.1, 1.25, 1.4) for b in (1.0, 1.2)]
    return tq.simulate("mooney-rivlin", {"C10": 0.4, "C01": 0.08}, pairs, noise_sd=0.02, seed=6, mode="biaxial")


def strips() -> tuple[tq.Experiment, ...]:
    """Return uniaxial tests along both axes of a tissue with fibres."""
    truth, stretch = {"C10": 0.4, "k": 1.5}, np.linspace(1.05, 1.4, 8)
    return tuple(
        tq.simulate("neo-hookean+standard-fibres@40", truth, stretch, noise_sd=0.02, seed=seed, mode=mode)
        for seed, mode in enumerate(("uniaxial", "uniaxial@2"), 13)
    )


def three_modes() -> tuple[tq.Experiment, ...]:
    """Return a test in each of three modes."""
    return tuple(soft_tissue(mode, seed) for seed, mode in enumerate(("uniaxial", "equibiaxial", "simple-shear"), 10))


def brain() -> tuple[tq.Experiment, ...]:
    """Return tests of human brain in two modes."""
    return tuple(tq.datasets.load(f"brain-cortex-{mode}") for mode in ("uniaxial", "shear"))


def specimens(count: int) -> tuple[tq.Experiment, ...]:
    """Return tests of specimens that differ in stiffness."""
    factors = np.exp(0.25 * np.random.default_rng(7).standard_normal(count))
    stretch = np.linspace(0.8, 1.4, 8)
    return tuple(
        tq.Experiment(
            "uniaxial",
            stretch,
            tq.simulate("neo-hookean", {"C10": 0.5 * factor}, stretch, noise_sd=0.01, seed=20 + number).stress,
            name=f"specimen {number}",
        )
        for number, factor in enumerate(factors)
    )


def indentation(parameters: Mapping[str, float], depth: np.ndarray) -> np.ndarray:
    """Return the force of an exponential law: a forward model that costs nothing."""
    return parameters["mu"] * np.expm1(parameters["b"] * depth)


def rounded(test: Any, rounding: float) -> Any:
    """Return a test, or several, with stresses changed by a relative rounding error."""
    if isinstance(test, tuple):
        return tuple(rounded(part, rounding) for part in test)
    if not rounding:
        return test
    factors = 1 + rounding * np.random.default_rng(9).uniform(-1, 1, test.stress.shape)
    return tq.Experiment(test.mode, test.stretch, test.stress * factors, name=test.name, specimen=test.specimen)


# Numbers -------------------------------------------------------------------------------------------------------------


def of_marginal(symbol: str, marginal: Any) -> Iterator[tuple[str, Number]]:
    """Yield mean, standard deviation and quantiles."""
    low, middle, high = (float(value) for value in marginal.quantile(QUANTILES))
    scale = (high - low) / NORMAL_RANGE
    if np.isfinite(marginal.mean) and np.isfinite(marginal.sd):
        yield f"{symbol} mean", Number(float(marginal.mean), scale)
        yield f"{symbol} sd", Number(float(marginal.sd), scale)
    for name, value in zip(("5 %", "median", "95 %"), (low, middle, high), strict=True):
        yield f"{symbol} {name}", Number(value, scale)


def of_band(name: str, band: Any) -> Iterator[tuple[str, Number]]:
    """Yield the ends and the middle of a predicted band."""
    for row in range(len(band)):
        values = band.iloc[row]
        scale = 0.5 * float(values["high"] - values["low"])
        for column in ("mean" if "mean" in band else "median", "low", "high"):
            yield f"{name} {row + 1} {column}", Number(float(values[column]), scale)


def of_posterior(
    posterior: tq.Posterior,
    at: Any = (0.9, 1.3),
    other: str = "",
    other_at: Sequence[float] = (1.2,),
    with_leave_one_out: bool = False,
) -> Numbers:
    """Return what describes a posterior: marginals, evidence, and predictions in its mode and another one."""
    numbers: Numbers = {}
    for symbol, marginal in posterior.marginals.items():
        numbers |= of_marginal(symbol, marginal)
    numbers |= of_marginal("initial shear modulus", posterior.initial_shear_modulus)
    if posterior.log_evidence is not None:
        numbers["log evidence"] = Number(posterior.log_evidence, 1.0)
        numbers[STATED_ERROR] = Number(posterior.log_evidence_error or 0.0, 1.0)
    if at is not None:
        numbers |= of_band("measurement", posterior.predict(at, unit="MPa"))
        numbers |= of_band("material", posterior.predict(at, discrepancy=False, noise=False, unit="MPa"))
    if other:
        numbers |= of_band(other, posterior.predict(other_at, mode=other, noise=False, unit="MPa"))
    if with_leave_one_out:
        left_out = posterior.data["leave_one_out"]["log_density"].to_numpy()
        numbers["leave-one-out"] = Number(float(left_out.sum()), 1.0)
    return numbers


def fitted(
    data: Callable[[], Any], options: Mapping[str, Any], description: Mapping[str, Any], seed: int, rounding: float
) -> Numbers:
    """Return the numbers of `tissuq.fit`; of one test, unless said, as tested."""
    tests = tq.Experiment.of(rounded(data(), rounding))
    defaults = {"tolerances": "as-tested"} if len(tests.tests) == 1 else {}
    return of_posterior(tq.fit(tests, seed=seed, **(defaults | options)), **description)


def fit_case(
    data: Callable[[], Any],
    *,
    at: Any = (0.9, 1.3),
    other: str = "",
    other_at: Sequence[float] = (1.2,),
    with_leave_one_out: bool = False,
    is_sampled: bool = False,
    is_quick: bool = False,
    **options: Any,
) -> Case:
    """Return the case of one fit; further options are those of `tissuq.fit`."""
    description = {"at": at, "other": other, "other_at": other_at, "with_leave_one_out": with_leave_one_out}
    return Case(partial(fitted, data, options, description), is_sampled, is_quick)


def many(seed: int, rounding: float) -> Numbers:
    """Return the numbers of experiments that are fitted together, two of them on the same stretches."""
    tests = rounded((soft_tissue(seed=2), soft_tissue(seed=3), soft_tissue("equibiaxial", 4)), rounding)
    numbers: Numbers = {}
    for number, posterior in enumerate(tq.fit_many(tests, discrepancy="yeoh", seed=seed), 1):
        numbers |= {f"{number}: {name}": value for name, value in of_posterior(posterior).items()}
    return numbers


def updated(seed: int, rounding: float) -> Numbers:
    """Return the numbers of a posterior after further measurements."""
    before = tq.fit(rounded(soft_tissue(seed=2), rounding), discrepancy="yeoh", seed=seed)
    more = tq.simulate("yeoh", {"C10": 0.5, "C20": 0.1, "C30": 0.01}, [0.8, 1.25, 1.9], 0.02, seed=8)
    return of_posterior(before.update(more))


def assessed(seed: int, rounding: float) -> Numbers:
    """Return what the assessment of a discrepancy says."""
    assessment = tq.fit(rounded(soft_tissue(), rounding), discrepancy="auto", noise_sd=0.02, seed=seed).assess()
    numbers = {
        f"{name} {place}": Number(float(value), 1e-3)
        for name in ("share", "modulus")
        for place, value in zip(("mean", "low", "high"), getattr(assessment, name), strict=True)
    }
    numbers |= {f"member {name}": Number(float(value), 1e-3) for name, value in assessment.members.items()}
    numbers["between"] = Number(float(assessment.between), 1e-3)
    numbers["probability of none"] = Number(float(assessment.probability_of_none), 1e-12)
    return numbers


def pooled(seed: int, rounding: float) -> Numbers:
    """Return the numbers of a population."""
    population = tq.fit_population(
        {test.name: test for test in rounded(specimens(5), rounding)}, discrepancy="none", noise_sd=0.01, seed=seed
    )
    numbers: Numbers = {}
    for prefix, table in (("population", population.summary()), ("specimen", population.specimen_summary())):
        for index, row in table.iterrows():
            scale = float(row["hdi_high"] - row["hdi_low"]) / 4
            for column in ("median", "hdi_low", "hdi_high"):
                numbers[f"{prefix} {' '.join(index)} {column}"] = Number(float(row[column]), scale)
    return numbers


def calibrated(seed: int, rounding: float) -> Numbers:
    """Return the numbers of the calibration of a forward model."""
    depth = np.linspace(0.1, 1, 12)
    measured = indentation({"mu": 0.4, "b": 1.5}, depth) + 0.01 * np.random.default_rng(1).standard_normal(12)
    calibration = tq.calibrate(
        depth,
        measured * (1 + rounding),
        indentation,
        {"mu": tq.Uniform(0.1, 1), "b": tq.Uniform(0.5, 3)},
        discrepancy="none",
        noise_sd=0.01,
        runs=20,
        seed=seed,
    )
    numbers: Numbers = {}
    for symbol, marginal in calibration.marginals.items():
        numbers |= of_marginal(symbol, marginal)
    if calibration.log_evidence is not None:
        numbers["log evidence"] = Number(calibration.log_evidence, 1.0)
    return numbers | dict(of_band("force", calibration.predict().iloc[[2, 9]]))


# Cases ---------------------------------------------------------------------------------------------------------------


def paper_case(form: str, **options: Any) -> Case:
    """Return the case of one of the paper's formulations with its uniform priors."""
    priors = {symbol: BOUNDS[symbol] for symbol in ("C10", *PARAMETERS[form].split())}
    defaults: dict[str, Any] = {"at": (1.4, 3.5), "noise_sd": 0.5, "priors": priors}
    return fit_case(paper_example, discrepancy=form, **(defaults | options))


paper = partial(fit_case, paper_example, at=(1.4, 3.5), noise_sd=0.5)
tissue = partial(fit_case, soft_tissue)
CUT = {"C10": tq.Uniform(0, 1.05), "C20": tq.Uniform(-0.02, 1), "C30": tq.Uniform(0, 0.0025)}

CASES: dict[str, Case] = {
    **{
        f"paper-{form}": paper_case(form, is_quick=True, with_leave_one_out=form in ("none", "yeoh", "gp"))
        for form in PARAMETERS
    },
    "paper-gp-unknown-noise": paper_case("gp", noise_sd="unknown"),
    "paper-auto": paper(discrepancy="auto", other="planar", with_leave_one_out=True),
    "gp-pinned": tissue(discrepancy="gp-pinned", noise_sd=0.02),
    "gp-orthogonal": tissue(discrepancy="gp-orthogonal", noise_sd=0.02),
    "gp-scaled": tissue(discrepancy="gp-scaled", noise_sd=0.02),
    "block-taylor": tissue(discrepancy="taylor", noise_sd=0.02, other="equibiaxial", is_quick=True),
    "sum-log-hencky": tissue(discrepancy="log+hencky", noise_sd=0.02, other="planar", is_quick=True),
    "auto": tissue(discrepancy="auto", other="equibiaxial"),
    "auto-balanced": tissue(discrepancy="auto-balanced", noise_sd=0.02, other="planar"),
    "auto-sharp": tissue(discrepancy="auto-sharp", noise_sd=0.02, other="planar"),
    "noise-unknown": tissue(discrepancy="none", is_quick=True, with_leave_one_out=True),
    "noise-proportional": fit_case(growing, discrepancy="none", noise="proportional", is_quick=True),
    "noise-repeats": fit_case(repeated, discrepancy="yeoh", noise="repeats", is_quick=True),
    "noise-repeats-auto": fit_case(repeated, discrepancy="auto", noise="repeats"),
    "noise-autoregressive": fit_case(drifting, discrepancy="none", noise="autoregressive", is_quick=True),
    "noise-autoregressive-auto": fit_case(drifting, discrepancy="auto", noise="autoregressive", tolerances="as-tested"),
    "one-test-tolerances": tissue(
        discrepancy="auto", noise_sd=0.02, tolerances=tq.Tolerances(stress=0.1, length=0.02, slack=0.005, zero=0.01)
    ),
    "one-test-stretch-tolerance": tissue(discrepancy="none", noise_sd=0.02, tolerances=tq.Tolerances(stretch=0.01)),
    "two-tests-brain": fit_case(brain, discrepancy="auto", at=None, other="planar", other_at=(1.05,)),
    "two-tests-brain-tolerances": fit_case(
        brain,
        material="mooney-rivlin",
        discrepancy="auto",
        at=None,
        other="uniaxial",
        other_at=(0.95, 1.05),
        tolerances=tq.Tolerances(stress=0.1, length=0.02),
    ),
    "three-tests": fit_case(three_modes, discrepancy="auto", at=None, other="planar", other_at=(0.9, 1.3)),
    "three-tests-none": fit_case(three_modes, discrepancy="none", at=None, other="planar", is_quick=True),
    "three-tests-stress-form": fit_case(three_modes, discrepancy="yeoh", at=None, tolerances=tq.Tolerances()),
    "five-specimens": fit_case(lambda: specimens(5), discrepancy="none", at=None, other="uniaxial", is_quick=True),
    "biaxial": fit_case(biaxial, discrepancy="auto-isotropic", at=[(1.1, 1.1)], other="uniaxial"),
    "biaxial-direction": fit_case(biaxial, discrepancy="auto", at=[(1.1, 1.1)], other="uniaxial"),
    "biaxial-none": fit_case(
        biaxial, material="mooney-rivlin", discrepancy="none", at=[(1.1, 1.1)], other="simple-shear", is_quick=True
    ),
    "simple-shear": fit_case(lambda: soft_tissue("simple-shear"), discrepancy="auto", at=(0.2, 0.7), other="uniaxial"),
    "ogden-1": tissue(material="ogden-1", discrepancy="none", noise_sd=0.02),
    "gent": tissue(material="gent", discrepancy="none", noise_sd=0.02),
    "fibres": fit_case(biaxial, material="neo-hookean+standard-fibres", discrepancy="none", at=[(1.1, 1.1)]),
    "strips": fit_case(
        strips, material="neo-hookean+standard-fibres@40", discrepancy="none", noise_sd=0.02, at=None, other="planar"
    ),
    "gent-auto": tissue(material="gent", discrepancy="auto", noise_sd=0.02, other="planar"),
    "normal-priors": tissue(
        material="mooney-rivlin", discrepancy="constant", priors={"C10": tq.Normal(0.4, 0.1), "C01": tq.Normal(0, 0.1)}
    ),
    "bound-1": paper(material="yeoh", discrepancy="none", priors={"C10": CUT["C10"]}),
    "bounds-2": paper(material="yeoh", discrepancy="none", priors={"C10": CUT["C10"], "C20": CUT["C20"]}),
    "bounds-3": paper(material="yeoh", discrepancy="none", priors=CUT),
    "bounds-5": paper(
        material="yeoh", discrepancy="linear", priors=CUT | {"m0": tq.Uniform(-0.3, 0.1), "m1": tq.Uniform(0, 0.2)}
    ),
    "bound-auto": tissue(discrepancy="auto", noise_sd=0.02, priors={"C10": tq.Uniform(0, 0.5)}),
    "many": Case(many, is_quick=True),
    "update": Case(updated, is_quick=True),
    "assessment": Case(assessed),
    "stable": tissue(discrepancy="auto", noise_sd=0.02, stable_in="uniaxial", is_sampled=True),
    "nuts": paper_case("constant", method="nuts", is_sampled=True),
    "smc": paper_case("constant", method="smc", is_sampled=True),
    "joint": paper_case("none", method="joint", is_sampled=True),
    "population": Case(pooled, is_sampled=True),
    "calibration": Case(calibrated, is_sampled=True),
}
