"""Which test to make next: candidates by how much they are expected to lower the uncertainty of some targets."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from tissuq.assessment.candidates import Candidate, farthest_range, reach_of
from tissuq.assessment.expected_variance import GaussianMixture, expected_variances
from tissuq.assessment.targets import Target
from tissuq.errors import InputError, ModelError
from tissuq.experiments.experiment import Experiment
from tissuq.inference.resampling import systematic
from tissuq.inference.solution import Components, Solution
from tissuq.model import StatisticalModel
from tissuq.prediction.joint_moments import joint_stresses, points_together
from tissuq.tolerances import BETWEEN_SPECIMENS, Tolerances, specimens_of

__all__ = ["FARTHEST", "Expected", "NextTest", "Specimen"]

FloatArray = NDArray[np.float64]
Column = tuple[FloatArray, FloatArray]

Specimen = Literal["same", "other"]
"""Of which specimen a test to come is: the one of the data, or another one."""
BATCHES, COMPONENTS, OUTCOMES = 8, 400, 7
"""Independent batches, whose spread tells the error; components of each, and the power of two of its outcomes."""
FEW = 10.0
"""Effective number of components after the test below which what is expected is rough."""
FARTHEST = 2.0
"""Times as far as the data, in I1 - 3 and I2 - 3, beyond which an energy discrepancy has no size to reckon with."""
MOST_POINTS = 400
"""Measurements from which fewer of them, with as much less noise, stand for all."""


@dataclass(frozen=True, eq=False)
class Expected:
    """What is expected of one candidate: standard deviations (t,) of the targets now and after the test.

    ``after`` is the root of the expected variance, ``error`` the standard error of ``after / now`` by simulation, zero
    where all is in closed form. ``is_rough`` tells that few components of the posterior would be left.
    """

    now: FloatArray
    after: FloatArray
    error: FloatArray
    is_rough: bool

    @property
    def reduction(self) -> FloatArray:
        """By what share the standard deviations fall."""
        return 1 - self.after / self.now


class NextTest:
    """The question which test is to be made next, for one posterior.

    Tests of the same specimen have the errors of single measurements that the model has: in the mode of the data they
    are further measurements of the same test (`Posterior.update`), in another mode a test without errors of its own. A
    test of another specimen has errors of area, length and zero of its own, as `Tolerances` of the model say, or the
    usual ones between specimens.

    Parameters
    ----------
    solution : Solution
    targets : sequence of Target
    specimen : str, optional
        ``"same"`` or ``"other"``; that of the data unless these are of several specimens with errors of their own.
    seed : int
        Of the outcomes of tests that are drawn.

    Raises
    ------
    InputError
        When the model's errors do not say what a further test's are.
    """

    def __init__(
        self, solution: Solution, targets: Sequence[Target], specimen: Specimen | None = None, seed: int = 0
    ) -> None:
        self.model, self.targets, self._seed = solution.model, targets, seed
        self._components = solution.components
        self.specimen: Specimen = specimen or ("other" if self.model.tolerances else "same")
        _check_model(self.model, self.specimen)
        for target in targets:
            for mode, points in target.points:
                self._check_place(Candidate(mode, points), f"target '{target.name}'")

    def expected(self, candidate: Candidate) -> Expected:
        """Return what is expected of a candidate.

        Raises
        ------
        InputError, ModelError
            When the discrepancy says nothing of its mode or range, or the material may lock or does not deform so.
        """
        self._check_place(candidate, f"test '{candidate.name}'")
        ratios, effective = [], []
        for number, chosen in enumerate(self._batches):
            mixture = self._mixture(chosen, candidate)
            found = expected_variances(mixture, self._uniforms(number, mixture))
            centre = mixture.weights @ mixture.target_mean
            before, after = (
                each + self._common(self.errors_after) ** 2 * (found.before + centre**2)
                for each in (found.before, found.after)
            )
            ratios.append(after / before)
            effective.append(found.effective)
        ratio, count = np.mean(ratios, axis=0), len(ratios)
        spread = np.std(np.sqrt(ratios), axis=0, ddof=1) / np.sqrt(count) if count > 1 else np.zeros(len(ratio))
        is_rough = count > 1 and float(np.mean(effective)) < FEW
        return Expected(self.now, self.now * np.sqrt(ratio), spread, is_rough)

    @cached_property
    def now(self) -> FloatArray:
        """The standard deviations (t,) of the targets before any further test."""
        mean, root = self._targets(self._components, *self._stresses(self._components, []))
        nothing = np.zeros((len(mean), 0))
        parts = nothing, nothing[:, :, None], nothing
        mixture = GaussianMixture(self._components.weights / self._components.weights.sum(), *parts, mean, root)
        centre, variance = mixture.weights @ mean, mixture.variance
        return np.sqrt(variance + self._common(self.errors_now) ** 2 * (variance + centre**2))

    @property
    def tolerances(self) -> Tolerances:
        """By how much a test of another specimen may be off."""
        return self.model.tolerances if self.model.tolerances.stress else BETWEEN_SPECIMENS

    @property
    def errors_now(self) -> float:
        """The relative standard deviation of the error that all stresses have in common."""
        if self.specimen == "same":
            return self.model.common_error
        return self.tolerances.in_common(self.model.experiment)

    @property
    def errors_after(self) -> float:
        """The same after a further test."""
        return self.errors_now if self.specimen == "same" else self.tolerances.stress / np.sqrt(self._specimens + 1)

    @property
    def _specimens(self) -> int:
        return int(specimens_of(self.model.experiment).shape[1])

    def _common(self, error: float) -> FloatArray:
        """Return the error (t,) of each target that all stresses have in common."""
        return error * np.array([target.is_stiffness(self.model) for target in self.targets])

    @cached_property
    def _batches(self) -> list[Components]:
        """Components that stand for the posterior, anew in every batch where there are many."""
        parts, count = self._components, len(self._components.weights)
        if count == 1:
            return [parts]
        if count <= COMPONENTS:
            return [parts.weighted(parts.weights / parts.weights.sum())] * BATCHES
        offsets = (np.arange(BATCHES) + 0.5) / BATCHES
        chosen = [systematic(parts.weights[None], COMPONENTS, offset)[0] for offset in offsets]
        return [parts[own].weighted(np.full(COMPONENTS, 1 / COMPONENTS)) for own in chosen]

    def _uniforms(self, number: int, mixture: GaussianMixture) -> FloatArray:
        """Return points of the unit cube, the same for all candidates as far as these are alike."""
        from scipy.stats import qmc

        size = 1 + mixture.root.shape[2] + mixture.mean.shape[1]
        engine = qmc.Sobol(size, rng=np.random.default_rng([self._seed, 23, number]))
        return np.asarray(engine.random_base2(OUTCOMES))

    def _stresses(self, parts: Components, tests: list[tuple[Candidate, FloatArray]]) -> Column:
        """Return means and roots of the stresses of tests at points of them, and of the targets that are stresses."""
        every = [(test.mode, points) for test, points in tests]
        every += [own for target in self.targets for own in target.points]
        if not every:
            return np.zeros((len(parts.weights), 0)), np.zeros((len(parts.weights), 0, parts.root.shape[2]))
        return joint_stresses(self.model, parts, *points_together(self.model, every))

    def _targets(self, parts: Components, mean: FloatArray, root: FloatArray) -> Column:
        """Return means (M, t) and roots (M, t, r) of the targets; stresses among them are the last ones given."""
        width, found = root.shape[2], []
        scatter = _scatter(self.model, parts)
        place = mean.shape[1] - sum(1 for target in self.targets for _ in target.points)
        for target in self.targets:
            own_root, own = np.zeros((len(mean), width + 1)), np.zeros(len(mean))
            if any(True for _ in target.points):
                own, own_root[:, :width], own_root[:, width] = mean[:, place], root[:, place], scatter
                place += 1
            else:
                own, linear = target.moments(self.model, parts)
                own_root[:, : linear.shape[1]] = linear
            found.append((own, own_root))
        return np.stack([mean for mean, _ in found], axis=1), np.stack([root for _, root in found], axis=1)

    def _mixture(self, parts: Components, candidate: Candidate) -> GaussianMixture:
        """Return the candidate's measurements and the targets as one Gaussian in every component."""
        points, share = _few(candidate.stretch)
        mean, root = self._stresses(parts, [(candidate, points)])
        count = len(points) * len(candidate.mode.stresses)
        target_mean, target_root = self._targets(parts, mean, root)
        mean, root = mean[:, :count], np.concatenate([root[:, :count], np.zeros((*mean[:, :count].shape, 1))], axis=2)
        curve = parts.weights @ mean / parts.weights.sum()
        noise_sd = self._noise(parts, candidate, points, curve)
        if self.specimen == "other":
            kinds = len(candidate.mode.stresses)
            stress = curve if kinds == 1 else curve.reshape(kinds, -1).T
            test = Experiment(candidate.mode, points, stress)
            columns = list(self._errors_of_specimen(test, curve, mean, target_mean))
            root = np.concatenate([root, *(own[:, :, None] for own, _ in columns)], axis=2)
            target_root = np.concatenate([target_root, *(own[:, :, None] for _, own in columns)], axis=2)
            noise_sd = np.hypot(noise_sd, self.tolerances.noise(test, curve))
        return GaussianMixture(parts.weights, mean, root, noise_sd * np.sqrt(share), target_mean, target_root)

    def _noise(self, parts: Components, candidate: Candidate, points: FloatArray, curve: FloatArray) -> FloatArray:
        """Return the sd (M, n) of all that is independent from measurement to measurement."""
        model = self.model
        values = {symbol: own[:, None] for symbol, own in zip(model.nonlinear, parts.settings.T, strict=True)}
        _, rows = points_together(model, [(candidate.mode, points)])
        variance = model.noise_variance(values, np.abs(curve)) * model.relative_noise(rows) ** 2
        found = variance + _scatter(model, parts)[:, None] ** 2
        return np.asarray(np.sqrt(np.broadcast_to(found, (len(parts.weights), len(curve)))))

    def _errors_of_specimen(
        self, test: Experiment, curve: FloatArray, mean: FloatArray, target_mean: FloatArray
    ) -> Iterator[Column]:
        """Yield what standard errors of a new specimen do to its stresses (M, n) and to the targets (M, t).

        With e the errors of stress of K + 1 specimens, what the data tell of is the tissue's stress times 1 + the mean
        of K. The new stress is that times 1 + d, d = e_new - mean of K, and the mean of K + 1 is that of K plus
        d / (K + 1).
        """
        sd, count = self.tolerances.stress * np.sqrt(1 + 1 / self._specimens), self._specimens + 1
        yield mean * sd, target_mean * self._common(sd / count)
        for column in self.tolerances.columns(test, curve)[:, 1:].T:
            if column.any():
                yield np.broadcast_to(column, mean.shape), np.zeros_like(target_mean)

    def _check_place(self, candidate: Candidate, what: str) -> None:
        """Refuse a test or a stress of which the posterior says nothing."""
        model, data = self.model, self.model.experiment
        for path in candidate.mode.channels:
            if problem := model.material.why_not(path.moved(candidate.stretch[:1], 0.0)):
                raise ModelError(problem)
        is_known = model.discrepancy.is_energy or not model.discrepancy.parameters
        if (not is_known or model.is_correlated) and candidate.mode not in data.modes:
            names = ", ".join(mode.name for mode in data.modes)
            raise InputError(
                f"{what}: discrepancy '{model.discrepancy.name}' is an error of the {names} stress and another, "
                f"unknown one of the {candidate.mode.name} stress: choose mode {names}, or a posterior with an energy, "
                "such as 'auto'."
            )
        reach = float(reach_of(data, candidate.mode, candidate.stretch).max())
        if model.energy_symbols and reach > FARTHEST:
            low, high = farthest_range(data, candidate.mode, FARTHEST)
            raise InputError(
                f"{what} reaches {reach:.2g} times as far as the data in I1 - 3 or I2 - 3; beyond {FARTHEST:g} times "
                "the discrepancy may be of any size, so that nothing can be expected: choose a range within "
                f"{low:g} to {high:g}."
            )


def _check_model(model: StatisticalModel, specimen: Specimen) -> None:
    """Refuse a model whose errors do not say what those of a further test are."""
    if specimen not in get_args(Specimen):
        raise InputError(f"specimen must be one of {', '.join(get_args(Specimen))}, not '{specimen}'.")
    if model.lag:
        raise InputError(
            "consecutive errors of these data are correlated, and how those of a further test are depends on how it is "
            "sampled: fit with the noise 'unknown', or with fewer points."
        )
    is_known = model.discrepancy.is_energy or not model.discrepancy.parameters
    is_plain = not (model.is_correlated or model.noise.depends_on_level or model.noise.shares_discrepancy)
    if not is_known and (specimen == "other" or len(model.experiment.curves) > 1):
        raise InputError(
            f"discrepancy '{model.discrepancy.name}' is another, unknown error of the stress in each test: only a "
            "posterior of one test can say what more of it would tell. Fit with an energy, such as 'auto'."
        )
    if specimen == "other" and not is_plain:
        raise InputError(
            f"noise '{model.noise}' and discrepancy '{model.discrepancy.name}' do not go together with errors of whole "
            "tests: fit with the noise 'unknown' and the discrepancy 'auto', or ask for a test of the same specimen."
        )
    if specimen == "same" and model.tolerances:
        raise InputError(
            "the tests of this posterior have errors of area or length that a test of the same specimen would share: "
            "ask for one of another specimen, or fit without tolerances."
        )


def _scatter(model: StatisticalModel, parts: Components) -> FloatArray:
    """Return the sd (M,) of the discrepancy's share that is independent from point to point."""
    if model.is_repeated:
        return np.zeros(len(parts.weights))
    values: Mapping[str, FloatArray] = dict(zip(model.nonlinear, parts.settings.T, strict=True))
    return np.asarray(np.sqrt(np.broadcast_to(model.discrepancy.independent_variance(values), len(parts.weights))))


def _few(points: FloatArray) -> tuple[FloatArray, float]:
    """Return few points (n,) that stand for many, and their number over that of all."""
    if len(points) <= MOST_POINTS:
        return points, 1.0
    chosen = np.sort(points)[((np.arange(MOST_POINTS) + 0.5) / MOST_POINTS * len(points)).astype(int)]
    return chosen, MOST_POINTS / len(points)
