"""Mutated files are read or refused."""

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("openpyxl", reason="openpyxl is not installed")


@pytest.mark.slow
def test_mutated_files_are_read_or_refused_with_a_message():
    script = Path(__file__).with_name("fuzz.py")
    run = subprocess.run([sys.executable, script, "--files", "1200"], capture_output=True, text=True)
    assert run.stdout.strip().endswith("0 faults in 1200 files"), run.stdout + run.stderr
    assert run.returncode == 0
