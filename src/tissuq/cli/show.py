"""``tissuq show``: the summary of an earlier run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

__all__ = ["show"]


def show(run_folder: Annotated[Path, typer.Argument(help="Folder of a run.")]) -> None:
    """Print the summary of a run and where its report lies."""
    from tissuq.cli.tables import print_summary

    print_summary(run_folder)
