"""The tables of a run: one row a formulation, and one row a parameter."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tissuq.assessment.stability import LOST
from tissuq.posterior import Posterior

__all__ = [
    "headline_of",
    "parameter_rows",
    "stability_cells",
    "stability_rows",
    "summary_row",
    "write_csv",
    "write_json",
]

Row = dict[str, Any]

STABILITY = ("stable", "lost_at", "lost_at_low", "lost_at_high")


def summary_row(formulation: str, posterior: Posterior, seconds: float, truth: float | None = None) -> Row:
    """Return the row of one formulation, C10 (or the material's first parameter) in MPa; empty what it has not."""
    symbol = posterior.model.headline
    found = posterior.summary().to_dict("index")[symbol]
    low, high = float(found["hdi_low"]), float(found["hdi_high"])
    return {
        "formulation": formulation,
        f"{symbol}_mean": float(found["mean"]),
        f"{symbol}_sd": float(found["sd"]),
        f"{symbol}_hdi_low": low,
        f"{symbol}_hdi_high": high,
        "contains_truth": None if truth is None else low <= truth <= high,
        "log_evidence": posterior.log_evidence,
        "predictive_coverage": posterior.predictive_coverage(),
        "predictive_coverage_model_only": posterior.predictive_coverage(discrepancy=False),
        "rhat": float(found["rhat"]) if "rhat" in found else None,
        "ess": float(found["ess"]) if "ess" in found else None,
        "seconds": seconds,
    }


def headline_of(row: Row) -> str:
    """Return the parameter whose posterior the row of a formulation gives."""
    names = [name.removesuffix("_mean") for name in row if name.endswith("_mean")]
    if not names:
        raise KeyError("the row names no parameter")
    return names[0]


def parameter_rows(posteriors: Mapping[str, Posterior]) -> list[Row]:
    """Return mean, sd, median and 95 % HPD of every parameter of every formulation, with its unit and prior."""
    rows = []
    for formulation, posterior in posteriors.items():
        table = posterior.summary().to_dict("index")
        for parameter in posterior.model.parameters:
            numbers = table[parameter.symbol]
            rows.append(
                {
                    "formulation": formulation,
                    "parameter": parameter.symbol,
                    "unit": parameter.unit,
                    "prior": str(posterior.model.priors[parameter.symbol]),
                    **{name: _known(numbers[name]) for name in ("mean", "sd", "median", "hdi_low", "hdi_high")},
                    "rhat": float(numbers["rhat"]) if "rhat" in numbers else None,
                    "ess": float(numbers["ess"]) if "ess" in numbers else None,
                }
            )
    return rows


def stability_rows(posteriors: Mapping[str, Posterior]) -> list[Row]:
    """Return how far every formulation is stable in every loading mode, where its energy tells."""
    rows = []
    for formulation, posterior in posteriors.items():
        for mode, found in posterior.stable_ranges.items():
            row: Row = {"formulation": formulation, "mode": mode, "stretch_low": found.low, "stretch_high": found.high}
            row |= {"stable": found.probability, "surely_low": found.surely_low, "surely_high": found.surely_high}
            for side, loss in (("below", found.below), ("above", found.above)):
                row |= {f"lost_{side}_{name}": _known(value) for name, value in loss._asdict().items()}
            rows.append(row)
    return rows


def stability_cells(posterior: Posterior) -> Row:
    """Return how probable stability is over the measured stretches, and where it is lost, likelier below or above one.

    None where it is hardly ever lost.
    """
    modes = [mode.name for mode in posterior.model.experiment.modes]
    every = [found for name, found in posterior.stable_ranges.items() if name in modes]
    found = min(every, key=lambda found: found.probability, default=None)
    if found is None:
        return dict.fromkeys(STABILITY)
    places = found.loss[1:] if found.loss.probability > LOST else (None, None, None)
    return dict(zip(STABILITY, (found.probability, *places), strict=True))


def _known(number: float) -> float | None:
    return None if number != number else float(number)


def write_csv(path: Path, rows: list[Row]) -> None:
    """Write rows as CSV; floats in full, nothing for None."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def write_json(path: Path, rows: list[Row]) -> None:
    """Write rows as JSON, which knows no nan: null stands for it."""
    plain = [{name: None if value != value else value for name, value in row.items()} for row in rows]
    path.write_text(json.dumps(plain, indent=2, allow_nan=False) + "\n", encoding="utf-8")
