"""Material cards read as the codes' manuals describe them, each into an energy of three principal stretches.

Nothing here knows how tissuq writes them. Energies are the isochoric parts, in the unit of the card.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

Energy = Callable[[tuple], complex]


class Read(NamedTuple):
    """A law's name in the code, its energy, and the bulk modulus at the reference."""

    law: str
    energy: Energy
    bulk: float


def invariants(stretches):
    one, two, three = (each * each for each in stretches)
    return one + two + three - 3, one * two + two * three + three * one - 3


def polynomial(coefficients):
    """Return the energy of ((i, j), C_ij) pairs."""

    def energy(stretches):
        x, y = invariants(stretches)
        return sum(value * x**i * y**j for (i, j), value in coefficients)

    return energy


def powers(pairs):
    """Return the energy of (factor, exponent) pairs."""
    return lambda stretches: sum(factor * (sum(each**power for each in stretches) - 3) for factor, power in pairs)


FULL = {  # the order of coefficients in the manuals of Abaqus, CalculiX and ANSYS
    2: [(1, 0), (0, 1), (2, 0), (1, 1), (0, 2)],
    3: [(1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3)],
    4: [
        (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3),
        (4, 0), (3, 1), (2, 2), (1, 3), (0, 4),
    ],
}  # fmt: skip


def abaqus(text: str) -> Read:
    lines = [line for line in text.splitlines() if line and not line.startswith("**")]
    assert lines[0].startswith("*MATERIAL, NAME=")
    law = lines[1].removeprefix("*HYPERELASTIC, ")
    name, _, order = law.partition(", N=")
    count = int(order or 1)
    rows = [line.split(",") for line in lines[2:]]
    assert all(len(row) == 8 for row in rows[:-1])
    assert len(rows[-1]) <= 8
    numbers = [float(word) for row in rows for word in row]
    reads = {
        "NEO HOOKE": lambda: (polynomial([((1, 0), numbers[0])]), 1, 1),
        "MOONEY-RIVLIN": lambda: (polynomial([((1, 0), numbers[0]), ((0, 1), numbers[1])]), 2, 1),
        "YEOH": lambda: (polynomial([((n + 1, 0), numbers[n]) for n in range(3)]), 3, 3),
        "REDUCED POLYNOMIAL": lambda: (
            polynomial([((n + 1, 0), numbers[n]) for n in range(count)]), count, count,
        ),
        "POLYNOMIAL": lambda: (polynomial(list(zip(FULL[count], numbers, strict=False))), len(FULL[count]), count),
        "OGDEN": lambda: (
            powers([(2 * mu / a**2, a) for mu, a in zip(numbers[0:2 * count:2], numbers[1:2 * count:2], strict=True)]),
            2 * count, count,
        ),
        "VAN DER WAALS": lambda: (van_der_waals(*numbers[:4]), 4, 1),
    }  # fmt: skip
    energy, constants, further = reads[name]()
    assert len(numbers) == constants + further
    assert all(each == 0 or each > 1e15 for each in numbers[constants + 1 :])  # no term, or none to speak of
    return Read(law, energy, 2 / numbers[constants])


def van_der_waals(mu, lambda_m, a, beta):
    def energy(stretches):
        x, y = invariants(stretches)
        mixed = (1 - beta) * x + beta * y
        eta = np.sqrt(mixed / (lambda_m**2 - 3))
        return mu * (-(lambda_m**2 - 3) * (np.log(1 - eta) + eta) - 2 / 3 * a * (mixed / 2) ** 1.5)

    return energy


def ansys(text: str) -> Read:
    lines = [line for line in text.splitlines() if line and not line.startswith("!")]
    label, _, _, _, points, option = lines[0].split(",")
    assert label == "TB"
    numbers = []
    for line in lines[1:]:
        command, start, *words = line.split(",")
        assert command == "TBDATA"
        assert int(start) == len(numbers) + 1
        assert len(words) <= 6
        numbers += map(float, words)
    count = int(points or 1)
    reads = {
        "NEO": lambda: (polynomial([((1, 0), numbers[0] / 2)]), 1, 1),
        "YEOH": lambda: (polynomial([((n + 1, 0), numbers[n]) for n in range(count)]), count, count),
        "MOONEY": lambda: (
            polynomial(list(zip({2: FULL[2][:2], 5: FULL[2], 9: FULL[3]}[count], numbers, strict=False))), count, 1,
        ),
        "OGDEN": lambda: (
            powers([(mu / a, a) for mu, a in zip(numbers[0:2 * count:2], numbers[1:2 * count:2], strict=True)]),
            2 * count, count,
        ),
        "GENT": lambda: (gent(*numbers[:2]), 2, 1),
    }  # fmt: skip
    energy, constants, further = reads[option]()
    assert len(numbers) == constants + further
    assert not any(numbers[constants + 1 :])
    return Read(option, energy, 2 / numbers[constants])


def gent(modulus, limit):
    return lambda stretches: -modulus * limit / 2 * np.log(1 - invariants(stretches)[0] / limit)


def febio(text: str) -> Read:
    (material,) = ElementTree.fromstring(text.encode()).find("Material")
    assert float(material.find("density").text) > 0
    solids = [febio_solid(each) for each in material.findall("solid")]
    if not solids:
        return febio_solid(material)
    assert material.get("type") == "uncoupled solid mixture"
    # FEUncoupledMaterial::Init sets the bulk moduli of solids within a mixture to zero; the mixture has its own.
    bulk = float(material.find("k").text)
    return Read(material.get("type"), lambda stretches: sum(each.energy(stretches) for each in solids), bulk)


def febio_solid(material) -> Read:
    known = {each.tag: float(each.text) for each in material}
    law = material.get("type")

    def numbered(letter):
        return [known[f"{letter}{n}"] for n in range(1, 7) if f"{letter}{n}" in known]

    reads = {
        "Mooney-Rivlin": lambda: polynomial([((1, 0), known["c1"]), ((0, 1), known["c2"])]),
        "Yeoh": lambda: polynomial([((n, 0), value) for n, value in enumerate(numbered("c"), start=1)]),
        "Ogden": lambda: powers([(c / m**2, m) for c, m in zip(numbered("c"), numbered("m"), strict=True)]),
        "Gent": lambda: gent(known["G"], known["Jm"]),
        "Veronda-Westmann": lambda: veronda_westmann(known["c1"], known["c2"]),
    }
    return Read(law, reads[law](), known.get("k", 0.0))


def veronda_westmann(c1, c2):
    def energy(stretches):
        x, y = invariants(stretches)
        return c1 * (np.exp(c2 * x) - 1) - c1 * c2 / 2 * y

    return energy


def ls_dyna(text: str) -> Read:
    lines = [line for line in text.splitlines() if not line.startswith("$")]
    assert (lines[0], lines[-1]) == ("*KEYWORD", "*END")
    keyword, long = lines[1].split(" ")
    assert long == "+"  # fields of 20 columns
    assert re.fullmatch(r"[\w-]+", lines[2])  # the title
    rows = [[line[start : start + 20] for start in range(0, len(line), 20)] for line in lines[3:-1]]
    (_, _, ratio, fitted, _), *others = rows
    assert int(fitted) == 0
    numbers = [[float(word) for word in row] for row in others]
    if keyword == "*MAT_HYPERELASTIC_RUBBER_TITLE":
        (own,) = numbers
        energy = polynomial(list(zip([(1, 0), (0, 1), (1, 1), (2, 0), (0, 2), (3, 0)], own, strict=True)))
        shear = 2 * (own[0] + own[1])
    else:
        assert keyword == "*MAT_OGDEN_RUBBER_TITLE"
        moduli, exponents = numbers
        assert len(moduli) == len(exponents) == 8
        pairs = [(mu, a) for mu, a in zip(moduli, exponents, strict=True) if mu]
        energy, shear = powers([(mu / a, a) for mu, a in pairs]), sum(mu * a for mu, a in pairs) / 2
    nu = float(ratio)
    return Read(keyword, energy, 2 * shear * (1 + nu) / (3 * (1 - 2 * nu)))


READERS = {"abaqus": abaqus, "calculix": abaqus, "ansys": ansys, "febio": febio, "ls-dyna": ls_dyna}

PATHS = {  # principal stretches along a mode, and the axes that carry its stress
    "uniaxial": (lambda x: (x, x**-0.5, x**-0.5), 1),
    "equibiaxial": (lambda x: (x, x, x**-2), 2),
    "planar": (lambda x: (x, 1 + 0 * x, 1 / x), 1),
}


def stress(energy: Energy, mode: str, stretch: np.ndarray) -> np.ndarray:
    """Return the engineering stress by an imaginary step."""
    path, axes = PATHS[mode]
    return energy(path(np.asarray(stretch, dtype=complex) + 1e-30j)).imag / 1e-30 / axes
