"""A population as labelled arrays, for ArviZ and for a file."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tissuq.posterior import Posterior

if TYPE_CHECKING:
    import xarray as xr

    from tissuq.population.population import Population

__all__ = ["labelled"]

FloatArray = NDArray[np.float64]


def labelled(population: Population) -> xr.DataTree:
    """Return draws and data of a population with the names of specimens and parameters."""
    import xarray as xr

    posteriors, symbols = population.posteriors, list(population.symbols)
    chains, draws = population.median.shape[:2]
    sample = {"chain": np.arange(chains), "draw": np.arange(draws)}
    parameter = {"parameter": symbols}
    specimen = {"specimen": list(posteriors)}
    each, pair = ("chain", "draw", "parameter"), ("chain", "draw", "parameter", "other_parameter")
    of_specimen = ("chain", "draw", "specimen", "parameter")
    alone = np.stack([_drawn(posterior, symbols, (chains, draws)) for posterior in posteriors.values()], axis=2)
    together = _drawn(population.complete, symbols, (chains, draws))
    data = [posterior.model.experiment for posterior in posteriors.values()]
    owner = np.repeat(np.arange(len(data)), [len(experiment) for experiment in data])
    stretch = np.concatenate([one.mode.abscissa(one.stretch) for one in data])
    stress = np.concatenate([one.stress for one in data])
    mode = [part.mode.name for one in data for part in one.parts for _ in range(part.stress.size)]
    groups = {
        "posterior": xr.Dataset(
            {
                "median": (each, population.median),
                "spread": (each, population.spread),
                "correlation": (pair, population.hierarchy.correlation),
                "specimens": (of_specimen, population.specimens),
            },
            sample | parameter | specimen | {"other_parameter": symbols},
        ),
        "new_patient": xr.Dataset({"parameters": (each, population.new)}, sample | parameter),
        "no_pooling": xr.Dataset({"specimens": (of_specimen, alone)}, sample | parameter | specimen),
        "complete_pooling": xr.Dataset({"parameters": (each, together)}, sample | parameter),
        "observed_data": xr.Dataset({"stress": ("measurement", stress, {"units": "MPa"})}),
        "constant_data": xr.Dataset(
            {
                "stretch": ("measurement", stretch),
                "specimen": ("measurement", owner),
                "mode": ("measurement", mode),
            }
        ),
    }
    tree = xr.DataTree.from_dict(groups)
    model, found = population.complete.model, population.diagnostics
    tree.attrs.update(
        inference_library="tissuq",
        material=model.material.name,
        discrepancy=model.discrepancy.name,
        noise=str(model.noise),
        loading_mode=", ".join(mode.name for mode in model.experiment.modes),
        stress_unit=model.experiment.stress_unit,
        logarithms=", ".join(np.array(symbols)[population.coordinates.is_log]),
        spread_prior=f"half-normal({population.spread_prior:g})",
        seed=population.seed,
        converged=str(population.converged),
        verdict=found.verdict,
        effective=population.hierarchy.effective,
    )
    return tree


def _drawn(posterior: Posterior, symbols: list[str], shape: tuple[int, int]) -> FloatArray:
    """Return draws (chains, draws, d) of a posterior, as many as asked for, evenly taken from its own."""
    own = np.column_stack([posterior.solution.draws[symbol].ravel() for symbol in symbols])
    chosen = np.linspace(0, len(own) - 1, shape[0] * shape[1]).round().astype(int)
    return np.asarray(own[chosen].reshape(*shape, len(symbols)))
