"""The commands, and how every error reaches a person."""

from __future__ import annotations

import signal
import sys
from io import TextIOWrapper
from types import FrameType
from typing import Annotated

import typer

from tissuq.cli import (
    calibrate,
    catalogue,
    design,
    ensemble,
    fit,
    inspect,
    project,
    runs,
    structure,
    study,
)
from tissuq.cli.former_names import Renamed
from tissuq.errors import TissuqError

__all__ = ["app", "main"]

INTERRUPTED = 130
"""The exit status that Typer gives to Ctrl-C."""
TERMINATED = 128 + signal.SIGTERM

app = typer.Typer(
    name="tissuq",
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


app.command("init")(project.init)
app.command("paper", cls=Renamed)(study.paper)
app.command("inspect")(inspect.inspect)
app.command("fit")(fit.fit)
app.command("predict", cls=Renamed)(runs.predict)
app.command("population", cls=Renamed)(fit.population)
app.command("calibrate")(calibrate.calibrate)
app.command("compare")(runs.compare)
app.command("design", cls=Renamed)(design.design)
app.command("export", cls=Renamed)(runs.export)
app.command("structure", cls=Renamed)(structure.structure)
app.command("ensemble")(ensemble.ensemble)
app.command("simulate", cls=Renamed, hidden=True, deprecated=True)(structure.structure)
app.command("show")(runs.show)
app.command("materials")(catalogue.materials)
app.command("modes")(catalogue.modes)
app.command("check")(catalogue.check)
app.command("discrepancies")(catalogue.discrepancies)
app.add_typer(study.study)
app.command("datasets")(catalogue.datasets)
app.command("doctor")(project.doctor)


def main() -> None:
    """Run the command line: exit status 2 with one message on bad input, 3 when sampling has not converged."""
    signal.signal(signal.SIGTERM, _stop)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that shows no ± shows a ? instead
    try:
        app(prog_name="tissuq")
    except TissuqError as error:
        typer.echo(f"tissuq: {error}", err=True)
        sys.exit(2)
    except OSError as error:
        typer.echo(f"tissuq: {error}. Check the path, its permissions and the space on the disk.", err=True)
        sys.exit(2)
    except SystemExit as end:
        if end.code in (INTERRUPTED, TERMINATED):
            typer.echo("tissuq: stopped; no run was written (the same command resumes a campaign).", err=True)
        raise


def _stop(number: int, _: FrameType | None) -> None:
    """End on a request to terminate as on an error, so that nothing half written is left."""
    signal.signal(number, signal.SIG_IGN)
    sys.exit(TERMINATED)
