"""The folder of a prediction: bands and scores as tables and labelled arrays, the figure and a page."""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.report.common import write_figures, write_recipe
from tissuq.report.page import embedded_figure, render
from tissuq.report.prediction_figures import prediction_figure
from tissuq.report.rows import interval, significant
from tissuq.report.run_folder import INPUT, RECIPE
from tissuq.report.tables import write_csv, write_json
from tissuq.studies.prediction import Prediction

if TYPE_CHECKING:
    import pandas as pd

    from tissuq.studies.prediction_settings import PredictionSettings

__all__ = [
    "band_headers",
    "readable_bands",
    "readable_scores",
    "score_headers",
    "write_prediction_run",
]

MOST_ROWS = 13
"""Of the bands, for people; the files have all."""
MOST_SHARE, LARGE, NOTHING = 10.0, 1e5, 1e-12
"""Shares, and stresses in their unit, of which no digit is worth reading, and those that are rounding."""


def write_prediction_run(
    found: Prediction,
    settings: PredictionSettings,
    folder: Path,
    target: Path,
    beside: Path = Path(),
    *,
    law: str | None = None,
    figures: bool = True,
) -> None:
    """Write everything that a prediction leaves behind into an empty folder.

    Parameters
    ----------
    found : Prediction
    settings : PredictionSettings
        From which it came.
    folder : Path
        Exists and is empty.
    target : Path
        What the folder will be in the end: the recipe names the run from there.
    beside : Path
        Where the relative paths of the settings lie.
    law : str, optional
        The material that was named, where it is a law in the user's file.
    figures : bool
        Draw them, too.
    """
    command = f"predict{'' if figures else ' --no-figures'}{f' --material {law}' if law else ''}"
    kept: dict[str, Any] = {"run": os.path.relpath(beside / settings.run, target), "mode": found.mode.name}
    if settings.data is not None:
        (folder / INPUT).mkdir()
        source = beside / settings.data.file
        shutil.copyfile(source, folder / INPUT / source.name)
        copy = {"file": f"{INPUT}/{source.name}", "mode": found.mode.name}
        kept["data"] = settings.data.model_copy(update=copy)
    write_recipe(folder, command, settings.model_copy(update=kept))
    found.table.to_csv(folder / "prediction.csv", index=False)
    found.save(folder / "prediction.nc")
    if found.scores is not None:
        rows = [{str(name): value for name, value in row.items()} for row in found.scores.to_dict("records")]
        write_csv(folder / "scores.csv", rows)
        write_json(folder / "scores.json", rows)
    if figures:
        write_figures(folder, {"prediction": prediction_figure(found)})
    page = render("prediction.html", **_context(found, settings, folder), command=command)
    (folder / "report.html").write_text(page, encoding="utf-8")


def band_headers(found: Prediction) -> list[str]:
    """Return the heads of the columns of `readable_bands`."""
    own = ["measured"] * (len(found.stresses) > 1)
    names = [control.name for control in found.mode.controls]
    share = f"{100 * found.prob:.4g} %"
    each = ["mean", f"{share} of the stress", f"{share} of measurements"]
    alone = [each, ["alone: mean", "alone: stress", "alone: measurements"]] if found.kinds[0] else [each]
    return [*names, *own, *(text for texts in alone for text in texts), "calibrated"]


def readable_bands(found: Prediction) -> list[list[str]]:
    """Return some rows of the bands, from end to end, as text in the unit of the run."""
    rows, scale = [], found.unit.to_mpa
    count = len(found.points)
    places = np.unique(np.linspace(0, count - 1, min(count, MOST_ROWS)).round().astype(int))
    for channel, name in enumerate(found.stresses):
        for place in places:
            cells = [f"{column[place]:.4g}" for column in found.controls.values()]
            cells += [name] * (len(found.stresses) > 1)
            for kind in found.kinds:
                stress, noisy = (found.bands[channel, kind, noise].iloc[place] / scale for noise in (False, True))
                cells += [_mean(stress), _ends(stress), _ends(noisy)]
            rows.append([*cells, "yes" if found.is_calibrated[place] else "no"])
    return rows


def score_headers(found: Prediction) -> list[str]:
    """Return the heads of the columns of `readable_scores`."""
    own = ["measured"] * (len(found.stresses) > 1)
    unit = found.unit.name
    inside = f"inside {100 * found.prob:.4g} %"
    return [
        "prediction",
        *own,
        "range",
        "points",
        inside,
        "half width",
        "error",
        f"CRPS, {unit}",
        f"interval score, {unit}",
    ]


def readable_scores(found: Prediction) -> list[list[str]]:
    """Return how the measurements are predicted as text."""
    rows, scale = [], found.unit.to_mpa
    assert found.scores is not None  # noqa: S101 (asked for where there are some)
    for row in found.scores.to_dict("records"):
        cells = [_of(found, row)] + [row["measured"]] * (len(found.stresses) > 1)
        shares = [_share(row[name]) for name in ("inside", "half_width", "error")]
        stresses = [_stress(row[name] / scale) for name in ("crps", "interval_score")]
        rows.append([*cells, row["range"], f"{row['count']}", *shares, *stresses])
    return rows


def _kind(found: Prediction, kind: bool) -> str:
    model = found.posterior.model
    return f"with {model.discrepancy.name}" if kind else f"{model.material.name} alone"


def _of(found: Prediction, row: Mapping[Any, Any]) -> str:
    return _kind(found, row["discrepancy"] == "with")


def _share(value: float) -> str:
    return "" if isnan(value) else f"{value:.0%}" if value < MOST_SHARE else f"> {MOST_SHARE:.0%}"


def _stress(value: float) -> str:
    return significant(value) if abs(value) < LARGE else f"{value:.0e}"


def _mean(band: pd.Series[float]) -> str:
    mean, width = float(band["mean"]), float(band["high"] - band["low"])
    if max(abs(mean), width) < NOTHING:
        return "0"
    return interval(mean, mean, width / 4)[0] if abs(mean) < LARGE else f"{mean:.0e}"


def _ends(band: pd.Series[float]) -> str:
    low, high = float(band["low"]), float(band["high"])
    if max(-low, high) < NOTHING:
        return "0"
    texts = interval(low, high, (high - low) / 4) if max(-low, high) < LARGE else (f"{low:.0e}", f"{high:.0e}")
    return "{} to {}".format(*texts)


def _context(found: Prediction, settings: PredictionSettings, folder: Path) -> dict[str, Any]:
    model = found.posterior.model
    data = found.data
    return {
        "found": found,
        "run": Path(settings.run).name or settings.run,
        "model": model,
        "measured": " and ".join(f"{part.mode.name} ({len(part)} measurements)" for part in model.experiment.parts),
        "lead": _lead(found),
        "share": f"{100 * found.prob:.4g} %",
        "headers": band_headers(found),
        "rows": readable_bands(found),
        "is_part": len(found.points) > MOST_ROWS,
        "data": data,
        "score_headers": score_headers(found),
        "scores": [] if found.scores is None else readable_scores(found),
        "cautions": found.posterior.warnings,
        "recipe": (folder / RECIPE).read_text(encoding="utf-8"),
        "figures": {path.stem: embedded_figure(path) for path in sorted((folder / "figures").glob("*.svg"))},
    }


def _lead(found: Prediction) -> str:
    """Return the finding in a sentence or two."""
    return _lead_of_bands(found) if found.scores is None else _lead_of_scores(found)


def _lead_of_scores(found: Prediction) -> str:
    assert found.scores is not None and found.data is not None  # noqa: S101, PT018 (the caller has looked)
    ranges = set(found.scores["range"])
    which = "calibrated" if "calibrated" in ranges else "all"
    where = " in the calibrated range" if which in ranges - {"all"} else ""
    where = ", all beyond the calibrated range," if ranges == {"all", "beyond"} else where
    texts = []
    for channel, name in enumerate(found.stresses):
        rows = found.scores[
            (found.scores["range"] == which) & (found.scores["measured"] == found.mode.stresses[channel])
        ]
        of = f" ({name})" if len(found.stresses) > 1 else ""
        parts = [
            f"{row['inside']:.0%} lie in the {100 * found.prob:.4g} % band ({_of(found, row)}), "
            f"whose mean errs by {_share(row['error'])} of the stress"
            for row in rows.to_dict("records")
        ]
        count = rows["count"].iloc[0]
        texts.append(f"Of {count} measurements of {found.data.name}{of}{where} {', and '.join(parts)}.")
    return " ".join(texts)


def _lead_of_bands(found: Prediction) -> str:
    known = np.flatnonzero(found.is_calibrated)
    change = np.abs(found.points.reshape(len(found.points), -1) - np.atleast_1d(found.mode.reference)).max(axis=1)
    place = int(known[change[known].argmax()] if len(known) else change.argmax())
    where = " and ".join(
        f"{control.name} {column[place]:.4g}"
        for control, column in zip(found.mode.controls, found.controls.values(), strict=True)
    )
    texts = []
    for channel, name in enumerate(found.stresses):
        band = found.bands[channel, found.kinds[0], False].iloc[place] / found.unit.to_mpa
        texts.append(f"the {name} is {_mean(band)} {found.unit.name} ({100 * found.prob:.4g} %: {_ends(band)})")
    beyond = "" if len(known) else ", which is beyond what was measured"
    return f"At {where} in mode {found.mode.name}{beyond}, {' and '.join(texts)}: {_kind(found, found.kinds[0])}."
