"""A population as labelled arrays, for ArviZ and for a file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tissuq.population.likelihoods import Coordinates
from tissuq.posterior.posterior import Posterior

if TYPE_CHECKING:
    import xarray as xr

    from tissuq.population.hierarchy import Hierarchy

__all__ = ["labelled"]

FloatArray = NDArray[np.float64]


def labelled(
    posteriors: Mapping[str, Posterior],
    complete: Posterior,
    coordinates: Coordinates,
    hierarchy: Hierarchy,
    new: FloatArray,
    labels: Mapping[str, str | float],
) -> xr.DataTree:
    """Return draws and data of a population with the names of specimens and parameters.

    Parameters
    ----------
    posteriors, complete, coordinates, hierarchy, new
        As in `Population`.
    labels : mapping of str to str or float
        Further attributes of the tree.
    """
    import xarray as xr

    symbols = list(coordinates.symbols)
    chains, draws = hierarchy.mean.shape[:2]
    sample = {"chain": np.arange(chains), "draw": np.arange(draws)}
    parameter = {"parameter": symbols}
    specimen = {"specimen": list(posteriors)}
    by_parameter, by_pair = ("chain", "draw", "parameter"), ("chain", "draw", "parameter", "other_parameter")
    of_specimen = ("chain", "draw", "specimen", "parameter")
    no_pooling = np.stack([_drawn(posterior, symbols, (chains, draws)) for posterior in posteriors.values()], axis=2)
    complete_pooling = _drawn(complete, symbols, (chains, draws))
    data = [posterior.model.experiment for posterior in posteriors.values()]
    owner = np.repeat(np.arange(len(data)), [experiment.size for experiment in data])
    stretch = np.concatenate([experiment.states.abscissa for experiment in data])
    stress = np.concatenate([experiment.measured for experiment in data])
    mode = [curve.mode.name for experiment in data for curve in experiment.curves for _ in range(len(curve))]
    groups = {
        "posterior": xr.Dataset(
            {
                "median": (by_parameter, coordinates.from_line(hierarchy.mean)),
                "spread": (by_parameter, hierarchy.tau * coordinates.scale),
                "correlation": (by_pair, hierarchy.correlation),
                "specimens": (of_specimen, coordinates.from_line(hierarchy.specimens)),
            },
            sample | parameter | specimen | {"other_parameter": symbols},
        ),
        "new_patient": xr.Dataset({"parameters": (by_parameter, new)}, sample | parameter),
        "no_pooling": xr.Dataset({"specimens": (of_specimen, no_pooling)}, sample | parameter | specimen),
        "complete_pooling": xr.Dataset({"parameters": (by_parameter, complete_pooling)}, sample | parameter),
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
    model = complete.model
    tree.attrs.update(
        inference_library="tissuq",
        material=model.material.name,
        discrepancy=model.discrepancy.name,
        noise=str(model.noise),
        loading_mode=", ".join(mode.name for mode in model.experiment.modes),
        stress_unit=model.experiment.stress_unit,
        logarithms=", ".join(np.array(symbols)[coordinates.is_log]),
        verdict=hierarchy.diagnostics.verdict,
        effective=hierarchy.effective,
        **labels,
    )
    return tree


def _drawn(posterior: Posterior, symbols: list[str], shape: tuple[int, int]) -> FloatArray:
    """Return draws (chains, draws, d) of a posterior, evenly thinned from its own."""
    draws = np.column_stack([posterior.solution.draws[symbol].ravel() for symbol in symbols])
    rows = np.linspace(0, len(draws) - 1, shape[0] * shape[1]).round().astype(int)
    return np.asarray(draws[rows].reshape(*shape, len(symbols)))
