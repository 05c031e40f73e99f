"""What the draws of posteriors give in the user's model: curves, bands, what failed, and warnings."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.decks.model_run import ModelRun
from tissuq.decks.result_file import SAME_TIME
from tissuq.errors import ConvergenceError
from tissuq.finite_elements.simulation import COMPLETE, FAMILIES, FINE_MESH, MATERIAL_ONLY, MIN_DRAWS
from tissuq.finite_elements.spread import (
    BAND,
    SHARES,
    force_table,
    mesh_factor,
    mesh_free,
    too_few_draws,
)
from tissuq.finite_elements.warnings import MIN_MESH_CHANGE
from tissuq.posterior.draws_in_words import FailedDraw, failed_draws
from tissuq.posterior.ensemble import Ensemble

if TYPE_CHECKING:
    import pandas as pd

TIMES = 41
"""Common times of curves whose solver chose its increments draw by draw."""
MIN_VALUE = 1e-3
"""Share of its largest value from which the relative change of a quantity on a finer mesh is used."""
MIN_SHARE_BEYOND = 0.02
"""Mean share of elements beyond what was measured from which a warning is given."""


@dataclass(frozen=True)
class FailedRun(FailedDraw):
    """A run that did not end well, with the last lines of the solver and its folder."""

    lines: tuple[str, ...]
    folder: str


@dataclass(frozen=True)
class ModelEnsemble:
    """Quantities of draws in the user's model.

    Attributes
    ----------
    times : mapping of str to (s,) array
        By quantity.
    curves : mapping of str to mapping of str to (N, s) array
        By quantity, and by family: ``complete``, and ``alone`` (the same draws without discrepancy) where there is one;
        not a number where a draw did not get that far.
    beyond : (times (s,), shares (N, s)) or None
        Shares of the elements that are strained beyond what was measured.
    failures : tuple of FailedRun
    folders : tuple of str
        Of the complete draws that ended well.
    seconds : float
        Of all runs of the solver, s.
    sources : mapping of str to (N, k) array
        What the draws of all materials differ by besides parameters and discrepancy, as in `Ensemble.sources`.
    mesh_changes : mapping of str to tuple of (float, float)
        By quantity, where a draw was run on a finer mesh: times, and the relative changes on it.
    finer : float
        What the error of the mesh is divided by on that.
    mesh_problem : str
        Why there are no such changes, though that was asked for.
    """

    times: Mapping[str, FloatArray]
    curves: Mapping[str, Mapping[str, FloatArray]]
    beyond: tuple[FloatArray, FloatArray] | None
    failures: tuple[FailedRun, ...]
    folders: tuple[str, ...]
    seconds: float
    sources: Mapping[str, FloatArray] = field(default_factory=dict)
    mesh_changes: Mapping[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)
    finer: float = 2.0
    mesh_problem: str = ""

    @property
    def draws(self) -> int:
        """The number of draws."""
        return len(next(iter(self.curves.values()))[COMPLETE])

    @property
    def is_shared(self) -> bool:
        """Whether the draws without their discrepancy are there, too."""
        return MATERIAL_ONLY in next(iter(self.curves.values()))

    def table(self, quantity: str) -> pd.DataFrame:
        """Return band and shares of the variance of a quantity at every time: see `spread.force_table`.

        The band is that of all complete draws that got there; the shares are those of the draws (``shared_draws``) that
        got there without their discrepancy, too. Where a draw was run on a finer mesh, with the band for cells without
        size: see `spread.mesh_free`.
        """
        times, families = self.times[quantity], self.curves[quantity]
        complete = families[COMPLETE]
        table = force_table(times, complete, complete, None, 0.0, "time", self.sources)
        if self.is_shared:
            table = self._with_shares(table, quantity)
        changes = self.mesh_changes.get(quantity, ())
        return mesh_free(table, mesh_factor(times, changes, self.finer)) if changes else table

    def _with_shares(self, table: pd.DataFrame, quantity: str) -> pd.DataFrame:
        """Return a table with the shares of the draws that are there without their discrepancy, too."""
        times, families = self.times[quantity], self.curves[quantity]
        complete = families[COMPLETE]
        shared = force_table(times, complete, families[MATERIAL_ONLY], None, 0.0, "time", self.sources)
        names = [
            name for name in (*SHARES, "discrepancy_sd", *(f"alone_{column}" for column in BAND)) if name in shared
        ]
        errors = [f"{name}_error" for name in names if f"{name}_error" in shared]
        return table.assign(**{name: shared[name] for name in (*names, *errors)}, shared_draws=shared["draws"])

    def last_values(self, quantity: str) -> FloatArray:
        """Return the last value (N,) of a quantity of every complete draw; not a number where it did not get there."""
        return self.curves[quantity][COMPLETE][:, -1]

    @property
    def warnings(self) -> list[str]:
        """Warnings about the result."""
        return [*_failed(self), *_without_spread(self), *_beyond(self), *_too_few(self), *_mesh(self)]

    @property
    def without_spread(self) -> list[str]:
        """The quantities, other than zero, that all draws have the same of."""
        last = {name: self.last_values(name) for name in self.curves}
        last = {name: values[np.isfinite(values)] for name, values in last.items()}
        return [name for name, values in last.items() if len(values) > 1 and values[0] and not np.ptp(values)]


def gathered(
    tasks: Sequence[ModelRun],
    results: Sequence[Mapping[str, Any]],
    ensembles: Collection[Ensemble] = (),
    finer: float = 2.0,
) -> ModelEnsemble:
    """Return the ensemble of runs, with the draws of its materials; one on a finer mesh only tells the error of theirs.

    Raises
    ------
    ConvergenceError
        When fewer than two draws give a quantity.
    """
    everything = list(zip(tasks, results, strict=True))
    pairs = [(task, result) for task, result in everything if task.family != FINE_MESH]
    fine = next(((task, result) for task, result in everything if task.family == FINE_MESH), None)
    tasks, results = [task for task, _ in pairs], [result for _, result in pairs]
    families = {task.family: None for task in tasks}
    by_family = {name: [result for task, result in pairs if task.family == name] for name in families}
    times, curves = {}, {}
    for name in (quantity.name for quantity in tasks[0].quantities):
        pairs_of_draws = [result["curves"].get(name) for result in results]
        _check_any(name, by_family[COMPLETE])
        times[name], rows = on_common_times(pairs_of_draws)
        members = [np.array([task.family == family for task in tasks]) for family in families]
        curves[name] = {family: rows[is_member] for family, is_member in zip(families, members, strict=True)}
    shares = [result["beyond"] for result in by_family[COMPLETE]]
    return ModelEnsemble(
        times,
        curves,
        on_common_times(shares) if any(shares) else None,
        tuple(_failures(pairs)),
        tuple(result["folder"] for result in by_family[COMPLETE] if not result["problem"]),
        sum(float(result["seconds"]) for result in results),
        _sources(ensembles),
        finer=finer,
        **(_mesh_changes(*fine, by_family[COMPLETE]) if fine is not None else {}),
    )


def _mesh_changes(task: ModelRun, fine: Mapping[str, Any], complete: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the relative changes of quantities of one draw on a finer mesh, or why there are none."""
    coarse, changes = complete[task.number], {}
    for name in (quantity.name for quantity in task.quantities):
        pair = [result["curves"].get(name) or [[], []] for result in (coarse, fine)]
        if all(times for times, _ in pair):
            times, (on_mesh, on_finer) = on_common_times(pair)
            is_known = np.abs(on_mesh) > MIN_VALUE * np.nanmax(np.abs(on_mesh))
            is_known &= np.isfinite(on_finer)
            relative = on_finer[is_known] / on_mesh[is_known] - 1
            changes[name] = tuple(zip(times[is_known].tolist(), relative.tolist(), strict=True))
    reasons = [(fine, "on the finer mesh"), (coarse, "on the mesh")]
    problem = next(
        (
            f"draw {task.number + 1} {mesh_words}: {reason}"
            for result, mesh_words in reasons
            if (reason := result["problem"] or result["misread"])
        ),
        "" if all(changes.values()) and changes else "the quantity is zero",
    )
    return {"mesh_changes": changes, "mesh_problem": problem}


def _sources(ensembles: Collection[Ensemble]) -> dict[str, FloatArray]:
    """Return what the draws of materials differ by, those of one run once."""
    columns: dict[str, list[FloatArray]] = {}
    for ensemble in ensembles:
        for name, values in ensemble.sources.items():
            if not any(np.array_equal(values, earlier) for earlier in columns.setdefault(name, [])):
                columns[name].append(values)
    return {name: np.concatenate(values, axis=1) for name, values in columns.items()}


def on_common_times(curves: Sequence[Any]) -> tuple[FloatArray, FloatArray]:
    """Return times (s,) and curves (N, s) on them, from pairs of times and values, None where a draw has none.

    Where all have the times of the longest, or those up to where they stopped, these are the common ones; else curves
    are interpolated by monotone cubics. Where a curve has stopped it is not a number.

    Examples
    --------
    >>> from tissuq.decks.model_ensemble import on_common_times
    >>> times, values = on_common_times([([0.5, 1.0], [2.0, 4.0]), ([0.5], [3.0]), None])
    >>> times.tolist(), values.tolist()
    ([0.5, 1.0], [[2.0, 4.0], [3.0, nan], [nan, nan]])
    """
    from scipy.interpolate import PchipInterpolator

    pairs = [
        None if curve is None else tuple(np.asarray(column, dtype=np.float64) for column in curve) for curve in curves
    ]
    present = [pair for pair in pairs if pair is not None and len(pair[0])]
    longest = max((times for times, _ in present), key=lambda times: (times[-1], len(times)))
    is_prefix = all(
        len(times) <= len(longest) and np.allclose(times, longest[: len(times)], rtol=SAME_TIME, atol=0)
        for times, _ in present
    )
    common = longest if is_prefix else np.linspace(max(times[0] for times, _ in present), longest[-1], TIMES)
    rows = np.full((len(pairs), len(common)), np.nan)
    for row, pair in zip(rows, pairs, strict=True):
        if pair is not None and len(pair[0]) and is_prefix:
            row[: len(pair[1])] = pair[1]
        elif pair is not None and len(pair[0]):
            times, rows_of_times = np.unique(pair[0], return_index=True)
            if len(times) > 1:
                row[:] = PchipInterpolator(times, pair[1][rows_of_times], extrapolate=False)(common)
            row[-1] = pair[1][-1] if np.isclose(pair[0][-1], common[-1], rtol=SAME_TIME, atol=0) else np.nan
    return common, rows


def _check_any(name: str, complete: Sequence[Mapping[str, Any]]) -> None:
    if sum(bool(result["curves"].get(name, [[]])[0]) for result in complete) >= MIN_DRAWS:
        return
    reasons = [(result["problem"] or result["misread"], result["lines"]) for result in complete]
    problem, lines = next((pair for pair in reasons if pair[0]), ("", []))
    said = "".join(f"\n    {line}" for line in lines)
    raise ConvergenceError(
        f"of {len(complete)} draws, fewer than {MIN_DRAWS} give '{name}' ({problem or 'no results'})."
        + (f" The solver's last lines:{said}" if said else "")
    )


def _failures(pairs: Iterable[tuple[ModelRun, Mapping[str, Any]]]) -> Iterable[FailedRun]:
    for task, result in pairs:
        problem = result["problem"] or result["misread"]
        if problem:
            ends = [times[-1] for times, _ in result["curves"].values() if times]
            reached = max(ends, default=0.0)
            yield FailedRun(task.family, task.number, reached, problem, tuple(result["lines"]), result["folder"])


def _failed(ensemble: ModelEnsemble) -> list[str]:
    advice = "failures.csv has all of them with the solver's last lines; --again makes them again."
    return failed_draws(ensemble.failures, dict.fromkeys(FAMILIES, ensemble.draws), FAMILIES, "at time {:.3g}", advice)


def _beyond(ensemble: ModelEnsemble) -> list[str]:
    if ensemble.beyond is None:
        return []
    share = float(np.nanmean(ensemble.beyond[1][:, -1]))
    if share < MIN_SHARE_BEYOND:
        return []
    return [
        f"At the end {100 * share:.0f} % of the elements are strained beyond what was measured (I1 or I2). There a "
        "card goes on as its form does, with an error that no number here holds: measure further, or load the model "
        "less."
    ]


def _mesh(ensemble: ModelEnsemble) -> list[str]:
    if ensemble.mesh_problem:
        return [
            f"The error of the mesh is not known up to the end ({ensemble.mesh_problem}): mend the finer model and "
            "repeat the command with --again."
        ]
    ends = {name: changes[-1][1] for name, changes in ensemble.mesh_changes.items()}
    return [
        f"On the finer mesh {name} at the end changes by {100 * change:+z.1f} %: the mesh is too coarse for it."
        for name, change in ends.items()
        if abs(change) >= MIN_MESH_CHANGE
    ]


def _without_spread(ensemble: ModelEnsemble) -> list[str]:
    return [
        f"All draws give the same {name}: no section of the model may use the "
        "material that was replaced, or the quantity does not depend on it."
        for name in ensemble.without_spread
    ]


def _too_few(ensemble: ModelEnsemble) -> list[str]:
    count = min(int(np.isfinite(ensemble.last_values(name)).sum()) for name in ensemble.curves)
    return too_few_draws(count)
