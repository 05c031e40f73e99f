"""The statistical model: one joint density of data and parameters on a given experiment."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tissuq.compatibility import check_linearity, check_parts, check_separable
from tissuq.discrepancy import Discrepancy, EnergyDiscrepancy, Member, separated
from tissuq.errors import InputError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import Path
from tissuq.mechanics import Material, stress_basis
from tissuq.mechanics.joint import CURVE, joined
from tissuq.noise import Noise, noise_named, stress_level
from tissuq.parameters import Parameter
from tissuq.priors import Flat, Prior
from tissuq.scales import default_boxes, default_prior, off_zero, support
from tissuq.statistics import CHUNK, Statistics
from tissuq.tolerances import Tolerances
from tissuq.whitening import Whitening, whitening

__all__ = ["StatisticalModel"]

FloatArray = NDArray[np.float64]

BENT_QUANTILES = (0.001, 0.1, 0.5, 0.9, 0.999)
"""Probabilities of the exponents' priors at which the size of a box is judged."""


@dataclass(frozen=True, eq=False)
class StatisticalModel:
    """measured stress = material(l) + discrepancy(l) + noise, with a prior on every parameter (eq. 15).

    The stress is linear in most parameters. Those of them with a flat, uniform or Gaussian prior are `linear`: given
    the few others, the `nonlinear` ones, the posterior is Gaussian, and inference rests on that. The `structure`
    is what costs a factorisation to vary: nonlinear parameters of the material or of a correlation's shape.

    Parameters
    ----------
    experiment : Experiment
        The measurements.
    material : Material
        The model whose parameters are wanted.
    discrepancy : Discrepancy
        What it cannot explain; the model holds it as adapted to material and experiment.
    noise : float, str or Noise
        Standard deviation in MPa, or the name of a noise with parameters (``"unknown"``).
    chosen_priors : mapping of str to Prior
        Priors in MPa that replace the defaults.
    tolerances : Tolerances
        By how much whole tests may be off; nothing, where nothing is said.
    curve : (n,) array, MPa, optional
        About what stress the measurements have without errors, along which tolerances act; `tissuq.fit` finds it.
    level : float, MPa, optional
        About what the sd of all independent errors is (noise and S), by which tolerances are made relative, as
        conjugate priors are; `tissuq.fit` finds it.
    lag : float, optional
        Correlation of the noise of consecutive measurements; `tissuq.fit` finds it for noise that has one.
    known_statistics : Statistics, optional
        `statistics`, where they are known already.

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
    curve: FloatArray | None = None
    level: float | None = None
    lag: float | None = None
    known_statistics: Statistics | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "experiment", joined(self.experiment))
        object.__setattr__(self, "noise", noise_named(self.noise))
        object.__setattr__(self, "discrepancy", separated(self.discrepancy, self.material, self.experiment))
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
        others = [p.symbol for p in self.parameters if p.symbol not in self.linear]
        return tuple(sorted(others, key=lambda symbol: symbol not in self.structure))

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
        return tuple(self.discrepancy.members(self.experiment.mode, self.experiment.stretch))

    @property
    def energy_symbols(self) -> tuple[str, ...]:
        """The amplitudes of an energy discrepancy."""
        is_energy = isinstance(self.discrepancy, EnergyDiscrepancy)
        return tuple(p.symbol for p in self.discrepancy.parameters) if is_energy else ()

    def basis(self, stretch: FloatArray, bent: ArrayLike = (), mode: Path | None = None) -> FloatArray:
        """Return the (n, k) mean stresses of unit parameters `column_symbols` at stretches (n,).

        Where the material has parameters in which its stress is not linear, ``bent`` holds their values: (s,), or
        (m, s) for (m, n, k) mean stresses. ``mode`` is that of the experiment unless another is given.
        """
        if mode is None or self.discrepancy.is_energy or mode == self.experiment.mode:
            return _basis(self.material, self.discrepancy, mode or self.experiment.mode, stretch, bent)
        own = stress_basis(self.material, mode, stretch, bent)  # an error of the stress says nothing of other modes
        return np.pad(own, [(0, 0)] * (own.ndim - 1) + [(0, len(self.column_symbols) - own.shape[-1])])

    @property
    def headline(self) -> str:
        """The parameter that summaries put first: the material's first one."""
        return self.material.parameters[0].symbol

    @cached_property
    def whitening(self) -> Whitening | None:
        """What makes the errors of several tests independent and equal; None where they are so already."""
        if len(self.experiment.parts) == 1 and not self.tolerances and not self.lag:
            return None
        noise_sd, usual = self._noise_of_tests
        parts = self.tolerances, self.curve, self.level, self.lag or 0.0
        return whitening(self.experiment, noise_sd, usual, *parts)

    @cached_property
    def _noise_of_tests(self) -> tuple[FloatArray, float]:
        """The noise (tests,) of every test as known or about, MPa, and its geometric mean."""
        noise_sd = self.noise.of_tests(self.experiment)
        usual = float(np.exp(np.log(noise_sd).mean()))
        return np.full(len(noise_sd), usual) if self.noise.depends_on_level else noise_sd, usual

    @property
    def common_error(self) -> float:
        """The relative standard deviation of the error of stress that all measurements have in common.

        It is not in the data: everything that is inferred is the tissue's stress times it, and so are `column_symbols`.
        """
        return self.tolerances.in_common(self.experiment)

    @property
    def is_joint(self) -> bool:
        """Whether measurements belong together in more than the material: several tests, or errors of a whole one."""
        return self.experiment.stretch.ndim > 1 or self.whitening is not None

    def white(self, columns: Any) -> Any:
        """Return columns (n,) or (n, k) of the measurements in units in which their errors are independent and equal.

        Everything that inference sees of the data is whitened.
        """
        return columns if self.whitening is None else self.whitening(columns)

    def relative_noise(self, points: FloatArray) -> Any:
        """Return the noise over noise_sd at points (g,) or rows (g, 14): that of the test; one where there is none."""
        if self.whitening is None or len(self.experiment.parts) == 1:
            return 1.0
        noise_sd, usual = self._noise_of_tests
        of_curve = [own for part, own in zip(self.experiment.parts, noise_sd, strict=True) for _ in part.mode.channels]
        return np.append(np.array(of_curve) / usual, 1.0)[points[:, CURVE].astype(int)]

    @property
    def log_whitening(self) -> float:
        """What whitening adds to the log density of the data."""
        return 0.0 if self.whitening is None else self.whitening.log_determinant

    @cached_property
    def stress(self) -> FloatArray:
        """The measured stresses (n,), whitened."""
        return np.asarray(self.white(self.experiment.stress))

    @cached_property
    def design(self) -> FloatArray:
        """`basis` at the measurements, whitened; at the medians of the priors where it depends on parameters."""
        if len(self.experiment) > CHUNK or self.is_joint:
            return self.design_at(self.usual_bent)
        key = self.experiment.stretch.tobytes()
        return _remembered_basis(self.material, self.discrepancy, self.experiment.mode, key, self.usual_bent)

    def design_at(self, bent: ArrayLike) -> FloatArray:
        """Return `basis` (n, k) at the measurements, whitened, at values (s,) of `bent_symbols`."""
        return np.asarray(self.white(self.basis(self.experiment.stretch, bent)))

    def energy_features(self, place: int) -> list[FloatArray]:
        """Return the stresses (n, r) of each block's terms of a member at the measurements, whitened."""
        features = self.energy_members[place].stress_features(self.experiment.mode, self.experiment.stretch)
        return [np.asarray(self.white(each)) for each in features]

    @cached_property
    def statistics(self) -> Statistics:
        """The data and `design`, reduced in one pass."""
        return self.known_statistics or Statistics.of_rows(self._rows())

    def with_more(self, experiment: Experiment) -> StatisticalModel:
        """Return the same model of this experiment and further measurements, at a cost that only these set.

        Raises
        ------
        InputError
            When the further measurements are in another loading mode.
        """
        both = self.experiment.joined(experiment)
        if self.is_joint or self.tolerances or self.noise.is_consecutive:
            return replace(self, experiment=both, known_statistics=None, curve=None, level=None, lag=None)
        rows = np.column_stack([self.basis(experiment.stretch, self.usual_bent), experiment.stress])
        return replace(self, experiment=both, known_statistics=self.statistics.joined(Statistics.of_rows([rows])))

    def noise_variance(self, values: Mapping[str, Any], level: Any) -> Any:
        """Return the variance (MPa^2) of the measurement noise where the absolute stress has a level (MPa)."""
        return self.noise.sd(values, level) ** 2

    def white_variance(self, values: Mapping[str, Any], level: Any = 0.0) -> Any:
        """Return the variance (MPa^2) of all that is independent from measurement to measurement."""
        own = 0.0 if self.is_repeated else self.discrepancy.independent_variance(values)
        return self.noise_variance(values, level) + own

    @cached_property
    def levels(self) -> FloatArray:
        """The level of the stress (n,) at every measurement, MPa, for noise that depends on it."""
        return stress_level(self.experiment)

    @property
    def is_correlated(self) -> bool:
        """Whether the discrepancy at one measurement tells something about another."""
        return self.discrepancy.is_correlated or self.is_repeated

    @property
    def has_directions(self) -> bool:
        """Whether errors are independent along directions that the size of noise and discrepancy leave alone."""
        return not (self.is_correlated and self.noise.depends_on_level)

    @cached_property
    def is_repeated(self) -> bool:
        """Whether measurements at one stretch share an otherwise independent discrepancy."""
        is_only_scattered = self.discrepancy.is_scattered and not self.discrepancy.is_correlated
        return self.noise.shares_discrepancy and is_only_scattered

    def correlated_variance(self, values: Mapping[str, Any]) -> Any:
        """Return the variance (MPa^2) of the correlated part of the discrepancy."""
        part = self.discrepancy.independent_variance if self.is_repeated else self.discrepancy.correlated_variance
        return part(values)

    def correlation(self, first: Any, second: Any, values: Mapping[str, Any]) -> Any:
        """Return the (n, m) covariance of the correlated part between two sets of stretches, over its variance."""
        if self.is_repeated:
            return 1.0 * (first[:, None] == second[None, :])
        return self.discrepancy.correlation(first, second, values)

    def relative_variance(self, stretch: Any, values: Mapping[str, Any]) -> Any:
        """Return the (n,) diagonal of `correlation`."""
        return self.discrepancy.relative_variance(stretch, values)

    @property
    def confounds_noise(self) -> bool:
        """Whether only the sum of noise and discrepancy variance is in the data, whatever they are."""
        is_one_level = not self.noise.depends_on_level and not self.noise.shares_discrepancy
        return bool(self.noise.parameters) and is_one_level and self.discrepancy.is_scattered

    def _rows(self) -> Iterator[FloatArray]:
        """Yield the rows [X y], block by block; every block has one length, so that JAX compiles once."""
        stretch, stress = self.experiment.stretch, self.experiment.stress
        if len(stress) <= CHUNK or self.is_joint:
            yield np.column_stack([self.design, self.stress])
            return
        for start in range(0, len(stress), CHUNK):
            block = slice(start, start + CHUNK)
            count = len(stress[block])
            basis = self.basis(np.pad(stretch[block], (0, CHUNK - count), mode="edge"), self.usual_bent)
            yield np.column_stack([basis[:count], stress[block]])

    @cached_property
    def usual_bent(self) -> tuple[float, ...]:
        """The medians of the priors of `bent_symbols`; off zero, where a law may divide by it."""
        return tuple(off_zero(prior, 0.5) for prior in self._bent_priors())

    def _bent_priors(self) -> list[Prior]:
        own = {p.symbol: p for p in self.material.parameters}
        return [self._chosen_prior(own[s]) or default_prior(own[s], self.experiment) for s in self.bent_symbols]

    def _shortest_columns(self) -> FloatArray:
        """Return the least lengths of the material's columns over the priors of `bent_symbols`, for this many data."""
        stretch = self.experiment.stretch
        some = stretch if self.is_joint else stretch[:: max(1, len(stretch) // CHUNK)]
        bent = np.array([[off_zero(prior, q) for prior in self._bent_priors()] for q in BENT_QUANTILES])
        bases = stress_basis(self.material, self.experiment.mode, some, bent)
        columns = np.array([self.white(basis) for basis in bases])
        return np.asarray(np.linalg.norm(columns, axis=1).min(axis=0) * np.sqrt(len(stretch) / len(some)))

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
        own = sum(p.is_linear for p in self.material.parameters)
        shortest = self._shortest_columns() if self.bent_symbols else None
        return default_boxes([p for p in self.parameters if p.is_linear], own, self.statistics.triangle, shortest)

    def _check_priors(self) -> None:
        for symbol in self.chosen_priors:
            if symbol not in self.symbols:
                raise InputError(
                    f"there is a prior for '{symbol}', but the parameters of this model are {', '.join(self.symbols)}."
                )
        for parameter in self.parameters:
            self._chosen_prior(parameter)

    def _check_data(self) -> None:
        n, name = len(self.experiment), self.experiment.name
        told = [symbol for symbol in self.symbols if symbol not in self.energy_symbols]  # not by their priors alone
        if n < len(told) or (self.energy_symbols and n <= len(self.column_symbols)):
            raise InputError(
                f"experiment '{name}' has {n} measurements for {len(told)} parameters "
                f"({', '.join(told)}): measure more, or choose a simpler material or discrepancy."
            )
        empty = next((part.name for part in self.experiment.parts if not part.stress.any()), None)
        if empty is not None:
            raise InputError(f"experiment '{empty}': every stress is zero, so there is nothing to identify.")
        for part in self.experiment.parts:
            for path in part.mode.channels:
                ends = np.array([part.stretch.min(axis=0), part.stretch.max(axis=0)])
                check_linearity(self.material, path, ends.tobytes(), ends.shape, self.usual_bent)
        check_separable(self.statistics.triangle[:, :-1], name, self.column_symbols)


@lru_cache(maxsize=256)
def _remembered_basis(
    material: Material, discrepancy: Discrepancy, mode: Path, stretch: bytes, bent: tuple[float, ...]
) -> FloatArray:
    return _basis(material, discrepancy, mode, np.frombuffer(stretch), bent)


def _basis(
    material: Material, discrepancy: Discrepancy, mode: Path, stretch: FloatArray, bent: ArrayLike
) -> FloatArray:
    own, other = stress_basis(material, mode, stretch, bent), discrepancy.mean_basis(mode, stretch)
    return np.concatenate([own, np.broadcast_to(other, (*own.shape[:-1], other.shape[-1]))], axis=-1)
