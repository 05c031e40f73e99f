"""What a fit started from, as files of its run: copies of measured files and laws, and settings that name them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from tissuq.experiments.experiment import Experiment
from tissuq.report.run_folder import INPUT, law_files
from tissuq.studies.laws import LawSettings
from tissuq.studies.measured_file import MeasuredFile
from tissuq.studies.specimen import SpecimenSettings

__all__ = ["Inputs", "inputs_of"]


class Inputs(NamedTuple):
    """Copies by their names in the run, the recipe that names them, settings of no meaning, options of user laws."""

    files: dict[str, Path]
    recipe: SpecimenSettings
    without: frozenset[str]
    options: str


def inputs_of(settings: SpecimenSettings, experiment: Experiment, sources: Sequence[Path]) -> Inputs:
    """Return what a fit started from; ``sources`` are the files that were read, one a test."""
    several_laws = isinstance(settings, LawSettings)
    named = list(settings.laws) if isinstance(settings, LawSettings) else [settings.material]
    laws = [law_files(name) for name in named]
    names = [name for name, _ in laws]
    files = list(dict.fromkeys(sources))
    stems = [file.name for file in files]
    copy_of = {
        file: f"{INPUT}/{number}-{file.name}" if stems.count(file.name) > 1 else f"{INPUT}/{file.name}"
        for number, file in enumerate(files, 1)
    }
    relocated = _relocated(settings, experiment, sources, copy_of)
    relocated |= {"laws": tuple(names)} if several_laws else {"material": names[0]}
    without = frozenset(MeasuredFile.model_fields) if settings.tests else frozenset(["tests"])
    copies = {copy: file for file, copy in copy_of.items()} | {
        copy: law for _, law_copies in laws for copy, law in law_copies.items()
    }
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
