"""What every file of a draw says of where it comes from, and the row of a draw in the index."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tissuq.ensemble import EnergyDraw, Ensemble
from tissuq.export.cards import CardSettings
from tissuq.export.states import SeenStates

__all__ = ["distances_from_median", "draw_row", "ensemble_lines", "file_name", "words_of"]


def file_name(ensemble: Ensemble, place: int, suffix: str) -> str:
    """Return the name of a draw's file, so that names sort like numbers."""
    return f"draw-{place + 1:0{len(str(len(ensemble)))}d}{suffix}"


def ensemble_lines(ensemble: Ensemble, settings: CardSettings) -> Iterator[str]:
    """Return the sentences that are true of all draws."""
    model = ensemble.model
    names = f"{model.material.name}, discrepancy {model.discrepancy.name}"
    yield f"tissuq: equally probable draws of the posterior of {names}"
    yield f"source: {settings.source or model.experiment.name}"
    yield (
        "energy of the draws: material and discrepancy" if ensemble[0].discrepancy else "energy of the draws: material"
    )
    if ensemble.admissible_in:
        yield (
            f"admissible: stable over the measured range in {', '.join(ensemble.admissible_in)}; "
            f"{len(ensemble)} of {ensemble.tried} draws that were tried are"
        )
    else:
        yield "admissible: not looked at, draws may be unstable"
    ends = (f"{mode} {low:.4g} to {high:.4g}" for mode, (low, high) in ensemble.ranges.items())
    yield f"calibrated stretches: {', '.join(ends)}; beyond, the card is an extrapolation"


def draw_row(draw: EnergyDraw, settings: CardSettings, modulus: float) -> dict[str, Any]:
    """Return what the index says of any draw: its number, parameters (stresses in the unit), and its modulus."""
    own = _parameters(draw, settings)
    return {"draw": draw.number + 1, "unit": settings.unit, **own, "initial_shear_modulus": modulus}


def words_of(draw: EnergyDraw, settings: CardSettings) -> str:
    """Return the parameters of a draw in words, stresses in the unit."""
    return ", ".join(f"{symbol} = {value:.6g}" for symbol, value in _parameters(draw, settings).items())


def distances_from_median(ensemble: Ensemble) -> NDArray[np.float64]:
    """Return how far draws (N,) are from the median of all: root mean square difference of stresses in the seen states.

    Relative to the sizes of the medians; the draw with the smallest is the most typical.
    """
    states = SeenStates(ensemble.most)
    stress = ensemble.stress(states, states.points)
    middle = np.median(stress, axis=0)
    return np.asarray(np.sqrt((((stress - middle) / np.abs(middle)) ** 2).mean(axis=1)))


def _parameters(draw: EnergyDraw, settings: CardSettings) -> dict[str, float]:
    material, values = draw.parts[0]
    factors = (settings.factor if parameter.unit == "MPa" else 1.0 for parameter in material.parameters)
    symbols = (parameter.symbol for parameter in material.parameters)
    return {symbol: value * factor for symbol, value, factor in zip(symbols, values, factors, strict=True)}
