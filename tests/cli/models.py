"""A deck of two materials, a program in the place of CalculiX, and what these leave."""

from __future__ import annotations

import csv
import shutil
import sys
from pathlib import Path

STUB = Path(__file__).parents[1] / "stub_solver.py"
DECK = """*HEADING
*NODE, NSET=TOP
1, 0., 0., 0.
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


def rows_of(path: Path) -> list[dict[str, str]]:
    """Return the rows of a table."""
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def started(folder: Path) -> list[str]:
    """Return the folders in which the stub was run, in their order."""
    log = folder / "started"
    return log.read_text(encoding="utf-8").split() if log.exists() else []
