"""What is known of specimens beside their tests: numbers such as an age, and words such as a sex, for a regression."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from numbers import Real
from typing import Any, TypeAlias

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.errors import InputError
from tissuq.experiments.numbers import number_in

Place: TypeAlias = Callable[[str, str], str]
"""Where the value of a specimen (or of none: an empty text) and of a covariate (likewise) stands, for messages."""

SPECIMENS_BEYOND_COLUMNS = 3
"""Specimens more than columns of the regression, at least: as many as a population needs without covariates."""
DEPENDENT = 1e-6
"""Part of a column, over its size, that the columns before it leave open where they determine it."""
UNIT = re.compile(r"(.*\S)\s*[\[(]([^\[\]()]+)[\])]")
"""A name with a unit in brackets."""
SHOWN = 6
"""Number of names that a message lists."""


@dataclass(frozen=True)
class Covariate(ABC):
    """One thing that is known of every specimen.

    Attributes
    ----------
    name : str
    """

    name: str

    @property
    @abstractmethod
    def effects(self) -> tuple[tuple[str, str], ...]:
        """What each of its columns in the regression is called, and what its effect is per, or against."""

    @property
    @abstractmethod
    def size(self) -> float:
        """What one in a column is, in units of the covariate."""

    @property
    @abstractmethod
    def reference(self) -> str:
        """The value at which its columns are zero, as text."""

    @abstractmethod
    def encoded(self, value: Any) -> FloatArray:
        """Return the columns (k,) of a value.

        Raises
        ------
        InputError
            When it is no value of this covariate.
        """

    @abstractmethod
    def shown(self, value: Any) -> str:
        """Return a value as text."""

    def beyond(self, value: Any) -> str:
        """Return in words how far a value lies beyond those of the specimens; nothing where it does not."""
        return ""


@dataclass(frozen=True)
class NumberCovariate(Covariate):
    """A number, such as an age: one column, centred at the specimens' mean, in units of their standard deviation."""

    unit: str
    centre: float
    sd: float
    low: float
    high: float

    @property
    def effects(self) -> tuple[tuple[str, str], ...]:
        return ((self.name, f"per {self.unit or 'unit'}"),)

    @property
    def size(self) -> float:
        return self.sd

    @property
    def reference(self) -> str:
        return self.shown(self.centre)

    def encoded(self, value: Any) -> FloatArray:
        number = _number(value)
        if number is None:
            raise InputError(f"'{self.name}' must be a number, not {value!r}.")
        return np.array([(number - self.centre) / self.sd])

    def shown(self, value: Any) -> str:
        return f"{float(_number(value) or 0.0):.4g}{f' {self.unit}' * bool(self.unit)}"

    def beyond(self, value: Any) -> str:
        is_inside = self.low <= float(_number(value) or 0.0) <= self.high
        return "" if is_inside else f"{self.name} {self.shown(value)} (theirs: {self.low:.4g} to {self.high:.4g})"


@dataclass(frozen=True)
class LevelCovariate(Covariate):
    """A word, such as a sex or a region: a column for every level but the first, which is the reference."""

    levels: tuple[str, ...]

    size = 1.0

    @property
    def effects(self) -> tuple[tuple[str, str], ...]:
        return tuple((f"{self.name} {level}", f"against {self.reference}") for level in self.levels[1:])

    @property
    def reference(self) -> str:
        return self.levels[0]

    def encoded(self, value: Any) -> FloatArray:
        if self.shown(value) not in self.levels:
            raise InputError(f"'{self.name}' must be one of {', '.join(self.levels)}, not {value!r}.")
        return np.array([float(self.shown(value) == level) for level in self.levels[1:]])

    def shown(self, value: Any) -> str:
        return str(value).strip()


@dataclass(frozen=True, eq=False)
class Covariates:
    """The covariates of a population; none, where there are none.

    Attributes
    ----------
    each : tuple of Covariate
    design : (I, k) array
        The columns of every specimen: zero at the mean of the numbers and the reference level of the words.
    """

    each: tuple[Covariate, ...]
    design: FloatArray

    def __bool__(self) -> bool:
        return bool(self.each)

    @property
    def effects(self) -> tuple[tuple[str, str], ...]:
        """What each column is called, and what its effect is per, or against."""
        return tuple(effect for covariate in self.each for effect in covariate.effects)

    @property
    def sizes(self) -> FloatArray:
        """What one in each column (k,) is, in units of its covariate."""
        return np.array([covariate.size for covariate in self.each for _ in covariate.effects])

    def row(self, values: Mapping[str, Any]) -> FloatArray:
        """Return the columns (k,) of somebody with these values, the others at the reference.

        Raises
        ------
        InputError
            When there is no such covariate, or no such value of it.
        """
        names = [covariate.name for covariate in self.each]
        if unknown := [name for name in values if name not in names]:
            available = f"the covariates are {', '.join(names)}" if names else "it was fitted without covariates"
            raise InputError(f"there is no covariate {_listed(unknown)} in this population: {available}.")
        pieces = [
            covariate.encoded(values[covariate.name]) if covariate.name in values else np.zeros(len(covariate.effects))
            for covariate in self.each
        ]
        return np.concatenate([np.zeros(0), *pieces])

    def described(self, values: Mapping[str, Any]) -> str:
        """Return in words whom `row` is of: ``age 54.2, sex f``."""
        return ", ".join(f"{c.name} {c.shown(values[c.name]) if c.name in values else c.reference}" for c in self.each)

    def beyond(self, values: Mapping[str, Any]) -> list[str]:
        """Return in words which values lie beyond those of the specimens."""
        return [text for c in self.each if c.name in values and (text := c.beyond(values[c.name]))]


def covariates_of(source: Any, specimens: Sequence[str], locate: Place | None = None) -> Covariates:
    """Return the covariates of specimens.

    Parameters
    ----------
    source : pandas.DataFrame, mapping of str to mapping, or Covariates
        Values by the names of covariates, for every specimen (the index of a table). Numbers may be texts. A name may
        end in a unit in brackets, such as ``age [year]``. None: no covariates.
    specimens : sequence of str
    locate : callable, optional
        Where values stand, for messages.

    Raises
    ------
    InputError
        When specimens or values are missing or unknown, or a column is constant, or determined by others, or they are
        too many.
    """
    if isinstance(source, Covariates):
        return source
    if source is None:
        return Covariates((), np.zeros((len(specimens), 0)))
    locate, values = locate or _in_python, _by_specimen(source)
    if unknown := [name for name in values if name not in specimens]:
        raise InputError(
            f"{locate(unknown[0], '')}: there is no specimen {_listed(unknown)}; the specimens are "
            f"{_listed(specimens)}."
        )
    if missing := [name for name in specimens if name not in values]:
        raise InputError(
            f"{locate('', '')}: the covariates of specimen {_listed(missing)} are missing. Add a row, or leave out the "
            "specimen's tests."
        )
    names = list(dict.fromkeys(str(name) for row in values.values() for name in row))
    if not names:
        raise InputError(f"{locate('', '')}: there is no covariate.")
    covariates = [_covariate(name, {s: values[s].get(name) for s in specimens}, locate) for name in names]
    design = np.hstack([np.array([c.encoded(values[s][n]) for s in specimens])
                        for n, c in zip(names, covariates, strict=True)])  # fmt: skip
    if len({covariate.name for covariate in covariates}) < len(covariates):
        raise InputError(f"{locate('', '')}: two covariates have the same name; they are {', '.join(names)}.")
    allowed = len(specimens) - SPECIMENS_BEYOND_COLUMNS
    if design.shape[1] > allowed:
        raise InputError(
            f"{locate('', '')}: the covariates ({', '.join(names)}) have {design.shape[1]} effects on every parameter, "
            f"and {len(specimens)} specimens allow {allowed}: leave some out, or join levels."
        )
    _check_independent(design, [n for n, c in zip(names, covariates, strict=True) for _ in c.effects], locate)
    return Covariates(tuple(covariates), design)


def _covariate(name: str, values: Mapping[str, Any], locate: Place) -> Covariate:
    """Return the covariate of some values, by specimens."""
    for specimen, value in values.items():
        if value is None or str(value).strip().lower() in ("", "nan", "<na>", "none"):
            raise InputError(
                f"{locate(specimen, name)}: the value of '{name}' is missing. Fill it in, or leave out the specimen "
                "and its tests, or the column."
            )
    numbers = {specimen: _number(value) for specimen, value in values.items()}
    are_numbers = [number is not None for number in numbers.values()]
    if any(are_numbers) and not all(are_numbers):
        specimen = next(s for s, number in numbers.items() if number is None)
        raise InputError(f"{locate(specimen, name)}: '{values[specimen]}' is no number, as others in this column are.")
    match = UNIT.fullmatch(name)
    if all(are_numbers):
        array = np.array([number for number in numbers.values() if number is not None])
        if array.min() == array.max():
            raise InputError(f"{locate('', name)}: all specimens have the same value, {array[0]:g}: leave it out.")
        short, unit = match.groups() if match else (name, "")
        return NumberCovariate(
            short, unit, float(array.mean()), float(array.std()), float(array.min()), float(array.max())
        )
    words = [str(value).strip() for value in values.values()]
    levels = sorted(set(words), key=lambda word: (-words.count(word), word))
    if len(levels) == 1:
        raise InputError(f"{locate('', name)}: all specimens have the same value, '{levels[0]}': leave it out.")
    alike = {level.casefold(): level for level in reversed(levels)}
    if different := [level for level in levels if alike[level.casefold()] != level]:
        common, variant = alike[different[0].casefold()], different[0]
        specimen = next(specimen for specimen, value in values.items() if str(value).strip() == variant)
        raise InputError(
            f"{locate(specimen, name)}: '{variant}' and '{common}' differ in capitals only: write them alike."
        )
    return LevelCovariate(name, tuple(levels))


def _check_independent(design: FloatArray, of_columns: Sequence[str], locate: Place) -> None:
    """Refuse a column that those before it determine, together with a constant."""
    basis = np.ones((len(design), 1)) / np.sqrt(len(design))
    for name, column in zip(of_columns, design.T, strict=True):
        earlier = list(dict.fromkeys(of_columns[: basis.shape[1] - 1]))
        residual = column - basis @ (basis.T @ column)
        residual -= basis @ (basis.T @ residual)
        if np.linalg.norm(residual) < DEPENDENT * np.linalg.norm(column):
            raise InputError(
                f"{locate('', name)}: the covariates before it ({_listed(earlier)}) determine it in these specimens, "
                "so that their effects cannot be told apart: leave one of them out."
            )
        basis = np.column_stack([basis, residual / np.linalg.norm(residual)])


def _by_specimen(table: Any) -> dict[str, Mapping[str, Any]]:
    """Return values by specimen, of a table or of a mapping."""
    if hasattr(table, "iterrows"):
        labels = [str(label) for label in table.index]
        if twice := [label for label in dict.fromkeys(labels) if labels.count(label) > 1]:
            raise InputError(f"covariates: specimen {_listed(twice)} has several rows; give one for each specimen.")
        columns = {str(name): list(table[name]) for name in table.columns}
        return {label: {name: cells[row] for name, cells in columns.items()} for row, label in enumerate(labels)}
    if not isinstance(table, Mapping) or not all(isinstance(row, Mapping) for row in table.values()):
        raise InputError(
            "covariates must be a table with a row for each specimen (its index), or a mapping such as "
            f"{{'S1': {{'age': 60, 'sex': 'f'}}}}, not {type(table).__name__}."
        )
    return {str(specimen): {str(name): value for name, value in row.items()} for specimen, row in table.items()}


def _number(value: Any) -> float | None:
    """Return a finite number, that may be a text; None of what is none (True and False are words)."""
    if isinstance(value, str):
        value = number_in(value.strip())
    is_number = isinstance(value, Real) and not isinstance(value, bool | np.bool_)
    return float(value) if is_number and isfinite(value) else None


def _in_python(specimen: str, covariate: str) -> str:
    return "covariates" + f", specimen '{specimen}'" * bool(specimen) + f", '{covariate}'" * bool(covariate)


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(f"'{name}'" for name in names[:SHOWN]) + more
