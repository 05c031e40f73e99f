"""Simulated tests written as testing machines export them: each layout with what must be read from it.

The curves are those of a neo-Hookean specimen (shear modulus 40 kPa), rounded to the digits that the machine writes.
``python tests/machine_files.py FOLDER`` writes them all into a folder.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

MU = 0.04


def neo_hookean(stretch):
    """Engineering stress (MPa) in uniaxial tension or compression."""
    return MU * (stretch - stretch**-2)


def equibiaxial(stretch):
    return MU * (stretch - stretch**-5)


@dataclass(frozen=True)
class MachineFile:
    """The bytes of a file, how to read it, and the stretches and stresses (MPa) to within the digits written."""

    name: str
    content: bytes
    stretch: np.ndarray
    stress: np.ndarray
    options: dict[str, Any] = field(default_factory=dict)

    def written(self, folder: Path) -> Path:
        path = folder / self.name
        path.write_bytes(self.content)
        return path


def ramp(top=1.4, rows=60):
    return np.linspace(1.0, top, rows)


def cycles(tops: Sequence[float], rows=40):
    """Stretches of loading to each top and unloading to 1, and the cycle of every row."""
    parts = [np.concatenate([ramp(top, rows), ramp(top, rows)[-2:0:-1]]) for top in tops]
    return np.concatenate([*parts, [1.0]]), np.repeat(np.arange(1, len(tops) + 1), [len(p) for p in parts])


def numbered(*columns):
    return enumerate(zip(*columns, strict=True))


def instron() -> MachineFile:
    """Bluehill: specimen properties, a table of results, then the measurements, everything quoted."""
    stretch = ramp()
    force = neo_hookean(stretch) * 10
    head = [
        '"Specimen label","A1"', '"Rate 1","10.00","mm/min"', '"Rectangular : Width","5.00","mm"',
        '"Rectangular : Thickness","2.00","mm"', '"Length","20.00","mm"', '"Results Table 1"',
        '"","Maximum Load","Extension at Maximum Load"', '"","(N)","(mm)"', f'"1","{force.max():.5f}","8.00000"', "",
        '"Time","Extension","Load"', '"(s)","(mm)","(N)"',
    ]  # fmt: skip
    rows = [f'"{i / 10:.3f}","{20 * (s - 1):.5f}","{f:.5f}"' for i, (s, f) in numbered(stretch, force)]
    return MachineFile("instron.csv", "\r\n".join([*head, *rows, ""]).encode(), stretch, force / 10)


def instron_compression() -> MachineFile:
    """Bluehill in compression: extension and load are both positive."""
    stretch = np.linspace(1.0, 0.7, 50)
    force = -neo_hookean(stretch) * np.pi * 16
    head = ["Diameter,8,mm", "Height : none", "", "Time (s),Compressive extension (mm),Compressive load (N)"]
    rows = [f"{i / 10:.1f},{5 * (1 - s):.5f},{f:.5f}" for i, (s, f) in numbered(stretch, force)]
    options = {"compression_positive": True, "dimensions": {"length": "5 mm"}}
    return MachineFile(
        "compression.csv", "\n".join([*head, *rows]).encode(), stretch, neo_hookean(stretch), options
    )  # fmt: skip


def zwick() -> MachineFile:
    """Zwick's testXpert: German, Latin-1, decimal commas, tabs and quotation marks, names and units in two rows."""
    stretch = ramp(rows=80)
    force = neo_hookean(stretch) * 4 * 1.55

    def comma(value: float) -> str:
        return f"{value:.5f}".replace(".", ",")

    head = [
        '"Prüfer"\t"Jörg Mäßig"', '"Probendicke"\t1,55\t"mm"', '"Probenbreite"\t4\t"mm"', '"Einspannlänge"\t25\t"mm"',
        '"Vorkraft"\t0,01\t"N"', "", '"Prüfzeit"\t"Standardkraft"\t"Standardweg"', '"s"\t"N"\t"mm"',
    ]  # fmt: skip
    rows = [f"{comma(i / 5)}\t{comma(f)}\t{comma(25 * (s - 1))}" for i, (s, f) in numbered(stretch, force)]
    return MachineFile("zwick.TXT", "\r\n".join([*head, *rows]).encode("latin-1"), stretch, force / 6.2)


def biotester() -> MachineFile:
    """CellScale's BioTester: two axes in um and mN, preconditioning and test sets, phases beside the cycle."""
    stretch, number = cycles([1.1, 1.1, 1.25], rows=30)
    stretch = stretch[:-1]
    force = equibiaxial(stretch) * 5 * 0.8 * 1e3
    lines = ["SetName,Cycle,Time_S,Temperature,XSize_um,YSize_um,XDisplacement_um,YDisplacement_um,XForce_mN,YForce_mN"]
    for i, (s, n, f) in numbered(stretch, number, force):
        phase = "Stretch" if i % 58 < 30 else "Recover"
        cycle = f"Precondition,{n}-{phase}" if n < 3 else f"Test 1,1-{phase}"
        moved = round(5000 * (s - 1), 3)
        sizes = f"{5000 + moved:.3f},{5100 + moved:.3f},{moved:.3f},{moved:.3f}"
        lines.append(f"{cycle},{i / 5},37.0,{sizes},{f:.3f},{f:.3f}")
    last = np.flatnonzero(number == 3)[:30]
    options = {
        "axis": "x", "mode": "equibiaxial", "cycle": "last", "branch": "loading",
        "dimensions": {"width": "5 mm", "thickness": "800 um"},
    }  # fmt: skip
    return MachineFile(
        "biotesterData.csv", "\n".join(lines).encode(), stretch[last], equibiaxial(stretch[last]), options
    )


C10, C01 = 0.015, 0.005


def mooney_rivlin(stretch):
    """Engineering stresses (MPa) of both axes, (n, 2), at stretches of both (n, 2); C10 and C01 as above."""
    own, other = stretch, stretch[:, ::-1]
    thickness = 1 / (own * other)
    return 2 * (own**2 - thickness**2) * (C10 + C01 * other**2) / own


def biotester_protocols() -> MachineFile:
    """The BioTester with different stretches on its axes, a cycle each: 1:1, 1:0.5 and 0.5:1."""
    there = np.linspace(0.0, 0.25, 31)
    back = np.concatenate([there, there[-2::-1]])
    stretch = np.concatenate([1 + np.outer(back, ratio) for ratio in ((1, 1), (1, 0.5), (0.5, 1))])
    moved, stress = (stretch - 1) * [5000, 5100], mooney_rivlin(stretch)
    force = stress * [5.1 * 1.5, 5.0 * 1.5] * 1e3
    lines = ["SetName,Cycle,Time_S,Temperature,XSize_um,YSize_um,XDisplacement_um,YDisplacement_um,XForce_mN,YForce_mN"]
    for i, (u, f) in numbered(moved, force):
        phase = "Stretch" if i % 61 < 31 else "Recover"
        sizes = f"{5000 + u[0]:.3f},{5100 + u[1]:.3f},{u[0]:.3f},{u[1]:.3f}"
        lines.append(f"Test,{i // 61 + 1}-{phase},{i / 5},37.0,{sizes},{f[0]:.3f},{f[1]:.3f}")
    loading = np.arange(len(stretch)) % 61 < 31
    options = {"mode": "biaxial", "branch": "loading", "dimensions": {"thickness": "1.5 mm"}}
    return MachineFile("biaxialData.csv", "\n".join(lines).encode(), stretch[loading], stress[loading], options)


def univert() -> MachineFile:
    """CellScale's UniVert: one axis; the length is the size less the displacement."""
    stretch = ramp(rows=50)
    force = neo_hookean(stretch) * 12
    rows = [f"Pull,1-Stretch,{i / 5},{15 * s:.5f},{15 * (s - 1):.5f},{f:.5f}" for i, (s, f) in numbered(stretch, force)]
    lines = ["SetName,Cycle,Time_S,Size_mm,Displacement_mm,Force_N", *rows]
    return MachineFile(
        "univertData.csv", "\n".join(lines).encode(), stretch, force / 12, {"dimensions": {"area": "0.12 cm2"}}
    )


def wintest() -> MachineFile:
    """ElectroForce's WinTest: a NUL ends the first line, commas end all others, three cycles, slack before each."""
    stretch, _ = cycles([1.3, 1.3, 1.3], rows=50)
    taut = 1.04
    force = np.where(stretch > taut, neo_hookean(np.maximum(stretch / taut, 1.0)), 0.0) * 6
    head = ['"WinTest export"\0', '"Data file: A1",', '"Elapsed Time ","Disp ","Load ",', '"Sec ","mm ","N ",']
    rows = [f"{i / 50:.3f},{10 * (s - 1):.6f},{f:.6f}," for i, (s, f) in numbered(stretch, force)]
    last = stretch[2 * 98 : 2 * 98 + 50], force[2 * 98 : 2 * 98 + 50]
    first = int(np.argmax(last[1] >= 0.01))
    reference = np.interp(0.01, last[1][first - 1 : first + 1], last[0][first - 1 : first + 1])
    options = {
        "cycle": 3, "branch": "loading", "preload": "0.01 N", "dimensions": {"length": "10 mm", "area": "6 mm2"},
    }  # fmt: skip
    return MachineFile(
        "wintest.txt", "\r\n".join([*head, *rows]).encode(), last[0][first:] / reference, last[1][first:] / 6, options
    )


def mts() -> MachineFile:
    """MTS: text in columns of blanks, names and units in two rows."""
    stretch = ramp(rows=70)
    force = neo_hookean(stretch) * 8
    head = [
        "Test Run 1",
        "Specimen Area:  8.00 mm^2",
        "Gage Length:  30.0 mm",
        "",
        "Crosshead   Load   Time",
        "mm   N   Sec",
    ]
    rows = [f"{30 * (s - 1):12.5f} {f:12.5f} {i / 10:9.3f}" for i, (s, f) in numbered(stretch, force)]
    return MachineFile("mts.txt", "\n".join([*head, *rows]).encode(), stretch, force / 8)


LAYOUTS: dict[str, Callable[[], MachineFile]] = {
    layout.__name__: layout
    for layout in (instron, instron_compression, zwick, biotester, biotester_protocols, univert, wintest, mts)
}

if __name__ == "__main__":
    for layout in LAYOUTS.values():
        print(layout().written(Path(sys.argv[1])))
