"""The reference posteriors that are quick to compute are as stored; `make frozen` compares all of them."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from frozen import check
from frozen.cases import CASES, Number

STORED = json.loads(check.STORED.read_text())


@pytest.mark.parametrize("name", [name for name, case in CASES.items() if case.is_quick])
def test_a_reference_posterior_has_not_moved(name):
    numbers, _ = check.computed(name)
    found = check.compared(numbers, STORED[name])
    assert not found.missing
    assert found.deviation <= found.allowed, found.number


def test_every_reference_posterior_has_stored_numbers_and_none_is_left_over():
    assert list(STORED) == list(CASES)


@pytest.mark.parametrize("change", [1e-7, float("nan")])
def test_a_number_that_moves_is_named(change):
    numbers, _ = check.computed("paper-none")
    moved = numbers["C10 sd"]
    found = check.compared(numbers | {"C10 sd": replace(moved, value=moved.value * (1 + change))}, STORED["paper-none"])
    assert not found.holds
    assert found.number == "C10 sd"


def test_a_number_that_is_gone_or_new_is_named():
    numbers, _ = check.computed("paper-none")
    numbers["C99 sd"] = numbers.pop("C10 sd")
    found = check.compared(numbers, STORED["paper-none"])
    assert not found.holds
    assert found.missing == ("C10 sd", "C99 sd")


def test_a_sampled_number_is_held_against_its_standard_error():
    stored = {"is_sampled": True, "numbers": {"x mean": [1.0, 0.1]}}
    near, far = ({"x mean": Number(value, 1.0)} for value in (1.45, 1.55))
    assert check.compared(near, stored).holds
    assert not check.compared(far, stored).holds
