"""A campaign as small tasks: a set of tests, its fit and an oracle's, and the bands of the forces of structures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.errors import TissuqError
from tissuq.finite_elements.response import respond
from tissuq.finite_elements.simulation import COMPLETE, simulate
from tissuq.finite_elements.spread import band_of
from tissuq.mechanics import material_named
from tissuq.posterior.fitting import fit
from tissuq.posterior.posterior import Posterior
from tissuq.studies.stream import Campaign
from tissuq.validation.structures.settings import KNOWN_LAWS, STRUCTURES, StructureStudySettings
from tissuq.validation.structures.simulated_tests import simulated_tests

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["DEFAULT", "ORACLE", "StructureTask", "carry_out", "run_structures", "summarise_structures", "tasks_of"]

DEFAULT, ORACLE = "default", "oracle"
"""The fit as it is unless anything is said, and one that knows the law."""


@dataclass(frozen=True)
class StructureTask:
    """A set of tests of one truth."""

    truth: str
    replicate: int

    @property
    def key(self) -> str:
        """What tells it from every other task of the campaign."""
        return f"{self.truth}/{self.replicate}"

    @property
    def label(self) -> str:
        """What is shown while it is carried out."""
        return f"{self.truth}, tests {self.replicate + 1}"


def tasks_of(settings: StructureStudySettings) -> list[StructureTask]:
    """Return all tasks of a campaign, every truth's first before any second."""
    return [StructureTask(truth, number) for number in range(settings.replicates) for truth in settings.truths]


def carry_out(settings: StructureStudySettings, task: StructureTask) -> dict[str, Any]:
    """Return true forces (N) and bands of the structures for a set of tests; ``failure`` says why there are none."""
    truth = KNOWN_LAWS[task.truth]
    tests = simulated_tests(settings, truth, [settings.seed, list(KNOWN_LAWS).index(task.truth), task.replicate])
    row: dict[str, Any] = {"truth": task.truth, "replicate": task.replicate, "failure": "", "structures": {}}
    try:
        fits = {
            DEFAULT: fit(tests, tolerances=settings.tolerances),
            ORACLE: fit(
                tests, tolerances=settings.tolerances, material=truth.material, discrepancy="none", priors=truth.priors
            ),
        }
        for name in settings.structures:
            force = _true_force(name, task.truth)
            bands = {kind: _band(settings, name, posterior) for kind, posterior in fits.items()}
            row["structures"][name] = {"force": force, **bands}
    except TissuqError as error:
        row["failure"] = str(error)
    return row


run_structures = Campaign(tasks_of, carry_out)
"""Carries out a campaign on the force of structures."""


@lru_cache
def _true_force(structure: str, truth: str) -> float:
    """Return the force of a structure of a known law at the end, N."""
    law = KNOWN_LAWS[truth]
    return float(respond(STRUCTURES[structure], material_named(law.material), law.values, steps=4).force[-1])


def _band(settings: StructureStudySettings, structure: str, posterior: Posterior) -> dict[str, float]:
    """Return mean, sd and 95 % band of the force at the end, N, and the error of first order in a draw."""
    simulation = simulate(
        posterior, STRUCTURES[structure], settings.draws, steps=settings.steps, seed=settings.seed, check_mesh=False,
        shares=False, full_runs=settings.full_runs,
    )  # fmt: skip
    forces = simulation.forces[COMPLETE][:, -1]
    band = band_of(forces[np.isfinite(forces), None])
    error = simulation.first_order_error.get(COMPLETE)
    return {
        **{name: float(getattr(band, name)[0]) for name in ("mean", "sd", "low", "high")},
        "completed": int(np.isfinite(forces).sum()),
        "first_order_error": 0.0 if error is None or not np.isfinite(error.force[-1]) else float(error.force[-1]),
    }


def summarise_structures(results: Sequence[dict[str, Any]]) -> pd.DataFrame:
    """Return a row for each truth and structure.

    Columns truth, structure, replicates (that did not fail), failed, inside (share of bands that hold the true force),
    inside_error (its standard error), oracle_inside, half_width (median, over the true force), width_ratio (median of
    the band's width over the oracle's), and error (median distance of the mean from the truth, over the truth).
    """
    import pandas as pd

    rows = []
    names = dict.fromkeys((row["truth"], structure) for row in results for structure in row["structures"])
    for truth, structure in names:
        of_truth = [row for row in results if row["truth"] == truth]
        estimates = [row["structures"][structure] for row in of_truth if structure in row["structures"]]
        force = np.array([estimate["force"] for estimate in estimates])
        default, oracle = (
            {name: np.array([estimate[kind][name] for estimate in estimates]) for name in ("mean", "low", "high")}
            for kind in (DEFAULT, ORACLE)
        )
        inside, oracle_inside = (
            (estimate["low"] <= force) & (force <= estimate["high"]) for estimate in (default, oracle)
        )
        width, oracle_width = (estimate["high"] - estimate["low"] for estimate in (default, oracle))
        count = len(estimates)
        share = (inside.sum() + 1) / (count + 2)  # so that the error of 0 or 100 % is not zero
        rows.append({
            "truth": truth, "structure": structure, "replicates": count, "failed": len(of_truth) - count,
            "inside": inside.mean(), "inside_error": np.sqrt(share * (1 - share) / count),
            "oracle_inside": oracle_inside.mean(), "half_width": np.median(width / 2 / force),
            "width_ratio": np.median(width / oracle_width), "error": np.median(np.abs(default["mean"] / force - 1)),
        })  # fmt: skip
    return pd.DataFrame(rows)
