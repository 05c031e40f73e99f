"""The statistical model: one joint density of data and parameters on a given experiment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import inf
from numbers import Real
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tissuq.discrepancy import Discrepancy
from tissuq.errors import InputError, ModelError
from tissuq.experiments.experiment import Experiment
from tissuq.mechanics import Material, engineering_stress, stress_basis
from tissuq.parameters import Parameter
from tissuq.priors import Normal, Prior, Uniform

__all__ = ["StatisticalModel"]

FloatArray = NDArray[np.float64]

NOISE = Parameter.scale("noise_sd", "standard deviation of the measurement noise")
BOX_MARGIN = 10.0
"""Default boxes of linear parameters reach this many times further than least squares could."""


@dataclass(frozen=True, eq=False)
class StatisticalModel:
    """measured stress = material(l) + discrepancy(l) + noise, with a prior on every parameter (eq. 15).

    The stress is linear in most parameters (`linear`), and Gaussian in everything else once a few `nonlinear` ones
    are given: the structure that inference rests on.

    Parameters
    ----------
    experiment : Experiment
        The measurements.
    material : Material
        The model whose parameters are wanted.
    discrepancy : Discrepancy
        What it cannot explain.
    noise_sd : float or "unknown"
        Standard deviation of the noise in MPa; unknown makes it a parameter.
    chosen_priors : mapping of str to Prior
        Priors in MPa that replace the defaults.

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
    noise_sd: float | Literal["unknown"] = "unknown"
    chosen_priors: Mapping[str, Prior] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._check_noise()
        self._check_parameters()
        self._check_priors()
        self._check_data()

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Every parameter: of the material, the discrepancy and, when it is unknown, the noise."""
        noise = (NOISE,) if self.noise_sd == "unknown" else ()
        return (*self.material.parameters, *self.discrepancy.parameters, *noise)

    @cached_property
    def priors(self) -> dict[str, Prior]:
        """The prior of every parameter, in MPa and stretch."""
        boxes = self._default_boxes()
        return {
            p.symbol: self._chosen_prior(p) or boxes.get(p.symbol) or self._default_scale_prior(p)
            for p in self.parameters
        }

    @property
    def symbols(self) -> tuple[str, ...]:
        """The symbol of every parameter."""
        return tuple(p.symbol for p in self.parameters)

    @cached_property
    def linear(self) -> tuple[str, ...]:
        """Parameters that can be integrated in closed form: stress linear in them, prior uniform or Gaussian."""
        return tuple(
            p.symbol for p in self.parameters if p.is_linear and isinstance(self.priors[p.symbol], Uniform | Normal)
        )

    @cached_property
    def nonlinear(self) -> tuple[str, ...]:
        """All other parameters, those of a correlation's shape first: they cost most to vary."""
        others = [p.symbol for p in self.parameters if p.symbol not in self.linear]
        return tuple(sorted(others, key=lambda symbol: symbol not in self.discrepancy.shape_symbols))

    @cached_property
    def column_symbols(self) -> tuple[str, ...]:
        """The parameters in which the mean stress is linear, in the order of the columns of `basis`."""
        return tuple(p.symbol for p in self.parameters if p.is_linear)

    @cached_property
    def material_symbols(self) -> tuple[str, ...]:
        """The parameters of the material."""
        return tuple(p.symbol for p in self.material.parameters)

    def basis(self, stretch: FloatArray) -> FloatArray:
        """Return the (n, k) mean stresses of unit parameters `column_symbols` at stretches (n,)."""
        mode = self.experiment.mode
        return np.hstack([stress_basis(self.material, mode, stretch), self.discrepancy.mean_basis(mode, stretch)])

    @cached_property
    def design(self) -> FloatArray:
        """`basis` at the measured stretches."""
        return self.basis(self.experiment.stretch)

    def noise_variance(self, values: Mapping[str, Any]) -> Any:
        """Return the variance of the measurement noise, MPa^2."""
        return (values["noise_sd"] if self.noise_sd == "unknown" else self.noise_sd) ** 2

    def white_variance(self, values: Mapping[str, Any]) -> Any:
        """Return the variance of everything independent from point to point: noise and discrepancy, MPa^2."""
        return self.noise_variance(values) + self.discrepancy.independent_variance(values)

    @property
    def confounds_noise(self) -> bool:
        """Whether only the sum of noise and discrepancy variance is in the data."""
        return self.noise_sd == "unknown" and "S" in self.symbols

    def _chosen_prior(self, parameter: Parameter) -> Prior | None:
        prior = self.chosen_priors.get(parameter.symbol)
        if prior is not None and not isinstance(prior, Prior):
            raise InputError(f"{parameter.symbol}: a prior must be one such as tissuq.Uniform(0, 1), not {prior!r}.")
        try:
            return prior.within(parameter.support) if prior else None
        except InputError as error:
            raise InputError(f"{parameter.symbol}: {error}") from error

    def _default_scale_prior(self, parameter: Parameter) -> Prior:
        if parameter.relative_prior is None:
            raise ModelError(f"parameter {parameter.symbol} has no default prior: give one.")
        data = self.experiment
        if parameter.dimension == "stretch" and not np.ptp(data.stretch):
            raise ModelError(
                f"experiment '{data.name}' has one stretch only, so nothing tells the {parameter.description} "
                f"{parameter.symbol}: measure at other stretches, or choose another discrepancy."
            )
        unit = {"stress": np.abs(data.stress).max(), "stretch": np.ptp(data.stretch), "number": 1.0}
        return parameter.relative_prior.scaled(float(unit[parameter.dimension]))

    def _default_boxes(self) -> dict[str, Prior]:
        """Return uniform priors that hold the least-squares solution with a margin, whatever the units.

        |b_j| <= ||row j of pinv(X)|| ||y|| bounds every least-squares coefficient. The material's boxes come from
        its own columns alone, so that they are the same for every discrepancy.
        """
        own = len(self.material.parameters)
        of_material, of_all = (np.linalg.pinv(X) for X in (self.design[:, :own], self.design))
        rows = [*of_material, *of_all[own:]]
        size = float(np.linalg.norm(self.experiment.stress))
        boxes: dict[str, Prior] = {}
        for parameter, row in zip((p for p in self.parameters if p.is_linear), rows, strict=True):
            reach = BOX_MARGIN * float(np.linalg.norm(row)) * size
            low, high = parameter.support
            boxes[parameter.symbol] = Uniform(max(low, -reach), min(high, reach))
        return boxes

    def _check_noise(self) -> None:
        if self.noise_sd == "unknown":
            return
        if not isinstance(self.noise_sd, Real) or self.noise_sd is True or not 0 < self.noise_sd < inf:
            raise InputError(
                f"noise_sd must be a positive number of MPa or 'unknown', not {self.noise_sd!r}. "
                "Noise of zero would make every measurement exact; if you do not know it, say 'unknown'."
            )

    def _check_parameters(self) -> None:
        shared = [p.symbol for p in self.discrepancy.parameters if p.symbol in self.material_symbols]
        if shared:
            raise ModelError(
                f"discrepancy '{self.discrepancy.name}' adds {', '.join(shared)}, which material "
                f"'{self.material.name}' has already: no data can tell the two apart. Choose another of the two."
            )

    def _check_priors(self) -> None:
        for symbol in self.chosen_priors:
            if symbol not in self.symbols:
                raise InputError(
                    f"there is a prior for '{symbol}', but the parameters of this model are {', '.join(self.symbols)}."
                )
        for parameter in self.parameters:
            self._chosen_prior(parameter)

    def _check_linearity(self) -> None:
        """Refuse a material whose stress is not proportional to its parameters, which are all taken to be linear."""
        own = len(self.material.parameters)
        tried = 0.3 + np.random.default_rng(0).random((own, own))
        found = engineering_stress(self.material, self.experiment.mode, self.experiment.stretch, tried)
        expected = tried @ self.design[:, :own].T
        if not np.allclose(found, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max()):
            raise ModelError(
                f"the stress of material '{self.material.name}' is not proportional to its parameters "
                f"({', '.join(self.material_symbols)}), for example because one stands in an exponent; only materials "
                "that are linear in their parameters can be fitted yet."
            )

    def _check_data(self) -> None:
        n, name = len(self.experiment), self.experiment.name
        if n < len(self.parameters):
            raise InputError(
                f"experiment '{name}' has {n} measurements for {len(self.parameters)} parameters "
                f"({', '.join(self.symbols)}): measure more, or choose a simpler material or discrepancy."
            )
        if not self.experiment.stress.any():
            raise InputError(f"experiment '{name}': every stress is zero, so there is nothing to identify.")
        self._check_linearity()
        lengths = np.linalg.norm(self.design, axis=0)
        if not lengths.all() or np.linalg.cond(self.design / lengths) > 1e10:
            raise ModelError(
                f"the stretches of experiment '{name}' cannot separate the parameters "
                f"{', '.join(self.column_symbols)}: measure at more or other stretches, or choose a simpler "
                "material or discrepancy."
            )
