"""The page of a run as a PDF, printed by Chromium."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

from tissuq.errors import InputError

__all__ = ["write_pdf"]

LONGEST = 120
"""Seconds that the browser may take."""


def write_pdf(page: Path, file: Path) -> None:
    """Print a page into a file.

    Raises
    ------
    InputError
        When there is no page or no Chromium, or it prints nothing.
    """
    from tissuq.studies.installation import programs

    if not page.exists():
        raise InputError(f"there is no page '{page}' to print: give the folder of a complete run.")
    chromium = next(program.path for program in programs() if program.name == "Chromium")
    if chromium is None:
        raise InputError(
            "a PDF is printed by Chromium or Chrome, and neither is on the PATH (tissuq doctor shows what is). Install "
            f"one, or open '{page}' in a browser and print it."
        )
    if not file.absolute().parent.is_dir():
        raise InputError(f"'{file}' cannot be written: there is no folder '{file.parent}'.")
    with TemporaryDirectory() as scratch:
        printed = Path(scratch) / "page.pdf"
        words = [
            chromium,
            "--headless",
            "--disable-gpu",
            "--no-pdf-header-footer",
            f"--user-data-dir={scratch}/profile",
        ]
        words += ["--no-sandbox"] * (hasattr(os, "geteuid") and os.geteuid() == 0)  # which it has for no root
        words += [f"--print-to-pdf={printed}", page.absolute().as_uri()]
        try:
            done = subprocess.run(words, capture_output=True, text=True, timeout=LONGEST, check=False)  # noqa: S603
        except subprocess.TimeoutExpired as error:
            raise InputError(f"'{chromium}' printed nothing within {LONGEST} s; print '{page}' yourself.") from error
        if done.returncode or not printed.exists():
            last = done.stderr.strip().splitlines()[-1:] or ["it says nothing"]
            raise InputError(f"'{chromium}' could not print '{page}': {last[0]}")
        file.write_bytes(printed.read_bytes())
