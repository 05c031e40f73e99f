"""What the answer of a run says to what is computed with its posterior: for what it can be used, and what is wrong."""

from __future__ import annotations

import os
import shlex
from dataclasses import dataclass
from pathlib import Path

from tissuq.assessment.uses import Use, Verdict
from tissuq.errors import InputError
from tissuq.model.statistical_model import StatisticalModel
from tissuq.report.result import RESULT
from tissuq.report.writer import read_record
from tissuq.result_warning import ResultWarning, Severity
from tissuq.studies.earlier_run import answering
from tissuq.studies.settings import damage_reported

__all__ = ["Said", "said_by", "uses_of"]

SPOILING = ("not-converged", "doubtful-reading", "stress-at-rest", "tests-apart", "contradicting-tests",
            "unmodelled-curve", "measurements")  # fmt: skip
"""Codes of warnings about what a fit says of the tissue, and not about how exactly."""
SIMULATING, USE_OF_FIT = "simulate with finite elements", "use of the fit in finite elements"


@dataclass(frozen=True)
class Said:
    """What a fit says to whatever is computed with it.

    Attributes
    ----------
    use : Use or None
        Whether it serves finite elements; None where it says nothing, as a population does.
    warnings : tuple of ResultWarning
        Those that hold for it, too.
    next_step : str
    """

    use: Use | None = None
    warnings: tuple[ResultWarning, ...] = ()
    next_step: str = ""

    @property
    def advice(self) -> str:
        """What to do before it is used in finite elements; nothing where it serves them."""
        if self.use is None or self.use.verdict is not Verdict.NO:
            return ""
        return "do not use this yet" + (f"; next step of the fit: {self.next_step}" if self.next_step else "")


def said_by(run: Path, model: StatisticalModel | None = None) -> Said:
    """Return what a run folder says; nothing where there is no result in it, and no use without a model.

    Raises
    ------
    InputError
        When its result is damaged.
    """
    if not (run / RESULT).is_file():
        return Said()
    record = read_record(run)
    with damage_reported(run / RESULT):
        warnings = tuple(
            ResultWarning(warning["text"], warning["code"], Severity(warning["severity"]))
            for warning in record["warnings"]
            if warning["code"] in SPOILING and warning["severity"] != Severity.NOTE
        )
    uses = uses_of(run, model) if model else []
    of_fit = next((use._replace(purpose=USE_OF_FIT) for use in uses if use.purpose.startswith(SIMULATING)), None)
    return Said(of_fit, warnings, record["next"].replace("{run}", shlex.quote(os.path.normpath(run))))


def uses_of(run: Path, model: StatisticalModel) -> list[Use]:
    """Return the uses that a run says of a model: that of its answer, or with this law in a comparison of laws.

    Raises
    ------
    InputError
        When it has no result, or a damaged one.
    """
    record = read_record(run)
    with damage_reported(run / RESULT):
        uses = [Use(use["purpose"], Verdict(use["verdict"]), use["reason"]) for use in record["uses"]]
    try:
        is_answer = answering(run) == model.discrepancy.name
    except InputError:  # no run of tissuq fit with one law
        is_answer = False
    return [use for use in uses if is_answer or use.purpose.endswith(f", with {model.material.name}")]
