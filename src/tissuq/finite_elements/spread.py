"""The band of a quantity over draws, and what its variance is due to, with the errors of a finite number of draws."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

PROBABILITY = 0.95
MIN_DRAWS_A_COLUMN = 5
"""Draws for every column of a source, below which its part cannot be told."""
MAX_EXPONENT = 300.0
"""Of an exponential of a source, so that it stays finite."""
BOOTSTRAP_RESAMPLES = 400
"""Number of bootstrap resamples of the draws for standard errors."""


@dataclass(frozen=True)
class Band:
    """Mean, sd and interval of draws at every step: arrays (s,)."""

    mean: FloatArray
    sd: FloatArray
    low: FloatArray
    high: FloatArray


@dataclass(frozen=True)
class Shares:
    """Shares of the variance of a new measurement; they add up to one, and a single one can be negative or above one.

    With Q a draw's quantity and Q0 that of its parameters alone, Var Q = Cov(Q, Q0) + Cov(Q, Q - Q0): the parameters'
    part and the discrepancy's. A negative one means that the two compensate each other in the posterior. What draws
    differ by independently of both, `Ensemble.sources`, is taken out of these first: its part is what of Q is linear in
    its columns, and for the extrapolation in the exponential that follows from these, by least squares.

    Attributes
    ----------
    parameters, discrepancy, noise : (s,) arrays
    extrapolation, test_scale : (s,) arrays
        Not a number where the draws do not differ by these, or are fewer than five for every column.
    correlation : (s,) array
        Correlation of Q0 and Q - Q0; not a number without discrepancy.

    References
    ----------
    Li et al. (2010), Global sensitivity analysis for systems with independent and/or correlated inputs.
    """

    parameters: FloatArray
    discrepancy: FloatArray
    noise: FloatArray
    correlation: FloatArray
    extrapolation: FloatArray
    test_scale: FloatArray


def band_probability(draws: int) -> float:
    """Return the probability that a band of so many draws holds: 95 %, or what the range of fewer than 39 draws holds.

    Examples
    --------
    >>> band_probability(64), round(band_probability(16), 2)
    (0.95, 0.88)
    """
    return min(PROBABILITY, (draws - 1) / (draws + 1))


def too_few_draws(count: int) -> list[str]:
    """Return a warning where so many draws are too few for the ends of a band."""
    probability = band_probability(count)
    if probability >= PROBABILITY:
        return []
    return [
        f"{count} draws are too few for a 95 % band: the band is their range, which holds {100 * probability:.0f} %."
    ]


def band_of(values: FloatArray) -> Band:
    """Return mean, sd and the ends of the central interval of draws (N, s), which holds `band_probability`.

    Raises
    ------
    InputError
        When there are fewer than two draws.
    """
    if len(values) < 2:
        raise InputError(f"a band needs two draws or more, and there are {len(values)}.")
    tail = (1 - band_probability(len(values))) / 2
    low, high = np.quantile(values, [tail, 1 - tail], axis=0, method="weibull")
    return Band(values.mean(axis=0), values.std(axis=0, ddof=1), low, high)


def shares_of(
    complete: FloatArray,
    material_only: FloatArray,
    noise_sd: float = 0.0,
    sources: Mapping[str, FloatArray] | None = None,
) -> Shares:
    """Return what the variance of draws (N, s) is due to, given the same draws (N, s) without their discrepancy.

    ``sources`` are those of `tissuq.Ensemble`, columns (N, k) by name.
    """
    return _shares(complete, parts_of(complete, material_only, sources or {}), noise_sd)


def parts_of(
    complete: FloatArray, material_only: FloatArray, sources: Mapping[str, FloatArray]
) -> dict[str, FloatArray]:
    """Return the parts (N, s) that draws are made of, by what they are due to, and Q0 and Q - Q0 as they are."""
    parts = {"Q0": material_only, "rest": complete - material_only}
    remaining = {"parameters": material_only - material_only.mean(axis=0)}
    remaining["discrepancy"] = complete - complete.mean(axis=0) - remaining["parameters"]
    if not sources or len(complete) < MIN_DRAWS_A_COLUMN * _count(sources):
        return parts | remaining
    columns = zip(complete.T, remaining["parameters"].T, remaining["discrepancy"].T, strict=True)
    of_steps = [_explained(sources, *values) for values in columns]
    return parts | {name: np.stack([of_step[name] for of_step in of_steps], axis=1) for name in of_steps[0]}


def _count(sources: Mapping[str, FloatArray]) -> int:
    """Return the number of columns of a regression on sources, with the exponential of those with several."""
    return sum(columns.shape[1] + (columns.shape[1] > 1) for columns in sources.values())


def _explained(
    sources: Mapping[str, FloatArray], values: FloatArray, parameters: FloatArray, discrepancy: FloatArray
) -> dict[str, FloatArray]:
    """Return what of values (N,) the sources explain, and what they leave of parameters and discrepancy (N,).

    Beyond the data stresses go on as exponentials of the score: where all values have one sign, a source with several
    columns gets the exponential of its part in the logarithm of the values as a further one.
    """
    designs = {name: columns - columns.mean(axis=0) for name, columns in sources.items()}
    if np.abs(np.sign(values).sum()) == len(values):
        joint, logs = np.hstack(list(designs.values())), np.log(np.abs(values))
        weights = np.linalg.lstsq(joint, logs - logs.mean(), rcond=None)[0]
        for name, columns in designs.items():
            of_source, weights = weights[: columns.shape[1]], weights[columns.shape[1] :]
            if columns.shape[1] > 1:
                growth = np.exp(np.minimum(columns @ of_source, MAX_EXPONENT))
                designs[name] = np.column_stack([columns, growth - growth.mean()])
    joint = np.hstack(list(designs.values()))
    fitted = {
        name: np.linalg.lstsq(joint, target - target.mean(), rcond=None)[0]
        for name, target in (("", values), ("parameters", parameters), ("discrepancy", discrepancy))
    }
    ends = np.cumsum([0, *(columns.shape[1] for columns in designs.values())])
    spans = zip(designs, ends, ends[1:], strict=False)
    explained = {name: joint[:, start:end] @ fitted[""][start:end] for name, start, end in spans}
    unexplained = {"parameters": parameters - joint @ fitted["parameters"]}
    return explained | unexplained | {"discrepancy": discrepancy - joint @ fitted["discrepancy"]}


def _shares(complete: FloatArray, parts: Mapping[str, FloatArray], noise_sd: float) -> Shares:
    """Return the shares of the variance of draws (N, s) that are due to their parts."""
    centred = complete - complete.mean(axis=0)
    total = (centred**2).sum(axis=0) / (len(complete) - 1) + noise_sd**2
    unknown = np.full(len(total), np.nan)
    with np.errstate(invalid="ignore", divide="ignore"):
        due_to = {
            name: (centred * parts[name]).sum(axis=0) / (len(complete) - 1) / total if name in parts else unknown
            for name in SOURCES
        }
        base, remainder = (values - values.mean(axis=0) for values in (parts["Q0"], parts["rest"]))
        correlation = (base * remainder).sum(axis=0) / np.sqrt((base**2).sum(axis=0) * (remainder**2).sum(axis=0))
        return Shares(noise=noise_sd**2 / total, correlation=correlation, **due_to)


def standard_errors(
    statistics: Callable[..., Mapping[str, FloatArray]], *draws: FloatArray, seed: int = 0
) -> dict[str, FloatArray]:
    """Return the bootstrap's standard errors of statistics of draws (N, s), of which all arrays are resampled alike.

    Each column has statistics of its own. Draws of a quasi-random sequence have smaller errors than that.
    """
    count, columns = draws[0].shape
    rows = np.random.default_rng(seed).integers(count, size=(BOOTSTRAP_RESAMPLES, count))
    resampled = (values[rows.T].reshape(count, BOOTSTRAP_RESAMPLES * columns) for values in draws)
    replicates = statistics(*resampled)
    return {
        name: np.std(values.reshape(BOOTSTRAP_RESAMPLES, columns), axis=0, ddof=1)
        for name, values in replicates.items()
    }


PARTS_OF_CORRECTION = 4
"""The correction for the mesh in standard deviations of its error."""
BAND = ("mean", "sd", "low", "high")
SOURCES = ("parameters", "discrepancy", "extrapolation", "test_scale")
"""What the variance of draws may be due to."""
SHARES = (*SOURCES, "noise", "correlation")
ALWAYS = (*BAND, "parameters", "discrepancy", "noise", "correlation")


def force_table(
    travel: FloatArray,
    complete: FloatArray,
    material_only: FloatArray,
    without: FloatArray | None,
    noise_sd: float,
    travel_name: str = "travel_mm",
    sources: Mapping[str, FloatArray] | None = None,
) -> pd.DataFrame:
    """Return band and shares of the variance at every step, each with its standard error (``_error``).

    Parameters
    ----------
    travel : (s,) array, mm
    complete, material_only : (N, s) arrays, N
        Draws, and the same draws without discrepancy; not a number where a draw did not get that far.
    without : (M, s) array, N, or None
        Draws of a fit without discrepancy.
    noise_sd : float
        Standard deviation of a new measurement of the force, N.
    travel_name : str
        Name of its column.
    sources : mapping of str to (N, k) array
        What else the draws differ by, as in `Ensemble.sources`.

    Returns
    -------
    pandas.DataFrame
        The travel; draws that got there; mean, sd, low and high (N); the shares of the variance of a new measurement;
        the sd of what the discrepancy adds (``discrepancy_sd``); and the band of the draws alone and of the fit without
        discrepancy, with the prefixes ``alone_`` and ``without_``.
    """
    import pandas as pd

    rows = []
    for step, travel_at_step in enumerate(travel):
        row: dict[str, Any] = {travel_name: float(travel_at_step)}
        is_reached = np.isfinite(complete[:, step]) & np.isfinite(material_only[:, step])
        row["draws"] = int(is_reached.sum())
        if row["draws"] > 1:
            reached = {name: columns[is_reached] for name, columns in (sources or {}).items()}
            row |= _with_errors(complete[is_reached, step], material_only[is_reached, step], noise_sd, reached)
            row["discrepancy_sd"] = float((complete - material_only)[is_reached, step].std(ddof=1))
        for name, values in (("alone", material_only[is_reached, step]), ("without", _reached(without, step))):
            if len(values) > 1:
                row |= {f"{name}_{key}": float(getattr(band_of(values[:, None]), key)[0]) for key in BAND}
        rows.append(row)
    return pd.DataFrame(rows)


def mesh_factor(abscissa: FloatArray, changes: Sequence[tuple[float, float]], finer: float) -> FloatArray:
    """Return what a quantity is to be multiplied by at travels or times (s,) for cells without size (Richardson).

    Parameters
    ----------
    abscissa : (s,) array
    changes : sequence of (float, float)
        Travels or times, rising, and the relative changes of the quantity on a finer mesh there.
    finer : float
        What the error is divided by on that: the ratio of the sizes of cells, to the power of the order of convergence.

    Examples
    --------
    >>> mesh_factor(np.array([0.5, 1.0]), [(0.5, -0.01), (1.0, -0.02)], 2.0).tolist()
    [0.98, 0.96]
    """
    if not changes:
        return np.ones(len(abscissa))
    return np.asarray(1 + finer / (finer - 1) * np.interp(abscissa, *np.transpose(changes)))


def mesh_free(table: pd.DataFrame, factor: FloatArray) -> pd.DataFrame:
    """Return a table with the band for cells without size, too, and with the share of the variance that the mesh has.

    A quarter of the correction is taken as the standard deviation of its error, the same for all draws and independent
    of them: its variance is the part of the ``mesh``, beside which the other shares become less.

    Parameters
    ----------
    table : pandas.DataFrame
        Of `force_table`.
    factor : (s,) array
        Of `mesh_factor`.
    """
    table, spread = table.copy(), table["mean"].abs() * np.abs(factor - 1) / PARTS_OF_CORRECTION
    middle = table["mean"] * factor
    table["mesh_free_mean"], table["mesh_free_sd"] = middle, np.hypot(table["sd"] * factor, spread)
    for end in ("low", "high"):
        distance = np.hypot((table[end] - table["mean"]) * factor, 2 * spread)
        table[f"mesh_free_{end}"] = middle + (distance if end == "high" else -distance)
    on_mesh = table["sd"] ** 2 / (1 - table["noise"])
    noise = on_mesh * table["noise"]
    total = table["mesh_free_sd"] ** 2 + noise
    for name in (*SOURCES, "noise"):
        for column in {name, f"{name}_error"} & {*table}:
            table[column] *= on_mesh / total * (1.0 if name == "noise" else factor**2)
    table["mesh"] = spread**2 / total
    varying = (1 - table["mesh"]) * table["sd_error"] / table["sd"]
    table["mesh_error"] = 2 * table["mesh"] * np.hypot(table["mean_error"] / table["mean"], varying)
    return table


def _reached(values: FloatArray | None, step: int) -> FloatArray:
    return np.zeros(0) if values is None else values[np.isfinite(values[:, step]), step]


def _with_errors(
    complete: FloatArray, material_only: FloatArray, noise_sd: float, sources: Mapping[str, FloatArray]
) -> dict[str, float]:
    draws = complete[:, None]
    parts = parts_of(draws, material_only[:, None], sources)

    def statistics(complete: FloatArray, *values: FloatArray) -> dict[str, FloatArray]:
        band, shares = band_of(complete), _shares(complete, dict(zip(parts, values, strict=True)), noise_sd)
        columns = {name: getattr(band, name) for name in BAND} | {name: getattr(shares, name) for name in SHARES}
        return {name: values for name, values in columns.items() if name in ALWAYS or name in parts}

    estimates, errors = statistics(draws, *parts.values()), standard_errors(statistics, draws, *parts.values())
    return {name: float(estimates[name][0]) for name in estimates} | {
        f"{name}_error": float(errors[name][0]) for name in errors
    }
