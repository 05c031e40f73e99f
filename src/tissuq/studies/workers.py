"""The workers of a campaign: processes on this machine, or those of a Dask scheduler."""

from __future__ import annotations

import logging
import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from threading import Thread
from typing import Any, ParamSpec, TypeVar

from tissuq.errors import InputError

__all__ = ["WorkerProcesses", "open_pool"]

Arguments = ParamSpec("Arguments")
Value = TypeVar("Value")

SPAWN = get_context("spawn")


@contextmanager
def open_pool(workers: int = 1, scheduler: str | None = None) -> Iterator[Executor | None]:
    """Give the workers of a campaign: processes on this machine, or those of a Dask scheduler; None for no other.

    Raises
    ------
    InputError
        When the scheduler cannot be reached, or is lost.
    """
    if scheduler is not None:
        with _dask_pool(scheduler) as cluster:
            yield cluster
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
    before: Any = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
