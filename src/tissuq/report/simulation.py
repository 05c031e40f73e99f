"""The folder of a simulation: tables, curves, fields, figures and the report."""

from __future__ import annotations

import filecmp
import json
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.errors import InputError
from tissuq.finite_elements.response import CellFields, respond
from tissuq.finite_elements.simulation import COMPLETE, FAMILIES, MATERIAL_ONLY, WITHOUT, Simulation
from tissuq.finite_elements.spread import band_probability
from tissuq.report.run_folder import INPUT, RECIPE, write_figures, write_page
from tissuq.report.simulation_figures import force_unit, simulation_figures, write_collection, write_vtu
from tissuq.report.tables import significant, write_csv
from tissuq.studies.earlier_run import POSTERIORS
from tissuq.studies.structure import SimulationStudy

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

__all__ = ["SOURCE", "check_source", "copy_source", "readable_forces", "write_simulation"]

SOURCE = "source"
"""The folder with copies of the files of the run that the posterior comes from."""
CELL_FIELDS = {
    "first_invariant": "I1 - 3",
    "second_invariant": "I2 - 3",
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
    stored = folder / SOURCE
    if stored.is_dir() and not all(
        (run / name).is_file() and (stored / name).is_file() and filecmp.cmp(run / name, stored / name, False)
        for name in _files(run)
    ):
        raise InputError(f"'{folder}' holds a simulation of another run; choose another folder with --out.")


def _files(run: Path) -> list[Path]:
    """Return the files of a run, relative to it, from which a simulation starts: its recipe and its posteriors."""
    return [Path(RECIPE), *(file.relative_to(run) for file in sorted((run / POSTERIORS).glob("*.nc")))]


def copy_source(run: Path, folder: Path) -> None:
    """Copy the files of a run into the folder of a simulation, so that it can be repeated."""
    stored = folder / SOURCE
    if not stored.is_dir():
        scratch = folder / f"{SOURCE}.new"
        shutil.copytree(run / INPUT, scratch / INPUT, dirs_exist_ok=True)
        for name in _files(run):
            (scratch / name).parent.mkdir(exist_ok=True)
            shutil.copyfile(run / name, scratch / name)
        scratch.rename(stored)


def write_simulation(study: SimulationStudy, folder: Path, *, figures: bool = True) -> None:
    """Write tables, curves, fields, figures and page of a simulation beside its results.

    Parameters
    ----------
    study : SimulationStudy
    folder : Path
        Holds the results of the draws and the recipe.
    figures : bool
        Draw them, too.
    """
    simulation = study.simulation
    table = simulation.table()
    table.to_csv(folder / "forces.csv", index=False)
    (folder / "failures.csv").unlink(missing_ok=True)
    if simulation.failures:
        write_csv(folder / "failures.csv", [vars(failure) for failure in simulation.failures])
    summary = json.dumps(_summary(study, table), indent=2, allow_nan=False)
    (folder / "summary.json").write_text(summary + "\n", encoding="utf-8")
    curves = bytes(_curves(study).to_netcdf(engine="h5netcdf"))
    (folder / "curves.nc").write_bytes(curves)
    _write_fields(study, folder)
    shutil.rmtree(folder / "figures", ignore_errors=True)
    if figures:
        write_figures(folder, simulation_figures(simulation, table))
    write_page(folder, "simulation.html", **_context(study, table))


def readable_forces(study: SimulationStudy) -> tuple[list[str], list[list[str]]]:
    """Return headers and rows of the forces as text."""
    simulation, table = study.simulation, study.simulation.table()
    unit, factor = force_unit(table)
    percent = f"{100 * band_probability(int(table['draws'].max())):.0f} %"
    is_compared, is_shared = WITHOUT in simulation.forces, MATERIAL_ONLY in simulation.forces
    headers = [f"{simulation.case.travel_name}, mm", "draws", f"force, {unit}", "sd", percent]
    headers += ["parameters", "discrepancy"] * is_shared + ["noise"]
    headers += ["without discrepancy", percent] * is_compared
    rows = []
    for row in table.to_dict("records"):
        numbers = {str(key): value for key, value in row.items()}
        cells = [f"{row[f'{simulation.case.travel_name}_mm']:.3g}", str(row["draws"]), *_band(numbers, factor, "")]
        for name in (["parameters", "discrepancy"] if is_shared else []) + ["noise"]:
            cells.append(_percent(numbers[name], numbers[f"{name}_error"]))
        if is_compared:
            mean, _, ends = _band(numbers, factor, "without_")
            cells += [mean, ends]
        rows.append(cells)
    return headers, rows


def _band(row: dict[str, Any], factor: float, prefix: str) -> list[str]:
    mean, sd, low, high = (row.get(f"{prefix}{name}", np.nan) * factor for name in ("mean", "sd", "low", "high"))
    return [significant(mean), significant(sd), f"{significant(low)} to {significant(high)}"]


def _percent(value: float, error: float) -> str:
    return "" if np.isnan(value) else f"{100 * value:.0f} ± {100 * error:.0f} %"


def _summary(study: SimulationStudy, table: pd.DataFrame) -> dict[str, Any]:
    simulation = study.simulation
    last = {key: None if value != value else value for key, value in table.iloc[-1].to_dict().items()}
    return {
        "case": study.settings.case,
        "sizes": vars(simulation.case),
        "draws": len(simulation.forces[COMPLETE]),
        "complete_draws": int(np.isfinite(simulation.forces[COMPLETE][:, -1]).sum()),
        "probability_of_band": band_probability(int(table["draws"].iloc[-1])),
        "last_step": last,
        "beyond": _last_mean(simulation.volume_beyond),
        "energy_beyond": _last_mean(simulation.energy_beyond),
        "measured_invariants": list(simulation.max_invariants),
        "mesh_change": None if simulation.mesh_change is None else simulation.mesh_change[0],
        "noise_sd": simulation.noise_sd,
        "admissible_share": simulation.ensembles[COMPLETE].admissible_share,
        "seconds": simulation.seconds,
        "warnings": study.warnings,
    }


def _last_mean(rows: np.ndarray[Any, Any]) -> float | None:
    last = rows[np.isfinite(rows[:, -1]), -1]
    return float(last.mean()) if len(last) else None


def _curves(study: SimulationStudy) -> xr.Dataset:
    """Return all curves, with the parameters of their draws."""
    import xarray as xr

    simulation = study.simulation
    coordinates = {"travel": ("travel", simulation.travel, {"units": "mm", "long_name": simulation.case.travel_name})}
    curves: dict[str, Any] = {}
    for family, forces in simulation.forces.items():
        draw = "draw_without" if family == WITHOUT else "draw"
        curves[f"force_{family}"] = ((draw, "travel"), forces, {"units": "N"})
    for symbol in simulation.ensembles[COMPLETE][0].values:
        values = [draw.values[symbol] for draw in simulation.ensembles[COMPLETE]]
        curves[f"parameter_{symbol}"] = (("draw",), values)
    for name, shares in (("beyond", simulation.volume_beyond), ("energy_beyond", simulation.energy_beyond)):
        curves[name] = (("draw", "travel"), shares)
    return xr.Dataset(curves, coordinates, {"case": simulation.case.name, "noise_sd": simulation.noise_sd})


def _write_fields(study: SimulationStudy, folder: Path) -> None:
    """Write mean and sd of the fields of the last step, and all steps of the draw in the middle."""
    simulation = study.simulation
    mesh = simulation.case.mesh()
    if len(simulation.fields.get("first_invariant", ())) > 1:
        displacement = simulation.fields["displacement"]
        points = {
            "mean displacement": displacement.mean(axis=0),
            "sd of displacement": displacement.std(axis=0, ddof=1),
        }
        cells = {}
        for name, label in CELL_FIELDS.items():
            cells[f"mean {label}"] = simulation.fields[name].mean(axis=0)
            cells[f"sd of {label}"] = simulation.fields[name].std(axis=0, ddof=1)
        write_vtu(folder / "fields.vtu", mesh, points, cells)
    (folder / "steps").mkdir(exist_ok=True)
    files: list[tuple[float, str]] = []

    def at_step(travel: float, fields: CellFields) -> None:
        name = f"steps/step_{len(files) + 1:02d}.vtu"
        cell_fields = {label: getattr(fields, field) for field, label in CELL_FIELDS.items()}
        write_vtu(folder / name, mesh, {"displacement": fields.displacement}, cell_fields)
        files.append((travel, name))

    settings = study.settings
    respond(
        simulation.case, simulation.median_draw, steps=settings.steps, bulk_ratio=settings.bulk_ratio, at_step=at_step
    )
    write_collection(folder / "middle_draw.pvd", files)


def _context(study: SimulationStudy, table: pd.DataFrame) -> dict[str, Any]:
    simulation, model, failed = study.simulation, study.posteriors.fitted.model, study.simulation.failures
    unit, factor = force_unit(table)
    headers, rows = readable_forces(study)
    count = int(table["draws"].max())
    return {
        "command": "structure",
        "case": simulation.case,
        "sizes": [[name.replace("_", " "), _size(name, value)] for name, value in vars(simulation.case).items()],
        "material": model.material.name,
        "discrepancy": model.discrepancy.name,
        "data": model.experiment.name,
        "lead": _lead(simulation, table),
        "warnings": study.warnings,
        "headers": headers,
        "rows": rows,
        "percent": f"{100 * band_probability(count):.0f}",
        "draws": len(simulation.forces[COMPLETE]),
        "complete": int(np.isfinite(simulation.forces[COMPLETE][:, -1]).sum()),
        "is_shared": MATERIAL_ONLY in simulation.forces,
        "is_compared": WITHOUT in simulation.forces,
        "failures": [
            [FAMILIES[failure.family], failure.number + 1, f"{failure.reached:.3g}", failure.problem]
            for failure in failed
        ],
        "noise": f"{significant(simulation.noise_sd * factor)} {unit}",
        "noise_is_given": study.settings.force_noise is not None,
        "bulk_ratio": f"{study.settings.bulk_ratio:g}",
        "cells": len(simulation.case.mesh().cells),
        "seconds": f"{simulation.seconds:.0f}",
        "mesh": simulation.mesh_change,
    }


def _size(name: str, value: float | str) -> str:
    if isinstance(value, str):
        return value
    return f"{value:g}" if name == "fineness" else f"{value:g} mm"


def _lead(simulation: Simulation, table: pd.DataFrame) -> str:
    """Return the finding in a sentence or two."""
    unit, factor = force_unit(table)
    last_step: dict[str, Any] = dict(table[table["draws"] > 1].iloc[-1].items())  # type: ignore[arg-type]
    mean, _, ends = _band(last_step, factor, "")
    percent = f"{100 * band_probability(int(last_step['draws'])):.0f} %"
    name = simulation.case.travel_name
    article, travel = "an" if name[0] in "aeiou" else "a", last_step[f"{name}_mm"]
    text = f"At {article} {name} of {travel:.3g} mm the force is {mean} {unit} ({percent}: {ends} {unit})."
    if WITHOUT in simulation.forces:
        without, _, without_ends = _band(last_step, factor, "without_")
        text += f" Without discrepancy it is {without} {unit} ({without_ends} {unit})."
    return text
