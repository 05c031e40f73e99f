"""A TOML file with what was understood of the tests in files, to look through, to change and to fit."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tissuq.experiments.reading.inspection import Inspection

__all__ = ["study_file"]

HEAD = """\
# What was understood of these tests. Change what is wrong, then: tissuq fit FILE.toml
# The options of every test are those of reading (tissuq inspect --help); lines that begin with a # are remarks.

material = "neo-hookean"        # see: tissuq materials
# discrepancies = ["auto"]      # see: tissuq discrepancies
# estimand = "tissue"           # what intervals are of: as-tested, specimen or tissue
# stable_in = ["all"]           # modes in which the material must be stable

"""
OPTIONS = """\
# specimen = "S1"               # tests with the same name are of one specimen
# cycle = "last"
# branch = "loading"
# preload = "0.01 N"
# until_peak = true
"""
"""Options that tests often need, as remarks on the first."""


def study_file(tests: Sequence[Mapping[str, Any]], inspections: Sequence[Inspection], folder: Path) -> str:
    """Return the text of a file that ``tissuq fit`` takes, with remarks on what was understood of every test.

    Parameters
    ----------
    tests : sequence of mapping
        The settings that read each test.
    inspections : sequence of Inspection
        What was understood of them.
    folder : Path
        Where the file will lie: files of measurements are named from there.
    """
    import tomli_w

    blocks = [HEAD]
    for test, inspection in zip(tests, inspections, strict=True):
        remarks = [inspection.line, *(f"Note: {text}" for text in inspection.warnings)]
        named = {"name": inspection.reading.experiment.name, **test}
        named["file"] = Path(os.path.relpath(test["file"], folder)).as_posix()
        if "mode" not in test:
            named["mode"] = inspection.reading.experiment.mode.name
            remarks.append("Note: the loading mode is a guess: nothing in the file says which it is.")
        comments = "".join(f"# {line}\n" for text in remarks for line in text.splitlines())
        values = {name: value for name, value in named.items() if not isinstance(value, dict)}
        tables = {name: value for name, value in named.items() if isinstance(value, dict) and value}
        settings = tomli_w.dumps(values) + "".join(
            f"\n[tests.{name}]\n{tomli_w.dumps(value)}" for name, value in tables.items()
        )
        blocks.append(f"[[tests]]\n{comments}{OPTIONS if test is tests[0] else ''}{settings}\n")
    return "".join(blocks)
