"""The folder of a simulation: tables, curves, fields, figures and the report."""

from __future__ import annotations

import filecmp
import json
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.errors import InputError
from tissuq.finite_elements.cautions import FAMILIES
from tissuq.finite_elements.response import CellFields, respond
from tissuq.finite_elements.simulation import ALONE, COMPLETE, WITHOUT, Simulation
from tissuq.finite_elements.spread import held_probability
from tissuq.report.common import write_figures
from tissuq.report.page import embedded_figure, render
from tissuq.report.rows import significant
from tissuq.report.run_folder import INPUT, RECIPE
from tissuq.report.simulation_figures import force_unit, simulation_figures
from tissuq.report.tables import write_csv
from tissuq.report.vtu import write_collection, write_vtu
from tissuq.studies.simulate import SimulationStudy

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

__all__ = ["SOURCE", "check_source", "copy_source", "readable_forces", "write_simulation"]

SOURCE = "source"
"""The folder with what is needed of the run that the posterior comes from."""
FILES = (RECIPE, "summary.json")
CELL_FIELDS = {
    "first": "I1 - 3",
    "second": "I2 - 3",
    "largest": "largest stretch",
    "von_mises": "von Mises stress, MPa",
}


def check_source(run: Path, folder: Path) -> None:
    """Refuse a folder that holds a simulation with another run.

    Raises
    ------
    InputError
        When it does.
    """
    kept = folder / SOURCE
    if kept.is_dir() and not all(
        (run / name).is_file() and filecmp.cmp(run / name, kept / name, False) for name in FILES
    ):
        raise InputError(f"'{folder}' holds a simulation with another run; choose another folder with --out.")


def copy_source(run: Path, folder: Path) -> None:
    """Copy what is needed of a run into the folder of a simulation, so that it can be repeated."""
    kept = folder / SOURCE
    if not kept.is_dir():
        scratch = folder / f"{SOURCE}.new"
        shutil.copytree(run / INPUT, scratch / INPUT, dirs_exist_ok=True)
        for name in FILES:
            shutil.copyfile(run / name, scratch / name)
        scratch.rename(kept)


def write_simulation(study: SimulationStudy, folder: Path, *, figures: bool = True) -> None:
    """Write everything that a simulation leaves behind beside its results.

    Parameters
    ----------
    study : SimulationStudy
    folder : Path
        Holds the results of the draws and the recipe.
    figures : bool
        Draw them, too.
    """
    found = study.simulation
    table = found.table()
    table.to_csv(folder / "forces.csv", index=False)
    (folder / "failures.csv").unlink(missing_ok=True)
    if found.failures:
        write_csv(folder / "failures.csv", [vars(each) for each in found.failures])
    summary = json.dumps(_summary(study, table), indent=2, allow_nan=False)
    (folder / "summary.json").write_text(summary + "\n", encoding="utf-8")
    curves = bytes(_curves(study).to_netcdf(engine="h5netcdf"))
    (folder / "curves.nc").write_bytes(curves)
    _write_fields(study, folder)
    shutil.rmtree(folder / "figures", ignore_errors=True)
    if figures:
        write_figures(folder, simulation_figures(found, table))
    page = render("simulation.html", **_context(study, table, folder))
    (folder / "report.html").write_text(page, encoding="utf-8")


def readable_forces(study: SimulationStudy) -> tuple[list[str], list[list[str]]]:
    """Return headers and rows of the forces as text."""
    found, table = study.simulation, study.simulation.table()
    unit, factor = force_unit(table)
    percent = f"{100 * held_probability(int(table['draws'].max())):.0f} %"
    is_compared, is_shared = WITHOUT in found.forces, ALONE in found.forces
    headers = [f"{found.case.travel_name}, mm", "draws", f"force, {unit}", "sd", percent]
    headers += ["parameters", "discrepancy"] * is_shared + ["noise"]
    headers += ["without discrepancy", percent] * is_compared
    rows = []
    for row in table.to_dict("records"):
        own = {str(key): value for key, value in row.items()}
        cells = [f"{row[f'{found.case.travel_name}_mm']:.3g}", str(row["draws"]), *_band(own, factor, "")]
        for name in (["parameters", "discrepancy"] if is_shared else []) + ["noise"]:
            cells.append(_percent(own[name], own[f"{name}_error"]))
        if is_compared:
            mean, _, ends = _band(own, factor, "without_")
            cells += [mean, ends]
        rows.append(cells)
    return headers, rows


def _band(row: dict[str, Any], factor: float, prefix: str) -> list[str]:
    mean, sd, low, high = (row.get(f"{prefix}{name}", np.nan) * factor for name in ("mean", "sd", "low", "high"))
    return [significant(mean), significant(sd), f"{significant(low)} to {significant(high)}"]


def _percent(value: float, error: float) -> str:
    return "" if np.isnan(value) else f"{100 * value:.0f} ± {100 * error:.0f} %"


def _summary(study: SimulationStudy, table: pd.DataFrame) -> dict[str, Any]:
    found = study.simulation
    last = {key: None if value != value else value for key, value in table.iloc[-1].to_dict().items()}
    return {
        "case": study.settings.case,
        "sizes": vars(found.case),
        "draws": len(found.forces[COMPLETE]),
        "complete_draws": int(np.isfinite(found.forces[COMPLETE][:, -1]).sum()),
        "probability_of_band": held_probability(int(table["draws"].iloc[-1])),
        "last_step": last,
        "beyond": _last_mean(found.beyond),
        "energy_beyond": _last_mean(found.energy_beyond),
        "measured_invariants": list(found.most),
        "mesh_change": None if found.mesh_change is None else found.mesh_change[0],
        "noise_sd": found.noise_sd,
        "admissible_share": found.ensembles[COMPLETE].admissible_share,
        "seconds": found.seconds,
        "warnings": study.warnings,
    }


def _last_mean(rows: np.ndarray[Any, Any]) -> float | None:
    last = rows[np.isfinite(rows[:, -1]), -1]
    return float(last.mean()) if len(last) else None


def _curves(study: SimulationStudy) -> xr.Dataset:
    """Return all curves, with the parameters of their draws."""
    import xarray as xr

    found = study.simulation
    own = {"travel": ("travel", found.travel, {"units": "mm", "long_name": found.case.travel_name})}
    curves: dict[str, Any] = {}
    for family, forces in found.forces.items():
        draw = "draw_without" if family == WITHOUT else "draw"
        curves[f"force_{family}"] = ((draw, "travel"), forces, {"units": "N"})
    for symbol in found.ensembles[COMPLETE][0].values:
        values = [draw.values[symbol] for draw in found.ensembles[COMPLETE]]
        curves[f"parameter_{symbol}"] = (("draw",), values)
    for name in ("beyond", "energy_beyond"):
        curves[name] = (("draw", "travel"), getattr(found, name))
    return xr.Dataset(curves, own, {"case": found.case.name, "noise_sd": found.noise_sd})


def _write_fields(study: SimulationStudy, folder: Path) -> None:
    """Write mean and sd of the fields of the last step, and all steps of the draw in the middle."""
    found = study.simulation
    mesh = found.case.mesh()
    if len(found.fields.get("first", ())) > 1:
        displacement = found.fields["displacement"]
        points = {
            "mean displacement": displacement.mean(axis=0),
            "sd of displacement": displacement.std(axis=0, ddof=1),
        }
        cells = {}
        for name, label in CELL_FIELDS.items():
            cells[f"mean {label}"] = found.fields[name].mean(axis=0)
            cells[f"sd of {label}"] = found.fields[name].std(axis=0, ddof=1)
        write_vtu(folder / "fields.vtu", mesh, points, cells)
    (folder / "steps").mkdir(exist_ok=True)
    files: list[tuple[float, str]] = []

    def at_step(travel: float, fields: CellFields) -> None:
        name = f"steps/step_{len(files) + 1:02d}.vtu"
        own = {label: getattr(fields, field) for field, label in CELL_FIELDS.items()}
        write_vtu(folder / name, mesh, {"displacement": fields.displacement}, own)
        files.append((travel, name))

    settings = study.settings
    respond(found.case, found.middle, steps=settings.steps, bulk_ratio=settings.bulk_ratio, at_step=at_step)
    write_collection(folder / "middle_draw.pvd", files)


def _context(study: SimulationStudy, table: pd.DataFrame, folder: Path) -> dict[str, Any]:
    found, model, failed = study.simulation, study.posteriors.given.model, study.simulation.failures
    unit, factor = force_unit(table)
    headers, rows = readable_forces(study)
    count = int(table["draws"].max())
    return {
        "recipe": (folder / RECIPE).read_text(encoding="utf-8"),
        "command": "simulate",
        "case": found.case,
        "sizes": [[name.replace("_", " "), _size(name, value)] for name, value in vars(found.case).items()],
        "material": model.material.name,
        "discrepancy": model.discrepancy.name,
        "data": model.experiment.name,
        "lead": _lead(found, table),
        "warnings": study.warnings,
        "headers": headers,
        "rows": rows,
        "percent": f"{100 * held_probability(count):.0f}",
        "draws": len(found.forces[COMPLETE]),
        "complete": int(np.isfinite(found.forces[COMPLETE][:, -1]).sum()),
        "is_shared": ALONE in found.forces,
        "is_compared": WITHOUT in found.forces,
        "failures": [[FAMILIES[each.family], each.number + 1, f"{each.reached:.3g}", each.problem] for each in failed],
        "noise": f"{significant(found.noise_sd * factor)} {unit}",
        "noise_is_given": study.settings.force_noise is not None,
        "bulk_ratio": f"{study.settings.bulk_ratio:g}",
        "cells": len(found.case.mesh().cells),
        "seconds": f"{found.seconds:.0f}",
        "mesh": found.mesh_change,
        "figures": {path.stem: embedded_figure(path) for path in sorted((folder / "figures").glob("*.svg"))},
    }


def _size(name: str, value: float | str) -> str:
    if isinstance(value, str):
        return value
    return f"{value:g}" if name == "fineness" else f"{value:g} mm"


def _lead(found: Simulation, table: pd.DataFrame) -> str:
    """Return the finding in a sentence or two."""
    unit, factor = force_unit(table)
    there: dict[str, Any] = dict(table[table["draws"] > 1].iloc[-1].items())  # type: ignore[arg-type]
    mean, _, ends = _band(there, factor, "")
    percent = f"{100 * held_probability(int(there['draws'])):.0f} %"
    name = found.case.travel_name
    article, at = "an" if name[0] in "aeiou" else "a", there[f"{name}_mm"]
    text = f"At {article} {name} of {at:.3g} mm the force is {mean} {unit} ({percent}: {ends} {unit})."
    if WITHOUT in found.forces:
        other, _, other_ends = _band(there, factor, "without_")
        text += f" The model without discrepancy says {other} {unit} ({other_ends} {unit})."
    return text
