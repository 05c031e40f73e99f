"""What tests of reading share: messages about files are looked at in the form in which they are written."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path

import pytest

from tissuq.experiments.reading import inspection, read, tests_in_file


@pytest.fixture(autouse=True)
def as_on_the_shell(request, monkeypatch):
    """Leave messages about files as the shell shows them: another module tests how Python words them."""
    if request.module.__name__.endswith("test_python_form"):
        return

    def refusals(data):
        return nullcontext() if isinstance(data, str | Path) else in_python(data)

    in_python = tests_in_file.refusals_in_python
    for module in (read, tests_in_file, inspection):
        monkeypatch.setattr(module, "refusals_in_python", refusals)
    monkeypatch.setattr(inspection, "in_python", lambda text, stress_unit: text)
