"""Settings that several commands have: a run to begin from, which of its laws or discrepancies, a seed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from tissuq.errors import InputError
from tissuq.parameters.checks import MAX_SEED
from tissuq.studies.option import Settings, argument, option

if TYPE_CHECKING:
    from tissuq.mechanics import Material

__all__ = ["RunSettings", "mesh_order", "sampling", "seed"]


class RunSettings(Settings):
    """What is done with a run of ``tissuq fit``."""

    run: str = argument(..., "Run folder of tissuq fit.", takes=Path)
    material: str | None = option(None, "Which of the laws of the run, where it compared several.")
    discrepancy: str | None = option(None, "Which of the discrepancies of the run [auto, or the only one].")

    def law_of(self, own: Material | None) -> str | Material | None:
        """Return the law of the run: the user's own, which was named beside the settings, or the name of another.

        Raises
        ------
        InputError
            When these are two.
        """
        if own is not None and self.material not in (None, own.name):
            raise InputError(f"--user-law names the law '{own.name}', and --material '{self.material}': give one law.")
        return own or self.material


def seed() -> Any:
    """Declare the seed of random numbers."""
    return option(0, "Seed of the random numbers.", ge=0, le=MAX_SEED)


def sampling() -> Any:
    """Declare how draws spread through a posterior."""
    return option(
        "sobol", "How draws spread: sobol, latin or random.", choices="tissuq.posterior.drawn_materials:Sampling"
    )


def mesh_order(group: str) -> Any:
    """Declare the order with which what is computed on a finer mesh converges."""
    return option(
        None,
        "Power of the size of elements with which the error of the mesh falls: 1 at sharp edges, 2 without [1].",
        gt=0,
        le=8,
        group=group,
    )
