"""Every measured stress of every loading mode as textbooks write it: F, and a component of the nominal stress."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tissuq.experiments.modes import LoadingMode, Path, loading_modes

STRETCH = np.concatenate([np.linspace(0.5, 0.95, 7), np.linspace(1.05, 3.0, 11)])
PAIRS = np.array([[0.6, 0.6], [0.6, 1.5], [0.9, 1.05], [1.0, 1.2], [1.05, 0.95], [1.2, 1.2], [1.6, 0.7], [2.0, 1.9]])
SHEAR = np.array([-2.0, -0.7, -0.1, -1e-3, 1e-3, 0.05, 0.3, 1.0, 3.0])
LARGEST = 15.02
"""Of I1 - 3 at these points, at a stretch of 0.5 or 3 in one of the modes."""


def diagonal(first, second):
    return np.diag([first, second, 1 / (first * second)])


def sheared(shear):
    return np.array([[1, shear, 0], [0, 1, 0], [0, 0, 1]], dtype=float)


TEXTBOOK = {  # points, F, and the row and column of the nominal stresses; the third face is free
    "uniaxial": (STRETCH, lambda x: diagonal(x, x**-0.5), [(0, 0)]),
    "equibiaxial": (STRETCH, lambda x: diagonal(x, x), [(0, 0)]),
    "planar": (STRETCH, lambda x: diagonal(x, 1.0), [(0, 0)]),
    "constrained-uniaxial": (STRETCH, lambda x: diagonal(x, 1.0), [(0, 0), (1, 1)]),
    "biaxial": (PAIRS, lambda x: diagonal(*x), [(0, 0), (1, 1)]),
    "thin-tube": (PAIRS, lambda x: diagonal(*x), [(0, 0), (1, 1)]),
    "inflated-tube": (PAIRS, lambda x: diagonal(*x), [(0, 0)]),
    "simple-shear": (SHEAR, sheared, [(0, 1)]),
    "simple-shear-normal": (SHEAR, sheared, [(0, 1), (1, 1)]),
}


@dataclass(frozen=True, eq=False)
class Measured:
    """One stress: the path it does work along, and what a textbook says of it."""

    mode: LoadingMode
    path: Path
    points: np.ndarray
    gradient: Callable
    component: tuple[int, int]

    def __str__(self):
        return f"{self.mode.name}-{'-'.join(str(1 + axis) for axis in self.component)}"


def every_stress():
    for name, kind in loading_modes().items():
        points, gradient, components = TEXTBOOK[name]
        for path, component in zip(kind().paths, components, strict=True):
            yield Measured(kind(), path, points, gradient, component)


MEASURED = list(every_stress())
