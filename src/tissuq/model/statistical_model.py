"""The statistical model: one joint density of data and parameters on a given experiment."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import InitVar, dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tissuq.arrays import FloatArray, IndexArray
from tissuq.errors import InputError, ModelError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import States
from tissuq.mechanics import Material, stress_basis
from tissuq.mechanics.rays import Range
from tissuq.mechanics.relative_stiffness import for_states
from tissuq.model.compatibility import check_angles, check_linearity, check_parts, check_separable
from tissuq.model.discrepancy import Discrepancy, EnergyDiscrepancy, Member
from tissuq.model.discrepancy.blocks import EnergyBlock
from tissuq.model.error_model import ErrorModel
from tissuq.model.noise import Noise, noise_named
from tissuq.model.scales import default_boxes, default_prior, off_zero, support
from tissuq.model.statistics import CHUNK, Condensed, Statistics, condensed, is_condensed, upper_triangle
from tissuq.model.tolerances import FittedErrors, Tolerances
from tissuq.parameters.parameter import Parameter
from tissuq.parameters.priors import Flat, Prior

BENT_QUANTILES = (0.001, 0.1, 0.5, 0.9, 0.999)
"""Probabilities of the exponents' priors at which the size of a box is judged."""
MAX_REMEMBERED_SIZE = 2000
"""Measurements up to which the stresses of a block are remembered from one model to the next."""
POINTS_OF_RANGE = 2001
"""Points that stand for the range of the stretches of very many measurements."""


@dataclass(frozen=True, eq=False)
class StatisticalModel(ErrorModel):
    """measured stress = material(l) + discrepancy(l) + noise, with a prior on every parameter (eq. 15).

    The stress is linear in most parameters. Those of them with a flat, uniform or Gaussian prior are `linear`: given
    the few others, the `nonlinear` ones, the posterior is Gaussian, and inference rests on that. The `structure`
    is what costs a factorisation to vary: nonlinear parameters of the material or of a correlation's shape.

    Parameters
    ----------
    experiment : Experiment
        The measurements.
    material : Material
        The model whose parameters are wanted; in parameters in which its stress is linear on this experiment.
    discrepancy : Discrepancy
        What it cannot explain; the model holds it as adapted to material and experiment.
    noise : float, str or Noise
        Standard deviation in MPa, or the name of a noise with parameters (``"unknown"``).
    chosen_priors : mapping of str to Prior
        Priors in MPa that replace the defaults.
    tolerances : Tolerances
        By how much whole tests may be off; nothing, where nothing is said.
    fitted_errors : FittedErrors
        Estimates of its errors that are plugged in; `tissuq.fit` makes them.
    known_statistics : Statistics, optional
        `statistics`, where they are known already; a model that differs (`dataclasses.replace`) computes its own.

    Raises
    ------
    ModelError
        When material and discrepancy share a parameter, or the data cannot separate the parameters.
    InputError
        When noise or priors are unusable, or there are fewer measurements than parameters.
    """

    experiment: Experiment
    material: Material
    discrepancy: Discrepancy
    noise: Noise = "unknown"  # type: ignore[assignment]  # a name or a number becomes a Noise
    chosen_priors: Mapping[str, Prior] = field(default_factory=dict)
    tolerances: Tolerances = Tolerances()  # noqa: RUF009 (frozen)
    fitted_errors: FittedErrors = FittedErrors()  # noqa: RUF009 (frozen)
    known_statistics: InitVar[Statistics | None] = None

    def __post_init__(self, known_statistics: Statistics | None) -> None:
        if known_statistics is not None:
            self.__dict__["statistics"] = known_statistics
        object.__setattr__(self, "experiment", Experiment.of(self.experiment))
        object.__setattr__(self, "material", for_states(self.material, self.experiment.states))
        object.__setattr__(self, "noise", noise_named(self.noise))
        object.__setattr__(self, "discrepancy", self.discrepancy.adapted_to(self.material, self.experiment))
        check_parts(self.material, self.discrepancy, self.noise, self.tolerances, self.experiment)
        self._check_priors()
        self._check_data()

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Every parameter: of the material, the discrepancy and, when it has some, the noise."""
        return (*self.material.parameters, *self.discrepancy.parameters, *self.noise.parameters)

    @cached_property
    def priors(self) -> dict[str, Prior]:
        """The prior of every parameter, in MPa and stretch."""
        boxes = self._default_boxes()
        return {
            p.symbol: self._chosen_prior(p) or boxes.get(p.symbol) or default_prior(p, self.experiment)
            for p in self.parameters
        }

    @property
    def is_improper(self) -> bool:
        """Whether a prior is flat, so that there is no evidence."""
        return any(isinstance(prior, Flat) for prior in self.priors.values())

    @cached_property
    def derived_parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the material in the literature that follow from those of the model."""
        return tuple(p for p in self.material.plain.parameters if p.symbol not in self.material_symbols)

    @property
    def reported_parameters(self) -> tuple[Parameter, ...]:
        """Every parameter, those that follow from others last."""
        return (*self.parameters, *self.derived_parameters)

    @property
    def symbols(self) -> tuple[str, ...]:
        """The symbol of every parameter."""
        return tuple(p.symbol for p in self.parameters)

    @cached_property
    def linear(self) -> tuple[str, ...]:
        """Parameters that can be integrated in closed form: stress linear in them, prior flat, uniform or Gaussian."""
        return tuple(p.symbol for p in self.parameters if p.is_linear and self.priors[p.symbol].gaussian is not None)

    @cached_property
    def nonlinear(self) -> tuple[str, ...]:
        """All other parameters, those of the structure first."""
        nonlinear = [p.symbol for p in self.parameters if p.symbol not in self.linear]
        return tuple(sorted(nonlinear, key=lambda symbol: symbol not in self.structure))

    @cached_property
    def structure(self) -> tuple[str, ...]:
        """Parameters on which the basis of the mean stress or the correlation of the discrepancy depends."""
        return (*self.bent_symbols, *self.discrepancy.shape_symbols)

    @cached_property
    def column_symbols(self) -> tuple[str, ...]:
        """The parameters in which the mean stress is linear, in the order of the columns of `basis`."""
        return tuple(p.symbol for p in self.parameters if p.is_linear)

    @cached_property
    def bent_symbols(self) -> tuple[str, ...]:
        """The material's parameters in which its stress is not linear, such as exponents."""
        return tuple(p.symbol for p in self.material.parameters if not p.is_linear)

    @cached_property
    def material_symbols(self) -> tuple[str, ...]:
        """The parameters of the material."""
        return tuple(p.symbol for p in self.material.parameters)

    @cached_property
    def energy_members(self) -> tuple[Member, ...]:
        """The members of an energy discrepancy over the range of the data; none for other discrepancies."""
        if not isinstance(self.discrepancy, EnergyDiscrepancy):
            return ()
        return _remembered_members(self.discrepancy, self._range)

    @property
    def _range(self) -> States:
        """The states of all measurements, or of very many ones of one curve some that lie over their range."""
        curve = self.experiment.curves[0]
        if not self._is_one_plain_curve or len(curve) <= CHUNK:
            return self.experiment.states
        return curve.path.at(np.linspace(curve.points.min(), curve.points.max(), POINTS_OF_RANGE), 0)

    @property
    def _is_one_plain_curve(self) -> bool:
        """Whether the measurements are of one stress against one control, with independent and equal errors."""
        curves = self.experiment.curves
        return len(curves) == 1 and curves[0].points.ndim == 1 and self.whitening is None

    @property
    def energy_symbols(self) -> tuple[str, ...]:
        """The amplitudes of an energy discrepancy."""
        is_energy = isinstance(self.discrepancy, EnergyDiscrepancy)
        return tuple(p.symbol for p in self.discrepancy.parameters) if is_energy else ()

    def basis(self, states: States, bent: ArrayLike = ()) -> FloatArray:
        """Return the (n, k) mean stresses of unit parameters `column_symbols` at states (n,).

        Where the material has parameters in which its stress is not linear, ``bent`` holds their values: (s,), or
        (m, s) for (m, n, k) mean stresses.
        """
        return _basis(self.material, self.discrepancy, states, bent)

    @property
    def meaning(self) -> str:
        """What an interval of its posterior is of, in words."""
        return self.tolerances.meaning(self.experiment)

    @property
    def headline(self) -> str:
        """The parameter that summaries put first: the material's first one."""
        return self.material.parameters[0].symbol

    @cached_property
    def condensed(self) -> Condensed | None:
        """Very many measurements of one curve as few rows; None where each is a row of its own.

        It needs errors that are independent and equal, and stresses that are smooth between few points.
        """
        is_plain = self._is_one_plain_curve and not (self.is_correlated or self.noise.depends_on_level)
        if not is_plain or self.experiment.size <= CHUNK:
            return None
        return condensed(self.experiment, float(self.experiment.mode.reference), self._functions)

    def _functions(self, points: FloatArray) -> list[FloatArray]:
        """Return the stresses (m, k) that the model is made of at points (m,): of the mean, and of each block."""
        states, bent = self.experiment.states_at(points), [self.usual_bent]
        if self.bent_symbols:
            bent += [tuple(off_zero(prior, q) for prior in self._bent_priors()) for q in BENT_QUANTILES]
        blocks = {
            block: block[0].stress_features(states, *block[1:])
            for member in self.energy_members
            for block in member.scaled_blocks
        }
        return [*self.basis(states, np.array(bent)), *blocks.values()]

    @property
    def states(self) -> States:
        """Where stresses must be known for the rows of `design`: at the measurements, unless these are condensed."""
        return self.experiment.states if self.condensed is None else self.experiment.states_at(self.condensed.points)

    def at_measurements(self, columns: FloatArray) -> FloatArray:
        """Return columns (n,) or (n, k) at all measurements, given those (m,) or (m, k) at `states`."""
        return columns if self.condensed is None else self.condensed.at_measurements(columns)

    def rows(self, columns: Any) -> Any:
        """Return columns (m,) or (m, k) at `states` as inference sees them: whitened, or condensed."""
        return self.white(columns) if self.condensed is None else self.condensed(columns)

    @cached_property
    def stress(self) -> FloatArray:
        """The measured stresses (n,), whitened, or the rows (r,) that they are condensed to."""
        return np.asarray(self.white(self.experiment.measured)) if self.condensed is None else self.condensed.stress

    @cached_property
    def design(self) -> FloatArray:
        """`basis` as `rows`; at the medians of the priors where it depends on parameters."""
        if self.experiment.size > CHUNK:
            return self.design_at(self.usual_bent)
        basis = _remembered_basis(self.material, self.discrepancy, self.experiment.states, self.usual_bent)
        return np.asarray(self.rows(basis))

    def design_at(self, bent: ArrayLike) -> FloatArray:
        """Return `basis` as `rows` (r, k), at values (s,) of `bent_symbols`."""
        return np.asarray(self.designs_at(np.asarray(bent)[None])[0])

    def designs_at(self, bent: ArrayLike) -> FloatArray:
        """Return `basis` as `rows` (m, r, k), at m values (m, s) of `bent_symbols`."""
        bases = self.basis(self.states, bent)
        rows = np.asarray(self.rows(bases.swapaxes(0, 1).reshape(bases.shape[1], -1)))
        return rows.reshape(len(rows), len(bases), -1).swapaxes(0, 1)

    def by_limits(self, member: IndexArray) -> Iterator[tuple[Range, IndexArray]]:
        """Yield the different ranges of the data of energy members (M,), and which of these have each.

        Nothing for a material with fibres, whose energy does not follow from the principal stretches.
        """
        numbers = np.unique(member[: len(member) * self.material.is_isotropic])
        limits = [self.energy_members[number].limits for number in numbers]
        for distinct in dict.fromkeys(limits):
            alike = [number for number, values in zip(numbers, limits, strict=True) if values == distinct]
            yield distinct, np.flatnonzero(np.isin(member, alike))

    def energy_features(self, member: int) -> list[FloatArray]:
        """Return the stresses of each block's terms of a member as `rows`."""
        return [self._rows_of_block(*scaled_block) for scaled_block in self.energy_members[member].scaled_blocks]

    def _rows_of_block(self, block: EnergyBlock, reach: tuple[float, float], length: float) -> FloatArray:
        """Return the stresses of the terms of a block as `rows`, remembered, as many members have it."""
        key = block, reach, length
        if key not in self._known_blocks:
            are_few = self.experiment.size <= MAX_REMEMBERED_SIZE
            features = (_remembered_features if are_few else _features)(block, self.states, reach, length)
            self._known_blocks[key] = np.asarray(self.rows(features))
        return self._known_blocks[key]

    @cached_property
    def _known_blocks(self) -> dict[tuple[EnergyBlock, tuple[float, float], float], FloatArray]:
        return {}

    @cached_property
    def statistics(self) -> Statistics:
        """The data and `design`, reduced in one pass."""
        is_of_many_columns = bool(self.energy_symbols or self.bent_symbols)  # for which one pass must do
        is_worth_it = is_of_many_columns or is_condensed(self.experiment)
        if not is_worth_it or self.condensed is None:
            return Statistics.of_rows(self._rows())
        rows = np.column_stack([self.design_at(self.usual_bent), self.stress])
        return Statistics(len(self.experiment), upper_triangle(rows))

    def with_more(self, experiment: Experiment) -> StatisticalModel:
        """Return the same model of this experiment and further measurements, at a cost that only these set.

        Raises
        ------
        InputError
            When the further measurements are in another loading mode.
        """
        joined = self.experiment.joined(experiment)
        if self.whitening is not None or self.tolerances or self.noise.is_consecutive or len(joined.curves) > 1:
            return replace(self, experiment=joined, fitted_errors=FittedErrors())
        rows = np.column_stack([self.basis(experiment.states, self.usual_bent), experiment.measured])
        return replace(self, experiment=joined, known_statistics=self.statistics.joined(Statistics.of_rows([rows])))

    def with_errors(self, **estimates: Any) -> StatisticalModel:
        """Return the same model with other estimates of its errors, as the attributes of `FittedErrors`."""
        return replace(self, fitted_errors=replace(self.fitted_errors, **estimates))

    def _rows(self) -> Iterator[FloatArray]:
        """Yield the rows [X y], block by block; every block has one length, so that JAX compiles once."""
        if self.experiment.size <= CHUNK or self.whitening is not None:
            yield np.column_stack([self.design, self.stress])
            return
        for number, curve in enumerate(self.experiment.curves):
            for start in range(0, len(curve), CHUNK):
                points, stress = curve.points[start : start + CHUNK], curve.stress[start : start + CHUNK]
                padding = [(0, CHUNK - len(stress)), *[(0, 0)] * (points.ndim - 1)]
                states = curve.path.at(np.pad(points, padding, mode="edge"), number)
                yield np.column_stack([self.basis(states, self.usual_bent)[: len(stress)], stress])

    @cached_property
    def usual_bent(self) -> tuple[float, ...]:
        """The medians of the priors of `bent_symbols`; off zero, where a law may divide by it."""
        return tuple(off_zero(prior, 0.5) for prior in self._bent_priors())

    def _bent_priors(self) -> list[Prior]:
        bent = [p for p in self.material.parameters if p.symbol in self.bent_symbols]
        return [self._chosen_prior(parameter) or default_prior(parameter, self.experiment) for parameter in bent]

    def _shortest_columns(self) -> FloatArray:
        """Return the least lengths of the material's columns over the priors of `bent_symbols`, for this many data."""
        states = self.experiment.states
        sample = states if self.whitening is not None else states.thinned(max(1, len(states) // CHUNK))
        bent = tuple(tuple(off_zero(prior, q) for prior in self._bent_priors()) for q in BENT_QUANTILES)
        bases = _remembered_stress_basis(self.material, sample, bent)
        columns = np.array([self.white(basis) for basis in bases])
        return np.asarray(np.linalg.norm(columns, axis=1).min(axis=0) * np.sqrt(len(states) / len(sample)))

    def _chosen_prior(self, parameter: Parameter) -> Prior | None:
        prior = self.chosen_priors.get(parameter.symbol)
        if prior is not None and not isinstance(prior, Prior):
            raise InputError(f"{parameter.symbol}: a prior must be one such as tissuq.Uniform(0, 1), not {prior!r}.")
        if isinstance(prior, Flat) and not parameter.is_linear:
            raise InputError(f"{parameter.symbol}: a flat prior is improper and only serves linear parameters.")
        try:
            return prior.within(support(parameter, self.experiment)) if prior else None
        except InputError as error:
            raise InputError(f"{parameter.symbol}: {error}") from error

    def _default_boxes(self) -> dict[str, Prior]:
        material_count = sum(p.is_linear for p in self.material.parameters)
        shortest = self._shortest_columns() if self.bent_symbols else None
        return default_boxes(
            [p for p in self.parameters if p.is_linear], material_count, self.statistics.triangle, shortest
        )

    def _check_priors(self) -> None:
        for symbol in self.chosen_priors:
            if symbol not in self.symbols:
                raise InputError(
                    f"there is a prior for '{symbol}', but the parameters of this model are {', '.join(self.symbols)}."
                )
        for parameter in self.parameters:
            if (prior := self._chosen_prior(parameter)) and prior.problem:
                raise ModelError(f"{parameter.symbol}: the prior {prior} cannot be used: {prior.problem}.")

    def _check_data(self) -> None:
        n, name = self.experiment.size, self.experiment.name
        from_data = [symbol for symbol in self.symbols if symbol not in self.energy_symbols]  # not by priors alone
        if n < len(from_data) or (self.energy_symbols and n <= len(self.column_symbols)):
            raise InputError(
                f"experiment '{name}' has {n} measurements for {len(from_data)} parameters "
                f"({', '.join(from_data)}): measure more, or choose a simpler material or discrepancy."
            )
        empty = next((test.name for test in self.experiment.tests if not test.stress.any()), None)
        if empty is not None:
            raise InputError(f"experiment '{empty}': every stress is zero, so there is nothing to identify.")
        for curve in self.experiment.curves:
            ends = curve.path.at([curve.points.min(axis=0), curve.points.max(axis=0)])
            check_linearity(self.material, ends, self.usual_bent)
        check_separable(self.statistics.triangle[:, :-1], name, self.column_symbols)
        if self.energy_symbols and not self.material.is_isotropic:
            check_angles(self.material, self.discrepancy, self.experiment, self.usual_bent)


def _basis(material: Material, discrepancy: Discrepancy, states: States, bent: ArrayLike) -> FloatArray:
    of_material, of_discrepancy = stress_basis(material, states, bent), discrepancy.mean_basis(states)
    count = sum(parameter.is_linear for parameter in discrepancy.parameters)
    if of_discrepancy.ndim < 2 or of_discrepancy.shape[-1] != count:
        raise ModelError(
            f"discrepancy '{discrepancy.name}': mean_basis has the shape {of_discrepancy.shape}, not a column for each "
            f"of its linear parameters ({count})."
        )
    if not np.isfinite(of_discrepancy).all():
        raise ModelError(f"discrepancy '{discrepancy.name}': mean_basis is not finite everywhere.")
    shape = (*of_material.shape[:-1], of_discrepancy.shape[-1])
    return np.concatenate([of_material, np.broadcast_to(of_discrepancy, shape)], axis=-1)


_remembered_basis = lru_cache(maxsize=64)(_basis)
_remembered_stress_basis = lru_cache(maxsize=64)(stress_basis)


# The same for every noise, lag and tolerance of the same tests, of which the errors are estimated.


@lru_cache(maxsize=64)
def _remembered_members(discrepancy: EnergyDiscrepancy, states: States) -> tuple[Member, ...]:
    return tuple(discrepancy.members(states))


def _features(block: EnergyBlock, states: States, reach: tuple[float, float], length: float) -> FloatArray:
    return block.stress_features(states, reach, length)


_remembered_features = lru_cache(maxsize=256)(_features)
