"""Run folders: complete or not there at all, and never overwritten unasked."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import mkdtemp

from tissuq.errors import InputError

__all__ = ["RECIPE", "check_target", "run_folder"]

RECIPE = "run.toml"
"""The file that says how a run is repeated; a folder without it is not a run."""


def check_target(target: Path, *, force: bool) -> None:
    """Refuse a run folder that must not be written.

    Raises
    ------
    InputError
        When the folder exists and ``force`` is not set, or when it holds something other than a run.
    """
    if not target.exists():
        return
    if not target.is_dir():
        raise InputError(f"'{target}' is a file; choose another folder for the run with --out.")
    if any(target.iterdir()):
        if not (target / RECIPE).exists():
            raise InputError(f"folder '{target}' holds files that are not a run; choose another with --out.")
        if not force:
            raise InputError(f"run folder '{target}' exists; choose another with --out, or replace it with --force.")


@contextmanager
def run_folder(target: Path, *, force: bool = False) -> Iterator[Path]:
    """Give a folder to write a run into; it becomes ``target`` when all is written, and vanishes on any error.

    Raises
    ------
    InputError
        When the target must not be overwritten, or the disk refuses to be written.
    """
    target = Path(target)
    check_target(target, force=force)
    scratch: Path | None = None
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        scratch = Path(mkdtemp(prefix=f".{target.name}-", dir=target.parent))
        scratch.chmod(0o755)
        yield scratch
        if target.exists():
            shutil.rmtree(target)
        scratch.rename(target)
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(
            f"the run could not be written to '{target}': {reason}. Check the folder's permissions and the space "
            "on the disk, or choose another folder with --out."
        ) from error
    finally:
        if scratch is not None and scratch.exists():
            shutil.rmtree(scratch, ignore_errors=True)
