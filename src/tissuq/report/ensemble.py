"""The result of an ensemble of a user's model: every quantity with its band, tables, curves, fields and figures."""

from __future__ import annotations

import os
import re
import shlex
import shutil
from collections.abc import Iterable, Mapping, Sequence
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
from tissuq.report.band_table import OF_RANGES, Bands, percent_of
from tissuq.report.finite_element_figures import band_over_time, quantity_figure, state_figure, write_fields
from tissuq.report.result import MAX_NUMBERS, Block, Picture, Preformatted, Result, Section, Table
from tissuq.report.source_run import Said, said_by
from tissuq.result_warning import merged
from tissuq.studies.ensemble import DRAWS, EnsembleStudy

if TYPE_CHECKING:
    import xarray as xr

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
    bands = {name: Bands(result.table(name), result.is_shared) for name in result.curves}
    stored = [folder / DRAWS / name / FIELDS for name in result.folders]
    fields = [FinalFields.load(path) for path in stored if path.is_file()]
    has_fields = len(fields) > 1 and find_spec("meshio") is not None
    for name in ("fields.vtu", "failures.csv"):
        (folder / name).unlink(missing_ok=True)
    limits = prepared.tasks(folder)[0].limits
    count = len(prepared.ensembles)
    said = {
        name: said_by(beside / run, prepared.ensembles[name].model) for name, run in prepared.settings.materials.items()
    }
    quantity, of_first = next(iter(bands.items()))
    return Result(
        command="ensemble",
        title="From the posterior into your model",
        subject=f"{prepared.deck.main} with draws of {count} material{'s' * (count > 1)} · {len(result.folders)} of "
        f"{result.draws} draws completed",
        numbers=(
            *(of_one.number(f"{name} at the end") for name, of_one in list(bands.items())[:MAX_NUMBERS]),
            *of_first.largest_share(of_first.shares),
        ),
        finding=_lead(bands),
        uses=tuple(
            of_run.use._replace(purpose=f"{of_run.use.purpose}, {name}" if count > 1 else of_run.use.purpose)
            for name, of_run in said.items()
            if of_run.use
        ),
        next_step=_next_step(study, said.values(), folder, beside),
        picture=Picture("answer", lambda: band_over_time(of_first, quantity), f"Band of {quantity} over time",
                        f"{quantity}: mean and {of_first.percent} band over draws of the posterior."),
        tables=(Table(*_at_the_end(bands), f"Model '{prepared.deck.main}' with {result.draws} draws, at the end",
                      note=f"{_of_sector(study)} {_of_mesh(study, bands)}".strip()),),
        sections=_sections(study, bands, fields, limits, has_fields=has_fields),
        warnings=(*merged({name: of_run.warnings for name, of_run in said.items()}, named=count > 1), *study.warnings),
        files=_files(study, bands) | ({"fields.vtu": lambda path: write_fields(path, fields)} if has_fields else {}),
    )  # fmt: skip


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


def _at_the_end(bands: dict[str, Bands]) -> tuple[list[str], list[list[str]]]:
    """Return headers and rows of the quantities at the end as text."""
    of_first = next(iter(bands.values()))
    percent = percent_of(min(of_one.last["draws"] for of_one in bands.values()))
    headers = ["quantity", *of_first.headers("time", "mean", percent, of_first.shares)]
    return headers, [[name, *_cells(of_one, of_one.last)] for name, of_one in bands.items()]


def _cells(bands: Bands, row: Mapping[Any, Any]) -> list[str]:
    return bands.cells(row, f"{row['time']:.4g}", bands.shares)


def _files(study: EnsembleStudy, bands: dict[str, Bands]) -> dict[str, Any]:
    """Return tables, curves, cards, summary and the changes of the deck."""
    import pandas as pd

    result, prepared = study.result, study.prepared
    frames = [of_one.table.assign(quantity=name) for name, of_one in bands.items()]
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
            "quantities": {
                name: {key: value for key, value in of_one.last.items() if not key.startswith("noise")}
                for name, of_one in bands.items()
            },
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
            for parameter in ensemble.model.material.plain.parameters:
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


def _of_mesh(study: EnsembleStudy, bands: dict[str, Bands]) -> str:
    """Return what was done for the size of the elements, in sentences; nothing where nothing was."""
    finer = study.prepared.finer
    corrected = {name: of_one.mesh_change for name, of_one in bands.items() if of_one.is_mesh_free}
    if finer is None or not corrected:
        return ""
    sizes = ", ".join(f"{name} {change}" for name, change in corrected.items())
    return (
        f"For elements without size (Richardson): at the end {sizes} beside this mesh, of which a quarter is taken as "
        f"the sd of its error, within the band. {finer.words}"
    )


def _sections(
    study: EnsembleStudy,
    bands: dict[str, Bands],
    fields: Sequence[FinalFields],
    limits: tuple[tuple[str, tuple[float, float]], ...],
    *,
    has_fields: bool,
) -> tuple[Section, ...]:
    """Return what a page folds: every quantity, states of the material, failures, how it was computed."""
    prepared, result = study.prepared, study.result
    sections = [Section(f"{name} over time", _quantity(study, name, of_one)) for name, of_one in bands.items()]
    if (of_first := next(iter(bands.values()))).shares:
        sentences = (*[SHARES] * result.is_shared, OF_RANGES, *[of_first.of_sources] * bool(result.sources))
        sentences += (OF_MESH,) * of_first.is_mesh_free
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
    is_meshed = bool(_of_mesh(study, bands))
    stored = " `fields.vtu` holds mean and standard deviation of the fields at the end for ParaView." * has_fields
    computed = (
        f"{result.draws} draws of the posterior, the same and in the same order as `tissuq export` writes. Solver: "
        f"{prepared.solver.name}, `{prepared.solver.command or prepared.solver.template}`; {result.seconds:.0f} s in "
        "all.",
        *prepared.card_warnings,
        "Where the solver chose its increments draw by draw, curves are interpolated between them by monotone cubics; "
        "values at the end are its own.",
        f"The error of the model's {'' if is_meshed else 'mesh, of its '}loads and of its supports is in no number "
        f"here.{stored}",
        *[_of_mesh(study, bands)] * is_meshed,
    )
    changed = prepared.diff().encode("utf-8", "replace").decode()
    deck = Section("What was changed in the deck, for the first draw", (Preformatted(changed),))
    return (*sections, Section("How it was computed", (computed, deck)))


def _quantity(study: EnsembleStudy, name: str, bands: Bands) -> tuple[Block, ...]:
    """Return definition, figure and some times of a quantity."""
    several, has_shares = bands.of_several, bool(bands.shares)
    picked = several.iloc[np.unique(np.linspace(0, len(several) - 1, ROWS).round().astype(int))]
    rows = [_cells(bands, row) for row in picked.to_dict("records")]
    quantity = next(quantity for quantity in study.prepared.quantities if quantity.name == name)
    is_function = isinstance(quantity, FunctionQuantity)  # whose file is known by its absolute name
    text = study.prepared.settings.quantities[name] if is_function else quantity.text
    shares = " Right: shares of the variance, ± one standard error (bootstrap)." * has_shares
    figure = Picture(
        f"quantity-{name}",
        lambda: quantity_figure(study.result, bands, name),
        f"Band of {name} over time, and its values at the end",
        f"Left: mean and {bands.percent} band over draws of the posterior, over the time of the model. "
        f"{'Middle' if has_shares else 'Right'}: the draws at its end.{shares}",
    )  # fmt: skip
    headers = bands.headers("time", "mean", bands.percent, bands.shares)
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


def _lead(bands: dict[str, Bands]) -> str:
    """Return the finding in a sentence for each quantity."""
    sentences = []
    for name, of_one in bands.items():
        mean, _, ends = of_one.band(of_one.last)
        percent = percent_of(of_one.last["draws"])
        sentences.append(f"At time {of_one.last['time']:.4g}, {name} is {mean} ({percent}: {ends}).")
    return " ".join(sentences)
