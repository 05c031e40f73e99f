"""Tables of a fit, as rows for files and for people: discrepancies, parameters, stability, tests from the others."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from operator import itemgetter

from tissuq.assessment.stability import MIN_LOSS_PROBABILITY
from tissuq.experiments.units import StressUnit
from tissuq.posterior.labelled import summaries, summaries_in
from tissuq.posterior.posterior import Posterior
from tissuq.report.result import Section, Table
from tissuq.report.tables import (
    Row,
    interval,
    known_number,
    percent,
    significant,
    stretch_in_words,
    table_files,
)

HOW_TO_READ = (
    "Intervals are the shortest that hold 95 %. In band, alone: share of measurements inside the 95 % band with the "
    "discrepancy, and inside that of the material alone.{stability} A good predictive check does not mean "
    "that {name} is right."
)
STABLE = " Stable: probability of stability over the measured stretches; all loading modes: `stability.csv`."
LOST = " Lost at stretch: median [95 %] of the draws that become unstable."
FOLLOWS = "follows from the others"
"""In place of the prior of a parameter that is none of the model's."""
STABILITY = ("stable", "lost_at", "lost_at_low", "lost_at_high")
"""Of `stability_cells`."""
SAME_STATES = (
    "Tension in one mode may be compression in another: what is pressed to 0.6 along two axes (equibiaxial "
    "compression) grows to 1 / 0.6² = 2.8 along the third, for its volume stays: the state of uniaxial tension to 2.8."
)
STABLE_MEANS = (
    "Stable means that from rest onward the greater principal stress lies along the greater stretch (Baker-Ericksen), "
    "every small change of stress does positive work (Drucker), and the engineering stress rises with the stretch. It "
    "is checked over the measured stretches of the modes that were measured, and in the others over those within "
    "which both invariants were measured, for the material together with a "
    "discrepancy that is an energy; any other discrepancy does not affect stability and is left out. Lost in "
    "compression or tension: median and 95 % interval of the draws that become unstable, if stability is lost with a "
    "probability above 5 %."
)
SCORES = ("crps", "interval_score")
"""Scores of a prediction that are stresses."""
OF_HEADLINE = ("median", "hdi_low", "hdi_high")
"""What is said of the headline parameter from the other tests."""
HELD_OUT_NOTE = (
    "Every test is predicted by a fit of the others alone. Inside: how many of its measurements lie in the predicted "
    "band, 95 % where all is well. Extrapolated: how many lie at strains that the others did not reach. Band ±, the "
    "half width of the band, and off by, how far its middle is off: root mean squares of the measurements that are not "
    "extrapolated, relative to that of their stress; small is good."
)


def summary_row(
    formulation: str, posterior: Posterior, seconds: float, truth: float | None = None, more: Row | None = None
) -> Row:
    """Return the row of one formulation, C10 (or the material's first parameter) in MPa; empty what it has not.

    ``more`` are further cells, such as `stability_cells`.
    """
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
        **(more or {}),
        "seconds": seconds,
    }


def headline_of(row: Row) -> str:
    """Return the parameter whose posterior the row of a formulation gives."""
    return next(name.removesuffix("_mean") for name in row if name.endswith("_mean"))


def parameter_rows(posteriors: Mapping[str, Posterior]) -> list[Row]:
    """Return mean, sd, median and 95 % interval of every parameter of every formulation, with its unit and prior."""
    rows = []
    for formulation, posterior in posteriors.items():
        unit = posterior.unit()
        table = summaries_in(unit, posterior.solution)
        model = posterior.model
        priors = {p.symbol: model.priors[p.symbol].scaled(1 / unit.to_mpa if p.unit else 1.0) for p in model.parameters}
        for parameter in model.reported_parameters:
            numbers = table[parameter.symbol]
            rows.append(
                {
                    "formulation": formulation,
                    "parameter": parameter.symbol,
                    "unit": unit.name if parameter.unit else "",
                    "prior": str(priors.get(parameter.symbol, FOLLOWS)),
                    **{name: known_number(numbers[name]) for name in ("mean", "sd", "median", "hdi_low", "hdi_high")},
                    "rhat": float(numbers["rhat"]) if "rhat" in numbers else None,
                    "ess": float(numbers["ess"]) if "ess" in numbers else None,
                }
            )
    return rows


def summary_tables(
    summary: list[Row], posteriors: Mapping[str, Posterior], suffix: str = "", unit: StressUnit | None = None
) -> dict[str, list[Row]]:
    """Return summary.csv, summary.json and parameters.csv; the summary, in MPa, in a unit where one is said."""
    columns = [name for name in summary[0] if name.startswith(f"{headline_of(summary[0])}_")]
    name, parameters = f"summary{suffix}", {f"parameters{suffix}.csv": parameter_rows(posteriors)}
    if unit is None:
        return {f"{name}.csv": summary, f"{name}.json": summary} | parameters
    return table_files(name, summary, columns, unit) | parameters


def summary_table(rows: list[Row], unit: StressUnit, title: str, main: str = "") -> Table:
    """Return the rows of a summary for people, C10 (or the material's first parameter) in a unit.

    Parameters
    ----------
    rows : list of Row
        Of `summary_row`.
    unit : StressUnit
    title : str
    main : str
        The discrepancy that answers.
    """
    name = headline_of(rows[0])
    has_truth, is_sampled, has_stability = (
        any(row.get(column) is not None for row in rows) for column in ("contains_truth", "rhat", "stable")
    )
    headers = ["discrepancy", f"{name}, {unit.name}", "sd", "95 % interval", *["truth"] * has_truth]
    is_lost = has_stability and any(row[STABILITY[1]] is not None for row in rows)
    headers += ["log ev.", "in band", "alone", *["stable"] * has_stability, *["lost at stretch"] * is_lost]
    headers += ["R-hat", "ESS"] * is_sampled
    cells = []
    for row in rows:
        mean, sd, low, high = (row[f"{name}_{key}"] / unit.to_mpa for key in ("mean", "sd", "hdi_low", "hdi_high"))
        middle, ends = interval(mean, mean, sd)[0], ", ".join(interval(low, high, sd))
        line = [row["formulation"], middle, interval(sd, sd, sd)[0], f"[{ends}]"]
        line += [{True: "yes", False: "no", None: ""}[row["contains_truth"]]] * has_truth
        line.append("" if row["log_evidence"] is None else f"{row['log_evidence']:.2f}")
        line += [f"{100 * row[column]:.0f} %" for column in ("predictive_coverage", "predictive_coverage_model_only")]
        line += [percent(row["stable"])] if has_stability else []
        line += [stretch_in_words(*(row[column] for column in STABILITY[1:]))] if is_lost else []
        if is_sampled:
            for column, digits in (("rhat", 3), ("ess", 0)):
                line.append("" if row[column] is None else f"{row[column]:.{digits}f}")
        cells.append(line)
    note = HOW_TO_READ.format(name=name, stability=STABLE * has_stability + LOST * is_lost)
    return Table(headers, cells, title, note=note, main=main)


def parameter_table(posteriors: Mapping[str, Posterior]) -> Table:
    """Return the rows of parameters.csv for people."""
    rows = []
    for row in parameter_rows(posteriors):
        mean, sd, median, low, high = (row[name] for name in ("mean", "sd", "median", "hdi_low", "hdi_high"))
        spread = (high - low) / 4 if sd is None else sd
        ends = interval(low, high, spread)
        moments = ["–", "–"] if sd is None else [interval(mean, mean, sd)[0], interval(sd, sd, sd)[0]]
        names = [row[name] for name in ("formulation", "parameter", "unit", "prior")]
        rows.append([*names, interval(median, median, spread)[0], *moments, f"[{ends[0]}, {ends[1]}]"])
    headers = ["discrepancy", "parameter", "unit", "prior", "median", "mean", "sd", "95 % interval"]
    return Table(headers, rows, text_columns=(1, 2, 3))


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


def stability_section(rows: list[Row]) -> Section:
    """Return the rows of stability for people; no stretch where it is hardly ever lost."""

    def lost(row: Row, side: str) -> str:
        ends = (row[f"lost_{side}_{name}"] for name in ("median", "low", "high"))
        return stretch_in_words(*ends) if row[f"lost_{side}_probability"] > MIN_LOSS_PROBABILITY else ""

    columns: dict[str, Callable[[Row], str]] = {
        "discrepancy": itemgetter("formulation"),
        "loading mode": itemgetter("mode"),
        "stretch": lambda row: f"{row['stretch_low']:.3g} to {row['stretch_high']:.3g}",
        "stable throughout, probability": lambda row: percent(row["stable"]),
        "lost in compression at": lambda row: lost(row, "below"),
        "lost in tension at": lambda row: lost(row, "above"),
    }
    table = Table.of(rows, columns, text_columns=(1,))
    return Section("Where it is stable", (STABLE_MEANS, table, SAME_STATES))


def held_out_files(rows: Sequence[Row], headline: str, unit: StressUnit) -> dict[str, list[Row]]:
    """Return the rows, whose scores and headline parameter are in MPa, as files in a unit."""
    return table_files("held_out", rows, [*SCORES, *(f"{headline}_{name}" for name in OF_HEADLINE)], unit)


def held_out_table(rows: Sequence[Row], headline: str, unit: StressUnit) -> Table:
    """Return the rows for people."""
    headers = ["discrepancy", "test left out", "measured", "inside band", "extrapolated", "band ±", "off by"]
    cells = []
    for row in rows:
        median, low, high = (significant(row[f"{headline}_{name}"] / unit.to_mpa) for name in OF_HEADLINE)
        shares = [percent(row[name]) for name in ("inside", "beyond", "half_width", "error")]
        cells.append([row["formulation"], row["test"], row["measured"], *shares, f"{median} [{low}, {high}]"])
    headers.append(f"{headline} of the others, {unit.name}")
    return Table(headers, cells, "Each test predicted from the others", (1, 2), HELD_OUT_NOTE)
