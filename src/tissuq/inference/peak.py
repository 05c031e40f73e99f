"""Where a smooth function that costs much to evaluate is largest, by parabolas through few of its values."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

MAX_EVALUATIONS = 20


def highest(
    function: Callable[[float], float], start: float, step: float, reach: float, accuracy: float
) -> tuple[float, float]:
    """Return where a function with one peak is largest, and its value there, both as a parabola says.

    Parameters
    ----------
    function : callable
    start, step : float
        Where the search begins, and how far from there it looks first; then twice as far, and so on. About over such a
        step a parabola is to describe the function.
    reach : float
        Farthest from the start that is looked at; where the function still rises there, it is the result.
    accuracy : float
        By which the parabola may exceed the largest value that was computed.

    Examples
    --------
    >>> place, value = highest(lambda x: 3 - (x - 1.7) ** 2, 0.0, 0.4, 3.0, 0.01)
    >>> round(place, 6), round(value, 6)
    (1.7, 3.0)
    """
    values = {point: function(point) for point in (start - step, start, start + step)}
    widest = 1.5 * step
    while len(values) < MAX_EVALUATIONS:
        points = sorted(values)
        best = max(points, key=lambda point: values[point])
        index = points.index(best)
        if index in (0, len(points) - 1):
            step *= 2
            point = float(np.clip(best + (step if index else -step), start - reach, start + reach))
            if point == best:
                break
        else:
            neighbours = points[index - 1 : index + 2]
            farther = max((neighbours[0], neighbours[2]), key=lambda neighbour: abs(neighbour - best))
            point, value = top_of_parabola(neighbours, [values[neighbour] for neighbour in neighbours])
            if abs(farther - best) > widest:  # a parabola says little
                point = 0.5 * (farther + best)
            elif value < values[best] + accuracy:
                return point, value
        values[point] = function(point)
    best = max(values, key=lambda point: values[point])
    return best, values[best]


def top_of_parabola(points: Sequence[float], values: Sequence[float]) -> tuple[float, float]:
    """Return the top of the parabola through three ascending places, of which the middle one has the largest value."""
    distance_before, distance_after = points[0] - points[1], points[2] - points[1]
    drop_before, drop_after = values[0] - values[1], values[2] - values[1]
    curvature = (drop_after / distance_after - drop_before / distance_before) / (distance_after - distance_before)
    slope = drop_after / distance_after - curvature * distance_after
    if curvature >= 0:  # all three are alike
        return points[1], values[1]
    return float(points[1] - 0.5 * slope / curvature), float(values[1] - 0.25 * slope**2 / curvature)
