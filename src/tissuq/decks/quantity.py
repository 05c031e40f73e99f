"""Quantities of interest: reaction forces, displacements, stresses, strains of a set, or a function of the user's."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.decks.result_file import ALL, TENSOR, Results, result_files
from tissuq.errors import InputError
from tissuq.mechanics.user_law import UserCode

SPECIFICATION = re.compile(r"(?P<component>[A-Za-z]+\d*)(@(?P<set>[^:]+))?(:(?P<how>\w+))?")
HOW_TO_WRITE = "write NAME=RF3@SET, NAME=U2@SET:max, NAME=S11@SET, NAME=MISES@SET:max, or NAME=file.py:function"
OWN_FUNCTION = "give it by a function of yours, NAME=file.py:function"
AXES = ("1", "2", "3")
REDUCTIONS: dict[str, Callable[..., FloatArray]] = {"sum": np.sum, "mean": np.mean, "min": np.min, "max": np.max}


class Curve(NamedTuple):
    """A quantity at times: arrays (t,)."""

    times: FloatArray
    values: FloatArray


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


class Kind(NamedTuple):
    """A field: how members of a set are joined, unless that is said, and its components."""

    how: str = "mean"
    components: tuple[str, ...] = AXES


KINDS = {"U": Kind(), "RF": Kind("sum"), "S": Kind(components=TENSOR), "E": Kind(components=TENSOR)}


@dataclass(frozen=True)
class Component(Quantity):
    """A component of a field in the result file of a program, over a set.

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
        file = results.file
        if file is None:
            suffixes = ", ".join(suffix for kind in result_files() for suffix in kind.suffixes)
            raise InputError(
                f"{self.text}: the run of '{results.job}' left no file that can be read ({suffixes}); {OWN_FUNCTION}."
            )
        try:
            values = file.of_set(self.kind, self.set_name, self.how)
        except InputError as error:
            raise InputError(f"{self.text}: {error}") from error
        if values is not None:
            return Curve(values.times, self._over_set(values.values))
        request = file.requests.get(self.kind, "").format(set=self.set_name)
        advice = f"ask for it in the deck, as by '{request}'" if request else f"this program has none; {OWN_FUNCTION}"
        raise InputError(f"{self.text} is not in {file.label}: {advice}.")

    def _over_set(self, values: FloatArray) -> FloatArray:
        """Return the quantity (t,) from components (t, rows, c)."""
        reduce = REDUCTIONS[self.how]
        columns = np.moveaxis(values, -1, 0)
        if self.component:
            return reduce(columns[KINDS[self.kind].components.index(self.component)], axis=1)
        if self.kind == "S":
            return reduce(von_mises(*columns), axis=1)
        if self.how == "sum":
            return np.asarray(np.linalg.norm(values.sum(axis=1), axis=1))
        return reduce(np.linalg.norm(values, axis=2), axis=1)


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
    def _code(self) -> UserCode:
        code = UserCode.named(self.location)
        assert code is not None  # noqa: S101 (as it was parsed)
        return code

    @property
    def identity(self) -> str:
        return f"{self.location} {self._code.digest}"

    def check(self) -> None:
        self._function()

    def _function(self) -> Callable[[Path], object]:
        path, name = self._code
        missing = f"quantity '{self.name}': there is no file '{path}'."
        return self._code.function(missing, f"Write {name}(folder) of the draw's folder")

    def read(self, results: Results) -> Curve:
        function = self._function()
        try:
            returned = function(results.folder)
            times, values = returned if isinstance(returned, tuple) else (np.nan, returned)
            curve = Curve(*(np.atleast_1d(np.asarray(column, dtype=np.float64)) for column in (times, values)))
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
    code = UserCode.named(text)
    return text if code is None else f"{(beside / code.path).absolute()}:{code.name}"


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
    if UserCode.named(text):
        return FunctionQuantity(name, text)
    match = SPECIFICATION.fullmatch(text.strip())
    word = match["component"].upper() if match else ""
    kind, component = ("S", "") if word == "MISES" else (word.rstrip("0123456789"), word.lstrip("USREF"))
    how = (match["how"] or "").lower() if match else ""
    is_known = kind in KINDS and (component in KINDS[kind].components or (not component and kind in ("U", "RF")))
    if match is None or not (is_known or word == "MISES") or how not in ("", *REDUCTIONS):
        raise InputError(f"'{text}' is not a quantity: {HOW_TO_WRITE} (over a set: {', '.join(REDUCTIONS)}).")
    return Component(name, kind, component, (match["set"] or ALL).strip().upper(), how or KINDS[kind].how)
