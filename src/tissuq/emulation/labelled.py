"""A calibration as labelled arrays, which ArviZ and xarray read."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import xarray as xr

    from tissuq.emulation.calibration import Calibration

__all__ = ["labelled_arrays"]

STRIDE = 4
"""Of the draws, for which measurements are simulated."""


def labelled_arrays(calibration: Calibration) -> xr.DataTree:
    """Return draws, measurements as simulated and as made, and forward runs: the groups of `Calibration.data`."""
    import xarray as xr

    problem, runs, drawn = calibration.problem, calibration.runs, calibration.posterior.draws
    chains, draws = np.arange(drawn.shape[0]), np.arange(drawn.shape[1])
    sample, some = {"chain": chains, "draw": draws}, {"chain": chains, "draw": draws[::STRIDE]}
    chosen = drawn[:, ::STRIDE]
    flat = chosen.reshape(-1, drawn.shape[2])
    scores = np.random.default_rng([calibration.seed, 59]).standard_normal((len(flat), len(problem.measured)))
    simulated = calibration.likelihood.replicates(flat, scores).reshape(*chosen.shape[:2], -1)
    point, run = {"measurement": np.arange(len(problem.measured))}, {"run": np.arange(len(runs))}
    columns = enumerate(problem.symbols)
    groups = {
        "posterior": xr.Dataset({each: (("chain", "draw"), drawn[:, :, place]) for place, each in columns}, sample),
        "posterior_predictive": xr.Dataset({"measured": (("chain", "draw", "measurement"), simulated)}, some | point),
        "observed_data": xr.Dataset({"measured": ("measurement", problem.measured)}, point),
        "constant_data": xr.Dataset({"control": ("measurement", problem.control)}, point),
        "forward_runs": xr.Dataset(
            {
                "parameters": (("run", "parameter"), runs.points),
                "outputs": (("run", "measurement"), runs.outputs),
                "error": ("run", np.array(runs.errors, dtype=str)),
                "seconds": ("run", runs.seconds),
            },
            point | run | {"parameter": list(runs.symbols)},
        ),
    }
    tree = xr.DataTree.from_dict(groups)
    tree.attrs.update(_labels(calibration))
    return tree


def _labels(calibration: Calibration) -> dict[str, str | float]:
    problem, found = calibration.problem, calibration.posterior
    labels: dict[str, str | float] = {
        "inference_library": "tissuq",
        "discrepancy": problem.discrepancy.name,
        "noise_sd": "unknown" if problem.noise_sd is None else problem.noise_sd,
        "method": found.method,
        "converged": str(found.converged),
        "verdict": found.verdict,
        "seed": calibration.seed,
        "emulator_check": str(calibration.check),
    }
    labels |= {f"prior_{symbol}": str(prior) for symbol, prior in problem.priors.items()}
    return labels if found.log_evidence is None else labels | {"log_evidence": found.log_evidence}
