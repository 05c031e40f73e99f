"""Run folders: complete or not there at all, and never overwritten unasked."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import mkdtemp

from tissuq.errors import InputError
from tissuq.studies.settings import RECIPE

__all__ = ["ASSESSMENT", "CONTENTS", "HELD_OUT_TESTS", "INPUT", "RECIPE", "check_apart", "check_target", "run_folder"]

INPUT = "input"
"""The folder of a run that holds copies of the user's files, so that the run can be repeated."""

ASSESSMENT = "assessment.json"
"""The file that says what each discrepancy does."""

HELD_OUT_TESTS = "held_out.json"
"""The file that says how each of several tests is predicted from the others."""

CONTENTS = "contents.txt"
"""The list of a run's own files; a folder without it is not a run, and files that it does not list are foreign."""


def check_target(target: Path, *, force: bool) -> None:
    """Refuse a run folder that must not be written.

    Raises
    ------
    InputError
        When the folder exists and ``force`` is not set, when it holds something other than a run, or when it cannot
        be made.
    """
    try:
        _check(target, force)
    except OSError as error:
        raise _not_written(target, error) from error


def check_apart(target: Path, run: Path) -> None:
    """Refuse to write what is made of a run into its own folder, or over it.

    Raises
    ------
    InputError
        When the folder holds the run, is the run, or lies in it.
    """
    place, source = Path(os.path.realpath(target)), Path(os.path.realpath(run))
    if source.is_relative_to(place):
        raise InputError(f"'{target}' is the run itself, or holds it; choose another folder with --out.")
    if place.is_relative_to(source):
        raise InputError(f"'{target}' lies in the run '{run}'; choose a folder outside of it with --out.")


@contextmanager
def run_folder(target: Path, *, force: bool = False) -> Iterator[Path]:
    """Give a folder to write a run into; it becomes ``target`` when all is written, and vanishes on any error.

    Raises
    ------
    InputError
        When the target must not be overwritten, or the disk refuses to be written.
    """
    check_target(target, force=force)
    place = Path(os.path.realpath(target))
    missing = [folder for folder in place.parents if not folder.exists()]
    scratch: Path | None = None
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        scratch = Path(mkdtemp(prefix=f".{place.name}-", dir=place.parent))
        scratch.chmod(0o755)
        yield scratch
        (scratch / CONTENTS).write_text("".join(f"{name}\n" for name in _files(scratch)), encoding="utf-8")
        _check(target, force)
        _put(scratch, place)
    except OSError as error:
        raise _not_written(target, error) from error
    finally:
        if scratch is not None and scratch.exists():
            shutil.rmtree(scratch, ignore_errors=True)
        for folder in missing:
            with suppress(OSError):
                folder.rmdir()


def _check(target: Path, force: bool) -> None:
    if not target.exists():
        _check_parent(target)
        return
    if not target.is_dir():
        raise InputError(f"'{target}' is a file; choose another folder for the run with --out.")
    if Path.cwd().is_relative_to(target.resolve()):
        raise InputError(f"'{target}' is the folder you are in; give the run a folder of its own with --out.")
    if not any(target.iterdir()):
        return
    listing = target / CONTENTS
    if not listing.exists():
        raise InputError(f"folder '{target}' holds files that are not a run; choose another with --out.")
    if not force:
        raise InputError(f"run folder '{target}' exists; choose another with --out, or replace it with --force.")
    foreign = set(_files(target)) - {CONTENTS, *listing.read_text(encoding="utf-8").splitlines()}
    if foreign:
        raise InputError(
            f"run folder '{target}' also holds files that are not of the run ({', '.join(sorted(foreign)[:3])}); "
            "move them elsewhere, or choose another folder with --out."
        )


def _check_parent(target: Path) -> None:
    """Refuse, before any work is done, a folder that can be seen not to be makeable."""
    there = next(folder for folder in target.absolute().parents if folder.exists())
    if not there.is_dir():
        raise InputError(f"'{target}' cannot be made: '{there}' is a file; choose another folder with --out.")
    if not os.access(there, os.W_OK | os.X_OK):
        raise InputError(f"'{target}' cannot be made: '{there}' must not be written; choose another with --out.")


def _files(folder: Path) -> list[str]:
    """Return everything in a folder that is not itself a folder, by relative path."""
    found = (path for path in folder.rglob("*") if path.is_symlink() or not path.is_dir())
    return sorted(path.relative_to(folder).as_posix() for path in found)


def _put(scratch: Path, place: Path) -> None:
    """Rename the finished folder into place; an earlier run goes only when the new one stands."""
    if not place.exists():
        scratch.rename(place)
        return
    earlier = place.with_name(f"{scratch.name}-earlier")
    place.rename(earlier)
    try:
        scratch.rename(place)
    except OSError:
        earlier.rename(place)
        raise
    shutil.rmtree(earlier, ignore_errors=True)


def _not_written(target: Path, error: OSError) -> InputError:
    reason = error.strerror or str(error)
    return InputError(
        f"the run could not be written to '{target}': {reason}. Check the folder's permissions and the space "
        "on the disk, or choose another folder with --out."
    )
