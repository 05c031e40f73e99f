"""``tissuq init``, ``doctor`` and ``app``: an example to begin from, what is here to work with, and the local page."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tissuq.errors import InputError

if TYPE_CHECKING:
    from tissuq.studies.installation import Extra


def init(
    folder: Annotated[Path, typer.Argument(help="Folder to write it into, new or empty.")] = Path("tissuq-example"),
) -> None:
    """Write an example project: measured files, a study of them, and the same in Python."""
    from tissuq.studies.example_project import write_example_project

    project = write_example_project(folder)
    for file in sorted(path for path in project.rglob("*") if path.is_file()):
        print(file)
    print(f"\nNext:\n    cd {project}\n    tissuq inspect data/tension-compression.csv\n    tissuq fit study.toml")


def doctor() -> None:
    """Show versions, extras and programs that are here, with what each is for; status 2 where a needed one is not."""
    import platform
    from importlib import metadata

    from tissuq.studies import installation

    print(f"tissuq {metadata.version('tissuq')}, Python {platform.python_version()}, {platform.platform()}")
    needed = installation.needed()
    print("\nNeeded")
    for package in needed:
        problem = "" if package.is_enough else f"   needs {package.least} or later"
        print(f"    {package.name:<20} {package.version or 'not installed'}{problem}")
    print("\nExtras")
    for extra in installation.extras():
        print(f"    {extra.name:<10} {extra.purpose}\n               {_state_of(extra)}")
    print("\nOther programs (none is needed to fit)")
    for program in installation.programs():
        print(f"    {program.name:<10} {program.purpose}\n               {program.path or 'not on the PATH'}")
    lacking = [package for package in needed if not package.is_enough]
    if lacking:
        names = " ".join(f"'{package.name}>={package.least}'" for package in lacking)
        raise InputError(f"{len(lacking)} needed packages are not here or too old. Type: pip install --upgrade {names}")


def _state_of(extra: Extra) -> str:
    lacking = ", ".join(package.name for package in extra.packages if not package.is_enough)
    if lacking:
        return f"not installed ({lacking}): pip install 'tissuq[{extra.name}]'"
    return ", ".join(f"{package.name} {package.version}" for package in extra.packages)


def app(
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port of the page on this computer; 0 takes a free one.")
    ] = 0,
    browser: Annotated[bool, typer.Option(help="Open the page in the browser.")] = True,
) -> None:
    """Open a page in the browser for files of measurements: read, mend, fit, compare, predict, export."""
    try:
        from tissuq.app.server import serve
    except ModuleNotFoundError as missing:
        raise InputError(f"the page needs {missing.name}: pip install 'tissuq[app]'.") from missing
    serve(port, open_browser=browser)
