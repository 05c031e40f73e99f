"""FElupe, which is an extra: how its absence is told, and its regions and fields of a mesh."""

from __future__ import annotations

from typing import Any

from tissuq.errors import InputError
from tissuq.finite_elements.case import Mesh

__all__ = ["felupe", "field_on", "region_of"]


def felupe() -> Any:
    """Return FElupe, imported when it is first needed.

    Raises
    ------
    InputError
        When it is not installed.
    """
    try:
        import felupe as library
    except ImportError as error:
        raise InputError(
            "finite elements need FElupe: install tissuq with its extra 'fe' (pip install 'tissuq[fe]')."
        ) from error
    return library


def region_of(mesh: Mesh, kind: str = "", **options: Any) -> Any:
    """Return the region of the cells of a mesh, or one of a further kind, such as ``Boundary``, with its options."""
    library = felupe()
    cells = library.Mesh(mesh.points, mesh.cells, mesh.kind.meshio)
    return getattr(library, f"{mesh.kind.region}{kind}")(cells, **options)


def field_on(region: Any, mesh: Mesh) -> Any:
    """Return displacements on a region of a mesh: of a solid, in plane strain, or around an axis."""
    library = felupe()
    if mesh.is_solid:
        return library.Field(region, dim=3)
    return (library.FieldPlaneStrain if mesh.is_plane else library.FieldAxisymmetric)(region, dim=2)
