"""A command as it was typed, with options on which no number depends, and how it is carried out, in what folder."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TextIO, TypeVar

import typer

from tissuq.cli.progress import Monitor
from tissuq.errors import InputError
from tissuq.studies.option import Settings, option
from tissuq.studies.settings import RECIPE, load_settings

if TYPE_CHECKING:
    from pydantic import BaseModel

    from tissuq.mechanics import Material
    from tissuq.report.result import Record, Result
    from tissuq.studies.finite_element_settings import ModelSettings

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


Kind = TypeVar("Kind", bound=Settings)
How = TypeVar("How", bound=Running)
Study = TypeVar("Study")
NOT_CONVERGED = 3
"""The exit status where sampling has not converged."""


@dataclass(frozen=True)
class Call(Generic[Kind, How]):
    """A command as it was typed.

    Attributes
    ----------
    kind : type of Settings
        What a file of them may hold.
    stated : dict
        The settings that were typed.
    typed : mapping of str to str
        The option of each, as it was typed.
    how : Running
        The other options.
    command : str
        The command's name.
    monitor : Monitor
        Is told how the command gets on.
    out : file
        Where the answer goes, also with --quiet.
    """

    kind: type[Kind]
    stated: dict[str, Any]
    typed: Mapping[str, str]
    how: How
    command: str
    monitor: Monitor = field(default_factory=Monitor)
    out: TextIO = field(default_factory=lambda: sys.stdout)

    @property
    def config(self) -> Path | None:
        """The file of settings, if one was named."""
        return self.how.config if isinstance(self.how, Configured) else None

    @property
    def beside(self) -> Path:
        """The folder from which relative names count: that of the file of settings, or the current one."""
        return self.config.parent if self.config else Path()

    @cached_property
    def settings(self) -> Kind:
        """The settings, those that were typed before those in a file."""
        return self.loaded()

    def loaded(self, rivals: tuple[str, ...] = (), **changes: Any) -> Kind:
        """Return the settings with changes to what was typed; of rivals only one can be set."""
        return load_settings(self.kind, self.config, self.stated | changes, rivals, self.typed)

    def campaign_in(self, folder: Path) -> Callable[[int], AbstractContextManager[Callable[[str, bool], None]]]:
        """Return what shows the tasks of a campaign, which are kept in a folder as they are done."""
        self.monitor.folder = folder
        return self.monitor.campaign

    def check_source(self, setting: str, what: str, earlier: str) -> None:
        """Refuse a call with neither or both of a source of data, which is a setting, and a file of settings."""
        source = self.stated.get(setting)
        if source and self.config:
            raise InputError(
                f"'{self.config}' is of a {earlier}, and names what that is of: leave out --config, or {what} "
                f"({' '.join(map(str, source if isinstance(source, list) else [source]))})."
            )
        if not (source or self.config):
            raise InputError(f"give {what}, or --config run.toml of an earlier {earlier}.")

    def check_named_again(self, settings: ModelSettings, *, is_dry: bool = False) -> None:
        """Refuse to run programs, to ask servers or to read files elsewhere that only a recipe names.

        Raises
        ------
        InputError
            When the command line does not name them, too; the message has the options to type.
        """
        from tissuq.studies.settings import is_inside

        if self.config is None:
            return
        missing, inside = list[str](), self.beside.resolve()
        for setting, typed, text in settings.run_by_name() if not is_dry else ():
            stated = self.stated.get(setting)
            if not stated or (isinstance(stated, dict) and text.partition("=")[0] not in stated):
                missing.append(f"{typed} {shlex.quote(text)}")
        if "also" not in self.stated and not all(is_inside(inside / file, inside) for file in settings.also):
            missing += [f"--also {shlex.quote(file)}" for file in settings.also]
        if missing:
            raise InputError(
                f"'{self.config}' names programs that would be run, a server, or files outside of its folder. They are "
                f"used only if named here, too; if you know them, add {' '.join(missing)}."
            )

    @cached_property
    def law(self) -> Material | None:
        """The user's own law that a run is of."""
        from tissuq.mechanics import material_named

        name = self.how.user_law if isinstance(self.how, LawOfRun) else None
        if name is not None and ".py:" not in name:
            raise InputError(
                f"'{name}' is not of the form law.py:Name. --user-law is only needed for a run whose material is a law "
                "in your own file."
            )
        return material_named(name, laws=True) if name else None

    def target(self, default: Path, *, apart_from: Path | None = None) -> Path:
        """Return the folder that is to be written, once it may be; ``default`` unless another is named."""
        from tissuq.report.run_folder import check_apart, check_target

        assert isinstance(self.how, IntoFolder)  # noqa: S101 (only such commands have a folder)
        folder = self.how.out or default
        if apart_from is not None:
            check_apart(folder, apart_from)
        check_target(folder, self.command, force=self.how.force)
        return folder

    def carried_out(
        self,
        target: Path,
        run: Callable[[Callable[[str], None]], Study],
        result_of: Callable[[Study], Result],
        steps: int | None = None,
    ) -> Study:
        """Return what a run gives, once its result is written into the target folder, and printed.

        Parameters
        ----------
        target : Path
        run : callable
            Gets what is to be told of each step.
        result_of : callable
            Makes the result of the study.
        steps : int, optional
            Their number, where it is known.
        """
        from tissuq.report.run_folder import run_folder
        from tissuq.report.writer import write_result

        assert isinstance(self.how, Written)  # noqa: S101 (only such commands have a folder)
        with self.monitor.steps(steps) as step:
            study = run(step)
            step("writing")
            with run_folder(target, self.command, force=self.how.force) as folder:
                result = result_of(study)
                record = write_result(result, folder, figures=self.how.figures, target=target)
                self.monitor.write_log(folder, result.warnings)
        self.show(record, target)
        return study

    def put_into(self, folder: Path, result: Result, *, figures: bool = True) -> None:
        """Write a result into the folder of a campaign, and print it."""
        from tissuq.report.writer import write_result

        record = write_result(result, folder, figures=figures)
        self.monitor.write_log(folder, result.warnings)
        self.show(record, folder)

    def show(self, record: Record, folder: Path | None, *, details: bool = False) -> None:
        """Print the record of a result; of that with --quiet, which leaves all else out, the numbers."""
        from tissuq.report.terminal import print_result

        print_result(record, folder, details=details)
        for number in record["numbers"] if self.monitor.is_quiet else ():
            remark = f", {number['remark']}" if number["remark"] else ""
            print(f"{number['name'].removesuffix(':')}: {number['text']}{remark}", file=self.out)


def not_converged(names: list[str]) -> None:
    """End with status 3 when sampling has not converged anywhere."""
    if names:
        typer.echo(
            f"tissuq: sampling has NOT converged for {', '.join(names)}; do not use these results. "
            "Try another method, narrower priors or another seed.",
            err=True,
        )
        raise typer.Exit(NOT_CONVERGED)


MAX_LETTERS = 300
"""Of what is said of settings that differ."""


def check_folder(folder: Path, settings: BaseModel, free: frozenset[str] = frozenset()) -> None:
    """Refuse a folder that is not empty, unless it is that of the same campaign.

    Settings that are ``free`` may be others than before.

    Raises
    ------
    InputError
        When it is neither.
    """
    import tomllib

    from tissuq.studies.stream import unfinished

    recipe = folder / RECIPE
    if not folder.exists() or (
        folder.is_dir() and {path.name for path in folder.iterdir()} <= {unfinished(recipe).name}
    ):
        return
    if not recipe.exists():
        raise InputError(f"'{folder}' is not the folder of a campaign; choose another with --out.")
    stored, wanted = dict[str, Any](), _plain(settings)
    with suppress(tomllib.TOMLDecodeError):  # a damaged one has no settings
        stored = tomllib.loads(recipe.read_text(encoding="utf-8"))
    if names := [name for name in {**stored, **wanted} if name not in free and stored.get(name) != wanted.get(name)]:
        said = ", ".join(f"{name}: {stored.get(name, 'none')} there, {wanted.get(name, 'none')} here" for name in names)
        raise InputError(
            f"'{folder}' holds a campaign with other settings ({said:.{MAX_LETTERS}}): choose another folder (--out)."
        )


def write_campaign_recipe(folder: Path, settings: BaseModel) -> None:
    """Write the recipe atomically, so that a killed campaign can be resumed."""
    import tomli_w

    from tissuq.studies.stream import write_whole

    folder.mkdir(parents=True, exist_ok=True)
    write_whole(folder / RECIPE, tomli_w.dumps(_plain(settings)))


def _plain(settings: BaseModel) -> dict[str, Any]:
    """Return settings as a recipe has them."""
    return settings.model_dump(mode="json", exclude_none=True)
