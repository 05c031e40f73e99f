"""The tables of a run: its rows as numbers, and as text rounded in the unit of the data."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence
from math import floor, isfinite, isnan, log10
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tissuq.assessment.stability import MIN_LOSS_PROBABILITY
from tissuq.experiments.units import StressUnit, stress_unit
from tissuq.posterior.labelled import summaries, summaries_in

if TYPE_CHECKING:
    from tissuq.model.tolerances import Tolerances
    from tissuq.posterior.posterior import Posterior

__all__ = [
    "headline_columns",
    "headline_of",
    "in_mpa",
    "in_unit_of",
    "known_number",
    "parameter_rows",
    "readable_held_out",
    "readable_methods",
    "readable_parameters",
    "readable_stability",
    "readable_summary",
    "significant",
    "stability_cells",
    "stability_rows",
    "summary_row",
    "tolerances_in_words",
    "with_named_units",
    "write_csv",
    "write_json",
]

Row = dict[str, Any]

STABILITY = ("stable", "lost_at", "lost_at_low", "lost_at_high")


def summary_row(formulation: str, posterior: Posterior, seconds: float, truth: float | None = None) -> Row:
    """Return the row of one formulation, C10 (or the material's first parameter) in MPa; empty what it has not."""
    symbol = posterior.model.headline
    numbers = summaries(posterior.solution, parameters=[symbol])[symbol]
    low, high = float(numbers["hdi_low"]), float(numbers["hdi_high"])
    return {
        "formulation": formulation,
        f"{symbol}_mean": float(numbers["mean"]),
        f"{symbol}_sd": float(numbers["sd"]),
        f"{symbol}_hdi_low": low,
        f"{symbol}_hdi_high": high,
        "contains_truth": None if truth is None else low <= truth <= high,
        "log_evidence": posterior.log_evidence,
        "predictive_coverage": posterior.predictive_coverage(),
        "predictive_coverage_model_only": posterior.predictive_coverage(discrepancy=False),
        "rhat": float(numbers["rhat"]) if "rhat" in numbers else None,
        "ess": float(numbers["ess"]) if "ess" in numbers else None,
        "seconds": seconds,
    }


def headline_columns(row: Row) -> list[str]:
    """Return the columns of a row that begin with its headline parameter, in whose unit they are."""
    return [name for name in row if name.startswith(f"{headline_of(row)}_")]


def headline_of(row: Row) -> str:
    """Return the parameter whose posterior the row of a formulation gives."""
    names = [name.removesuffix("_mean") for name in row if name.endswith("_mean")]
    if not names:
        raise KeyError("the row names no parameter")
    return names[0]


UNIT = "unit"
"""What rows call the unit of their stresses; without it these are in MPa."""


def in_unit_of(rows: Sequence[Row], columns: Sequence[str], unit: StressUnit) -> list[Row]:
    """Return rows whose columns in MPa are in another unit, which stands among them."""
    return [_divided(row, columns, unit.to_mpa) | {UNIT: unit.name} for row in rows]


def in_mpa(rows: Sequence[Row], columns: Sequence[str]) -> list[Row]:
    """Return rows of a file with these columns in MPa, in which earlier files have them without saying so."""
    return [_divided(row, columns, 1 / stress_unit(row[UNIT]).to_mpa) if UNIT in row else row for row in rows]


def with_named_units(rows: Sequence[Row], columns: Sequence[str], unit: StressUnit) -> list[Row]:
    """Return rows whose columns in MPa are in another unit, which stands in the names of these columns."""
    names = {name: f"{name} [{unit.name}]" for name in columns}
    return [
        {names.get(name, name): value for name, value in row.items() if name != UNIT}
        for row in in_unit_of(rows, columns, unit)
    ]


def _divided(row: Row, columns: Sequence[str], divisor: float) -> Row:
    return {name: value / divisor if name in columns and value is not None else value for name, value in row.items()}


def parameter_rows(posteriors: Mapping[str, Posterior]) -> list[Row]:
    """Return mean, sd, median and 95 % HPD of every parameter of every formulation, with its unit and prior."""
    rows = []
    for formulation, posterior in posteriors.items():
        unit = posterior.unit()
        table = summaries_in(unit, posterior.solution)
        for parameter in posterior.model.parameters:
            numbers, prior = table[parameter.symbol], posterior.model.priors[parameter.symbol]
            rows.append(
                {
                    "formulation": formulation,
                    "parameter": parameter.symbol,
                    "unit": unit.name if parameter.unit else "",
                    "prior": str(prior.scaled(1 / unit.to_mpa) if parameter.unit else prior),
                    **{name: known_number(numbers[name]) for name in ("mean", "sd", "median", "hdi_low", "hdi_high")},
                    "rhat": float(numbers["rhat"]) if "rhat" in numbers else None,
                    "ess": float(numbers["ess"]) if "ess" in numbers else None,
                }
            )
    return rows


def stability_rows(posteriors: Mapping[str, Posterior]) -> list[Row]:
    """Return how far every formulation is stable in every loading mode, where its energy tells."""
    rows = []
    for formulation, posterior in posteriors.items():
        for mode, stable_range in posterior.stable_ranges.items():
            row: Row = {
                "formulation": formulation,
                "mode": mode,
                "stretch_low": stable_range.low,
                "stretch_high": stable_range.high,
            }
            row |= {
                "stable": stable_range.probability,
                "surely_low": stable_range.surely_low,
                "surely_high": stable_range.surely_high,
            }
            for side, loss in (("below", stable_range.loss_below), ("above", stable_range.loss_above)):
                row |= {f"lost_{side}_{name}": known_number(value) for name, value in loss._asdict().items()}
            rows.append(row)
    return rows


def stability_cells(posterior: Posterior) -> Row:
    """Return how probable stability is over the measured stretches, and where it is lost, likelier below or above one.

    None where it is hardly ever lost.
    """
    modes = [mode.name for mode in posterior.model.experiment.modes]
    ranges = [stable_range for name, stable_range in posterior.stable_ranges.items() if name in modes]
    lowest = min(ranges, key=lambda stable_range: stable_range.probability, default=None)
    if lowest is None:
        return dict.fromkeys(STABILITY)
    losses = lowest.loss[1:] if lowest.loss.probability > MIN_LOSS_PROBABILITY else (None, None, None)
    return dict(zip(STABILITY, (lowest.probability, *losses), strict=True))


def known_number(number: float) -> float | None:
    """Return a number, None for one that is missing."""
    return None if number != number else float(number)


def write_csv(path: Path, rows: list[Row]) -> None:
    """Write rows as CSV; floats in full, nothing for None."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def write_json(path: Path, content: Sequence[Row] | Mapping[str, Any]) -> None:
    """Write rows, or one record, as JSON, which knows neither nan nor infinity: null stands for both."""
    path.write_text(json.dumps(_finite(content), indent=2, allow_nan=False) + "\n", encoding="utf-8")


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _finite(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not isfinite(value) else value


HELD_OUT_HEADLINE = ("median", "hdi_low", "hdi_high")
"""What is said of the headline parameter from the other tests."""
HELD_OUT = ["formulation", "test left out", "measured", "inside band", "extrapolated", "band ±", "off by"]
"""What `readable_held_out` gives, before the headline parameter."""


def significant(value: float | None, digits: int = 3) -> str:
    """Return a number for people: some significant digits, no exponent where none is needed."""
    if value is None:
        return ""
    text = f"{value:.{digits}g}"
    return f"{float(text):,.0f}" if "e+0" in text and abs(value) < 1e6 else text


def interval(low: float, high: float, sd: float) -> tuple[str, str]:
    """Return the ends of an interval with the decimals that its width supports."""
    decimals = max(0, 1 - floor(log10(sd))) if sd > 0 else 3
    if decimals > 8:
        return f"{low:.3g}", f"{high:.3g}"
    low, high = (round(end, decimals) + 0.0 for end in (low, high))  # no minus before a zero
    return f"{low:.{decimals}f}", f"{high:.{decimals}f}"


def readable_summary(rows: list[Row], unit: StressUnit) -> list[Row]:
    """Return the rows of a summary as text, C10 (or the material's first parameter) in the given unit."""
    readable = []
    for row in rows:
        mean, sd, low, high = (
            row[f"{headline_of(row)}_{key}"] / unit.to_mpa for key in ("mean", "sd", "hdi_low", "hdi_high")
        )
        ends = interval(low, high, sd)
        readable.append(
            {
                "formulation": row["formulation"],
                "mean": interval(mean, mean, sd)[0],
                "sd": interval(sd, sd, sd)[0],
                "low": ends[0],
                "high": ends[1],
                "contains_truth": row["contains_truth"],
                "log_evidence": "" if row["log_evidence"] is None else f"{row['log_evidence']:.2f}",
                "coverage": f"{row['predictive_coverage']:.0%}",
                "coverage_model_only": f"{row['predictive_coverage_model_only']:.0%}",
                "stable": _percent(row.get("stable")),
                "lost_at": _place(*(row.get(name) for name in ("lost_at", "lost_at_low", "lost_at_high"))),
                "rhat": "" if row["rhat"] is None else f"{row['rhat']:.3f}",
                "ess": "" if row["ess"] is None else f"{row['ess']:.0f}",
                "seconds": f"{row['seconds']:.2f}",
            }
        )
    return readable


def readable_stability(rows: list[Row]) -> list[list[str]]:
    """Return the rows of stability as text; empty where it is hardly ever lost."""
    return [
        [
            row["formulation"],
            row["mode"],
            f"{row['stretch_low']:.3g} to {row['stretch_high']:.3g}",
            _percent(row["stable"]),
            *(
                _place(*(row[f"lost_{side}_{name}"] for name in ("median", "low", "high")))
                if row[f"lost_{side}_probability"] > MIN_LOSS_PROBABILITY
                else ""
                for side in ("below", "above")
            ),
        ]
        for row in rows
    ]


def _percent(probability: float | None) -> str:
    return "" if probability is None else f"{probability:.0%}"


def _place(median: float | None, low: float | None, high: float | None) -> str:
    """Return a stretch with its interval."""
    return "" if median is None else f"{median:.3g} [{low:.3g}, {high:.3g}]"


def readable_methods(posteriors: Mapping[str, Posterior]) -> dict[str, str]:
    """Return, for every formulation, by which method it was computed, how accurately, and whether it converged."""
    texts = {}
    for formulation, posterior in posteriors.items():
        diagnostics, error = posterior.diagnostics, posterior.log_evidence_error
        text = f"method {posterior.method}. {posterior.how}."
        if error is not None:
            text += f" Error of the log evidence: {error:.0e}."
        texts[formulation] = text if diagnostics is None else f"{text} {diagnostics.verdict}"
    return texts


def readable_parameters(posteriors: Mapping[str, Posterior], unit: StressUnit) -> list[list[str]]:
    """Return rows of formulation, parameter, unit, prior, median, mean, sd and interval as text."""
    rows = []
    for formulation, posterior in posteriors.items():
        for symbol, numbers in summaries(posterior.solution).items():
            parameter = next(p for p in posterior.model.parameters if p.symbol == symbol)
            is_stress = parameter.unit == "MPa"
            factor = unit.to_mpa if is_stress else 1.0
            mean, sd, median, low, high = (
                float(numbers[key]) / factor for key in ("mean", "sd", "median", "hdi_low", "hdi_high")
            )
            spread = (high - low) / 4 if isnan(sd) else sd
            ends = interval(low, high, spread)
            moments = ["–", "–"] if isnan(sd) else [interval(mean, mean, sd)[0], interval(sd, sd, sd)[0]]
            prior = str(posterior.model.priors[parameter.symbol].scaled(1 / factor))
            name = unit.name if is_stress else ""
            row = [formulation, parameter.symbol, name, prior, interval(median, median, spread)[0], *moments]
            rows.append([*row, f"[{ends[0]}, {ends[1]}]"])
    return rows


def readable_held_out(rows: Sequence[Row], headline: str, unit: StressUnit) -> list[list[str]]:
    """Return how every test is predicted from the others, as cells for people."""
    cells = []
    for row in rows:
        median, low, high = (significant(row[f"{headline}_{name}"] / unit.to_mpa) for name in HELD_OUT_HEADLINE)
        shares = [_share(row[name]) for name in ("inside", "beyond", "half_width", "error")]
        cells.append([row["formulation"], row["test"], row["measured"], *shares, f"{median} [{low}, {high}]"])
    return cells


def _share(value: float | None) -> str:
    return "" if value is None else f"{value:.0%}"


def tolerances_in_words(tolerances: Tolerances, unit: StressUnit) -> str:
    """Return the standard deviations of the errors of whole tests in words; empty if there are none."""
    texts = []
    for error, size in tolerances:
        value = f"{size / unit.to_mpa:.3g} {unit.name}" if error.is_stress else f"{size:.3g}"
        texts.append(f"{value} {error.description}")
    return ", ".join(texts)
