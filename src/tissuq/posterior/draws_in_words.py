"""Draws of an ensemble in words: which they are, and which of them failed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

MAX_DRAWS_NAMED = 6
"""Largest number of draws that a sentence names; a table has all of them."""


@dataclass(frozen=True)
class FailedDraw:
    """A draw that did not get to the end: its family, its number from zero, how far it got (mm, or time), and why."""

    family: str
    number: int
    reached: float
    problem: str


def named_draws(numbers: Iterable[int], remarks: Sequence[str] = ()) -> str:
    """Return draws in words: numbered from one, where they come from zero, and of many only the first by their numbers.

    Examples
    --------
    >>> named_draws([3]), named_draws([3, 0], ["at 2 mm", "at 5 mm"])
    ('draw 4', 'draws 4 at 2 mm, 1 at 5 mm')
    >>> named_draws(range(9))
    'draws 1, 2, 3, 4, 5, 6 and 3 others'
    """
    names = [str(number + 1) for number in numbers]
    if remarks:
        names = [f"{name} {remark}" for name, remark in zip(names, remarks, strict=True)]
    unnamed = len(names) - MAX_DRAWS_NAMED
    more = f" and {unnamed} other{'s' * (unnamed > 1)}" if unnamed > 0 else ""
    return f"draw{'s' * (len(names) > 1)} {', '.join(names[:MAX_DRAWS_NAMED])}{more}"


def failed_draws(
    failures: Sequence[FailedDraw], totals: Mapping[str, int], families: Mapping[str, str], place: str, advice: str
) -> list[str]:
    """Return a sentence for each family of draws of which some failed, those that got least far first.

    Parameters
    ----------
    failures : sequence of FailedDraw
    totals : mapping of str to int
        How many draws a family has.
    families : mapping of str to str
        What the draws of a family are called.
    place : str
        How far a draw got, such as ``"at {:.3g} mm"``.
    advice : str
        What follows on where to find more.
    """
    sentences = []
    for family in dict.fromkeys(failure.family for failure in failures):
        failed = sorted((draw for draw in failures if draw.family == family), key=lambda draw: draw.reached)
        named = named_draws([draw.number for draw in failed], [place.format(draw.reached) for draw in failed])
        sentences.append(
            f"{len(failed)} of {totals[family]} {families[family]} failed ({named}; first reason: "
            f"{failed[0].problem}). {advice} Every step shows only the draws that reached it, which may no longer be a "
            "fair sample."
        )
    return sentences
