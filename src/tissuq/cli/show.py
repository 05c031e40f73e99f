"""``tissuq show``: what an earlier run says."""

from __future__ import annotations

import json
from pathlib import Path

from tissuq.cli.call import Call
from tissuq.cli.command import command
from tissuq.cli.running import Verbosity
from tissuq.studies.option import Settings, argument, option

__all__ = ["show"]


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
    from tissuq.cli.pdf import write_pdf
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
