"""Many small tasks, whose results are on disk as soon as they are there: on one core, many, or a cluster."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Protocol, TypeVar

from tissuq.errors import InputError

__all__ = ["RESULTS", "Step", "open_pool", "run_tasks", "silent"]

RESULTS = "tasks.jsonl"
"""The file of the results: a line a task."""

Step = Callable[[str, bool], None]
"""Told of every task that is done: its label, and whether it was done now or before."""


def silent(label: str, is_new: bool) -> None:
    """Tell nobody."""


class Task(Protocol):
    """What is done by itself."""

    @property
    def key(self) -> str:
        """What tells it from every other task."""

    @property
    def label(self) -> str:
        """What is shown when it is done."""


Kind = TypeVar("Kind", bound=Task)


@contextmanager
def open_pool(workers: int = 1, scheduler: str | None = None) -> Iterator[Executor | None]:
    """Give the workers of a campaign: processes on this machine, or those of a Dask scheduler; None for no other.

    Raises
    ------
    InputError
        When the scheduler cannot be reached.
    """
    if scheduler is None:
        if workers == 1:
            yield None
            return
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


def run_tasks(
    tasks: Sequence[Kind],
    carry_out: Callable[[Kind], dict[str, Any]],
    folder: Path,
    *,
    pool: Executor | None = None,
    step: Step = silent,
) -> list[dict[str, Any]]:
    """Carry out what is not done yet, and return the results of all tasks, in their order.

    A result is on disk before the next is waited for; what was killed at any point goes on where it was. Results
    depend neither on the workers nor on their order.

    Parameters
    ----------
    tasks : sequence of Task
    carry_out : callable
        Returns the result of a task, plain data; it and the tasks travel to the workers.
    folder : Path
        Exists; holds the results so far, if any.
    pool : Executor, optional
        From `open_pool`.
    step : callable
        Told of every task that is done: its label, and whether it was done now or before.
    """
    path = folder / RESULTS
    done = _read(path)
    for task in tasks:
        if task.key in done:
            step(task.label, False)
    with path.open("a", encoding="utf-8") as file:
        for task, found in _carried_out([task for task in tasks if task.key not in done], carry_out, pool):
            done[task.key] = {"key": task.key, **found}
            file.write(json.dumps(done[task.key]) + "\n")
            file.flush()
            os.fsync(file.fileno())
            step(task.label, True)
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
    tasks: Sequence[Kind], carry_out: Callable[[Kind], dict[str, Any]], pool: Executor | None
) -> Iterator[tuple[Kind, dict[str, Any]]]:
    """Yield tasks and their results as they come."""
    if pool is None:
        yield from ((task, carry_out(task)) for task in tasks)
        return
    futures = {pool.submit(carry_out, task): task for task in tasks}
    try:
        yield from ((futures[future], future.result()) for future in as_completed(futures))
    finally:
        for future in futures:
            future.cancel()
