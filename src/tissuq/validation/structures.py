"""Whether bands of the force of a structure hold: simple tests of a known law, and the structure with their fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from pydantic import field_validator

from tissuq.arrays import FloatArray
from tissuq.errors import ModelError, TissuqError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import loading_mode
from tissuq.finite_elements import Case, ClampedBar, Indentation, PlateWithHole
from tissuq.finite_elements.response import respond
from tissuq.finite_elements.simulation import COMPLETE, simulate
from tissuq.finite_elements.spread import band_of
from tissuq.mechanics import engineering_stress, material_named
from tissuq.model.tolerances import Tolerances
from tissuq.parameters.priors import Prior, Uniform
from tissuq.posterior.fitting import fit
from tissuq.posterior.posterior import Posterior
from tissuq.studies.campaign_settings import StructureStudyOptions, each_once, names_among
from tissuq.studies.settings import there_is
from tissuq.studies.stream import Campaign, TaskOfFields

if TYPE_CHECKING:
    import pandas as pd


class KnownLaw(NamedTuple):
    """A law with its parameters, MPa where they are stresses, and what priors an oracle has that differ."""

    material: str
    values: tuple[float, ...]
    priors: Mapping[str, Prior] = MappingProxyType({})


KNOWN_LAWS = {
    "gent": KnownLaw("gent", (0.01, 0.8)),
    "ogden": KnownLaw("ogden-1", (0.01, -9.0), MappingProxyType({"alpha1": Uniform(-40.0, -0.5)})),
}
"""The truths: one that locks at I1 - 3 = 0.8, and one that is much stiffer in compression than in tension."""
STRUCTURES: dict[str, Case] = {
    "bar": ClampedBar(elongation=1.5, fineness=0.5),
    "indentation": Indentation(depth=0.3, fineness=0.5),
    "plate": PlateWithHole(elongation=2.0, fineness=0.5),
}
"""Structures by name, with meshes that are the same for the truth: errors of a mesh have no part in coverage."""


def _with_one_stress(name: str) -> None:
    mode = loading_mode(name)
    if len(mode.controls) > 1 or len(mode.stresses) > 1:
        raise ModelError(f"the mode {name!r} has several controls or stresses; choose among those with one")


class StructureStudySettings(StructureStudyOptions):
    """Everything that a campaign on the force of structures depends on.

    Attributes
    ----------
    truths, structures : tuple of str
        Of `KNOWN_LAWS` and `STRUCTURES`.
    replicates : int
        Sets of tests of every truth.
    modes : tuple of str
        A test in each.
    low, high : float
        Stretches between which they are made; amounts of shear are up to ``high - 1``.
    points : int
        Of every test.
    noise : float
        Standard deviation over the largest stress of a test.
    estimand : str
        Whose errors of tests are simulated, and told to the fits.
    draws, full_runs, steps : int
        As of `tissuq structure`.
    seed : int
    """

    _once = field_validator("truths", "structures")(each_once)
    _known_truths = field_validator("truths")(names_among(KNOWN_LAWS, "law"))
    _known_structures = field_validator("structures")(names_among(STRUCTURES, "structure"))
    _known_modes = field_validator("modes")(there_is(_with_one_stress))
    _known_estimand = field_validator("estimand")(there_is(Tolerances))

    @property
    def tolerances(self) -> Tolerances:
        """Sizes of the errors of tests."""
        return Tolerances(self.estimand)


DEFAULT, ORACLE = "default", "oracle"
"""The fit as it is unless anything is said, and one that knows the law."""
SMOOTH_LENGTH = 1 / 3
"""Correlation length of smooth errors, in ranges of the stretch."""


@dataclass(frozen=True)
class StructureTask(TaskOfFields):
    """A set of tests of one truth."""

    separator = "/"
    truth: str
    replicate: int

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


def simulated_tests(settings: StructureStudySettings, truth: KnownLaw, seed: list[int]) -> list[Experiment]:
    """Return a test in every mode of one specimen of a law.

    The stress is that at the true stretch; what is recorded is a stretch with errors of length and slack, and a stress
    with a factor of the specimen (``stress``), one of the test (``test``), a smooth relative error, a zero, the
    resolution of the load cell and noise: normal, with the standard deviations of the settings' tolerances.
    """
    generator, sizes = np.random.default_rng(seed), settings.tolerances.sizes
    law, specimen = material_named(truth.material), _factor(generator, sizes, "stress")
    tests = []
    for mode in settings.modes:
        loading = loading_mode(mode)
        strain = _strains(settings.low if mode == "uniaxial" else 1.0, settings.high, settings.points)
        control = loading.excursion(strain)
        stress = engineering_stress(law, loading.paths[0], control, np.array([truth.values]))[0]
        largest = float(np.abs(stress).max())
        measured = stress * specimen * _factor(generator, sizes, "test") * _smooth(generator, sizes, control)
        scatter = np.hypot(settings.noise, sizes.get("resolution", 0.0)) * largest
        measured = measured + sizes.get("zero", 0.0) * generator.standard_normal()
        measured = measured + scatter * generator.standard_normal(len(control))
        recorded = loading.excursion(strain * _factor(generator, sizes, "length"))
        recorded = recorded + sizes.get("slack", 0.0) * generator.standard_normal()
        tests.append(Experiment(loading, recorded, measured).labelled(name=mode, specimen="simulated"))
    return tests


def _strains(low: float, high: float, count: int) -> FloatArray:
    """Return so many changes of a control, up to those of both stretches, without the one nearest to rest."""
    strain = np.linspace(low, high, count + 1) - 1
    return np.delete(strain, np.abs(strain).argmin())


def _factor(generator: np.random.Generator, sizes: Mapping[str, float], name: str) -> float:
    return float(1 + sizes.get(name, 0.0) * generator.standard_normal())


def _smooth(generator: np.random.Generator, sizes: Mapping[str, float], stretch: FloatArray) -> FloatArray:
    """Return factors (n,) that vary smoothly along a test."""
    distance = (stretch[:, None] - stretch) / (SMOOTH_LENGTH * np.ptp(stretch))
    root = np.linalg.cholesky(np.exp(-0.5 * distance**2) + 1e-9 * np.eye(len(stretch)))
    return np.asarray(1 + sizes.get("smooth", 0.0) * (root @ generator.standard_normal(len(stretch))))


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
