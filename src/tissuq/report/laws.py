"""The result of a comparison of laws: the averaged modulus, which law, table, posteriors and figures."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tissuq.assessment.answer import Answer
from tissuq.assessment.next_step import STEPS
from tissuq.assessment.uses import MIN_STABLE, Verdict
from tissuq.drawing import pieces
from tissuq.drawing.panels import columns_of, legend_above, on_figure
from tissuq.drawing.style import ANSWER_WIDTH, BASE, SERIES, new_figure
from tissuq.experiments.units import StressUnit
from tissuq.pictures.curves import points_along, ways_of
from tissuq.posterior.laws import ALL_LAWS
from tissuq.report.inputs import with_inputs
from tissuq.report.measured import computed_section, data_section, named, subject_of
from tissuq.report.result import Number, Picture, Result, Section, Table
from tissuq.report.source_run import LAW_OF_USE
from tissuq.report.tables import known_number, significant, table_files
from tissuq.report.writer import data_file, posterior_files
from tissuq.studies.laws import LawStudy

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MAX_DRAWN, LINE_POINTS = 6, 80
"""Laws of which curves are drawn, and points of each."""
FEW_LAWS = 3
"""Laws that a title names; fewer are named beside the best."""
DECIDED = 0.95
"""Probability of a law from which the data tell it from the others."""
MODULUS = ("modulus", "modulus_low", "modulus_high")
"""Columns that are stresses."""
HOW_TO_READ = (
    "Probability: of the law with its discrepancy, were all laws as probable before the data. A law with more "
    "parameters pays for those that the data do not need. It says nothing about whether a law is true.",
    "elpd minus best: by how much the expected log density of new measurements (each left out in turn) falls short of "
    "the best, with its standard error. Less than two errors is no difference.",
    "R2 and error alone: of the law by itself, fitted by least squares; the error is the root mean square over that "
    "of the stress. Share of discrepancy: of the stress beside this law, on average.",
    "Stable / 50 % beyond: probability of stability over the range of I1 and I2 that was measured, and up to 1.5 times "
    "these, with the discrepancy where it is an energy; in the least stable loading mode.",
    "To continue with one law: tissuq predict, export or design with this folder and --material LAW.",
)


def law_result(study: LawStudy, beside: Path = Path()) -> Result:
    """Return what a comparison of laws says; relative files of its settings lie in ``beside``."""
    comparison, settings, unit = study.comparison, study.settings, study.unit
    rows = [
        {"law": name} | {str(column): known_number(value) for column, value in row.items()}
        for name, row in comparison.table_in("MPa").iterrows()
    ]
    files, discrepancy = table_files("laws", rows, MODULUS, unit), settings.discrepancies[0]
    caption = (
        f"Initial shear modulus under every law with the discrepancy '{discrepancy}': mean and 95 % interval, and the "
        "average by the laws' probabilities."
    )
    law, names = study.recommended, list(comparison.fits)
    laws = " and ".join([", ".join(names[:-1]), names[-1]])
    answer, meaning = comparison.fits[law].answer, next(iter(comparison.fits.values())).model.meaning
    result = Result(
        command="fit",
        title=f"{named(study.experiment)}: which law of {laws if len(names) <= FEW_LAWS else len(names)}",
        subject=subject_of(study.experiment),
        numbers=_numbers(study),
        finding=f"{law_lead(study)} The interval is of {meaning}.",
        uses=tuple(use._replace(purpose=f"{use.purpose}{LAW_OF_USE}{law}") for use in answer.uses),
        next_step=_next_step(law, answer, is_of_all=settings.laws == (ALL_LAWS,)),
        picture=Picture("moduli", lambda: modulus_figure(study), "Initial shear moduli of the laws", caption),
        tables=(law_table(study),),
        sections=_sections(study),
        warnings=tuple(study.warnings),
        files=data_file(study.experiment, unit) | files | posterior_files(comparison.fits),
    )  # fmt: skip
    return with_inputs(result, study, beside)


def _next_step(law: str, answer: Answer, *, is_of_all: bool) -> str:
    """Return what to do next, in agreement with the verdicts on the best law; other laws only where some were left out.

    The law is gone on with where its modulus can be reported, and half of all uses are open to it.
    """
    step = STEPS["design"] if is_of_all and answer.next_step == STEPS["law"] else answer.next_step
    words = step.shell.replace("{run}", f"{{run}} --material {law}")
    purposes = [use.purpose for use in answer.uses if use.verdict is not Verdict.NO]
    if answer.uses[0].verdict is Verdict.NO or 2 * len(purposes) < len(answer.uses):
        but = f"serves only to {' and to '.join(purposes)}" if purposes else "is of no use yet"
        return f"{law} is as good as any here, but {but}: {words}"
    if "{run}" not in words:
        return f"{words} As good as any here is {law}: tissuq predict {{run}} --material {law} (export, design, too)"
    return f"continue with {law}, which is as good as any here: {words}"


def _numbers(study: LawStudy) -> tuple[Number, ...]:
    """Return the averaged modulus, the most probable law, and the one that predicts best."""
    comparison, scale = study.comparison, study.unit.to_mpa
    table, modulus = comparison.table_in("MPa"), comparison.modulus
    low, high = (end / scale for end in modulus.hdi())
    mean = modulus.mean / scale
    numbers = [Number("initial shear modulus, averaged over the laws", mean, low, high, study.unit.name)]
    if table.probability.notna().any():
        law = str(table.probability.idxmax())
        remark = f"probability {_percent(float(table.probability[law]))}"
        numbers.append(Number("most probable law", law, remark=remark))
    best = str(table.elpd_difference.idxmin())
    rivals = [law for law in study.close if law != best]
    named_others = " and ".join(rivals) if len(rivals) < FEW_LAWS else f"{len(rivals)} others"
    as_good = f"with its discrepancy as good: {named_others}" if rivals else "no other as good"
    stable = float(table.stable[best])
    but = f"; stable over the measured range with a probability of {_percent(stable)}" if stable < MIN_STABLE else ""
    return (*numbers, Number("best for left-out measurements", best, remark=as_good + but))


def columns_of_laws(unit: StressUnit) -> dict[str, Callable[[Any], str]]:
    """Return how cells are made of a row of `LawComparison.table_in` in MPa; the modulus in a unit."""

    def modulus(row: Any) -> str:
        return "[{}, {}]".format(*(significant(end / unit.to_mpa) for end in (row.modulus_low, row.modulus_high)))

    def difference(row: Any) -> str:
        words = f"{0.0 - row.elpd_difference:.1f} ± {row.elpd_difference_error:.1f}"
        return words if row.elpd_difference else "best"

    def stability(row: Any) -> str:
        return f"{_percent(row.stable)} / {_percent(row.stable_beyond)}" if row.stable == row.stable else ""

    return {
        "law": lambda row: str(row.name),
        f"modulus [{unit.name}]": lambda row: significant(row.modulus / unit.to_mpa),
        "95 % interval": modulus,
        "parameters": lambda row: f"{row.parameters:.0f}",
        "probability": lambda row: _percent(row.probability),
        "elpd minus best": difference,
        "R2 alone": lambda row: "" if row.r_squared != row.r_squared else f"{row.r_squared:.4f}",
        "error alone": lambda row: _percent(row.nrmse),
        "share of discrepancy": lambda row: "> 100 %" if row.discrepancy_share > 1 else _percent(row.discrepancy_share),
        "stable / 50 % beyond": stability,
    }


def law_table(study: LawStudy) -> Table:
    """Return the laws beside one another as text, the moduli in the unit of the file."""
    rows = (row for _, row in study.comparison.table_in("MPa").iterrows())
    return Table.of(
        rows, columns_of_laws(study.unit), f"Laws of {study.experiment.name}, moduli in {study.unit.name}",
        note="Log evidences, intervals of the shares and times are in `laws.csv`.",
    )  # fmt: skip


def law_lead(study: LawStudy) -> str:
    """Return the finding in a few sentences."""
    comparison, unit = study.comparison, study.unit
    table, modulus = comparison.table_in("MPa"), comparison.modulus
    low, high = (significant(end / unit.to_mpa) for end in modulus.hdi())
    close = study.close
    comparison_words = (
        f"of {len(table)} laws, only {close[0]} describes the measurements so well that no other is as good"
        if len(close) == 1
        else f"{len(close)} of {len(table)} laws, with the discrepancy '{study.settings.discrepancies[0]}', predict "
        f"left-out measurements equally well{_though(table.probability)}"
    )
    nearest = table.nrmse.dropna().nsmallest(1)
    misfit_words = [
        f" Alone, without discrepancy, {name} comes nearest to the measurements (error {100 * error:.1f} %)."
        for name, error in nearest.items()
    ]
    mean = significant(modulus.mean / unit.to_mpa)
    return (
        f"The initial shear modulus, averaged over the laws, has the mean {mean} {unit.name}, 95 % interval {low} to "
        f"{high} {unit.name}; {100 * comparison.between:.2g} % of its variance is between the laws. "
        f"{comparison_words[0].upper()}{comparison_words[1:]}." + "".join(misfit_words)
    )


def _though(probability: Any) -> str:
    """Return what the probabilities of the laws say beside predictions that are equally good."""
    if probability.isna().all():
        return ""
    law, largest = str(probability.idxmax()), float(probability.max())
    if largest < DECIDED:
        return ": the data do not tell these apart"
    return (
        f"; that {law} is the most probable ({_percent(largest)}) is due to how many parameters a law has and how wide "
        "their priors are, too"
    )


def modulus_figure(study: LawStudy) -> Figure:
    """Return the moduli of all laws with 95 % interval, and their average."""
    with new_figure(ANSWER_WIDTH, 0.34 * (len(study.comparison.fits) + 1) + 1.0) as figure:
        study.comparison.plot(figure.subplots(), unit=study.unit.name)
    return figure


def curve_figure(study: LawStudy) -> Figure:
    """Return the stress of the laws alone that come nearest, over the measurements, a panel for each curve."""
    curves, scale = study.experiment.curves, study.unit.to_mpa
    names = [str(name) for name in study.comparison.table.nrmse.dropna().nsmallest(MAX_DRAWN).index]
    columns = columns_of(len(curves))
    with new_figure(8.2, (4.2 if len(curves) == 1 else 3.4) * -(-len(curves) // columns) + 0.7) as figure:
        axes = on_figure(figure, len(curves), columns).axes
        for axis, curve in zip(axes, curves, strict=True):
            pieces.points(axis, curve.drawn_at(), curve.stress / scale, color=BASE, is_back=curve.is_back)
            points = points_along(curve, LINE_POINTS)
            states, abscissa = curve.path.at(points), curve.drawn_at(points)
            ways = ways_of(curve.mode, points, abscissa)
            for number, name in enumerate(names):
                stress = study.comparison.alone[name].stress(states)
                pieces.line(axis, abscissa, stress / scale, color=SERIES[number], width=1.2, ways=ways, label=name)
            axis.set_title(curve.name)
            axis.set_xlabel(curve.drawn_name)
            axis.set_ylabel(f"engineering stress [{study.unit.name}]")
        legend_above(figure, axes, 4)
    return figure


def _sections(study: LawStudy) -> tuple[Section, ...]:
    """Return what a page folds: the curves of the laws, how to read the table, how it was computed, the data."""
    comparison = study.comparison
    caption = "The laws by themselves, without discrepancy: least squares, those that come nearest to the measurements."
    curves = Picture("curves", lambda: curve_figure(study), "Curves of the laws", caption, is_slim=True)
    return (
        Section("The laws alone", (curves,)),
        Section("How to read it", (HOW_TO_READ,)),
        computed_section(comparison.fits, comparison.skipped),
        data_section(study, next(iter(comparison.fits.values()))),
    )


def _percent(share: float) -> str:
    return "" if share != share else "< 0.1 %" if 0 < share < 0.001 else f"{100 * share:.3g} %"
