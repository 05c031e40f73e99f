"""Tests that could be made next, ranked by how much less uncertain they are expected to make some targets."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.assessment.candidates import Candidate, candidate_named, reach_of, usual_candidates
from tissuq.assessment.next_test import NextTest, Specimen
from tissuq.assessment.stability import LOST, stability
from tissuq.assessment.targets import MODULUS, Target, target_named
from tissuq.errors import InputError, ModelError
from tissuq.inference.solution import Solution

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["rank_tests"]

WITHIN = 1 + 1e-6
"""Reach up to which a stretch is one whose invariants were measured."""
ROUGH = "rough: few components of the posterior would be left"


def rank_tests(
    solution: Solution,
    candidates: Sequence[str | Candidate] = (),
    targets: Sequence[str | Target] = (),
    *,
    points: Sequence[int] = (),
    specimen: Specimen | None = None,
    seed: int = 0,
    step: Callable[[str], None] = lambda text: None,
) -> pd.DataFrame:
    """Return candidates for the next test, best first for each target.

    Parameters
    ----------
    solution : Solution
    candidates : sequence of str or Candidate
        The usual ones (`usual_candidates`) where there are none; the tests of the data again are always among them.
    targets : sequence of str or Target
        The initial shear modulus where there are none.
    points : sequence of int
        Numbers of measurements of the usual candidates; one like that of the data where there are none.
    specimen : str, optional
        ``"same"`` or ``"other"``: a test of the specimen of the data, or of another one whose stresses differ as the
        posterior's tolerances say, or by 18 %. The same, unless the data are of several specimens.
    seed : int
        Of the outcomes that are drawn.
    step : callable
        Told the name of each candidate when its turn comes.

    Returns
    -------
    pandas.DataFrame
        One row for each target and candidate.

        - target, unit (MPa or nothing), candidate, mode, low, high (the range of stretches), points.
        - sd_now, sd_after: standard deviation of the target now, and the root of the expected variance after the test.
        - reduction: 1 - sd_after / sd_now; error: its standard error by simulation, zero in closed form.
        - beyond: share of the measurements at which I1 or I2 is larger than in the data.
        - stable: probability that the material is stable over the range; nan where that is not told.
        - is_repeat: whether it is a test of the data again; is_rough: whether few components of the posterior would be
          left, so that the numbers are not to be trusted; note: all this in words, or why there are no numbers.

    Raises
    ------
    InputError, ModelError
        When the posterior does not say what is asked.
    """
    import pandas as pd

    model = solution.model
    if any(count < 1 for count in points):
        raise InputError(f"a test has one measurement or more, not {min(points)}.")
    chosen = list(dict.fromkeys(target_named(each, model) for each in targets or [MODULUS]))
    asked = NextTest(solution, chosen, specimen, seed)
    is_known = model.discrepancy.is_energy or not model.discrepancy.parameters
    is_energy = is_known and not model.is_correlated
    usual = list(usual_candidates(model.experiment, model.material, is_energy=is_energy, points=tuple(points)))
    own = [each if isinstance(each, Candidate) else candidate_named(each) for each in candidates]
    every = [*[each for each in usual if each.is_repeat], *own] if own else usual
    stable = _stable(solution, every)
    rows: list[dict[str, Any]] = []
    for candidate, share in zip(every, stable, strict=True):
        step(candidate.name)
        rows += _rows(asked, candidate, share, is_asked=candidate in own)
    table = pd.DataFrame(rows)
    order = {target.name: place for place, target in enumerate(chosen)}
    keys = pd.DataFrame({"target": table["target"].map(order), "gain": -table["reduction"]})
    return table.loc[keys.sort_values(["target", "gain"], kind="stable").index].reset_index(drop=True)


def _rows(asked: NextTest, candidate: Candidate, stable: float, *, is_asked: bool) -> list[dict[str, Any]]:
    """Return the rows of a candidate, one a target; without numbers where the material cannot be stretched so."""
    try:
        found, problem = asked.expected(candidate), ""
    except ModelError as error:
        if is_asked:
            raise
        found, problem = None, str(error)
    model = asked.model
    beyond = float((reach_of(model.experiment, candidate.mode, candidate.stretch) > WITHIN).mean())
    notes = [f"{beyond:.0%} beyond the data"] * (beyond > 0)
    notes += [f"stable up to there: {stable:.0%}"] * (stable < 1 - LOST)
    notes += [ROUGH] * (found is not None and found.is_rough) + [problem] * bool(problem)
    rows = []
    for place, target in enumerate(asked.targets):
        numbers = {
            "sd_now": asked.now[place],
            "sd_after": found.after[place] if found else np.nan,
            "reduction": found.reduction[place] if found else np.nan,
            "error": found.error[place] if found else np.nan,
        }
        rows.append(
            {
                "target": target.name,
                "unit": target.unit(model),
                "candidate": candidate.name,
                "mode": candidate.mode.name,
                "low": float(candidate.stretch.min()),
                "high": float(candidate.stretch.max()),
                "points": len(candidate.stretch),
                **{name: float(value) for name, value in numbers.items()},
                "beyond": beyond,
                "stable": stable,
                "is_repeat": candidate.is_repeat,
                "is_rough": bool(found and found.is_rough),
                "note": "; ".join(notes),
            }
        )
    return rows


def _stable(solution: Solution, candidates: Sequence[Candidate]) -> list[float]:
    """Return how probably the material is stable over the whole range of each candidate; nan where that is not told."""
    found = dict.fromkeys(range(len(candidates)), np.nan)
    for mode in dict.fromkeys(each.mode for each in candidates):
        own = [place for place, each in enumerate(candidates) if each.mode == mode]
        if len(mode.stresses) > 1:
            continue
        ends = np.unique([end for place in own for end in _ends(candidates[place])])
        with suppress(ModelError):
            shares = dict(zip(ends, stability(solution, mode, ends).stable, strict=True))
            found |= {place: min(float(shares[end]) for end in _ends(candidates[place])) for place in own}
    return list(found.values())


def _ends(candidate: Candidate) -> tuple[float, float]:
    return float(candidate.stretch.min()), float(candidate.stretch.max())
