"""The run folder of the benchmark on real tissue: tables, a figure and the report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from tissuq.drawing.panels import legend_above
from tissuq.drawing.style import BASE, STYLE
from tissuq.report.coverage_figures import COLORS, MARKERS, panel_grid
from tissuq.report.run_folder import write_figures, write_page
from tissuq.report.tables import significant
from tissuq.validation.tissues import TissueSettings, summarise_tissues
from tissuq.validation.tissues.benchmark import ALL, PROBABILITIES, TARGET_HALF_WIDTH, TARGET_INSIDE

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

__all__ = ["readable_tissues", "write_tissues"]

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
MOVED = 0.16
"""Distance of the marks of two formulations, in rows."""


def write_tissues(settings: TissueSettings, results: list[dict[str, Any]], folder: Path) -> pd.DataFrame:
    """Write the tables as CSV, the figure and report.html beside the results; return the summary."""
    import pandas as pd

    summary = summarise_tissues(results)
    summary.to_csv(folder / "summary.csv", index=False)
    pd.DataFrame(map(_plain, results)).to_csv(folder / "predictions.csv", index=False)
    write_figures(folder, {"tissues": _figure(summary)})
    tables = {
        protocol: (TESTS[protocol], *readable_tissues(summary[summary["protocol"] == protocol]))
        for protocol in dict.fromkeys(summary["protocol"])
    }
    write_page(
        folder,
        "tissues.html",
        settings=settings,
        tables=tables,
        has_moduli=bool(summary["modulus_inside"].notna().any()),
        sets=list(dict.fromkeys(result["tissue"] for result in results)),
        failures=_failures(results),
        inside=100 * TARGET_INSIDE,
        width=100 * TARGET_HALF_WIDTH,
        command="study tissues",
    )
    return summary


def readable_tissues(summary: pd.DataFrame) -> tuple[list[str], list[list[str]]]:
    """Return headers and rows of a summary as text; columns that say nothing are left out."""
    labels = [name for name in ("protocol", "class") if summary[name].nunique() > 1]
    headers = [*labels, "formulation", "predictions", *SHARES.values(), *RATIOS.values()]
    has_moduli = summary["modulus_inside"].notna().any()
    rows = [
        [
            *(str(row[name]) for name in (*labels, "formulation", "predictions")),
            *(_percent(row[name]) for name in SHARES),
            *(_percent(row[name]) for name in RATIOS),
            *([_percent(row["modulus_inside"]), _number(row["modulus_ratio"])] if has_moduli else []),
        ]
        for row in summary.to_dict("records")
    ]
    return [*headers, *(["modulus in", "upper / lower end"] if has_moduli else [])], rows


def _number(ratio: float) -> str:
    return significant(ratio, 2) if ratio == ratio else "-"


def _failures(results: list[dict[str, Any]]) -> list[str]:
    rows = [row for row in results if "failure" in row]
    return sorted({f"{row['tissue']}, {row['predicted']}, {row['formulation']}: {row['failure']}" for row in rows})


def _percent(share: float) -> str:
    if share != share:
        return "-"
    return f"{100 * share:.0f} %" if share < MIN_TIMES else f"{share:.3g} times"


def _plain(result: dict[str, Any]) -> dict[str, Any]:
    """Return a result as a row of a table."""
    return {name: value for name, value in result.items() if name != "key"} | {"fitted": "; ".join(result["fitted"])}


def _figure(summary: pd.DataFrame) -> Figure:
    """Draw coverage, half width and error by class of tissue, a row of panels a protocol."""
    from matplotlib import rc_context

    protocols = list(dict.fromkeys(summary["protocol"]))
    classes = list(dict.fromkeys(summary["class"]))
    names = list(dict.fromkeys(summary["formulation"]))
    with rc_context(STYLE):
        figure, axes = panel_grid(len(protocols), len(PANELS), 0.8 + 0.26 * len(classes))
        for row, protocol in zip(axes, protocols, strict=True):
            table = summary[summary["protocol"] == protocol]
            for axis, (measure, (_, target)) in zip(row, PANELS.items(), strict=True):
                for number, name in enumerate(names):
                    lines = table[table["formulation"] == name]
                    shift = MOVED * (0.5 * (len(names) - 1) - number)
                    heights = [len(classes) - 1 - classes.index(label) + shift for label in lines["class"]]
                    values = (100 * lines[measure]).clip(SMALLEST_SHOWN if measure in RATIOS else 0.0, LARGEST_SHOWN)
                    style: dict[str, Any] = {"color": COLORS[number % len(COLORS)], "label": name}
                    axis.plot(values, heights, MARKERS[number % len(MARKERS)], markersize=5, **style)
                if target is not None:
                    axis.axvline(target, color=BASE, linewidth=1, zorder=0)
                if measure == "inside_95":
                    axis.set_xlim(-2, 102)
                else:
                    axis.set_xscale("log")
                    axis.set_xlim(0.8 * SMALLEST_SHOWN, 1.2 * LARGEST_SHOWN)
                    axis.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
                    axis.xaxis.set_minor_formatter("")
                axis.set_yticks(range(len(classes)), classes[::-1] if axis is row[0] else [""] * len(classes))
                axis.set_ylim(-0.6, len(classes) - 0.4)
                if ALL in classes and len(classes) > 1:
                    axis.axhline(0.5, color="#dddddd", linewidth=0.8, zorder=0)
            row[0].set_title(TESTS[protocol])
        for axis, (text, _) in zip(axes[-1], PANELS.values(), strict=True):
            axis.set_xlabel(text)
        legend_above(figure, axes[0][:1], font_size=10)
    return figure
