"""``tissuq inspect``: what would be understood of a file, before anything is fitted."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from tissuq.cli import reading
from tissuq.studies.settings import load_settings

__all__ = ["inspect"]


@reading.reads_files
def inspect(
    file: Annotated[Path, typer.Argument(help="CSV or Excel file, or the name of a built-in data set.")],
    mode: reading.Mode = None,
    *,
    read_as: dict[str, Any],
    out: Annotated[Path | None, typer.Option(help="Folder for figure, converted data and what is printed.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace the folder of an earlier inspection.")] = False,
) -> None:
    """Show what is understood of a file of measurements: columns, dimensions, cycles, rows, noise, doubts."""
    from tissuq.experiments.inspection import inspect as inspect_file
    from tissuq.report.run_folder import check_target, run_folder
    from tissuq.studies.measured_file import MeasuredFile

    if out is not None:
        check_target(out, force=force)
    source = reading.resolve(file)
    settings = load_settings(MeasuredFile, None, read_as | {"mode": mode, "file": str(source)})
    inspection = inspect_file(source, **settings.reading_options)
    print(inspection)
    if out is not None:
        from tissuq.report.inspection import write_inspection

        with run_folder(out, force=force) as folder:
            write_inspection(inspection, folder)
        print(f"\nFigure: {out / 'figures' / 'curve.png'}")
