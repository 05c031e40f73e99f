"""Tables in the terminal."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tissuq.errors import InputError
from tissuq.report.answer import ANSWER, numbers_of, readable_estimates, shown_and_folded
from tissuq.report.run_folder import ASSESSMENT, HELD_OUT_TESTS, RECIPE
from tissuq.report.tables import headline_of
from tissuq.report.terminal import (
    print_explanations,
    print_next,
    print_numbers,
    print_rows,
    print_uses,
    print_warnings,
)
from tissuq.report.writer import contents_for_programs
from tissuq.result_warning import Severity
from tissuq.studies.settings import DAMAGE, damage_reported, load_settings

if TYPE_CHECKING:
    from tissuq.experiments.experiment import Experiment

__all__ = ["print_json", "print_summary"]

SUMMARY = "summary.json"


def print_summary(folder: Path, experiment: Experiment | None = None, *, details: bool = False) -> None:
    """Print the answer of a run folder, its summary where that says more, and where its report lies.

    Parameters
    ----------
    folder : Path
    experiment : Experiment, optional
        The measurements of the run, which are otherwise read from its folder.
    details : bool
        Everything: the summary of a single formulation, to what extent the material is wrong, and all warnings.

    Raises
    ------
    InputError
        When the folder is not that of a complete run.
    """
    from tissuq.model.tolerances import ESTIMANDS

    if not folder.exists():
        raise InputError(f"there is no folder '{folder}'.")
    try:
        answer = _answer(folder)
        rows, readable, unit, title = _read_run(folder, experiment)
        headers, cells, has_stability = _summary_cells(rows, readable, unit)
    except (OSError, *DAMAGE) as error:
        raise InputError(
            f"'{folder}' is not the folder of a complete run of tissuq fit or paper: {SUMMARY}, {ANSWER} or {RECIPE} "
            "is missing, damaged or that of another command, whose page is report.html."
        ) from error
    folded: list[dict[str, str]] = []
    if answer is not None:
        shown, folded = shown_and_folded(answer)
        shown += folded * details
        print_warnings([warning["text"] for warning in shown if warning["severity"] == Severity.PROBLEM])
        _print_answer(answer, folder)
        print_warnings([warning["text"] for warning in shown if warning["severity"] != Severity.PROBLEM])
    if rows[0].get("noise_lag"):
        print(f"The errors of consecutive measurements are correlated (lag-1 correlation {rows[0]['noise_lag']:.2f}).")
    if answer is None or details or len(rows) > 1:
        print_rows(title, headers, cells)
        if answer is None and rows[0].get("estimand") in ESTIMANDS:
            print(f"The intervals are of {ESTIMANDS[rows[0]['estimand']].description}.")
        _print_legend(headline_of(rows[0]), has_stability)
    if details:
        _print_assessment(folder / ASSESSMENT)
    _print_held_out(folder / HELD_OUT_TESTS, headline_of(rows[0]), unit)
    if answer is not None and not details:
        count = f", further warnings and notes ({len(folded)})" if folded else ""
        print(f"Stability, shares, weights{count}: tissuq show {shlex.quote(str(folder))} --details")
    print(f"Report: {folder / 'report.html'}")


def print_json(folder: Path) -> None:
    """Print all that a run says as one JSON object: what its JSON files hold, by their names.

    Raises
    ------
    InputError
        When the folder is not that of a complete run.
    """
    print(json.dumps(contents_for_programs(folder), indent=2))


def _answer(folder: Path) -> dict[str, Any] | None:
    """Return the answer of a run, or None of one that has none, such as the study of the paper."""
    path = folder / ANSWER
    if not path.exists():
        return None
    answer: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    readable_estimates(answer)  # complains of what is damaged
    return answer


def _print_answer(answer: dict[str, Any], folder: Path) -> None:
    """Print the numbers with their intervals, for what they can be used, and what to do next."""
    print(f"\n{answer['title']}")
    print_numbers(numbers_of(answer))
    print(f"  The intervals are of {answer['meaning']}.\n")
    print_uses(answer["uses"])
    print_next(answer["next"], folder)


def _summary_cells(
    rows: list[dict[str, Any]], readable: list[dict[str, Any]], unit: str
) -> tuple[list[str], list[list[str]], bool]:
    """Return headers and cells of the summary, and whether it tells of stability."""
    has_verdict = any(row["contains_truth"] is not None for row in rows)
    is_sampled = any(row["rhat"] is not None for row in rows)
    has_stability = any(row["stable"] for row in readable)
    headers = ["formulation", f"{headline_of(rows[0])}, {unit}", "sd", "HPD low", "high"]
    headers += ["log ev.", "in band", "alone"] + ["stable", "lost at stretch"] * has_stability
    headers += ["truth"] * has_verdict + ["R-hat", "ESS"] * is_sampled
    table = []
    for row in readable:
        cells = [row["formulation"], row["mean"], row["sd"], row["low"], row["high"], row["log_evidence"]]
        cells += [row["coverage"], row["coverage_model_only"]] + [row["stable"], row["lost_at"]] * has_stability
        cells += [{True: "yes", False: "no", None: ""}[row["contains_truth"]]] * has_verdict
        table.append(cells + [row["rhat"], row["ess"]] * is_sampled)
    return headers, table, has_stability


def _print_legend(headline: str, has_stability: bool) -> None:
    """Print what the columns of the summary mean."""
    print(
        "HPD: 95 %. In band, alone: share of measurements inside the 95 % band with the discrepancy, and inside that "
        "of the material alone."
    )
    if has_stability:
        print(
            "Stable: probability of stability over the measured stretches. Lost at stretch: median [95 %] of the draws "
            "that become unstable. All loading modes: stability.csv."
        )
    print(f"A good predictive check does not mean that {headline} is right.")


def _print_assessment(path: Path) -> None:
    """Print to what extent the material is wrong, if the run has one assessment."""
    with damage_reported(path):
        assessments = json.loads(path.read_text(encoding="utf-8")) if path.exists() else []
        sentences = list(map(str, assessments[0]["sentences"])) if len(assessments) == 1 else []
    if sentences:
        print("\nTo what extent the material is wrong:")
        print_explanations(sentences)
        print()


def _print_held_out(path: Path, headline: str, unit: str) -> None:
    """Print how each test is predicted from the others, if requested."""
    if not path.exists():
        return
    from tissuq.experiments.units import stress_unit
    from tissuq.report.tables import HELD_OUT, HELD_OUT_HEADLINE, in_mpa, readable_held_out

    with damage_reported(path):
        rows = json.loads(path.read_text(encoding="utf-8"))
        rows = in_mpa(rows, [f"{headline}_{name}" for name in HELD_OUT_HEADLINE])
        cells = [list(map(str, row)) for row in readable_held_out(rows, headline, stress_unit(unit))]
    print_rows("Each test predicted from the others", [*HELD_OUT, f"{headline} of the others, {unit}"], cells)


def _read_run(
    folder: Path, experiment: Experiment | None
) -> tuple[list[dict[str, Any]], list[dict[str, Any]], str, str]:
    """Return the rows of the summary, the same for people, the unit of stress and a title."""
    import tomllib

    from tissuq.experiments.units import stress_unit
    from tissuq.report.tables import headline_columns, in_mpa, readable_summary
    from tissuq.studies.specimen import SpecimenSettings

    unit, title = stress_unit("MPa"), "The study of the paper: neo-Hookean C10 under seven formulations"
    rows = json.loads((folder / SUMMARY).read_text(encoding="utf-8"))
    if not rows:
        raise ValueError("the summary has no rows")
    rows = in_mpa(rows, headline_columns(rows[0]))
    recipe = tomllib.loads((folder / RECIPE).read_text(encoding="utf-8"))
    if "file" in recipe or "tests" in recipe:
        settings = load_settings(SpecimenSettings, folder / RECIPE, {})
        experiment = experiment or settings.experiment(folder)
        unit = stress_unit(experiment.stress_unit)
        title = f"{experiment.name}: {settings.material} with model uncertainty"
    return rows, readable_summary(rows, unit), unit.name, title
