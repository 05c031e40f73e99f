"""``tissuq show`` and ``compare``: what earlier runs say, alone or beside one another, and a page as a PDF."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from tissuq.cli.call import Call, IntoFolder, Verbosity
from tissuq.cli.command import command
from tissuq.errors import InputError
from tissuq.studies.option import Settings, argument, option
from tissuq.studies.settings import DAMAGE

if TYPE_CHECKING:
    import xarray as xr

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
        call.show(record, folder, details=call.how.details)


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


class ComparedRuns(Settings):
    """What is compared."""

    runs: tuple[Path, ...] = argument(..., "Run folders, or files of posteriors in them.", takes=list[Path])


class CompareOptions(IntoFolder, Verbosity):
    """Where a comparison is written, if at all."""


@command(ComparedRuns, CompareOptions, out="Folder for table, figure and report.")
def compare(call: Call[ComparedRuns, CompareOptions]) -> None:
    """Compare fits of the same measurements by evidence and by leave-one-out prediction."""
    from tissuq.assessment import compare as compare_fits
    from tissuq.assessment.comparison import values_in_mpa
    from tissuq.experiments.units import stress_unit
    from tissuq.report.comparison import comparison_result
    from tissuq.report.run_folder import run_folder
    from tissuq.report.writer import write_result

    runs, out, force = call.settings.runs, call.how.out, call.how.force
    if out is not None:
        if any(path.resolve().is_relative_to(out.resolve()) for path in runs):
            raise InputError(f"'{out}' holds one of the compared runs; choose another folder with --out.")
        call.target(out)
    with call.monitor.steps() as step:
        step("reading")
        trees = _trees(runs)
        step("comparing")
        table = compare_fits(trees, unit="MPa")
    units = {str(tree.attrs.get("stress_unit", "MPa")) for tree in trees.values()}
    measured = values_in_mpa(next(iter(trees.values()))["observed_data"]["stress"])
    unit = stress_unit(units.pop() if len(units) == 1 else "MPa").readable(float(abs(measured).max()))
    result = comparison_result(table, [str(run) for run in runs], unit)
    if out is not None:
        with run_folder(out, call.command, force=force) as folder:
            write_result(result, folder, target=out)
    call.show(result.record(), out, details=out is None)


def _trees(runs: tuple[Path, ...]) -> dict[str, xr.DataTree]:
    """Read the posteriors of runs, named by formulation, and by run where there are several."""
    import xarray as xr

    from tissuq.posterior.archive import unreadable
    from tissuq.posterior.netcdf import opened

    files: dict[str, Path] = {}
    if len({run.resolve() for run in runs}) < len(runs):
        raise InputError(f"a run is given twice among {', '.join(map(str, runs))}: name every run once.")
    for run in runs:
        paths = sorted((run / "posterior").glob("*.nc")) if run.is_dir() else [run]
        if not paths or not all(path.is_file() for path in paths):
            raise InputError(f"there is no posterior in '{run}': give the folder of a run, or an .nc file in one.")
        for path in paths:
            name = f"{run.name}/{path.stem}" if run.is_dir() and len(runs) > 1 else path.stem
            files[name if name not in files else str(path)] = path
    trees: dict[str, xr.DataTree] = {}
    for name, path in files.items():
        try:
            with opened(path):
                trees[name] = xr.open_datatree(path, engine="h5netcdf").load()
        except Exception as error:  # whatever a damaged file makes the readers of HDF5 raise
            raise unreadable(path, error) from error
        trees[name].attrs |= _assessed(path)
    return trees


def _assessed(path: Path) -> dict[str, float]:
    """Return what the assessment of the posterior's run says of its evidence with other priors."""
    from tissuq.report.run_folder import ASSESSMENT

    try:
        rows = json.loads((path.parent.parent / ASSESSMENT).read_text(encoding="utf-8"))
        assessment = next(row for row in rows if row["formulation"] == path.stem)
        return {f"evidence_change_{name}": float(change) for name, change in assessment["evidence_changes"].items()}
    except (OSError, *DAMAGE, StopIteration):
        return {}  # a single file, or a run without an assessment
