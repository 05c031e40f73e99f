"""A campaign as many small tasks, whose results are on disk as soon as they are there."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import InputError, TissuqError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import loading_mode
from tissuq.studies.coverage.formulations import marginals_of_c10
from tissuq.studies.coverage.settings import BLOCK, CoverageSettings
from tissuq.studies.coverage.truths import FAMILIES, draw_truth

__all__ = ["RESULTS", "Task", "run_campaign", "tasks_of"]

FloatArray = NDArray[np.float64]

RESULTS = "tasks.jsonl"
"""The file of a campaign's results: a line a task."""


@dataclass(frozen=True)
class Task:
    """Some replicates of one family on one design, with one formulation; all by their places in the settings."""

    design: int
    strength: int
    family: int
    formulation: int
    first: int
    count: int

    @property
    def key(self) -> str:
        """What tells it from every other task of the campaign."""
        return "-".join(map(str, vars(self).values()))


def tasks_of(settings: CoverageSettings) -> list[Task]:
    """Return all tasks of a campaign, in their order."""
    blocks = [(start, min(BLOCK, settings.replicates - start)) for start in range(0, settings.replicates, BLOCK)]
    return [
        Task(design, strength, family, formulation, *block)
        for design in range(len(settings.designs))
        for strength in range(len(settings.strengths))
        for block in blocks
        for family in range(len(settings.families))
        for formulation in range(len(settings.formulations))
    ]


def run_campaign(
    settings: CoverageSettings,
    folder: Path,
    *,
    workers: int = 1,
    scheduler: str | None = None,
    step: Callable[[str], None] = lambda text: None,
) -> list[dict[str, Any]]:
    """Carry out what is not done yet of a campaign, and return the results of all tasks, in their order.

    A result is on disk before the next is waited for; a campaign that was killed at any point goes on where it was.
    Results do not depend on the number of workers or their order.

    Parameters
    ----------
    settings : CoverageSettings
    folder : Path
        Exists; holds the results so far, if any.
    workers : int
        Processes on this machine.
    scheduler : str, optional
        Address of a Dask scheduler whose workers are used instead.
    step : callable
        Told of every task that is done.

    Raises
    ------
    InputError
        When the scheduler cannot be reached.
    """
    path = folder / RESULTS
    tasks = tasks_of(settings)
    done = _read(path)
    for _ in range(sum(task.key in done for task in tasks)):
        step("done before")
    left = [task for task in tasks if task.key not in done]
    with path.open("a", encoding="utf-8") as file:
        for found in _carried_out(settings, left, workers, scheduler):
            file.write(json.dumps(found) + "\n")
            file.flush()
            os.fsync(file.fileno())
            done[found["key"]] = found
            step(settings.formulations[found["formulation"]])
    results = [done[task.key] for task in tasks]
    scratch = path.with_suffix(".new")
    scratch.write_text("".join(json.dumps(each) + "\n" for each in results), encoding="utf-8")
    scratch.replace(path)
    return results


def _read(path: Path) -> dict[str, dict[str, Any]]:
    """Return the results on disk by their keys; a line that was cut short by a kill is taken off the file."""
    if not path.exists():
        return {}
    content = path.read_bytes()
    whole = content[: content.rfind(b"\n") + 1]
    if len(whole) < len(content):
        with path.open("r+b") as file:
            file.truncate(len(whole))
    return {found["key"]: found for found in map(json.loads, whole.decode("utf-8").splitlines())}


def _carried_out(
    settings: CoverageSettings, tasks: Sequence[Task], workers: int, scheduler: str | None
) -> Iterator[dict[str, Any]]:
    """Yield the results of tasks as they come."""
    if scheduler is None and workers == 1:
        yield from (carry_out(settings, task) for task in tasks)
        return
    with _executor(workers, scheduler) as executor:
        futures = [executor.submit(carry_out, settings, task) for task in tasks]
        try:
            yield from (future.result() for future in as_completed(futures))
        finally:
            for future in futures:
                future.cancel()


@contextmanager
def _executor(workers: int, scheduler: str | None) -> Iterator[Executor]:
    if scheduler is None:
        with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
            yield pool
        return
    try:
        from distributed import Client
    except ImportError as error:
        raise InputError("--scheduler needs Dask: install tissuq with its extra 'cluster'.") from error
    try:
        client = Client(scheduler, timeout="5s")
    except (OSError, ValueError) as error:
        raise InputError(f"no Dask scheduler answers at '{scheduler}' ({error}).") from error
    with client, client.get_executor(retries=5) as pool:
        yield pool


def carry_out(settings: CoverageSettings, task: Task) -> dict[str, Any]:
    """Return truths, intervals and moments of C10 in every replicate of a task; null where a fit failed."""
    design, formulation = settings.designs[task.design], settings.formulations[task.formulation]
    mode, stretch = loading_mode(design.mode), design.stretch
    strength, family = settings.strengths[task.strength], settings.families[task.family]
    own = list(FAMILIES).index(family)
    truths, oracles, data = [], [], []
    for replicate in range(task.first, task.first + task.count):
        truth = draw_truth(family, (settings.seed, 1, own, replicate))
        neo_hookean = draw_truth("neo-hookean", (settings.seed, 1, own, replicate))
        unit = strength * truth.unit_stress(mode, stretch) + (1 - strength) * neo_hookean.unit_stress(mode, stretch)
        generator = np.random.default_rng((settings.seed, 2, own, replicate, task.design))
        stress = truth.C10 * unit + design.noise_sd * generator.standard_normal(len(stretch))
        truths.append(truth.C10)
        oracles.append(design.noise_sd / float(np.linalg.norm(unit)))
        data.append(Experiment(mode, stretch, stress))
    noise_sd: Any = design.noise_sd if settings.noise == "known" else "unknown"
    rows = _fits(data, formulation, noise_sd, settings.prob)
    return {"key": task.key, **asdict(task), "truth": truths, "oracle_sd": oracles, "fits": rows}


def _fits(data: list[Experiment], formulation: str, noise_sd: Any, prob: float) -> list[list[float] | None]:
    """Return ends, mean and sd of C10 for every data set; one by one where all together fail."""
    try:
        marginals = marginals_of_c10(formulation, data, noise_sd)
    except (TissuqError, np.linalg.LinAlgError):
        if len(data) == 1:
            return [None]
        return [row for each in data for row in _fits([each], formulation, noise_sd, prob)]
    return [[*marginal.hdi(prob), marginal.mean, marginal.sd] for marginal in marginals]
