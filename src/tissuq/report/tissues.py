"""The result of the benchmark on real tissue: how often bands hold, by formulation, protocol and class of tissue."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tissuq.assessment.uses import PRECISE, USEFUL
from tissuq.drawing.panels import legend_above
from tissuq.report.coverage import numbers_of_shares
from tissuq.report.coverage_figures import dots_by_row, panel_grid, shares_figure
from tissuq.report.result import Picture, Result, Section, Table
from tissuq.report.tables import significant
from tissuq.validation.tissues import TissueSettings, summarise_tissues, summarise_verdicts
from tissuq.validation.tissues.benchmark import ALL, PROBABILITIES, TARGET_HALF_WIDTH, TARGET_INSIDE, sets_of

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

SHARES = {"inside_50": "in 50 %", "inside_80": "in 80 %", "inside_95": "in 95 %", "useful": "useful"}
RATIOS = {"half_width": "half width", "error": "error", "score": "score"}
TESTS = {
    "tests": "Each test from the others of its set",
    "modes": "Each test from all tests of one other mode",
    "specimens": "Each test from the others of the same specimen",
    "ends": "The end of each test (30 % of its range) from the rest of it",
    "halves": "Every second measurement of each test from the others",
}
"""What a protocol predicts, and from what."""
PANELS = {
    "inside_95": ("measurements in the 95 % band [%]", 100 * PROBABILITIES[-1]),
    "half_width": ("median half width [% of the stress]", 100 * TARGET_HALF_WIDTH),
    "error": ("median error of the median [% of the stress]", None),
}
"""Columns of the figure: what is drawn, and where its line stands."""
LARGEST_SHOWN = 1000.0
"""Half width or error, per cent of the stress, at which the figure ends."""
SMALLEST_SHOWN = 1.0
"""Where it begins."""
MIN_TIMES = 10.0
"""Ratio to the stress from which it is given as so many times, not in per cent."""


def tissue_result(settings: TissueSettings, results: list[dict[str, Any]]) -> Result:
    """Return what a benchmark on real tissue says."""
    import pandas as pd

    summary = summarise_tissues(results)
    predictions = pd.DataFrame(results).drop(columns="key").assign(fitted=["; ".join(row["fitted"]) for row in results])
    sets = list(dict.fromkeys(result["tissue"] for result in results))
    nominal, by_class = PROBABILITIES[-1], summary[summary["class"] != ALL]
    protocols = summary.groupby("protocol", sort=False, observed=True)
    return Result(
        command="study tissues",
        title="Do predictions of real tests hold?",
        subject=f"benchmark on real tissue, {len(sets)} set{'s' * (len(sets) > 1)} of measured tests, material "
        f"{settings.material}",
        numbers=numbers_of_shares(by_class, "inside_95", nominal, "measurements inside the band of"),
        finding="Every test is predicted from a fit of others that does not see it: one material, "
        f"{' or '.join(settings.formulations)} as its discrepancy, {_errors_in_words(settings)}.",
        next_step="see how your own tests are predicted from one another: tissuq study tissues FOLDER",
        picture=Picture(
            "answer",
            lambda: shares_figure(by_class, "inside_95", 100 * nominal, PANELS["inside_95"][0]),
            "Share of the measurements in the 95 % band", "A mark for each protocol and class of tissue; line: "
            "nominal.",
        ),
        tables=tuple(_table(str(protocol), rows) for protocol, rows in protocols),
        sections=_sections(settings, summary, results, sets),
        files={
            "summary.csv": summary,
            "verdicts.csv": summarise_verdicts(results),
            "predictions.csv": predictions,
        },
    )  # fmt: skip


def _errors_in_words(settings: TissueSettings) -> str:
    if settings.tolerances is None:
        return "everything else as by default"
    sizes = ", ".join(f"{name} {size:g}" for name, size in settings.tolerances.items())
    return f"errors of the tests {sizes or 'none'}"


def _sections(
    settings: TissueSettings, summary: pd.DataFrame, results: list[dict[str, Any]], sets: list[str]
) -> tuple[Section, ...]:
    """Return what a page folds: by class of tissue, how to read it, what was not predicted, the sets."""
    figure = Picture(
        "tissues", lambda: _figure(summary), "Coverage, half width and error by class of tissue",
        "Share of the measurements in the 95 % band, half width of the band and error of its median, by class of "
        "tissue. Grey lines: the nominal share, and the half width up to which a prediction counts as useful. Marks at "
        "the edges may lie beyond them.",
    )  # fmt: skip
    reading = [
        "In 50, 80 and 95 %: share of the measurements inside the central interval of a new test with noise, mean over "
        "the predictions; it should be near the nominal one.",
        "Half width: root mean square of half of the 95 % band; error: that of its median's error; both over the root "
        "mean square of the stress, median over the predictions.",
        "Score: the mean interval score of the 95 % band (its width, plus a penalty for measurements outside) over the "
        "root mean square of the stress, median over the predictions. Lower is better.",
        f"Useful: share of the predictions with {100 * TARGET_INSIDE:g} % or more of the measurements in a band whose "
        f"half width is below {100 * TARGET_HALF_WIDTH:g} % of the stress.",
    ]
    if summary["modulus_inside"].notna().any():
        reading.append(
            "Modulus in: share of the 95 % intervals of the initial shear modulus from the fitted tests that hold the "
            "median of the one from the predicted test; upper / lower end: ratio of the ends of that interval, median."
        )
    reading += [
        "A discrepancy in stress (such as gp) says nothing about a mode that was not fitted, and is left out of its "
        "prediction.",
        f"At most {settings.points} measurements are taken from a test, and at most {settings.predictions} predictions "
        "are made for each set and protocol.",
    ]
    sections = [
        Section("By class of tissue", (figure,)),
        *_verdicts(summarise_verdicts(results)),
        Section("How to read it", (tuple(reading),)),
    ]
    failed = [row for row in results if "failure" in row]
    texts = sorted({f"{row['tissue']}, {row['predicted']}, {row['formulation']}: {row['failure']}" for row in failed})
    made = {(row["protocol"], row["tissue"]) for row in results}
    for protocol in settings.protocols:
        if empty := [name for name in sets_of(settings) if (protocol, name) not in made]:
            few = "too few tests, modes, specimens or measurements"
            texts.append(f"{TESTS[protocol]}: nothing in {', '.join(empty)}, which have {few} for it.")
    if texts:
        sections.append(Section("Not predicted", (tuple(texts),)))
    origin = "" if settings.folder else " (those that come with tissuq: `tissuq datasets` tells their sources)"
    return (*sections, Section("Sets", (f"{', '.join(sets)}{origin}.",)))


def _verdicts(summary: pd.DataFrame) -> tuple[Section, ...]:
    """Return how far predictions were off, by what the fit said that it could be used for."""
    if summary.empty:
        return ()
    limits = [f"within {100 * limit:g} %" for limit in (PRECISE, USEFUL)]
    rows = [
        [
            f"{row['quantity']}: {TESTS[row['protocol']].lower()}",
            *(str(row[name]) for name in ("formulation", "verdict", "predictions")),
            *(_percent(row[name]) for name in ("held", "error", "precise", "of_use")),
        ]
        for row in summary.to_dict("records")
    ]
    text = (
        f"A fit says 'yes' where it claims to know a stress or a modulus to {100 * PRECISE:g} %, and 'with care' up to "
        f"{100 * USEFUL:g} % or where something speaks against it. Of the predictions under a verdict: the mean share "
        "of the measurements (or of the moduli of the predicted tests) in 95 % intervals, the median error, and how "
        "many were within what a verdict of yes claims, and within what one of care does."
    )
    table = Table(["predicted", "formulation", "verdict", "predictions", "in 95 %", "error", *limits], rows, "", (1, 2))
    return (Section("Do the verdicts hold?", (text, table)),)


def _table(protocol: str, summary: pd.DataFrame) -> Table:
    """Return the summary of a protocol as text; columns that say nothing are left out."""
    labels = ["class"] if summary["class"].nunique() > 1 else []
    headers = [*labels, "formulation", "predictions", *SHARES.values(), *RATIOS.values()]
    has_moduli = summary["modulus_inside"].notna().any()

    def ratio(number: float) -> str:
        return significant(number, 2) if number == number else "-"

    rows = [
        [
            *(str(row[name]) for name in (*labels, "formulation", "predictions")),
            *(_percent(row[name]) for name in SHARES),
            *(_percent(row[name]) for name in RATIOS),
            *([_percent(row["modulus_inside"]), ratio(row["modulus_ratio"])] if has_moduli else []),
        ]
        for row in summary.to_dict("records")
    ]
    headers += ["modulus in", "upper / lower end"] if has_moduli else []
    return Table(headers, rows, TESTS.get(protocol, protocol), (1,) if labels else ())


def _percent(share: float) -> str:
    if share != share:
        return "-"
    return f"{100 * share:.0f} %" if share < MIN_TIMES else f"{share:.3g} times"


def _figure(summary: pd.DataFrame) -> Figure:
    """Draw coverage, half width and error by class of tissue, a row of panels a protocol."""
    protocols = list(dict.fromkeys(summary["protocol"]))
    classes = list(dict.fromkeys(summary["class"]))
    with panel_grid(len(protocols), len(PANELS), 0.8 + 0.26 * len(classes)) as (figure, axes):
        for row, protocol in zip(axes, protocols, strict=True):
            table = summary[summary["protocol"] == protocol]
            for axis, (measure, (_, target)) in zip(row, PANELS.items(), strict=True):
                low = SMALLEST_SHOWN if measure in RATIOS else 0.0
                series = {
                    str(name): (lines["class"], (100 * lines[measure]).clip(low, LARGEST_SHOWN), None)
                    for name, lines in table.groupby("formulation", sort=False, observed=True)
                }
                dots_by_row(axis, classes, series, target, is_named=axis is row[0])
                if measure == "inside_95":
                    axis.set_xlim(-2, 102)
                else:
                    axis.set_xscale("log")
                    axis.set_xlim(0.8 * SMALLEST_SHOWN, 1.2 * LARGEST_SHOWN)
                    axis.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
                    axis.xaxis.set_minor_formatter("")
                if ALL in classes and len(classes) > 1:
                    axis.axhline(0.5, color="#dddddd", linewidth=0.8, zorder=0)
            row[0].set_title(TESTS[protocol])
        for axis, (text, _) in zip(axes[-1], PANELS.values(), strict=True):
            axis.set_xlabel(text)
        legend_above(figure, axes[0][:1], font_size=10)
    return figure
