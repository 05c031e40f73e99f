"""Rows as people read them: numbers rounded, in the unit of the data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import floor, isnan, log10
from typing import Any

from tissuq.assessment.stability import LOST
from tissuq.experiments.units import StressUnit
from tissuq.posterior import Posterior
from tissuq.report.tables import headline_of
from tissuq.tolerances import Tolerances

__all__ = [
    "readable_held_out",
    "readable_methods",
    "readable_parameters",
    "readable_stability",
    "readable_summary",
    "significant",
    "tolerances_in_words",
]

Row = dict[str, Any]


HELD_OUT = ["formulation", "test", "measured", "inside", "beyond", "half width", "error"]
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
    """Return the rows of how far it is stable as text; no place where it is hardly ever lost."""
    return [
        [
            row["formulation"],
            row["mode"],
            f"{row['stretch_low']:.3g} to {row['stretch_high']:.3g}",
            _percent(row["stable"]),
            *(
                _place(*(row[f"lost_{side}_{name}"] for name in ("median", "low", "high")))
                if row[f"lost_{side}_probability"] > LOST
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
        found, error = posterior.diagnostics, posterior.log_evidence_error
        text = f"method {posterior.method}. {posterior.solution.reason}."
        if error is not None:
            text += f" Error of the log evidence: {error:.0e}."
        texts[formulation] = text if found is None else f"{text} {found.verdict}"
    return texts


def readable_parameters(posteriors: Mapping[str, Posterior], unit: StressUnit) -> list[list[str]]:
    """Return rows of formulation, parameter, unit, prior, median, mean, sd and interval as text."""
    rows = []
    for formulation, posterior in posteriors.items():
        for symbol, numbers in posterior.summary().iterrows():
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
    found = []
    for row in rows:
        median, low, high = (
            significant(row[f"{headline}_{name}"] / unit.to_mpa) for name in ("median", "hdi_low", "hdi_high")
        )
        shares = [_share(row[name]) for name in ("inside", "beyond", "half_width", "error")]
        found.append([row["formulation"], row["test"], row["measured"], *shares, f"{median} [{low}, {high}]"])
    return found


def _share(value: float | None) -> str:
    return "" if value is None else f"{value:.0%}"


def tolerances_in_words(tolerances: Tolerances, unit: StressUnit) -> str:
    """Return by how much whole tests may be off, in words; nothing where they may not."""
    parts = {
        "stress": f"{tolerances.stress:.3g} of the stress, as between specimens",
        "length": f"{tolerances.length:.3g} of the strain",
        "slack": f"{tolerances.slack:.3g} of stretch by slack",
        "zero": f"{tolerances.zero / unit.to_mpa:.3g} {unit.name} at rest",
        "stretch": f"{tolerances.stretch:.3g} in every single stretch",
    }
    return ", ".join(text for name, text in parts.items() if getattr(tolerances, name))
