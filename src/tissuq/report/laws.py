"""The folder of a comparison of laws: table, posteriors, figures and a page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tissuq.drawing import pieces
from tissuq.drawing.panels import columns_of, legend_above, on_figure
from tissuq.drawing.style import BASE, SERIES, new_figure
from tissuq.pictures.curves import points_along, ways_of
from tissuq.prediction.bands import predict_band
from tissuq.report.run_folder import write_figures, write_page, write_posteriors
from tissuq.report.specimen import lines_of_tests, noise_in_words, write_inputs
from tissuq.report.tables import (
    in_unit_of,
    known_number,
    readable_methods,
    significant,
    tolerances_in_words,
    with_named_units,
    write_csv,
    write_json,
)
from tissuq.result_warning import in_shell
from tissuq.studies.laws import LawStudy

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["HEADERS", "law_lead", "readable_laws", "write_law_run"]

MAX_DRAWN, LINE_POINTS = 6, 80
"""Laws of which curves are drawn, and points of each."""
SIGNIFICANT_ERRORS = 2.0
"""Standard errors of a difference of elpd beyond which it counts."""
MODULUS = ("modulus", "modulus_low", "modulus_high")
"""Columns that are stresses."""
HEADERS = [
    "law", "modulus", "95 % HPD", "parameters", "probability", "elpd less best", "R2 alone", "error alone",
    "share of discrepancy", "stable / to 1.5 I",
]  # fmt: skip


def write_law_run(study: LawStudy, sources: Sequence[Path], folder: Path, *, figures: bool = True) -> None:
    """Write the results of a comparison into an empty folder; arguments as of `write_specimen_run`."""
    command = write_inputs(study.settings, study.experiment, sources, folder, figures=figures)
    rows = [
        {"law": name} | {str(column): known_number(value) for column, value in row.items()}
        for name, row in study.comparison.table_in("MPa").iterrows()
    ]
    write_csv(folder / "laws.csv", with_named_units(rows, MODULUS, study.unit))
    write_json(folder / "laws.json", in_unit_of(rows, MODULUS, study.unit))
    write_posteriors(folder, study.comparison.fits)
    if figures:
        write_figures(folder, {"moduli": modulus_figure(study), "curves": curve_figure(study)})
    write_page(folder, "laws.html", **_context(study), command=command)


def readable_laws(study: LawStudy) -> list[list[str]]:
    """Return the rows of the table in words, under `HEADERS`; the moduli in the unit of the file."""
    return [_readable(str(name), row, study.unit.to_mpa) for name, row in study.comparison.table_in("MPa").iterrows()]


def _readable(name: str, row: Any, to_mpa: float) -> list[str]:
    median, low, high = (significant(value / to_mpa) for value in (row.modulus, row.modulus_low, row.modulus_high))
    difference = f"{row.elpd_difference:.1f} +- {row.elpd_difference_error:.1f}"
    return [
        name,
        median,
        f"[{low}, {high}]",
        f"{row.parameters:.0f}",
        _percent(row.probability),
        difference if row.elpd_difference else "best",
        "" if row.r_squared != row.r_squared else f"{row.r_squared:.4f}",
        _percent(row.nrmse),
        _percent(row.discrepancy_share),
        f"{_percent(row.stable)} / {_percent(row.stable_beyond)}" if row.stable == row.stable else "",
    ]


def law_lead(study: LawStudy) -> str:
    """Return the finding in a few sentences."""
    comparison, unit = study.comparison, study.unit
    table, modulus = comparison.table_in("MPa"), comparison.modulus
    low, high = (significant(end / unit.to_mpa) for end in modulus.hdi())
    is_close = table.elpd_difference > -SIGNIFICANT_ERRORS * table.elpd_difference_error
    close = [str(name) for name in table.index[is_close | (table.elpd_difference == 0)]]
    told = (
        f"of {len(table)} laws, only {close[0]} describes the measurements so well that no other is as good"
        if len(close) == 1
        else f"{len(close)} of {len(table)} laws, with the discrepancy '{study.settings.discrepancies[0]}', predict "
        f"left-out measurements equally well: the data do not tell these apart"
    )
    nearest = table.nrmse.dropna().nsmallest(1)
    alone = [
        f" Alone, without discrepancy, {name} comes nearest to the measurements (error {100 * error:.1f} %)."
        for name, error in nearest.items()
    ]
    median = significant(float(modulus.quantile(0.5)) / unit.to_mpa)
    return (
        f"The initial shear modulus, averaged over the laws, is {median} {unit.name}, 95 % HPD {low} to {high} "
        f"{unit.name}; {100 * comparison.between:.2g} % of its variance is between the laws. "
        f"{told[0].upper()}{told[1:]}." + "".join(alone)
    )


def modulus_figure(study: LawStudy) -> Figure:
    """Return the moduli of all laws with 95 % HPD, and their average."""
    with new_figure(8.2, 0.34 * (len(study.comparison.fits) + 1) + 1.0) as figure:
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
            pieces.points(axis, curve.abscissa, curve.stress / scale, color=BASE)
            at = points_along(curve, LINE_POINTS)
            options: dict[str, Any] = {"noise": False, "mode": curve.mode, "channel": curve.channel}
            for number, name in enumerate(names):
                found = predict_band(study.comparison.alone[name].solution, at, **options)
                for places, is_curve in ways_of(curve.mode, at, found.stretch):
                    pieces.line(axis, found.stretch[places], found.median[places] / scale, color=SERIES[number],
                                width=1.2, is_path=is_curve, label=name)  # fmt: skip
            axis.set_title(curve.name)
            axis.set_xlabel(curve.mode.controls[0].name)
            axis.set_ylabel(f"engineering stress [{study.unit.name}]")
        legend_above(figure, axes, 4)
    return figure


def _context(study: LawStudy) -> dict[str, Any]:
    comparison = study.comparison
    return {
        "experiment": study.experiment,
        "tests": lines_of_tests(study.experiment),
        "lead": law_lead(study),
        "headers": [HEADERS[0], f"modulus [{study.unit.name}]", *HEADERS[2:]],
        "rows": readable_laws(study),
        "warnings": list(map(in_shell, study.warnings)),
        "estimand": study.tolerances.meaning,
        "tolerances": tolerances_in_words(study.tolerances, study.unit),
        "discrepancy": study.settings.discrepancies[0],
        "noise": noise_in_words(study.settings, next(iter(comparison.fits.values())), study.unit),
        "methods": readable_methods(comparison.fits),
        "skipped": comparison.skipped,
    }


def _percent(share: float) -> str:
    return "" if share != share else "< 0.1 %" if 0 < share < 0.001 else f"{100 * share:.3g} %"
