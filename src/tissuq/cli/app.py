"""The commands, and how every error reaches a person."""

from __future__ import annotations

import sys

import typer

from tissuq.cli import (
    calibrate,
    catalogue,
    check,
    compare,
    design,
    export,
    fit,
    inspect,
    paper,
    population,
    predict,
    show,
    simulate,
    study,
)
from tissuq.errors import TissuqError

__all__ = ["app", "main"]

INTERRUPTED = 130
"""The exit status that Typer gives to Ctrl-C."""

app = typer.Typer(
    name="tissuq",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help="Parameters of hyperelastic soft-tissue models, with uncertainty that can be trusted.",
)
app.command("paper")(paper.paper)
app.command("inspect")(inspect.inspect)
app.command("fit")(fit.fit)
app.command("predict")(predict.predict)
app.command("population")(population.population)
app.command("calibrate")(calibrate.calibrate)
app.command("compare")(compare.compare)
app.command("design")(design.design)
app.command("export")(export.export)
app.command("simulate")(simulate.simulate)
app.command("show")(show.show)
app.command("materials")(catalogue.materials)
app.command("modes")(catalogue.modes)
app.command("check")(check.check)
app.command("discrepancies")(catalogue.discrepancies)
app.add_typer(study.study)
app.command("datasets")(catalogue.datasets)


def main() -> None:
    """Run the command line: exit status 2 with one message on bad input, 3 when sampling has not converged."""
    try:
        app(prog_name="tissuq")
    except TissuqError as error:
        typer.echo(f"tissuq: {error}", err=True)
        sys.exit(2)
    except OSError as error:
        typer.echo(f"tissuq: {error}. Check the path, its permissions and the space on the disk.", err=True)
        sys.exit(2)
    except SystemExit as end:
        if end.code == INTERRUPTED:
            typer.echo("tissuq: stopped; no run was written (a campaign goes on with the same command).", err=True)
        raise
