"""The planted faults of ``make mutants`` can be planted."""

from __future__ import annotations

from pathlib import Path

import pytest

import tissuq
from mutants import MUTANTS, ROOT, sources_with


@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda mutant: mutant.text.strip()[:50])
def test_a_fault_has_its_place_and_its_tests(mutant):
    """Where the source was rewritten, tests/mutants.toml has to say the line as it is now, or another fault."""
    assert len(sources_with(mutant.text, Path(tissuq.__file__).parent)) == 1, "the text must stand once in the source"
    assert mutant.fault != mutant.text
    files = [word for word in mutant.tests.split() if "/" in word or word.endswith(".py")] or mutant.tests.split()
    assert all((ROOT / "tests" / file.partition("::")[0]).exists() for file in files)
