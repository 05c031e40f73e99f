"""Materials: strain-energy densities of the invariants, with named parameters."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

from tissuq.errors import ModelError
from tissuq.parameters import Parameter
from tissuq.registry import find, variants

__all__ = ["Material", "material_named", "materials"]


@dataclass(frozen=True)
class Material(ABC):
    """An isotropic, incompressible hyperelastic material W(I1, I2).

    A new material is one subclass in one file: its name, formula, parameters and energy. The energy is written
    with plain arithmetic and must vanish at I1 = I2 = 3; every stress is its derivative along a loading mode, so no
    material holds a stress formula. `initial_shear_modulus` is 2 (dW/dI1 + dW/dI2) at the reference.
    """

    name: ClassVar[str]
    formula: ClassVar[str]
    source: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]]
    caution: ClassVar[str] = ""
    """What a reader of its parameters must know."""

    @abstractmethod
    def strain_energy(self, I1: Any, I2: Any, values: Any) -> Any:
        """Return the strain energy per undeformed volume (MPa) for parameter values in their order."""


def materials() -> dict[str, type[Material]]:
    """Return every material by name."""
    return variants(Material)


def material_named(material: str | Material) -> Material:
    """Return the material of that name; a material is returned as it is.

    Raises
    ------
    ModelError
        When no material has that name.
    """
    return material if isinstance(material, Material) else find(Material, "material", material, ModelError)()
