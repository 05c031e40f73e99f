"""One draw in the user's model: a folder with its deck, the solver's run there, and what is read from it."""

from __future__ import annotations

import json
import os
import shlex
import shutil
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path, PurePosixPath
from tempfile import mkdtemp
from time import perf_counter
from typing import Any

import numpy as np

from tissuq.decks.calculix_results import CalculiXResults
from tissuq.decks.deck import Deck
from tissuq.decks.fields import final_fields, share_beyond
from tissuq.decks.quantity import Component, Quantity
from tissuq.decks.result_file import ALL, Results, unknown_set
from tissuq.decks.solver import LOG, CalculiXSolver, Solver
from tissuq.errors import InputError

DONE = "run.json"
"""What is known of a run of the solver that has ended, in its folder."""
FIELDS = "fields.npz"
SCRATCH = ".running-"
"""What names of folders begin with in which a solver is at work."""


@dataclass(frozen=True)
class SolverRun:
    """How the solver is run, on which no number depends.

    Attributes
    ----------
    timeout : float, optional
        Seconds after which it is stopped.
    retries : int
        Times that a run which failed is made again.
    keep : bool
        Keep its files.
    abaqus : str
        The program that opens .odb files; unless given, the first word of the solver's command.
    """

    timeout: float | None = None
    retries: int = 0
    keep: bool = True
    abaqus: str = ""


USUALLY = SolverRun()
"""How it is run unless anything else is said."""


@dataclass(frozen=True)
class ModelRun:
    """A draw of each material in the user's model.

    Attributes
    ----------
    family : str
        Which kind of draws it belongs to.
    number : int
        From zero.
    model : Path
        The folder with the files of the model.
    main, deck_format : str
        The deck's file, relative to that folder, and its format.
    blocks : tuple of (str, str)
        The materials, and the blocks of cards that replace them.
    solver : Solver
    quantities : tuple of Quantity
    limits : tuple of (str, (float, float))
        The largest I1 - 3 and I2 - 3 that were measured, by materials in capitals.
    folder : Path
        Where the run is left.
    running : SolverRun
    mesh : str
        A digest of the files of the model, where it is another than that of the other runs.
    """

    family: str
    number: int
    model: Path
    main: str
    deck_format: str
    blocks: tuple[tuple[str, str], ...]
    solver: Solver
    quantities: tuple[Quantity, ...]
    limits: tuple[tuple[str, tuple[float, float]], ...]
    folder: Path
    running: SolverRun = USUALLY
    mesh: str = ""

    @property
    def solver_key(self) -> str:
        """A digest of all that the solver's run depends on."""
        inputs = (self.main, self.blocks, self.solver.name, self.solver.words("job", "deck"))
        return _digest(*inputs, *([self.mesh] if self.mesh else []))

    @property
    def key(self) -> str:
        """A digest that identifies the task, whose result depends on the quantities, too."""
        return _digest(self.solver_key, [(quantity.name, quantity.identity) for quantity in self.quantities])

    @property
    def label(self) -> str:
        """The text shown when the task is done."""
        return f"draw {self.number + 1}{' on the finer mesh' if self.mesh else ''}"

    @property
    def deck(self) -> Deck:
        """The deck as it is in the folder of the model."""
        return Deck.read(self.model / self.main, self.deck_format)


def carried_out(task: ModelRun) -> dict[str, Any]:
    """Run the solver for a task, unless that is done, and return what it gave, plain data.

    The folder of the run stands when the solver has ended, and not before: what is killed leaves nothing that could be
    taken for a result.
    """
    stored = _stored(task)
    if stored is None:
        stored = _solved(task)
    deck = task.deck
    job_folder = task.folder / PurePosixPath(task.main).parent
    sets = sets_of(deck, task.quantities)
    components = tuple(
        (quantity.kind, quantity.set_name) for quantity in task.quantities if isinstance(quantity, Component)
    )
    program = task.running.abaqus or shlex.quote(task.solver.words(deck.job, deck.main)[0])
    is_ring = any(kind == "RF" for kind, _ in components) and deck.format.is_axisymmetric(list(deck.files.values()))
    results = Results(job_folder, deck.job, stored["last_time"] or np.inf, sets, components, program, is_ring)
    curves, misread = _curves(task, results)
    elements_beyond = None
    if not misread and not stored["problem"]:
        misread, elements_beyond = _saved_fields(task, results)
    if not task.running.keep:
        _strip(task.folder)
    return {**stored, "curves": curves, "misread": misread, "beyond": elements_beyond, "folder": task.folder.name}


def clear_unfinished(folder: Path) -> None:
    """Delete what runs of a process that was killed have left in the folder of all runs."""
    for unfinished in folder.glob(f"{SCRATCH}*"):
        shutil.rmtree(unfinished, ignore_errors=True)


def problem_of(folder: Path) -> str:
    """Return why the run of the solver in a folder did not end well; empty where it did, or there is none."""
    try:
        return str(json.loads((folder / DONE).read_text(encoding="utf-8"))["problem"])
    except OSError:
        return ""


def run_again(folder: Path) -> None:
    """Mark the run in a folder as one that is to be made again when it is next asked for; its files stay."""
    stored: Mapping[str, Any] = json.loads((folder / DONE).read_text(encoding="utf-8"))
    (folder / DONE).write_text(json.dumps({**stored, "is_whole": False}), encoding="utf-8")


def sets_of(deck: Deck, quantities: Iterable[Quantity]) -> dict[str, set[int]]:
    """Return the sets of nodes of a deck where a quantity is that of a set.

    Raises
    ------
    InputError
        When they are not understood.
    """
    is_needed = any(isinstance(quantity, Component) for quantity in quantities)
    return deck.format.node_sets(list(deck.files.values())) if is_needed else {}


def check_sets(deck: Deck, quantities: Iterable[Quantity], solver: Solver | None = None) -> None:
    """Refuse a quantity of a set that the deck does not have, where all are known, or that the solver does not write.

    Raises
    ------
    InputError
        When there is one.
    """
    for quantity in quantities if not deck.outside else ():
        if isinstance(quantity, Component) and quantity.set_name != ALL:
            of_elements = quantity.kind in ("S", "E")
            set_names = deck.format.set_names(list(deck.files.values()), of_elements=of_elements)
            if (
                set_names and quantity.set_name.rpartition(".")[2] not in set_names
            ):  # those of instances are PART-1-1.TOP
                raise InputError(f"{quantity.text}: {unknown_set(quantity.set_name, set_names)}")
            if set_names and of_elements and isinstance(solver, CalculiXSolver):
                _check_printed(deck, quantity)


def _check_printed(deck: Deck, quantity: Component) -> None:
    """Refuse a field in a set of elements that CalculiX is not asked to print."""
    files, set_name = list(deck.files.values()), quantity.set_name.rpartition(".")[2]
    if set_name in deck.format.set_names(files, of_elements=False):
        return
    if (quantity.kind, set_name) not in deck.format.printed_elements(files):
        raise InputError(
            f"{quantity.text}: '{set_name}' is a set of elements, of which CalculiX writes only what it is asked to "
            f"print: add '*EL PRINT, ELSET={set_name}' with {quantity.kind} to the step, or name a set of nodes."
        )


def _digest(*contents: object) -> str:
    return sha256(repr(contents).encode()).hexdigest()[:24]


def _stored(task: ModelRun) -> dict[str, Any] | None:
    """Return what is known of a run that has ended, and whose files are all there."""
    try:
        stored = json.loads((task.folder / DONE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    is_this = isinstance(stored, dict) and stored.get("solver_key") == task.solver_key
    return stored if is_this and stored.get("is_whole") else None


def _solved(task: ModelRun) -> dict[str, Any]:
    start = perf_counter()
    task.folder.parent.mkdir(parents=True, exist_ok=True)
    for attempt in range(1, task.running.retries + 2):
        scratch = Path(mkdtemp(prefix=f"{SCRATCH}{task.folder.name}-", dir=task.folder.parent))
        scratch.chmod(0o755)
        try:
            _lay_out(task, scratch)
            job_folder = scratch / PurePosixPath(task.main).parent
            outcome = task.solver.run(job_folder, PurePosixPath(task.main).name, task.running.timeout)
            if outcome.problem and attempt <= task.running.retries:
                continue
            last_time = task.solver.last_time(job_folder, PurePosixPath(task.main).stem)
            stored = {
                "solver_key": task.solver_key,
                "is_whole": True,
                "problem": outcome.problem,
                "lines": list(outcome.lines),
                "last_time": last_time if np.isfinite(last_time) else None,
                "attempts": attempt,
                "seconds": perf_counter() - start,
            }
            (scratch / DONE).write_text(json.dumps(stored), encoding="utf-8")
            shutil.rmtree(task.folder, ignore_errors=True)
            scratch.rename(task.folder)
            return stored
        finally:
            shutil.rmtree(scratch, ignore_errors=True)
    raise AssertionError("the last attempt returns")


def _lay_out(task: ModelRun, folder: Path) -> None:
    """Write the deck of a draw: changed files anew, and all others as links to those of the model."""
    changed = task.deck.with_materials(dict(task.blocks))
    for source in sorted(task.model.rglob("*")):
        name = source.relative_to(task.model)
        if source.is_dir():
            continue
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        if name.as_posix() in changed:
            (folder / name).write_bytes(changed[name.as_posix()])
            continue
        try:
            (folder / name).symlink_to(os.path.relpath(source, (folder / name).parent))
        except OSError:
            shutil.copyfile(source, folder / name)


def _curves(task: ModelRun, results: Results) -> tuple[dict[str, Any], str]:
    """Return the quantities as plain data, and why one of a run that ended well could not be read."""
    curves, misread = {}, ""
    for quantity in task.quantities:
        try:
            curve = quantity.read(results)
        except InputError as error:
            misread = misread or str(error)
            continue
        curves[quantity.name] = [curve.times.tolist(), curve.values.tolist()]
    return curves, misread


def _saved_fields(task: ModelRun, results: Results) -> tuple[str, Any]:
    """Write the fields of a run that ended well; return why it cannot, and the share of elements beyond the data."""
    try:
        frd = results.file.frd if isinstance(results.file, CalculiXResults) else None
    except InputError as error:
        return str(error), None
    fields = final_fields(frd) if frd is not None else None
    if frd is None or fields is None:
        return "", None
    fields.save(task.folder / FIELDS)
    share = share_beyond(frd, dict(task.limits))
    return "", None if share is None else [share.times.tolist(), share.values.tolist()]


def _strip(folder: Path) -> None:
    """Take off a run's folder what the solver left there."""
    run_again(folder)
    for path in sorted(folder.rglob("*"), reverse=True):
        if path.is_dir() and not path.is_symlink():
            if not any(path.iterdir()):
                path.rmdir()
        elif path.name not in (DONE, FIELDS, LOG):
            path.unlink()
