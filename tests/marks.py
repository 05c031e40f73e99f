"""Which cases of a test are in the quick tests."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any

import pytest


def slow_but(kept: Collection[Any], every: Iterable[Any]) -> list[Any]:
    """Return all cases, those that are not kept for the quick tests with the mark slow; a tuple has several values."""
    cases = [(each, each if isinstance(each, tuple) else (each,)) for each in every]
    return [each if each in kept else pytest.param(*values, marks=pytest.mark.slow) for each, values in cases]
