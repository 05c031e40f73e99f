"""The options that say how a file of measurements is read, shared by the commands that read one."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from functools import wraps
from pathlib import Path
from typing import Annotated, Any

import typer

from tissuq.cli.options import once_each
from tissuq.errors import InputError

__all__ = ["Mode", "reads_files", "resolve"]

Mode = Annotated[str | None, typer.Option(help="Loading mode [uniaxial].")]
OPTIONS: dict[str, Any] = {
    "column": Annotated[
        list[str] | None,
        typer.Option(
            help="ROLE=COLUMN for stretch, strain or displacement, and stress or force, such as stretch=Strain; "
            "repeat. Of a second axis or stress: stretch2 ... force2."
        ),
    ],
    "stress_unit": Annotated[
        str | None,
        typer.Option(help="Unit of the stress column [the file's, or MPa]; for forces, the unit shown [kPa]."),
    ],
    "stress_type": Annotated[str | None, typer.Option(help="engineering or cauchy [engineering].")],
    "strain_unit": Annotated[str | None, typer.Option(help="Unit of a strain column: 1 or percent.")],
    "force_unit": Annotated[str | None, typer.Option(help="Unit of a force column that states none, such as mN.")],
    "displacement_unit": Annotated[str | None, typer.Option(help="Unit of a displacement column that states none.")],
    "length": Annotated[
        str | None, typer.Option(help="Undeformed length, such as '20 mm' [the file's]; in mode biaxial that along x.")
    ],
    "area": Annotated[str | None, typer.Option(help="Undeformed cross-section, such as '10 mm2' [the file's].")],
    "width": Annotated[
        str | None, typer.Option(help="With --thickness, instead of --area; in mode biaxial the size along y.")
    ],
    "thickness": Annotated[str | None, typer.Option(help="With --width, instead of --area.")],
    "diameter": Annotated[str | None, typer.Option(help="Of a round specimen, instead of --area.")],
    "compression_positive": Annotated[
        bool | None, typer.Option("--compression-positive", help="The file counts compression as positive.")
    ],
    "cycle": Annotated[str | None, typer.Option(help="Use only this cycle: first, last or its number [all].")],
    "branch": Annotated[str | None, typer.Option(help="Use only loading or unloading [both].")],
    "preload": Annotated[
        str | None, typer.Option(help="Force or stress at which the specimen is taut ('0.05 N'): stretch 1 is there.")
    ],
    "every": Annotated[int | None, typer.Option(help="Use only every N-th row [1].")],
    "axis": Annotated[str | None, typer.Option(help="x or y: the only axis to read from a biaxial machine's file.")],
    "sheet": Annotated[str | None, typer.Option(help="Sheet of an Excel workbook, by name or number.")],
    "skip_rows": Annotated[int | None, typer.Option(help="Lines to skip at the top of the file.")],
}
"""The options, in the order of the help, by the names of the settings that they are."""
DIMENSIONS = ("length", "area", "width", "thickness", "diameter")


def reads_files(command: Callable[..., None], names: Mapping[str, str] | None = None) -> Callable[..., None]:
    """Give a command the options that say how files are read, in place of its parameter ``read_as``.

    That gets them as the settings of a file's reading. ``names`` are those of options that the command itself has
    another use for.
    """
    names = {name: name for name in OPTIONS} | dict(names or {})
    signature = inspect.signature(command, eval_str=True)
    place = list(signature.parameters).index("read_as")
    own = list(signature.parameters.values())
    options = [
        inspect.Parameter(names[name], inspect.Parameter.KEYWORD_ONLY, default=None, annotation=option)
        for name, option in OPTIONS.items()
    ]

    @wraps(command)
    def reading(**arguments: Any) -> None:
        given = {name: arguments.pop(names[name]) for name in OPTIONS}
        command(**arguments, read_as=_settings(given))

    reading.__signature__ = signature.replace(  # type: ignore[attr-defined]  # what Typer reads
        parameters=[*own[:place], *options, *own[place + 1 :]]
    )
    return reading


def _settings(given: dict[str, Any]) -> dict[str, Any]:
    """Return the settings of a file's reading for the options' values by name."""
    dimensions = {name: given.pop(name) for name in DIMENSIONS}
    columns = once_each("--column", map(_role, given.pop("column") or []))
    known = {name: value for name, value in dimensions.items() if value}
    return given | {"dimensions": known or None, "columns": columns or None}


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
