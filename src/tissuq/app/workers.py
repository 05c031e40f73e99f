"""Processes that do the work of the page: started and warmed up before they are needed, ended to stop what they do."""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import signal
import tempfile
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

from tissuq.errors import TissuqError

SPAWNED = multiprocessing.get_context("spawn")  # a fork of a process with threads may hang
LIGHT = ("choices", "inspect")
"""Tasks that take a moment and need neither JAX nor Matplotlib."""
PREPARED = "prepared"
MOST_FITS = 2
"""Fits that go on at once, where the computer has the cores."""


class News(NamedTuple):
    """What a process says of its task: ``step``, ``answer``, and at last ``done`` or ``error``."""

    kind: str
    data: Any


class _Process:
    """A process that does one task after another, and its end of the pipe."""

    def __init__(self, scratch: Path, *, is_light: bool) -> None:
        self.connection, child_end = SPAWNED.Pipe()
        self.process = SPAWNED.Process(target=_work, args=(child_end, scratch, is_light), daemon=True)
        with _deaf_to_interrupts():
            self.process.start()
        child_end.close()

    def receive(self) -> News:
        """Return the next news; of a process that has ended, that it has."""
        try:
            return News(*self.connection.recv())
        except (EOFError, OSError):
            return News("error", {"text": "", "stopped": True})

    def end(self) -> None:
        """End the process, whatever it does."""
        self.process.kill()
        self.process.join(5)
        self.connection.close()


class _Pool:
    """Processes of one kind: one from the start, further ones when all are busy."""

    def __init__(self, scratch: Path, limit: int, threads: ThreadPoolExecutor, *, is_light: bool) -> None:
        self.scratch, self.limit, self.is_light = scratch, limit, is_light
        self.threads = threads
        self.has_ended = False
        self.idle: asyncio.Queue[_Process] = asyncio.Queue()
        self.processes: set[_Process] = set()
        self.busy = 0
        self.starts: set[asyncio.Task[None]] = set()

    def start(self) -> None:
        """Start one more process; it is idle as soon as it is prepared."""
        process = _Process(self.scratch, is_light=self.is_light)
        self.processes.add(process)
        task = asyncio.get_running_loop().create_task(self._prepared(process))
        self.starts.add(task)
        task.add_done_callback(self.starts.discard)

    async def run(self, message: Any, say: Callable[[News], None]) -> None:
        if self.idle.empty() and self.busy == len(self.processes) < self.limit:
            self.start()
        process = await self.idle.get()
        self.busy += 1
        say(News("start", None))
        try:
            process.connection.send(message)
            while (news := await self.next_of(process)).kind not in ("done", "error"):
                say(news)
        except BaseException:
            self._replace(process)
            raise
        finally:
            self.busy -= 1
        if isinstance(news.data, dict) and news.data.get("stopped"):
            self._replace(process)
            news = News("error", {"text": "The process that did the work has ended; the memory may be too small."})
        else:
            self.idle.put_nowait(process)
        say(news)

    async def next_of(self, process: _Process) -> News:
        return await asyncio.get_running_loop().run_in_executor(self.threads, process.receive)

    def end(self) -> None:
        self.has_ended = True
        for start in list(self.starts):
            start.cancel()
        for process in self.processes:
            process.end()

    async def _prepared(self, process: _Process) -> None:
        await self.next_of(process)  # it says that it is prepared
        self.idle.put_nowait(process)

    def _replace(self, process: _Process) -> None:
        self.processes.discard(process)
        process.end()
        if not self.has_ended:
            self.start()


class Workers:
    """A process for reading files, and some for fits, of which each does one task at a time.

    Parameters
    ----------
    scratch : Path
        Folder that is deleted after the processes have ended, in which they may leave files.
    """

    def __init__(self, scratch: Path) -> None:
        fitting_limit = min(MOST_FITS, os.cpu_count() or 1)
        self._threads = ThreadPoolExecutor(max_workers=fitting_limit + 2, thread_name_prefix="news")
        self._light = _Pool(scratch, 1, self._threads, is_light=True)
        self._heavy = _Pool(scratch, fitting_limit, self._threads, is_light=False)

    async def start(self) -> None:
        """Start a process of each kind."""
        self._light.start()
        self._heavy.start()

    async def run(self, task: str, request: Mapping[str, Any], folder: Path, say: Callable[[News], None]) -> None:
        """Do a task in a folder and say what comes of it; cancelled, its process ends, and another takes its turn."""
        pool = self._light if task in LIGHT else self._heavy
        await pool.run((task, dict(request), str(folder)), say)

    async def stop(self) -> None:
        """End all processes."""
        self._light.end()
        self._heavy.end()
        self._threads.shutdown(wait=False, cancel_futures=True)


@contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Ignore Ctrl-C for a moment: what is started then ignores it for good, for the page ends it."""
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)


def _work(connection: Any, scratch: Path, is_light: bool) -> None:
    """Do tasks until the page ends; every message of tissuq is news, and an error of the program is one, too."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # where systems do not hand it down
    os.chdir(scratch)
    from tissuq.app.tasks import TASKS, warm_up

    if not is_light:
        with tempfile.TemporaryDirectory(prefix="warm-up-", dir=scratch) as folder, suppress(Exception):
            os.chdir(folder)
            warm_up()
            os.chdir(scratch)
    try:
        connection.send((PREPARED, None))
        while True:
            task, request, folder = connection.recv()
            try:
                os.chdir(folder)
                TASKS[task](request, lambda kind, data: connection.send((kind, data)))
            except TissuqError as error:
                connection.send(("error", {"text": str(error), "code": type(error).__name__}))
            except Exception as error:  # the page goes on, and says what to report
                text = f"This is a fault of tissuq ({type(error).__name__}: {error}). Please report it with the file."
                connection.send(("error", {"text": text, "code": "fault"}))
            finally:
                os.chdir(scratch)
    except (EOFError, BrokenPipeError, KeyboardInterrupt):
        return
