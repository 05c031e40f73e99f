"""The same model with a finer mesh, on which one draw is run for the error of the mesh."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tissuq.decks import Deck, Quantity
from tissuq.decks.model_run import check_sets
from tissuq.errors import InputError
from tissuq.posterior.ensemble import Ensemble
from tissuq.studies.model_settings import EnsembleSettings

__all__ = ["FINER", "FinerModel", "finer_model"]

FINER = "finer"
"""Folder with copies of its files, in the folder of the ensemble."""


@dataclass(frozen=True)
class FinerModel:
    """The same model with a finer mesh.

    Attributes
    ----------
    deck : Deck
    number : int
        The draw that is run on it: of all, its stresses in the test are in the middle.
    ratio : float
        How many times smaller its elements are.
    order : float
        Of convergence: the power of their size with which the error falls.
    counts : (int, int) or None
        Elements of the model and of this one, where the ratio is taken from these.
    """

    deck: Deck
    number: int
    ratio: float
    order: float
    counts: tuple[int, int] | None = None

    @property
    def finer(self) -> float:
        """What the error of the mesh is divided by on this one."""
        return float(self.ratio**self.order)

    @property
    def words(self) -> str:
        """What is assumed, as a sentence."""
        by_count = f" (by {self.counts[0]} and {self.counts[1]} elements)" if self.counts else " (as given)"
        return (
            f"Draw {self.number + 1} was run on '{self.deck.main}', too, whose elements are {self.ratio:.3g} times "
            f"smaller{by_count}; the error is assumed to fall with the power {self.order:g} of their size everywhere, "
            "and to be the same share of every draw's quantity."
        )


def finer_model(
    settings: EnsembleSettings,
    beside: Path,
    deck: Deck,
    quantities: Sequence[Quantity],
    ensembles: Collection[Ensemble],
) -> FinerModel | None:
    """Return the model with the finer mesh that settings name; None where they name none.

    Raises
    ------
    InputError
        When it lacks a material or a set of the model, is of another format, or has no finer mesh.
    """
    if settings.finer_model is None:
        if settings.cell_ratio is not None or settings.mesh_order is not None:
            raise InputError("--cell-ratio and --mesh-order are of a finer model: give --finer-model FILE, too.")
        return None
    finer = Deck.read(beside / settings.finer_model, deck.format.name, frozenset())
    try:
        for name in settings.materials:
            finer.material(name)
        check_sets(finer, quantities)
    except InputError as error:
        raise InputError(
            f"the finer model (--finer-model) must have the materials and sets of the model: {error}"
        ) from error
    if list(finer.files.values()) == list(deck.files.values()):
        raise InputError(
            f"the finer model (--finer-model) '{finer.main}' is the model itself: give one with a finer mesh."
        )
    number, order = _middle_draw(ensembles), settings.mesh_order or 1.0
    if settings.cell_ratio is not None:
        return FinerModel(finer, number, settings.cell_ratio, order)
    sizes = [
        model.format.mesh_size(list(model.files.values())) if not model.outside else None for model in (deck, finer)
    ]
    coarse, fine = sizes
    if coarse is None or fine is None or coarse.dimensions != fine.dimensions:
        raise InputError(
            f"how much finer the mesh of '{finer.main}' is cannot be told from its elements and those of "
            f"'{deck.main}': give --cell-ratio, such as 2 where its elements are half as long."
        )
    if fine.elements <= coarse.elements:
        raise InputError(
            f"the finer model '{finer.main}' has {fine.elements} elements, and the model {coarse.elements}: give a "
            "finer mesh with --finer-model."
        )
    ratio = float((fine.elements / coarse.elements) ** (1 / coarse.dimensions))
    return FinerModel(finer, number, ratio, order, (coarse.elements, fine.elements))


def _middle_draw(ensembles: Collection[Ensemble]) -> int:
    """Return the draw whose stress in the tests is in the middle of all, in all materials together."""
    stresses = [np.abs(ensemble.stresses_at(ensemble.model.experiment.states)).mean(axis=1) for ensemble in ensembles]
    ranks = np.array([np.argsort(np.argsort(of_material)) for of_material in stresses])
    return int(np.argmin(((ranks - ranks.shape[1] // 2) ** 2).sum(axis=0)))
