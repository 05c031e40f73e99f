"""The folder of an ensemble of a user's model: tables, curves, fields, figures and the report."""

from __future__ import annotations

import json
import re
import shutil
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.decks import FunctionQuantity
from tissuq.decks.fields import FinalFields
from tissuq.decks.model_run import FIELDS
from tissuq.finite_elements.simulation import COMPLETE, FAMILIES
from tissuq.finite_elements.spread import band_probability
from tissuq.report.ensemble_figures import ensemble_figures, write_fields
from tissuq.report.run_folder import write_figures, write_page
from tissuq.report.tables import significant, write_csv
from tissuq.studies.ensemble import EnsembleStudy
from tissuq.studies.ensemble_files import DRAWS

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

__all__ = ["copy_functions", "readable_quantities", "write_ensemble"]

FUNCTIONS = "quantities"
"""Folder with copies of the files of the user's functions."""
ROWS = 12
"""Times that the page shows of every quantity."""


def copy_functions(study_quantities: tuple[object, ...], folder: Path) -> dict[str, str]:
    """Copy the files of quantities that are functions, and return what these are called in the recipe."""
    texts = {}
    for quantity in study_quantities:
        if isinstance(quantity, FunctionQuantity):
            source = Path(quantity.location.rpartition(":")[0])
            target = folder / FUNCTIONS / source.name
            target.parent.mkdir(exist_ok=True)
            if not target.exists() or not source.samefile(target):
                shutil.copyfile(source, target)
            texts[quantity.name] = f"{FUNCTIONS}/{source.name}:{quantity.location.rpartition(':')[2]}"
    return texts


def write_ensemble(study: EnsembleStudy, folder: Path, *, figures: bool = True) -> None:
    """Write tables, curves, fields, figures and page of an ensemble beside the runs of its draws.

    Parameters
    ----------
    study : EnsembleStudy
    folder : Path
        Holds the recipe, the model and the runs.
    figures : bool
        Draw them, too.
    """
    result = study.result
    tables = {name: result.table(name) for name in result.curves}
    _write_tables(study, tables, folder)
    (folder / "model.diff").write_text(study.prepared.diff() + "\n", encoding="utf-8", errors="surrogateescape")
    for name, cards in study.prepared.cards[COMPLETE].items():
        write_csv(folder / f"cards-{re.sub(r'[^A-Za-z0-9_-]+', '-', name)}.csv", [dict(row) for row in cards.index])
    (folder / "curves.nc").write_bytes(bytes(_curves(study).to_netcdf(engine="h5netcdf")))
    stored = [folder / DRAWS / name / FIELDS for name in result.folders]
    fields = [FinalFields.load(path) for path in stored if path.is_file()]
    (folder / "fields.vtu").unlink(missing_ok=True)
    has_fields = len(fields) > 1 and find_spec("meshio") is not None
    if has_fields:
        write_fields(folder / "fields.vtu", fields)
    shutil.rmtree(folder / "figures", ignore_errors=True)
    if figures:
        limits = study.prepared.tasks(folder)[0].limits
        write_figures(folder, ensemble_figures(result, fields, limits))
    write_page(folder, "ensemble.html", **_context(study, tables, has_fields))


def readable_quantities(study: EnsembleStudy) -> tuple[list[str], list[list[str]]]:
    """Return headers and rows of the quantities at the end as text."""
    result = study.result
    tables = {name: result.table(name) for name in result.curves}
    headers = ["quantity", *_headers(study, tables)]
    return headers, [[name, *_row(study, _last(table))] for name, table in tables.items()]


def _write_tables(study: EnsembleStudy, tables: dict[str, pd.DataFrame], folder: Path) -> None:
    import pandas as pd

    result = study.result
    frames = [table.assign(quantity=name) for name, table in tables.items()]
    everything = pd.concat(frames, ignore_index=True).drop(columns=["noise", "noise_error"], errors="ignore")
    everything.insert(0, "quantity", everything.pop("quantity"))
    everything.to_csv(folder / "quantities.csv", index=False)
    write_csv(folder / "draws.csv", _draw_rows(study))
    (folder / "failures.csv").unlink(missing_ok=True)
    if result.failures:
        rows = [{**vars(item), "number": item.number + 1, "lines": " | ".join(item.lines)} for item in result.failures]
        write_csv(folder / "failures.csv", rows)
    beyond = result.beyond
    summary = {
        "model": study.prepared.settings.model,
        "materials": list(study.prepared.ensembles),
        "solver": study.prepared.solver.name,
        "draws": result.draws,
        "failed": sum(failure.family == COMPLETE for failure in result.failures),
        "quantities": {name: _plain(_last(table)) for name, table in tables.items()},
        "measured_invariants": {name: list(ensemble.most) for name, ensemble in study.prepared.ensembles.items()},
        "elements_beyond": None if beyond is None else float(np.nanmean(beyond[1][:, -1])),
        "seconds": result.seconds,
        "cards": study.prepared.card_warnings,
        "warnings": study.warnings,
    }
    (folder / "summary.json").write_text(json.dumps(summary, indent=2, allow_nan=False) + "\n", encoding="utf-8")


def _draw_rows(study: EnsembleStudy) -> list[dict[str, Any]]:
    """Return a row for every draw: parameters, last values, and why it failed."""
    result, ensembles = study.result, study.prepared.ensembles
    problems = {failure.number: failure.problem for failure in result.failures if failure.family == COMPLETE}
    rows = []
    for number in range(result.draws):
        row: dict[str, Any] = {"draw": number + 1}
        for material, ensemble in ensembles.items():
            prefix = f"{material}." if len(ensembles) > 1 else ""
            row |= {f"{prefix}{symbol}": value for symbol, value in ensemble[number].values.items()}
        for name in result.curves:
            value = float(result.last_values(name)[number])
            row[name] = value if np.isfinite(value) else ""
        rows.append(row | {"problem": problems.get(number, "")})
    return rows


def _curves(study: EnsembleStudy) -> xr.Dataset:
    import xarray as xr

    result = study.result
    curves: dict[str, Any] = {}
    coordinates: dict[str, Any] = {}
    for name, families in result.curves.items():
        coordinates[f"time_{name}"] = result.times[name]
        for family, values in families.items():
            curves[name if family == COMPLETE else f"{name}_{family}"] = (("draw", f"time_{name}"), values)
    return xr.Dataset(curves, coordinates, {"model": study.prepared.settings.model})


def _last(table: pd.DataFrame) -> dict[str, Any]:
    """Return the last row of a table with a band."""
    return {str(key): value for key, value in table[table["draws"] > 1].iloc[-1].items()}


def _plain(row: dict[str, Any]) -> dict[str, Any]:
    return {key: None if value != value else float(value) for key, value in row.items() if not key.startswith("noise")}


def _headers(study: EnsembleStudy, tables: dict[str, pd.DataFrame]) -> list[str]:
    percent = f"{100 * band_probability(max(int(table['draws'].max()) for table in tables.values())):.0f} %"
    return ["time", "draws", "mean", "sd", percent, *["parameters", "discrepancy"] * study.result.is_shared]


def _row(study: EnsembleStudy, row: dict[str, Any]) -> list[str]:
    cells = [f"{row['time']:.4g}", str(int(row["draws"])), significant(row["mean"]), significant(row["sd"])]
    cells.append(f"{significant(row['low'])} to {significant(row['high'])}")
    for name in ["parameters", "discrepancy"] * study.result.is_shared:
        share, error = row[name], row[f"{name}_error"]
        cells.append("" if np.isnan(share) else f"{100 * share:.0f} ± {100 * error:.0f} %")
    return cells


def _context(study: EnsembleStudy, tables: dict[str, pd.DataFrame], has_fields: bool) -> dict[str, Any]:
    prepared, result = study.prepared, study.result
    shown = {}
    for name, table in tables.items():
        full = table[table["draws"] > 1]
        picked = full.iloc[np.unique(np.linspace(0, len(full) - 1, ROWS).round().astype(int))]
        shown[name] = [
            _row(study, {str(key): value for key, value in row.items()}) for row in picked.to_dict("records")
        ]
    materials = [
        [name, ensemble.model.experiment.name, ensemble.model.material.name, ensemble.model.discrepancy.name,
         f"{ensemble.most[0]:.3g}", f"{ensemble.most[1]:.3g}"]
        for name, ensemble in prepared.ensembles.items()
    ]  # fmt: skip
    return {
        "command": "ensemble",
        "model": prepared.deck.main,
        "solver": prepared.solver.name,
        "command_line": prepared.solver.command or prepared.solver.template,
        "definitions": {quantity.name: quantity.text for quantity in prepared.quantities},
        "lead": _lead(study, tables),
        "warnings": study.warnings,
        "cards": prepared.card_warnings,
        "headers": _headers(study, tables),
        "tables": shown,
        "materials": materials,
        "draws": result.draws,
        "complete": len(result.folders),
        "is_shared": result.is_shared,
        "has_fields": has_fields,
        "percent": _headers(study, tables)[4],
        "failures": [
            [FAMILIES[item.family], item.number + 1, f"{item.reached:.4g}", item.problem, "\n".join(item.lines)]
            for item in result.failures
        ],
        "diff": prepared.diff().encode("utf-8", "replace").decode(),
        "seconds": f"{result.seconds:.0f}",
    }


def _lead(study: EnsembleStudy, tables: dict[str, pd.DataFrame]) -> str:
    """Return the finding in a sentence for each quantity."""
    percent = _headers(study, tables)[4]
    sentences = []
    for name, table in tables.items():
        row = _last(table)
        sentences.append(
            f"At time {row['time']:.4g}, {name} is {significant(row['mean'])} ({percent}: {significant(row['low'])} to "
            f"{significant(row['high'])})."
        )
    return " ".join(sentences)
