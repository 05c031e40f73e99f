"""Candidates for the next test, ranked by the expected reduction of the uncertainty of targets."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from numbers import Integral
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.assessment.stability import MIN_LOSS_PROBABILITY, measured_states, stability
from tissuq.errors import InputError, ModelError
from tissuq.experiments.units import StressUnit, stress_unit
from tissuq.inference.solution import Solution
from tissuq.next_test.candidates import Candidate, candidate_named, default_candidates
from tissuq.next_test.next_test import NextTest, Specimen
from tissuq.next_test.targets import MODULUS, Target, target_named
from tissuq.parameters.checks import check_count, check_seed, one_or_several

if TYPE_CHECKING:
    import pandas as pd

MAX_MEASURED_REACH = 1 + 1e-6
"""Largest reach of a stretch whose invariants were measured."""
TOLD_APART, NEGLIGIBLE = 2.0, 0.01
"""Standard errors of the difference of two reductions from which it is one, and what of it matters to no laboratory."""
RULES = {
    "points": "a test has one measurement or more: points must be whole numbers",
    "target": "target must be 'modulus', a parameter, or a stress such as 'planar:1.5'",
    "candidates": "candidates must be such as 'planar 1:1.5 20'",
}
"""What may be asked for."""
TIED = "as good as the best"
FEW_COMPONENTS = "inaccurate: few components of the posterior would remain"


def rank_tests(
    solution: Solution,
    candidates: str | Candidate | Sequence[str | Candidate] = (),
    targets: str | Target | Sequence[str | Target] = (),
    *,
    points: int | Sequence[int] = (),
    specimen: Specimen | None = None,
    seed: int = 0,
    unit: str | None = None,
    step: Callable[[str], None] = lambda text: None,
) -> pd.DataFrame:
    """Return candidates for the next test, best first for each target.

    Parameters
    ----------
    solution : Solution
    candidates : str, Candidate, or sequence of these
        The default ones (`default_candidates`) where there are none; the tests of the data again are always among them.
    targets : str, Target, or sequence of these
        The initial shear modulus where there are none.
    points : int, or sequence of int
        Numbers of measurements of the default candidates; as many as the data have where there are none.
    specimen : str, optional
        ``"same"`` or ``"other"``: a test of the specimen of the data, or of another one whose stresses differ as the
        posterior's tolerances state, or by 18 %. The same, unless the data are of several specimens.
    seed : int
        Seed of the drawn outcomes.
    unit : str, optional
        Unit of stress, such as ``"MPa"``; that of the measurements unless given.
    step : callable
        Called with the name of each candidate before it is computed.

    Returns
    -------
    pandas.DataFrame
        One row for each target and candidate.

        - target, unit (that of stress, or nothing), candidate, mode, low, high (the range of stretches), points.
        - sd_now, sd_after: standard deviation of the target now, and the root of the expected variance after the test.
        - reduction: 1 - sd_after / sd_now; error: its standard error by simulation, zero in closed form.
        - beyond: share of the measurements at which I1 or I2 is larger than in the data.
        - stable: probability that the material is stable over the range; nan where that is unknown.
        - is_tied: whether its reduction is that of the best new test within two standard errors of the simulation, or
          within 1 % of the standard deviation now.
        - is_repeat: whether it repeats a test of the data; is_rough: whether few components of the posterior would
          remain, so that the numbers are unreliable; note: all this in words, or why there are no numbers.

    Raises
    ------
    InputError, ModelError
        When the posterior does not determine a target or a test.
    """
    import pandas as pd

    model = solution.model
    shown_unit = stress_unit(unit or model.experiment.stress_unit)
    check_seed(seed)
    counts = one_or_several(points, Integral, RULES["points"])
    for count in counts:
        check_count(count, RULES["points"])
    asked = one_or_several(targets, (str, Target), RULES["target"])
    targets_asked = list(dict.fromkeys(target_named(target, model) for target in asked or [MODULUS]))
    next_test = NextTest(solution, targets_asked, specimen, seed)
    for target, sd in zip(targets_asked, next_test.sd_now, strict=True):
        if not sd > 0:
            raise InputError(f"target '{target.name}': its value is known already, so that no test tells more of it.")
    is_energy = model.discrepancy.is_energy and not model.is_correlated
    defaults = list(default_candidates(model.experiment, model.material, is_energy=is_energy, points=tuple(counts)))
    requested = [
        candidate if isinstance(candidate, Candidate) else candidate_named(candidate)
        for candidate in one_or_several(candidates, (str, Candidate), RULES["candidates"])
    ]
    ranked = [*[candidate for candidate in defaults if candidate.is_repeat], *requested] if requested else defaults
    stable = _stable(solution, ranked)
    rows: list[dict[str, Any]] = []
    for candidate, share in zip(ranked, stable, strict=True):
        step(candidate.name)
        rows += _rows(next_test, candidate, share, shown_unit, is_requested=candidate in requested)
    table = pd.DataFrame(rows)
    order = {target.name: position for position, target in enumerate(targets_asked)}
    keys = pd.DataFrame({"target": table["target"].map(order), "gain": -table["reduction"]})
    ranked_table = table.loc[keys.sort_values(["target", "gain"], kind="stable").index].reset_index(drop=True)
    return _with_ties(ranked_table)


def _with_ties(table: pd.DataFrame) -> pd.DataFrame:
    """Return a ranking, best first, in which new tests that are as good as the best of a target say so."""
    table.insert(list(table.columns).index("is_repeat"), "is_tied", False)
    for _, new_tests in table[~table["is_repeat"]].groupby("target"):
        best = new_tests.iloc[0]
        margin = np.maximum(TOLD_APART * np.hypot(new_tests["error"], best["error"]), NEGLIGIBLE)
        tied = new_tests.index[(best["reduction"] - new_tests["reduction"] <= margin) & (new_tests.index != best.name)]
        if len(tied):
            table.loc[[best.name, *tied], "is_tied"] = True
            table.loc[tied, "note"] = [f"{TIED}; {note}" if note else TIED for note in table.loc[tied, "note"]]
    return table


def _rows(
    next_test: NextTest, candidate: Candidate, stable: float, unit: StressUnit, *, is_requested: bool
) -> list[dict[str, Any]]:
    """Return the rows of a candidate, one a target; without numbers where the material cannot be stretched so."""
    try:
        expected, problem = next_test.expected(candidate), ""
    except ModelError as error:
        if is_requested:
            raise
        expected, problem = None, str(error)
    model = next_test.model
    measured = measured_states(model).times(MAX_MEASURED_REACH)
    share_beyond = 1 - float(measured.contain(candidate.mode.paths[0].at(candidate.stretch)).mean())
    notes = [f"{100 * share_beyond:.0f} % beyond the data"] * (share_beyond > 0)
    notes += [f"stable up to there: {100 * stable:.0f} %"] * (stable < 1 - MIN_LOSS_PROBABILITY)
    notes += [FEW_COMPONENTS] * (expected is not None and expected.is_rough) + [problem] * bool(problem)
    rows = []
    for column, target in enumerate(next_test.targets):
        to_mpa = unit.to_mpa if target.unit else 1.0
        numbers = {
            "sd_now": next_test.sd_now[column] / to_mpa,
            "sd_after": expected.sd_after[column] / to_mpa if expected else np.nan,
            "reduction": expected.reduction[column] if expected else np.nan,
            "error": expected.error[column] if expected else np.nan,
        }
        rows.append(
            {
                "target": target.name,
                "unit": unit.name if target.unit else "",
                "candidate": candidate.name,
                "mode": candidate.mode.name,
                "low": float(candidate.stretch.min()),
                "high": float(candidate.stretch.max()),
                "points": len(candidate.stretch),
                **{name: float(value) for name, value in numbers.items()},
                "beyond": share_beyond,
                "stable": stable,
                "is_repeat": candidate.is_repeat,
                "is_rough": bool(expected and expected.is_rough),
                "note": "; ".join(notes),
            }
        )
    return rows


def _stable(solution: Solution, candidates: Sequence[Candidate]) -> list[float]:
    """Return the probability that the material is stable over the range of each candidate; nan where it is unknown."""
    probabilities = dict.fromkeys(range(len(candidates)), np.nan)
    for mode in dict.fromkeys(candidate.mode for candidate in candidates):
        indices = [index for index, candidate in enumerate(candidates) if candidate.mode == mode]
        if len(mode.stresses) > 1:
            continue
        ends = np.unique([end for index in indices for end in _ends(candidates[index])])
        with suppress(ModelError):
            shares = dict(zip(ends, stability(solution, mode, ends).stable, strict=True))
            probabilities |= {index: min(float(shares[end]) for end in _ends(candidates[index])) for index in indices}
    return list(probabilities.values())


def _ends(candidate: Candidate) -> tuple[float, float]:
    return float(candidate.stretch.min()), float(candidate.stretch.max())
