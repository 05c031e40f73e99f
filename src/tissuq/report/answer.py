"""The answer of a fit as a file, for the head of its page and for the terminal: numbers, uses, next step, warnings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from tissuq.assessment.answer import Answer, Verdict
from tissuq.experiments.units import StressUnit
from tissuq.report.tables import interval
from tissuq.result_warning import ResultWarning, Severity

__all__ = ["ANSWER", "answer_record", "readable_estimates", "shown_and_folded"]

ANSWER = "answer.json"
"""The file with the answer of a fit."""
MAX_SHOWN = 3
"""Warnings that are shown at once; notes and the others are counted and folded."""


def answer_record(
    title: str, formulation: str, answer: Answer, unit: StressUnit, warnings: Sequence[ResultWarning]
) -> dict[str, Any]:
    """Return the answer of one formulation in a unit of stress, with all warnings of the run, in the form of a shell.

    Parameters
    ----------
    title : str
        What was fitted.
    formulation : str
        The discrepancy whose posterior answers.
    answer : Answer
    unit : StressUnit
    warnings : sequence of ResultWarning
        The severest first.
    """
    return {
        "title": title,
        "formulation": formulation,
        "meaning": answer.meaning,
        "unit": unit.name,
        "estimates": [
            {
                "name": estimate.name,
                "mean": estimate.mean / unit.to_mpa,
                "hdi_low": estimate.low / unit.to_mpa,
                "hdi_high": estimate.high / unit.to_mpa,
            }
            for estimate in answer.estimates
        ],
        "uses": [use._asdict() for use in answer.uses],
        "next": answer.next_step.shell,
        "warnings": [{"code": w.code, "severity": w.severity, "text": w.shell} for w in warnings],
    }


def readable_estimates(record: dict[str, Any]) -> list[dict[str, str]]:
    """Return name, value and interval of every estimate as text, rounded by the width of the interval."""
    readable = []
    for estimate in record["estimates"]:
        mean, low, high = (float(estimate[name]) for name in ("mean", "hdi_low", "hdi_high"))
        spread = (high - low) / 4
        ends = interval(low, high, spread)
        value = f"{interval(mean, mean, spread)[0]} {record['unit']}"
        readable.append({"name": str(estimate["name"]), "value": value, "interval": f"{ends[0]} to {ends[1]}"})
    return readable


def numbers_of(record: dict[str, Any]) -> list[dict[str, str]]:
    """Return every estimate as a number of the terminal: ``name``, ``text`` and ``remark``."""
    return [
        {"name": estimate["name"], "text": estimate["value"], "remark": f"95 % interval {estimate['interval']}"}
        for estimate in readable_estimates(record)
    ]


def shown_and_folded(record: dict[str, Any]) -> tuple[list[dict[str, str]], list[dict[str, str]]]:
    """Return the warnings to show at once, problems in any case, and the others; they are in order of severity.

    Notes are folded where the modulus can be reported; otherwise one of them may say why not.
    """
    warnings: list[dict[str, str]] = record["warnings"]
    severities = [warning["severity"] for warning in warnings]
    is_reportable = record["uses"][0]["verdict"] == Verdict.YES
    problems, notes = severities.count(Severity.PROBLEM), severities.count(Severity.NOTE) if is_reportable else 0
    count = min(max(MAX_SHOWN, problems), len(warnings) - notes)
    return warnings[:count], warnings[count:]
