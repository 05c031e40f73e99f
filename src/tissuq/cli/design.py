"""``tissuq design``: which test to make next."""

from __future__ import annotations

import os
from functools import partial
from pathlib import Path

from tissuq.cli.call import Call
from tissuq.cli.command import command
from tissuq.cli.running import OfRun
from tissuq.errors import InputError
from tissuq.studies.design_settings import DesignSettings
from tissuq.studies.option import option

__all__ = ["design"]


class DesignOptions(OfRun):
    """How a ranking is written."""

    out: Path | None = option(None, "Folder for the ranking [runs/RUN-design].")


@command(DesignSettings, DesignOptions)
def design(call: Call[DesignSettings, DesignOptions]) -> None:
    """Rank tests that could be made next by how much less uncertain they make a parameter or a prediction."""
    from tissuq.report.answer_of_run import said_by
    from tissuq.report.design import design_result
    from tissuq.studies.design import run_design
    from tissuq.studies.ensemble_target import with_folder

    stated = call.stated.get("run")
    if not (call.config or stated):
        raise InputError("give the RUN folder of a fit, or --config run.toml.")

    def beside_settings(name: str) -> str:  # where all names of the settings count from
        is_from_here = not call.config or Path(name).is_absolute()
        return str(name) if is_from_here else os.path.relpath(name, call.beside)

    typed = tuple(with_folder(name, beside_settings) for name in call.stated.get("targets", ()))
    settings = call.loaded(run=beside_settings(stated) if stated else None, targets=typed or None)
    run = (call.beside / settings.run).resolve()
    target = call.target(Path("runs") / f"{run.name}-design", apart_from=call.beside / settings.run)

    def from_target(name: str) -> str:
        return os.path.relpath((call.beside / name).resolve(), target.resolve())

    targets = tuple(with_folder(name, from_target) for name in settings.targets)
    recipe = settings.model_copy(update={"run": from_target(settings.run), "targets": targets})

    said_by(run)  # refused before the ranking where it is damaged
    call.carried_out(
        target,
        lambda step: run_design(settings, call.beside, step, call.law),
        partial(design_result, recipe=recipe, run=run),
    )
