"""The result of a campaign on forces of structures: how often bands hold, and how wide they are beside an oracle's."""

from __future__ import annotations

from collections.abc import Callable
from operator import itemgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.drawing.style import ANSWER_WIDTH, BAND, BASE, TRUTH, new_figure
from tissuq.errors import ConvergenceError
from tissuq.finite_elements.spread import PROBABILITY
from tissuq.report.result import MAX_NUMBERS, Number, Picture, Result, Section, Table
from tissuq.validation.structures import (
    DEFAULT,
    KNOWN_LAWS,
    ORACLE,
    STRUCTURES,
    StructureStudySettings,
    summarise_structures,
)

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

COLUMNS: dict[str, Callable[[Any], str]] = {
    "truth": itemgetter("truth"),
    "structure": itemgetter("structure"),
    "sets of tests": lambda row: str(row["replicates"]),
    "in 95 %": lambda row: f"{100 * row['inside']:.0f} ± {100 * row['inside_error']:.0f} %",
    "oracle in 95 %": lambda row: f"{100 * row['oracle_inside']:.0f} %",
    "half width": lambda row: f"{100 * row['half_width']:.1f} %",
    "over the oracle's": lambda row: f"{row['width_ratio']:.2f}",
    "error": lambda row: f"{100 * row['error']:.1f} %",
}
NOTE = (
    "In 95 %: bands that hold the true force, ± one standard error. Half width of the band and error of its mean: "
    "median, over the true force. Over the oracle's: median ratio of widths."
)


def structures_result(settings: StructureStudySettings, results: list[dict[str, Any]]) -> Result:
    """Return what a campaign on forces of structures says.

    Raises
    ------
    ConvergenceError
        When nothing could be computed.
    """
    summary = summarise_structures(results)
    failures = [row for row in results if row["failure"]]
    if summary.empty:
        raise ConvergenceError(f"no set of tests gave a force: {failures[0]['failure']}")
    laws = "; ".join(f"{name}: {law.material}({', '.join(f'{v:g}' for v in law.values)})"
                     for name, law in KNOWN_LAWS.items() if name in settings.truths)  # fmt: skip
    bodies = "; ".join(STRUCTURES[name].description for name in settings.structures)
    modes = " and ".join(settings.modes)
    computed = (
        f"Truths (MPa): {laws}. Structures: {bodies}.",
        f"Each set has a test in {modes} ({settings.points} measurements, up to a stretch of {settings.high:g}), with "
        f"noise of {100 * settings.noise:g} % of the largest stress and the errors of tests of the estimand "
        f"'{settings.estimand}', drawn anew: factors of specimen and test, length, slack, smooth errors, resolution.",
        "It is fitted as tissuq fit does unless told otherwise, with these tolerances; the oracle is fitted with the "
        f"true law and no discrepancy. {settings.draws} draws of each, of which {settings.full_runs or settings.draws} "
        "in full and the others to first order. Truth and draws are on the same mesh.",
    )
    sections = [Section("How it was computed", (computed,))]
    if failures:
        rows = [[row["truth"], str(row["replicate"] + 1), row["failure"]] for row in failures]
        sections.insert(
            0, Section("Sets without a result", (Table(["truth", "tests", "reason"], rows, text_columns=(2,)),))
        )
    return Result(
        command="study structures",
        title="Do bands of the force of a structure hold?",
        subject=f"{settings.replicates} sets of tests of each law: {', '.join(settings.truths)}; structures: "
        f"{', '.join(settings.structures)}",
        numbers=_numbers(summary),
        finding=f"Simple tests of a known law with errors of a laboratory, fitted by default, predict the force of a "
        f"structure: a band that is right holds the true one in {100 * PROBABILITY:.0f} %.",
        next_step="see whether predictions of real tests hold: tissuq study tissues",
        picture=Picture(
            "answer", lambda: _figure(results), "Bands of the force over the true one",
            "Every set of tests: band (blue) and mean over the true force, and the band of an oracle that knows the "
            "law (grey). Line: the truth.",
        ),
        tables=(
            Table.of(summary.to_dict("records"), COLUMNS, "Forces at the end", text_columns=(1,), note=NOTE),
        ),
        sections=tuple(sections),
        files={"summary.csv": summary, "bands.csv": _rows(results)},
    )  # fmt: skip


def _numbers(summary: pd.DataFrame) -> tuple[Number, ...]:
    return tuple(
        Number(
            f"{row['truth']}, {row['structure']}: bands that hold the force",
            COLUMNS["in 95 %"](row),
            remark=f"of {row['replicates']}; {row['width_ratio']:.2g} times as wide as an oracle's",
        )
        for row in summary.to_dict("records")[:MAX_NUMBERS]
    )


def _rows(results: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [
        {"truth": row["truth"], "tests": row["replicate"] + 1, "structure": name, "force_N": estimates["force"]}
        | {f"{kind}_{key}": value for kind in (DEFAULT, ORACLE) for key, value in estimates[kind].items()}
        for row in results
        for name, estimates in row["structures"].items()
    ]


def _figure(results: list[dict[str, Any]]) -> Figure:
    """Draw every band over the true force, by truth and structure, from low to high."""
    names = list(dict.fromkeys((row["truth"], name) for row in results for name in row["structures"]))
    with new_figure(ANSWER_WIDTH, 1.1 + 1.7 * len(names)) as figure:
        for axis, (truth, name) in zip(figure.subplots(len(names), 1, squeeze=False)[:, 0], names, strict=True):
            estimates = [
                row["structures"][name] for row in results if row["truth"] == truth and name in row["structures"]
            ]
            estimates.sort(key=lambda estimate: estimate[DEFAULT]["mean"] / estimate["force"])
            positions = np.arange(len(estimates))
            for kind, color, shift in ((ORACLE, BASE, 0.3), (DEFAULT, BAND, 0.0)):
                ends = np.array(
                    [[estimate[kind][end] / estimate["force"] for end in ("low", "high")] for estimate in estimates]
                )
                axis.vlines(positions + shift, *ends.T, color=color, lw=1.6)
            axis.plot(
                positions,
                [estimate[DEFAULT]["mean"] / estimate["force"] for estimate in estimates],
                ".",
                color=BAND,
                ms=4,
            )
            axis.axhline(1, color=TRUTH, lw=1)
            axis.set_title(f"{truth}, {name}", fontsize=9)
            axis.set_xticks([])
        figure.supylabel("force over the true one", fontsize=9)
    return figure
