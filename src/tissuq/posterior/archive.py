"""A solution as groups of a file and again as a solution: all that it is, without a fit and without code from the file.

The groups stand beside those that ArviZ reads (`tissuq.posterior.labelled`).
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from tissuq.errors import InputError, TissuqError
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.inference.marginal import Marginal
from tissuq.inference.solution import Diagnostics, Solution
from tissuq.mechanics import Material
from tissuq.model.discrepancy import Discrepancy
from tissuq.model.statistical_model import StatisticalModel
from tissuq.posterior.netcdf import Group, LabelledGroup, opened, read_groups
from tissuq.posterior.recorded_model import TESTS, model_groups, recorded_model
from tissuq.posterior.solver import Solver

__all__ = ["read_modes", "read_solution", "solution_groups"]

FORMAT = 2
"""Version of the groups; of another one nothing is known."""
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
    if solution.represent_tails is not None:
        groups[WIDE_MIXTURE] = LabelledGroup(solution.wide_mixture.to_arrays())
    recorded = groups | model_groups(solution.model)
    return {FIT: LabelledGroup(attrs={"format": FORMAT})} | {f"{FIT}/{name}": group for name, group in recorded.items()}


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
        return _solution(groups, recorded_model(groups, material, discrepancy)), _solver(groups)
    except TissuqError:
        raise
    except Exception as error:  # whatever a damaged file makes the readers of HDF5, JSON and arrays raise
        raise InputError(
            f"'{path}' is damaged or no posterior of tissuq ({type(error).__name__}): run the fit again."
        ) from error


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
        raise InputError(
            f"'{path}' is damaged or no posterior of tissuq ({type(error).__name__}): run the fit again."
        ) from error


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
        represent=lambda: mixture,
        represent_tails=None if tails is None else lambda: tails,
        marginals={symbol: Marginal(*moments[symbol], *tables.arrays[symbol]) for symbol in model.symbols},
        sampled=sampled,
        diagnostics=None if diagnostics is None else Diagnostics(**diagnostics),
        stable_in=tuple(plain.pop("stable_in")),
        **plain,
    )


def _solver(groups: Mapping[str, Group]) -> Solver:
    plain = json.loads(groups[SOLUTION].attrs["solver"])
    return Solver(plain["method"], tuple(plain["stable_in"]), plain["seed"])
