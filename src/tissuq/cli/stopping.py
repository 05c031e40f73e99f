"""Ctrl-C and requests to terminate: what is said, and with which status a command ends."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from tissuq.cli.progress import Monitor

__all__ = ["INTERRUPTED", "TERMINATED", "Stopped", "end_on_request", "stopping"]

INTERRUPTED = 130
"""The exit status that Typer gives to Ctrl-C."""
TERMINATED = 128 + signal.SIGTERM


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
