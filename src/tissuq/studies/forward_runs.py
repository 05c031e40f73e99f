"""Runs of an expensive model in several processes, on disk as soon as they are done."""

from __future__ import annotations

import json
import pickle
import shutil
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from tissuq.emulation.adaptive import Runner
from tissuq.emulation.forward import Forward
from tissuq.emulation.problem import Problem
from tissuq.emulation.runs import ForwardRun, ForwardRuns, carry_out, gathered
from tissuq.errors import InputError
from tissuq.studies.stream import RESULTS, Step, open_pool, run_tasks

__all__ = ["runs_of"]

FloatArray = NDArray[np.float64]

ABOUT = "about.json"
"""The file that says of which model the runs in a folder are."""


@contextmanager
def runs_of(model: Forward, problem: Problem, folder: str | Path | None, workers: int, step: Step) -> Iterator[Runner]:
    """Give what runs a model at parameters (N, d).

    Parameters
    ----------
    model : Forward
    problem : Problem
    folder : str or Path, optional
        Where the runs are kept, and found again; without one they are forgotten.
    workers : int
        Processes.
    step : callable
        Told of every run that is done.

    Raises
    ------
    InputError
        When the folder holds runs of another model or at other controls, or the model cannot travel to processes.
    """
    if workers < 1:
        raise InputError(f"the number of workers must be at least 1, not {workers}.")
    if workers > 1:
        _check_travels(model)
    with TemporaryDirectory() as scratch, open_pool(workers) as pool:
        place = Path(scratch) if folder is None else Path(folder)
        missing = [each for each in (place, *place.absolute().parents) if not each.exists()]
        if folder is not None:
            _open(place, model, problem)
        try:
            yield _Runs(model, problem, place, pool, step)
        except BaseException:
            _remove_if_fruitless(place, missing)
            raise


@dataclass(frozen=True)
class _Runs:
    """Batches of runs, each in a folder of its own."""

    model: Forward
    problem: Problem
    folder: Path
    pool: Executor | None
    step: Step
    batches: Iterator[int] = field(default_factory=count)
    numbers: Iterator[int] = field(default_factory=lambda: count(1))

    def __call__(self, points: FloatArray) -> ForwardRuns:
        """Run the model at parameters (N, d)."""
        symbols, control = self.problem.forward_symbols, tuple(self.problem.control.tolist())
        tasks = [
            ForwardRun(self.model, tuple(zip(symbols, point.tolist(), strict=True)), control, next(self.numbers))
            for point in points
        ]
        place = self.folder / f"batch-{next(self.batches)}"
        place.mkdir(exist_ok=True)
        _forget_failures(place / RESULTS)
        results = run_tasks(tasks, carry_out, place, pool=self.pool, step=self.step)
        return gathered(symbols, results, len(control))


def _open(folder: Path, model: Forward, problem: Problem) -> None:
    """Mark a folder as that of this model and these controls, or refuse it."""
    about = {
        "model": model.identity,
        "parameters": list(problem.forward_symbols),
        "control": problem.control.tolist(),
    }
    file = folder / ABOUT
    if file.exists():
        try:
            found = json.loads(file.read_text(encoding="utf-8"))
        except ValueError as error:
            raise InputError(f"'{file}' is damaged: choose another folder for the runs.") from error
        for name, value in about.items():
            if found.get(name) != value:
                raise InputError(
                    f"folder '{folder}' holds runs of another forward model or data (its {name} differ): choose "
                    "another one, or remove it."
                )
        return
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"'{folder}' is not a folder of forward runs; choose another one.")
    folder.mkdir(parents=True, exist_ok=True)
    scratch = file.with_suffix(".new")
    scratch.write_text(json.dumps(about), encoding="utf-8")
    scratch.replace(file)


def _remove_if_fruitless(folder: Path, missing: Sequence[Path]) -> None:
    """Remove a folder in which not one run has ended, and what was made to hold it."""
    if any(path.stat().st_size for path in folder.glob(f"batch-*/{RESULTS}")):
        return
    shutil.rmtree(folder, ignore_errors=True)
    for each in missing[1:]:
        with suppress(OSError):
            each.rmdir()


def _forget_failures(results: Path) -> None:
    """Take failed runs off the disk, so that they are tried again."""
    if not results.exists():
        return
    kept = [line for line in results.read_text(encoding="utf-8").splitlines(keepends=True) if not _has_failed(line)]
    results.write_text("".join(kept), encoding="utf-8")


def _has_failed(line: str) -> bool:
    try:
        return bool(json.loads(line)["error"])
    except ValueError:  # cut short by a kill
        return True


def _check_travels(model: Forward) -> None:
    try:
        pickle.dumps(model)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise InputError(
            f"the forward model cannot be sent to other processes ({error}): define it at the top of a file, or use "
            "one worker."
        ) from error
