"""``tissuq show``: what an earlier run says, and its page as a PDF, printed by Chromium."""

from __future__ import annotations

import json
from pathlib import Path

from tissuq.cli.call import Call
from tissuq.cli.command import command
from tissuq.cli.running import Verbosity
from tissuq.errors import InputError
from tissuq.studies.option import Settings, argument, option

__all__ = ["show", "write_pdf"]

LONGEST = 120
"""Seconds that the browser may take to print a page."""


class ShownRun(Settings):
    """What is shown."""

    run_folder: Path = argument(..., "Folder of a run.")


class ShowOptions(Verbosity):
    """How it is shown."""

    details: bool = option(False, "Also stability, what the discrepancy does, and all warnings.")
    as_json: bool = option(False, "Everything as one JSON object, for programs.", name="json")
    pdf: Path | None = option(None, "Print the report into this file instead, with Chromium.")


@command(ShownRun, ShowOptions)
def show(call: Call[ShownRun, ShowOptions]) -> None:
    """Print the answer of a run and where its report lies."""
    from tissuq.report.terminal import print_result
    from tissuq.report.writer import contents_for_programs, read_record

    folder = call.settings.run_folder
    if call.how.pdf is not None:
        with call.monitor.steps() as step:
            step("printing")
            write_pdf(folder / "report.html", call.how.pdf)
        print(call.how.pdf)
    elif call.how.as_json:
        print(json.dumps(contents_for_programs(folder), indent=2), file=call.out)
    else:
        with call.monitor.steps() as step:
            step("reading")
            record = read_record(folder)
        print_result(record, folder, details=call.how.details)
        call.answer(record["numbers"])


def write_pdf(page: Path, file: Path) -> None:
    """Print a page into a file.

    Raises
    ------
    InputError
        When there is no page or no Chromium, or it prints nothing.
    """
    import os
    import subprocess
    from tempfile import TemporaryDirectory

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
