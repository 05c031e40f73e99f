"""``tissuq compare``: the fits of runs side by side."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tissuq.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["compare"]


def compare(
    runs: Annotated[list[Path], typer.Argument(help="Run folders, or files of posteriors in them.")],
    out: Annotated[Path | None, typer.Option(help="CSV file for the table.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace the CSV file.")] = False,
) -> None:
    """Compare fits of the same measurements by evidence and by leave-one-out prediction."""
    from tissuq.assessment import compare as compare_fits
    from tissuq.cli.tables import print_rows

    if out is not None and out.exists() and not force:
        raise InputError(f"'{out}' exists; choose another file, or --force.")
    table = compare_fits(_trees(runs))
    if out is not None:
        table.rename_axis("fit").to_csv(out)
    rows = [
        [
            str(name),
            f"{row['log_evidence']:.2f}",
            f"{row['log_bayes_factor']:.2f}",
            f"{row['probability']:.1%}",
            f"{row['elpd']:.1f}",
            f"{row['elpd_difference']:.1f} ± {row['elpd_difference_error']:.1f}",
            f"{row['stacking']:.2f}{' (rough)' if row['is_rough'] else ''}",
        ]
        for name, row in table.iterrows()
    ]
    headers = ["fit", "log evidence", "log Bayes factor", "probability", "elpd", "difference", "stacking"]
    print_rows("Fits of the same measurements", headers, rows)
    print("Probability: were all fits as probable before the data; it depends on the widths of their priors.")
    print("Stacking: weights for an average of predictions; they say nothing of parameters.")
    if table["is_rough"].any():
        print("Rough: single measurements weigh so much that importance sampling cannot leave them out.")


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
        return {name: xr.open_datatree(path, engine="h5netcdf").load() for name, path in files.items()}
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"a posterior cannot be read: {error}.") from error
