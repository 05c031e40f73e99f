"""Draws of a posterior as complete hyperelastic materials, discrepancy included: what other programs can compute with.

Their energy is that of the material, of a discrepancy's further terms, and of a discrepancy that is an energy.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from html import escape
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike

from tissuq.arrays import FloatArray
from tissuq.assessment.stability import measured_range
from tissuq.drawing.panels import panels
from tissuq.errors import InputError
from tissuq.experiments.checked_arrays import checked_points, headed
from tissuq.experiments.modes import Deformation, LoadingMode, Path, States, loading_mode
from tissuq.experiments.units import stress_unit
from tissuq.mechanics import Material, StretchMaterial
from tissuq.mechanics.draws import Continuation, PiecewiseEnergy, sum_of_energies
from tissuq.mechanics.equilibrium import has_free_axis
from tissuq.mechanics.invariants import invariant_rates, invariants, largest_invariants
from tissuq.mechanics.material import axes_felt_by
from tissuq.mechanics.stress import stresses_at, stresses_by_basis
from tissuq.model.statistical_model import StatisticalModel
from tissuq.pictures.prediction import curves

PLOT_POINTS = 81
"""Stretches of a picture."""


@dataclass(frozen=True, eq=False)
class EnergyDraw(StretchMaterial):
    """One draw of a posterior as a material without free parameters.

    Beyond the range of the data of its discrepancy, its energy goes on along rays (`tissuq.mechanics.rays`). With
    fibres it does not, and its energy is one of the deformation, not of the stretches alone.

    Attributes
    ----------
    number : int
        Its place in the ensemble, from zero.
    parts : tuple of (Material, tuple of float)
        The material, and further terms of the discrepancy where it has some, with their parameters.
    discrepancy : PiecewiseEnergy or None
        The energy of a discrepancy that is one.
    continuation : Continuation or None
        The energy of all beyond the range of the data of such a discrepancy.
    beyond_score : float
        Quantile of the normal distribution at which the draw goes on beyond that range, less steeply or more.
    test_scale : float
        The factor of the error that all tests have in common.
    """

    number: int
    parts: tuple[tuple[Material, tuple[float, ...]], ...]
    discrepancy: PiecewiseEnergy | None
    continuation: Continuation | None = None
    beyond_score: float = 0.0
    test_scale: float = 1.0

    parameters = ()
    source = "tissuq"
    __eq__ = object.__eq__  # what is remembered of one draw is not true of another
    __hash__ = object.__hash__

    @property
    def name(self) -> str:  # type: ignore[override]  # of the object, not the class
        """The material's name and the draw's number."""
        return f"{self.parts[0][0].name}, draw {self.number}"

    @property
    def formula(self) -> str:  # type: ignore[override]
        """The formulas of the parts, joined."""
        terms = [material.formula for material, _ in self.parts]
        return " + ".join([*terms, "discrepancy"] if self.discrepancy else terms)

    @property
    def values(self) -> dict[str, float]:
        """The parameters of the material by their symbols."""
        material, values = self.parts[0]
        return {parameter.symbol: value for parameter, value in zip(material.parameters, values, strict=True)}

    @property
    def is_isotropic(self) -> bool:  # type: ignore[override]
        """Whether all parts are."""
        return all(material.is_isotropic for material, _ in self.parts)

    def energy(self, stretches: tuple[Any, Any, Any], values: Any = ()) -> Any:
        materials, parameters = zip(*self.parts, strict=True)
        return sum_of_energies(materials, parameters, stretches, self.discrepancy, self.continuation)

    def energy_of(self, deformation: Deformation, values: Any = ()) -> Any:
        if self.is_isotropic:
            return self.energy(deformation.stretches)
        energy = sum(material.energy_of(deformation, parameters) for material, parameters in self.parts)
        return energy if self.discrepancy is None else energy + self.discrepancy(deformation.stretches)

    @property
    def felt_axes(self) -> tuple[int, ...]:  # type: ignore[override]
        """The axes that some part feels."""
        return axes_felt_by(material for material, _ in self.parts)

    @property
    def shears(self) -> bool:  # type: ignore[override]
        """Whether some part does."""
        return any(material.shears for material, _ in self.parts)

    def why_not(self, deformation: Deformation) -> str:
        if deformation.has_free_axis and not self.shears:
            return ""
        return next(filter(None, (material.why_not(deformation) for material, _ in self.parts)), "")


@dataclass(frozen=True, eq=False)
class Ensemble(Sequence[EnergyDraw]):
    """Equally probable draws of a posterior as complete materials.

    Attributes
    ----------
    draws : tuple of EnergyDraw
    model : StatisticalModel
        What was fitted.
    admissible_in : tuple of str
        Loading modes in which every draw is stable over the range in which both invariants were measured; empty where
        none was left out.
    tried : int
        Draws among which the admissible ones were found.
    ranges : mapping of str to (float, float)
        Stretches of each loading mode of one stretch between which both invariants were measured; with fibres, measured
        stretches along the axes of the test.
    origin : str
        Where the draws come from, in words, where that is no fit of measurements: a new patient of a population.
    """

    draws: tuple[EnergyDraw, ...]
    model: StatisticalModel
    admissible_in: tuple[str, ...]
    tried: int
    ranges: Mapping[str, tuple[float, float]]
    origin: str = ""

    @overload
    def __getitem__(self, index: int) -> EnergyDraw: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[EnergyDraw]: ...
    def __getitem__(self, index: int | slice) -> EnergyDraw | Sequence[EnergyDraw]:
        return self.draws[index]

    def __len__(self) -> int:
        return len(self.draws)

    def shuffled(self, seed: int | Sequence[int]) -> Ensemble:
        """Return the same draws in another order, numbered by it, to pair them with those of another ensemble."""
        order = np.random.default_rng(seed).permutation(len(self))
        return replace(self, draws=tuple(replace(self.draws[k], number=number) for number, k in enumerate(order)))

    def __iter__(self) -> Iterator[EnergyDraw]:
        return iter(self.draws)

    @property
    def admissible_share(self) -> float:
        """The share of the posterior that is admissible, as far as the tried draws tell."""
        return len(self.draws) / self.tried

    @property
    def sources(self) -> dict[str, FloatArray]:
        """What the draws differ by besides parameters and discrepancy, independently of these: columns (N, k) by name.

        ``extrapolation``, the score of how a draw goes on beyond the data and its square, where any does so;
        ``test_scale``, the factor that all tests have in common, where there is one.
        """
        score, scale = (np.array([getattr(draw, name) for draw in self]) for name in ("beyond_score", "test_scale"))
        columns = {}
        if any(draw.continuation is not None for draw in self):
            columns["extrapolation"] = np.stack([score, score**2 - 1], axis=1)
        if np.ptp(scale) > 0:
            columns["test_scale"] = scale[:, None] - 1
        return columns

    @property
    def alone(self) -> Ensemble:
        """The same draws of the material's parameters, without any discrepancy."""
        return replace(
            self,
            draws=tuple(
                replace(draw, parts=draw.parts[:1], discrepancy=None, continuation=None) for draw in self.draws
            ),
        )

    def stress(self, mode: str | LoadingMode | Path, stretch: ArrayLike) -> FloatArray:
        """Return the engineering stresses (N, n), MPa, of all draws at points (n,) of a mode of one stress."""
        if isinstance(mode, Path):
            return self.stresses_at(mode.at(stretch))
        loading = loading_mode(mode)
        return self.stresses_at(loading.at(checked_points(loading, np.atleast_1d(stretch))))

    def stresses_at(self, states: States) -> FloatArray:
        """Return the engineering stresses (N, n), MPa, of all draws at states (n,)."""
        return stress_of(self.draws, states)

    def plot(
        self,
        mode: str | LoadingMode | None = None,
        stretch: ArrayLike | None = None,
        ax: Any = None,
        *,
        unit: str | None = None,
    ) -> Any:
        """Draw the stress of every draw in a loading mode of one stress.

        Parameters
        ----------
        mode : str or LoadingMode, optional
            That of the first test, unless given.
        stretch : (g,) array, optional
            Over the range in which both invariants were measured, unless given.
        ax : Axes, optional
            Unless given, a new figure is made in `matplotlib.pyplot`.
        unit : str, optional
            Of the stress; that of the measurements, unless given.

        Returns
        -------
        Axes
        """
        loading = self.model.experiment.modes[0] if mode is None else loading_mode(mode)
        if len(loading.controls) > 1 or len(loading.stresses) > 1:
            raise InputError(
                f"draws are drawn in modes of one control and one stress, and '{loading.name}' has more: choose of "
                f"{', '.join(self.ranges)}."
            )
        if stretch is None:
            stretches = np.linspace(*measured_range(self.model.experiment, loading), PLOT_POINTS)
        else:
            stretches = np.atleast_1d(np.asarray(stretch, dtype=np.float64))
        with panels(ax, 1) as drawn:
            curves(
                drawn,
                stretches,
                self.stress(loading, stretches),
                loading,
                stress_unit(unit or self.model.experiment.stress_unit),
            )
        return drawn.result

    def _repr_html_(self) -> str:
        """Return how the draws' parameters spread as a table, which notebooks show."""
        import pandas as pd

        is_stress = {parameter.symbol: bool(parameter.unit) for parameter in self.model.material.plain.parameters}
        unit = stress_unit(self.model.experiment.stress_unit)
        table = pd.DataFrame([draw.values for draw in self.draws])
        table = table.div([unit.to_mpa if is_stress[str(name)] else 1.0 for name in table])
        spread = headed(table.describe().loc[["min", "50%", "max"]].rename(index={"50%": "median"}).T, unit)
        return f"<p>{escape(repr(self))}</p>{spread.to_html(float_format='{:.4g}'.format)}"

    def __repr__(self) -> str:
        stable = "" if self.admissible_in else ", stable or not"
        return f"<Ensemble of {len(self)} draws of {self.model.material.name}{stable}>"

    @cached_property
    def most(self) -> tuple[float, float]:
        """The largest I1 - 3 and I2 - 3 that were measured."""
        return largest_invariants(self.model.experiment.states)


def stress_of(draws: Sequence[EnergyDraw], states: States) -> FloatArray:
    """Return the stresses (N, n) of draws at states (n,)."""
    stresses = stress_within(draws, states)
    for row, draw in zip(stresses, draws, strict=True):
        if draw.continuation is not None:
            is_beyond, continued = draw.continuation.stress(*states.log_stretches)
            row[is_beyond] = continued
    return stresses


def stress_within(draws: Sequence[EnergyDraw], states: States) -> FloatArray:
    """Return the stresses (N, n) of draws at states (n,) in the range of their data."""
    if has_free_axis(draws[0], states):  # of all parts together
        return np.array([stresses_at(draw, states, ()) for draw in draws])
    stresses = np.zeros((len(draws), len(states)))
    for term, (material, _) in enumerate(draws[0].parts):
        stresses += stresses_by_basis(material, states, np.array([draw.parts[term][1] for draw in draws]))
    rates, (logs, log_rates) = invariant_rates(states), states.log_stretches
    I1, I2 = invariants(states)
    for row, energy in zip(stresses, (draw.discrepancy for draw in draws), strict=True):
        if energy is not None:
            row += energy.of_i1.slope(I1) * rates[0] + energy.of_i2.slope(I2) * rates[1]
            row += (energy.logarithm.slope(logs) * log_rates).sum(axis=1)
    return stresses
