"""The options that say how a file of measurements is read, shared by the commands that read one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from tissuq.cli.options import once_each
from tissuq.errors import InputError

__all__ = [
    "Area",
    "Axis",
    "Branch",
    "Column",
    "CompressionPositive",
    "Cycle",
    "Diameter",
    "DisplacementUnit",
    "Every",
    "ForceUnit",
    "Length",
    "Mode",
    "Preload",
    "Sheet",
    "SkipRows",
    "StrainUnit",
    "StressType",
    "StressUnit",
    "Thickness",
    "Width",
    "reading_options",
    "resolve",
]

Mode = Annotated[str | None, typer.Option(help="Loading mode [uniaxial].")]
Column = Annotated[
    list[str] | None,
    typer.Option(
        help="ROLE=COLUMN for stretch, strain or displacement, and stress or force, such as stretch=Strain; repeat. "
        "Of a second axis or stress: stretch2 ... force2."
    ),
]
StressUnit = Annotated[
    str | None, typer.Option(help="Unit of the stress column [the file's, or MPa]; for forces, the unit shown [kPa].")
]
StressType = Annotated[str | None, typer.Option(help="engineering or cauchy [engineering].")]
StrainUnit = Annotated[str | None, typer.Option(help="Unit of a strain column: 1 or percent.")]
ForceUnit = Annotated[str | None, typer.Option(help="Unit of a force column that states none, such as mN.")]
DisplacementUnit = Annotated[str | None, typer.Option(help="Unit of a displacement column that states none.")]
Length = Annotated[
    str | None, typer.Option(help="Undeformed length, such as '20 mm' [the file's]; in mode biaxial that along x.")
]
Area = Annotated[str | None, typer.Option(help="Undeformed cross-section, such as '10 mm2' [the file's].")]
Width = Annotated[
    str | None, typer.Option(help="With --thickness, instead of --area; in mode biaxial the size along y.")
]
Thickness = Annotated[str | None, typer.Option(help="With --width, instead of --area.")]
Diameter = Annotated[str | None, typer.Option(help="Of a round specimen, instead of --area.")]
CompressionPositive = Annotated[
    bool | None, typer.Option("--compression-positive", help="The file counts compression as positive.")
]
Cycle = Annotated[str | None, typer.Option(help="Use only this cycle: first, last or its number [all].")]
Branch = Annotated[str | None, typer.Option(help="Use only loading or unloading [both].")]
Preload = Annotated[
    str | None, typer.Option(help="Force or stress at which the specimen is taut ('0.05 N'): stretch 1 is there.")
]
Every = Annotated[int | None, typer.Option(help="Use only every N-th row [1].")]
Axis = Annotated[str | None, typer.Option(help="x or y: the only axis to read from a biaxial machine's file.")]
Sheet = Annotated[str | None, typer.Option(help="Sheet of an Excel workbook, by name or number.")]
SkipRows = Annotated[int | None, typer.Option(help="Lines to skip at the top of the file.")]


def reading_options(given: dict[str, Any]) -> dict[str, Any]:
    """Return the settings of a file's reading from a command's arguments by name."""
    names = ["stress_unit", "stress_type", "strain_unit", "force_unit", "displacement_unit", "cycle"]
    names += ["compression_positive", "branch", "preload", "every", "axis", "sheet", "skip_rows"]
    options = {name: given[name] for name in names}
    dimensions = {name: given[name] for name in ("length", "area", "width", "thickness", "diameter") if given[name]}
    columns = once_each("--column", map(_role, given["column"] or []))
    return options | {"dimensions": dimensions or None, "columns": columns or None}


def resolve(file: Path) -> Path:
    """Return the user's file, or the built-in data set of that name, which must be one that can be fitted."""
    from tissuq.experiments import datasets

    if file.exists() or str(file) not in datasets.names():
        return file
    datasets.load(str(file))
    return datasets.path(str(file))


def _role(text: str) -> tuple[str, str | int]:
    role, _, name = text.partition("=")
    if not name:
        raise InputError(f"--column needs ROLE=COLUMN, such as stress='Stress (kPa)', not '{text}'.")
    return role.strip(), int(name) if name.strip().isdecimal() else name.strip()
