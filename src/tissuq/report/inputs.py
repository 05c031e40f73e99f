"""Copies of the user's files in the folder of a run, and what a fit started from: settings that name these copies."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from tissuq.experiments.experiment import Experiment
from tissuq.mechanics.user_law import LAW
from tissuq.studies.fit_settings import LawSettings, SpecimenSettings
from tissuq.studies.measured_file import MeasuredFile
from tissuq.studies.settings import INPUT


class Copies(dict[str, Path]):
    """The user's files by the names of their copies in the folder of a run, so that it can be repeated."""

    def of_file(self, file: Path, folder: str = INPUT, name: str = "") -> str:
        """Return what the copy of a file is called: its name or the given one, numbered if that is taken."""
        name, number = name or file.name, 1
        copy = f"{folder}/{name}"
        while self.setdefault(copy, file) != file:
            number += 1
            copy = f"{folder}/{number}-{name}"
        return copy

    def of_code(self, text: str) -> str:
        """Return a text that names code in a file, such as ``model.py:force``, with its copy; any other as it is."""
        match = LAW.fullmatch(text)
        return f"{self.of_file(Path(match['path'].strip()))}:{match['name']}" if match else text

    def of_law(self, material: str) -> str:
        """Return the name of a material, or of a sum, with the copies of the laws in the user's files."""
        return "+".join(map(self.of_code, material.split("+")))


class Inputs(NamedTuple):
    """Copies by their names in the run, the recipe that names them, settings of no meaning, options of user laws."""

    files: dict[str, Path]
    recipe: SpecimenSettings
    without: frozenset[str]
    options: str


def inputs_of(settings: SpecimenSettings, experiment: Experiment, sources: Sequence[Path]) -> Inputs:
    """Return what a fit started from; ``sources`` are the files that were read, one a test."""
    copies, several_laws = Copies(), isinstance(settings, LawSettings)
    named = list(settings.laws) if isinstance(settings, LawSettings) else [settings.material]
    names = list(map(copies.of_law, named))
    copy_of = {file: copies.of_file(file) for file in sources}
    relocated = _relocated(settings, experiment, sources, copy_of)
    relocated |= {"laws": tuple(names)} if several_laws else {"material": names[0]}
    without = frozenset(MeasuredFile.model_fields) if settings.tests else frozenset(["tests"])
    options = "".join(f" --material {name}" for name in names) if names != named else ""
    recipe = settings.model_copy(update=relocated)
    return Inputs(copies, recipe, without | {"material"} if several_laws else without, options)


def _relocated(
    settings: SpecimenSettings, experiment: Experiment, sources: Sequence[Path], copy_of: dict[Path, str]
) -> dict[str, Any]:
    """Return the settings of what was measured with the names of the files' copies, which go with the run."""
    if not settings.tests:
        return {"file": copy_of[sources[0]], "mode": experiment.mode.name}
    tests = [
        test.model_copy(update={"file": copy_of[source], "name": measured.name, "mode": measured.mode.name})
        for test, source, measured in zip(settings.tests, sources, experiment.tests, strict=True)
    ]
    return {"tests": tuple(tests)}
