"""Whether errors of the integration decide which fit has the most evidence."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from tissuq.result_warning import ResultWarning

MIN_ERROR_OF_DIFFERENCE = 0.1
"""Error of the difference of two log evidences below which it changes no conclusion."""


def warnings_of_evidence(evidences: Mapping[str, tuple[float | None, float | None]]) -> tuple[ResultWarning, ...]:
    """Return the warning that fits may be ordered by errors of the integration, if those nearest to the best may be.

    Intervals of single fits hardly change by such errors; which fit has the most evidence does, where log evidences
    differ by no more.

    Parameters
    ----------
    evidences : mapping of str to (float, float)
        Log evidence and its error, by fit; None or nan where one has none.

    Examples
    --------
    >>> warnings_of_evidence({"a": (-3.0, 0.2), "b": (-3.2, 0.1)})[0].code
    'inaccurate-integral'
    >>> warnings_of_evidence({"a": (-3.0, 0.2), "b": (-5.0, 0.1)})
    ()
    """
    known = {name: value for name, (value, _) in evidences.items() if value is not None and not np.isnan(value)}
    if not known:
        return ()
    best = max(known, key=lambda name: known[name])

    def error_beside_best(name: str) -> float:
        return float(np.nansum([evidences[fit][1] or 0.0 for fit in (best, name)]))

    doubtful = [
        name
        for name, value in known.items()
        if name != best and known[best] - value <= error_beside_best(name) > MIN_ERROR_OF_DIFFERENCE
    ]
    if not doubtful:
        return ()
    widest = max(doubtful, key=error_beside_best)
    error = error_beside_best(widest)
    size = f"{error:.2g}" if np.isfinite(error) else "unknown"
    return (
        ResultWarning(
            f"whether {best} or {' or '.join(doubtful)} has the most evidence is not known: the log evidences differ "
            f"by {known[best] - known[widest]:.2g}, and the error of the integration is {size} "
            f"({widest}). Do not choose by their probabilities, but by how they predict left-out measurements.",
            "inaccurate-integral",
        ),
    )
