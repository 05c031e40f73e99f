"""The command line run in this process: arguments in; exit status, output and files out."""

from __future__ import annotations

import sys
import warnings
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import pytest

from tissuq.cli import main


@dataclass(frozen=True)
class Outcome:
    """What a command left: its exit status and what it said."""

    status: int
    out: str
    err: str


def run_in(folder: Path, *arguments: object) -> Outcome:
    """Run ``tissuq ARGUMENTS`` in a folder."""
    out, err = StringIO(), StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.chdir(folder)
        patch.setenv("COLUMNS", "80")
        patch.setattr(sys, "argv", ["tissuq", *map(str, arguments)])
        patch.setattr(warnings, "formatwarning", warnings.formatwarning)  # which the command sets
        with pytest.raises(SystemExit) as end:
            main()
    return Outcome(int(end.value.code or 0), out.getvalue(), err.getvalue())


def done_in(folder: Path, *arguments: object) -> Outcome:
    """Run a command that ends well in a folder."""
    said = run_in(folder, *arguments)
    assert said.status == 0, said.err
    return said
