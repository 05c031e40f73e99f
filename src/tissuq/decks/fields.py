"""Fields of a run of CalculiX at its end, and the states of its elements against those that were measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tissuq.arrays import FloatArray
from tissuq.decks.calculix_results import Frd, tensor_of
from tissuq.decks.quantity import Curve, von_mises


@dataclass(frozen=True)
class FinalFields:
    """The mesh of a model and the fields of a run at its last time.

    Attributes
    ----------
    points : (n, 3) array
    cells : mapping of int to (c, k) int array
        By the type of ``.frd``.
    materials : (e,) array of str
        Of every element, in the order of ``cells``, in capitals.
    displacement : (n, 3) array
    von_mises : (n,) array
        Empty where no stress was written.
    invariants : (e, 2) array
        I1 - 3 and I2 - 3 of the isochoric deformation of every element; empty where no strain was written.
    """

    points: FloatArray
    cells: Mapping[int, NDArray[np.int64]]
    materials: NDArray[np.str_]
    displacement: FloatArray
    von_mises: FloatArray
    invariants: FloatArray

    def save(self, path: Path) -> None:
        """Write them to an .npz file."""
        arrays = {name: value for name, value in vars(self).items() if name != "cells"}
        arrays |= {f"cells_{kind}": members for kind, members in self.cells.items()}
        np.savez_compressed(path, **arrays)

    @classmethod
    def load(cls, path: Path) -> FinalFields:
        """Return what was saved."""
        with np.load(path) as stored:
            arrays = {name: stored[name] for name in stored.files}
        cells = {int(name[6:]): arrays.pop(name) for name in list(arrays) if name.startswith("cells_")}
        return cls(cells=cells, **arrays)


def final_fields(frd: Frd) -> FinalFields | None:
    """Return the fields at the last time; None where no displacement was written."""
    if not frd.fields.get("DISP"):
        return None
    displacement = np.stack([frd.fields["DISP"][-1][1][name] for name in ("D1", "D2", "D3")], axis=1)
    stress = frd.fields.get("STRESS")
    numbers = [number for _, materials in frd.cells.values() for number in materials]
    return FinalFields(
        frd.points,
        {kind: members for kind, (members, _) in frd.cells.items()},
        np.array([frd.materials.get(int(number), "").upper() for number in numbers], dtype=np.str_),
        displacement,
        von_mises(*tensor_of(stress[-1][1])) if stress else np.zeros(0),
        element_invariants(frd, -1) if frd.fields.get("TOSTRAIN") else np.zeros((0, 2)),
    )


def element_invariants(frd: Frd, step: int) -> FloatArray:
    """Return I1 - 3 and I2 - 3 (e, 2) of elements at a step, of F / J^(1/3), from the Green strains E of their nodes.

    With C = 2 E + 1 and J^2 = det C, I1 = tr C / J^(2/3) and I2 = (tr(C)^2 - tr(C^2)) / (2 J^(4/3)); of an element,
    the mean over its nodes.
    """
    e11, e22, e33, e12, e13, e23 = tensor_of(frd.fields["TOSTRAIN"][step][1])
    right = 2 * np.array([[e11, e12, e13], [e12, e22, e23], [e13, e23, e33]]) + np.eye(3)[:, :, None]
    squared_volume = np.linalg.det(np.moveaxis(right, -1, 0))
    trace, square = np.einsum("iin->n", right), np.einsum("ijn,jin->n", right, right)
    with np.errstate(invalid="ignore"):
        I1_minus_3 = trace / np.cbrt(squared_volume) - 3
        I2_minus_3 = (trace**2 - square) / (2 * np.cbrt(squared_volume) ** 2) - 3
    at_nodes = np.stack([I1_minus_3, I2_minus_3], axis=1)
    return np.concatenate([at_nodes[members].mean(axis=1) for members, _ in frd.cells.values()])


def share_beyond(frd: Frd, limits: Mapping[str, tuple[float, float]]) -> Curve | None:
    """Return the share of elements of some materials whose I1 - 3 or I2 - 3 is larger than any that was measured.

    Parameters
    ----------
    frd : Frd
    limits : mapping of str to (float, float)
        The largest I1 - 3 and I2 - 3 that were measured, by materials in capitals.

    Returns
    -------
    Curve or None
        None where no strain was written, or no element is of these materials.
    """
    steps = frd.fields.get("TOSTRAIN", [])
    names = [frd.materials.get(int(number), "").upper() for _, numbers in frd.cells.values() for number in numbers]
    ends = np.array([limits.get(name, (np.nan, np.nan)) for name in names]).reshape(-1, 2)
    is_ours = np.isfinite(ends[:, 0])
    if not steps or not is_ours.any():
        return None
    shares = [(element_invariants(frd, step) > ends)[is_ours].any(axis=1).mean() for step in range(len(steps))]
    return Curve(np.array([time for time, _ in steps]), np.array(shares))
