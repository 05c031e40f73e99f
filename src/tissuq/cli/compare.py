"""``tissuq compare``: fits of the same measurements beside one another."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from tissuq.cli.call import Call
from tissuq.cli.command import command
from tissuq.cli.running import IntoFolder, Verbosity
from tissuq.errors import InputError
from tissuq.studies.option import Settings, argument
from tissuq.studies.settings import DAMAGE

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["compare"]


class ComparedRuns(Settings):
    """What is compared."""

    runs: tuple[Path, ...] = argument(..., "Run folders, or files of posteriors in them.", takes=list[Path])


class CompareOptions(IntoFolder, Verbosity):
    """Where a comparison is written, if at all."""


@command(ComparedRuns, CompareOptions, out="Folder for table, figure and report.")
def compare(call: Call[ComparedRuns, CompareOptions]) -> None:
    """Compare fits of the same measurements by evidence and by leave-one-out prediction."""
    from tissuq.assessment import compare as compare_fits
    from tissuq.experiments.units import stress_unit
    from tissuq.report.comparison import comparison_result
    from tissuq.report.run_folder import run_folder
    from tissuq.report.terminal import print_result
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
        table = compare_fits(trees)
    units = {str(tree.attrs.get("stress_unit", "MPa")) for tree in trees.values()}
    unit = stress_unit(units.pop() if len(units) == 1 else "MPa")
    result = comparison_result(table, [str(run) for run in runs], unit)
    if out is not None:
        with run_folder(out, call.command, force=force) as folder:
            write_result(result, folder, target=out)
    record = result.record()
    print_result(record, out, details=out is None)
    call.answer(record["numbers"])


def _trees(runs: tuple[Path, ...]) -> dict[str, xr.DataTree]:
    """Read the posteriors of runs, named by formulation, and by run where there are several."""
    import xarray as xr

    from tissuq.posterior.archive import unreadable

    files: dict[str, Path] = {}
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
            trees[name] = xr.open_datatree(path, engine="h5netcdf").load()
        except (OSError, ValueError, KeyError) as error:
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
