"""The call: from the experiments of several specimens to their population."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import reduce
from typing import Literal

import numpy as np

from tissuq.discrepancy import Discrepancy
from tissuq.errors import InputError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import LoadingMode
from tissuq.fitting import Method, fit_many
from tissuq.mechanics import Material, material_named
from tissuq.mechanics.joint import joined
from tissuq.noise import Noise
from tissuq.population.coordinates import coordinates_of
from tissuq.population.likelihoods import mixtures_of
from tissuq.population.population import Population
from tissuq.priors import Prior

__all__ = ["LEAST", "fit_population"]

LEAST = 3
"""Specimens: two tell a difference, but no spread."""
ALL = "all specimens"
"""The name of what complete pooling takes for one specimen."""


def fit_population(
    experiments: Sequence[Experiment] | Mapping[str, Experiment | Sequence[Experiment]],
    *,
    parameters: Sequence[str] | None = None,
    spread: float = 1.0,
    discrepancy: str | Discrepancy = "auto",
    material: str | Material = "neo-hookean",
    noise_sd: float | Literal["unknown"] | None = None,
    noise: str | Noise | None = None,
    priors: Mapping[str, Prior] | None = None,
    method: Method = "auto",
    seed: int = 0,
) -> Population:
    """Identify the parameters of several specimens and of the population that they come from.

    Every specimen is first fitted by itself, with wide priors and a discrepancy and noise of its own (no pooling). The
    pooled parameters of the specimens, the positive ones by their logarithms, are then taken to be Gaussian with an
    unknown mean, spread and correlation (partial pooling): what a specimen's own data leave open is filled in from the
    others. All measurements taken for those of one specimen (complete pooling) stand beside.

    Parameters
    ----------
    experiments : sequence of Experiment, or mapping of str to Experiment or sequence of them
        The tests of every specimen, in any loading modes. In a sequence, experiments of the same specimen (of the same
        name, where they do not say a specimen) belong together. A specimen's tests in one mode are joined, so that they
        can tell the noise (``noise="repeats"``); those in several modes are fitted together.
    parameters : sequence of str, optional
        The material's parameters that are pooled; all, unless given. The others stay each specimen's own.
    spread : float
        Sd of the half-normal prior of the spreads: of the logarithm; for parameters of either sign, in units of their
        typical size. One lets specimens differ by factors of ten.
    discrepancy, material, noise_sd, noise, priors, method, seed
        As for `tissuq.fit`, for every specimen by itself. Priors of pooled parameters only serve that step: they are
        divided out, and must be wide.

    Raises
    ------
    InputError
        When there are fewer than three specimens, a test is no experiment, or there is no such parameter.
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
    >>> low, high = found.summary().loc[("C10", "new patient"), ["hdi_low", "hdi_high"]]
    >>> bool(low < 0.4 and high > 0.7)
    True
    """
    from tissuq.population.hierarchy import sample_hierarchy  # JAX and BlackJAX, when they are needed

    specimens = _by_specimen(experiments)
    chosen = material_named(material)
    symbols = _checked(parameters, chosen)
    if not (np.isfinite(spread) and spread > 0):
        raise InputError(f"spread must be a positive number, not {spread!r}.")
    *alone, complete = fit_many(
        [
            *(_one(name, tests) for name, tests in specimens.items()),
            _one(ALL, [test for tests in specimens.values() for test in tests]),
        ],
        discrepancy=discrepancy,
        material=chosen,
        noise_sd=noise_sd,
        noise=noise,
        priors=priors,
        method=method,
        seed=seed,
    )
    coordinates = coordinates_of(alone, symbols)
    mixtures, reference = mixtures_of(alone, coordinates)
    hierarchy = sample_hierarchy(mixtures, reference, symbols, spread, seed)
    return Population(dict(zip(specimens, alone, strict=True)), complete, coordinates, hierarchy, spread, seed)


def _by_specimen(
    experiments: Sequence[Experiment] | Mapping[str, Experiment | Sequence[Experiment]],
) -> dict[str, list[Experiment]]:
    """Return the tests of each specimen."""
    found: dict[str, list[Experiment]] = {}
    if isinstance(experiments, Mapping):
        found = {str(name): list(joined(tests).parts) for name, tests in experiments.items()}
    elif experiments:
        for each in joined(experiments).parts:
            found.setdefault(each.specimen or each.name, []).append(each)
    if len(found) < LEAST:
        names = f" ({', '.join(found)})" if found else ""
        raise InputError(
            f"a population needs {LEAST} specimens or more; there are {len(found)}{names}. Experiments of one name are "
            "tests of one specimen: give every specimen a name of its own, or a mapping from names to experiments. "
            "For a single specimen use tissuq.fit."
        )
    return found


def _one(name: str, tests: Sequence[Experiment]) -> Experiment:
    """Return tests as those of one specimen: joined in each mode, so that no error of one against another is meant."""
    modes: dict[LoadingMode, list[Experiment]] = {}
    for test in tests:
        modes.setdefault(test.mode, []).append(test)
    return joined([replace(reduce(Experiment.joined, own), name=name, specimen=name) for own in modes.values()])


def _checked(parameters: Sequence[str] | None, material: Material) -> tuple[str, ...]:
    known = tuple(parameter.symbol for parameter in material.parameters)
    if parameters is None:
        return known
    unknown = [symbol for symbol in parameters if symbol not in known]
    if isinstance(parameters, str) or unknown or not parameters:
        found = parameters if isinstance(parameters, str) else ", ".join(unknown) or "none"
        raise InputError(f"parameters to pool must be a list of {', '.join(known)}; found: {found}.")
    return tuple(symbol for symbol in known if symbol in parameters)
