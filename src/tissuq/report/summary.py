"""The discrepancies of a run beside one another: rows for files, and tables for people in the unit of the data."""

from __future__ import annotations

from collections.abc import Mapping

from tissuq.experiments.units import StressUnit
from tissuq.posterior.labelled import summaries, summaries_in
from tissuq.posterior.posterior import Posterior
from tissuq.report.result import Table
from tissuq.report.stability import STABILITY
from tissuq.report.tables import Row, in_unit_of, interval, known_number, percent, stretch_in_words, with_named_units

__all__ = ["parameter_table", "summary_row", "summary_table", "summary_tables"]

HOW_TO_READ = (
    "Intervals are the shortest that hold 95 %. In band, alone: share of measurements inside the 95 % band with the "
    "discrepancy, and inside that of the material alone.{stability} A good predictive check does not mean "
    "that {name} is right."
)
STABLE = " Stable: probability of stability over the measured stretches; all loading modes: `stability.csv`."
LOST = " Lost at stretch: median [95 %] of the draws that become unstable."


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


def headline_columns(row: Row) -> list[str]:
    """Return the columns of a row that begin with its headline parameter, in whose unit they are."""
    return [name for name in row if name.startswith(f"{headline_of(row)}_")]


def headline_of(row: Row) -> str:
    """Return the parameter whose posterior the row of a formulation gives."""
    names = [name.removesuffix("_mean") for name in row if name.endswith("_mean")]
    if not names:
        raise KeyError("the row names no parameter")
    return names[0]


def parameter_rows(posteriors: Mapping[str, Posterior]) -> list[Row]:
    """Return mean, sd, median and 95 % interval of every parameter of every formulation, with its unit and prior."""
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


def summary_tables(
    summary: list[Row], posteriors: Mapping[str, Posterior], suffix: str = "", unit: StressUnit | None = None
) -> dict[str, list[Row]]:
    """Return summary.csv, summary.json and parameters.csv; the summary, in MPa, in a unit where one is said."""
    columns = headline_columns(summary[0])
    return {
        f"summary{suffix}.csv": summary if unit is None else with_named_units(summary, columns, unit),
        f"summary{suffix}.json": summary if unit is None else in_unit_of(summary, columns, unit),
        f"parameters{suffix}.csv": parameter_rows(posteriors),
    }


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
