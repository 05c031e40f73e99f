"""The run that a posterior comes from: what its answer says to what is computed with it, and copies of its files."""

from __future__ import annotations

import filecmp
import os
import shlex
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from tissuq.assessment.uses import COMPUTING, Use, Verdict
from tissuq.errors import InputError
from tissuq.model.statistical_model import StatisticalModel
from tissuq.report.result import RESULT
from tissuq.report.writer import read_record
from tissuq.result_warning import ResultWarning, Severity
from tissuq.studies.earlier_run import POSTERIORS, answering
from tissuq.studies.settings import INPUT, RECIPE, damage_reported

if TYPE_CHECKING:
    from tissuq.finite_elements.case import Case

SOURCE = "source"
"""The folder with the copies."""
SPOILING = ("not-converged", "doubtful-reading", "stress-at-rest", "tests-apart", "contradicting-tests",
            "unmodelled-curve", "large-drift", "measurements")  # fmt: skip
"""Codes of warnings about what a fit says of the tissue, and not about how exactly."""
SIMULATING, USE_OF_FIT = ("simulate with finite elements", COMPUTING), "use of the fit in finite elements"
LAW_OF_USE = ", with "
"""What stands before the law in a use that a comparison of laws says of one of them."""


@dataclass(frozen=True)
class Said:
    """What a fit says to whatever is computed with it.

    Attributes
    ----------
    use : Use or None
        Whether it serves finite elements; None where it says nothing.
    warnings : tuple of ResultWarning
        Those that hold for it, too.
    next_step : str
    """

    use: Use | None = None
    warnings: tuple[ResultWarning, ...] = ()
    next_step: str = ""

    @property
    def of_cards(self) -> str:
        """What stands in cards of its draws; nothing where it says nothing."""
        return f"{self.use.purpose}: {self.use.verdict.upper()}, {self.use.reason}" if self.use else ""

    def source_of_cards(self, run: Path, sampling: str, seed: int) -> str:
        """Return what cards say of where they are from, and for what its draws are of use."""
        drawn = f"run {run.resolve().name} of tissuq, {sampling} draws from seed {seed}"
        return "; ".join(filter(None, [drawn, self.of_cards]))

    @property
    def advice(self) -> str:
        """What to do before it is used in finite elements; nothing where it serves them."""
        if self.use is None or self.use.verdict is not Verdict.NO:
            return ""
        return "do not use this yet" + (f"; next step of the fit: {self.next_step}" if self.next_step else "")


def said_by(run: Path, model: StatisticalModel | None = None) -> Said:
    """Return what a run folder says; nothing where there is no result in it, and no use without a model.

    Raises
    ------
    InputError
        When its result is damaged.
    """
    if not (run / RESULT).is_file():
        return Said()
    record = read_record(run)
    with damage_reported(run / RESULT):
        warnings = tuple(
            ResultWarning(warning["text"], warning["code"], Severity(warning["severity"]))
            for warning in record["warnings"]
            if warning["code"] in SPOILING and warning["severity"] != Severity.NOTE
        )
    uses = uses_of(run, model) if model else []
    of_fit = next((use._replace(purpose=USE_OF_FIT) for use in uses if use.purpose.startswith(SIMULATING)), None)
    return Said(of_fit, warnings, record["next"].replace("{run}", shlex.quote(os.path.normpath(run))))


def uses_of(run: Path, model: StatisticalModel) -> list[Use]:
    """Return the uses that a run says of a model: that of its answer, or with this law in a comparison of laws.

    A calibration has one posterior, and its uses are of that.

    Raises
    ------
    InputError
        When it has no result, or a damaged one.
    """
    record = read_record(run)
    with damage_reported(run / RESULT):
        uses = [Use(use["purpose"], Verdict(use["verdict"]), use["reason"]) for use in record["uses"]]
    try:
        is_answer = answering(run) == model.discrepancy.name
    except InputError:  # no run of tissuq fit with one law
        is_answer = not any(LAW_OF_USE in use.purpose for use in uses)
    return [use for use in uses if is_answer or use.purpose.endswith(f"{LAW_OF_USE}{model.material.name}")]


def check_source(run: Path, folder: Path) -> None:
    """Refuse a folder that holds a simulation with another run, and a run whose result is damaged.

    Raises
    ------
    InputError
        When it does, or is.
    """
    said_by(run)
    stored = folder / SOURCE
    if stored.is_dir() and not all(
        (run / name).is_file() and (stored / name).is_file() and filecmp.cmp(run / name, stored / name, False)
        for name in _files(run)
    ):
        raise InputError(f"'{folder}' holds a simulation of another run; choose another folder with --out.")


def _files(run: Path) -> list[Path]:
    """Return the files of a run, relative to it, from which a simulation starts: its recipe and its posteriors."""
    return [Path(RECIPE), *(file.relative_to(run) for file in sorted((run / POSTERIORS).glob("*.nc")))]


def copy_source(run: Path, folder: Path) -> None:
    """Copy the files of a run into the folder of a simulation, so that it can be repeated."""
    stored = folder / SOURCE
    if not stored.is_dir():
        scratch = folder / f"{SOURCE}.new"
        shutil.copytree(run / INPUT, scratch / INPUT, dirs_exist_ok=True)
        names = _files(run) + [Path(RESULT)] * (run / RESULT).is_file()
        for name in names:
            (scratch / name).parent.mkdir(exist_ok=True)
            shutil.copyfile(run / name, scratch / name)
        scratch.rename(stored)


def mesh_files(case: Case, finer: Case | None) -> dict[str, tuple[str, bytes]]:
    """Return copies of the meshes that a case and a finer one are of, name and content, by the settings of these."""
    from tissuq.finite_elements.body_from_file import BodyFromFile

    bodies = {"mesh": case, "finer_mesh": finer}
    return {
        setting: (f"{setting.replace('_', '-')}{Path(body.file).suffix}", body.content())
        for setting, body in bodies.items()
        if isinstance(body, BodyFromFile)
    }


def check_mesh(name: str, content: bytes, folder: Path) -> None:
    """Refuse a folder that holds a simulation of another mesh.

    Raises
    ------
    InputError
        When it does.
    """
    if (folder / name).is_file() and (folder / name).read_bytes() != content:
        raise InputError(f"'{folder}' holds a simulation of another mesh; choose another folder with --out.")
