"""How a command gets on: shown on a terminal, told in lines elsewhere, kept for the log; and what is said at a stop."""

from __future__ import annotations

import os
import shlex
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from threading import Timer
from time import monotonic
from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress

LOG = "tissuq.log"
"""The file of a run that says how it came about."""
PATIENCE = 3.0
"""Seconds after which a step is told of where there is no terminal."""
TASKS_APART = 10.0
"""Seconds between lines about the tasks of a campaign."""
NONE_DONE = 60.0
"""Seconds after which it is told that no task of a campaign is done: batch jobs may wait, or may have failed."""
SWITCH = "TISSUQ_PROGRESS"
"""The environment variable that says ``off`` where such lines would be in the way."""
INTERRUPTED = 130
"""The exit status that Typer gives to Ctrl-C."""
TERMINATED = 128 + signal.SIGTERM


@dataclass
class Monitor:
    """The stages of a command, as they go by.

    Parameters
    ----------
    is_quiet : bool
        Show nothing.
    is_verbose : bool
        Tell how long every stage took.

    Attributes
    ----------
    stages : list of (str, float)
        Their names, and when they began, in seconds from the beginning.
    tasks_done, tasks : int
        Of a campaign.
    folder : Path or None
        Where what is done stays when the command is stopped.
    """

    is_quiet: bool = False
    is_verbose: bool = False
    stages: list[tuple[str, float]] = field(default_factory=list)
    tasks_done: int = 0
    tasks: int = 0
    folder: Path | None = None
    started: float = field(default_factory=monotonic)
    started_at: datetime = field(default_factory=lambda: datetime.now(UTC))

    @property
    def seconds(self) -> float:
        """Since the beginning."""
        return monotonic() - self.started

    @contextmanager
    def steps(self, total: int | None = None) -> Iterator[Callable[[str], None]]:
        """Show the steps of a run; give the function that announces the next one.

        They are unlike, from a fit to the writing of a page, so that those done do not tell how long the others take.
        """
        done = 0
        with self._bar(total) as bar, _Timed(self._say) as timed:
            shown = bar.add_task("starting", total=total)

            def step(text: str) -> None:
                nonlocal done
                self._begin(text)
                bar.update(shown, description=text, completed=done)
                done += 1
                if self._tells_lines:
                    timed.wait(f"{done} of {total}: {text}" if total else text)

            yield step
        self._end()

    @contextmanager
    def campaign(self, total: int) -> Iterator[Callable[[str, bool], None]]:
        """Show how much of a campaign is done and how long it will take; give the function to call after each task.

        Tasks that an earlier run had done count as done, but not in the estimate of the time.
        """
        self._begin(f"{total} tasks")
        self.tasks, self.tasks_done, computed, begun, last_told = total, 0, 0, monotonic(), monotonic()
        with self._bar(total) as bar, _Timed(self._say) as timed:
            shown = bar.add_task("", total=total)
            if self._tells_lines:
                timed.wait(f"none of {total} tasks is done after {NONE_DONE:.0f} s", NONE_DONE)

            def step(text: str, is_new: bool) -> None:
                nonlocal computed, last_told
                timed.stop()
                self.tasks_done, computed = self.tasks_done + 1, computed + is_new
                seconds_left = (monotonic() - begun) / computed * (total - self.tasks_done) if computed else None
                bar.update(shown, description=f"{_left(seconds_left)}{text}", completed=self.tasks_done)
                if self._tells_lines and monotonic() - last_told > TASKS_APART:
                    last_told = monotonic()
                    self._say(f"{self.tasks_done} of {total}, {_left(seconds_left)}{text}")

            yield step
        self._end()

    def write_log(self, folder: Path, warnings: Iterable[str] = ()) -> None:
        """Write into a run's folder how it came about; an earlier log of a campaign stays above."""
        import platform
        from importlib.metadata import version

        from tissuq.result_warning import in_shell

        lines = [
            f"{self.started_at:%Y-%m-%d %H:%M:%S} UTC  tissuq {version('tissuq')}, Python {platform.python_version()}",
            f"command: {_without_folders()}",
            *(f"{began:8.1f} s  {name}" for name, began in self.stages if name),
            f"{self.seconds:8.1f} s  written",
            *(f"warning: {' '.join(in_shell(text).split())}" for text in warnings),
        ]
        with (folder / LOG).open("a", encoding="utf-8") as file:
            file.write("\n".join(lines) + "\n\n")

    def stopped(self) -> str:
        """Return what to say when the command is stopped: what is done, and how to go on."""
        if self.folder is not None:
            done = f"{self.tasks_done} of {self.tasks} tasks are done" if self.tasks else "what is done"
            return f"stopped; {done} and kept in '{self.folder}'. To go on: {_as_typed()}"
        names = [name for name, _ in self.stages if name]
        stage = f" during '{names[-1]}'" if names else ""
        done = f" (done: {', '.join(names[:-1])})" if names[:-1] else ""
        return f"stopped{stage}{done}; no run was written. To begin again: {_as_typed()}"

    def _begin(self, name: str) -> None:
        self._end()
        self.stages.append((name, self.seconds))

    def _end(self) -> None:
        """Tell how long the stage took, if one is going on and that is asked for."""
        if self.stages and self.stages[-1][0]:
            name, began = self.stages[-1]
            if self.is_verbose:
                self._say(f"{name}: {self.seconds - began:.1f} s")
            self.stages.append(("", self.seconds))

    @property
    def _has_terminal(self) -> bool:
        return sys.stderr.isatty()

    @property
    def _tells_lines(self) -> bool:
        return not self._has_terminal and os.environ.get(SWITCH) != "off"

    def _bar(self, total: int | None) -> Progress:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

        columns = (
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("{task.description}", markup=False),
        )
        is_shown = self._has_terminal and not self.is_quiet
        return Progress(*columns, console=Console(stderr=True), transient=True, disable=not is_shown)

    def _say(self, text: str) -> None:
        if not self.is_quiet:
            print(f"tissuq: {text}", file=sys.stderr, flush=True)


class _Timed:
    """Says what goes on for long: the text that it waits with, unless another comes first."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self.say = say
        self.timer: Timer | None = None

    def __enter__(self) -> _Timed:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def wait(self, text: str, seconds: float = PATIENCE) -> None:
        """Say a text, unless another comes within some seconds, or it stops."""
        self.stop()
        self.timer = Timer(seconds, self.say, [text])
        self.timer.daemon = True
        self.timer.start()

    def stop(self) -> None:
        """Say nothing of what is waited with."""
        if self.timer is not None:
            self.timer.cancel()


def _as_typed() -> str:
    return shlex.join(["tissuq", *sys.argv[1:]])


def _without_folders() -> str:
    """Return what was typed, but of paths that begin at the root, which a run says nothing of, the names alone."""
    words = [word.partition("=") for word in sys.argv[1:]]
    ends = [(_name(option), equals, _name(value)) for option, equals, value in words]
    return shlex.join(["tissuq", *("".join(pieces) for pieces in ends)])


def _name(text: str) -> str:
    return Path(text).name if Path(text).is_absolute() else text


def _left(seconds: float | None) -> str:
    if seconds is None:
        return ""
    minutes, remaining = divmod(round(seconds), 60)
    return f"{minutes // 60} h {minutes % 60:02d} min left, " if minutes >= 60 else f"{minutes}:{remaining:02d} left, "


class Stopped(SystemExit):
    """The end of a command that has said what is done."""


@contextmanager
def stopping(monitor: Monitor) -> Iterator[None]:
    """Say what is done, and how to go on, where a command is stopped."""
    try:
        yield
    except (KeyboardInterrupt, SystemExit) as end:
        status = end.code if isinstance(end, SystemExit) else INTERRUPTED
        if status not in (INTERRUPTED, TERMINATED):
            raise
        print(f"tissuq: {monitor.stopped()}", file=sys.stderr)
        raise Stopped(status) from None


def end_on_request() -> None:
    """End on a request to terminate as on an error, so that nothing half written is left."""
    signal.signal(signal.SIGTERM, _stop)


def _stop(number: int, _: FrameType | None) -> None:
    signal.signal(number, signal.SIG_IGN)
    sys.exit(TERMINATED)
