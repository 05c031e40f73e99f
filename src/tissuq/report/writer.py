"""Writes a `Result` into a run folder: its files, figures, recipe, record and page; and reads the record again."""

from __future__ import annotations

import json
import shlex
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args, get_origin, get_type_hints, is_typeddict

from tissuq.errors import InputError
from tissuq.report.result import RESULT, Record, Result, few_and_others
from tissuq.report.run_folder import write_figures, write_page, write_recipe
from tissuq.report.tables import Row, rows_of, write_csv, write_json
from tissuq.studies.settings import DATA, RECIPE, damage_reported

if TYPE_CHECKING:
    from tissuq.experiments.experiment import Experiment
    from tissuq.experiments.units import StressUnit
    from tissuq.posterior.posterior import Posterior

MAX_RUNS_NAMED = 5
"""Runs that a message names of a folder that holds several."""


def write_result(result: Result, folder: Path, *, figures: bool = True, target: Path | None = None) -> Record:
    """Write a result into a folder, whose earlier figures go; return its record.

    Parameters
    ----------
    result : Result
    folder : Path
        Empty, or that of a campaign with its recipe.
    figures : bool
        Draw them, too.
    target : Path, optional
        Where the folder will lie, as its page calls it, if not where it is.
    """
    verb, _, options = result.command.partition(" ")
    command = " ".join(filter(None, [verb, "" if figures else "--no-figures", options]))
    if result.recipe is not None:
        write_recipe(folder, command, result.recipe, result.without)
    for name, content in result.files.items():
        _write(folder / name, content)
    shutil.rmtree(folder / "figures", ignore_errors=True)
    pictures = {picture.name: picture.drawn() for picture in result.pictures} if figures else {}
    if pictures:
        write_figures(folder, pictures)
    record = result.record()
    write_json(folder / RESULT, record)
    shown, folded = few_and_others(record)
    of_chart = result.picture.chart if figures and result.picture is not None else None
    write_page(folder, result=result, record=record, shown=shown, others=folded, command=command,
               run=shlex.quote(str(target or folder)),
               chart_data=of_chart() if of_chart else None)  # fmt: skip
    return record


def _write(path: Path, content: Any) -> None:
    """Write what stands in a file: rows, a table of pandas, text, bytes, a copy, or what a function writes there."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if callable(content):
        content(path)
    elif isinstance(content, Path):
        shutil.copyfile(content, path)
    elif isinstance(content, bytes):
        path.write_bytes(content)
    elif isinstance(content, str):
        path.write_text(content, encoding="utf-8", errors="surrogateescape")
    elif hasattr(content, "to_csv"):
        content.to_csv(path, index=False)
    elif path.suffix == ".csv":
        write_csv(path, content)
    else:
        write_json(path, content)


def read_record(folder: Path) -> Record:
    """Return the record of a result in a run folder.

    Raises
    ------
    InputError
        When there is none, or it is damaged.
    """
    path = folder / RESULT
    if not path.exists():
        raise _without_record(folder)
    with damage_reported(path):
        content = json.loads(path.read_text(encoding="utf-8"))
        if not _is_of(content, Record):
            raise ValueError("something else than a record")
        record: Record = content
        return record


def _is_of(value: Any, kind: Any) -> bool:
    """Return whether what was read has all that a type says."""
    if is_typeddict(kind):
        hints = get_type_hints(kind)
        return isinstance(value, dict) and all(name in value and _is_of(value[name], hints[name]) for name in hints)
    if get_origin(kind) is list:
        return isinstance(value, list) and all(_is_of(item, get_args(kind)[0]) for item in value)
    return isinstance(value, kind)


def contents_for_programs(folder: Path) -> dict[str, Any]:
    """Return all JSON files in a run folder, by the stems of their names, with the folder named in what to do next.

    Raises
    ------
    InputError
        When the folder holds no run, or a file of it is damaged.
    """
    contents = {}
    for path in sorted(folder.glob("*.json")) if (folder / RECIPE).exists() or (folder / RESULT).exists() else ():
        with damage_reported(path):
            contents[path.stem] = json.loads(path.read_text(encoding="utf-8"))
            if path.name == RESULT:
                step = str(contents[path.stem]["next"])
                contents[path.stem]["next"] = step.replace("{run}", shlex.quote(str(folder)))
    if not contents:
        raise _without_record(folder)
    return contents


def _without_record(folder: Path) -> InputError:
    if not folder.exists():
        return InputError(f"there is no folder '{folder}'.")
    from tissuq.studies.stream import RESULTS

    recipe, runs = folder / RECIPE, sorted(folder.glob(f"*/{RESULT}"))
    further = ""
    if (folder / RESULTS).is_file():
        further = f" It was stopped: the command that began it, with --out {shlex.quote(str(folder))}, goes on."
    elif recipe.is_file():
        further = f" If an earlier version made it, make it again, as the first line of '{recipe}' says."
    elif runs:
        names = ", ".join(shlex.quote(str(path.parent)) for path in runs[:MAX_RUNS_NAMED])
        further = f" Runs in it: {names}{' and others' if len(runs) > MAX_RUNS_NAMED else ''}."
    return InputError(f"'{folder}' is not the folder of a complete run: {RESULT} is missing.{further}")


def data_file(experiment: Experiment, unit: StressUnit | None = None) -> dict[str, Any]:
    """Return data.csv with the measurements as fitted, in full precision: stretch and engineering stress.

    In MPa unless said. Of several tests with the name of each and its mode, and with direction and condition where
    these are said.
    """
    end, to_mpa = ("", 1.0) if unit is None else (f" [{unit.name}]", unit.to_mpa)
    stated = [name for name in ("direction", "condition") if any(getattr(curve, name) for curve in experiment.curves)]
    several, has_errors = len(experiment.curves) > 1, experiment.standard_error.any()
    rows: list[Row] = []
    for curve in experiment.curves:
        labels: Row = {"test": curve.name, "mode": curve.mode.name, "measured": curve.quantity} if several else {}
        columns = {"stretch": curve.abscissa, f"stress{end}": curve.stress / to_mpa}
        columns |= {f"standard_error{end}": curve.standard_error / to_mpa} if has_errors else {}
        rows += rows_of(columns, labels | {name: getattr(curve, name) for name in stated})
    return {DATA: rows}


def posterior_files(posteriors: Mapping[str, Posterior], suffix: str = "") -> dict[str, Callable[[Path], object]]:
    """Return posteriors as files of a result."""
    return {f"posterior/{name}{suffix}.nc": posterior.save for name, posterior in posteriors.items()}
