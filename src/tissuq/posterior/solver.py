"""How models are solved: which enumerator, what is estimated before and plugged in, and what is left out after."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

from tissuq.assessment.stable_posterior import stable_part
from tissuq.errors import ConvergenceError, ModelError
from tissuq.inference.enumerators.adapted_points import AdaptedPoints
from tissuq.inference.enumerators.adaptive_cells import AdaptiveCells
from tissuq.inference.enumerators.amplitude_lattice import AmplitudeLattice
from tissuq.inference.enumerators.line import FINE, OF_SUM, ROUGH, Accuracy
from tissuq.inference.enumerators.nodes import Guide
from tissuq.inference.enumerators.noise_grid import NoiseGrid
from tissuq.inference.reduction import RememberedBases
from tissuq.inference.solution import Enumerator, Solution
from tissuq.inference.threads import one_thread
from tissuq.model.statistical_model import StatisticalModel
from tissuq.posterior.plug_in import ErrorEstimates

Method = Literal["auto", "exact", "nuts", "smc", "joint"]
MAX_COMPONENTS_OF_VALUE = 1000
"""Components that represent the posterior at one value of the noise, where it is summed over several."""
FACTORISED = 3
"""Parameters from which cells would take minutes, as each of them costs a factorisation to vary."""
METHODS: tuple[Method, ...] = ("auto", "exact", "nuts", "smc", "joint")


@dataclass(frozen=True)
class Solver:
    """What gives the posterior of a model: the same for every model, and enough to solve another one likewise.

    Parameters
    ----------
    method : str
        As of `tissuq.fit`.
    stable_in : tuple of str
        Loading modes in which what is not stable is left out.
    seed : int
        Of the draws.
    accuracy : Accuracy
        Of importance points.
    """

    method: Method = "auto"
    stable_in: tuple[str, ...] = ()
    seed: int = 0
    accuracy: Accuracy = FINE

    @property
    def for_checks(self) -> Solver:
        """The same solver for models near one that it solved without sampling: fewer points, and no sampling."""
        return replace(self, method="exact", accuracy=ROUGH)

    def solve(self, models: Sequence[StatisticalModel]) -> list[Solution]:
        """Return the posteriors of models on the same stretches."""
        with one_thread():
            solutions = self._solve([self._error_estimates().of(model) for model in models])
            if self.stable_in:
                solutions = [stable_part(solution, self.stable_in, self.seed) for solution in solutions]
            return list(solutions)

    def with_spreads_of_tests(self, model: StatisticalModel) -> StatisticalModel:
        """Return a model whose spreads between specimens and tests are as large as several tests tell."""
        with one_thread():
            return self._error_estimates().with_spreads_of_tests(model)

    def with_probable_noise(self, model: StatisticalModel) -> StatisticalModel:
        """Return a model whose unknown noise is autoregressive where the data are far more probable so."""
        with one_thread():
            return self._error_estimates().with_probable_noise(model)

    def _error_estimates(self) -> ErrorEstimates:
        for_estimates, similar_solver = replace(self, accuracy=OF_SUM), partial(self._known_solver, ROUGH)
        return ErrorEstimates(
            lambda model: for_estimates._solve([model])[0], self._is_integrated, self._sums_noise, similar_solver
        )

    def _is_integrated(self, model: StatisticalModel) -> bool:
        """Return whether there is an evidence without sampling."""
        is_summed = bool(model.energy_symbols) or not AdaptedPoints.why_not(model)
        return self.method in ("auto", "exact") and is_summed

    def _sums_noise(self, model: StatisticalModel) -> bool:
        """Return whether a model is solved as a sum over values of its noise."""
        return self._is_integrated(model) and not NoiseGrid.why_not(model)

    def _solve(self, models: Sequence[StatisticalModel], enumerators: Sequence[Enumerator] = ()) -> Sequence[Solution]:
        """Solve models on the same stretches: together by the first enumerator that serves, or else each by itself.

        That is the first of those given, or of those for the method; where none serves it is NUTS for a single model.
        """
        errors = list[ConvergenceError]()
        for enumerator in enumerators or self._enumerators(models[0]):
            try:
                return enumerator.solve(models, self.seed)
            except ConvergenceError as error:
                errors.append(error)
                if len(models) > 1:
                    break
        if self.method != "auto" or models[0].energy_symbols:
            raise errors[0]
        if len(models) > 1:
            return [solution for model in models for solution in self._solve([model])]
        return _sampler("nuts", str(errors[0])).solve(models, self.seed)

    def _known_solver(self, accuracy: Accuracy) -> Callable[[StatisticalModel], Solution]:
        """Return what solves models with known noise, similar ones that are summed."""
        lattice, points = AmplitudeLattice(MAX_COMPONENTS_OF_VALUE, Guide(accuracy)), AdaptedPoints(accuracy)
        # The first value of the noise is the least, where a ridge is thinnest: there it is seen whether any was missed.
        cells = AdaptiveCells(accuracy == OF_SUM, accuracy.tolerance, bases=RememberedBases())

        def solve_known(model: StatisticalModel) -> Solution:
            if model.energy_symbols:
                return lattice.solve([model], self.seed)[0]
            return self._solve([model], [cells, points] if _suits_cells(model) else [points])[0]

        return solve_known

    def _enumerators(self, model: StatisticalModel) -> list[Enumerator]:
        """Return what may enumerate the nonlinear parameters of a model by the method that was chosen, the best first.

        Raises
        ------
        ModelError
            When it does not serve this model.
        """
        if self._sums_noise(model):
            return [NoiseGrid(self._known_solver)]
        if self.method not in ("auto", "exact"):
            sampler = _sampler(self.method)
            if reason := sampler.why_not(model):
                raise ModelError(f"the method '{self.method}' does not apply: {reason}.")
            return [sampler]
        if model.energy_symbols:
            return [AmplitudeLattice(guide=Guide(FINE if self.accuracy == FINE else OF_SUM))]
        if refusal := AdaptedPoints.why_not(model):
            return [_sampler("nuts", refusal) if self.method == "auto" else AdaptiveCells()]
        points = [AdaptedPoints(self.accuracy)] if model.nonlinear else []
        return [AdaptiveCells(), *points] if _suits_cells(model) else [*points]


def _sampler(method: Method, refusal: str = "") -> Enumerator:
    """Return a sampler, which needs JAX; ``refusal`` says why another enumerator was not taken."""
    from tissuq.inference.enumerators.sampled import JointNuts, Nuts, TemperedSmc

    return {"nuts": Nuts(refusal), "smc": TemperedSmc(), "joint": JointNuts()}[method]


def _suits_cells(model: StatisticalModel) -> bool:
    """Return whether cells serve a model without energies: few nonlinear parameters, which cost little to vary."""
    return len(model.structure) < FACTORISED and not AdaptiveCells().why_not(model)
