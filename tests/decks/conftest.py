"""The command line in a folder."""

from __future__ import annotations

import subprocess
import sys

import pytest


@pytest.fixture(scope="session")
def cli_in():
    """Return the function that runs ``tissuq ARGUMENTS`` in a folder and returns its exit status."""

    def run(folder, *arguments):
        words = [sys.executable, "-c", "from tissuq.cli import main; main()", *map(str, arguments)]
        done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
        assert "Traceback" not in done.stderr, done.stderr
        return done.returncode

    return run
