"""The main call: from an experiment to the posterior of a material's parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from numbers import Integral
from typing import Literal

from tissuq.discrepancy import Discrepancy, discrepancy_named
from tissuq.errors import ConvergenceError, InputError
from tissuq.experiments.experiment import Experiment
from tissuq.inference.exact import is_exact, solve_exactly
from tissuq.inference.solution import Solution
from tissuq.mechanics import Material, material_named
from tissuq.model import StatisticalModel
from tissuq.posterior import Posterior
from tissuq.priors import Prior

__all__ = ["SAMPLERS", "fit"]

Sampler = Literal["auto", "exact", "nuts"]
SAMPLERS: tuple[Sampler, ...] = ("auto", "exact", "nuts")


def fit(
    data: Experiment,
    *,
    discrepancy: str | Discrepancy,
    material: str | Material = "neo-hookean",
    noise_sd: float | Literal["unknown"] = "unknown",
    priors: Mapping[str, Prior] | None = None,
    sampler: Sampler = "auto",
    seed: int = 0,
) -> Posterior:
    """Identify the parameters of a material from an experiment, with a model discrepancy and noise.

    Parameters
    ----------
    data : Experiment
        The measurements.
    discrepancy : str or Discrepancy
        What the material cannot explain, by name (``tissuq discrepancies`` lists them) or as an object.
    material : str or Material
        The material whose parameters are wanted.
    noise_sd : float or "unknown"
        Standard deviation of the measurement noise in MPa; unknown makes it a parameter.
    priors : mapping of str to Prior
        Priors in MPa (psi in stretch) that replace the defaults, by parameter.
    sampler : str
        ``"exact"`` (closed form and quadrature), ``"nuts"`` (the joint density, as in the paper), or ``"auto"``: exact
        where it applies and reaches its tolerance.
    seed : int
        Of the draws.

    Raises
    ------
    InputError
        When data, noise or priors cannot be used.
    ModelError
        When the parts do not fit each other, or the sampler does not apply.

    References
    ----------
    Zeraatpisheh, Bordas & Beex (2021), eq. 15 to 26.

    Examples
    --------
    >>> import tissuq as tq
    >>> truth = {"C10": 1.2, "C20": -0.057, "C30": 0.004}
    >>> stretch = [0.5, 0.75, 1.25, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0]
    >>> data = tq.simulate("yeoh", truth, stretch, noise_sd=0.1, seed=1)
    >>> posterior = tq.fit(data, material="neo-hookean", discrepancy="yeoh", noise_sd=0.1)
    >>> low, high = posterior.summary().loc["C10", ["hdi_low", "hdi_high"]]
    >>> bool(low < 1.2 < high)
    True
    """
    if sampler not in SAMPLERS:
        raise InputError(f"there is no sampler '{sampler}'. Choose one of: {', '.join(SAMPLERS)}.")
    if not isinstance(seed, Integral) or seed < 0:
        raise InputError(f"seed must be a whole number, zero or more, not {seed!r}.")
    model = StatisticalModel(
        data, material_named(material), discrepancy_named(discrepancy), noise_sd, dict(priors or {})
    )
    solution = _solve(model, sampler, seed)
    return Posterior(replace(solution, warnings=tuple(_warnings(solution))), seed)


def _solve(model: StatisticalModel, sampler: Sampler, seed: int) -> Solution:
    if sampler == "exact":
        return solve_exactly(model, seed)
    if sampler == "auto" and is_exact(model):
        with suppress(ConvergenceError):
            return solve_exactly(model, seed)
    from tissuq.inference.sampled import solve_by_sampling

    return solve_by_sampling(model, seed)


def _warnings(solution: Solution) -> list[str]:
    found = []
    if solution.is_approximate and solution.diagnostics is not None:
        found.append(solution.diagnostics.verdict)
    if solution.model.confounds_noise:
        found.append(
            "noise_sd and S are both unknown, and only noise_sd^2 + S^2 is in the data: read neither alone, or give "
            "the noise (repeated measurements at one stretch tell it)."
        )
    cut = [f"{symbol} ({end})" for symbol, end in _cut_by_prior(solution)]
    if cut:
        found.append(
            f"the posterior is cut by a bound of the prior of {', '.join(cut)}: there the bound, not the data, "
            "decides. Give a wider prior, unless the bound is meant."
        )
    return found


def _cut_by_prior(solution: Solution) -> Iterator[tuple[str, str]]:
    """Yield the parameters whose posterior is still high at a bound that only the prior sets, and which bound."""
    for parameter in solution.model.parameters:
        marginal = solution.marginals[parameter.symbol]
        ends = zip(("lower", "upper"), solution.model.priors[parameter.symbol].support, parameter.support, strict=True)
        for name, chosen, natural in ends:
            inside = chosen + (1e-3 if name == "lower" else -1e-3) * marginal.sd
            if chosen != natural and marginal.pdf(inside) > 0.1 * marginal.density.max():
                yield parameter.symbol, name
