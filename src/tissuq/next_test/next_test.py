"""The next test: the expected reduction of the uncertainty of targets by a candidate."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, get_args

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.errors import InputError, ModelError
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.inference.quasi_monte_carlo import systematic
from tissuq.inference.solution import Solution
from tissuq.model.error_model import widening_of_lag
from tissuq.model.measurement_errors import ErrorPoints
from tissuq.model.statistical_model import StatisticalModel
from tissuq.model.tolerances import Tolerances, specimens_of
from tissuq.next_test.candidates import Candidate, farthest_range, reach_of
from tissuq.next_test.expected_variance import expected_variances, joint_stresses, states_of
from tissuq.next_test.targets import Stresses, Target
from tissuq.prediction.moments import slopes_of, stress_moments, values_by_symbol

Column = tuple[FloatArray, FloatArray]

Specimen = Literal["same", "other"]
"""Specimen of the next test: the one of the data, or another one."""
BATCHES, COMPONENTS_PER_BATCH, LOG2_OUTCOMES = 8, 400, 7
"""Number of independent batches, whose spread gives the error; components of each; base-2 logarithm of its outcomes."""
MIN_EFFECTIVE_COMPONENTS, MIN_EFFECTIVE_SHARE = 10.0, 0.3
"""Smallest effective number of components after the test for which the expectation is reliable; where few are summed
over (values of the noise), as a share of those before."""
MAX_REACH = 2.0
"""Largest I1 - 3 and I2 - 3 over those of the data for which an energy discrepancy has a known size."""
MAX_POINTS = 400
"""Largest number of measurements that are computed; of more, a subset with correspondingly less noise is used."""


@dataclass(frozen=True, eq=False)
class Expected:
    """Expectation for one candidate: standard deviations (t,) of the targets now and after the test.

    ``sd_after`` is the root of the expected variance, ``error`` the standard error of ``sd_after / sd_now`` by
    simulation, zero where all is in closed form. ``is_rough`` means that few components of the posterior would remain.
    """

    sd_now: FloatArray
    sd_after: FloatArray
    error: FloatArray
    is_rough: bool

    @property
    def reduction(self) -> FloatArray:
        """By what share the standard deviations fall."""
        return 1 - self.sd_after / self.sd_now


class NextTest:
    """The expected gain of further tests, for one posterior.

    Tests of the same specimen have the errors of single measurements that the model has: in the mode of the data they
    are further measurements of the same test (`Posterior.update`), in another mode a test without separate errors. A
    test of another specimen has separate errors of area, length and zero, by the `Tolerances` of the model, and differs
    as specimens of a tissue do (`Tolerances.of_another_specimen`): what is wanted is then the tissue's.

    Parameters
    ----------
    solution : Solution
    targets : sequence of Target
    specimen : str, optional
        ``"same"`` or ``"other"``; that of the data unless these are of several specimens with errors of their own.
    seed : int
        Seed of the drawn outcomes of tests.

    Raises
    ------
    InputError
        When the model's errors do not determine those of a further test.
    """

    def __init__(
        self, solution: Solution, targets: Sequence[Target], specimen: Specimen | None = None, seed: int = 0
    ) -> None:
        self.model, self.targets, self._seed = solution.model, targets, seed
        self._components = solution.mixture
        self.specimen: Specimen = specimen or ("other" if self.model.tolerances else "same")
        _check_model(self.model, self.specimen)
        for target in targets:
            for mode, stretch in target.states:
                self._check_candidate(Candidate(mode, [stretch]), f"target '{target.name}'")

    def expected(self, candidate: Candidate) -> Expected:
        """Return the expectation for a candidate.

        Raises
        ------
        InputError, ModelError
            When the discrepancy is unknown in its mode or range, or the material may lock or does not deform so.
        """
        self._check_candidate(candidate, f"test '{candidate.name}'")
        ratios, effective = [], []
        for number, components in enumerate(self._batches):
            mixture, noise_sd = self._mixture(components, candidate)
            variances = expected_variances(mixture, noise_sd, self._uniforms(number, mixture, noise_sd))
            centre = (mixture.weights @ mixture.mean)[noise_sd.shape[1] :] - self._offsets
            prior, expected = (
                variance + self._common_error(self.errors_after(candidate.tests)) ** 2 * (variances.prior + centre**2)
                for variance in (variances.prior, variances.expected)
            )
            ratios.append(expected / prior)
            effective.append(variances.effective)
        ratio, count = np.mean(ratios, axis=0), len(ratios)
        spread = np.std(np.sqrt(ratios), axis=0, ddof=1) / np.sqrt(count) if count > 1 else np.zeros(len(ratio))
        weights = self._batches[0].weights
        effective_now = float(weights.sum() ** 2 / (weights @ weights))
        min_effective = min(MIN_EFFECTIVE_COMPONENTS, MIN_EFFECTIVE_SHARE * effective_now)
        is_rough = count > 1 and float(np.mean(effective)) < min_effective
        return Expected(self.sd_now, self.sd_now * np.sqrt(ratio), spread, is_rough)

    @cached_property
    def sd_now(self) -> FloatArray:
        """The standard deviations (t,) of the targets before any further test."""
        mean, root = self._targets(self._components, *self._stresses(self._components, []))
        centre, covariance = GaussianMixture(self._components.weights, self._components.settings, mean, root).moments()
        variance = np.diag(covariance)
        of_stresses = centre - self._offsets
        return np.sqrt(variance + self._common_error(self.errors_now) ** 2 * (variance + of_stresses**2))

    @property
    def tolerances(self) -> Tolerances:
        """The errors of a test of another specimen."""
        tolerances = self.model.tolerances
        has_several = specimens_of(self.model.experiment).shape[1] > 1  # these tell by how much specimens differ
        return tolerances if has_several and tolerances.stress else tolerances.of_another_specimen()

    @property
    def errors_now(self) -> float:
        """The relative standard deviation of the error that all stresses have in common."""
        if self.specimen == "same":
            return self.model.common_error
        return self.tolerances.in_common(self.model.experiment)

    def errors_after(self, tests: int) -> float:
        """Return the same after so many further tests."""
        if self.specimen == "same":
            return self.errors_now
        spreads = [size / np.sqrt(count + tests) for size, count in self._spreads]
        return float(np.linalg.norm(spreads))

    @property
    def _spreads(self) -> list[tuple[float, int]]:
        """The spread of the stress between specimens, and between tests, and how many of them there are."""
        tests, specimens = specimens_of(self.model.experiment).shape
        return [(self.tolerances.stress, specimens), (self.tolerances.test, tests)]

    def _common_error(self, error: float) -> FloatArray:
        """Return the error (t,) of each target that all stresses have in common."""
        return error * np.array([target.is_stiffness for target in self.targets])

    @property
    def _offsets(self) -> FloatArray:
        """The part (t,) of each target that such an error does not multiply."""
        return np.array([target.offset for target in self.targets])

    @cached_property
    def _batches(self) -> list[GaussianMixture]:
        """Components that represent the posterior, drawn anew for every batch where there are many."""
        components, count = self._components, len(self._components.weights)
        if count == 1:
            return [components]
        if count <= COMPONENTS_PER_BATCH:
            return [components.weighted(components.weights / components.weights.sum())] * BATCHES
        offsets = (np.arange(BATCHES) + 0.5) / BATCHES
        row_sets = [systematic(components.weights[None], COMPONENTS_PER_BATCH, offset)[0] for offset in offsets]
        return [components[rows].weighted(np.full(COMPONENTS_PER_BATCH, 1 / COMPONENTS_PER_BATCH)) for rows in row_sets]

    def _uniforms(self, number: int, mixture: GaussianMixture, noise_sd: FloatArray) -> FloatArray:
        """Return points of the unit cube, the same for all candidates as far as these are alike."""
        from scipy.stats import qmc

        size = 1 + mixture.root.shape[2] + noise_sd.shape[1]
        engine = qmc.Sobol(size, rng=np.random.default_rng([self._seed, 23, number]))
        return np.asarray(engine.random_base2(LOG2_OUTCOMES))

    def _stresses(self, components: GaussianMixture, tests: list[tuple[Candidate, FloatArray]]) -> Column:
        """Return means and roots of the stresses of tests at points of them, and of the targets that are stresses."""
        points_of_modes = [(test.mode, points) for test, points in tests]
        states = [state for target in self.targets for state in target.states]
        points_of_modes += [(mode, np.array([stretch])) for mode, stretch in states]
        if not points_of_modes:
            return np.zeros((len(components.weights), 0)), np.zeros(
                (len(components.weights), 0, components.root.shape[2])
            )
        return joint_stresses(self.model, components, states_of(self.model, points_of_modes))

    def _targets(self, components: GaussianMixture, mean: FloatArray, root: FloatArray) -> Column:
        """Return means (M, t) and roots (M, t, r) of the targets; stresses among them are the last ones given."""
        scatter, columns = _scatter(self.model, components), []
        start = mean.shape[1] - sum(len(target.states) for target in self.targets)
        for target in self.targets:
            end = start + len(target.states)
            stresses = Stresses(mean[:, start:end], root[:, start:end], scatter)
            target_mean, known_root = target.moments(self.model, components, stresses)
            target_root = np.zeros((len(mean), root.shape[2] + 1))
            target_root[:, : known_root.shape[1]] = known_root
            columns.append((target_mean, target_root))
            start = end
        return np.stack([mean for mean, _ in columns], axis=1), np.stack([root for _, root in columns], axis=1)

    def _mixture(self, components: GaussianMixture, candidate: Candidate) -> tuple[GaussianMixture, FloatArray]:
        """Return the candidate's measurements followed by the targets, and the noise (M, n) of the former."""
        of_one, share = _thinned(candidate.stretch[:: candidate.tests], MAX_POINTS // candidate.tests)
        points = np.repeat(of_one, candidate.tests)
        mean, root = self._stresses(components, [(candidate, points)])
        count = len(points) * len(candidate.mode.stresses)
        target_mean, target_root = self._targets(components, mean, root)
        mean, root = mean[:, :count], np.concatenate([root[:, :count], np.zeros((*mean[:, :count].shape, 1))], axis=2)
        curve = components.weights @ mean / components.weights.sum()
        noise_sd = self._noise(components, candidate, curve)
        if self.specimen == "other":
            test = self._error_points(components, candidate, points, curve)
            columns = list(self._errors_of_specimens(test, mean, target_mean - self._offsets, candidate.tests))
            root = np.concatenate([root, *(column[:, :, None] for column, _ in columns)], axis=2)
            target_root = np.concatenate([target_root, *(column[:, :, None] for _, column in columns)], axis=2)
            noise_sd = np.hypot(noise_sd, self.tolerances.noise(test))
        moments = np.concatenate([mean, target_mean], axis=1), np.concatenate([root, target_root], axis=1)
        return GaussianMixture(components.weights, components.settings, *moments), noise_sd * np.sqrt(share)

    def _error_points(
        self, components: GaussianMixture, candidate: Candidate, points: FloatArray, curve: FloatArray
    ) -> ErrorPoints:
        """Return the points of a candidate at which its errors act, for its mean curve (n,)."""
        if not self.tolerances.need_slope:
            return ErrorPoints(candidate.mode, points, curve)
        states = states_of(self.model, [(candidate.mode, points)])
        mean, _ = stress_moments(self.model, components, states)
        slopes = slopes_of(lambda moved: stress_moments(self.model, components, moved)[0], states, mean)
        weights = components.weights / components.weights.sum()
        return ErrorPoints(candidate.mode, points, curve, np.einsum("m,mgc->gc", weights, slopes))

    def _noise(self, components: GaussianMixture, candidate: Candidate, curve: FloatArray) -> FloatArray:
        """Return the sd (M, n) of all that is independent from measurement to measurement.

        Errors that are correlated from one to the next, if the test is sampled as those of the data, tell as little as
        larger independent ones.
        """
        model = self.model
        values = values_by_symbol(model, components.settings)
        variance = model.noise_variance(values, np.abs(curve)) * model.noise_of_new_test(candidate.mode) ** 2
        variance = variance * widening_of_lag(model.fitted_errors.lag or 0.0) ** 2
        total = variance + _scatter(model, components)[:, None] ** 2
        return np.asarray(np.sqrt(np.broadcast_to(total, (len(components.weights), len(curve)))))

    def _errors_of_specimens(
        self, test: ErrorPoints, mean: FloatArray, target_mean: FloatArray, tests: int
    ) -> Iterator[Column]:
        """Yield the effects of standard errors of m new specimens on their stresses (M, n) and on the targets (M, t).

        With e the errors of stress of K + m specimens, or tests, the data determine the tissue's stress times 1 + the
        mean of K. A new stress is that times 1 + d, d = e_new - mean of K, and the mean of K + m is that of K plus the
        sum of d / (K + m). Of m tests at the same points one follows the other at each of these.
        """
        of_tests = [np.arange(mean.shape[1]) % tests == number for number in range(tests)]
        for size, count in self._spreads:
            if size:
                of_mean, share = size / np.sqrt(count), 1 / (count + tests)
                yield -of_mean * mean, target_mean * self._common_error(-of_mean * tests * share)
                for is_of_test in of_tests:
                    yield size * mean * is_of_test, target_mean * self._common_error(size * share)
        columns = [self.tolerances.columns(test, shared) for shared in ("specimen", "test")]
        for column in np.hstack(columns).T:
            if column.any():
                for is_of_test in of_tests:
                    yield np.broadcast_to(column * is_of_test, mean.shape), np.zeros_like(target_mean)

    def _check_candidate(self, candidate: Candidate, label: str) -> None:
        """Refuse a test or a stress that the posterior does not determine."""
        model, data = self.model, self.model.experiment
        for path in candidate.mode.paths:
            if problem := model.material.why_not(path.moved(candidate.stretch[:1], 0.0)):
                raise ModelError(problem)
        if (not model.discrepancy.is_energy or model.is_correlated) and candidate.mode not in data.modes:
            names = ", ".join(mode.name for mode in data.modes)
            raise InputError(
                f"{label}: discrepancy '{model.discrepancy.name}' is an error of the {names} stress and another, "
                f"unknown one of the {candidate.mode.name} stress: choose mode {names}, or a posterior with an energy, "
                "such as 'auto'."
            )
        reach = float(reach_of(data, candidate.mode, candidate.stretch).max())
        if model.energy_symbols and reach > MAX_REACH:
            low, high = farthest_range(data, candidate.mode, MAX_REACH)
            raise InputError(
                f"{label} reaches {reach:.2g} times as far as the data in I1 - 3 or I2 - 3; beyond {MAX_REACH:g} times "
                f"too little is known to plan with: choose a range within {low:g} to {high:g}."
            )


def _check_model(model: StatisticalModel, specimen: Specimen) -> None:
    """Refuse a model whose errors do not determine those of a further test."""
    if specimen not in get_args(Specimen):
        raise InputError(f"specimen must be one of {', '.join(get_args(Specimen))}, not '{specimen}'.")
    is_plain = not (model.is_correlated or model.noise.depends_on_level or model.noise.shares_discrepancy)
    if not model.discrepancy.is_energy and (specimen == "other" or len(model.experiment.curves) > 1):
        raise InputError(
            f"discrepancy '{model.discrepancy.name}' is a different, unknown error of the stress in each test: only "
            "further points of a single test can be assessed. Fit with an energy, such as 'auto'."
        )
    if specimen == "other" and not is_plain:
        raise InputError(
            f"noise '{model.noise}' and discrepancy '{model.discrepancy.name}' cannot be combined with errors of whole "
            "tests: fit with the noise 'unknown' and the discrepancy 'auto', or choose a test of the same specimen."
        )
    if specimen == "same" and model.tolerances:
        raise InputError(
            "the tests of this posterior have errors of area or length that a test of the same specimen would share: "
            "choose one of another specimen, or fit as tested (--estimand as-tested)."
        )


def _scatter(model: StatisticalModel, components: GaussianMixture) -> FloatArray:
    """Return the sd (M,) of the discrepancy's share that is independent from point to point."""
    values: Mapping[str, FloatArray] = dict(zip(model.nonlinear, components.settings.T, strict=True))
    return np.asarray(np.sqrt(np.broadcast_to(model.independent_variance(values), len(components.weights))))


def _thinned(points: FloatArray, most: int) -> tuple[FloatArray, float]:
    """Return at most so many of the points, evenly thinned, and their number over that of all."""
    if len(points) <= most:
        return points, 1.0
    selected = np.sort(points)[((np.arange(most) + 0.5) / most * len(points)).astype(int)]
    return selected, most / len(points)
