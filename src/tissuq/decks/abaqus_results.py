"""The result file of Abaqus (``.odb``), which only Abaqus's own Python opens: it writes what is asked for."""

from __future__ import annotations

import json
import shlex
import shutil
import subprocess
from collections.abc import Collection, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tissuq.decks.result_file import ALL, TENSOR, ResultFile, Values, unknown_set
from tissuq.errors import InputError

__all__ = ["AbaqusResults"]

FloatArray = NDArray[np.float64]

SCRIPT = Path(__file__).with_name("odb_table.py")
SUFFIX = ".tissuq.json"
"""What the name of the table ends in."""
LAST_LINES = 5
"""Lines of what Abaqus said that a message shows."""


class AbaqusResults(ResultFile):
    """Abaqus's output database; stresses are those extrapolated to nodes, averaged over the elements that meet there.

    Its strains are logarithmic ones, not Green's. Sets are those in the file, also of an instance
    (``PART-1-1.TOP``).
    """

    name = "abaqus"
    suffixes = (".odb",)
    requests = {  # noqa: RUF012  (as in the base class)
        "U": r"*OUTPUT, FIELD\n*NODE OUTPUT, NSET={set}\n U",
        "RF": r"*OUTPUT, FIELD\n*NODE OUTPUT, NSET={set}\n RF",
        "S": r"*OUTPUT, FIELD\n*ELEMENT OUTPUT\n S",
    }

    @property
    def nodes(self) -> NDArray[np.int64]:
        return np.zeros(0, dtype=np.int64)

    @cached_property
    def node_sets(self) -> Mapping[str, Collection[int]]:
        """The names of the sets in the file, of which the members stay in it."""
        return dict.fromkeys(self._table(())["sets"], ())

    def field(self, kind: str) -> Values | None:
        return self.of_set(kind, ALL, "")

    def of_set(self, kind: str, set_name: str, how: str) -> Values | None:
        if kind not in self.requests:
            return None
        request = f"{kind}@{set_name}"
        fields = self._table((request,))["fields"]
        if request not in fields:
            raise InputError(unknown_set(set_name, self.node_sets))
        field = fields[request]
        if field is None:
            return None
        width = len(TENSOR) if kind == "S" else 3
        is_within = self.results.reach(np.array(field["times"]))
        rows = [[row or [np.nan] * width for row in rows] for rows in field["rows"]]
        return Values(np.array(field["times"])[is_within], np.array(rows, dtype=np.float64)[is_within])

    def _table(self, requests: tuple[str, ...]) -> Mapping[str, Any]:
        """Return the table, written anew where it lacks a request."""
        target = self.path.with_name(self.path.name + SUFFIX)
        stored = _stored(target)
        if stored is None or not set(requests) <= set(stored["asked"]):
            all_requests = sorted({*requests, *(f"{kind}@{name}" for kind, name in self.results.asked)})
            self._write(target, all_requests)
            written = _stored(target) or {"sets": [], "fields": {}}
            stored = {**written, "asked": all_requests}
            target.write_text(json.dumps(stored), encoding="utf-8")
        return stored

    def _write(self, target: Path, requests: list[str]) -> None:
        program, *words = shlex.split(self.results.program) or ["abaqus"]
        command = [
            shutil.which(program) or program,
            *words,
            "python",
            str(SCRIPT),
            self.path.name,
            target.name,
            *requests,
        ]
        advice = "Name the program that opens it with --abaqus 'abaqus', or give the quantity by a function of yours."
        try:
            done = subprocess.run(  # noqa: S603  (the user's program, without a shell)
                command, cwd=self.path.parent, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL
            )
        except OSError as error:
            raise InputError(
                f"{self.label} cannot be opened: there is no program '{program}' to run. {advice}"
            ) from error
        if done.returncode or not target.is_file():
            lines = f"{done.stdout}\n{done.stderr}".strip().splitlines()[-LAST_LINES:]
            said = "".join(f"\n    {line}" for line in lines)
            raise InputError(f"{self.label} cannot be opened by '{program} python'. {advice} It said:{said}")


def _stored(target: Path) -> dict[str, Any] | None:
    """Return what is in a table; None where there is none, or it was cut short."""
    try:
        table = json.loads(target.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return {"asked": (), **table} if isinstance(table, dict) and "fields" in table else None
