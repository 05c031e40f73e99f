"""The result file of ANSYS (``.rst``), by the library ansys-mapdl-reader."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tissuq.decks.result_file import AS_TENSOR, ResultFile, Values
from tissuq.errors import InputError

__all__ = ["AnsysResults"]

FloatArray = NDArray[np.float64]

WRITTEN = {"U": ("NSL", "ptrNSL"), "RF": ("RF", "ptrRF"), "S": ("ENS", "ptrESL")}
"""What the library calls a field that was written, and the place in a state where it begins, zero without it."""
NOT_CONVERGED = 999999
"""The substep under which ANSYS writes the state in which it gave up."""


class AnsysResults(ResultFile):
    """ANSYS's result file; stresses are the means at a corner over the elements that meet there.

    The strains in it are logarithmic ones, not Green's. Sets are the components in the file, else those of the deck
    (``CMBLOCK``).
    """

    name = "ansys"
    suffixes = (".rst",)
    requests = {  # noqa: RUF012  (as in the base class)
        "U": "OUTRES,NSOL,ALL",
        "RF": "OUTRES,RSOL,ALL",
        "S": "OUTRES,STRS,ALL",
    }

    @cached_property
    def content(self) -> Any:
        """The file as the library reads it."""
        try:
            from ansys.mapdl import reader
        except ImportError as error:
            raise InputError(
                f"to read {self.label}, install tissuq with its extra 'ansys' (the library ansys-mapdl-reader), or "
                "give the quantity by a function of yours, NAME=file.py:function."
            ) from error
        try:
            return reader.read_binary(str(self.path))
        except Exception as error:  # whatever the library raises for what it does not know
            raise InputError(f"{self.label} cannot be read ({type(error).__name__}: {error}).") from error

    @cached_property
    def nodes(self) -> NDArray[np.int64]:
        return np.sort(np.asarray(self.content.mesh.nnum, dtype=np.int64))

    @cached_property
    def node_sets(self) -> Mapping[str, set[int]]:
        components = self.content.node_components.items()
        in_file = {name.upper(): {int(node) for node in members} for name, members in components}
        return {**self.results.node_sets, **in_file}

    @cached_property
    def _converged(self) -> list[int]:
        """Places of the states that converged."""
        substeps = np.asarray(self.content._resultheader["ls_table"])[:, 1]
        times = self.content.time_values
        return [
            number
            for number, (time, substep) in enumerate(zip(times, substeps, strict=False))
            if substep != NOT_CONVERGED and self.results.reach(time)
        ]

    def field(self, kind: str) -> Values | None:
        if kind not in WRITTEN or not self.content.available_results[WRITTEN[kind][0]]:
            return None
        numbers = [number for number in self._converged if self.content._solution_header(number)[WRITTEN[kind][1]]]
        if not numbers:
            return None
        read = {"U": self._displacements, "RF": self._reactions, "S": self._stresses}[kind]
        times = np.array([self.content.time_values[number] for number in numbers], dtype=np.float64)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of the libraries that the reader uses
            return Values(times, np.array([read(number) for number in numbers]))

    def of_set(self, kind: str, set_name: str, how: str) -> Values | None:
        """Return a field at the members of a set; of stresses, which are at corners alone, at those members."""
        values = super().of_set(kind, set_name, how)
        if values is None or kind != "S":
            return values
        is_corner = np.isfinite(values.values).all(axis=(0, 2))
        return Values(values.times, values.values[:, is_corner if is_corner.any() else slice(None)])

    def _displacements(self, number: int) -> FloatArray:
        numbers, values = self.content.nodal_displacement(number)
        in_space = np.zeros((len(values), 3))
        in_space[:, : min(3, values.shape[1])] = values[:, :3]
        return self._spread(numbers, in_space)

    def _stresses(self, number: int) -> FloatArray:
        numbers, values = self.content.nodal_stress(number)
        return self._spread(numbers, values[:, AS_TENSOR])

    def _reactions(self, number: int) -> FloatArray:
        """Return the forces, which are zero where a node is free; moments and other degrees of freedom are left out."""
        forces, numbers, freedoms = self.content.nodal_reaction_forces(number)
        reactions = np.zeros((len(self.nodes), 3))
        is_force = np.isin(freedoms, (1, 2, 3))
        rows = np.searchsorted(self.nodes, numbers[is_force])
        np.add.at(reactions, (rows, np.asarray(freedoms)[is_force] - 1), forces[is_force])
        return reactions

    def _spread(self, numbers: NDArray[Any], values: FloatArray) -> FloatArray:
        """Return values at all nodes, from those at some of them."""
        at_all_nodes = np.full((len(self.nodes), values.shape[1]), np.nan)
        at_all_nodes[np.searchsorted(self.nodes, numbers)] = values
        return at_all_nodes
