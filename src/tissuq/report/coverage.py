"""The result of a campaign on coverage: how often intervals hold the truth, by formulation, and what they cost."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from tissuq.report.coverage_figures import coverage_figure, family_figure, shares_figure, unseen_figure
from tissuq.report.result import MAX_NUMBERS, Block, Number, Picture, Result, Section, Table
from tissuq.report.tables import significant
from tissuq.validation.coverage import CoverageSettings, summarise, summarise_unseen

if TYPE_CHECKING:
    import pandas as pd

MIN_RELATIVE_ERROR = 1e-9
"""Monte Carlo error, relative to its number, below which it is rounding and shown as zero."""
SETTING_HEADERS = {name: name for name in ("design", "strength", "noise", "family")} | {"mode": "loading mode"}
OF_COVERAGE = {
    "fits": ("fits", "count"),
    "coverage": ("coverage", "percent"),
    "score": ("score / C10", "number"),
    "price": ("score / oracle", "number"),
    "price_median": ("(median)", "plain"),
    "width": ("width / oracle", "number"),
    "bias": ("bias", "percent"),
    "predictive": ("new data in band", "percent"),
}
OF_UNSEEN = {
    "materials": ("materials", "count"),
    "coverage": ("true stress in band", "percent"),
    "error": ("error of the mean", "percent"),
}
"""Heads of the columns of a summary, and what stands in each."""
MODES = (
    "The true stress against the {percent} % band of the stress itself, at stretches above one up to where I1 or I2 "
    "leaves the range that was measured. The error is the median over materials of the root mean square error of the "
    "posterior mean, relative to the stress. A discrepancy that is an energy is part of the prediction; the others "
    "(none, constant, linear, quadratic, gp) do not apply to another mode and are left out."
)
ERRORS = "Numbers after ± are Monte Carlo standard errors."
BARS = "Bars are 95 % Monte Carlo intervals"


def coverage_result(settings: CoverageSettings, results: list[dict[str, Any]]) -> Result:
    """Return what a campaign says."""
    summary, families = summarise(settings, results), summarise(settings, results, "family")
    tables = {"summary": summary, "families": families}
    if settings.unseen:
        tables["unseen"] = summarise_unseen(settings, results)
    percent = f"{100 * settings.prob:g}"
    families_word = "families or materials" if len(settings.families) > 1 else "family or material"
    designs = f"{len(settings.designs)} designs" if len(settings.designs) > 1 else f"design {settings.designs[0].label}"
    scale = f", C10 from {settings.scale[0]:g} to {settings.scale[1]:g} MPa" if settings.scale else ""
    holding = f"intervals that hold the true C10 [%]; line: {percent} %"
    return Result(
        command="study coverage",
        title="Do the intervals contain the truth?",
        subject=f"coverage study, {len(settings.families)} {families_word}, {settings.replicates} replicates of each, "
        f"{designs}, noise {' and '.join(settings.noise)}{scale}",
        numbers=numbers_of_shares(summary, "coverage", settings.prob, "coverage of"),
        finding="Every replicate is a member of its family, measured with independent noise and fitted as neo-Hookean. "
        f"Coverage is the share of {percent} % intervals of C10 that contain half the true initial shear modulus of "
        "the material.",
        next_step="use the formulation whose coverage is nominal in all designs: tissuq fit FILE --discrepancy NAME",
        picture=Picture(
            "answer", lambda: shares_figure(summary, "coverage", 100 * settings.prob, holding),
            "Coverage of every formulation", "Coverage, a mark for each design, strength and noise."
        ),
        tables=(coverage_table(summary, title="Coverage of C10", note=ERRORS),),
        sections=_sections(settings, tables, percent),
        files={f"{name}.csv": table for name, table in tables.items()},
    )  # fmt: skip


def numbers_of_shares(table: pd.DataFrame, column: str, prob: float, words: str) -> tuple[Number, ...]:
    """Return the mean share of some formulations, the nearest to the nominal one first, with its range."""
    shares = table.groupby("formulation", sort=False)[column].agg(["mean", "min", "max"]).dropna()
    shares = shares.iloc[(shares["mean"] - prob).abs().argsort(kind="stable").to_numpy()]
    numbers = []
    for name, row in shares.head(MAX_NUMBERS).iterrows():
        ends = f"; {100 * row['min']:.0f} % to {100 * row['max']:.0f} % by case" if row["max"] > row["min"] else ""
        remark = f"nominal {100 * prob:.0f} %{ends}"
        numbers.append(Number(f"{words} '{name}'", f"{100 * row['mean']:.0f} %", remark=remark))
    return tuple(numbers)


def _sections(settings: CoverageSettings, tables: dict[str, pd.DataFrame], percent: str) -> tuple[Section, ...]:
    """Return what a page folds: coverage and price, other loading modes, families, how to read it."""
    is_series = len(settings.strengths) > 1
    coverage = Picture(
        "coverage", lambda: coverage_figure(tables["summary"], settings.prob),
        f"Coverage and price {'over the strength of the error of the model' if is_series else 'of every formulation'}",
        f"Left: share of intervals that hold the truth. Right: interval score over the width of an oracle's. {BARS}."
        if is_series
        else f"Share of intervals that contain the truth, and their width and score. {BARS}; grey lines, the ideal.",
    )  # fmt: skip
    sections = [Section("Coverage and its price", (coverage,))]
    if settings.unseen:
        unseen = Picture(
            "unseen",
            lambda: unseen_figure(tables["unseen"], settings.prob),
            "Coverage and error in unseen loading modes",
            f"Coverage and error of the stress in other loading modes. {BARS}.",
        )
        table = coverage_table(tables["unseen"], OF_UNSEEN)
        words = MODES.format(percent=percent)
        sections.append(Section("Stress in loading modes that were not measured", (words, unseen, table)))
    if tables["families"]["family"].nunique() > 1:
        families = Picture(
            "families",
            lambda: family_figure(tables["families"], settings.prob),
            "Coverage by family and design",
            "Share of intervals that hold the truth, in percent: white where it is nominal, orange where it is lower.",
        )
        sections.append(Section("By family", (families, coverage_table(tables["families"]))))
    failed = int(tables["summary"]["failed"].sum())
    unit = ", in units of C10" if settings.scale else ", MPa"
    reading = [
        f"A design is its range of stretches, number of measurements (n) and noise (sd{unit}).",
        f"Coverage should be near {percent} %; the lower it is, the more often the interval misses the truth.",
        "Score is the mean interval score: width, plus a penalty if it misses the truth. It is given over the true "
        "C10, and over the width of the interval of an oracle that knows everything but C10 (mean, with its error, "
        "then median). Lower is better.",
        "Width is the median ratio to the oracle's. Bias is that of the posterior mean, relative to the truth.",
    ]
    if settings.predictive:
        reading.append(
            f"New data in band: share of new measurements at the same stretches inside the {percent} % predictive band."
        )
    reading.append(ERRORS)
    reading += [f"{failed} fits failed, and are left out."] * bool(failed)
    how: tuple[Block, ...] = (tuple(reading),)
    return (*sections, Section("How to read it", how))


def coverage_table(
    table: pd.DataFrame, headers: Mapping[str, tuple[str, str]] = OF_COVERAGE, title: str = "", note: str = ""
) -> Table:
    """Return a summary as text, with Monte Carlo errors; columns with one value are left out."""
    varying = [name for name in SETTING_HEADERS if name in table and table[name].nunique() > 1]
    columns = {
        name: header
        for name, header in headers.items()
        if name in table and (header[1] != "count" or table[name].nunique() > 1)
    }
    rows = [
        [
            *(f"{row[name]:g}" if name == "strength" else str(row[name]) for name in varying),
            str(row["formulation"]),
            *(_with_error(row, name, kind) for name, (_, kind) in columns.items()),
        ]
        for row in table.to_dict("records")
    ]
    heads = [*(SETTING_HEADERS[name] for name in varying), "formulation", *(text for text, _ in columns.values())]
    return Table(heads, rows, title, tuple(range(1, len(varying) + 1)), note)


def _with_error(row: Any, name: str, kind: str) -> str:
    """Return a number and its Monte Carlo standard error as text: a share in percent, or any other number."""
    value, error = row[name], row.get(f"{name}_error")
    if kind == "count":
        return f"{value:.0f}"
    if kind == "plain":
        return significant(value)
    if error != error:  # of one data set
        return significant(100 * value) + " %" if kind == "percent" else significant(value)
    if kind == "percent":
        return f"{100 * value:.1f} ± {100 * error:.1f} %"
    return f"{significant(value)} ± {significant(error if error > MIN_RELATIVE_ERROR * abs(value) else 0.0, 2)}"
