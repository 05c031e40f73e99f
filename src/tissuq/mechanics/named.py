"""Materials by name: those of the library, their parametrised families, sums, and those of other packages."""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import Any

from tissuq.errors import ModelError
from tissuq.mechanics.fibres import FibreMaterial
from tissuq.mechanics.material import Material
from tissuq.mechanics.materials.ogden import Ogden
from tissuq.mechanics.materials.polynomial import Rivlin
from tissuq.mechanics.materials.sums import added
from tissuq.mechanics.user_law import LAW, as_material, load_material
from tissuq.registry import find, variants

__all__ = ["FORMS", "GROUP", "material_named", "plugins"]

GROUP = "tissuq.materials"
"""The entry points through which other packages add materials."""
FAMILIES = Rivlin, Ogden, FibreMaterial
SUMS = {
    "standard-reinforcing": "neo-hookean+standard-fibres",
    "holzapfel-gasser-ogden": "neo-hookean+exponential-fibres",
    "gasser-ogden-holzapfel": "neo-hookean+dispersed-fibres",
}
"""Sums that have a name in the literature."""
FORMS = (
    *(family.form for family in FAMILIES),
    *(f"{name} ({parts})" for name, parts in SUMS.items()),
    "gent+mooney-rivlin (a sum of any)",
    "law.py:Name (a law of your own)",
)
"""What names can be, beside those of the list."""


def material_named(material: str | Material, *, laws: bool = False) -> Material:
    """Return the material of that name; a material is returned as it is.

    Parameters
    ----------
    material : str or Material
    laws : bool
        Whether the name may be that of a law in a file, which is then run: only where a person has given it.

    Raises
    ------
    ModelError
        When no material has that name, or a sum has a parameter twice.
    InputError
        When a law in a file cannot be used.

    Examples
    --------
    >>> [p.symbol for p in material_named("gent+rivlin:C01,C11").parameters]
    ['mu', 'Jm', 'C01', 'C11']
    """
    if isinstance(material, Material):
        return material
    names = [SUMS.get(part.strip(), part) for part in material.split("+")]
    parts = [_single(part.strip(), laws) for part in "+".join(names).split("+")]
    return added(*parts) if len(parts) > 1 else parts[0]


def _single(name: str, laws: bool) -> Material:
    if LAW.fullmatch(name):
        if laws:
            return load_material(name)
        raise ModelError(
            f"'{name}' is a law in a file, which is run only where you name it yourself: give it with --material on "
            "the command line, or tissuq.load_material(...) in Python."
        )
    for family in FAMILIES:
        found = family.named(name)
        if found is not None:
            return found
    if name not in variants(Material):
        for point in entry_points(group=GROUP, name=name):
            return _loaded(point)
    return find(Material, "material", name, ModelError)()


def plugins() -> list[Material]:
    """Return the materials that other packages add.

    Raises
    ------
    ModelError
        When one of them cannot be used.
    """
    return [_loaded(point) for point in entry_points(group=GROUP)]


def _loaded(point: Any) -> Material:
    try:
        return as_material(point.load(), point.value)
    except Exception as error:
        raise ModelError(
            f"the material '{point.name}' of another package ({point.value}) cannot be used: {error}. Repair or "
            "uninstall that package."
        ) from error
