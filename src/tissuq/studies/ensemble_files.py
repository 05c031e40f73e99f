"""The folders of an ensemble's runs, and those of runs that failed."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Sequence
from pathlib import Path

from tissuq.decks.model_run import ModelRun
from tissuq.studies.stream import RESULTS, read_results

__all__ = ["DRAWS", "forget_failures"]

DRAWS = "draws"
"""Folder with a folder for each run."""
RUN_FOLDER = re.compile(r"[a-z]+-[0-9]+")
"""What folders of runs are called."""


def forget_failures(runs: Sequence[ModelRun], folder: Path) -> int:
    """Take the results of runs that failed off the file of results, and their folders away; return how many."""
    places = {run.key: run.folder.name for run in runs}
    path = folder / RESULTS
    results = read_results(path)
    failed = {key for key, result in results.items() if result.get("problem") or result.get("misread")}
    for key in failed:
        name = places.get(key) or str(results[key].get("folder", ""))  # the latter where quantities are others
        if RUN_FOLDER.fullmatch(name):
            shutil.rmtree(folder / DRAWS / name, ignore_errors=True)
    if failed:
        lines = (json.dumps(result) + "\n" for key, result in results.items() if key not in failed)
        scratch = path.with_suffix(".new")
        scratch.write_text("".join(lines), encoding="utf-8")
        scratch.replace(path)
    return len(failed)
