"""The main calls: from experiments to the posterior of a material's parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from numbers import Integral
from typing import Literal

import numpy as np

from tissuq.assessment.stable_posterior import StableSolution, modes_named
from tissuq.discrepancy import Discrepancy, discrepancy_named
from tissuq.errors import ConvergenceError, InputError, ModelError
from tissuq.experiments.experiment import Experiment
from tissuq.inference.energies import solve_energies
from tissuq.inference.exact import solve_exactly, why_not_exact
from tissuq.inference.solution import Solution
from tissuq.mechanics import Material, material_named
from tissuq.mechanics.joint import joined
from tissuq.model import StatisticalModel
from tissuq.noise import Noise, noise_named
from tissuq.posterior import Posterior
from tissuq.prediction.moments import level_of_errors, mean_curve
from tissuq.priors import Prior
from tissuq.tolerances import BETWEEN_SPECIMENS, Tolerances, specimens_of

__all__ = ["METHODS", "Method", "fit", "fit_many"]

Method = Literal["auto", "exact", "nuts", "smc", "joint"]
FACTORISED = 3
"""Parameters of the structure from which `auto` samples."""
ENOUGH, SPREADS = 4, (0.125, 0.25, 0.5, 1.0, 2.0, 4.0)
"""Specimens that tell how far they are apart, and the values that are tried, over the usual one."""
ROUNDS = 3
"""In which the curve is found along which whole tests err."""
LAGS = (0.0, 0.2, 0.4, 0.6, 0.75, 0.85, 0.92, 0.96, 0.98, 0.99)
"""Correlations of consecutive errors that are tried."""
METHODS: tuple[Method, ...] = ("auto", "exact", "nuts", "smc", "joint")


def fit(
    data: Experiment | Sequence[Experiment],
    *,
    discrepancy: str | Discrepancy = "auto",
    material: str | Material = "neo-hookean",
    noise_sd: float | Sequence[float] | Literal["unknown"] | None = None,
    noise: str | Noise | None = None,
    priors: Mapping[str, Prior] | None = None,
    tolerances: Tolerances | None = None,
    method: Method = "auto",
    stable_in: str | Sequence[str] = (),
    seed: int = 0,
) -> Posterior:
    """Identify the parameters of a material from an experiment, with a model discrepancy and noise.

    Parameters
    ----------
    data : Experiment or sequence of Experiment
        The measurements: of one test, or of several in any modes, which share one material. A discrepancy that is an
        energy acts in all of them; one in stress is another in each test, of the same size.
    discrepancy : str or Discrepancy
        What the material cannot explain, by name (``tissuq discrepancies`` lists them) or as an object; ``"auto"`` is
        an average of strain energies that leave the initial shear modulus alone, by the evidence.
    material : str or Material
        The material whose parameters are wanted.
    noise_sd : float or "unknown"
        Standard deviation of the measurement noise in MPa; unknown, as when nothing is said, makes it a parameter. For
        several tests a sequence of numbers, one for each, is taken, too; where it is unknown, its ratios between the
        tests are those of their scatter about smooth curves, and noise_sd is its geometric mean.
    noise : str or Noise
        Another kind of noise instead: ``"proportional"`` (sd = noise_sd + noise_share |stress|), ``"repeats"`` (told
        by repeated measurements at the same stretch), or ``"autoregressive"`` (errors of consecutive measurements
        correlated).
    priors : mapping of str to Prior
        Priors in MPa (psi in stretch) that replace the defaults, by parameter.
    tolerances : Tolerances
        By how much whole tests may be off, such as ``Tolerances(stress=0.1, length=0.02)``; by default tests of
        different specimens agree to 18 % in stress (four or more tell by themselves how far they are apart), and a
        single test has no such errors.
    method : str
        ``"exact"``: closed form and quadrature over at most three nonlinear parameters.
        ``"nuts"``: the linear parameters in closed form, the no-U-turn sampler over the others.
        ``"smc"``: the same with tempered sequential Monte Carlo, which gives the evidence, too.
        ``"joint"``: the no-U-turn sampler over all parameters, nothing integrated, as in the paper.
        ``"auto"``: exact where it applies and reaches its tolerance; else nuts, with the evidence from smc.
        The posterior's ``solution.route`` and ``solution.reason`` say what was done and why.
    stable_in : str or sequence of str
        Loading modes, or ``"all"``, in which material and energy discrepancy must be stable over the range that was
        measured: the prior leaves out what is not, and the posterior is known by those of its draws that are.
    seed : int
        Of the draws.

    Raises
    ------
    InputError
        When data, noise or priors cannot be used.
    ModelError
        When the parts do not fit each other, or the method does not apply, or hardly any of the posterior is stable
        where that is asked for.
    ConvergenceError
        When the method was asked for by name and cannot reach its tolerance.

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
    return fit_many(
        [data],
        discrepancy=discrepancy,
        material=material,
        noise_sd=noise_sd,
        noise=noise,
        priors=priors,
        tolerances=tolerances,
        method=method,
        stable_in=stable_in,
        seed=seed,
    )[0]


def fit_many(
    datasets: Sequence[Experiment | Sequence[Experiment]],
    *,
    discrepancy: str | Discrepancy = "auto",
    material: str | Material = "neo-hookean",
    noise_sd: float | Sequence[float] | Literal["unknown"] | None = None,
    noise: str | Noise | None = None,
    priors: Mapping[str, Prior] | None = None,
    tolerances: Tolerances | None = None,
    method: Method = "auto",
    stable_in: str | Sequence[str] = (),
    seed: int = 0,
) -> list[Posterior]:
    """Fit many experiments with the same model, each by itself; the parameters are those of `fit`.

    Experiments on the same stretches in the same loading mode (replicates, specimens, synthetic data) share all
    factorisations and are integrated together, which takes a small part of the time of as many calls of `fit` and gives
    the same posteriors to the accuracy of the integration.

    Parameters
    ----------
    datasets : sequence of Experiment, or of sequences of them
        Several tests that belong together count as one data set.

    Returns
    -------
    list of Posterior
        In the order of the experiments.

    Examples
    --------
    >>> import tissuq as tq
    >>> stretch = [0.7, 0.8, 0.9, 1.1, 1.2, 1.3, 1.4]
    >>> specimens = [tq.simulate("neo-hookean", {"C10": 0.5}, stretch, noise_sd=0.05, seed=s) for s in range(20)]
    >>> posteriors = tq.fit_many(specimens, discrepancy="none", noise_sd=0.05)
    >>> held = [0.5 > p.summary().loc["C10", "hdi_low"] for p in posteriors]
    >>> len(held)
    20
    """
    if tolerances is not None and not isinstance(tolerances, Tolerances):
        raise InputError(f"tolerances must be such as tissuq.Tolerances(stress=0.1), not {tolerances!r}.")
    if method not in METHODS:
        raise InputError(f"there is no method '{method}'. Choose one of: {', '.join(METHODS)}.")
    if not isinstance(seed, Integral) or seed < 0:
        raise InputError(f"seed must be a whole number, zero or more, not {seed!r}.")
    if noise_sd is not None and noise is not None:
        raise InputError(f"give noise_sd or noise, not both (noise_sd is {noise_sd!r}, noise is {noise!r}).")
    chosen = noise_named(noise if noise is not None else "unknown" if noise_sd is None else noise_sd)
    parts = discrepancy_named(discrepancy), material_named(material), chosen
    recipe = _Recipe(*parts, dict(priors or {}), tolerances, method, modes_named(stable_in), seed)
    every = [joined(data) for data in datasets]
    is_shared = [len(data.parts) == 1 and not tolerances and not chosen.is_consecutive for data in every]
    keys = [
        (data.mode.name, data.stretch.tobytes(), 0 if shared else place)
        for place, (data, shared) in enumerate(zip(every, is_shared, strict=True))
    ]
    found: dict[int, Posterior] = {}
    for _, group in groupby(sorted(range(len(keys)), key=keys.__getitem__), key=keys.__getitem__):
        places = list(group)
        found |= zip(places, recipe.posteriors([every[place] for place in places]), strict=True)
    return [found[place] for place in range(len(datasets))]


@dataclass(frozen=True, eq=False)
class _Recipe:
    """What is fitted and how: everything but the data."""

    discrepancy: Discrepancy
    material: Material
    noise: Noise
    priors: Mapping[str, Prior]
    tolerances: Tolerances | None
    method: Method
    stable_in: tuple[str, ...]
    seed: int

    def posteriors(self, datasets: Sequence[Experiment]) -> list[Posterior]:
        """Fit experiments on the same stretches."""
        return self.solved([self._model(data) for data in datasets])

    def _model(self, data: Experiment) -> StatisticalModel:
        chosen = Tolerances() if self.tolerances is None else self.tolerances
        model = StatisticalModel(data, self.material, self.discrepancy, self.noise, self.priors, chosen)
        return model if self.tolerances is not None else self._with_spread(model)

    def solved(self, models: Sequence[StatisticalModel]) -> list[Posterior]:
        """Return the posteriors of models on the same stretches."""
        ready = [self._prepared(model) for model in models]
        solutions = self._solve(ready)
        if self.stable_in:
            solutions = [StableSolution(solution, self.stable_in, self.seed) for solution in solutions]
        return [Posterior(solution, self.seed, self.solved) for solution in solutions]

    def _prepared(self, model: StatisticalModel) -> StatisticalModel:
        """Return a model with all that is found before it is solved: curve and level of its errors, and their lag."""
        before = self._with_curve(model)
        after = self._with_lag(before)
        return after if after is before or not model.tolerances else self._with_curve(replace(after, curve=None))

    def _with_spread(self, model: StatisticalModel) -> StatisticalModel:
        """Return a model with the usual tolerances; where there are specimens enough, their spread as the data tell it.

        Where there is an evidence to tell it: the root of its posterior mean square over some values, under a
        half-Cauchy prior of the usual spread, which is what the error in common needs of it. A plug-in, like the curve
        along which tests err.
        """
        usual = _usual_tolerances(model)
        if not usual:
            return model
        model = replace(model, tolerances=usual)
        if specimens_of(model.experiment).shape[1] < ENOUGH or not self._is_integrated(model):
            return model
        model = self._with_curve(model)
        spread = usual.stress * np.array(SPREADS)
        tried = [replace(model, tolerances=replace(usual, stress=float(each))) for each in spread]
        found = [self._solve([each])[0].log_evidence for each in tried]
        if any(each is None for each in found):
            return model
        evidence = np.array(found, dtype=np.float64)
        weight = np.exp(evidence - evidence.max()) / (1 + np.array(SPREADS) ** 2) * spread  # even in the logarithm
        told = float(np.sqrt(weight @ spread**2 / weight.sum()))
        return self._with_curve(replace(model, tolerances=replace(usual, stress=told), curve=None, level=None))

    def _is_integrated(self, model: StatisticalModel) -> bool:
        """Return whether there is an evidence without sampling."""
        return self.method in ("auto", "exact") and (bool(model.energy_symbols) or not why_not_exact(model))

    def _with_lag(self, model: StatisticalModel) -> StatisticalModel:
        """Return a model with consecutive noise at the lag under which the data are most probable."""
        if not model.noise.is_consecutive or model.lag is not None:
            return model
        tried = [replace(model, lag=lag) for lag in LAGS]
        evidence = [self._evidence(each) for each in tried]
        best = int(np.argmax(evidence))
        if best in (0, len(LAGS) - 1):
            return tried[best]
        # A parabola through the best three, in the lag's inverse hyperbolic tangent.
        at, around = np.arctanh(LAGS[best - 1 : best + 2]), np.array(evidence[best - 1 : best + 2])
        second, first, _ = np.polyfit(at, around, 2)
        return replace(model, lag=float(np.tanh(-first / (2 * second))))

    def _evidence(self, model: StatisticalModel) -> float:
        found = self._solve([model])[0].log_evidence
        if found is None:
            raise ModelError(
                f"noise '{model.noise}' needs the evidence, which this fit does not have: choose proper priors, and a "
                "discrepancy and a method that give it, such as 'auto'."
            )
        return found

    def _with_curve(self, model: StatisticalModel) -> StatisticalModel:
        """Return a model with tolerances along its own mean curve, and at its own level of errors.

        As they are found first as if there were no tolerances, and then with these.
        """
        if not model.tolerances or model.curve is not None:
            return model
        pilot = replace(model, tolerances=Tolerances())
        for _ in range(ROUNDS):
            found = self._solve([pilot])[0]
            pilot = replace(model, curve=mean_curve(found), level=level_of_errors(found))
        return pilot

    def _solve(self, models: Sequence[StatisticalModel]) -> Sequence[Solution]:
        """Solve models on the same stretches: together by the exact route, one by one by the others."""
        if models[0].energy_symbols:
            if self.method not in ("auto", "exact"):
                raise ModelError(
                    f"the method '{self.method}' does not apply: discrepancy '{self.discrepancy.name}' is integrated "
                    "exactly. Use 'auto' or 'exact'."
                )
            return solve_energies(models, self.seed)
        if self.method != "auto":
            return solve_exactly(models, self.seed) if self.method == "exact" else [self._sample(m) for m in models]
        refusal = why_not_exact(models[0]) or _why_not_soon(models[0])
        if not refusal:
            try:
                return solve_exactly(models, self.seed)
            except ConvergenceError as error:
                refusal = str(error)
        if len(models) > 1:
            return [solution for model in models for solution in self._solve([model])]
        return [self._sample(models[0], refusal)]

    def _sample(self, model: StatisticalModel, refusal: str = "") -> Solution:
        from tissuq.inference import sampled

        if self.method == "joint":
            return sampled.sample_joint(model, self.seed)
        if not model.nonlinear and self.method in ("nuts", "smc"):
            raise ModelError(
                f"the method '{self.method}' does not apply: every parameter is linear with a flat, uniform or "
                "Gaussian prior, so nothing is left to sample. Use 'exact', or 'joint' to sample all of them."
            )
        if self.method == "smc":
            return sampled.sample_smc_given(model, self.seed)
        return sampled.sample_nuts_given(model, self.seed, refusal)


def _usual_tolerances(model: StatisticalModel) -> Tolerances:
    """Return the tolerances where nothing is said: none within a specimen, or where something else takes them up."""
    is_plain = not (model.is_correlated or model.noise.depends_on_level or model.noise.shares_discrepancy)
    return BETWEEN_SPECIMENS if specimens_of(model.experiment).shape[1] > 1 and is_plain else Tolerances()


def _why_not_soon(model: StatisticalModel) -> str:
    """Return why the exact route, which applies, would take minutes; or nothing."""
    if len(model.structure) < FACTORISED:
        return ""
    return f"each of {', '.join(model.structure)} costs a factorisation to vary, which would take minutes"
