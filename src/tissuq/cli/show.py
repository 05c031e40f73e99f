"""``tissuq show``: what an earlier run says."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

__all__ = ["show"]


def show(
    run_folder: Annotated[Path, typer.Argument(help="Folder of a run.")],
    details: Annotated[
        bool, typer.Option("--details", help="Also stability, what the discrepancy does, and all warnings.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Everything as one JSON object, for programs.")] = False,
) -> None:
    """Print the answer of a run and where its report lies."""
    from tissuq.cli.tables import print_json, print_summary
    from tissuq.report.terminal import print_result
    from tissuq.report.writer import read_record

    if as_json:
        print_json(run_folder)
    elif record := read_record(run_folder):
        print_result(record, run_folder, details=details)
    else:
        print_summary(run_folder, details=details)
