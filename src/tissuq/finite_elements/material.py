"""A draw of a posterior, or a material with values, as a material of FElupe: its energy, stress and tangent."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tissuq.arrays import FloatArray
from tissuq.errors import InputError, ModelError
from tissuq.finite_elements.energy_derivatives import FibreEnergy, Fibres, gradient, gradient_and_hessian, is_arithmetic
from tissuq.mechanics import FibreMaterial, Material, material_named
from tissuq.mechanics.draws import Continuation, PiecewiseEnergy, sum_of_energies
from tissuq.mechanics.material import MaterialSum
from tissuq.mechanics.stress import differentiator
from tissuq.posterior.ensemble import EnergyDraw


class FElupeMaterial:
    """W(J^(-1/3) l1, J^(-1/3) l2, J^(-1/3) l3) + K/2 (J - 1)^2 with the methods that FElupe asks of a material.

    It goes into `felupe.SolidBody`; without a bulk modulus, when it is the distortional part alone, into
    `felupe.SolidBodyNearlyIncompressible` or `felupe.NearlyIncompressible`, which have a bulk modulus of their own;
    and with one into `felupe.ThreeFieldVariation`. It needs nothing of FElupe itself. The energy of fibres, which
    J^(-1/3) F stretches, is added to that of their matrix.

    Parameters
    ----------
    material : Material
        A draw of `Posterior.ensemble`, with the discrepancy in its energy, or any material, with fibres or without.
    bulk_modulus : float
        K in MPa; zero for the distortional part alone.
    values : (k,) array, optional
        The parameters of a material that is no draw, in its order.
    unit : float
        MPa in which stresses are given: 1, or 0.001 for a mesh whose loads are in kPa.
    directions : (2, 3) or (2, 3, q, c) array
        Unit vectors along axis 1 and axis 2 of the test in the undeformed body, the same everywhere or at every
        quadrature point of every cell: fibres lie at phi and -phi from axis 1 towards axis 2. Unless given, x and y;
        an isotropic material has no use for them.

    Raises
    ------
    InputError, ModelError
        When the bulk modulus is negative, values are missing, fibres have no matrix, or the directions are no two unit
        vectors at a right angle.

    Examples
    --------
    >>> import numpy as np
    >>> import tissuq as tq
    >>> umat = tq.finite_elements.FElupeMaterial(tq.materials()["neo-hookean"](), bulk_modulus=50.0, values=[0.5])
    >>> F = np.diag([2.0, 2**-0.5, 2**-0.5])[:, :, None, None]  # (3, 3, quadrature points, cells)
    >>> P, _ = umat.gradient([F, None])
    >>> stress = P[0, 0] - P[1, 1] * F[1, 1] / F[0, 0]  # the free sides give the pressure
    >>> float(stress[0, 0].round(9)), umat.hessian([F, None])[0].shape
    (1.75, (3, 3, 3, 3, 1, 1))

    Fibres at 0 degrees from axis 1, along x and along y, where they are slack:

    >>> law = tq.mechanics.material_named("neo-hookean+standard-fibres:one@0")
    >>> for axes in ([[1, 0, 0], [0, 1, 0]], [[0, 1, 0], [-1, 0, 0]]):
    ...     umat = tq.finite_elements.FElupeMaterial(law, 50.0, [0.5, 0.8], directions=axes)
    ...     P, _ = umat.gradient([F, None])
    ...     print((P[0, 0] - P[2, 2] * F[2, 2] / F[0, 0]).round(9))
    [[11.35]]
    [[1.75]]
    """

    def __init__(
        self,
        material: Material,
        bulk_modulus: float = 0.0,
        values: ArrayLike | None = None,
        unit: float = 1.0,
        directions: ArrayLike = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    ) -> None:
        if not 0 <= bulk_modulus < np.inf or not 0 < unit < np.inf:
            raise InputError(f"a bulk modulus is zero or a positive number of MPa, not {bulk_modulus!r}.")
        self.energy, fibres = _matrix_and_fibres(material_named(material), values)
        self.fibres = FibreEnergy(fibres, np.asarray(directions, dtype=np.float64)) if fibres else None
        self.bulk_modulus = float(bulk_modulus)
        self.unit = float(unit)
        self.x: list[FloatArray] = [np.eye(3), np.zeros(0)]
        """Shapes of what it is called with: a gradient, and no state variables."""

    def gradient(self, x: Sequence[Any]) -> list[Any]:
        """Return [P, state variables], the first Piola-Kirchhoff stress (3, 3, ...) at [F, state variables]."""
        F, shape = _points(x[0])
        stress = first_piola_kirchhoff(self.energy.slopes, F)
        if self.bulk_modulus:
            stress += volumetric_stress(self.bulk_modulus, F)
        if self.fibres:
            stress += self.fibres.derivative(1, x[0])
        return [(stress / self.unit).reshape(3, 3, *shape), x[-1]]

    def hessian(self, x: Sequence[Any]) -> list[Any]:
        """Return [dP/dF], (3, 3, 3, 3, ...), at [F, state variables]."""
        F, shape = _points(x[0])
        tangents = tangent(self.energy.derivatives, F)
        if self.bulk_modulus:
            tangents += volumetric_tangent(self.bulk_modulus, F)
        if self.fibres:
            tangents += self.fibres.derivative(2, x[0])
        return [(tangents / self.unit).reshape(3, 3, 3, 3, *shape)]

    def function(self, x: Sequence[Any]) -> list[Any]:
        """Return [W], the energy (...) at [F, state variables]."""
        F, shape = _points(x[0])
        stretches = np.asarray(np.linalg.svd(np.moveaxis(F, -1, 0), compute_uv=False).T, dtype=np.float64)
        energy = self.energy(stretches) + self.bulk_modulus / 2 * (stretches.prod(axis=0) - 1) ** 2
        if self.fibres:
            energy += self.fibres.derivative(0, x[0])
        return [(energy / self.unit).reshape(shape)]


def _points(F: Any) -> tuple[FloatArray, tuple[int, ...]]:
    """Return gradients (3, 3, n) and the shape of what n counts."""
    gradients = np.asarray(F, dtype=np.float64)
    return gradients.reshape(3, 3, -1), gradients.shape[2:]


Numbers = tuple[Sequence[Sequence[Any]], PiecewiseEnergy | None, Continuation | None]
"""Everything about a sum of energies on which its derivatives are not compiled."""
Slopes = Callable[[FloatArray], FloatArray]
Derivatives = Callable[[FloatArray], tuple[FloatArray, FloatArray]]

ROUNDING = 1e-9
"""Initial shear modulus over the sum of linear parameters that is nothing but rounding."""
EQUAL_STRETCH_TOLERANCE = 1e-5
"""Relative difference of stretches below which a quotient of differences gives way to its limit: both have errors of
about 1e-10 there, the quotient that of rounding and the limit that of its next term."""


def principal(F: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the principal stretches (3, n) of gradients (3, 3, n), and their axes n_i and N_i as columns (n, 3, 3).

    They are not numbers where the volume is not positive, so that a solver sees that a step was too large.
    """
    matrices = np.moveaxis(F, -1, 0)
    squares, material_axes = np.linalg.eigh(np.swapaxes(matrices, 1, 2) @ matrices)
    with np.errstate(invalid="ignore"):
        stretches = np.where(np.linalg.det(matrices)[:, None] > 0, np.sqrt(squares), np.nan)
    return stretches.T, matrices @ material_axes / stretches[:, None, :], material_axes


def first_piola_kirchhoff(slopes: Slopes, F: FloatArray) -> FloatArray:
    """Return P = sum_i w_i n_i x N_i, (3, 3, n), with w_i = dW/dl_i."""
    stretches, spatial_axes, material_axes = principal(F)
    stress = (spatial_axes * slopes(stretches).T[:, None, :]) @ np.swapaxes(material_axes, 1, 2)
    return np.moveaxis(stress, 0, -1)


def tangent(derivatives: Derivatives, F: FloatArray) -> FloatArray:
    """Return dP/dF, (3, 3, 3, 3, n).

    In the principal axes it has the components A_iijj = d2W/dl_i dl_j and, for i not j, A_ijij = (a + b) / 2 and
    A_ijji = (a - b) / 2, where a = (w_i - w_j) / (l_i - l_j), which becomes d2W/dl_i dl_i - d2W/dl_i dl_j for equal
    stretches, and b = (w_i + w_j) / (l_i + l_j).

    References
    ----------
    Ogden (1997), Non-linear elastic deformations, section 6.1.4.
    """
    stretches, spatial_axes, material_axes = principal(F)
    slopes, curvature = derivatives(stretches)
    components = np.zeros((3, 3, 3, 3, F.shape[-1]))
    for i in range(3):
        components[i, i, i, i] = curvature[i, i]
        for j in range(i):
            a = _quotient(stretches[[i, j]], slopes[[i, j]], curvature[[i, j]][:, [i, j]])
            b = (slopes[i] + slopes[j]) / (stretches[i] + stretches[j])
            components[i, i, j, j] = components[j, j, i, i] = curvature[i, j]
            components[i, j, i, j] = components[j, i, j, i] = (a + b) / 2
            components[i, j, j, i] = components[j, i, i, j] = (a - b) / 2
    axes = np.einsum("nai,nbj->nabij", spatial_axes, material_axes).reshape(-1, 9, 9)
    full = axes @ np.moveaxis(components.reshape(9, 9, -1), -1, 0) @ np.swapaxes(axes, 1, 2)
    return np.asarray(np.moveaxis(full, 0, -1).reshape(components.shape))


def _quotient(stretches: FloatArray, slopes: FloatArray, curvature: FloatArray) -> FloatArray:
    """Return (w_i - w_j) / (l_i - l_j), and its limit where the stretches are nearly equal."""
    difference = stretches[0] - stretches[1]
    is_near = np.abs(difference) < EQUAL_STRETCH_TOLERANCE * stretches[0]
    limit = (curvature[0, 0] + curvature[1, 1] - 2 * curvature[0, 1]) / 2
    return np.asarray(np.where(is_near, limit, (slopes[0] - slopes[1]) / np.where(is_near, 1.0, difference)))


def volumetric_stress(bulk: float, F: FloatArray) -> FloatArray:
    """Return the stress K (J - 1) J F^-T of K/2 (J - 1)^2."""
    J, inverse = _volume(F)
    return np.asarray(bulk * (J - 1) * J * inverse)


def volumetric_tangent(bulk: float, F: FloatArray) -> FloatArray:
    """Return K J ((2 J - 1) F^-T x F^-T - (J - 1) F^-T (il) F^-T), the tangent of K/2 (J - 1)^2."""
    J, inverse = _volume(F)
    outer = np.einsum("ijn,kln->ijkln", inverse, inverse)
    return np.asarray(bulk * J * ((2 * J - 1) * outer - (J - 1) * np.swapaxes(outer, 1, 3)))


def _volume(F: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return J (n,) and F^-T (3, 3, n)."""
    matrices = np.moveaxis(F, -1, 0)
    return np.linalg.det(matrices), np.moveaxis(np.swapaxes(np.linalg.inv(matrices), 1, 2), 0, -1)


@dataclass(frozen=True, eq=False)
class DistortionalEnergy:
    """W(J^(-1/3) l1, J^(-1/3) l2, J^(-1/3) l3) of an isotropic material, J = l1 l2 l3.

    Where an energy must be compiled, its derivatives serve all draws of a posterior: the parameters are arguments.

    Attributes
    ----------
    materials : tuple of Material
        Materials whose energies are added.
    values : tuple of tuple of float
        The parameters of each material.
    discrepancy : PiecewiseEnergy or None
        Energy of the discrepancy.
    continuation : Continuation or None
        Energy beyond the range of the data.
    """

    materials: tuple[Material, ...]
    values: tuple[tuple[float, ...], ...]
    discrepancy: PiecewiseEnergy | None = None
    continuation: Continuation | None = None

    @property
    def _numbers(self) -> Numbers:
        return self.values, self.discrepancy, self.continuation

    def slopes(self, stretches: FloatArray) -> FloatArray:
        """Return the gradient (3, n), MPa, at principal stretches (3, n)."""
        if self._is_arithmetic:
            return gradient(self._of_isochoric, stretches)
        return np.asarray(_compiled(self.materials)[0](self._numbers, stretches))

    def derivatives(self, stretches: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the gradient (3, n) and the Hessian (3, 3, n), MPa, at principal stretches (3, n)."""
        if self._is_arithmetic:
            return gradient_and_hessian(self._of_isochoric, stretches)
        slopes, curvature = _compiled(self.materials)[1](self._numbers, stretches)
        return np.asarray(slopes), np.asarray(curvature)

    def __call__(self, stretches: FloatArray) -> FloatArray:
        """Return the energy (n,), MPa, at principal stretches (3, n)."""
        return np.asarray(self._of_isochoric(tuple(np.asarray(stretches) / np.prod(stretches, axis=0) ** (1 / 3))))

    def _of_isochoric(self, stretches: tuple[Any, Any, Any]) -> Any:
        return sum_of_energies(self.materials, self.values, stretches, self.discrepancy, self.continuation)

    @cached_property
    def _is_arithmetic(self) -> bool:
        return is_arithmetic(self._of_isochoric)

    @property
    def initial_shear_modulus(self) -> float:
        """Half of what the energy's second derivative along l1 - l2 is at the reference, in MPa."""
        _, hessian = self.derivatives(np.ones((3, 1)))
        modulus = float(hessian[0, 0, 0] - hessian[0, 1, 0]) / 2
        terms = sum(
            abs(value)
            for material, numbers in zip(self.materials, self.values, strict=True)
            for parameter, value in zip(material.parameters, numbers, strict=True)
            if parameter.is_linear
        )
        return modulus if abs(modulus) > ROUNDING * terms else 0.0


def distortional_energy(material: Material, values: ArrayLike | None = None) -> DistortionalEnergy:
    """Return the energy of a draw of an ensemble, or of a material with values of its parameters.

    Raises
    ------
    ModelError
        When the material has fibres, or there is not one value for each parameter.
    """
    if not material.is_isotropic:
        raise ModelError(
            f"material '{material.name}' has fibres; these finite elements take isotropic materials only, which depend "
            "on the principal stretches alone. Cards for other programs have fibres (tissuq export RUN), and so has "
            "tissuq.finite_elements.FElupeMaterial for a model of your own in Python."
        )
    return _matrix_and_fibres(material, values)[0]


Part = tuple[Material, tuple[float, ...]]
"""A material with its parameters."""


def _matrix_and_fibres(material: Material, values: ArrayLike | None) -> tuple[DistortionalEnergy, Fibres]:
    """Return the energy of what is isotropic in a material, and its fibres."""
    if isinstance(material, EnergyDraw):
        laws, beside = material.parts, (material.discrepancy, material.continuation)
    else:
        laws, beside = ((material, _complete(material, values)),), (None, None)
    terms = [term for law in laws for term in _parts(*law)]
    fibres = tuple((kind, numbers) for kind, numbers in terms if isinstance(kind, FibreMaterial))
    matrix = [term for term in terms if not isinstance(term[0], FibreMaterial)]
    if not matrix or not all(kind.is_isotropic for kind, _ in matrix):
        raise ModelError(
            f"material '{material.name}' is no sum of an isotropic matrix and fibres, which finite elements need, such "
            "as 'neo-hookean+standard-fibres'."
        )
    kinds, parameters = zip(*matrix, strict=True)
    return DistortionalEnergy(kinds, parameters, *beside), fibres


def _parts(material: Material, values: tuple[float, ...]) -> list[Part]:
    """Return the summands where some are fibres, and otherwise the material as it is."""
    if isinstance(material, MaterialSum) and not material.is_isotropic:
        return material.shares(values)
    return [(material, values)]


def _complete(material: Material, values: ArrayLike | None) -> tuple[float, ...]:
    """Return the values of a material's parameters as numbers, one for each."""
    numbers = tuple(map(float, np.atleast_1d(np.asarray([] if values is None else values, dtype=np.float64))))
    if len(numbers) != len(material.parameters):
        symbols = ", ".join(parameter.symbol for parameter in material.parameters)
        raise ModelError(f"material '{material.name}' needs one value for each of {symbols}, and was given {numbers}.")
    return numbers


@lru_cache(maxsize=64)
def _compiled(materials: tuple[Material, ...]) -> tuple[Any, Any]:
    """Return two compiled functions of numbers and stretches (3, n): the gradients, and these with the Hessians."""
    jax = differentiator()

    def energy(point: Any, numbers: Numbers) -> Any:
        values, discrepancy, continuation = numbers
        isochoric = tuple(point / (point[0] * point[1] * point[2]) ** (1 / 3))
        return sum_of_energies(materials, values, isochoric, discrepancy, continuation)

    slopes, curvature = jax.grad(energy), jax.hessian(energy)
    gradients = jax.vmap(slopes, (1, None), -1)
    joint = jax.vmap(lambda *arguments: (slopes(*arguments), curvature(*arguments)), (1, None), (-1, -1))
    return tuple(
        jax.jit(lambda numbers, stretches, batched=batched: batched(stretches, numbers))
        for batched in (gradients, joint)
    )
