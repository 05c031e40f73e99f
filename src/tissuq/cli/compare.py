"""``tissuq compare``: the fits of runs side by side."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tissuq.errors import InputError
from tissuq.report.run_folder import ASSESSMENT

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["compare"]


def compare(
    runs: Annotated[list[Path], typer.Argument(help="Run folders, or files of posteriors in them.")],
    out: Annotated[Path | None, typer.Option(help="Folder for table, figure and report.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace the folder of an earlier comparison.")] = False,
) -> None:
    """Compare fits of the same measurements by evidence and by leave-one-out prediction."""
    from tissuq.assessment import compare as compare_fits
    from tissuq.cli.tables import print_rows, print_warnings
    from tissuq.experiments.units import stress_unit
    from tissuq.report.comparison import (
        HEADERS,
        NOTES,
        ROUGH,
        parameter_header,
        readable_comparison,
        write_comparison,
    )
    from tissuq.report.run_folder import check_target, run_folder

    if out is not None:
        if any(path.resolve().is_relative_to(out.resolve()) for path in runs):
            raise InputError(f"'{out}' holds what is compared; choose another folder for the comparison with --out.")
        check_target(out, force=force)
    trees = _trees(runs)
    table = compare_fits(trees)
    units = {str(tree.attrs.get("stress_unit", "MPa")) for tree in trees.values()}
    unit = stress_unit(units.pop() if len(units) == 1 else "MPa")
    headers = [*HEADERS, parameter_header(table, unit)]
    print_rows("Fits of the same measurements", headers, readable_comparison(table, unit))
    print_warnings([*NOTES, *[ROUGH] * bool(table["is_rough"].any())])
    if out is not None:
        with run_folder(out, force=force) as folder:
            write_comparison(table, [str(run) for run in runs], unit, folder)
        print(f"Report: {out / 'report.html'}")


def _trees(runs: list[Path]) -> dict[str, xr.DataTree]:
    """Read the posteriors of runs, named by formulation, and by run where there are several."""
    import xarray as xr

    files: dict[str, Path] = {}
    for run in runs:
        found = sorted((run / "posterior").glob("*.nc")) if run.is_dir() else [run]
        if not found or not all(path.is_file() for path in found):
            raise InputError(f"there is no posterior in '{run}': give the folder of a run, or an .nc file in one.")
        for path in found:
            name = f"{run.name}/{path.stem}" if run.is_dir() and len(runs) > 1 else path.stem
            files[name if name not in files else str(path)] = path
    try:
        trees = {name: xr.open_datatree(path, engine="h5netcdf").load() for name, path in files.items()}
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"a posterior cannot be read: {error}.") from error
    for name, path in files.items():
        trees[name].attrs |= _assessed(path)
    return trees


def _assessed(path: Path) -> dict[str, float]:
    """Return what the assessment of the posterior's run says of its evidence with other priors."""
    try:
        rows = json.loads((path.parent.parent / ASSESSMENT).read_text(encoding="utf-8"))
        own = next(row for row in rows if row["formulation"] == path.stem)
        return {f"evidence_change_{name}": float(change) for name, change in own["evidence_changes"].items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError, StopIteration):
        return {}  # a file by itself, or a run without an assessment: not known
