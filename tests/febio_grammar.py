"""What FEBio's reader refuses in a ``<Material>`` section, after its source (github.com/febiosoftware/FEBio).

FEBioXML/FEBioMaterialSection3.cpp, ``Parse``: the id of a material is the number of those before it plus one, and its
name is not theirs. FEBioMech/FEBioMech.cpp names the types; ``BEGIN_FECORE_CLASS`` in FEMooneyRivlin.cpp, FEYeoh.cpp,
FEOgdenMaterial.cpp, FEGentMaterial.cpp, FEVerondaWestmann.cpp and FEHolzapfelGasserOgden.cpp their parameters and
ranges, and that in FEUncoupledMaterial.cpp ``k`` for all of them, which its ``Init`` wants positive of a material that
is part of no other, and sets to zero of one that is. Nothing here knows how tissuq writes cards.
"""

from __future__ import annotations

from collections.abc import Callable
from xml.etree import ElementTree

ANY: Callable[[float], bool] = lambda value: True  # noqa: E731
POSITIVE: Callable[[float], bool] = lambda value: value > 0  # noqa: E731
NOT_NEGATIVE: Callable[[float], bool] = lambda value: value >= 0  # noqa: E731
NOT_ZERO: Callable[[float], bool] = lambda value: value != 0  # noqa: E731
SIX = range(1, 7)
TYPES = {
    "Mooney-Rivlin": {"c1": ANY, "c2": ANY},
    "Yeoh": {f"c{n}": ANY for n in SIX},
    "Ogden": {f"c{n}": ANY for n in SIX} | {f"m{n}": NOT_ZERO for n in SIX},
    "Gent": {"G": POSITIVE, "Jm": POSITIVE},
    "Veronda-Westmann": {"c1": POSITIVE, "c2": POSITIVE},
    "Holzapfel-Gasser-Ogden": {
        **dict.fromkeys(("c", "k1", "k2"), NOT_NEGATIVE),
        "kappa": lambda value: 0 <= value <= 1 / 3,
        "gamma": ANY,
    },
    "uncoupled solid mixture": {},
}
UNCOUPLED = {"k": lambda value: value >= 0, "density": POSITIVE}
MIXTURE = "uncoupled solid mixture"


def refusals(text: str) -> list[str]:
    """Return what FEBio would refuse or ignore in the materials of a file."""
    section = ElementTree.fromstring(text).find("Material")
    found: list[str] = []
    names: list[str] = []
    for place, material in enumerate(section, start=1):
        if material.tag != "material":
            found.append(f"unknown tag {material.tag}")
            continue
        if material.get("id") != str(place):
            found.append(f"id {material.get('id')} of material {place}")
        if material.get("name") in [None, *names]:
            found.append(f"name {material.get('name')}")
        names.append(material.get("name", ""))
        found += _material(material, is_top=True)
    return found


def _material(element: ElementTree.Element, *, is_top: bool) -> list[str]:
    kind = element.get("type", element.tag)
    if kind not in TYPES:
        return [f"unknown type {kind}"]
    known, found = TYPES[kind] | UNCOUPLED, []
    for child in element:
        if child.tag == "solid" and kind == MIXTURE:
            found += _material(child, is_top=False)
        elif child.tag not in known:
            found.append(f"{kind} has no parameter {child.tag}")
        elif not known[child.tag](float(child.text)):
            found.append(f"{kind}: {child.tag} = {child.text} is out of its range")
    bulk = float(element.findtext("k", "0"))
    if is_top and bulk <= 0:
        found.append(f"{kind}: K must be a positive number")
    if not is_top and bulk:
        found.append(f"{kind}: K should only be defined at the top level")
    return found
