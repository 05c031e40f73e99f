"""Where the draws of a fit are stable: rows for files, cells of the summary, and the section of a page."""

from __future__ import annotations

from collections.abc import Mapping

from tissuq.assessment.stability import MIN_LOSS_PROBABILITY
from tissuq.posterior.posterior import Posterior
from tissuq.report.result import Section, Table
from tissuq.report.tables import Row, known_number, percent, stretch_in_words

__all__ = ["SAME_STATES", "STABILITY", "stability_cells", "stability_rows", "stability_section"]

STABILITY = ("stable", "lost_at", "lost_at_low", "lost_at_high")
"""Of `stability_cells`."""
SAME_STATES = (
    "Tension in one mode may be compression in another: what is pressed to 0.6 along two axes (equibiaxial "
    "compression) grows to 1 / 0.6² = 2.8 along the third, for its volume stays: the state of uniaxial tension to 2.8."
)
HEADERS = [
    "discrepancy", "loading mode", "stretch", "stable throughout, probability", "lost in compression at",
    "lost in tension at",
]  # fmt: skip
WORDS = (
    "Stable means that from rest onward the greater principal stress lies along the greater stretch (Baker-Ericksen), "
    "every small change of stress does positive work (Drucker), and the engineering stress rises with the stretch. It "
    "is checked over the stretches within which both invariants were measured, for the material together with a "
    "discrepancy that is an energy; any other discrepancy does not affect stability and is left out. Lost in "
    "compression or tension: median and 95 % interval of the draws that become unstable, if stability is lost with a "
    "probability above 5 %."
)


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
            }
            row |= {
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
    cells = [
        [
            row["formulation"],
            row["mode"],
            f"{row['stretch_low']:.3g} to {row['stretch_high']:.3g}",
            percent(row["stable"]),
            *(
                stretch_in_words(*(row[f"lost_{side}_{name}"] for name in ("median", "low", "high")))
                if row[f"lost_{side}_probability"] > MIN_LOSS_PROBABILITY
                else ""
                for side in ("below", "above")
            ),
        ]
        for row in rows
    ]
    return Section("Where it is stable", (WORDS, Table(HEADERS, cells, text_columns=(1,)), SAME_STATES))
