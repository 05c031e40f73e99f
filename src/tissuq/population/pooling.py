"""The call `fit_population`: from the experiments of several specimens to their population."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import reduce
from numbers import Real
from statistics import median
from typing import Any

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import LoadingMode
from tissuq.experiments.reading.tests_in_file import measurements
from tissuq.mechanics import Material, material_named
from tissuq.model.discrepancy import Discrepancy, NoDiscrepancy, discrepancy_named
from tissuq.model.noise import Noise
from tissuq.model.tolerances import AS_TESTED, SPECIMEN, TISSUE, Tolerances
from tissuq.parameters.checks import check_switches, one_or_several
from tissuq.parameters.priors import Prior
from tissuq.population.covariates import covariates_of
from tissuq.population.likelihoods import coordinates_of, mixtures_of
from tissuq.population.population import Population
from tissuq.population.shared_error import biased, shared_covariance
from tissuq.posterior.fitting import fit_many, stated_tolerances
from tissuq.posterior.posterior import Posterior
from tissuq.posterior.solver import Method

MIN_SPECIMENS = 3
"""Smallest number of specimens: two determine a difference, but no spread."""
LEAST_DEFORMATION = 0.01
"""Of a specimen, over that of the others, below which it was hardly deformed."""
ALL_SPECIMENS = "all specimens"
"""Name of all specimens together, as complete pooling treats them."""


def fit_population(
    experiments: Any,
    *,
    parameters: Sequence[str] | None = None,
    spread: float = 1.0,
    covariates: Any = None,
    shared_discrepancy: bool = False,
    discrepancy: str | Discrepancy = "auto",
    material: str | Material = "neo-hookean",
    noise_sd: float | str | Mapping[str, float | str | Sequence[float]] | None = None,
    noise: str | Noise | None = None,
    priors: Mapping[str, Prior] | None = None,
    tolerances: Tolerances | Mapping[str, float | str] | str | None = None,
    method: Method = "auto",
    seed: int = 0,
) -> Population:
    """Identify the parameters of several specimens and of the population that they come from.

    Every specimen is first fitted separately, with wide priors and its own discrepancy and noise (no pooling). The
    pooled parameters of the specimens, the positive ones by their logarithms, are then taken to be Gaussian with an
    unknown mean, spread and correlation (partial pooling): what a specimen's own data leave open is filled in from the
    others. All measurements taken for those of one specimen (complete pooling) stand beside.

    Parameters
    ----------
    experiments : sequence of Experiment, mapping of str to Experiment or sequence of them, or one file or table of all
        The tests of every specimen, in any loading modes; files and tables stand for what `tissuq.read_tests` makes of
        them.
        In a sequence, experiments of the same specimen (of the same name, where no specimen is given) belong together.
        A specimen's tests in one mode are joined, so that they can determine the noise (``noise="repeats"``); those in
        several modes are fitted together.
    parameters : sequence of str, optional
        The material's parameters that are pooled; all, unless given. The others stay each specimen's own.
    spread : float
        Sd of the half-normal prior of the spreads: of the logarithm; for parameters of either sign, in units of their
        typical size. One lets specimens differ by factors of ten.
    covariates : pandas.DataFrame, mapping of str to mapping, or Covariates, optional
        What is known of every specimen (the index of a table) by the names of covariates: numbers such as an age, words
        such as a sex. The middle of the population then depends on them linearly: the logarithm of a positive
        parameter. A name may end in a unit in brackets, such as ``age [year]``.
    shared_discrepancy : bool
        Take the model error to be the same in all specimens (the same missing physics), instead of independent: the
        part of the specimens' covariance that is due to their discrepancy is then a bias that median, specimens and a
        new patient have in common, and that does not average out.
    noise_sd : float, str, or mapping of str to float, str or sequence of float, optional
        As for `tissuq.fit`, for every separate fit; or that of each specimen by its name, of several tests one for all
        or one for each in their order. The noise of specimens that are left out is unknown.
    discrepancy, material, noise, priors, method, seed
        As for `tissuq.fit`, for every separate fit. Priors of pooled parameters only serve that step: they are
        divided out, and must be wide.

    tolerances : Tolerances or str, optional
        Errors of every specimen's own tests, as for `tissuq.fit`: ``"as-tested"`` (the default), ``"specimen"`` or
        sizes. They are independent between specimens, so that the spread is what specimens differ beyond them; the
        tests of a specimen are then not joined, each has its own. Complete pooling is as tested.

    Raises
    ------
    InputError
        When there are fewer than three specimens, one was hardly deformed, a test is no experiment, there is no such
        parameter, or covariates cannot be used: missing, constant, determined by others, or too many; or there is no
        discrepancy to share.
    ModelError, ConvergenceError
        When a specimen cannot be fitted.

    References
    ----------
    Lunn, Barrett, Sweeting & Thompson (2013), Fully Bayesian hierarchical modelling in two stages, with application to
    meta-analysis, Applied Statistics 62, 551-572. Differs from the source: specimens are integrated in closed form
    instead of sampled again.

    Examples
    --------
    >>> import tissuq as tq
    >>> stretch = [0.8, 0.9, 1.1, 1.2, 1.3]
    >>> moduli = {"a": 0.4, "b": 0.5, "c": 0.6, "d": 0.7, "e": 0.45}
    >>> specimens = {
    ...     name: tq.simulate("neo-hookean", {"C10": modulus}, stretch, noise_sd=0.01, seed=place)
    ...     for place, (name, modulus) in enumerate(moduli.items())
    ... }
    >>> found = tq.fit_population(specimens, discrepancy="none", noise_sd=0.01)
    >>> low, high = found.summary().loc[("C10", "new specimen"), ["hdi_low", "hdi_high"]]
    >>> bool(low < 0.4 and high > 0.7)
    True
    """
    from tissuq.population.hierarchy import sample_hierarchy  # JAX and BlackJAX, when they are needed

    specimens = _by_specimen(experiments)
    pooled_material = material_named(material)
    symbols = _pooled_symbols(parameters, pooled_material)
    if not isinstance(spread, Real) or not 0 < spread < np.inf:
        raise InputError(f"spread must be a positive number, not {spread!r}.")
    check_switches(shared_discrepancy=shared_discrepancy)
    if shared_discrepancy and isinstance(discrepancy_named(discrepancy), NoDiscrepancy):
        raise InputError(
            "a shared discrepancy needs specimens that are fitted with one: choose a discrepancy such as 'auto', or "
            "leave out that it is shared."
        )
    _check_deformed(specimens)
    encoded = covariates_of(covariates, list(specimens))
    of_tests = stated_tolerances(AS_TESTED if tolerances is None else tolerances)
    if of_tests.estimand == TISSUE:
        raise InputError(
            f"the errors of the estimand '{TISSUE}' hold how much specimens differ, which a population finds itself: "
            f"take '{SPECIMEN}'."
        )
    options: dict[str, Any] = {
        "discrepancy": discrepancy,
        "material": pooled_material,
        "noise": noise,
        "priors": priors,
        "method": method,
        "seed": seed,
    }
    all_tests = [test for tests in specimens.values() for test in tests]
    noise_of = _noise_of_specimens(noise_sd, specimens)
    fits: dict[str, Posterior] = {}
    for sd in dict.fromkeys(noise_of.values()):
        alike = [name for name in specimens if noise_of[name] == sd]
        joined = [
            _one_specimen(name, specimens[name], separate=bool(of_tests) or isinstance(sd, tuple)) for name in alike
        ]
        fits |= zip(alike, fit_many(joined, noise_sd=sd, tolerances=of_tests, **options), strict=True)
    single = [fits[name] for name in specimens]
    of_all = _noise_of_all(noise_of, specimens) if isinstance(noise_sd, Mapping) else noise_sd
    together = _one_specimen(ALL_SPECIMENS, all_tests, separate=isinstance(of_all, list))
    (complete,) = fit_many([together], noise_sd=of_all, tolerances=AS_TESTED, **options)
    coordinates = coordinates_of(single, symbols)
    mixtures, reference = mixtures_of(single, coordinates)
    hierarchy = sample_hierarchy(mixtures, reference, symbols, encoded, spread, seed)
    covariance = shared_covariance(single, coordinates) if shared_discrepancy else None
    if covariance is not None:
        hierarchy = biased(hierarchy, covariance, seed)
    by_name = dict(zip(specimens, single, strict=True))
    return Population(by_name, complete, coordinates, hierarchy, spread, seed, encoded, shared_covariance=covariance)


def _by_specimen(
    experiments: Any,
) -> dict[str, list[Experiment]]:
    """Return the tests of each specimen."""
    tests_of: dict[str, list[Experiment]] = {}
    if isinstance(experiments, Mapping):
        tests_of = {str(name): list(measurements(tests).tests) for name, tests in experiments.items()}
    elif not isinstance(experiments, Sequence) or experiments:
        for test in measurements(experiments).tests:
            tests_of.setdefault(test.specimen or test.name, []).append(test)
    if len(tests_of) < MIN_SPECIMENS:
        names = f" ({', '.join(tests_of)})" if tests_of else ""
        raise InputError(
            f"a population needs {MIN_SPECIMENS} specimens or more; there are {len(tests_of)}{names}. Experiments of "
            "the same name are tests of one specimen: give every specimen its own name, or a mapping from names to "
            "experiments. For a single specimen use tissuq.fit."
        )
    return tests_of


def _check_deformed(specimens: Mapping[str, Sequence[Experiment]]) -> None:
    """Refuse specimens whose tests went next to nowhere: they say nothing of a stiffness, and would look very stiff."""
    largest = {
        name: max(float(np.abs(test.stretch - test.mode.reference).max()) for test in tests)
        for name, tests in specimens.items()
    }
    typical = median(largest.values())
    small = [name for name, deformation in largest.items() if deformation < LEAST_DEFORMATION * typical]
    if small:
        listed = ", ".join(f"{name} (by {largest[name]:.2g} at the most)" for name in small)
        options = " ".join(f"--without {name}" for name in small)
        raise InputError(
            f"hardly deformed: {listed}, while half of the specimens were by {typical:.2g} or more. Such tests say "
            "nothing of a stiffness, and would widen the range of all specimens. See whether the column and the unit "
            f"of the stretch are right; or leave out what was not stretched: {options}."
        )


def _noise_of_specimens(noise_sd: Any, specimens: Mapping[str, Sequence[Experiment]]) -> dict[str, Any]:
    """Return the noise of every specimen; a tuple where each of its tests has its own."""
    if isinstance(noise_sd, Sequence) and not isinstance(noise_sd, str):
        raise InputError(f"noise_sd must be one for all, or by specimen, such as {{'S1': 0.02}}, not {noise_sd!r}.")
    if not isinstance(noise_sd, Mapping):
        return dict.fromkeys(specimens, noise_sd)
    if foreign := [str(name) for name in noise_sd if name not in specimens]:
        raise InputError(f"there is a noise of {', '.join(foreign)}, but the specimens are {', '.join(specimens)}.")
    sds = {name: noise_sd.get(name, "unknown") for name in specimens}
    return {name: sd if isinstance(sd, str | float | int) else tuple(sd) for name, sd in sds.items()}


def _noise_of_all(noise_of: Mapping[str, Any], specimens: Mapping[str, Sequence[Experiment]]) -> list[Any] | str:
    """Return the noise of all tests, each with its own; unknown where one is."""
    sds = [sd if isinstance(sd, tuple) else (sd,) * len(specimens[name]) for name, sd in noise_of.items()]
    of_tests = [sd for of_specimen in sds for sd in of_specimen]
    return "unknown" if "unknown" in of_tests else of_tests


def _one_specimen(name: str, tests: Sequence[Experiment], *, separate: bool = False) -> Experiment:
    """Return tests as those of one specimen: joined in each mode, unless they are to stay apart."""
    if separate:
        return Experiment.of([test.labelled(name=name, specimen=name) for test in tests])
    modes: dict[LoadingMode, list[Experiment]] = {}
    for test in tests:
        modes.setdefault(test.mode, []).append(test)
    return Experiment.of(
        [
            reduce(Experiment.joined, tests_in_mode).labelled(name=name, specimen=name)
            for tests_in_mode in modes.values()
        ]
    )


def _pooled_symbols(parameters: Sequence[str] | None, material: Material) -> tuple[str, ...]:
    symbols = tuple(parameter.symbol for parameter in material.parameters)
    if parameters is None:
        return symbols
    rule = f"parameters to pool must be a list of {', '.join(symbols)}"
    pooled = one_or_several(parameters, str, rule)
    found = [name for name in pooled if name not in symbols or isinstance(parameters, str)]
    if found or not pooled:
        raise InputError(f"{rule}; found: {', '.join(found) or 'none'}.")
    return tuple(symbol for symbol in symbols if symbol in pooled)
