"""Run folders: written completely or not at all; their tables, posteriors, figures, recipe and page."""

from __future__ import annotations

import os
import platform
import re
import shutil
from base64 import b64encode
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from glob import escape
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from tempfile import mkdtemp
from typing import TYPE_CHECKING, Any

from tissuq.errors import InputError
from tissuq.experiments.numbers import unbroken
from tissuq.studies.settings import RECIPE

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup
    from matplotlib.figure import Figure
    from pydantic import BaseModel

ASSESSMENT = "assessment.json"
"""The file with the assessment of each discrepancy."""

CONTENTS = "contents.txt"
"""The list of a run's own files, behind a line that names the command; a folder without it is not a run, and files that
it does not list are foreign."""
COMMAND_LINE = "# tissuq "
"""What that line begins with."""
WRITTEN, EARLIER = ".tissuq", "-earlier"
"""What the names of folders beside a run's end with while it is written: its own, and that of the run it replaces."""


def check_target(target: Path, command: str, *, force: bool) -> None:
    """Refuse a folder that must not be written by a command.

    Raises
    ------
    InputError
        When the folder exists and ``force`` is not set, when it contains something other than a run, or what another
        command made, or when it cannot be created.
    """
    try:
        _clear(Path(os.path.realpath(target)))
        _check(target, command, force)
    except OSError as error:
        raise _not_written(target, error) from error


def check_apart(target: Path, run: Path) -> None:
    """Refuse to write results made from a run into its own folder, or over it.

    Raises
    ------
    InputError
        When the folder holds the run, is the run, or lies in it.
    """
    target_path, source = Path(os.path.realpath(target)), Path(os.path.realpath(run))
    if source.is_relative_to(target_path):
        raise InputError(f"'{target}' is the run itself or contains it; choose another folder with --out.")
    if target_path.is_relative_to(source):
        raise InputError(f"'{target}' lies inside the run '{run}'; choose a folder outside it with --out.")


@contextmanager
def run_folder(target: Path, command: str, *, force: bool = False) -> Iterator[Path]:
    """Give a folder for a command's run; it becomes ``target`` when all is written, and vanishes on any error.

    Raises
    ------
    InputError
        When the target must not be overwritten, or the disk refuses to be written.
    """
    check_target(target, command, force=force)
    target_path = Path(os.path.realpath(target))
    missing = [folder for folder in target_path.parents if not folder.exists()]
    scratch: Path | None = None
    lock: int | None = None
    try:
        target_path.parent.mkdir(parents=True, exist_ok=True)
        scratch = Path(mkdtemp(prefix=f".{target_path.name}-", dir=target_path.parent))
        scratch.chmod(0o755)
        lock = _lock(scratch)  # before it has a name that others clear
        scratch = scratch.rename(scratch.with_name(f"{scratch.name}{WRITTEN}"))
        yield scratch
        lines = [f"{COMMAND_LINE}{command}", *_files(scratch)]
        (scratch / CONTENTS).write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
        _check(target, command, force)
        _put(scratch, target_path)
    except OSError as error:
        raise _not_written(target, error) from error
    finally:
        if scratch is not None and scratch.exists():
            shutil.rmtree(scratch, ignore_errors=True)
        if lock is not None:
            os.close(lock)
        for folder in missing:
            with suppress(OSError):
                folder.rmdir()


def _check(target: Path, command: str, force: bool) -> None:
    if not target.exists():
        _check_parent(target)
        return
    if not target.is_dir():
        raise InputError(f"'{target}' is a file; choose another folder for the run with --out.")
    if Path.cwd().is_relative_to(target.resolve()):
        raise InputError(f"'{target}' is the current folder; choose a new folder for the run with --out.")
    if not any(target.iterdir()):
        return
    listing = target / CONTENTS
    if not listing.exists():
        raise InputError(f"folder '{target}' contains files that are not a run; choose another folder with --out.")
    if not force:
        raise InputError(
            f"run folder '{target}' already exists; choose another folder with --out, or replace it with --force "
            "(in Python force=True)."
        )
    listed = listing.read_text(encoding="utf-8", errors="replace").splitlines()
    made_by = next((line.removeprefix(COMMAND_LINE) for line in listed[:1] if line.startswith(COMMAND_LINE)), command)
    if made_by != command:
        raise InputError(
            f"folder '{target}' holds what tissuq {made_by} made, which --force of tissuq {command} does not replace: "
            "choose another folder with --out, or remove that one first."
        )
    foreign = set(_files(target)) - {CONTENTS, *listed}
    if foreign:
        raise InputError(
            f"run folder '{target}' also contains files that do not belong to the run "
            f"({', '.join(sorted(foreign)[:3])}); move them elsewhere, or choose another folder with --out."
        )


def _check_parent(target: Path) -> None:
    """Refuse, before any work is done, a folder that cannot be created."""
    existing = next(folder for folder in target.absolute().parents if folder.exists())
    if not existing.is_dir():
        raise InputError(f"'{target}' cannot be created: '{existing}' is a file; choose another folder with --out.")
    if not os.access(existing, os.W_OK | os.X_OK):
        raise InputError(
            f"'{target}' cannot be created: no permission to write to '{existing}'; choose another folder with --out."
        )


def _files(folder: Path) -> list[str]:
    """Return everything in a folder that is not itself a folder, by relative path."""
    paths = (path for path in folder.rglob("*") if path.is_symlink() or not path.is_dir())
    return sorted(path.relative_to(folder).as_posix() for path in paths)


def _put(scratch: Path, target: Path) -> None:
    """Rename the finished folder into place; an earlier run goes only when the new one stands."""
    if not target.exists():
        scratch.rename(target)
        return
    earlier = target.with_name(f"{scratch.name}{EARLIER}")
    target.rename(earlier)
    try:
        scratch.rename(target)
    except OSError:
        earlier.rename(target)
        raise
    shutil.rmtree(earlier, ignore_errors=True)


def _clear(target: Path) -> None:
    """Take away what commands that were killed left beside a run folder, and put back a run that one had moved."""
    pattern = f".{escape(target.name)}-????????{WRITTEN}"
    for earlier in target.parent.glob(f"{pattern}{EARLIER}"):
        scratch = earlier.with_name(earlier.name.removesuffix(EARLIER))
        if scratch.exists() and not target.exists() and (lock := _lock(scratch)) is not None:
            earlier.rename(target)
            os.close(lock)
        elif target.exists() and not scratch.exists():
            shutil.rmtree(earlier, ignore_errors=True)
    for scratch in target.parent.glob(pattern):
        if (lock := _lock(scratch)) is not None:
            shutil.rmtree(scratch, ignore_errors=True)
            os.close(lock)


def _lock(folder: Path) -> int | None:
    """Return a lock of a folder, which lasts until it is closed or this process ends.

    None where another process has it, or where there are none, as on Windows and some network disks.
    """
    try:
        from fcntl import LOCK_EX, LOCK_NB, flock

        handle = os.open(folder, os.O_RDONLY)
    except (ImportError, OSError):
        return None
    try:
        flock(handle, LOCK_EX | LOCK_NB)
    except OSError:
        os.close(handle)
        return None
    return handle


def _not_written(target: Path, error: OSError) -> InputError:
    reason = error.strerror or str(error)
    return InputError(
        f"the run could not be written to '{target}': {reason}. Check the folder's permissions and the space "
        "on the disk, or choose another folder with --out."
    )


LIBRARIES = ("tissuq", "numpy", "scipy", "jax", "blackjax", "arviz-stats", "xarray", "matplotlib")


def write_page(folder: Path, **context: Any) -> None:
    """Write report.html from the template of a result, with the folder's recipe and figures; values are escaped."""
    recipe = folder / RECIPE
    context["recipe"] = recipe.read_text(encoding="utf-8") if recipe.exists() else ""
    figures = sorted((folder / "figures").glob("*.svg"))
    context["figures"] = {
        path.stem: f"data:image/svg+xml;base64,{b64encode(path.read_bytes()).decode('ascii')}" for path in figures
    }
    page = _templates().get_template("result.html").render(versions=versions(), asset=_asset, **context)
    (folder / "report.html").write_text(page, encoding="utf-8")


@cache
def _templates() -> Environment:
    """Return the templates of this package, each compiled once in a process."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    templates = Environment(
        loader=PackageLoader("tissuq.report"), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True, finalize=_in_one_piece,
    )  # fmt: skip
    templates.filters["prose"] = _prose
    return templates


def _in_one_piece(value: Any) -> Any:
    """Return what a template shows, in plain texts with numbers on the line of their %."""
    return unbroken(value) if type(value) is str else value


def _prose(text: str) -> Markup:
    """Return a text as HTML: ``**strong**``, `` `code` ``, options and exponents in one piece; all else is escaped."""
    from markupsafe import Markup, escape

    marked = re.sub(r"\*\*(.+?)\*\*", r"<strong>\1</strong>", str(escape(unbroken(text))))
    marked = re.sub(r"(?<![\w-])(--[a-z][a-z-]+[a-z]|\d[\d.]*e-\d+)", r"<span class=option>\1</span>", marked)
    return Markup(re.sub(r"`(.+?)`", r"<code>\1</code>", marked))  # noqa: S704 (escaped above)


@cache
def _asset(name: str) -> str:
    """Return a script or a style that goes into pages."""
    return (files("tissuq.report") / "assets" / name).read_text(encoding="utf-8")


def versions() -> dict[str, str]:
    """Return the versions of Python and of the libraries on which numbers depend."""
    return {"python": platform.python_version()} | {name: version(name) for name in LIBRARIES}


def write_figures(folder: Path, figures: Mapping[str, Figure]) -> None:
    """Write every figure as SVG and PNG."""
    from tissuq.drawing.style import save_figure

    (folder / "figures").mkdir(exist_ok=True)
    for name, figure in figures.items():
        save_figure(figure, folder / "figures", name)


def write_recipe(folder: Path, command: str, settings: BaseModel, without: frozenset[str] = frozenset()) -> None:
    """Write run.toml, from which ``tissuq COMMAND --config`` repeats the run; ``without`` settings of no meaning."""
    import tomli_w

    plain: dict[str, Any] = settings.model_dump(mode="json", exclude_none=True, exclude=set(without))
    again = f"tissuq {command} --config {RECIPE} --out ANOTHER_FOLDER"
    header = f"# Repeat this run (version {version('tissuq')}): {again}\n"
    (folder / RECIPE).write_text(header + tomli_w.dumps(plain), encoding="utf-8")
