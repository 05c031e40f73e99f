"""A statistical model as labelled arrays and plain values, and again as a model: nothing of it is executed."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, TypeVar

from tissuq.errors import InputError, TissuqError
from tissuq.experiments.experiment import Experiment
from tissuq.mechanics import Material, material_named
from tissuq.model.discrepancy import Discrepancy, discrepancy_named
from tissuq.model.measurement_errors import FittedErrors, Tolerances
from tissuq.model.noise import KnownNoise, KnownNoises, Noise, noise_named
from tissuq.model.statistical_model import StatisticalModel
from tissuq.model.statistics import Statistics
from tissuq.parameters.priors import prior_from
from tissuq.posterior.netcdf import Group, LabelledGroup

__all__ = ["TESTS", "model_groups", "recorded_model"]

T = TypeVar("T", Material, Discrepancy)

MODEL, TESTS = "model", "tests"
"""Groups of the model's arrays, and of one for each test."""
LABELS = ("name", "source", "stress_unit", "specimen")
"""Texts of an experiment."""


def model_groups(model: StatisticalModel) -> dict[str, LabelledGroup]:
    """Return a model as groups of arrays; its names and settings are their attributes."""
    material, discrepancy, experiment = model.material, model.discrepancy, model.experiment
    plain = {
        "material": material.name,
        "material_symbols": list(model.material_symbols),
        "is_own_material": not _gives(lambda: material_named(material.name), material),
        "discrepancy": discrepancy.name,
        "is_own_discrepancy": not _gives(
            lambda: discrepancy_named(discrepancy.name).adapted_to(material, experiment), discrepancy
        ),
        "noise": _plain_noise(model.noise),
        "chosen_priors": {symbol: prior.as_dict() for symbol, prior in model.chosen_priors.items()},
        "priors": {symbol: prior.as_dict() for symbol, prior in model.priors.items()},
        "tolerances": model.tolerances.sizes,
        "fitted_errors": vars(model.fitted_errors) | {"curve": None},
        "count": model.statistics.count,
    }
    arrays: dict[str, Any] = {"triangle": (("row", "column"), model.statistics.triangle)}
    if model.fitted_errors.curve is not None:
        arrays["curve"] = ("measurement", model.fitted_errors.curve, {"units": "MPa"})
    groups = {MODEL: LabelledGroup(arrays, attrs={"settings": json.dumps(plain)})}
    for number, test in enumerate(experiment.tests):
        groups[f"{TESTS}/{number}"] = LabelledGroup(
            {
                "stretch": (("point", "control")[: test.stretch.ndim], test.stretch, {"units": "1"}),
                "stress": (("point", "stress_of_mode")[: test.stress.ndim], test.stress, {"units": "MPa"}),
            },
            attrs={"mode": test.mode.name} | {label: getattr(test, label) for label in LABELS},
        )
    return groups


def recorded_model(
    groups: Mapping[str, Group], material: Material | None, discrepancy: Discrepancy | None
) -> StatisticalModel:
    """Return the model of groups that `model_groups` gave.

    Parameters
    ----------
    groups : mapping of str to Group
    material, discrepancy
        Those of the model, where they are the user's own and no name stands for them.

    Raises
    ------
    InputError
        When they are needed and not given, or are others.
    """
    group = groups[MODEL]
    plain = json.loads(group.attrs["settings"])
    law = _named("material", plain["material"], None if plain["is_own_material"] else material_named, material)
    if [parameter.symbol for parameter in law.parameters] != plain["material_symbols"]:
        raise InputError(
            f"the material '{plain['material']}' of this posterior has the parameters "
            f"{', '.join(plain['material_symbols'])}; the one given has others."
        )
    error = _named(
        "discrepancy", plain["discrepancy"], None if plain["is_own_discrepancy"] else discrepancy_named, discrepancy
    )
    tests = [
        _test(groups[f"{TESTS}/{number}"]) for number in range(sum(name.startswith(f"{TESTS}/") for name in groups))
    ]
    model = StatisticalModel(
        Experiment.of(tests),
        law,
        error,
        noise_named(plain["noise"]),
        {symbol: prior_from(prior) for symbol, prior in plain["chosen_priors"].items()},
        Tolerances(**plain["tolerances"]),
        FittedErrors(**plain["fitted_errors"] | {"curve": group.arrays.get("curve")}),
        Statistics(plain["count"], group.arrays["triangle"]),
    )
    priors = {symbol: prior_from(prior) for symbol, prior in plain["priors"].items()}
    return model if model.priors == priors else replace(model, chosen_priors=priors)


def _test(group: Group) -> Experiment:
    labels = {label: str(group.attrs[label]) for label in LABELS}
    return Experiment(str(group.attrs["mode"]), group.arrays["stretch"], group.arrays["stress"], **labels)


def _plain_noise(noise: Noise) -> str | float | list[float]:
    if isinstance(noise, KnownNoises):
        return list(noise.sds)
    return noise.value if isinstance(noise, KnownNoise) else noise.name


def _gives(named: Callable[[], object], wanted: object) -> bool:
    """Return whether a name stands for an object."""
    try:
        return named() == wanted
    except TissuqError:
        return False


def _named(kind: str, name: str, find: Callable[[str], T] | None, supplied: T | None) -> T:
    """Return the material or discrepancy of a name; the one given, where there is none of that name."""
    registered = None
    if find is not None:
        try:
            registered = find(name)
        except TissuqError:  # of the user's own, and not defined here
            registered = None
    if registered is None and supplied is None:
        raise InputError(
            f"the {kind} '{name}' of this posterior is your own, and its file is run only where you name it yourself: "
            f"give it as {kind}= in Python, or with --material law.py:Name on the command line."
        )
    if supplied is not None and (supplied.name != name if registered is None else supplied != registered):
        raise InputError(f"this posterior is of the {kind} '{name}', not '{supplied.name}': leave it out, or fit anew.")
    variant = registered if supplied is None else supplied
    assert variant is not None  # noqa: S101 (one of them is there)
    return variant
