"""The commands, and how every error reaches a person."""

from __future__ import annotations

import os
import sys
import warnings
from io import TextIOWrapper
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from tissuq.cli import catalogue, finite_elements, fit, inspect, of_run, project, show, study
from tissuq.cli.command import Command
from tissuq.cli.progress import INTERRUPTED, TERMINATED, Stopped, end_on_request
from tissuq.errors import TissuqError


class Commands(TyperGroup):
    """The commands, which help lists by what they are for."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands under their headings, each with the beginning of what it does."""
        limit = formatter.width - 6 - max(map(len, self.commands))
        rows: dict[str, list[tuple[str, str]]] = {}
        for name, command in self.commands.items():
            if not command.hidden:
                heading = str(getattr(command, "rich_help_panel", ""))
                rows.setdefault(heading, []).append((name, command.get_short_help_str(limit)))
        for heading, of_heading in rows.items():
            with formatter.section(heading):
                formatter.write_dl(of_heading)


app = typer.Typer(
    name="tissuq",
    cls=Commands,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def _print_version(is_asked: bool) -> None:
    if is_asked:
        import tissuq

        print(f"tissuq {tissuq.__version__}")
        raise typer.Exit


@app.callback()
def _tissuq(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and stop.", callback=_print_version, is_eager=True)
    ] = False,
) -> None:
    """Parameters of hyperelastic soft-tissue models, with uncertainty that can be trusted."""


COMMANDS: dict[str, dict[str, Any]] = {
    "Start here": {
        "init": project.init, "inspect": inspect.inspect, "fit": fit.fit, "show": show.show, "app": project.app,
    },
    "After a fit": {
        "predict": of_run.predict, "compare": show.compare, "design": of_run.design, "export": of_run.export,
        "structure": finite_elements.structure, "ensemble": finite_elements.ensemble,
    },
    "Several specimens, expensive models": {"population": fit.population, "calibrate": fit.calibrate},
    "How far to trust it": {"paper": study.paper, "check": catalogue.check},
    "What there is": {
        "materials": catalogue.materials, "modes": catalogue.modes, "discrepancies": catalogue.discrepancies,
        "datasets": catalogue.datasets, "doctor": project.doctor, "schema": catalogue.schema,
    },
}  # fmt: skip
"""The commands, under the headings of the help."""
for heading, commands in COMMANDS.items():
    for name, function in commands.items():
        app.command(name, cls=Command, rich_help_panel=heading)(function)
app.add_typer(study.study, rich_help_panel="How far to trust it")
app.command("simulate", cls=Command, hidden=True, deprecated="It is 'tissuq structure' now.")(  # type: ignore[arg-type]
    finite_elements.structure
)


UNREAD = 141
"""The exit status where what reads the output has ended, such as ``head``: that of the shell for other programs."""


def main() -> None:
    """Run the command line: exit status 2 with one message on bad input, 3 when sampling has not converged."""
    end_on_request()
    warnings.formatwarning = _in_words
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that shows no ± shows a ? instead
    try:
        for argument in sys.argv[1:]:
            argument.encode()  # a name that cannot be written into a run is refused before anything is computed
        app(prog_name="tissuq")
    except TissuqError as error:
        typer.echo(f"tissuq: {error}", err=True)
        sys.exit(2)
    except OSError as error:
        typer.echo(f"tissuq: {error}. Check the path, its permissions and the space on the disk.", err=True)
        sys.exit(2)
    except UnicodeEncodeError as error:
        if error.reason != "surrogates not allowed":
            raise
        line = error.object[: error.start].rpartition("\n")[2] + error.object[error.start :].partition("\n")[0]
        cure = "Rename the file or folder, or take a locale in UTF-8"
        typer.echo(f"tissuq: a name is not in UTF-8: {line}. {cure}.", err=True)
        sys.exit(2)
    except SystemExit as end:
        if _nobody_reads(end):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # what is still to be written
            sys.exit(UNREAD)
        if end.code in (INTERRUPTED, TERMINATED) and not isinstance(end, Stopped):
            typer.echo("tissuq: stopped; no run was written.", err=True)
        raise


def _in_words(message: Warning | str, *place: Any, **line: Any) -> str:
    """Return a warning without the place in the program, of which it says nothing to a person."""
    return f"tissuq: {message}\n"


def _nobody_reads(end: SystemExit) -> bool:
    """Return whether what reads the output ended before it was all written."""
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        return True
    return isinstance(end.__context__, BrokenPipeError)
