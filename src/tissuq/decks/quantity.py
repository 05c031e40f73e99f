"""Quantities of interest: reaction forces, displacements, stresses, strains of a set, or a function of the user's."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tissuq.decks.calculix_results import Frd, Table, read_dat, read_frd
from tissuq.errors import InputError
from tissuq.mechanics.user_law import LAW, failures_of, run_file

__all__ = [
    "Component",
    "Curve",
    "FunctionQuantity",
    "Quantity",
    "Results",
    "parse_quantity",
    "tensor_of",
    "von_mises",
]

FloatArray = NDArray[np.float64]

SPECIFICATION = re.compile(r"(?P<component>[A-Za-z]+\d*)(@(?P<set>[^:]+))?(:(?P<how>\w+))?")
HOW_TO_WRITE = "write NAME=RF3@SET, NAME=U2@SET:max, NAME=S11@SET, NAME=MISES@SET:max, or NAME=file.py:function"
AXES = {"1": 0, "2": 1, "3": 2}
TENSOR = ("11", "22", "33", "12", "13", "23")
REDUCTIONS: dict[str, Callable[[FloatArray], FloatArray]] = {
    "sum": lambda values: values.sum(axis=1),
    "mean": lambda values: values.mean(axis=1),
    "min": lambda values: values.min(axis=1),
    "max": lambda values: values.max(axis=1),
}
ALL = "ALL"
"""The set of all nodes, where none is named."""


class Curve(NamedTuple):
    """A quantity at times: arrays (t,)."""

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
    """

    folder: Path
    job: str
    last_time: float = np.inf
    node_sets: Mapping[str, set[int]] = field(default_factory=dict)

    @cached_property
    def tables(self) -> Mapping[tuple[str, str], Table]:
        """The tables of the ``.dat`` file; none where there is no such file."""
        path = self.folder / f"{self.job}.dat"
        try:
            return read_dat(path) if path.is_file() else {}
        except ValueError as error:
            raise InputError(f"'{path.name}' cannot be read: a set has other rows at other times.") from error

    @cached_property
    def frd(self) -> Frd | None:
        """Mesh and fields of the ``.frd`` file; None where there is no such file."""
        path = self.folder / f"{self.job}.frd"
        return read_frd(path, self.last_time) if path.is_file() else None


class Quantity(ABC):
    """A number of a model at every time."""

    name: str

    @abstractmethod
    def read(self, results: Results) -> Curve:
        """Return the quantity from what a solver left.

        Raises
        ------
        InputError
            When it is not there.
        """

    @property
    @abstractmethod
    def text(self) -> str:
        """What it is, as it was written."""

    @property
    def identity(self) -> str:
        """A text that changes with what it gives."""
        return self.text

    def check(self) -> None:  # noqa: B027  (most have nothing to check)
        """Refuse what can be seen to be wrong before anything is run."""


@dataclass(frozen=True)
class Kind:
    """A field: what its tables in ``.dat`` are called, its name in ``.frd``, and how members of a set are joined."""

    tables: tuple[str, ...]
    frd: str
    request: str
    how: str = "mean"
    components: tuple[str, ...] = ("1", "2", "3")


KINDS = {
    "U": Kind(("displacements",), "DISP", "*NODE PRINT, NSET={set}\\n U"),
    "RF": Kind(("total force", "forces"), "FORC", "*NODE PRINT, NSET={set}, TOTALS=ONLY\\n RF", "sum"),
    "S": Kind(("stresses",), "STRESS", "*EL FILE\\n S", "mean", TENSOR),
    "E": Kind(("strains",), "TOSTRAIN", "*EL FILE\\n E", "mean", TENSOR),
}


@dataclass(frozen=True)
class Component(Quantity):
    """A component of a field in CalculiX's result files, over a set.

    Parameters
    ----------
    name : str
    kind : str
        ``U``, ``RF``, ``S`` (Cauchy stress) or ``E`` (Green strain).
    component : str
        ``1`` to ``3``, or ``11`` to ``23`` of a tensor; empty for the size of a vector, or the von Mises stress.
    set_name : str
        In capitals.
    how : str
        ``sum``, ``mean``, ``min`` or ``max`` over the set.
    """

    name: str
    kind: str
    component: str
    set_name: str
    how: str

    @property
    def text(self) -> str:
        word = "MISES" if self.kind == "S" and not self.component else f"{self.kind}{self.component}"
        return f"{word}@{self.set_name}:{self.how}"

    def read(self, results: Results) -> Curve:
        try:
            curve = self._read(results)
        except (ValueError, LookupError) as error:
            raise InputError(f"{self.text}: the results of '{results.job}' are cut short or damaged.") from error
        if not np.isfinite(curve.values).all():
            raise InputError(
                f"{self.text}: the results of '{results.job}' have no number at some nodes of the set "
                f"'{self.set_name}'; ask for a set whose nodes are all written."
            )
        return curve

    def _read(self, results: Results) -> Curve:
        for what in KINDS[self.kind].tables:
            table = results.tables.get((what, self.set_name))
            if table is not None and (self.how == "sum" or not what.startswith("total")):
                names = [name if len(name) == 3 else str("xyz".index(name[-1]) + 1) for name in table.columns]
                columns = dict(zip(names, np.moveaxis(table.values, -1, 0), strict=True))
                return Curve(table.times, self._over_set(columns))
        return self._from_frd(results)

    def _from_frd(self, results: Results) -> Curve:
        kind = KINDS[self.kind]
        steps = results.frd.fields.get(kind.frd, []) if results.frd is not None else []
        if results.frd is None or not steps:
            request = kind.request.format(set=self.set_name)
            raise InputError(
                f"{self.text} is not in the results '{results.job}.dat' and '{results.job}.frd': ask for it in the "
                f"deck, as by '{request}'."
            )
        nodes = results.frd.nodes
        members = results.node_sets.get(self.set_name)
        if members is None and self.set_name != ALL:
            known = ", ".join(sorted(results.node_sets)) or "none"
            raise InputError(f"{self.text}: the deck has no set of nodes '{self.set_name}'; its sets are {known}.")
        rows = np.isin(nodes, sorted(members)) if members is not None else np.ones(len(nodes), dtype=bool)
        if not rows.any():
            raise InputError(f"{self.text}: no node of the set is in '{results.job}.frd'.")
        names = [name if len(name) == 3 else name[-1] for name in steps[0][1]]
        values = [np.array([fields[key][rows] for _, fields in steps]) for key in steps[0][1]]
        return Curve(np.array([time for time, _ in steps]), self._over_set(dict(zip(names, values, strict=True))))

    def _over_set(self, columns: Mapping[str, FloatArray]) -> FloatArray:
        """Return the quantity (t,) from components (t, rows)."""
        reduce = REDUCTIONS[self.how]
        if self.kind in ("U", "RF"):
            vector = [columns[axis] for axis in AXES]
            if self.component:
                return reduce(vector[AXES[self.component]])
            parts = [reduce(values) for values in vector] if self.how == "sum" else vector
            size = np.sqrt(sum(values**2 for values in parts))
            return np.asarray(size if self.how == "sum" else reduce(size))
        tensor = dict(zip(TENSOR, tensor_of(columns), strict=True))
        return reduce(tensor[self.component] if self.component else von_mises(*tensor.values()))


def tensor_of(columns: Mapping[str, FloatArray]) -> list[FloatArray]:
    """Return the components 11, 22, 33, 12, 13, 23 of columns that end in the letters of their axes, such as SZX."""
    by_axes = {"".join(sorted(name[-2:].lower())): values for name, values in columns.items()}
    return [by_axes[axes] for axes in ("xx", "yy", "zz", "xy", "xz", "yz")]


def von_mises(*components: FloatArray) -> FloatArray:
    """Return the von Mises stress of the components 11, 22, 33, 12, 13, 23 of a Cauchy stress, arrays of one shape."""
    s11, s22, s33, s12, s13, s23 = components
    normal = (s11 - s22) ** 2 + (s22 - s33) ** 2 + (s33 - s11) ** 2
    return np.asarray(np.sqrt(normal / 2 + 3 * (s12**2 + s13**2 + s23**2)))


@dataclass(frozen=True)
class FunctionQuantity(Quantity):
    """A function in a file of the user's, ``file.py:function``: from the folder of a draw to a number or a curve.

    It returns a number, or a pair of arrays: times and values.
    """

    name: str
    location: str

    @property
    def text(self) -> str:
        return self.location

    @property
    def _path(self) -> Path:
        match = LAW.fullmatch(self.location)
        assert match is not None  # noqa: S101 (as it was parsed)
        return Path(match["path"])

    @property
    def identity(self) -> str:
        return f"{self.location} {sha256(self._path.read_bytes()).hexdigest()[:16]}"

    def check(self) -> None:
        self._function()

    def _function(self) -> Callable[[Path], object]:
        name = self.location.rpartition(":")[2]
        if not self._path.is_file():
            raise InputError(f"quantity '{self.name}': there is no file '{self._path}'.")
        with failures_of(self._path):
            function = getattr(run_file(self._path), name, None)
        if not callable(function):
            raise InputError(
                f"'{self._path}' has no function named '{name}'. Write {name}(folder) of the draw's folder."
            )
        return function  # type: ignore[no-any-return]

    def read(self, results: Results) -> Curve:
        function = self._function()
        try:
            returned = function(results.folder)
            times, values = returned if isinstance(returned, tuple) else (np.nan, returned)
            curve = Curve(*(np.atleast_1d(np.asarray(part, dtype=np.float64)) for part in (times, values)))
        except Exception as error:  # whatever the user's function does
            raise InputError(
                f"quantity '{self.name}': {self.location} raised {type(error).__name__}: {error}"
            ) from error
        if curve.times.shape != curve.values.shape or curve.values.ndim != 1 or not np.isfinite(curve.values).all():
            raise InputError(
                f"quantity '{self.name}': {self.location} must return a number, or a pair of times and values, all "
                "finite and of one length."
            )
        return Curve(np.ones(1), curve.values) if len(curve.times) == 1 and np.isnan(curve.times).all() else curve


def located(text: str, beside: Path) -> str:
    """Return the text of a quantity, where it is a function with its file in a folder, by an absolute name."""
    match = LAW.fullmatch(text)
    return text if match is None else f"{(beside / match['path']).absolute()}:{match['name']}"


def parse_quantity(name: str, text: str) -> Quantity:
    """Return a quantity from its name and a text like ``RF3@TOP`` or ``file.py:function``.

    Raises
    ------
    InputError
        When the text is neither.

    Examples
    --------
    >>> from tissuq.decks import parse_quantity
    >>> parse_quantity("force", "rf3@top").text, parse_quantity("peak", "MISES@HOLE:max").text
    ('RF3@TOP:sum', 'MISES@HOLE:max')
    """
    if not name.replace("_", "").replace("-", "").isalnum():
        raise InputError(f"'{name}' cannot name a quantity: use letters, digits, _ and -.")
    if LAW.fullmatch(text):
        return FunctionQuantity(name, text)
    match = SPECIFICATION.fullmatch(text.strip())
    word = match["component"].upper() if match else ""
    kind, component = ("S", "") if word == "MISES" else (word.rstrip("0123456789"), word.lstrip("USREF"))
    how = (match["how"] or "").lower() if match else ""
    is_known = kind in KINDS and (component in KINDS[kind].components or (not component and kind in ("U", "RF")))
    if match is None or not (is_known or word == "MISES") or how not in ("", *REDUCTIONS):
        raise InputError(f"'{text}' is not a quantity: {HOW_TO_WRITE} (over a set: {', '.join(REDUCTIONS)}).")
    return Component(name, kind, component, (match["set"] or ALL).strip().upper(), how or KINDS[kind].how)
