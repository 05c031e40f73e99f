"""Draws in words."""

from __future__ import annotations

from tissuq.posterior.draws_in_words import MAX_DRAWS_NAMED, FailedDraw, failed_draws, named_draws


def test_of_many_draws_the_first_are_named_and_the_others_counted():
    assert named_draws(range(MAX_DRAWS_NAMED)) == "draws 1, 2, 3, 4, 5, 6"
    assert named_draws(range(MAX_DRAWS_NAMED + 1)) == "draws 1, 2, 3, 4, 5, 6 and 1 other"


def test_failures_are_told_by_family_and_those_that_got_least_far_first():
    failures = [FailedDraw("a", 4, 0.5, "late"), FailedDraw("b", 0, 0.2, "alone"), FailedDraw("a", 8, 0.1, "soon")]
    of_a, of_b = failed_draws(failures, {"a": 9, "b": 1}, {"a": "draws", "b": "others"}, "at {:g} mm", "See there.")
    assert of_a.startswith("2 of 9 draws failed (draws 9 at 0.1 mm, 5 at 0.5 mm; first reason: soon). See there. ")
    assert of_b.startswith("1 of 1 others failed (draw 1 at 0.2 mm; first reason: alone). ")
    assert failed_draws([], {}, {}, "", "") == []
