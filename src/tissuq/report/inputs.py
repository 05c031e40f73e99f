"""Copies of the user's files in the folder of a run, and what a fit started from: settings that name these copies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tissuq.experiments.experiment import Experiment
from tissuq.mechanics.user_law import LAW
from tissuq.report.result import Result
from tissuq.studies.fit_settings import LawSettings, SpecimenSettings
from tissuq.studies.measured_file import MeasuredFile
from tissuq.studies.settings import INPUT

if TYPE_CHECKING:
    from tissuq.studies.laws import LawStudy
    from tissuq.studies.specimen import SpecimenStudy


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


def with_inputs(result: Result, study: SpecimenStudy | LawStudy, beside: Path) -> Result:
    """Return the result of a fit with copies of the files in ``beside`` that it started from, and its recipe."""
    settings, copies = study.settings, Copies()
    laws = settings.laws if isinstance(settings, LawSettings) else ()
    named = list(laws) or [settings.material]
    names, sources = list(map(copies.of_law, named)), settings.sources(beside)
    copy_of = {file: copies.of_file(file) for file in sources}
    relocated = _relocated(settings, study.experiment, sources, copy_of)
    relocated |= {"laws": tuple(names)} if laws else {"material": names[0]}
    without = frozenset(MeasuredFile.model_fields) if settings.tests else frozenset(["tests"])
    options = "".join(f" --material {name}" for name in names) if names != named else ""
    return replace(
        result,
        command=f"{result.command}{options}",
        files={**copies, **result.files},
        recipe=settings.model_copy(update=relocated),
        without=without | {"material"} if laws else without,
    )


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
