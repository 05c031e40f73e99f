"""Tables in the terminal."""

from __future__ import annotations

import json
from pathlib import Path
from textwrap import fill
from typing import Any

from tissuq.errors import InputError
from tissuq.report.run_folder import ASSESSMENT, HELD_OUT_TESTS, RECIPE
from tissuq.report.tables import headline_of

__all__ = ["print_rows", "print_summary", "print_warnings"]


def print_rows(title: str, headers: list[str], rows: list[list[str]]) -> None:
    """Print a table whose first column is text and whose others are numbers."""
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table

    table = Table(
        title=title,
        title_justify="left",
        title_style="bold",
        box=SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
        pad_edge=False,
    )
    for place, header in enumerate(headers):
        table.add_column(header, justify="right" if place else "left", no_wrap=True)
    for row in rows:
        table.add_row(*row)
    console = Console()
    needed = console.measure(table, options=console.options.update(max_width=1000)).maximum
    console.width = max(console.width, needed)  # a number cut short is no number
    console.print(table)


def print_summary(folder: Path) -> None:
    """Print the summary of a run folder, and where its report lies.

    Raises
    ------
    InputError
        When the folder is not that of a complete run.
    """
    rows, readable, unit, title = _read_run(folder)
    known = [row["contains_truth"] is not None for row in rows]
    sampled = any(row["rhat"] is not None for row in rows)
    headers = ["formulation", f"{headline_of(rows[0])}, {unit}", "sd", "HPD low", "high", "log ev.", "in band", "alone"]
    is_told = any(row["stable"] for row in readable)
    headers += ["stable", "lost at stretch"] * is_told
    headers += ["truth"] * any(known) + ["R-hat", "ESS"] * sampled
    table = []
    for row in readable:
        cells = [row["formulation"], row["mean"], row["sd"], row["low"], row["high"], row["log_evidence"]]
        cells += [row["coverage"], row["coverage_model_only"]] + [row["stable"], row["lost_at"]] * is_told
        cells += [{True: "yes", False: "no", None: ""}[row["contains_truth"]]] * any(known)
        table.append(cells + [row["rhat"], row["ess"]] * sampled)
    print_rows(title, headers, table)
    print(
        "HPD: 95 %. In band, alone: measurements inside the 95 % band with the discrepancy, and of the material alone."
    )
    if is_told:
        print(
            "Stable: probability over the measured stretches; of the draws that lose it, where: median [95 %]. "
            "All loading modes: stability.csv."
        )
    print(f"A good predictive check does not mean that {headline_of(rows[0])} is right.")
    _print_assessment(folder / ASSESSMENT)
    _print_held_out(folder / HELD_OUT_TESTS, headline_of(rows[0]), unit)
    print(f"Report: {folder / 'report.html'}")


def _print_assessment(path: Path) -> None:
    """Print to what extent the material is wrong, where one discrepancy tells it."""
    found = json.loads(path.read_text(encoding="utf-8")) if path.exists() else []
    if len(found) == 1:
        print("\nTo what extent the material is wrong:")
        for text in found[0]["sentences"]:
            print(fill(text, 96, initial_indent="- ", subsequent_indent="  "))
        print()


def _print_held_out(path: Path, headline: str, unit: str) -> None:
    """Print how every test is predicted from the others, where that was asked for."""
    if not path.exists():
        return
    from tissuq.experiments.units import stress_unit
    from tissuq.report.rows import HELD_OUT, readable_held_out

    rows = json.loads(path.read_text(encoding="utf-8"))
    cells = readable_held_out(rows, headline, stress_unit(unit))
    print_rows("Every test predicted from the others", [*HELD_OUT, f"{headline} of the others, {unit}"], cells)


def print_warnings(warnings: list[str]) -> None:
    """Print what a reader of a run must know."""
    for text in warnings:
        print(fill(text, 96, initial_indent="Note: ", subsequent_indent="      "))


def _read_run(folder: Path) -> tuple[list[dict[str, Any]], list[dict[str, Any]], str, str]:
    """Return the rows of the summary, the same for people, the unit of stress and a title."""
    import tomllib

    from tissuq.experiments.units import stress_unit
    from tissuq.report.rows import readable_summary
    from tissuq.studies.specimen import SpecimenSettings

    unit, title = stress_unit("MPa"), "The study of the paper: neo-Hookean C10 under seven formulations"
    try:
        recipe = tomllib.loads((folder / RECIPE).read_text(encoding="utf-8"))
        rows = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        if not rows:
            raise ValueError("the summary has no rows")
        if "file" in recipe or "tests" in recipe:
            settings = SpecimenSettings.model_validate(recipe)
            experiment = settings.experiment(folder)
            unit = stress_unit(experiment.stress_unit)
            title = f"{experiment.name}: {settings.material} with model uncertainty"
        return rows, readable_summary(rows, unit), unit.name, title
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"'{folder}' is not the folder of a complete run: summary.json or {RECIPE} is missing or damaged."
        ) from error
