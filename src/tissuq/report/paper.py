"""The result of the paper's study: which formulations hold the true C10, its seven figures and its claims."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from operator import itemgetter
from typing import TYPE_CHECKING, Any

from tissuq.drawing.style import ANSWER_WIDTH
from tissuq.experiments.modes import Uniaxial
from tissuq.experiments.units import StressUnit
from tissuq.mechanics import Yeoh, engineering_stress
from tissuq.report.figures import marginal_figure, predictive_figure
from tissuq.report.result import Block, Number, Picture, Result, Section, Table
from tissuq.report.summary import parameter_table, summary_row, summary_table, summary_tables
from tissuq.report.tables import Row
from tissuq.report.writer import data_file, posterior_files
from tissuq.validation.paper.study import AMPLITUDE_BOUNDS, FORMULATIONS, Fitted, PaperStudy

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MPA = StressUnit("MPa", 1.0)
PAGES = {
    1: (
        ("none", "constant", "linear", "quadratic"),
        "Polynomial discrepancies",
        "The error S is free, so the band can grow until it holds about 95 % of the data whatever the mean does. Where "
        "the predicted median stays near that of the fit without discrepancy (dotted) and away from the measurements, "
        "the band covers the data without explaining them.",
    ),
    3: (
        ("none", "mooney-rivlin", "yeoh"),
        "Hyperelastic discrepancies",
        "The Yeoh mean contains the truth, so its C10 keeps its meaning; the Mooney-Rivlin term does not, and its C01 "
        "absorbs part of the initial stiffness.",
    ),
    5: (
        ("none", "gp"),
        "A Gaussian process",
        "A process follows the data as far as the prior of its amplitude c allows; beyond that C10 has to adapt. The "
        "table of ranges and bounds below shows how much the verdict depends on this.",
    ),
}
"""The formulations of each pair of the paper's figures, its title, and what it shows, by the number of the first."""
FIGURE_7 = (
    "Figure 7 (numbered as in the paper). Marginal posteriors of C10: density (each to its own scale), 95 % interval "
    "(bar) and median (dot). Blue: the interval holds the true value; grey: it does not."
)
NOTE = (
    "The log evidence is that of the data in MPa with respect to the normalised priors, uniform densities "
    "included: wider boxes lower it. {nuts}With the Mooney-Rivlin term the initial shear modulus is 2 (C10 + C01), so "
    "C10 alone is not half the modulus there."
)
AGREEMENT: dict[str, Callable[[Row], str]] = {
    "formulation": itemgetter("formulation"),
    "mean": lambda row: f"{row['mean_shift_in_sd']:+z.3f}",
    "sd ratio": lambda row: f"{row['sd_ratio']:.3f}",
    "95 % low": lambda row: f"{row['hdi_low_shift_in_sd']:+z.3f}",
    "95 % high": lambda row: f"{row['hdi_high_shift_in_sd']:+z.3f}",
    "R-hat": lambda row: f"{row['rhat']:.4f}",
    "ESS": lambda row: f"{row['ess']:.0f}",
    "converged": lambda row: "yes" if row["converged"] else "NO",
}


def paper_result(study: PaperStudy) -> Result:
    """Return what the study says."""
    main, settings = _posteriors(study.main), study.settings
    summary = _summary(study, study.main)
    files = data_file(study.experiment) | summary_tables(summary, main) | posterior_files(main)
    if study.sampled:
        sampled = _posteriors(study.sampled)
        files |= summary_tables(_summary(study, study.sampled), sampled, "-nuts") | posterior_files(sampled, "-nuts")
        files["agreement.csv"] = _agreement(study)
    files |= {"sensitivity.csv": [vars(cell) for cell in study.cells], "claims.csv": _claims(study)}
    held = [row["formulation"] for row in summary if row["contains_truth"]]
    passed = [name for name, fit in study.main.items() if fit.finding.passes]
    table = summary_table(summary, MPA, "The study of the paper: neo-Hookean C10 under seven formulations")
    nuts = "NUTS gives no evidence. " * (settings.sampler == "nuts")
    return Result(
        command="paper",
        title="How much model uncertainty does a soft-tissue parameter need?",
        subject="the study of section 5 of Zeraatpisheh, Bordas & Beex, Data-Centric Engineering (2021)",
        numbers=_numbers(summary, held, passed),
        finding=f"A Yeoh material is measured at {settings.points} stretches, with noise, and its parameter C10 is "
        "identified with a neo-Hookean model, which is deliberately wrong. Six discrepancies and a fit without "
        f"one are compared. {len(held)} of the seven 95 % intervals hold the true C10 = {settings.truth['C10']} MPa "
        f"({_listed(held)}), while {len(passed)} of the seven pass the predictive check ({_listed(passed)}). "
        "**Passing the check says nothing about the parameter.**",
        next_step="fit your own test: tissuq fit FILE; its discrepancy 'auto' weighs such descriptions by the data.",
        picture=Picture(
            "figure7", lambda: marginal_figure(main, "C10", MPA, settings.truth["C10"], ANSWER_WIDTH),
            "Marginal posteriors of C10 for seven formulations", FIGURE_7, is_slim=True,
        ),
        tables=(replace(table, note=f"{table.note} {NOTE.format(nuts=nuts)}"),),
        sections=_sections(study),
        warnings=tuple(study.warnings),
        files=files,
        recipe=settings,
    )  # fmt: skip


def _listed(names: list[str]) -> str:
    return ", ".join(names) or "none of them"


def _numbers(summary: list[Row], held: list[str], passed: list[str]) -> tuple[Number, ...]:
    """Return the formulation that the evidence prefers with its C10, and how many intervals and checks hold."""
    numbers, count = [], len(summary)
    weighed = [row for row in summary if row["log_evidence"] is not None]
    if weighed:
        row = max(weighed, key=lambda row: float(row["log_evidence"]))
        mean, low, high = (float(row[f"C10_{name}"]) for name in ("mean", "hdi_low", "hdi_high"))
        number = Number("", mean, low, high, "MPa")
        numbers.append(
            Number("preferred by the evidence", str(row["formulation"]), remark=f"C10 {number.text}, {number.beside}")
        )
    numbers.append(Number("intervals that hold the true C10", f"{len(held)} of {count}"))
    remark = "as many measurements inside their 95 % bands as chance allows, or more"
    return (*numbers, Number("pass the predictive check", f"{len(passed)} of {count}", remark=remark))


def _sections(study: PaperStudy) -> tuple[Section, ...]:
    """Return what a page folds: the question, the paper's figures and claims, ranges, routes, parameters."""
    settings, truth = study.settings, study.settings.truth
    question = (
        "Measured stress = material + discrepancy + noise (the form of Kennedy & O'Hagan). The material is "
        f"neo-Hookean, with uniaxial stress 2 C10 (λ − λ^−2). The truth is Yeoh: C10 = {truth['C10']}, "
        f"C20 = {truth['C20']}, C30 = {truth['C30']} MPa, measured at {settings.points} stretches from "
        f"{settings.stretch_low} to {settings.stretch_high} with a noise of sd {settings.noise_sd} MPa. The "
        "discrepancy is absent, or has a constant, linear or quadratic mean, or the mean stress of a Mooney-Rivlin or "
        "of Yeoh terms (these five with an independent error of unknown sd S), or is a Gaussian process. The paper "
        "prints neither the number of points nor the range nor the bounds of its priors; all but one of its claims are "
        "confirmed together with the defaults of this study: 30 points on [0.5, 4.25], C10 and S uniform on [0, 10] "
        "MPa, the coefficients of the means on [-50, 50] MPa, c on [0, 1] MPa and psi on [0.05, 10].",
    )
    groups = [_group(study, number, *page) for number, page in PAGES.items()]
    sections = [Section("The question", question), *groups, Section("The paper's claims, one by one", _verdicts(study))]
    sections.append(Section("What the ranking depends on", _ranges(study)))
    if study.sampled:
        words = (
            "The exact route integrates; NUTS samples the joint density, as the paper does. Distances in units of the "
            "exact posterior sd of C10."
        )
        sections.append(Section("Two independent routes", (words, Table.of(_agreement(study), AGREEMENT))))
    times = [[name, f"{fit.seconds:.2f}"] for name, fit in study.main.items()]
    took = Section("How long it took", (Table(["formulation", "seconds"], times),))
    return (*sections, Section("Every parameter", (parameter_table(_posteriors(study.main)),)), took)


def _group(study: PaperStudy, number: int, formulations: tuple[str, ...], title: str, text: str) -> Section:
    """Return what a group shows, with its two figures: with the discrepancy, and the model alone."""
    shown = {name: study.main[name].posterior for name in formulations}
    condition = ", the process conditioned on the data" if "gp" in shown else ""
    with_it = f"Figure {number}. Predictive check with the discrepancy (eq. 27){condition}."
    without_it = f"Figure {number + 1}. The model alone, without the discrepancy's share (eq. 28), same data."
    words = title.lower()
    return Section(title, (
        text,
        Picture(f"figure{number}", partial(_predictive, study, shown, discrepancy=True), f"Predictive bands: {words}",
                with_it),
        Picture(f"figure{number + 1}", partial(_predictive, study, shown, discrepancy=False),
                f"Bands of the model alone: {words}", without_it),
    ))  # fmt: skip


def _predictive(study: PaperStudy, shown: dict[str, Any], *, discrepancy: bool) -> Figure:
    stretch = study.settings.stretch
    truth = [study.settings.truth[p.symbol] for p in Yeoh.parameters]
    curve = stretch, engineering_stress(Yeoh(), Uniaxial(), stretch, truth)
    return predictive_figure(shown, discrepancy=discrepancy, unit=MPA, true_curve=curve)


def _verdicts(study: PaperStudy) -> tuple[Block, ...]:
    replicates = study.settings.replicates
    rows = [
        [verdict.claim.text, verdict.word, f"{verdict.times} of {verdict.decided}",
         f"{verdict.observed}.{f' {verdict.claim.note}' if verdict.claim.note else ''}"]
        for verdict in study.verdicts
    ]  # fmt: skip
    counted = (
        "Run with `--replicates 20` to see how often each claim is confirmed."
        if replicates == 1
        else f"The third column counts over {replicates} data sets, which differ in their noise alone."
    )
    note = (
        "A predictive check counts as passed when the number of measurements inside the 95 % band is not below the "
        f"2.5 % quantile of the binomial distribution. {counted}"
    )
    return (Table(["claim", "this data set", f"of {replicates}", "result here"], rows, text_columns=(1, 3), note=note),)


def _ranges(study: PaperStudy) -> tuple[Block, ...]:
    cells, replicates = _cells(study), study.settings.replicates
    times = "Whether" if replicates == 1 else f"In how many of {replicates} data sets"
    words = (
        f"{times} the 95 % interval holds the true C10, for several stretch ranges, and for the process with its "
        "amplitude c uniform up to 1 or up to 10 MPa. The ranking changes with the range, and the verdict on the "
        "process with its prior box; a reader of the paper should not take either as a property of the formulation."
    )
    return words, cells


def _posteriors(fitted: dict[str, Fitted]) -> dict[str, Any]:
    return {name: fit.posterior for name, fit in fitted.items()}


def _summary(study: PaperStudy, fitted: dict[str, Fitted]) -> list[Row]:
    truth = study.settings.truth["C10"]
    return [summary_row(name, fit.posterior, fit.seconds, truth) for name, fit in fitted.items()]


def _agreement(study: PaperStudy) -> list[Row]:
    rows = []
    for name, sampled in study.sampled.items():
        exact, nuts = (fit.posterior.solution.marginals["C10"] for fit in (study.main[name], sampled))
        diagnostics = sampled.posterior.solution.diagnostics
        ends = [(b - a) / exact.sd for a, b in zip(exact.hdi(), nuts.hdi(), strict=True)]
        rows.append(
            {
                "formulation": name,
                "mean_shift_in_sd": (nuts.mean - exact.mean) / exact.sd,
                "sd_ratio": nuts.sd / exact.sd,
                "hdi_low_shift_in_sd": ends[0],
                "hdi_high_shift_in_sd": ends[1],
                "rhat": diagnostics.rhat["C10"] if diagnostics else None,
                "ess": min(diagnostics.ess_bulk["C10"], diagnostics.ess_tail["C10"]) if diagnostics else None,
                "converged": diagnostics.converged if diagnostics else None,
            }
        )
    return rows


def _claims(study: PaperStudy) -> list[Row]:
    return [
        {
            "claim": verdict.claim.text,
            "this_data_set": verdict.word,
            "times": verdict.times,
            "decided": verdict.decided,
            "found": verdict.observed,
        }
        for verdict in study.verdicts
    ]


def _cells(study: PaperStudy) -> Table:
    """Return the sensitivity table: a row a range, a column a formulation."""
    columns: list[tuple[str, float | None]] = [(name, None) for name in FORMULATIONS if name != "gp"]
    columns += [("gp", bound) for bound in AMPLITUDE_BOUNDS]
    cells = {(c.stretch_low, c.stretch_high, c.formulation, c.amplitude_bound): c for c in study.cells}
    ranges = list(dict.fromkeys((cell.stretch_low, cell.stretch_high) for cell in study.cells))

    def word(held: int) -> str:
        return ("yes" if held else "no") if study.settings.replicates == 1 else f"{held}/{study.settings.replicates}"

    return Table(
        ["stretch range", *(name if bound is None else f"{name}, c up to {bound:g} MPa" for name, bound in columns)],
        [
            [f"{low:g} to {high:g}", *(word(cells[low, high, *column].held) for column in columns)]
            for low, high in ranges
        ],
    )
