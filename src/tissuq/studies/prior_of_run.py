"""The posterior of a run as priors of the parameters of another model: normal and log-normal ones that go together."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments.units import stress_unit
from tissuq.mechanics import material_named
from tissuq.model.discrepancy import Auto
from tissuq.parameters.priors import LogNormal, Normal, Prior
from tissuq.posterior.posterior import Posterior
from tissuq.studies.earlier_run import load, posteriors_in

__all__ = ["priors_of", "priors_of_run"]

FAR = 5.0
"""Standard deviations that a bound must be away from the mean of a normal prior."""
SMALL_CORRELATION = 1e-6
"""Size below which a correlation is left out."""


def priors_of_run(run: Path, material: str, unit: str) -> tuple[dict[str, Prior], dict[tuple[str, str], float]]:
    """Return `priors_of` the posterior of a run of a law.

    Raises
    ------
    InputError
        When there is no such run, or it is of another law, or its posterior has no such form.
    """
    law = material_named(material)
    files = posteriors_in(run) if run.is_dir() else {}
    if len(files) > 1 and not {law.name, Auto.name} & set(files):
        named = " or ".join(map(str, files.values()))
        raise InputError(f"the run '{run}' has several posteriors: give the file of one, --prior-run {named}.")
    posterior = load(run, law.name if law.name in files else None)
    fitted = posterior.model.material
    if law.name != fitted.name:
        raise InputError(
            f"the run '{run}' is of the material {fitted.name}, and the forward model has {law.name}: fit the tests "
            f"with --material {law.name} (--prior-run)."
        )
    return priors_of(posterior, unit)


def priors_of(posterior: Posterior, unit: str = "MPa") -> tuple[dict[str, Prior], dict[tuple[str, str], float]]:
    """Return priors of a law's parameters with mean, sd and correlations of a posterior.

    Positive parameters get a log-normal prior with mean and sd of the logarithms, others a normal one; what the
    posterior says of a discrepancy or of the noise is left out.

    Parameters
    ----------
    posterior : Posterior
    unit : str
        Of the parameters that are stresses.

    Returns
    -------
    priors : dict of str to Prior
    correlations : dict of (str, str) to float
        Of every two of them: of logarithms, where the prior is log-normal.

    Raises
    ------
    InputError
        When a parameter has bounds near which the posterior lies.

    Examples
    --------
    >>> import tissuq as tq
    >>> data = tq.simulate("neo-hookean", {"C10": 0.5}, [0.8, 0.9, 1.1, 1.2], noise_sd=0.01, seed=1)
    >>> posterior = tq.fit(data, discrepancy="none", noise_sd=0.01)
    >>> priors, _ = priors_of(posterior)
    >>> priors["C10"].name, bool(abs(priors["C10"].median / posterior.marginals["C10"].mean - 1) < 0.01)
    ('log-normal', True)
    """
    draws = posterior.data_in("MPa")["posterior"]
    to_mpa = stress_unit(unit).to_mpa
    priors: dict[str, Prior] = {}
    lines = []
    for parameter in posterior.model.material.parameters:
        symbol, (low, high) = parameter.symbol, parameter.support
        scale = to_mpa if parameter.unit else 1.0
        values = np.asarray(draws[symbol], dtype=np.float64).ravel() / scale
        is_positive = low == 0 and high == np.inf
        line = np.log(values) if is_positive else values
        mean, sd = float(line.mean()), float(line.std())
        if not is_positive and (mean - FAR * sd < low / scale or mean + FAR * sd > high / scale):
            raise InputError(
                f"the posterior of {symbol} lies near a bound of the parameter, and no normal prior is like it: give "
                f"its prior yourself, as --prior {symbol}=uniform(...)."
            )
        priors[symbol] = LogNormal(float(np.exp(mean)), sd) if is_positive else Normal(mean, sd)
        lines.append(line)
    matrix, symbols = np.corrcoef(np.atleast_2d(lines)).reshape(len(lines), -1), list(priors)
    pairs = [(i, j) for i in range(len(symbols)) for j in range(i + 1, len(symbols))]
    correlations = {
        (symbols[i], symbols[j]): float(matrix[i, j]) for i, j in pairs if abs(matrix[i, j]) > SMALL_CORRELATION
    }
    return priors, correlations
