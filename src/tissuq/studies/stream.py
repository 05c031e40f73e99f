"""Many small tasks whose results are on disk as soon as they are there: on one core, many processes, or a cluster."""

from __future__ import annotations

import json
import logging
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    as_completed,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from itertools import islice
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from threading import Thread
from typing import Any, ClassVar, Generic, ParamSpec, Protocol, TypeVar

from tissuq.errors import InputError
from tissuq.studies.batch_jobs import is_queue, workers_in_queue

Arguments = ParamSpec("Arguments")
Value = TypeVar("Value")

SPAWN = get_context("spawn")


@contextmanager
def open_pool(workers: int = 1, scheduler: str | None = None) -> Iterator[Executor | None]:
    """Give the workers of a campaign: processes on this machine, or those of a Dask scheduler; None for no other.

    Parameters
    ----------
    workers : int
        Processes, or batch jobs.
    scheduler : str, optional
        Address of a Dask scheduler, or a queue in which batch jobs are to be put (`workers_in_queue`).

    Raises
    ------
    InputError
        When the scheduler cannot be reached, or is lost.
    """
    if scheduler is not None and is_queue(scheduler):
        with workers_in_queue(scheduler, workers) as cluster, _dask_pool(cluster.scheduler_address) as pool:
            yield pool
    elif scheduler is not None:
        with _dask_pool(scheduler) as pool:
            yield pool
    elif workers == 1:
        yield None
    else:
        with WorkerProcesses(workers) as processes:
            yield processes


@contextmanager
def _dask_pool(scheduler: str) -> Iterator[Executor]:
    try:
        from distributed import Client, KilledWorker
        from distributed.comm import CommClosedError
    except ImportError as error:
        raise InputError("--scheduler needs Dask: install tissuq with its extra 'cluster'.") from error
    log = logging.getLogger("distributed.client")
    level = log.level
    log.setLevel(logging.CRITICAL)  # its errors are raised here, too
    try:
        client = Client(scheduler, timeout="5s")
    except (OSError, ValueError) as error:
        raise InputError(f"no Dask scheduler answers at '{scheduler}' ({error}).") from error
    try:
        with client, client.get_executor(retries=5) as pool:
            yield pool
    except RuntimeError as error:
        if "deserialization" not in str(error):
            raise
        raise InputError(
            f"the Dask scheduler at '{scheduler}' does not understand tasks of tissuq: install there the same versions "
            "of Python, of tissuq and of its dependencies, and start it anew."
        ) from error
    except (CancelledError, CommClosedError, KilledWorker) as error:
        raise InputError(
            f"the Dask scheduler at '{scheduler}' or its workers are lost ({type(error).__name__}). What is done is "
            "kept: the same command goes on from there, with another scheduler or with --workers."
        ) from error
    finally:
        log.setLevel(level)


class WorkerProcesses(Executor):
    """Processes that end when this one does, however it ends, and that can be replaced when one of them is killed.

    Each of them waits for the end of a pipe that only this process holds open.

    Parameters
    ----------
    workers : int
        Processes.
    """

    def __init__(self, workers: int) -> None:
        self._workers = workers
        self._start()

    def _start(self) -> None:
        watched, self._open_end = SPAWN.Pipe(duplex=False)
        self._processes = ProcessPoolExecutor(self._workers, SPAWN, _end_with, (watched,))

    def submit(
        self, function: Callable[Arguments, Value], /, *args: Arguments.args, **kwargs: Arguments.kwargs
    ) -> Future[Value]:
        with _interrupts_held():  # a process that starts inherits this, and is not interrupted before it can be told
            return self._processes.submit(function, *args, **kwargs)

    def replace(self) -> None:
        """End the processes at once and start others."""
        self._end()
        self._start()

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        self._processes.shutdown(wait, cancel_futures=cancel_futures)
        self._open_end.close()

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self.shutdown()
        else:
            self._end()

    def _end(self) -> None:
        """End the processes, whatever they are doing."""
        self._open_end.close()
        self._processes.shutdown(cancel_futures=True)


def _end_with(watched: Connection) -> None:
    """Let a worker end as soon as the process that started it closes a pipe or is gone; leave Ctrl-C to that one."""

    def wait() -> None:
        with suppress(EOFError, OSError):
            watched.recv()
        os._exit(1)

    signal.signal(signal.SIGINT, lambda *_: None)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
    Thread(target=wait, daemon=True).start()


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Hold back Ctrl-C for as long as the context lasts, where the system can."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    earlier_mask: Any = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, earlier_mask)


RESULTS = "tasks.jsonl"
"""The file of the results: a line a task."""
MAX_LOSSES = 3
"""Times in a row that worker processes may be lost with nothing done in between."""

Step = Callable[[str, bool], None]
"""Called after each task: its label, and whether it was done now or earlier."""


def silent(label: str, is_new: bool) -> None:
    """Report nothing."""


class Task(Protocol):
    """One unit of work."""

    @property
    def key(self) -> str:
        """Identifies the task."""

    @property
    def label(self) -> str:
        """Shown when the task is done."""


@dataclass(frozen=True)
class TaskOfFields:
    """A task that is told from others by what it is made of; its label may be among that."""

    separator: ClassVar[str] = "-"

    @property
    def key(self) -> str:
        """What tells it from every other task of the campaign."""
        return self.separator.join(str(value) for name, value in vars(self).items() if name != "label")


Kind = TypeVar("Kind", bound=Task)
Settings = TypeVar("Settings")


def run_tasks(
    tasks: Sequence[Kind],
    carry_out: Callable[[Kind], dict[str, Any]],
    folder: Path,
    *,
    pool: Executor | None = None,
    limit: int | None = None,
    step: Step = silent,
    others_stay: bool = False,
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
        From `tissuq.studies.stream.open_pool`.
    limit : int, optional
        Tasks that are carried out at the same time, where they may be fewer than the pool has workers.
    step : callable
        Told of every task that is done: its label, and whether it was done now or before.
    others_stay : bool
        Leave the results of other tasks in the file.
    """
    path = folder / RESULTS
    done = read_results(path)
    for task in tasks:
        if task.key in done:
            step(task.label, False)
    with path.open("a", encoding="utf-8") as file:
        remaining = [task for task in tasks if task.key not in done]
        for task, result in _carried_out(remaining, carry_out, pool, limit):
            done[task.key] = {"key": task.key, **result}
            file.write(json.dumps(done[task.key]) + "\n")
            file.flush()
            os.fsync(file.fileno())
            step(task.label, True)
    results = [done[task.key] for task in tasks]
    if not others_stay:
        _write_results(path, results)
    return results


@dataclass(frozen=True)
class Campaign(Generic[Settings]):
    """Carries out what settings ask for, task by task: call it with settings and the folder of the results.

    Parameters
    ----------
    tasks_of : callable
        Returns the tasks of settings, in their order.
    carry_out : callable
        Returns the result of a task under settings, plain data.
    """

    tasks_of: Callable[[Settings], Sequence[Any]]
    carry_out: Callable[[Settings, Any], dict[str, Any]]

    def __call__(
        self, settings: Settings, folder: Path, *, pool: Executor | None = None, step: Step = silent
    ) -> list[dict[str, Any]]:
        """Carry out what is not done yet, as `run_tasks` does; return the results of all tasks, in their order."""
        return run_tasks(self.tasks_of(settings), partial(self.carry_out, settings), folder, pool=pool, step=step)


def read_results(path: Path) -> dict[str, dict[str, Any]]:
    """Return the results in a file by their keys; a line that was cut short by a kill is taken off the file.

    A line that is damaged in another way is passed over, so that its task is carried out again.
    """
    if not path.exists():
        return {}
    content = path.read_bytes()
    complete = content[: content.rfind(b"\n") + 1]
    if len(complete) < len(content):
        with path.open("r+b") as file:
            file.truncate(len(complete))
    results = (_parsed(line) for line in complete.splitlines())
    return {result["key"]: result for result in results if result is not None}


def forget_results(path: Path, has_failed: Callable[[dict[str, Any]], bool]) -> dict[str, dict[str, Any]]:
    """Take the results of tasks that failed off a file, so that they are carried out again; return them by key."""
    results = read_results(path)
    failed = {key: result for key, result in results.items() if has_failed(result)}
    if failed:
        _write_results(path, [result for key, result in results.items() if key not in failed])
    return failed


def unfinished(file: Path) -> Path:
    """Return where a file is written before it is whole."""
    return file.with_name(f"{file.name}.new")


def write_whole(file: Path, text: str) -> None:
    """Write a file whole or not at all, whenever the process is killed."""
    unfinished(file).write_text(text, encoding="utf-8")
    unfinished(file).replace(file)


def _write_results(path: Path, results: Sequence[dict[str, Any]]) -> None:
    write_whole(path, "".join(json.dumps(result) + "\n" for result in results))


def _parsed(line: bytes) -> dict[str, Any] | None:
    """Return the result in a line, None where it is damaged."""
    try:
        result = json.loads(line)
    except ValueError:
        return None
    return result if isinstance(result, dict) and isinstance(result.get("key"), str) else None


def _carried_out(
    tasks: Sequence[Kind], carry_out: Callable[[Kind], dict[str, Any]], pool: Executor | None, limit: int | None
) -> Iterator[tuple[Kind, dict[str, Any]]]:
    """Yield tasks and their results as they come; processes that are killed are replaced."""
    if pool is None:
        yield from ((task, carry_out(task)) for task in tasks)
        return
    remaining = {task.key: task for task in tasks}
    losses = 0
    while remaining:
        try:
            for task, result in _submitted(list(remaining.values()), carry_out, pool, limit):
                losses = 0
                del remaining[task.key]
                yield task, result
        except BrokenProcessPool as error:
            losses += 1
            if losses == MAX_LOSSES or not isinstance(pool, WorkerProcesses):
                raise InputError(
                    f"worker processes were killed {losses} times in a row, perhaps for want of memory, or ended as "
                    "they read a script whose calls do not stand beneath 'if __name__ == \"__main__\":'. What is done "
                    "is kept: the same command or script goes on from there; give it fewer workers."
                ) from error
            pool.replace()


def _submitted(
    tasks: Sequence[Kind], carry_out: Callable[[Kind], dict[str, Any]], pool: Executor, limit: int | None
) -> Iterator[tuple[Kind, dict[str, Any]]]:
    """Yield tasks and their results as they come from a pool, to which not more than the limit are given at a time."""
    futures: dict[Future[dict[str, Any]], Kind] = {}
    waiting = iter(tasks)
    try:
        futures |= {pool.submit(carry_out, task): task for task in islice(waiting, limit)}
        if limit is None:
            yield from ((futures[future], future.result()) for future in as_completed(futures))
            return
        while futures:
            for future in wait(futures, return_when=FIRST_COMPLETED).done:
                yield futures.pop(future), future.result()
                futures |= {pool.submit(carry_out, task): task for task in islice(waiting, 1)}
    finally:
        for future in futures:
            future.cancel()
