"""Options on which no number depends: what to repeat, where to write, how much to say."""

from __future__ import annotations

from pathlib import Path

from tissuq.studies.option import Settings, option

__all__ = [
    "SCHEDULER", "Campaign", "Configured", "IntoFolder", "LawOfRun", "OfRun", "Running", "SolverOptions", "Verbosity",
    "Written",
]  # fmt: skip

SCHEDULER = "Address of a Dask scheduler to use instead, or slurm:memory=4GB,walltime=02:00:00 for batch jobs."


class Running(Settings):
    """Options of a command on which its numbers do not depend."""


class Verbosity(Running):
    """A command that says as much as is asked for."""

    quiet: bool = option(False, "Print nothing but the numbers of the answer; errors as ever.", letter="q")
    verbose: bool = option(False, "Tell how long every stage took.")


class Configured(Verbosity):
    """A command that an earlier recipe repeats."""

    config: Path | None = option(None, "run.toml of an earlier run to repeat.")


class IntoFolder(Running):
    """A command that writes a folder, whole or not at all."""

    out: Path | None = option(None, "Folder for the run [runs/NAME].")
    force: bool = option(False, "Replace an existing folder of the same kind.")


class Written(IntoFolder, Configured):
    """A command whose folder is a run, with its figures and its recipe."""

    figures: bool = option(True, "Draw the figures.")


class LawOfRun(Running):
    """A command that begins from a run of ``tissuq fit``."""

    user_law: str | None = option(
        None, "law.py:Name of the run, if its material is your own law; its code runs only if named here."
    )


class OfRun(LawOfRun, Written):
    """A command that begins from such a run, and writes a folder."""


class SolverOptions(Running):
    """A command that runs the solver of the user's own finite-element model."""

    max_jobs: int | None = option(None, "Runs of the solver at a time, as many as licences [one a core].", ge=1)
    timeout: float | None = option(None, "Seconds after which the solver is stopped [never].", unit="s", ge=0)
    retries: int = option(0, "Times that a failed run of the solver is made again, as for a licence.", ge=0)
    abaqus: str = option("", "Program that opens .odb files, as its 'python' [first word of --command].")


class Campaign(Configured):
    """A command whose folder grows, and which goes on where it was stopped."""

    config: Path | None = option(None, "TOML file of the campaign.")
    out: Path | None = option(None, "Folder of the campaign [runs/NAME].")
    workers: int = option(1, "Processes on this machine.", ge=1)
    scheduler: str | None = option(None, SCHEDULER)
