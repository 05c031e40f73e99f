"""Solvers: how a deck is run in a folder, within a time limit, and whether it ended well."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
from abc import ABC
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from tissuq.errors import InputError
from tissuq.registry import find, variants

LOG = "solver.log"
"""What the solver said, in the folder of its run."""
LAST_LINES = 12
"""Lines of it that the report of a failed run shows."""
PLACEHOLDERS = ("job", "deck")


@dataclass(frozen=True)
class Outcome:
    """How a run ended: the problem, empty where there is none, and the solver's last lines."""

    problem: str
    lines: tuple[str, ...] = ()


@dataclass(frozen=True)
class Solver(ABC):
    """A finite-element program; a new one is one subclass with its command.

    Parameters
    ----------
    command : str
        The command, with ``{job}`` for the name of the deck without suffix and ``{deck}`` for that with it; unless
        given, that of the solver. It is run without a shell in a folder that holds the deck.
    """

    entry_point_group: ClassVar[str] = "tissuq.solvers"
    name: ClassVar[str]
    template: ClassVar[str]
    deck_format: ClassVar[str]
    """The format of its decks; empty where it may be any."""
    card_format: ClassVar[str]
    """The format of its cards; empty where it is that of the deck."""

    command: str = ""

    def __post_init__(self) -> None:
        words = self.words("job", "deck")
        if not words:
            raise InputError(f"the solver '{self.name}' needs its command: --command 'abaqus job={{job}} ask=off'.")

    def words(self, job: str, deck: str) -> list[str]:
        """Return the words of the command for a deck.

        Raises
        ------
        InputError
            When the command is not understood.
        """
        text = self.command or self.template
        try:
            return [word.format(job=job, deck=deck) for word in shlex.split(text)]
        except (ValueError, LookupError, AttributeError, TypeError) as error:
            names = " and ".join(f"{{{name}}}" for name in PLACEHOLDERS)
            raise InputError(
                f"the command '{text}' is not understood ({error}); {names} stand for the deck."
            ) from error

    def check_installed(self) -> None:
        """Refuse a command whose program is not there.

        Raises
        ------
        InputError
            When it is not.
        """
        program = self.words("job", "deck")[0]
        if shutil.which(program) is None:
            raise InputError(
                f"there is no program '{program}' to run: install it, or give its path with --command '{program} ...'."
            )

    def run(self, folder: Path, deck: str, timeout: float | None = None) -> Outcome:
        """Run a deck in its folder.

        Parameters
        ----------
        folder : Path
            Holds the deck.
        deck : str
            Name of its file.
        timeout : float, optional
            Seconds after which it is stopped.
        """
        job = Path(deck).stem
        environment = {**os.environ, "OMP_NUM_THREADS": os.environ.get("OMP_NUM_THREADS", "1")}
        with (folder / LOG).open("wb") as log:
            try:
                process = subprocess.Popen(  # noqa: S603  (the user's command, without a shell)
                    [*_tied(), *self.words(job, deck)],
                    cwd=folder,
                    stdin=subprocess.DEVNULL,
                    stdout=log,
                    stderr=subprocess.STDOUT,
                    env=environment,
                    start_new_session=True,
                )
            except OSError as error:
                return Outcome(f"the command could not be started: {error.strerror or error}")
            try:
                status = process.wait(timeout)
                problem = ""
            except subprocess.TimeoutExpired:
                status, problem = None, f"stopped after {timeout:g} s"
            finally:
                _end(process)
        said = (folder / LOG).read_text(encoding="utf-8", errors="replace")
        problem = problem or self.problem(folder, job, status or 0, said)
        lines = [line.rstrip() for line in said.splitlines() if line.strip()]
        return Outcome(problem, tuple(lines[-LAST_LINES:]) if problem else ())

    def problem(self, folder: Path, job: str, status: int, said: str) -> str:
        """Return why a run that ended is a failure, in words, or nothing."""
        return f"it ended with status {status}" if status else ""

    def last_time(self, folder: Path, job: str) -> float:
        """Return the time up to which the results of a run are converged."""
        return float("inf")


class CalculiXSolver(Solver):
    """CalculiX (ccx): it has ended well when it says so; its status is zero in some failures, too."""

    name = "ccx"
    template = "ccx -i {job}"
    deck_format = "abaqus"
    card_format = "calculix"

    def problem(self, folder: Path, job: str, status: int, said: str) -> str:
        if "Job finished" in said and not status:
            return ""
        errors = re.findall(r"\*ERROR[:\s]*(.+(?:\n {6,}[^\s*].*)*)", said)  # with the lines in which it goes on
        return " ".join(errors[-1].split()) if errors else f"it ended with status {status} and did not finish"

    def last_time(self, folder: Path, job: str) -> float:
        """Return the last total time in the .sta file: CalculiX writes the increment that failed into the .frd, too.

        A row of an attempt that failed has the time that was reached before.
        """
        status = folder / f"{job}.sta"
        if not status.is_file():
            return float("inf")
        rows = [line.split() for line in status.read_text(encoding="utf-8", errors="replace").splitlines()]
        ended = [row for row in rows if len(row) == 7 and row[0].isdigit()]
        return float(ended[-1][4]) if ended else 0.0


class FEBioSolver(Solver):
    """FEBio 4: it ends with the words NORMAL TERMINATION, spaced out."""

    name = "febio4"
    template = "febio4 -i {deck}"
    deck_format = "febio"
    card_format = "febio"

    def problem(self, folder: Path, job: str, status: int, said: str) -> str:
        if "NORMALTERMINATION" in said.replace(" ", "") and not status:
            return ""
        return f"it ended with status {status} and without a normal termination"


class CommandSolver(Solver):
    """Any other program, by its command line: it has ended well when its status is zero."""

    name = "command"
    template = ""
    deck_format = ""
    card_format = ""


def solver_for(deck_format: str, name: str | None, command: str = "") -> Solver:
    """Return the solver of that name, or, unless given, the one for a format of decks; with another command if given.

    Raises
    ------
    InputError
        When there is none, its command is missing or not understood, or it does not read such decks.
    """
    if name is None:
        fitting = [kind.name for kind in variants(Solver).values() if kind.deck_format == deck_format]
        name = fitting[0] if fitting and not command else CommandSolver.name
    solver = find(Solver, "solver", name, InputError)(command)
    if solver.deck_format not in ("", deck_format):
        raise InputError(f"the solver '{name}' reads decks of the format {solver.deck_format}, not {deck_format}.")
    return solver


def _end(process: subprocess.Popen[bytes]) -> None:
    """End what is left of a process and of those that it started."""
    if hasattr(os, "killpg"):
        try:
            os.killpg(process.pid, signal.SIGKILL)
        except (ProcessLookupError, PermissionError):
            return
    elif process.poll() is None:
        process.kill()
    process.wait()


def _tied() -> list[str]:
    """Return the words before a command that end its program with this process, however that ends, where Linux can."""
    setpriv = shutil.which("setpriv") if sys.platform.startswith("linux") else None
    return [setpriv, "--pdeathsig", "KILL", "--"] if setpriv else []
