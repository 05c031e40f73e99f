"""The call `tissuq.calibrate`: parameters of an expensive forward model, from its own outputs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tissuq.discrepancy.discrepancy import Discrepancy
from tissuq.emulation.adaptive import Choices, calibrated
from tissuq.emulation.calibration import Calibration
from tissuq.emulation.emulator import Emulator
from tissuq.emulation.forward import Forward, as_forward
from tissuq.emulation.problem import pose
from tissuq.emulation.runs import ForwardRuns
from tissuq.errors import InputError
from tissuq.priors import Prior
from tissuq.studies.forward_runs import runs_of
from tissuq.studies.stream import Step, silent

__all__ = ["calibrate"]

FloatArray = NDArray[np.float64]


def calibrate(
    control: ArrayLike,
    measured: ArrayLike,
    forward: Forward | Callable[..., Any],
    priors: Mapping[str, Prior],
    *,
    discrepancy: str | Discrepancy = "none",
    noise_sd: float | str = "unknown",
    zero_load: float = 0.0,
    emulator: Emulator | None = None,
    workers: int = 1,
    folder: str | Path | None = None,
    step: Step = silent,
    **choices: Any,
) -> Calibration:
    """Identify the parameters of an expensive forward model from what it computes, such as the force of indentation.

    The model is run at parameters that fill the priors, and a Gaussian process stands for it, whose own error is part
    of the likelihood: measured = emulator(parameters) + discrepancy(control) + noise (Kennedy & O'Hagan 2001).

    Parameters
    ----------
    control : (n,) array
        What was set in the experiment, such as depths; in the model's units, like everything here.
    measured : (n,) array
        What was measured there, such as forces.
    forward : callable or Forward
        ``forward(parameters)`` or ``forward(parameters, control)``, with a dictionary of parameters by name: returns n
        outputs. Or an `tissuq.emulation.umbridge.UmbridgeForward`.
    priors : mapping of str to Prior
        Of every parameter of the model: together they say where it is run. And, to replace the usual ones, of the
        discrepancy's ``c`` and ``psi`` and of ``noise_sd``.
    discrepancy : str
        ``"none"``, ``"gp"``, or ``"gp-pinned"``: zero with its slope at zero load, which leaves the initial stiffness
        to the parameters.
    noise_sd : float or ``"unknown"``
        Standard deviation of the noise.
    zero_load : float
        The control at zero load.
    emulator : Emulator, optional
        That of an earlier calibration with the same model and controls, instead of new runs.
    workers : int
        Processes that run the model; it must then be a function at the top of a file.
    folder : str or Path, optional
        Keeps every run as soon as it is done: the same call goes on there after a stop. Runs that failed are tried
        again.
    step : callable
        Told of every run that is done: its label, and whether it was done now or before.
    **choices
        ``runs`` (40) and ``refine`` (0): runs over the priors, and at most so many further ones where the posterior
        is; ``design`` (``"sobol"``, ``"latin"``); ``kernel`` (``"squared-exponential"``, ``"matern-5/2"``); ``trend``
        (``"linear"``, ``"constant"``, ``"quadratic"``); ``method`` (``"auto"``, ``"importance"``, ``"nuts"``);
        ``seed``.

    Raises
    ------
    InputError, ModelError, ConvergenceError
        When something does not fit, too many runs fail, or the folder holds runs of another model.

    References
    ----------
    Kennedy & O'Hagan (2001), Journal of the Royal Statistical Society B 63, 425-464.
    Higdon, Gattiker, Williams & Rightley (2008), Journal of the American Statistical Association 103, 570-583.

    Examples
    --------
    >>> import numpy as np
    >>> import tissuq as tq
    >>> def force(parameters, depth):
    ...     return parameters["mu"] * np.expm1(parameters["b"] * depth)
    >>> depth = np.linspace(0.1, 1, 12)
    >>> measured = force({"mu": 0.4, "b": 1.5}, depth) + 0.01 * np.random.default_rng(1).standard_normal(12)
    >>> priors = {"mu": tq.Uniform(0.1, 1), "b": tq.Uniform(0.5, 3)}
    >>> found = tq.calibrate(depth, measured, force, priors, noise_sd=0.01, runs=16)
    >>> low, high = found.marginals["b"].hdi()
    >>> bool(low < 1.5 < high), found.check.relative_error < 0.01
    (True, True)
    """
    problem = pose(control, measured, priors, discrepancy, noise_sd, zero_load)
    unknown = set(choices) - {each.name for each in fields(Choices)}
    if unknown:
        known = ", ".join(each.name for each in fields(Choices))
        raise InputError(f"tissuq.calibrate has no option '{sorted(unknown)[0]}'; further options are {known}.")
    asked = Choices(**choices)
    if emulator is not None and not asked.refine:
        return calibrated(problem, _no_runs, asked, emulator)
    model = as_forward(forward)
    model.check(problem.forward_symbols)
    with runs_of(model, problem, folder, workers, step) as run:
        return calibrated(problem, run, asked, emulator)


def _no_runs(points: FloatArray) -> ForwardRuns:
    raise InputError(f"there is no model for {len(points)} runs.")
