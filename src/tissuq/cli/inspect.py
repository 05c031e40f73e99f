"""``tissuq inspect``: what is understood of files of measurements, before anything is fitted."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tissuq.cli.ask import ask_about
from tissuq.cli.options import Force
from tissuq.cli.reading import Mode, files_of, find_tests, reads_files
from tissuq.errors import InputError

if TYPE_CHECKING:
    from tissuq.experiments.reading.experiment_file import Reading

__all__ = ["inspect"]


@reads_files
def inspect(
    file: Annotated[
        list[Path],
        typer.Argument(help="CSV, Excel or other files, folders of them, FILE#NAME for one test in a file, data sets."),
    ],
    mode: Mode = None,
    *,
    read_as: dict[str, Any],
    write: Annotated[
        Path | None, typer.Option(help="Write what was understood into this TOML file, to edit and to fit.")
    ] = None,
    ask: Annotated[
        bool, typer.Option("--ask", help="Ask where files leave a choice, and write what was understood [study.toml].")
    ] = False,
    out: Annotated[Path | None, typer.Option(help="Folder for figure, converted data and what is printed.")] = None,
    force: Force = False,
) -> None:
    """Show what is understood of files of measurements: tests, columns, dimensions, cycles, rows, noise, warnings."""
    from tissuq.experiments.reading.inspection import Inspection, overview
    from tissuq.report.run_folder import check_target, run_folder
    from tissuq.studies.study_file import study_file

    if out is not None:
        check_target(out, force=force)
    if ask and write is None:
        write = Path("study.toml")
    if write is not None and write.exists() and not force:
        raise InputError(f"'{write}' exists. Give another name, or --force to replace it.")
    files = files_of(file)
    tests: list[tuple[dict[str, Any], Reading]] = []
    settings = read_as | {"mode": mode}
    for path in files:
        if ask:
            found, settings = ask_about(path, settings, is_only_file=len(files) == 1)
        else:
            found = find_tests(path, settings, is_only_file=len(files) == 1)
        tests += found
    inspections = [Inspection.of(reading) for _, reading in tests]
    print(inspections[0] if len(tests) == 1 else overview(inspections))
    if write is not None:
        write.write_text(study_file([of_test for of_test, _ in tests], inspections, write.parent), encoding="utf-8")
        print(f"\nWritten: {write}. Look through it, then: tissuq fit {write}")
    if out is not None:
        from tissuq.report.specimen import write_inspection

        with run_folder(out, force=force) as folder:
            write_inspection(inspections, folder)
        print(f"\nFigures: {out / 'figures'}" if len(tests) > 1 else f"\nFigure: {out / 'figures' / 'curve.png'}")
