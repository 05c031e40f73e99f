"""The result of a simulation: the force with its band, tables, curves, fields and figures."""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.export.cards import ensemble_sentences
from tissuq.finite_elements.response import respond
from tissuq.finite_elements.simulation import COMPLETE, FAMILIES, MATERIAL_ONLY, WITHOUT, Simulation
from tissuq.finite_elements.solver import CellFields
from tissuq.finite_elements.spread import band_probability
from tissuq.report.band_table import OF_RANGES, SHARES, Bands, handy_unit, percent_of
from tissuq.report.finite_element_figures import (
    field_figure,
    force_and_strain_figure,
    force_figure,
    moments,
    share_figure,
    write_collection,
    write_vtu,
)
from tissuq.report.result import Number, Picture, Result, Section, Table
from tissuq.report.source_run import Said, said_by
from tissuq.report.tables import significant
from tissuq.studies.structure import SimulationStudy

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

OF_MEASUREMENT = "the variance of a new measurement, whose noise is not in the band"
MUCH_BEYOND = 0.2
"""Share of the strain energy beyond the measurements from which these are to be extended."""
CELL_FIELDS = {
    "first_invariant": "I1 - 3",
    "second_invariant": "I2 - 3",
    "largest": "largest stretch",
    "von_mises": "von Mises stress, MPa",
}


def simulation_result(study: SimulationStudy, folder: Path, run: Path) -> Result:
    """Return what a simulation with draws of a run says; its folder holds the results of the draws and the recipe."""
    simulation, model = study.simulation, study.posteriors.fitted.model
    table = simulation.table()
    unit, factor = handy_unit(table, simulation.case.response_unit)
    bands = Bands(table, MATERIAL_ONLY in simulation.forces, unit, factor)
    (folder / "failures.csv").unlink(missing_ok=True)
    failures = [vars(failure) for failure in simulation.failures]
    case, said = simulation.case, said_by(run, model)
    caption = f"{case.response.capitalize()}{_about_band(simulation, bands)}"
    titled = f"Case '{case.name}' with {study.settings.draws} draws"
    files = {
        f"{case.response}s.csv": table,
        "summary.json": _summary(study, table),
        "curves.nc": bytes(_curves(study).to_netcdf(engine="h5netcdf")),
        "middle_draw.pvd": lambda path: _write_fields(study, path.parent),
    }
    return Result(
        command="structure",
        title=f"From the posterior to a {case.response}",
        subject=f"{case.description} · {model.experiment.name}, {model.material.name}, discrepancy "
        f"{model.discrepancy.name} · {_completed(simulation)}",
        numbers=_numbers(simulation, bands),
        finding=_lead(simulation, bands),
        uses=(said.use,) if said.use else (),
        next_step=_next_step(simulation, said, shlex.quote(os.path.normpath(run))),
        picture=Picture("answer", lambda: force_figure(simulation, bands), f"Band of the {case.response}", caption),
        tables=(Table(*_readable(simulation, bands), titled, note=_of_cells(simulation, bands)),),
        sections=_sections(study, bands),
        warnings=(*said.warnings, *study.warnings),
        files=files | ({"failures.csv": failures} if failures else {}),
    )


def _completed(simulation: Simulation) -> str:
    """Return how many draws got to the end, and how many of them were computed in full."""
    forces = simulation.forces[COMPLETE]
    reached = np.isfinite(forces[:, -1])
    if COMPLETE not in simulation.first_order_error:
        return f"{reached.sum()} of {len(forces)} draws completed"
    in_full = simulation.in_full
    stopped = int((in_full & ~reached).sum())
    failed = f" ({stopped} of them not to the end)" if stopped else ""
    return f"{in_full.sum()} of {len(forces)} draws computed in full{failed}, the others to first order"


def _about_band(simulation: Simulation, bands: Bands) -> str:
    """Return what the caption of a figure of the force says after its name."""
    against = ", against those of a fit without discrepancy" if WITHOUT in simulation.forces else ""
    corrected = " Corrected for the size of the cells: see the table." * bands.is_mesh_free
    return (
        f" over {simulation.case.travel_name}: mean and {bands.percent} band over draws of the posterior, without the "
        f"noise of a measurement{against}.{corrected}"
    )


def _of_cells(simulation: Simulation, bands: Bands) -> str:
    """Return how the size of the cells was corrected, in sentences; nothing where it was not."""
    if not bands.is_mesh_free:
        return ""
    return (
        f"Corrected for the size of the cells, from {simulation.finer_mesh}: at the end by "
        f"{bands.mesh_change}, of which a quarter is the sd of the mesh's error in the band (Richardson's "
        f"extrapolation, the error falling with the power {simulation.mesh_order:g} of the size)."
    )


def _numbers(simulation: Simulation, bands: Bands) -> tuple[Number, ...]:
    """Return the force at the last step, the largest share of its variance, and how much of the body extrapolates."""
    case, last = simulation.case, bands.last
    numbers = [
        bands.number(f"{case.response} at {case.travel_name} {case.shown(last[case.travel_column])}"),
        *bands.largest_share([name for name in SHARES if name in last], OF_MEASUREMENT),
    ]
    energy_beyond = _last_mean(simulation.energy_beyond)
    if energy_beyond is not None:
        numbers.append(Number("energy strained beyond the measurements", f"{100 * energy_beyond:.0f} %"))
    return tuple(numbers)


def _next_step(simulation: Simulation, said: Said, run: str) -> str:
    if said.advice:
        return said.advice
    is_of_tests = not simulation.ensembles[COMPLETE].origin
    if is_of_tests and (_last_mean(simulation.energy_beyond) or 0.0) > MUCH_BEYOND:
        return f"measure up to the strains of the body: tissuq design {run} says which test helps most"
    return f"run your own model with the same draws: tissuq ensemble {run} MODEL --replace NAME --qoi NAME=WHAT"


def _readable(simulation: Simulation, bands: Bands) -> tuple[list[str], list[list[str]]]:
    """Return headers and rows of the forces as text."""
    case, shares = simulation.case, [*bands.shares, "noise"]
    along, mean = f"{case.travel_name}, {case.travel_unit}", f"{case.response}, {bands.unit}"
    rows = bands.table.to_dict("records")
    cells = [bands.cells(row, f"{row[case.travel_column]:.3g}", shares) for row in rows]
    return bands.headers(along, mean, bands.percent, shares), cells


def _summary(study: SimulationStudy, table: pd.DataFrame) -> dict[str, Any]:
    simulation = study.simulation
    return {
        "case": simulation.case.name,
        "sizes": vars(simulation.case),
        "draws": len(simulation.forces[COMPLETE]),
        "complete_draws": int(np.isfinite(simulation.forces[COMPLETE][:, -1]).sum()),
        "full_draws": int(simulation.in_full.sum()),
        "probability_of_band": band_probability(int(table["draws"].iloc[-1])),
        "last_step": table.iloc[-1].to_dict(),
        "beyond": _last_mean(simulation.volume_beyond),
        "energy_beyond": _last_mean(simulation.energy_beyond),
        "measured_invariants": list(simulation.max_invariants),
        "mesh_change": None if simulation.mesh_change is None else simulation.mesh_change[0],
        "noise_sd": simulation.noise_sd,
        "first_order_error": {
            family: {name: float(of_steps[-1]) for name, of_steps in error._asdict().items()}
            for family, error in simulation.first_order_error.items()
        },
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
    case = simulation.case
    coordinates = {"travel": ("travel", simulation.travel, {"units": case.travel_unit, "long_name": case.travel_name})}
    curves: dict[str, Any] = {}
    for family, forces in simulation.forces.items():
        draw = "draw_without" if family == WITHOUT else "draw"
        curves[f"{case.response}_{family}"] = ((draw, "travel"), forces, {"units": case.response_unit})
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
        points = moments({"displacement": simulation.fields["displacement"]})
        cells = moments({label: simulation.fields[name] for name, label in CELL_FIELDS.items()})
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


def _sections(study: SimulationStudy, bands: Bands) -> tuple[Section, ...]:
    """Return what a page folds: strains beyond, sources of uncertainty, fields, failures, how it was computed."""
    simulation, settings = study.simulation, study.settings
    case, draws = simulation.case, len(simulation.forces[COMPLETE])
    noise = f"{significant(simulation.noise_sd * bands.factor)} {bands.unit}"
    origin = f"the same share of the largest {case.response} as the test's noise is of its largest stress"
    forces = Picture(
        "forces", lambda: force_and_strain_figure(simulation, bands),
        f"Band of the {case.response}, and what is strained beyond the measurements",
        f"Left: {case.response}{_about_band(simulation, bands)} Right: how much of the body is strained beyond the "
        "measured I1 or I2, and how much of the strain energy is there.",
    )  # fmt: skip
    sections = [Section("What is strained beyond the measurements", (forces,))]
    if MATERIAL_ONLY in simulation.forces:
        shares = Picture(
            "shares", lambda: share_figure(simulation, bands), "Shares of the variance, and standard deviations",
            f"Left: shares of the variance of a new measurement of the {case.response}; shaded, ± one standard error "
            f"of {draws} draws (bootstrap). Right: how much the {case.response} would spread by each part alone; where "
            "the total is less than its parts, they compensate each other.",
        )  # fmt: skip
        said = ", as given" if settings.force_noise is not None else f": {origin}"
        sentences = (
            f"Q is the {case.response} of a draw with its discrepancy, Q0 that of the same draw with its material "
            "parameters alone. **Parameters** is Cov(Q, Q0), **discrepancy** Cov(Q, Q − Q0), **noise** the variance of "
            f"the noise of a new measurement (sd {noise}{said}). They add up to 100 % of Var Q + noise"
            f"{', with **mesh**, the error of the correction for the size of the cells' * bands.is_mesh_free}.",
            *[bands.of_sources] * bool(simulation.ensembles[COMPLETE].sources),
            "A share below zero or above 100 % is possible because parameters and discrepancy are correlated in the "
            "posterior. A negative share means that more information on this part alone would not narrow the band.",
            OF_RANGES,
        )
        sections.append(Section("Sources of uncertainty", (shares, sentences)))
    else:
        said = " (as given)" if settings.force_noise is not None else f" ({origin})"
        words = (
            "The posterior is without discrepancy: the band is due to the parameters alone. Noise of a new measurement "
            f"of the {case.response}: sd {noise}{said}."
        )
        sections.append(Section("Sources of uncertainty", (words,)))
    if len(simulation.fields.get("largest", ())) > 1 and len(simulation.case.mesh().section[0]):
        fields = Picture(
            "fields",
            lambda: field_figure(simulation),
            "Deformed section with mean and standard deviation of the largest stretch",
            f"{case.mesh().section_is}, deformed by the mean displacement at the last step. fields.vtu and "
            "middle_draw.pvd hold the fields for ParaView.",
        )  # fmt: skip
        sections.append(Section("Where the body is strained", (fields,)))
    if simulation.failures:
        failures = [
            [FAMILIES[failure.family], f"{failure.number + 1}", f"{failure.reached:.3g}", failure.problem]
            for failure in simulation.failures
        ]
        failed = Table(["draws", "number", f"reached, {case.travel_unit}", "reason"], failures, text_columns=(0, 3))
        sections.append(Section("Draws that were not completed", (failed,)))
    change = simulation.mesh_change
    finer = (
        f" On {simulation.finer_mesh} the {case.response} of one draw at {case.shown(change[1])} changes "
        f"by {100 * change[0]:+z.1f} %."
        if change
        else f" How far the {case.response} is off by the size of the cells is not known: compute it with a finer "
        "mesh, too (--finer-mesh)."
    )
    mesh = simulation.case.mesh()
    computed = (
        *ensemble_sentences(simulation.ensembles[COMPLETE]),
        f"{draws} draws of the posterior, each stable in every loading mode over the measured range, each a complete "
        f"material including the discrepancy in the energy. Bulk modulus: {settings.bulk_ratio:g} times the draw's "
        "initial shear modulus.",
        f"{len(mesh.cells)} {mesh.words} with one pressure and "
        "one volume each (mean dilatation), FElupe's; Newton's method with load steps that are halved where it fails."
        f"{finer}",
        *_first_order(simulation),
        "Numbers after ± are bootstrap standard errors from the number of draws. "
        f"{simulation.seconds:.0f} s of one processor.",
    )
    names = {"distance": case.travel_name, "press": "set that is pressed"}
    sizes = [
        [names.get(name, name).replace("_", " "), _size(name, value, case.travel_unit)]
        for name, value in vars(case).items()
        if value
    ]
    return (*sections, Section("How it was computed", (computed, Table(["size", "value"], sizes))))


def _first_order(simulation: Simulation) -> Iterator[str]:
    """Yield which draws were not computed in full, and the error of their forces."""
    if COMPLETE in simulation.first_order_error:
        in_full = int(simulation.in_full.sum())
        force, mean, sd = (f"{100 * of_steps[-1]:.2g} %" for of_steps in simulation.first_order_error[COMPLETE])
        yield (
            f"{in_full} draws were computed in full, those whose forces say most of the others'; these follow to first "
            "order from the deformation of the draw in the middle, corrected by those in full. Found from each of them "
            f"left out, the error of such a force is {force} at the last step, that of the mean of all draws {mean}, "
            f"and that of their sd {sd}. Fields, and what is strained beyond the measurements, are of the draws in "
            "full alone."
        )


def _size(name: str, value: float | str | dict[str, str], unit: str) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key}: {word}" for key, word in value.items())
    if isinstance(value, str):
        return value
    return f"{value:g}" if name in ("fineness", "parts") else f"{value:g} {unit}"


def _lead(simulation: Simulation, bands: Bands) -> str:
    """Return the finding in a sentence or two."""
    case, last, unit = simulation.case, bands.last, bands.unit
    mean, _, ends = bands.band(last)
    article, travel = "an" if case.travel_name[0] in "aeiou" else "a", case.shown(last[case.travel_column])
    text = f"At {article} {case.travel_name} of {travel} the {case.response} is {mean} {unit}"
    text += f" ({percent_of(last['draws'])}: {ends} {unit})."
    if WITHOUT in simulation.forces:
        without, _, without_ends = bands.band(last, "without_")
        text += f" Without discrepancy it is {without} {unit} ({without_ends} {unit})."
    return text
