"""The stresses of draws with which cards are compared: in the states that were measured, and in those around them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from tissuq.arrays import BoolArray, FloatArray, IndexArray
from tissuq.experiments.modes import LoadingMode, Path, curve_modes
from tissuq.export.stability_rows import StabilityStates, least_eigenvalues, wanted_stiffness
from tissuq.export.states import PrincipalStates, SeenStates, are_stable, mode_stretches, moduli, states_between
from tissuq.mechanics.invariants import invariant_rates
from tissuq.posterior.ensemble import Ensemble

REACHES = (1.0, 1.25, 1.5)
"""Multiples of the measured I1 - 3 and I2 - 3 up to which errors of cards are stated; cards are fitted to the last."""
MIN_RELATIVE_STRESS = 0.01
"""Smallest stress by which errors are divided, as a fraction of that of a neo-Hookean material of equal modulus."""
MIN_SHARE_OF_LARGEST = 0.01
"""Smallest stress by which distances of fits are divided, as a fraction of the largest of the three in a state."""


@dataclass(frozen=True, eq=False)
class Judged:
    """Points of a path, the stresses (N, n) of draws there, MPa, and the sizes (N, n) by which errors are divided."""

    path: LoadingMode | Path
    points: FloatArray
    stress: FloatArray
    size: FloatArray


@dataclass(frozen=True, eq=False)
class DrawStresses:
    """Draws and their stresses, each computed when it is first needed and then kept for all laws that are compared.

    Where errors are relative to a stress, one below a hundredth of the neo-Hookean one with the draw's modulus counts
    as that.
    """

    ensemble: Ensemble

    @cached_property
    def modulus(self) -> FloatArray:
        """Initial shear moduli (N,), MPa."""
        return moduli(self.ensemble)

    @cached_property
    def stable(self) -> BoolArray:
        """Whether draws (N,) are stable themselves over the range that was measured."""
        return are_stable(self.ensemble)

    @cached_property
    def states(self) -> PrincipalStates:
        """The states that were measured, and those around them up to the last of `REACHES`."""
        limits, factor_pairs = self.ensemble.most, pairwise(REACHES)
        shells = [SeenStates(limits), *(states_between(limits, factors) for factors in factor_pairs)]
        return PrincipalStates(np.concatenate([shell.logs for shell in shells]))

    @cached_property
    def shell(self) -> IndexArray:
        """The number of the first of `REACHES` that the state of a point (n,) is within."""
        largest = self._relative_invariants(self.states.logs)
        return np.tile(np.searchsorted(np.array(REACHES) * (1 + 1e-9), largest), 3)

    @cached_property
    def of_states(self) -> Judged:
        """The stresses in `states`."""
        return self._judged(self.states, self.states.points, self.states.of_unit_modulus)

    @cached_property
    def stability_states(self) -> StabilityStates:
        """The states in which laws are to be stable, up to the last of `REACHES`."""
        largest_1, largest_2 = self.ensemble.most
        return StabilityStates((REACHES[-1] * largest_1, REACHES[-1] * largest_2))

    @cached_property
    def wanted_stiffness(self) -> FloatArray:
        """The smallest stiffness (N, n) that laws may have in `stability_states`."""
        states = self.stability_states
        eigenvalues = least_eigenvalues(states.hessian(self.ensemble.stresses_at(states.nudged).T))
        is_beyond = self._relative_invariants(states.logs) > 1 + 1e-9
        pairs = zip(eigenvalues.T, self.modulus, strict=True)
        return np.array([wanted_stiffness(states, is_beyond, of_draw, float(modulus)) for of_draw, modulus in pairs])

    def _relative_invariants(self, logs: FloatArray) -> FloatArray:
        """Return the larger of both invariants of logarithmic strains (n, 3) over the largest measured one, (n,)."""
        invariants = np.stack([np.exp(sign * 2 * logs).sum(axis=1) - 3 for sign in (1, -1)], axis=1)
        return np.asarray((invariants / self.ensemble.most).max(axis=1))

    @cached_property
    def of_modes(self) -> dict[str, Judged]:
        """The stresses of every loading mode of one stretch over the range that was measured, by its name.

        None beside fibres, which leave open how a body deforms in these modes.
        """
        judged = {}
        for mode in (mode for mode in curve_modes() if mode.name in self.ensemble.ranges):
            stretch = mode_stretches(*self.ensemble.ranges[mode.name])
            of_unit_modulus = np.abs(0.5 * invariant_rates(mode.at(stretch))[0])
            judged[mode.name] = self._judged(mode, stretch, of_unit_modulus)
        return judged

    @cached_property
    def size_in_fits(self) -> FloatArray:
        """The sizes (N, n) by which distances in `states` are divided where a law is fitted."""
        return np.maximum(
            self.of_states.size, MIN_SHARE_OF_LARGEST * np.tile(_largest_of_three(self.of_states.stress), 3)
        )

    def errors(self, cards: Ensemble) -> dict[str, FloatArray]:
        """Return the relative errors of stresses, (N, n) each, of cards for these draws.

        By loading mode, and of the ``states`` that were measured, relative to the draw's own stress; and in the states
        up to so many times the measured invariants (``within_1``, ``within_1.25``, ``within_1.5``) the largest error of
        the three differences of principal stresses relative to the largest stress there. Not a number where a draw
        itself has no stress.
        """
        errors = {name: self._apart(cards, judged) / judged.size for name, judged in self.of_modes.items()}
        differences, wanted = self._apart(cards, self.of_states), self.of_states
        errors["states"] = (differences / wanted.size)[:, self.shell == 0]
        largest = _largest_of_three(differences) / _largest_of_three(wanted.stress)
        shell = self.shell[: largest.shape[1]]
        return errors | {within(reach): largest[:, shell <= number] for number, reach in enumerate(REACHES)}

    def _apart(self, cards: Ensemble, judged: Judged) -> FloatArray:
        with np.errstate(invalid="ignore"):
            return np.asarray(cards.stress(judged.path, judged.points) - judged.stress)

    def _judged(self, path: LoadingMode | Path, points: FloatArray, of_unit_modulus: FloatArray) -> Judged:
        stress = self.ensemble.stress(path, points)
        floor = MIN_RELATIVE_STRESS * np.abs(self.modulus)[:, None] * of_unit_modulus
        return Judged(path, points, stress, np.maximum(np.abs(stress), floor))


def within(reach: float) -> str:
    """Return the name of the errors in all states up to so many times the measured invariants."""
    return f"within_{reach:g}"


def _largest_of_three(stress: FloatArray) -> FloatArray:
    """Return the size (N, n) of the largest of the three stresses in a state, of (N, 3 n)."""
    return np.asarray(np.abs(stress.reshape(len(stress), 3, -1)).max(axis=1))
