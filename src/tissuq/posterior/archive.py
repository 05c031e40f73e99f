"""A solution with its model as groups of a file and again as a solution: without a fit, without code from the file."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.errors import InputError, TissuqError
from tissuq.experiments.experiment import Experiment
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.inference.marginal import Marginal
from tissuq.inference.solution import Diagnostics, Representation, Solution
from tissuq.mechanics import Material, material_named
from tissuq.mechanics.relative_stiffness import for_states
from tissuq.model.discrepancy import Discrepancy, discrepancy_named
from tissuq.model.noise import KnownNoise, KnownNoises, Noise, noise_named
from tissuq.model.statistical_model import StatisticalModel
from tissuq.model.statistics import Statistics
from tissuq.model.tolerances import FittedErrors, Tolerances
from tissuq.parameters.priors import prior_from
from tissuq.posterior.netcdf import Group, LabelledGroup, digest, opened, read_groups
from tissuq.posterior.solver import Solver
from tissuq.result_warning import ResultWarning, Severity

T = TypeVar("T", Material, Discrepancy)

MODEL, TESTS = "model", "tests"
"""Groups of the model's arrays, and of one for each test."""
LABELS = ("name", "source", "stress_unit", "specimen", "direction", "condition")
"""Texts of an experiment."""


def _model_groups(model: StatisticalModel) -> dict[str, LabelledGroup]:
    """Return a model as groups of arrays; its names and settings are their attributes."""
    material, discrepancy, experiment = model.material, model.discrepancy, model.experiment
    plain = {
        "material": material.name,
        "material_symbols": list(model.material_symbols),
        "is_own_material": not _gives(lambda: for_states(material_named(material.name), experiment.states), material),
        "discrepancy": discrepancy.name,
        "is_own_discrepancy": not _gives(
            lambda: discrepancy_named(discrepancy.name).adapted_to(material, experiment), discrepancy
        ),
        "noise": _plain_noise(model.noise),
        "chosen_priors": {symbol: prior.as_dict() for symbol, prior in model.chosen_priors.items()},
        "priors": {symbol: prior.as_dict() for symbol, prior in model.priors.items()},
        "estimand": model.tolerances.estimand,
        "tolerances": model.tolerances.stated,
        "fitted_errors": vars(model.fitted_errors) | {"curve": None, "slopes": None},
        "count": model.statistics.count,
    }
    arrays: dict[str, Any] = {
        "triangle": (("row", "column"), model.statistics.triangle),
        "unit_stresses": (("state", "column_of_law"), _unit_stresses(model), {"units": "MPa"}),
    }
    if model.fitted_errors.curve is not None:
        arrays["curve"] = ("measurement", model.fitted_errors.curve, {"units": "MPa"})
    if model.fitted_errors.slopes is not None:
        arrays["slopes"] = (("measurement", "control"), model.fitted_errors.slopes, {"units": "MPa"})
    groups = {MODEL: LabelledGroup(arrays, attrs={"settings": json.dumps(plain)})}
    for number, test in enumerate(experiment.tests):
        arrays = {
            "stretch": (("point", "control")[: test.stretch.ndim], test.stretch, {"units": "1"}),
            "stress": (("point", "stress_of_mode")[: test.stress.ndim], test.stress, {"units": "MPa"}),
        }
        if test.standard_error.any():
            arrays["standard_error"] = ("measurement", test.standard_error, {"units": "MPa"})
        groups[f"{TESTS}/{number}"] = LabelledGroup(
            arrays,
            attrs={
                "mode": test.mode.name,
                "least_errors": json.dumps(test.least_errors),
                "averaged": test.curves[0].averaged,
                "apart": test.curves[0].apart,
                "warnings": json.dumps([_plain_warning(warning) for warning in test.curves[0].warnings]),
            }
            | {label: getattr(test, label) for label in LABELS},
        )
    return groups


def _recorded_model(
    groups: Mapping[str, Group], material: Material | None, discrepancy: Discrepancy | None
) -> StatisticalModel:
    """Return the model of groups that `_model_groups` gave.

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
    tests = [
        _test(groups[f"{TESTS}/{number}"]) for number in range(sum(name.startswith(f"{TESTS}/") for name in groups))
    ]
    experiment = Experiment.of(tests)
    law = for_states(law, experiment.states)
    if [parameter.symbol for parameter in law.parameters] != plain["material_symbols"]:
        raise InputError(
            f"the material '{plain['material']}' of this posterior has the parameters "
            f"{', '.join(plain['material_symbols'])}; the one given has others."
        )
    error = _named(
        "discrepancy", plain["discrepancy"], None if plain["is_own_discrepancy"] else discrepancy_named, discrepancy
    )
    model = StatisticalModel(
        experiment,
        law,
        error,
        noise_named(plain["noise"]),
        {symbol: prior_from(prior) for symbol, prior in plain["chosen_priors"].items()},
        Tolerances(plain["estimand"], **plain["tolerances"]),
        FittedErrors(**plain["fitted_errors"] | {name: group.arrays.get(name) for name in ("curve", "slopes")}),
        Statistics(plain["count"], group.arrays["triangle"]),
    )
    priors = {symbol: prior_from(prior) for symbol, prior in plain["priors"].items()}
    model = model if model.priors == priors else replace(model, chosen_priors=priors)
    _check_unchanged(model, group.arrays.get("unit_stresses"))
    return model


STATES_OF_LAW = 8
"""Measured states at most at which a file remembers what the law says."""
SAME_LAW = 1e-6
"""Largest difference of such stresses over the largest of them, of a law that is the same in other words."""


def _unit_stresses(model: StatisticalModel) -> FloatArray:
    """Return what a law says at few measured states, for a unit of each linear parameter."""
    states = model.experiment.states
    places = np.unique(np.linspace(0, len(states) - 1, STATES_OF_LAW).astype(int))
    return model.basis(states.among(places), model.usual_bent)


def _check_unchanged(model: StatisticalModel, recorded: FloatArray | None) -> None:
    """Refuse a law that says something else than the one that was fitted; what that said older files do not tell."""
    if recorded is None:
        return
    found, size = _unit_stresses(model), float(np.abs(recorded[np.isfinite(recorded)]).max(initial=0.0))
    if found.shape == recorded.shape and np.allclose(found, recorded, rtol=0, atol=SAME_LAW * size, equal_nan=True):
        return
    raise InputError(
        f"the material '{model.material.name}' has other stresses than when this posterior was fitted, or else the "
        f"discrepancy '{model.discrepancy.name}' or the loading mode has, so that the parameters would mean something "
        "else: take the law as it was then, or fit anew."
    )


def _test(group: Group) -> Experiment:
    labels = {label: str(group.attrs.get(label, "")) for label in LABELS}
    rows = {name: int(group.attrs.get(name, 1)) for name in ("averaged", "apart")}
    stretch, stress = group.arrays["stretch"], group.arrays["stress"]
    errors = {
        "standard_error": group.arrays.get("standard_error", np.zeros(stress.size)).reshape(stress.T.shape).T,
        "least_errors": json.loads(group.attrs.get("least_errors", "{}")),
    }
    warnings = tuple(_warning(**plain) for plain in json.loads(group.attrs.get("warnings", "[]")))
    return Experiment(str(group.attrs["mode"]), stretch, stress, **errors).labelled(warnings=warnings, **rows, **labels)


def _plain_warning(warning: ResultWarning) -> dict[str, str]:
    return {"shell": warning.shell, "python": warning, "code": warning.code, "severity": warning.severity}


def _warning(shell: str, python: str, code: str, severity: str) -> ResultWarning:
    return ResultWarning(shell, code, Severity(severity)).in_python(python)


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
        with suppress(TissuqError):  # of the user's own, and not defined here
            registered = find(name)
    if registered is None and supplied is None:
        of_file = " with --user-law law.py:Name, for a file is run only where you name it yourself, or"
        raise InputError(
            f"the {kind} '{name}' of this posterior is your own, or of a package that is not here or cannot be used: "
            f"install that package, or give it{of_file if kind == 'material' else ''} in Python as {kind}=."
        )
    if supplied is not None and (supplied.name != name if registered is None else supplied != registered):
        raise InputError(f"this posterior is of the {kind} '{name}', not '{supplied.name}': leave it out, or fit anew.")
    variant = registered if supplied is None else supplied
    assert variant is not None  # noqa: S101 (one of them is there)
    return variant


FORMAT = 2
"""Version of the groups; of another one nothing is known."""
DIGEST = "digest"
"""Attribute by which it is seen that the groups are as they were written; older files have none."""
FIT, SOLUTION, MIXTURE, WIDE_MIXTURE, MARGINALS = "fit", "solution", "mixture", "wide_mixture", "marginals"
STABILITY = ("stable_in", "stable_share", "stable_prior_share")
PLAIN = ("route", "reason", "seed", "log_evidence", "log_evidence_error", "is_of_data", *STABILITY)
TABLE = ("points", "density", "cumulative")


def solution_groups(solution: Solution, solver: Solver) -> dict[str, LabelledGroup]:
    """Return everything that a solution is, every marginal computed, and how it was solved."""
    plain = {name: getattr(solution, name) for name in PLAIN} | {"members": dict(solution.members)}
    plain |= {"diagnostics": None if solution.diagnostics is None else asdict(solution.diagnostics)}
    plain["is_sampled"] = solution.sampled is not None
    linear_draws: dict[str, Any] = {}
    if solution.sampled is not None and solution.sampled.size:
        linear_draws = {"sampled": (("chain", "draw", "linear"), solution.sampled)}
    labels = {"solution": json.dumps(plain), "solver": json.dumps(asdict(solver)), "shape": solution.shape}
    tables, moments = {}, {}
    for symbol, marginal in solution.marginals.items():
        rows = np.array([getattr(marginal, name) for name in TABLE])
        tables[symbol] = (("of_" + symbol, "along_" + symbol), rows)
        moments[symbol] = [marginal.mean, marginal.sd]
    groups = {
        SOLUTION: LabelledGroup(linear_draws, attrs=labels),
        MIXTURE: LabelledGroup(solution.mixture.to_arrays()),
        MARGINALS: LabelledGroup(tables, attrs={"moments": json.dumps(moments)}),
    }
    if solution.has_wide_mixture:
        groups[WIDE_MIXTURE] = LabelledGroup(solution.wide_mixture.to_arrays())
    recorded = groups | _model_groups(solution.model)
    sealed = {"format": FORMAT, DIGEST: digest({name: group.as_read for name, group in recorded.items()})}
    return {FIT: LabelledGroup(attrs=sealed)} | {f"{FIT}/{name}": group for name, group in recorded.items()}


def read_solution(
    path: Path, material: Material | None = None, discrepancy: Discrepancy | None = None
) -> tuple[Solution, Solver]:
    """Return the solution in a file, and how it was solved.

    Parameters
    ----------
    path : Path
    material, discrepancy
        Those of the posterior, where they are the user's own.

    Raises
    ------
    InputError
        When there is no such file, or it holds no posterior, or the material or discrepancy must be given.
    """
    if not path.is_file():
        raise InputError(f"there is no posterior '{path}'.")
    try:
        groups = read_groups(path, FIT)
        if FIT not in groups:
            raise InputError(
                f"'{path}' holds draws, and not the whole posterior, as tissuq wrote them before: run the fit again."
            )
        if groups[FIT].attrs["format"] != FORMAT:
            raise InputError(f"'{path}' is of another version of tissuq: run the fit again.")
        recorded = {name: group for name, group in groups.items() if name != FIT}
        if DIGEST in groups[FIT].attrs and digest(recorded) != groups[FIT].attrs[DIGEST]:
            raise InputError(f"'{path}' was changed since it was written, in its group '{FIT}': run the fit again.")
        return _solution(groups, _recorded_model(groups, material, discrepancy)), _solver(groups)
    except TissuqError:
        raise
    except Exception as error:  # whatever a damaged file makes the readers of HDF5, JSON and arrays raise
        raise unreadable(path, error) from error


def unreadable(path: Path, error: Exception) -> InputError:
    """Return what to say of a file that could not be read as a posterior."""
    if path.suffix != ".nc":
        return InputError(
            f"'{path}' is no posterior: give the folder of a run, as in runs/specimen, or an .nc file in it."
        )
    return InputError(f"'{path}' is damaged or no posterior of tissuq ({type(error).__name__}): run the fit again.")


def read_modes(path: Path) -> list[str]:
    """Return the loading modes of the tests of the posterior in a file, without reading more of it.

    Raises
    ------
    InputError
        When there is no such file, or it holds no posterior.
    """
    try:
        with opened(path) as file:
            return sorted({str(test.attrs["mode"]) for test in file[FIT][TESTS].values()})
    except Exception as error:  # as in `read_solution`
        raise unreadable(path, error) from error


def _solution(groups: Mapping[str, Group], model: StatisticalModel) -> Solution:
    state, tables = groups[SOLUTION], groups[MARGINALS]
    plain = json.loads(state.attrs["solution"])
    moments = json.loads(tables.attrs["moments"])
    mixture = GaussianMixture.from_arrays(groups[MIXTURE].arrays)
    tails = GaussianMixture.from_arrays(groups[WIDE_MIXTURE].arrays) if WIDE_MIXTURE in groups else None
    sampled = state.arrays.get("sampled")
    if plain.pop("is_sampled") and sampled is None:  # nothing of what is drawn is linear
        sampled = np.zeros((*state.attrs["shape"], 0))
    diagnostics = plain.pop("diagnostics")
    return Solution(
        model,
        representation=Representation.of(mixture, tails),
        marginals={symbol: Marginal(*moments[symbol], *tables.arrays[symbol]) for symbol in model.symbols},
        sampled=sampled,
        diagnostics=None if diagnostics is None else Diagnostics(**diagnostics),
        stable_in=tuple(plain.pop("stable_in")),
        **plain,
    )


def _solver(groups: Mapping[str, Group]) -> Solver:
    plain = json.loads(groups[SOLUTION].attrs["solver"])
    return Solver(plain["method"], tuple(plain["stable_in"]), plain["seed"])
