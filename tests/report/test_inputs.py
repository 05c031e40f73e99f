"""Copies of the user's files in a run."""

from __future__ import annotations

from pathlib import Path

from tissuq.report.inputs import Copies


def test_files_of_one_name_have_a_copy_each():
    copies = Copies()
    named = [copies.of_code(text) for text in ("a/model.py:force", "b/model.py:force", "a/model.py:depth")]
    assert named == ["input/model.py:force", "input/2-model.py:force", "input/model.py:depth"]
    assert copies == {"input/model.py": Path("a/model.py"), "input/2-model.py": Path("b/model.py")}
