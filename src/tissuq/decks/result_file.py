"""Result files of finite-element programs: one class a program, chosen by the file that a run left."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tissuq.arrays import BoolArray, FloatArray
from tissuq.errors import InputError
from tissuq.registry import plugins, variants

ALL = "ALL"
"""The set of all nodes, where none is named."""
TENSOR = ("11", "22", "33", "12", "13", "23")
"""Components of a tensor, in their order."""

AS_TENSOR = [0, 1, 2, 3, 5, 4]
"""Places of these in a tensor that a program writes as XX, YY, ZZ, XY, YZ, XZ."""
SAME_TIME = 1e-5
"""Relative difference of times that are the same in files with six digits."""

MOST_NAMES = 20
"""Sets that a message lists."""


class Values(NamedTuple):
    """A field over time: times (t,), and its components at nodes or points, (t, rows, 3) of a vector, (t, rows, 6)."""

    times: FloatArray
    values: FloatArray


@dataclass(frozen=True)
class Results:
    """What a solver left in a folder.

    Attributes
    ----------
    folder : Path
    job : str
        Name of the deck without suffix.
    last_time : float
        Up to which it is converged.
    node_sets : mapping of str to set of int
        Of the deck, names in capitals.
    asked : tuple of (str, str)
        Fields (``U``, ``RF``, ``S``, ``E``) and sets that are going to be read, for programs that write them together.
    program : str
        The program that opens its files, where these are not open to others.
    is_axisymmetric : bool
        Whether the deck has elements of an axisymmetric body.
    """

    folder: Path
    job: str
    last_time: float = np.inf
    node_sets: Mapping[str, set[int]] = field(default_factory=dict)
    asked: tuple[tuple[str, str], ...] = ()
    program: str = ""
    is_axisymmetric: bool = False

    @cached_property
    def file(self) -> ResultFile | None:
        """The result file that is there; None where none is that can be read."""
        candidates = [
            (rank, kind, path)
            for kind in result_files()
            for rank, suffix in enumerate(kind.suffixes)
            if (path := self._with_suffix(suffix)) is not None
        ]
        if not candidates:
            return None
        _, kind, path = min(candidates, key=lambda candidate: candidate[0])
        return kind(path, self)

    def reach(self, times: Any) -> Any:
        """Return whether the results are converged at a time, or at each of several in an array."""
        return times <= self.last_time * (1 + SAME_TIME)

    def _with_suffix(self, suffix: str) -> Path | None:
        """Return the file of the job, else one of another name that the run wrote."""
        if (self.folder / f"{self.job}{suffix}").is_file():
            return self.folder / f"{self.job}{suffix}"
        written = [path for path in sorted(self.folder.glob(f"*{suffix}")) if not path.is_symlink()]
        return min(written, key=lambda path: len(path.name), default=None)


def result_files() -> list[type[ResultFile]]:
    """Return the classes of result files, those of other packages last."""
    return list(dict.fromkeys([*variants(ResultFile).values(), *plugins(ResultFile)]))


class ResultFile(ABC):
    """The results of a program; a new one is one subclass in one file.

    Parameters
    ----------
    path : Path
    results : Results
        The folder in which it lies.
    """

    entry_point_group: ClassVar[str] = "tissuq.result_files"
    name: ClassVar[str]
    suffixes: ClassVar[tuple[str, ...]]
    """Of its files, that by which it is chosen first."""
    requests: ClassVar[Mapping[str, str]]
    """What asks for a field in a deck, with ``{set}``; without a field that the program does not write."""

    def __init__(self, path: Path, results: Results) -> None:
        self.path = path
        self.results = results

    @property
    def label(self) -> str:
        """The file as it is called in messages."""
        return f"'{self.path.name}'"

    @property
    @abstractmethod
    def nodes(self) -> NDArray[np.int64]:
        """Numbers of the nodes (n,)."""

    @property
    def node_sets(self) -> Mapping[str, Collection[int] | NDArray[np.int64]]:
        """Nodes of sets, by their names in capitals."""
        return self.results.node_sets

    @abstractmethod
    def field(self, kind: str) -> Values | None:
        """Return a field at the nodes, in their order and not a number where it is not; None where it was not written.

        Parameters
        ----------
        kind : str
            ``U``, ``RF``, ``S`` (Cauchy stress) or ``E`` (Green strain).
        """

    def of_set(self, kind: str, set_name: str, how: str) -> Values | None:
        """Return a field at the members of a set, which are to be joined by ``how``.

        Raises
        ------
        InputError
            When there is no such set.
        """
        values = self.field(kind)
        return None if values is None else Values(values.times, values.values[:, self._rows(set_name)])

    def _rows(self, set_name: str) -> BoolArray:
        members = self.node_sets.get(set_name)
        if members is None and set_name != ALL:
            raise InputError(unknown_set(set_name, self.node_sets))
        rows = np.isin(self.nodes, list(members)) if members is not None else np.ones(len(self.nodes), dtype=bool)
        if not rows.any():
            raise InputError(f"no node of the set '{set_name}' is in {self.label}.")
        return rows


def unknown_set(set_name: str, set_names: Collection[str]) -> str:
    """Return what is said of a set that is none of those known: the nearest names, and some of the others."""
    near = get_close_matches(set_name, set_names, n=3)
    hint = f" Did you mean {' or '.join(map(repr, near))}?" if near else ""
    names = sorted(set_names)
    more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    listed = f"{', '.join(names[:MOST_NAMES]) or 'none'}{more}"
    return f"the model has no set of nodes '{set_name}'; its sets are {listed}.{hint}"
