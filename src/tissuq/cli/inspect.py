"""``tissuq inspect``: what is understood of files of measurements, before anything is fitted."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from tissuq.cli.ask import ask_about
from tissuq.cli.call import Call
from tissuq.cli.command import command
from tissuq.cli.running import IntoFolder
from tissuq.errors import InputError
from tissuq.studies.files_of_tests import files_of, find_tests
from tissuq.studies.measured_file import ReadingSettings
from tissuq.studies.option import argument, option

if TYPE_CHECKING:
    from tissuq.experiments.reading.experiment_file import Reading

__all__ = ["inspect"]


class InspectedFiles(ReadingSettings):
    """Files, and how they are read."""

    file: tuple[Path, ...] = argument(
        ...,
        "CSV, Excel or other files, folders of them, FILE#NAME for one test in a file, data sets.",
        takes=list[Path],
    )


class InspectOptions(IntoFolder):
    """What is made of what was understood."""

    write: Path | None = option(None, "Write what was understood into this TOML file, to edit and to fit.")
    ask: bool = option(False, "Ask where files leave a choice, and write what was understood [study.toml].")


@command(InspectedFiles, InspectOptions, out="Folder for figure, converted data and what is printed.")
def inspect(call: Call[InspectedFiles, InspectOptions]) -> None:
    """Show what is understood of files of measurements: tests, columns, dimensions, cycles, rows, noise, warnings."""
    from tissuq.experiments.reading.inspection import Inspection, overview
    from tissuq.report.run_folder import check_target, run_folder
    from tissuq.studies.files_of_tests import study_file

    write, ask, out, force = call.how.write, call.how.ask, call.how.out, call.how.force
    if out is not None:
        check_target(out, call.command, force=force)
    if ask and write is None:
        write = Path("study.toml")
    if write is not None and write.exists() and not force:
        raise InputError(f"'{write}' exists. Give another name, or --force to replace it.")
    settings: dict[str, Any] = dict(call.stated)
    files = files_of(settings.pop("file"))
    tests: list[tuple[dict[str, Any], Reading]] = []
    for path in files:
        if ask:
            file_tests, settings = ask_about(path, settings, is_only_file=len(files) == 1)
        else:
            file_tests = find_tests(path, settings, is_only_file=len(files) == 1)
        tests += file_tests
    inspections = [Inspection.of(reading) for _, reading in tests]
    print(inspections[0] if len(tests) == 1 else overview(inspections))
    if write is not None:
        write.write_text(study_file([of_test for of_test, _ in tests], inspections, write.parent), encoding="utf-8")
        print(f"\nWritten: {write}. Look through it, then: tissuq fit {write}")
    if out is not None:
        from tissuq.report.inspection import write_inspection

        with run_folder(out, call.command, force=force) as folder:
            write_inspection(inspections, folder)
        print(f"\nFigures: {out / 'figures'}" if len(tests) > 1 else f"\nFigure: {out / 'figures' / 'curve.png'}")
