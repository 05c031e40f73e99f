"""The figure of a prediction: bands with the discrepancy and of the material alone, over measurements if there are."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tissuq.report.figures import BAND, BASE, INK, STYLE
from tissuq.studies.prediction import Prediction

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["prediction_figure"]

FloatArray = NDArray[np.float64]

ROOM = 0.5
"""Of the height of what is known, above and below it: beyond, bands run out of the panel."""


def prediction_figure(found: Prediction) -> Figure:
    """Return a row of panels for each stress: with the discrepancy, where it is known, and the material alone.

    The stretches at which an invariant is larger than in the measurements of the run are hatched.
    """
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    count, kinds = len(found.stresses), found.kinds
    with rc_context(STYLE):
        figure = Figure(figsize=(4.9 * len(kinds) + (1.6 if len(kinds) == 1 else 0.4), 3.7 * count + 0.7))
        panels = figure.subplots(count, len(kinds), squeeze=False, sharey="row", sharex=found.points.ndim == 1)
        for channel, row in enumerate(panels):
            for axis, kind in zip(row, kinds, strict=True):
                _draw(axis, found, channel, kind)
                axis.set_title(_title(found, channel, kind))
                if found.points.ndim > 1 or channel == count - 1:
                    axis.set_xlabel(_label(found, _abscissa(found)[0]))
            row[0].set_ylim(*_limits(found, channel))
            row[0].set_ylabel(f"{found.stresses[channel]} [{found.unit.name}]")
        handles: dict[str, Any] = {}
        for axis in panels.ravel():
            for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
                handles.setdefault(label, handle)
        shown = min(len(handles), 3 * len(kinds) if len(kinds) > 1 else 2)
        figure.legend(list(handles.values()), list(handles), loc="outside upper center", ncols=shown, fontsize=9)
    return figure


def _draw(axis: Axes, found: Prediction, channel: int, kind: bool) -> None:
    """Draw bands, measurements and where nothing was measured."""
    _, at = _abscissa(found)
    stress, noisy = (_drawn(found, channel, kind, noise) for noise in (False, True))
    order, share = np.argsort(at, kind="stable"), f"{100 * found.prob:.4g} %"
    looks = ((noisy, 0.18, f"{share} of measurements"), (stress, 0.38, f"{share} of the stress"))
    is_path = found.points.ndim == 1 or found.data is None
    for band, strength, label in looks:
        low, high = (band[end].to_numpy()[order] for end in ("low", "high"))
        if is_path:
            axis.fill_between(at[order], low, high, color=BAND, alpha=strength, lw=0, label=label)
        else:
            axis.vlines(at[order], low, high, color=BAND, alpha=strength, lw=5, label=label)
    style: dict[str, Any] = {"ls": "-", "lw": 1.6} if is_path else {"ls": "", "marker": "_", "ms": 7}
    axis.plot(at[order], stress["mean"].to_numpy()[order], color=BAND, label="predicted mean", **style)
    axis.set_xlim(*_padded(at.min(), at.max()))
    axis.locator_params(axis="x", nbins=6)
    _shade(axis, found)
    if found.data is not None:
        points = found.data.stretch if found.points.ndim == 1 else at
        for chosen, face, label in (
            (found.is_data_calibrated, INK, "measured"),
            (~found.is_data_calibrated, "white", "measured beyond"),
        ):
            if chosen.any():
                values = found.measured(channel)[chosen] / found.unit.to_mpa
                axis.plot(points[chosen], values, "o", mec=INK, mfc=face, ms=3.6, mew=0.9, label=label, zorder=4)


def _drawn(found: Prediction, channel: int, kind: bool, noise: bool) -> pd.DataFrame:
    """Return a band in the unit of the run, cut where it has long left the panel: no renderer takes any number."""
    low, high = _limits(found, channel)
    band = found.bands[channel, kind, noise] / found.unit.to_mpa
    return band.clip(lower=low - 5 * (high - low), upper=high + 5 * (high - low))


def _abscissa(found: Prediction) -> tuple[int, FloatArray]:
    """Return the first control that changes, its number and its values."""
    columns = list(found.controls.values())
    which = next((place for place, each in enumerate(columns) if np.ptp(each) > 0), 0)
    return which, columns[which]


def _label(found: Prediction, which: int) -> str:
    """Return the name of the control along the axis, and where the others are held."""
    pairs = enumerate(zip(found.mode.controls, found.controls.values(), strict=True))
    held = [f"{own.name} {at[0]:.4g}" for place, (own, at) in pairs if place != which and np.ptp(at) == 0]
    return found.mode.controls[which].name + (f" ({', '.join(held)})" if held else "")


def _shade(axis: Axes, found: Prediction) -> None:
    """Hatch where an invariant is larger than any that was measured."""
    if found.points.ndim > 1:
        if not found.is_calibrated.all():
            at = _abscissa(found)[1][~found.is_calibrated]
            axis.plot(at, np.zeros_like(at), "|", color=BASE, ms=8, transform=axis.get_xaxis_transform(),
                      label="not calibrated", clip_on=False)  # fmt: skip
        return
    ends = found.calibrated_range
    assert ends is not None  # noqa: S101 (one control)
    left, right = axis.get_xlim()
    for start, end in ((left, min(ends[0], right)), (max(ends[1], left), right)):
        margin = 0.011 * (right - left)  # that of the axis beyond the last stretch is no place of its own
        if end - start > 3 * margin:
            axis.axvspan(start, end, facecolor="none", edgecolor=BASE, alpha=0.5, hatch="////", lw=0, zorder=3,
                         label="not calibrated")  # fmt: skip
            edge = end if start == left else start
            axis.axvline(edge, color=BASE, lw=1.1, ls="--", zorder=0.5)


def _padded(low: float, high: float) -> tuple[float, float]:
    margin = 0.02 * max(high - low, 0.1 * abs(high))
    return low - margin, high + margin


def _title(found: Prediction, channel: int, kind: bool) -> str:
    model = found.posterior.model
    name = f"with the discrepancy {model.discrepancy.name}" if kind else f"{model.material.name} alone"
    if found.scores is None:
        return name
    rows = found.scores[
        (found.scores["discrepancy"] == ("with" if kind else "without")) & (found.scores["range"] == "all")
    ]
    row = rows.iloc[channel]
    return f"{name}:  {round(row['inside'] * row['count'])} of {row['count']} inside"


def _limits(found: Prediction, channel: int) -> tuple[float, float]:
    """Return the ends of the stress axis: all that is calibrated or measured, and some room for what is beyond."""
    scale = found.unit.to_mpa
    known = found.is_calibrated if found.is_calibrated.any() else np.ones(len(found.points), dtype=bool)
    bands = [found.bands[channel, kind, True] for kind in found.kinds]
    core = [band[end].to_numpy()[known] for band in bands for end in ("low", "high")]
    core += [] if found.data is None else [found.measured(channel)]
    low, high = min(float(each.min()) for each in core), max(float(each.max()) for each in core)
    room = ROOM * (high - low)
    beyond = np.concatenate([band[end].to_numpy() for band in bands for end in ("low", "high")])
    ends = np.clip([beyond.min(), beyond.max()], low - room, high + room)
    low, high = _padded(min(low, float(ends[0])), max(high, float(ends[1])))
    return low / scale, high / scale
