"""``tissuq inspect``: what would be understood of a file, before anything is fitted."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tissuq.cli import reading
from tissuq.cli.options import load_settings

__all__ = ["inspect"]


def inspect(
    file: Annotated[Path, typer.Argument(help="CSV or Excel file, or the name of a built-in data set.")],
    mode: reading.Mode = None,
    column: reading.Column = None,
    stress_unit: reading.StressUnit = None,
    stress_type: reading.StressType = None,
    strain_unit: reading.StrainUnit = None,
    force_unit: reading.ForceUnit = None,
    displacement_unit: reading.DisplacementUnit = None,
    length: reading.Length = None,
    area: reading.Area = None,
    width: reading.Width = None,
    thickness: reading.Thickness = None,
    diameter: reading.Diameter = None,
    compression_positive: reading.CompressionPositive = None,
    cycle: reading.Cycle = None,
    branch: reading.Branch = None,
    preload: reading.Preload = None,
    every: reading.Every = None,
    axis: reading.Axis = None,
    sheet: reading.Sheet = None,
    skip_rows: reading.SkipRows = None,
    out: Annotated[Path | None, typer.Option(help="Folder for figure, converted data and what is printed.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace the folder of an earlier inspection.")] = False,
) -> None:
    """Show what is understood of a file of measurements: columns, dimensions, cycles, rows, noise, doubts."""
    given = reading.reading_options(locals())
    from tissuq.experiments.inspection import inspect as inspect_file
    from tissuq.report.run_folder import check_target, run_folder
    from tissuq.studies.measured_file import MeasuredFile

    if out is not None:
        check_target(out, force=force)
    source = reading.resolve(file)
    settings = load_settings(MeasuredFile, None, given | {"mode": mode, "file": str(source)})
    inspection = inspect_file(source, **settings.reading_options)
    print(inspection)
    if out is not None:
        from tissuq.report.inspection import write_inspection

        with run_folder(out, force=force) as folder:
            write_inspection(inspection, folder)
        print(f"\nFigure: {out / 'figures' / 'curve.png'}")
