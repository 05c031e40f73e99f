"""A draw of a posterior, or any isotropic material with values, as a material of FElupe."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tissuq.errors import InputError
from tissuq.finite_elements.distortional import distortional_energy
from tissuq.finite_elements.tensors import first_piola_kirchhoff, tangent, volumetric_stress, volumetric_tangent
from tissuq.mechanics import Material

__all__ = ["FElupeMaterial"]

FloatArray = NDArray[np.float64]


class FElupeMaterial:
    """W(J^(-1/3) l1, J^(-1/3) l2, J^(-1/3) l3) + K/2 (J - 1)^2 with the methods that FElupe asks of a material.

    It goes into `felupe.SolidBody`; without a bulk modulus, when it is the distortional part alone, into
    `felupe.SolidBodyNearlyIncompressible` or `felupe.NearlyIncompressible`, which have a bulk modulus of their own;
    and with one into `felupe.ThreeFieldVariation`. It needs nothing of FElupe itself.

    Parameters
    ----------
    material : Material
        A draw of `Posterior.ensemble`, with the discrepancy in its energy, or any isotropic material.
    bulk_modulus : float
        K in MPa; zero for the distortional part alone.
    values : (k,) array, optional
        The parameters of a material that is no draw, in its order.
    unit : float
        MPa in which stresses are given: 1, or 0.001 for a mesh whose loads are in kPa.

    Raises
    ------
    InputError, ModelError
        When the bulk modulus is negative, the material has fibres, or values are missing.

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
    """

    def __init__(
        self, material: Material, bulk_modulus: float = 0.0, values: ArrayLike | None = None, unit: float = 1.0
    ) -> None:
        if not 0 <= bulk_modulus < np.inf or not 0 < unit < np.inf:
            raise InputError(f"a bulk modulus is zero or a positive number of MPa, not {bulk_modulus!r}.")
        self.energy = distortional_energy(material, values)
        self.bulk_modulus = float(bulk_modulus)
        self.unit = float(unit)
        self.x: list[FloatArray] = [np.eye(3), np.zeros(0)]
        """Shapes of what it is called with: a gradient, and no state variables."""

    def gradient(self, x: Sequence[Any]) -> list[Any]:
        """Return [P, state variables], the first Piola-Kirchhoff stress (3, 3, ...) at [F, state variables]."""
        F, shape = _points(x[0])
        found = first_piola_kirchhoff(self.energy.derivatives, F)
        if self.bulk_modulus:
            found += volumetric_stress(self.bulk_modulus, F)
        return [(found / self.unit).reshape(3, 3, *shape), x[-1]]

    def hessian(self, x: Sequence[Any]) -> list[Any]:
        """Return [dP/dF], (3, 3, 3, 3, ...), at [F, state variables]."""
        F, shape = _points(x[0])
        found = tangent(self.energy.derivatives, F)
        if self.bulk_modulus:
            found += volumetric_tangent(self.bulk_modulus, F)
        return [(found / self.unit).reshape(3, 3, 3, 3, *shape)]

    def function(self, x: Sequence[Any]) -> list[Any]:
        """Return [W], the energy (...) at [F, state variables]."""
        F, shape = _points(x[0])
        stretches = np.linalg.svd(np.moveaxis(F, -1, 0), compute_uv=False).T
        found = self.energy(stretches) + self.bulk_modulus / 2 * (stretches.prod(axis=0) - 1) ** 2
        return [(found / self.unit).reshape(shape)]


def _points(F: Any) -> tuple[FloatArray, tuple[int, ...]]:
    """Return gradients (3, 3, n) and the shape of what n counts."""
    given = np.asarray(F, dtype=np.float64)
    return given.reshape(3, 3, -1), given.shape[2:]
