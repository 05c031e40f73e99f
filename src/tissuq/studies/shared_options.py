"""Settings that several commands have: a run to begin from, which of its discrepancies, a seed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tissuq.parameters.seeds import MAX_SEED
from tissuq.studies.option import Settings, argument, option

__all__ = ["RunSettings", "sampling", "seed"]


class RunSettings(Settings):
    """What is done with a run of ``tissuq fit``."""

    run: str = argument(..., "Run folder of tissuq fit.", takes=Path, parse=str)
    discrepancy: str | None = option(None, "Which of the discrepancies of the run [auto, or the only one].")


def seed() -> Any:
    """Declare the seed of random numbers."""
    return option(0, "Seed of the random numbers.", ge=0, le=MAX_SEED)


def sampling() -> Any:
    """Declare how draws spread through a posterior."""
    return option("sobol", "How draws spread: sobol, latin or random.", choices="tissuq.posterior.ensemble:Sampling")
