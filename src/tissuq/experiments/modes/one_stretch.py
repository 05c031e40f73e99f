"""Modes with one stretch and one stress: uniaxial, equibiaxial, planar."""

from __future__ import annotations

from typing import Any

from tissuq.experiments.modes.mode import LoadingMode

__all__ = ["Equibiaxial", "Planar", "Uniaxial"]


class Uniaxial(LoadingMode):
    """Tension or compression along one axis: F = diag(l, l^-1/2, l^-1/2)."""

    name = "uniaxial"
    description = "tension or compression along one axis"

    def principal_stretches(self, stretch: Any) -> tuple[Any, Any, Any]:
        lateral = stretch**-0.5
        return stretch, lateral, lateral


class Equibiaxial(LoadingMode):
    """Equal stretch along two axes: F = diag(l, l, l^-2)."""

    name = "equibiaxial"
    description = "equal tension along two axes"
    loaded_axes = 2

    def principal_stretches(self, stretch: Any) -> tuple[Any, Any, Any]:
        return stretch, stretch, stretch**-2


class Planar(LoadingMode):
    """Planar tension (pure shear): F = diag(l, 1, 1/l)."""

    name = "planar"
    description = "planar tension (pure shear), one lateral axis held"

    def principal_stretches(self, stretch: Any) -> tuple[Any, Any, Any]:
        return stretch, 1.0, 1.0 / stretch
