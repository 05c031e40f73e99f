"""The result of an ensemble of a user's model: every quantity with its band, tables, curves, fields and figures."""

from __future__ import annotations

import os
import re
import shlex
import shutil
from collections.abc import Iterable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.decks import FunctionQuantity
from tissuq.decks.calculix_results import SECTORS_OF_RING
from tissuq.decks.fields import FinalFields
from tissuq.decks.model_run import FIELDS
from tissuq.decks.quantity import Component
from tissuq.decks.solver import CalculiXSolver
from tissuq.experiments.units import stress_unit
from tissuq.finite_elements.simulation import COMPLETE, FAMILIES
from tissuq.report.answer_of_run import Said, said_by
from tissuq.report.band_table import (
    LABELS,
    band_cells,
    is_mesh_free,
    largest_share,
    last_row,
    mesh_change,
    of_sources,
    percent_of,
    prefix_of,
    share_cell,
    shares_in,
)
from tissuq.report.ensemble_figures import band_over_time, quantity_figure, state_figure, write_fields
from tissuq.report.result import MAX_NUMBERS, Block, Number, Picture, Preformatted, Result, Section, Table
from tissuq.report.tables import significant
from tissuq.result_warning import merged
from tissuq.studies.ensemble import DRAWS, EnsembleStudy

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

__all__ = ["copy_functions", "ensemble_result", "readable_quantities"]

FUNCTIONS = "quantities"
"""Folder with copies of the files of the user's functions."""
MUCH_BEYOND, FEW_DRAWS = 0.2, 64
"""Share of elements beyond the measurements from which these are to be extended; draws that give a sound band."""
SHARES = (
    "Q is the quantity of a draw with its discrepancy, Q0 that of the same draw with its material parameters alone. "
    "**Parameters** is Cov(Q, Q0), **discrepancy** Cov(Q, Q − Q0); they add up to 100 % of Var Q, and a share below "
    "zero says that the two compensate each other."
)
OF_MESH = (
    "**Mesh** is the variance of the error of the correction for the size of the elements; other shares are of what "
    "is left."
)
STATES = (
    "Left: I1 − 3 and I2 − 3 of the elements at the end (of F / J^(1/3), mean over the nodes), all draws together; "
    "what was measured lies within the frame. Right: the share of elements beyond it, mean of the draws."
)
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


def ensemble_result(study: EnsembleStudy, folder: Path, beside: Path = Path()) -> Result:
    """Return what an ensemble of a user's model says; its folder holds the recipe, the model and the runs.

    The relative paths of its settings lie in ``beside``.
    """
    result, prepared = study.result, study.prepared
    tables = {name: result.table(name) for name in result.curves}
    stored = [folder / DRAWS / name / FIELDS for name in result.folders]
    fields = [FinalFields.load(path) for path in stored if path.is_file()]
    has_fields = len(fields) > 1 and find_spec("meshio") is not None
    for name in ("fields.vtu", "failures.csv"):
        (folder / name).unlink(missing_ok=True)
    limits = prepared.tasks(folder)[0].limits
    headers, rows = readable_quantities(study)
    count = len(prepared.ensembles)
    said = {
        name: said_by(beside / run, prepared.ensembles[name].model) for name, run in prepared.settings.materials.items()
    }
    quantity = next(iter(tables))
    return Result(
        command="ensemble",
        title="From the posterior into your model",
        subject=f"{prepared.deck.main} with draws of {count} material{'s' * (count > 1)} · {len(result.folders)} of "
        f"{result.draws} draws completed",
        numbers=_numbers(study, tables),
        finding=_lead(study, tables),
        uses=tuple(
            of_run.use._replace(purpose=f"{of_run.use.purpose}, {name}" if count > 1 else of_run.use.purpose)
            for name, of_run in said.items()
            if of_run.use
        ),
        next_step=_next_step(study, said.values(), folder, beside),
        picture=Picture("answer", lambda: band_over_time(tables[quantity], quantity), f"Band of {quantity} over time",
                        f"{quantity}: mean and {_headers(study, tables)[4]} band over draws of the posterior."),
        tables=(Table(headers, rows, f"Model '{prepared.deck.main}' with {result.draws} draws, at the end",
                      note=f"{_of_sector(study)} {_of_mesh(study, tables)}".strip()),),
        sections=_sections(study, tables, fields, limits, has_fields=has_fields),
        warnings=(*merged({name: of_run.warnings for name, of_run in said.items()}, named=count > 1), *study.warnings),
        files=_files(study, tables) | ({"fields.vtu": lambda path: write_fields(path, fields)} if has_fields else {}),
    )  # fmt: skip


def _numbers(study: EnsembleStudy, tables: dict[str, pd.DataFrame]) -> tuple[Number, ...]:
    """Return every quantity at the end with its band, and the largest share of the variance of the first."""
    percent, numbers = _headers(study, tables)[4], []
    for name, table in list(tables.items())[:MAX_NUMBERS]:
        row = last_row(table)
        mean, low, high = (row[f"{prefix_of(row)}{column}"] for column in ("mean", "low", "high"))
        numbers.append(Number(f"{name} at the end", mean, low, high, interval_is=f"{percent} band"))
    first_table = next(iter(tables.values()))
    return (*numbers, *largest_share(last_row(first_table), shares_in(first_table, is_shared=study.result.is_shared)))


def _next_step(study: EnsembleStudy, said: Iterable[Said], folder: Path, beside: Path) -> str:
    result = study.result
    if result.without_spread:
        names = ", ".join(result.without_spread)
        return f"see whether the model uses the material that was replaced: all draws give the same {names}."
    run, quantity = next(iter(study.prepared.settings.materials.values())), next(iter(result.curves))
    target = f"ensemble:{folder}" + f":{quantity}" * (len(result.curves) > 1)
    design = f"tissuq design {shlex.quote(os.path.normpath(beside / run))} --target {shlex.quote(target)}"
    if result.failures:
        return (
            "look at why draws failed, below. To make them again, where the solver was at fault, repeat the command "
            "with --again; a model with other increments or another mesh needs another --out."
        )
    if advice := next(filter(None, (of_run.advice for of_run in said)), ""):
        return advice
    if next(iter(study.prepared.ensembles.values())).origin:  # no test of the material was fitted that another adds to
        return "compare the band with a measurement of your own, if there is one."
    share_beyond = None if result.beyond is None else float(np.nanmean(result.beyond[1][:, -1]))
    if share_beyond is not None and share_beyond > MUCH_BEYOND:
        return f"measure up to the strains of the model: {design} says which test helps most"
    if result.draws < FEW_DRAWS:
        return f"make the band more accurate: repeat the command with --draws {FEW_DRAWS} and another --out."
    return f"see which test would make the band narrower: {design}"


def readable_quantities(study: EnsembleStudy) -> tuple[list[str], list[list[str]]]:
    """Return headers and rows of the quantities at the end as text."""
    result = study.result
    tables = {name: result.table(name) for name in result.curves}
    headers = ["quantity", *_headers(study, tables)]
    return headers, [[name, *_row(study, last_row(table))] for name, table in tables.items()]


def _files(study: EnsembleStudy, tables: dict[str, pd.DataFrame]) -> dict[str, Any]:
    """Return tables, curves, cards, summary and the changes of the deck."""
    import pandas as pd

    result, prepared = study.result, study.prepared
    frames = [table.assign(quantity=name) for name, table in tables.items()]
    everything = pd.concat(frames, ignore_index=True).drop(columns=["noise", "noise_error"], errors="ignore")
    everything.insert(0, "quantity", everything.pop("quantity"))
    elements_beyond = result.beyond
    files: dict[str, Any] = {
        "quantities.csv": everything,
        "draws.csv": _draw_rows(study),
        "model.diff": f"{prepared.diff()}\n",
        "curves.nc": bytes(_curves(study).to_netcdf(engine="h5netcdf")),
        "summary.json": {
            "model": prepared.settings.model,
            "materials": list(prepared.ensembles),
            "solver": prepared.solver.name,
            "finer_model": _finer(study),
            "draws": result.draws,
            "failed": sum(failure.family == COMPLETE for failure in result.failures),
            "quantities": {name: _plain(last_row(table)) for name, table in tables.items()},
            "measured_invariants": {name: list(ensemble.most) for name, ensemble in prepared.ensembles.items()},
            "elements_beyond": None if elements_beyond is None else float(np.nanmean(elements_beyond[1][:, -1])),
            "seconds": result.seconds,
            "cards": prepared.card_warnings,
            "warnings": study.warnings,
        },
    }
    if result.failures:
        files["failures.csv"] = [
            {**vars(item), "number": item.number + 1, "lines": " | ".join(item.lines)} for item in result.failures
        ]
    for name, cards in prepared.cards[COMPLETE].items():
        files[f"cards-{re.sub(r'[^A-Za-z0-9_-]+', '-', name)}.csv"] = [dict(row) for row in cards.index]
    return files


def _finer(study: EnsembleStudy) -> dict[str, Any] | None:
    """Return what is assumed of the mesh, and the relative changes at the end of quantities on a finer one."""
    finer = study.prepared.finer
    if finer is None:
        return None
    changes = {name: changes[-1][1] for name, changes in study.result.mesh_changes.items() if changes}
    return {
        "model": study.prepared.settings.finer_model, "draw": finer.number + 1, "cell_ratio": finer.ratio,
        "mesh_order": finer.order, "elements": finer.counts, "changes": changes,
    }  # fmt: skip


def _draw_rows(study: EnsembleStudy) -> list[dict[str, Any]]:
    """Return a row for every draw: parameters in the unit of the cards, last values, and why it failed."""
    result, ensembles, unit = study.result, study.prepared.ensembles, stress_unit(study.prepared.settings.unit)
    problems = {failure.number: failure.problem for failure in result.failures if failure.family == COMPLETE}
    rows = []
    for number in range(result.draws):
        row: dict[str, Any] = {"draw": number + 1}
        for material, ensemble in ensembles.items():
            prefix = f"{material}." if len(ensembles) > 1 else ""
            for parameter in ensemble.model.material.parameters:
                value, heading = ensemble[number].values[parameter.symbol], f"{prefix}{parameter.symbol}"
                row |= {f"{heading} [{unit.name}]": value / unit.to_mpa} if parameter.unit else {heading: value}
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


def _plain(row: dict[str, Any]) -> dict[str, Any]:
    return {key: None if value != value else float(value) for key, value in row.items() if not key.startswith("noise")}


def _headers(study: EnsembleStudy, tables: dict[str, pd.DataFrame]) -> list[str]:
    percent = percent_of(min(table["draws"].iloc[-1] for table in tables.values()))
    shares = shares_in(next(iter(tables.values())), is_shared=study.result.is_shared)
    first_table = next(iter(tables.values()))
    return ["time", "draws", "mean", "sd", percent, *(LABELS[name] for name in shares)] + (
        ["on this mesh"] * is_mesh_free(first_table)
    )


def _row(study: EnsembleStudy, row: dict[str, Any]) -> list[str]:
    cells = [f"{row['time']:.4g}", str(int(row["draws"])), *band_cells(row, prefix=prefix_of(row))]
    cells += [share_cell(row, name) for name in shares_in(row, is_shared=study.result.is_shared)]
    return [*cells, *[significant(row["mean"])] * is_mesh_free(row)]


def _of_mesh(study: EnsembleStudy, tables: dict[str, pd.DataFrame]) -> str:
    """Return what was done for the size of the elements, in sentences; nothing where nothing was."""
    finer = study.prepared.finer
    corrected = {name: last_row(table) for name, table in tables.items() if is_mesh_free(table)}
    if finer is None or not corrected:
        return ""
    sizes = ", ".join(f"{name} {mesh_change(row)}" for name, row in corrected.items())
    return (
        f"For elements without size (Richardson): at the end {sizes} beside this mesh, of which a quarter is taken as "
        f"the sd of its error, within the band. {finer.words}"
    )


def _sections(
    study: EnsembleStudy,
    tables: dict[str, pd.DataFrame],
    fields: Sequence[FinalFields],
    limits: tuple[tuple[str, tuple[float, float]], ...],
    *,
    has_fields: bool,
) -> tuple[Section, ...]:
    """Return what a page folds: every quantity, states of the material, failures, how it was computed."""
    prepared, result = study.prepared, study.result
    headers = _headers(study, tables)
    sections = [Section(f"{name} over time", _quantity(study, name, table, headers)) for name, table in tables.items()]
    if shares_in(first_table := next(iter(tables.values())), is_shared=result.is_shared):
        sentences = (*[SHARES] * result.is_shared, *[of_sources(first_table)] * bool(result.sources))
        sentences += (OF_MESH,) * is_mesh_free(first_table)
        sections.append(Section("Sources of uncertainty", sentences))
    materials = [
        [name, ensemble.model.experiment.name, ensemble.model.material.name, ensemble.model.discrepancy.name,
         f"{ensemble.most[0]:.3g}", f"{ensemble.most[1]:.3g}"]
        for name, ensemble in prepared.ensembles.items()
    ]  # fmt: skip
    columns = ["material", "data", "law", "discrepancy", "measured I1 − 3 up to", "I2 − 3 up to"]
    blocks: tuple[Block, ...] = (Table(columns, materials, text_columns=(1, 2, 3)),)
    if fields and len(fields[0].invariants):
        words = "Invariants of the elements against those measured"
        blocks = (Picture("states", lambda: state_figure(result, fields, limits), words, STATES), *blocks)
    sections.append(Section("What the model asks of the material", blocks))
    if result.failures:
        failures = tuple(
            Section(
                f"{FAMILIES[item.family]}: number {item.number + 1}, at time {item.reached:.4g}: {item.problem}",
                (Preformatted("\n".join(item.lines)),),
            )
            for item in result.failures
        )
        sections.append(Section("Draws that failed", failures))
    is_meshed = bool(_of_mesh(study, tables))
    stored = " `fields.vtu` holds mean and standard deviation of the fields at the end for ParaView." * has_fields
    computed = (
        f"{result.draws} draws of the posterior, the same and in the same order as `tissuq export` writes. Solver: "
        f"{prepared.solver.name}, `{prepared.solver.command or prepared.solver.template}`; {result.seconds:.0f} s in "
        "all.",
        *prepared.card_warnings,
        "Where the solver chose its increments draw by draw, curves are interpolated linearly between them; values at "
        "the end are its own.",
        f"The error of the model's {'' if is_meshed else 'mesh, of its '}loads and of its supports is in no number "
        f"here.{stored}",
        *[_of_mesh(study, tables)] * is_meshed,
    )
    changed = prepared.diff().encode("utf-8", "replace").decode()
    deck = Section("What was changed in the deck, for the first draw", (Preformatted(changed),))
    return (*sections, Section("How it was computed", (computed, deck)))


def _quantity(study: EnsembleStudy, name: str, table: pd.DataFrame, headers: list[str]) -> tuple[Block, ...]:
    """Return definition, figure and some times of a quantity."""
    full = table[table["draws"] > 1]
    is_shared = bool(shares_in(table, is_shared=study.result.is_shared))
    picked = full.iloc[np.unique(np.linspace(0, len(full) - 1, ROWS).round().astype(int))]
    rows = [_row(study, {str(key): value for key, value in row.items()}) for row in picked.to_dict("records")]
    quantity = next(quantity for quantity in study.prepared.quantities if quantity.name == name)
    is_function = isinstance(quantity, FunctionQuantity)  # whose file is known by its absolute name
    text = study.prepared.settings.quantities[name] if is_function else quantity.text
    shares = " Right: shares of the variance, ± one standard error (bootstrap)." * is_shared
    figure = Picture(
        f"quantity-{name}",
        lambda: quantity_figure(study.result, table, name),
        f"Band of {name} over time, and its values at the end",
        f"Left: mean and {headers[4]} band over draws of the posterior, over the time of the model. "
        f"{'Middle' if is_shared else 'Right'}: the draws at its end.{shares}",
    )  # fmt: skip
    return f"{text}, in the units of the model", figure, Table(headers, rows)


def _of_sector(study: EnsembleStudy) -> str:
    """Return of what forces are where a program computes a part of an axisymmetric body; else nothing."""
    prepared = study.prepared
    deck, quantities = prepared.deck, prepared.quantities
    has_forces = any(isinstance(quantity, Component) and quantity.kind == "RF" for quantity in quantities)
    if not (has_forces and isinstance(prepared.solver, CalculiXSolver)):
        return ""
    if not deck.format.is_axisymmetric(list(deck.files.values())):
        return ""
    return (
        f"Forces are of the sector of {360 // SECTORS_OF_RING} degrees that CalculiX computes of an axisymmetric body: "
        f"those of the whole are {SECTORS_OF_RING} times as large."
    )


def _lead(study: EnsembleStudy, tables: dict[str, pd.DataFrame]) -> str:
    """Return the finding in a sentence for each quantity."""
    percent = _headers(study, tables)[4]
    sentences = []
    for name, table in tables.items():
        row = last_row(table)
        mean, _, ends = band_cells(row, prefix=prefix_of(row))
        sentences.append(f"At time {row['time']:.4g}, {name} is {mean} ({percent}: {ends}).")
    return " ".join(sentences)
