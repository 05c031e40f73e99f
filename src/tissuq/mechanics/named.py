"""Materials by name: those of the library, their parametrised families, sums, and those of other packages."""

from __future__ import annotations

from tissuq.errors import InputError, ModelError
from tissuq.mechanics.laws.fibres import FibreMaterial
from tissuq.mechanics.laws.polynomial import Rivlin
from tissuq.mechanics.laws.separable import Ogden
from tissuq.mechanics.material import SUMS, Material, MaterialSum
from tissuq.mechanics.user_law import UserCode, as_material, load_material
from tissuq.registry import find, load_plugins, variants

FAMILIES = Rivlin, Ogden, FibreMaterial
FORMS = (
    *(family.form for family in FAMILIES),
    *(f"{name} ({summands})" for name, summands in SUMS.items()),
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
        When no material has that name, it is neither a name nor a material, or a sum has a parameter twice.
    InputError
        When a law in a file cannot be used.

    Examples
    --------
    >>> [p.symbol for p in material_named("gent+rivlin:C01,C11").parameters]
    ['mu', 'Jm', 'C01', 'C11']
    """
    if isinstance(material, Material):
        return material
    if not isinstance(material, str):
        made = f": make one of the class, {material.__name__}(...)" if isinstance(material, type) else ""
        raise ModelError(
            f"material must be a name, such as 'yeoh', or an object of tissuq.Material, not {material}{made}."
        )
    names = [SUMS.get(name.strip(), name) for name in material.split("+")]
    summands = [_single(name.strip(), laws) for name in "+".join(names).split("+")]
    return MaterialSum.of(*summands) if len(summands) > 1 else summands[0]


def standard_name(name: str) -> str:
    """Return the name under which runs have the material of that name; another text as it is.

    Examples
    --------
    >>> standard_name("neo-hookean+exponential-fibres"), standard_name("auto")
    ('holzapfel-gasser-ogden', 'auto')
    """
    try:
        return material_named(name).name
    except (ModelError, InputError):
        return name


def _single(name: str, laws: bool) -> Material:
    if UserCode.named(name):
        if laws:
            return load_material(name)
        raise ModelError(
            f"'{name}' is a law in a file, which is run only where you name it yourself: give it with --material on "
            "the command line, or tissuq.load_material(...) in Python."
        )
    for family in FAMILIES:
        member = family.named(name)
        if member is not None:
            return member
    if name not in variants(Material):
        for plugin in load_plugins(Material.entry_point_group, as_material, name):
            return plugin
    return find(Material, "material", name, ModelError, SUMS)()


def plugins() -> list[Material]:
    """Return the materials that other packages add.

    Raises
    ------
    ModelError
        When one of them cannot be used.
    """
    return load_plugins(Material.entry_point_group, as_material)
