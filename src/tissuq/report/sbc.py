"""The result of simulation-based calibration: which parameters are not calibrated, their ranks and the figure."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from operator import itemgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.drawing.style import ANSWER_WIDTH, SERIES, new_figure
from tissuq.report.result import Number, Picture, Result, Section, Table
from tissuq.validation.sbc import SbcSettings, ecdf_band, probabilities_of, summarise_ranks

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MAX_COLUMNS = 4
"""Panels in a row of the figure."""
CAPTION = (
    "ECDF of the posterior probabilities below the truth, less that of uniform ones. Grey: where 95 % of uniform ones "
    "lie as a whole. Above on the left and below on the right: posteriors too narrow; the other way round: too wide."
)
CHECK = (
    "All parameters are drawn from their priors, data from the model with these, and the model is fitted to them with "
    "the same priors. If the computation is correct, the posterior probability below the true value is uniform, "
    "whatever the data. This checks the computation, not whether a model suits a tissue."
)
HOW_TO_READ = (
    "Mean: mean probability below the truth, 0.5 if calibrated. Spread: standard deviation of its normal score, 1 if "
    "calibrated; larger if posteriors are too narrow.",
    "p (shape): chance that uniform ranks leave the diagonal as far as these anywhere (Säilynoja, Bürkner & Vehtari "
    "2022). p (spread): chance of a spread as far from 1.",
    "A parameter counts as not calibrated if p is below 0.05 divided by the number of tests: if everything is correct, "
    "the chance of any such result is at most 5 %.",
    "An amplitude is zero in members without its block; its rank is then drawn within the posterior probability of "
    "zero.",
)


COLUMNS: dict[str, Callable[[Any], str]] = {
    "formulation": itemgetter("formulation"),
    "noise": itemgetter("noise"),
    "parameter": itemgetter("parameter"),
    "fits": lambda row: str(row["fits"]),
    "mean": lambda row: f"{row['mean']:.3f}",
    "spread": lambda row: f"{row['spread']:.3f}",
    "p (shape)": lambda row: f"{row['p_shape']:.2g}",
    "p (spread)": lambda row: f"{row['p_spread']:.2g}",
    "calibrated": lambda row: "yes" if row["calibrated"] else "NO",
}


def sbc_result(settings: SbcSettings, results: list[dict[str, Any]]) -> Result:
    """Return what a simulation-based calibration says."""
    table = summarise_ranks(settings, results)
    wrong, count = int((~table["calibrated"]).sum()), len(table)
    failed = int(table.groupby(["formulation", "noise"])["failed"].first().sum())
    formulations = f"{len(settings.formulations)} formulation{'s' * (len(settings.formulations) > 1)}"
    finding = (
        f"{wrong} of {count} parameters {'are' if wrong > 1 else 'is'} NOT calibrated."
        if wrong
        else f"All {count} parameters are consistent with calibrated posteriors."
    )
    worst = min(table.to_dict("records"), key=_least_probability)
    remark = f"p {_least_probability(worst):.2g}, of {2 * count} tests"
    left_out = [f"{failed} fits failed and are left out."] * bool(failed)
    priors = f"{'; '.join(f'{symbol}: {prior}' for symbol, prior in settings.chosen_priors.items())}."
    all_ranks = Picture("ranks", lambda: _figure(settings, results), "ECDF differences of the ranks", CAPTION)
    return Result(
        command="study sbc",
        title="Are the posteriors calibrated?",
        subject=f"simulation-based calibration, {formulations}, {settings.replicates} data sets of each, noise "
        f"{' and '.join(settings.noise)}",
        numbers=(
            Number("calibrated parameters", f"{count - wrong} of {count}"),
            Number("farthest from uniform", f"{worst['parameter']} with '{worst['formulation']}'", remark=remark),
        ),
        finding=finding,
        next_step="report what is not calibrated, with run.toml of this folder: the computation is wrong there."
        if wrong
        else "see whether the intervals hold the truth where the model is wrong: tissuq study coverage --preset paper",
        picture=Picture(
            "answer", lambda: _figure(settings, results, (worst["formulation"], worst["noise"])),
            "ECDF differences of the ranks that are farthest from uniform", CAPTION,
        ),
        tables=(Table.of(table.to_dict("records"), COLUMNS, "Ranks of the truth", text_columns=(1, 2)),),
        sections=(
            Section("Every formulation", (all_ranks,)),
            Section("How to read it", (CHECK, (*HOW_TO_READ, *left_out))),
            Section("Priors", (priors,)),
        ),
        files={"ranks.csv": table},
    )  # fmt: skip


def _least_probability(row: Mapping[Any, Any]) -> float:
    return min(float(row["p_shape"]), float(row["p_spread"]))


def _figure(settings: SbcSettings, results: list[dict[str, Any]], only: tuple[str, str] | None = None) -> Figure:
    """Draw, for each formulation and noise, by how much the ECDF of the ranks differs from that of uniform ones.

    Where it is said, for one of them ``only``.
    """
    panels: dict[tuple[str, str], dict[str, Any]] = {}
    for (formulation, noise, symbol), probabilities in probabilities_of(settings, results).items():
        if only in (None, (formulation, noise)):
            ranks = np.sort(probabilities[np.isfinite(probabilities)])
            panels.setdefault((formulation, noise), {})[symbol] = ranks
    symbols = list(dict.fromkeys(symbol for lines in panels.values() for symbol in lines))
    across = min(MAX_COLUMNS, len(panels))
    down = -(-len(panels) // across)
    size = (ANSWER_WIDTH, 3.6) if only else (2.7 * across + 0.8, 1.9 * down + 0.9)
    with new_figure(*size) as figure:
        axes = figure.subplots(down, across, squeeze=False, sharex=True, sharey=True).ravel()
        for axis in axes[len(panels) :]:
            axis.remove()
        handles: dict[str, Any] = {}
        for axis, ((formulation, noise), lines) in zip(axes, panels.items(), strict=False):
            probability_grid, low, high = ecdf_band(min(map(len, lines.values())))
            axis.fill_between(probability_grid, low - probability_grid, high - probability_grid, color="#d9dee5", lw=0)
            for symbol, probabilities in lines.items():
                share = np.searchsorted(probabilities, probability_grid, side="right") / len(probabilities)
                number = symbols.index(symbol)
                style = {"color": SERIES[number % len(SERIES)], "ls": ("-", "--", ":")[number // len(SERIES) % 3]}
                (handles[symbol],) = axis.plot(probability_grid, share - probability_grid, lw=1.2, **style)
            axis.set_title(formulation if len(settings.noise) == 1 else f"{formulation}, {noise}", fontsize=9.5)
        for axis in axes[max(0, len(panels) - across) : len(panels)]:
            axis.tick_params(labelbottom=True)
        figure.supxlabel("posterior probability below the truth", fontsize=10)
        figure.supylabel("ECDF less that of uniform ranks", fontsize=10)
        figure.legend(list(handles.values()), list(handles), loc="outside upper center", ncols=min(8, len(handles)))
    return figure
