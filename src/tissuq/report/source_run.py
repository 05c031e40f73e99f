"""Copies of the files of a run that a posterior comes from, in the folder of what was computed with it."""

from __future__ import annotations

import filecmp
import shutil
from pathlib import Path

from tissuq.errors import InputError
from tissuq.finite_elements.body_from_file import BodyFromFile
from tissuq.finite_elements.case import Case
from tissuq.report.answer_of_run import said_by
from tissuq.report.result import RESULT
from tissuq.report.run_folder import INPUT, RECIPE
from tissuq.studies.earlier_run import POSTERIORS

__all__ = ["SOURCE", "check_mesh", "check_source", "copy_mesh", "copy_source", "stored_mesh"]

SOURCE = "source"
"""The folder with the copies."""


def check_source(run: Path, folder: Path) -> None:
    """Refuse a folder that holds a simulation with another run, and a run whose result is damaged.

    Raises
    ------
    InputError
        When it does, or is.
    """
    said_by(run)
    stored = folder / SOURCE
    if stored.is_dir() and not all(
        (run / name).is_file() and (stored / name).is_file() and filecmp.cmp(run / name, stored / name, False)
        for name in _files(run)
    ):
        raise InputError(f"'{folder}' holds a simulation of another run; choose another folder with --out.")


def _files(run: Path) -> list[Path]:
    """Return the files of a run, relative to it, from which a simulation starts: its recipe and its posteriors."""
    return [Path(RECIPE), *(file.relative_to(run) for file in sorted((run / POSTERIORS).glob("*.nc")))]


def copy_source(run: Path, folder: Path) -> None:
    """Copy the files of a run into the folder of a simulation, so that it can be repeated."""
    stored = folder / SOURCE
    if not stored.is_dir():
        scratch = folder / f"{SOURCE}.new"
        shutil.copytree(run / INPUT, scratch / INPUT, dirs_exist_ok=True)
        names = _files(run) + [Path(RESULT)] * (run / RESULT).is_file()
        for name in names:
            (scratch / name).parent.mkdir(exist_ok=True)
            shutil.copyfile(run / name, scratch / name)
        scratch.rename(stored)


def stored_mesh(mesh: str | None, name: str = "mesh") -> str | None:
    """Return where the folder of a simulation holds the mesh that it is of, if there is one."""
    return None if mesh is None else f"{name}{Path(mesh).suffix}"


def check_mesh(case: Case, folder: Path) -> None:
    """Refuse a folder that holds a simulation of another mesh.

    Raises
    ------
    InputError
        When it does.
    """
    if isinstance(case, BodyFromFile):
        stored = folder / f"mesh{Path(case.file).suffix}"
        if stored.is_file() and stored.read_bytes() != case.content():
            raise InputError(f"'{folder}' holds a simulation of another mesh; choose another folder with --out.")


def copy_mesh(case: Case | None, folder: Path, name: str = "mesh") -> None:
    """Copy the mesh that a case is of, if it is of one, into the folder of a simulation."""
    if isinstance(case, BodyFromFile):
        (folder / f"{name}{Path(case.file).suffix}").write_bytes(case.content())
