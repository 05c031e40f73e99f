"""The result of a ranking of tests: the best next test for every target, table and figures."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence
from functools import partial
from math import isnan
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.drawing.style import ANSWER_WIDTH, BAND, BASE, INK, UNSTABLE, new_figure
from tissuq.experiments.units import stress_unit
from tissuq.model.error_model import typical
from tissuq.model.noise import UnknownNoise
from tissuq.model.tolerances import AS_TESTED, SPECIMEN, TISSUE
from tissuq.next_test.ranking import TIED
from tissuq.next_test.targets import Target
from tissuq.report.result import Number, Picture, Result, Section, Table
from tissuq.report.source_run import said_by
from tissuq.report.tables import significant
from tissuq.studies.design import DesignStudy
from tissuq.studies.fit_settings import SpecimenSettings
from tissuq.studies.run_settings import DesignSettings

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tissuq.model.statistical_model import StatisticalModel

MAX_ROWS = 16
"""Number of tests in a panel of the figure, besides repeats of the tests of the data."""
TABLE_ROWS = 10
"""Number of tests in a table beneath the answer; a folded one has all."""
EVERY = "Every test"
MAX_TARGETS = 2
"""Targets in the answer; the finding and the tables have all."""
FEW_TIES = 2
"""Tests that are named as being as good as the best; of others their number."""
FEW_ROWS, WIDTH = 6, 9.5
"""Number of tests in the figure beside the answer, and width of that of all, inches."""
LETTERS_PER_INCH, LINE = 7, 0.2
"""Of a line of a test's name, for each inch of the figure's width, and height of a line, inches."""
CAPTION = (
    "Expected standard deviation after each test, the best on top. Lines reach from it to the standard deviation now; "
    "a black bar is twice the error of the simulation to either side, an open dot an unreliable number."
)
AFTER_WARNING = "see first to the warning about the fit, whose measurements the ranking takes for right. Then"
NEXT = (
    "make the first of these tests{whose}{again}, and fit it together with the data: "
    "tissuq fit DATA.csv NEW.csv{options}"
)
OR_AGAIN, AS_MUCH = " (the same test again lowers it as much)", 0.01
"""What is said of a repeat of the data, and by how much of the sd now another test must be better."""
BEYOND = UNSTABLE


def _next_step(study: DesignStudy, is_spoilt: bool) -> str:
    """Return what to do: the fit for which the expected reduction holds, with the modes of both files."""
    model, is_other = study.posterior.model, study.specimen == "other"
    tolerances, tests = model.tolerances, model.experiment.tests
    estimand = TISSUE if is_other and tolerances.estimand == SPECIMEN else tolerances.estimand
    errors = f" --estimand {estimand}" * (estimand == (TISSUE if is_other else AS_TESTED))
    measured_errors = {*model.experiment.least_errors, *(("stress", "test") if len(tests) > 1 else ())}
    stated = {name: size for name, size in tolerances.unusual.items() if name not in measured_errors}
    errors += "".join(f" --tolerance {name}={size:g}" for name, size in stated.items())
    ranked, again = next(of_kind for of_kind in map(partial(_ranked, study), study.targets) if len(of_kind[0]))
    best = ranked.iloc[0]
    is_as_much = len(again) and again.iloc[-1]["reduction"] > best["reduction"] - AS_MUCH
    modes = f" --mode {tests[0].mode.name} --mode {best['mode']}" if len(tests) == 1 else ""
    whose = " on another specimen" * is_other
    default = {name: SpecimenSettings.model_fields[name].default for name in ("material", "discrepancies")}
    fitted = f" --material {model.material.name}" * (model.material.name != default["material"])
    fitted += f" --discrepancy {model.discrepancy.name}" * ((model.discrepancy.name,) != default["discrepancies"])
    required = "".join(f" --stable-in {mode}" for mode in study.posterior.solution.stable_in)
    options = fitted + modes + _noise_option(model, best["mode"]) + errors + _prior_options(model) + required
    test = NEXT.format(whose=whose, again=OR_AGAIN * bool(is_as_much), options=options)
    return f"{AFTER_WARNING} {test}" if is_spoilt else test


def _noise_option(model: StatisticalModel, mode: str) -> str:
    """Return the option for the noise of the fit, and of a new test in a mode; empty where nothing need be said."""
    noise, tests = model.noise, model.experiment.tests
    if noise.parameters:
        return f" --noise {noise.name}" * (noise.name != UnknownNoise.name)
    sds = noise.of_tests(model.experiment) * np.sqrt([test.curves[0].averaged for test in tests])
    units = [stress_unit(test.stress_unit).to_mpa for test in tests]
    of_new = typical(sds, [test.mode.name == mode for test in tests]) / units[0]
    is_one_for_all = len({*zip(sds, units, strict=True)}) == 1
    of_each = [of_new] if is_one_for_all else [*(sds / units), of_new]
    return " --noise-sd " + ",".join(f"{sd:g}" for sd in of_each)


def _prior_options(model: StatisticalModel) -> str:
    """Return the options for the priors that were chosen for the fit, in the unit of its first file."""
    to_mpa = stress_unit(model.experiment.tests[0].stress_unit).to_mpa
    texts = (
        f"{p.symbol}={model.chosen_priors[p.symbol].scaled(1 / to_mpa if p.unit else 1.0)}"
        for p in model.parameters
        if p.symbol in model.chosen_priors
    )
    return "".join(f" --prior {shlex.quote(text)}" for text in texts)


def design_table(study: DesignStudy, target: Target, limit: int | None = None) -> Table:
    """Return the tests for one target in the unit of the data, best first, under how uncertain it is now.

    With a limit it has so many of the best, and its note says where the others are.
    """
    every = _rows_of(study, target)
    rows, unit = every[:limit], every["unit"].iloc[0]

    def reduction(row: Any) -> str:
        error = f" ± {100 * row['error']:.1f} %" if row["error"] else ""
        return "" if isnan(row["reduction"]) else f"{100 * row['reduction']:.1f} %{error}"

    columns: dict[str, Callable[[Any], str]] = {
        "test": lambda row: str(row["candidate"]),
        f"expected sd{', ' * bool(unit)}{unit}": lambda row: (
            "" if isnan(row["reduction"]) else f"{row['sd_after']:#.3g}"
        ),
        "reduction": reduction,
        "note": lambda row: str(row["note"]),
    }
    sd_now = significant(float(rows["sd_now"].iloc[0]))
    whose = ", of the tissue" * (study.specimen == "other")
    title = f"{target.title}: sd {sd_now}{' ' * bool(unit)}{unit} now{whose}"
    more = len(every) - len(rows)
    note = f"{more} more tests under '{EVERY}', and in design.csv." if more else ""
    return Table.of((row for _, row in rows.iterrows()), columns, _capitalised(title), text_columns=(0, 3), note=note)


def design_figure(study: DesignStudy, targets: Sequence[Target], limit: int = MAX_ROWS, width: float = WIDTH) -> Figure:
    """Return the expected standard deviation after the best tests, a panel for each target, the best on top."""
    shown = [_shown(_rows_of(study, target), limit) for target in targets]
    lines_of = partial(wrap, width=int(LETTERS_PER_INCH * width), break_on_hyphens=False)
    height = 1.5 + max(sum(0.1 + LINE * len(lines_of(name)) for name in table["candidate"]) for table in shown)
    with new_figure(width, 0.4 + height * len(shown)) as figure:
        axes = figure.subplots(len(shown), 1, squeeze=False)[:, 0]
        for axis, target, table in zip(axes, targets, shown, strict=True):
            _panel(axis, study, target, table, lines_of)
        marks: list[Any] = [axes[0].plot([], [], "o", color=color)[0] for color in (BAND, BEYOND, BASE)]
        words = ["within the measured I1 and I2", "beyond", "repeats of the tests of the data"]
        figure.legend(marks, words, loc="outside lower right", ncols=3 if width == WIDTH else 1, fontsize=9)
    return figure


def design_result(study: DesignStudy, recipe: DesignSettings, run: Path) -> Result:
    """Return what a ranking of tests says.

    Standard deviations are in the unit of the data, which stands beside each.

    Parameters
    ----------
    study : DesignStudy
    recipe : DesignSettings
        The settings, with the run as it is seen from the folder.
    run : Path
        Where it lies.
    """
    said = said_by(run)
    rows = [row for target in study.targets for row in _rows_of(study, target).to_dict("records")]
    model = study.posterior.model
    figure = Picture(
        "design", lambda: design_figure(study, study.targets), "Expected standard deviations after each test", CAPTION
    )
    how_to_read = (
        *study.explanations,
        "The ranking does not know what a laboratory can do: of two tests with nearly the same number choose the one "
        "that is easier to do well.",
    )
    all_tests = [design_table(study, target) for target in study.targets]
    best = [number for target in study.targets if (number := _best(study, target))]
    return Result(
        command="design",
        title="Which test to make next",
        subject=f"{model.experiment.name} · {model.material.name}, discrepancy {model.discrepancy.name}",
        numbers=tuple(best[:MAX_TARGETS]),
        finding=" ".join(_sentences(study)[MAX_TARGETS:]),
        next_step=_next_step(study, bool(said.warnings)) if best else "",
        picture=Picture(
            "answer", lambda: design_figure(study, study.targets[:1], FEW_ROWS, ANSWER_WIDTH),
            "Expected standard deviation after the best tests", "Expected standard deviation after a test; line: now."
        ),
        tables=tuple(design_table(study, target, TABLE_ROWS) for target in study.targets),
        sections=(
            Section(EVERY, (tuple(_sentences(study)), figure, *all_tests)), Section("How to read it", (how_to_read,))
        ),
        warnings=(*said.warnings, *study.warnings),
        files={"design.csv": rows, "design.json": rows},
        recipe=recipe,
    )  # fmt: skip


def _rows_of(study: DesignStudy, target: Target) -> pd.DataFrame:
    """Return the rows of a target, standard deviations in the unit of the data, which stands among them."""
    return study.table[study.table["target"] == target.name]


def _ranked(study: DesignStudy, target: Target) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return the tests of a target with numbers, the best first: new ones, and repeats of those of the data."""
    table = _rows_of(study, target).dropna(subset=["reduction"])
    return table[~table["is_repeat"]], table[table["is_repeat"]]


def _best(study: DesignStudy, target: Target) -> Number | None:
    """Return the best new test for a target, compared with repeating the tests of the data."""
    best, again = _ranked(study, target)
    if not len(best):
        return None
    row = best.iloc[0]
    after = f"{significant(row['sd_after'])} {row['unit']}".strip()
    remark = f"lowers its sd by {100 * row['reduction']:.0f} %, to {after}{_tied(best)}"
    if len(again):
        remark += f"; repeating the data, by {100 * again.iloc[-1]['reduction']:.0f} %"
    return Number(f"For {target.title}:", str(row["candidate"]), remark=remark)


def _sentences(study: DesignStudy) -> list[str]:
    """Return the best test for each target in a sentence, compared with repeating the tests of the data."""
    sentences = []
    for target in study.targets:
        best, again = _ranked(study, target)
        if not len(best):
            continue
        row = best.iloc[0]
        title = _capitalised(target.title)
        reduction = f"{100 * row['reduction']:.0f} %{_tied(best)}"
        words = f"{title}: {row['candidate']}, is expected to lower its sd by {reduction}"
        if len(again):
            repeat = again.iloc[-1]
            words += f"; {repeat['candidate']}, by {100 * repeat['reduction']:.0f} %"
        sentences.append(words + ".")
    return sentences


def _tied(best: pd.DataFrame) -> str:
    """Return which new tests are as good as the best, the first, as a clause; nothing where there are none."""
    names = [str(name) for name in best["candidate"][best["is_tied"]][1:]]
    if not names:
        return ""
    more = f" and {len(names) - FEW_TIES} more" * (len(names) > FEW_TIES)
    return f" ({TIED}: {', '.join(names[:FEW_TIES])}{more})"


def _capitalised(text: str) -> str:
    return text[:1].upper() + text[1:]


def _shown(table: pd.DataFrame, limit: int) -> pd.DataFrame:
    """Return the best tests with numbers, and the tests of the data again."""
    ranked = table.dropna(subset=["reduction"])
    ranks = np.arange(len(ranked))
    return ranked[ranked["is_repeat"].to_numpy() | (ranks < limit)]


def _panel(
    axis: Axes, study: DesignStudy, target: Target, table: pd.DataFrame, lines_of: Callable[[str], list[str]]
) -> None:
    """Draw the tests of one target, their names in lines."""
    sd_now, unit, heights = float(table["sd_now"].iloc[0]), table["unit"].iloc[0], np.arange(len(table))[::-1]
    for height, (_, row) in zip(heights, table.iterrows(), strict=True):
        sd_after, error = row["sd_after"], 2 * row["error"] * sd_now
        color = BASE if row["is_repeat"] else BEYOND if row["beyond"] > 0 else BAND
        axis.plot([sd_after, sd_now], [height, height], color=color, lw=2, alpha=0.4, solid_capstyle="butt")
        axis.plot([sd_after - error, sd_after + error], [height, height], color=INK, lw=1.2)
        axis.plot(sd_after, height, "o", color="white" if row["is_rough"] else color, mec=color, ms=6)
    axis.axvline(sd_now, color=INK, lw=1)
    axis.set_yticks(heights, ["\n".join(lines_of(name)) for name in table["candidate"]])
    axis.set_ylim(-0.7, len(table) - 0.3)
    axis.set_xlim(0, 1.04 * sd_now)
    axis.locator_params(axis="x", nbins=4)
    axis.xaxis.set_major_formatter("{x:.3g}")
    axis.set_title(target.title)
    axis.set_xlabel(f"expected sd after the test{f' [{unit}]' if unit else ''}\n(line: now)", loc="right")
    axis.tick_params(axis="y", length=0)
