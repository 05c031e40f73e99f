"""A deck of two materials, a program in the place of CalculiX, and what these leave."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

STUB = Path(__file__).parents[1] / "stub_solver.py"
PATIENCE_S = 120.0
"""For the first results of a command."""
DECK = """*HEADING
*NODE, NSET=TOP
1, 0., 0., 0.
*NSET, NSET=BASE
1
*MATERIAL, NAME=Tissue
*ELASTIC
1., 0.3
*MATERIAL, NAME=Fat
*ELASTIC
2., 0.3
*STEP
*STATIC
*END STEP
"""


def write_model(folder: Path) -> str:
    """Write the deck and the stub into a folder, and return the command that runs the latter."""
    shutil.copyfile(STUB, folder / "stub.py")
    (folder / "model.inp").write_text(DECK, encoding="utf-8")
    return f'"{Path(sys.executable).as_posix()}" "{(folder / "stub.py").as_posix()}" {{job}}'


def started(folder: Path) -> list[str]:
    """Return the folders in which the stub was run, in their order."""
    log = folder / "started"
    return log.read_text(encoding="utf-8").split() if log.exists() else []


def killed_after(count: int, results: Path, folder: Path, *words: object) -> list[str]:
    """Kill a command in a folder when so many lines stand in a file of results, and return these lines."""
    process = subprocess.Popen(
        [sys.executable, "-c", "from tissuq.cli import main; main()", *map(str, words)],
        cwd=folder, env=dict(os.environ), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    deadline = time.monotonic() + PATIENCE_S
    while not results.exists() or results.read_text(encoding="utf-8").count("\n") < count:
        assert time.monotonic() < deadline
        assert process.poll() is None
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    process.wait()
    return results.read_text(encoding="utf-8").splitlines()[:count]
