"""Tasks for worker processes, some of which never end or are killed; run as a script, a campaign of endless ones."""

from __future__ import annotations

import os
import signal
import sys
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from tissuq.studies.stream import open_pool, run_tasks


@dataclass(frozen=True)
class Number:
    """A task whose result is twice its number."""

    number: int

    @property
    def key(self) -> str:
        return str(self.number)

    @property
    def label(self) -> str:
        return f"task {self.number}"


def endless(task, folder):
    """Leave a file with the process's number, and work on and on."""
    (folder / f"process-{task.number}").write_text(str(os.getpid()))
    time.sleep(3600)


def doubled(task, folder, deaths):
    """Return twice the number; the process that is given number 1 is killed the first times."""
    if task.number == 1 and (died := len(list(folder.glob("death-*")))) < deaths:
        (folder / f"death-{died}").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return {"twice": 2 * task.number}


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    with open_pool(2) as pool:
        run_tasks([Number(0), Number(1)], partial(endless, folder=folder), folder, pool=pool)
