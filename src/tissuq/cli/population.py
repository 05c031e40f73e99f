"""``tissuq population``: what specimens have in common, and how far they differ."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from tissuq.cli.call import Call, not_converged
from tissuq.cli.command import command
from tissuq.cli.running import Written
from tissuq.studies.population_settings import PopulationSettings

__all__ = ["population"]


@command(PopulationSettings, Written, out="Folder for the run [runs/population].")
def population(call: Call[PopulationSettings, Written]) -> None:
    """Identify a population from its specimens, every specimen within it, and what to expect of a new specimen."""
    from tissuq.mechanics import material_named
    from tissuq.report.population import population_result
    from tissuq.studies.population import run_population

    call.check_source("files", "the FILES of several specimens, folders of them", "run")
    settings, material = call.loaded(rivals=("noise", "noise_sd")), call.stated.get("material")
    law = material_named(material, laws=True) if material else None
    target = call.target(Path("runs") / "population")
    study = call.carried_out(
        target,
        lambda step: run_population(settings, call.beside, step, law),
        partial(population_result, beside=call.beside),
    )
    not_converged([] if study.population.converged else ["the population"])
