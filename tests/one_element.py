"""Homogeneous deformations of one element in CalculiX, and the same from a strain energy with finite compressibility.

The reference has W of l / J^(1/3) and U = K/2 (J - 1)^2; the stretches of free axes are those of zero stress.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Callable

import numpy as np
from scipy.optimize import root

CCX = shutil.which("ccx")
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
FREE = None
SHEAR = "simple shear"
Load = tuple[float | str | None, ...]


def calculix(card: str, loads: list[Load], folder, orientation: str = "") -> list[float]:
    """Return the engineering stress on axis 1 (or the shear stress) of a cube for each load, from CalculiX.

    The section has an orientation where one is named, which stands behind the card.

    A load is the stretches along the three axes, None where an axis is free, or ("simple shear", amount).
    """
    deck = ["*NODE, NSET=ALL"]
    for place, _ in enumerate(loads):
        deck += [f"{8 * place + n + 1}, {3 * place + x}, {y}, {z}" for n, (x, y, z) in enumerate(CORNERS)]
    deck.append("*ELEMENT, TYPE=C3D8, ELSET=ALL")
    deck += [f"{place + 1}, " + ", ".join(str(8 * place + n + 1) for n in range(8)) for place, _ in enumerate(loads)]
    name = re.search(r"NAME=(\S+)", card)[1]
    section = f"*SOLID SECTION, ELSET=ALL, MATERIAL={name}" + (f", ORIENTATION={orientation}" if orientation else "")
    deck += [card.rstrip(), section, "*STEP, NLGEOM, INC=1000", "*STATIC"]
    deck += ["0.05, 1., 1e-6, 0.1", "*BOUNDARY"]
    for place, load in enumerate(loads):
        deck += [f"{8 * place + n + 1}, {axis}, {axis}, {moved:.12g}" for n, axis, moved in _displacements(load)]
    deck += [
        "*NODE PRINT, NSET=ALL, FREQUENCY=1000",
        "RF",
        "*EL PRINT, ELSET=ALL, FREQUENCY=1000",
        "S",
        "*END STEP",
        "",
    ]
    (folder / "cube.inp").write_text("\n".join(deck))
    done = subprocess.run([CCX, "-i", "cube"], cwd=folder, capture_output=True, text=True, timeout=120, check=False)
    written = folder / "cube.dat"
    assert written.exists(), done.stdout[-2000:]
    last = written.read_text().rpartition("forces (fx,fy,fz)")[2]
    assert "time  0.1000000E+01" in last, done.stdout[-2000:]
    forces, stresses = (_rows(part) for part in last.split("stresses (elem"))
    force = {int(row[0]): row[1] for row in forces}
    shear = {int(row[0]): row[5] for row in stresses}
    return [
        shear[place + 1] if load[0] == SHEAR else sum(force[8 * place + n] for n in (2, 3, 6, 7))
        for place, load in enumerate(loads)
    ]


def reference(energy: Callable, bulk: float, load: Load, axis_of_stress: int = 0) -> float:
    """Return the same stress, or that on another axis, from an energy of principal stretches of product one."""
    if load[0] == SHEAR:
        amount = load[1]
        total = np.sqrt(1 + (amount / 2) ** 2)  # at constant volume, where U plays no part
        step = 1e-30j
        shear = amount + step
        root_of = np.sqrt(1 + shear**2 / 4)
        assert np.isclose(root_of.real, total)
        return float(energy((root_of + shear / 2, root_of - shear / 2, 1.0)).imag / 1e-30)
    given = [1.0 if each is FREE else each for each in load]
    free = [axis for axis, each in enumerate(load) if each is FREE]

    def gradient(stretches: np.ndarray) -> np.ndarray:
        found = []
        for axis in range(3):
            moved = stretches.astype(complex)
            moved[axis] += 1e-30j
            volume = moved.prod()
            whole = energy(tuple(moved / volume ** (1 / 3))) + 0.5 * bulk * (volume - 1) ** 2
            found.append(whole.imag / 1e-30)
        return np.array(found)

    def placed(values: np.ndarray) -> np.ndarray:
        stretches = np.array(given, dtype=float)
        stretches[free] = values
        return stretches

    if not free:
        return float(gradient(placed(np.zeros(0)))[axis_of_stress])
    start = np.prod([each for each in load if each is not FREE]) ** (-1 / len(free))
    found = root(lambda values: gradient(placed(values))[free], np.full(len(free), start), tol=1e-13)
    assert np.abs(gradient(placed(found.x))[free]).max() < 1e-8 * bulk
    return float(gradient(placed(found.x))[axis_of_stress])


def _displacements(load: Load) -> list[tuple[int, int, float]]:
    """Return (corner, axis, displacement) for all that is prescribed."""
    if load[0] == SHEAR:
        return [
            (n, axis, load[1] * y if axis == 1 else 0.0) for n, (_, y, _) in enumerate(CORNERS) for axis in (1, 2, 3)
        ]
    found = []
    for n, corner in enumerate(CORNERS):
        for axis, (place, stretch) in enumerate(zip(corner, load, strict=True), start=1):
            if place == 0 or stretch is not FREE:
                found.append((n, axis, place * (stretch - 1) if place else 0.0))
    return found


def _rows(text: str) -> list[list[float]]:
    lines = (line.split() for line in text.splitlines())
    return [[float(word) for word in line] for line in lines if len(line) in (4, 8) and line[0].isdigit()]
