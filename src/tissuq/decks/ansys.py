"""ANSYS: its decks (APDL text and .cdb files), and its result file (``.rst``), by the library ansys-mapdl-reader."""

from __future__ import annotations

import re
import warnings
from collections.abc import Collection, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tissuq.arrays import FloatArray
from tissuq.decks.deck import DeckFormat, DeckMaterial
from tissuq.decks.result_file import AS_TENSOR, ResultFile, Values
from tissuq.errors import InputError
from tissuq.finite_elements.deck_keywords import Line, decoded, lines_of

ELASTIC_TABLES = {"HYPE", "ELAS", "ANEL", "AHYP"}
"""Tables (TB) that a card replaces, by the four letters that the program reads."""
OTHER_TABLES = {"DENS", "CTE", "THER", "SPEC", "SDAM"}
"""Tables that stay; any other changes the stress."""
ELASTIC_CONSTANTS = {"EX", "EY", "EZ", "NUXY", "NUYZ", "NUXZ", "PRXY", "PRYZ", "PRXZ", "GXY", "GYZ", "GXZ"}
REMARKS = ("/COM", "/TITLE", "/STITLE", "C***")
"""What the commands of lines begin with whose words are for readers."""
DATA = ("TBDATA", "TBDAT", "TBPT", "TBTEMP", "TBTEM", "TBEO", "TBFIELD")
GROUPING = ("CM", "CMGRP", "CMEDIT", "*USE")
"""Commands that make components of what is selected, or may."""
COMPONENT = re.compile(
    rb"^[ \t]*CMBLOCK[ \t]*,(?P<name>[^,\r\n]+),[ \t]*NODE[^,\r\n]*,[ \t]*(?P<count>\d+)[^\r\n]*\r?\n",
    re.IGNORECASE | re.MULTILINE,
)
"""The head of a component of nodes."""
LONGEST = 24
"""Bytes that a number in it may take, at most."""
NOT_A_NUMBER = "a card needs its number in digits: write that in the place of the parameter."


class AnsysDeck(DeckFormat):
    """``TB,HYPER``, ``TB,ELASTIC`` and ``MP,EX`` with their like of one material number are replaced by a card.

    Its density and other properties stay.
    """

    name = "ansys"
    card_format = "ansys"
    suffixes = (".cdb", ".mac", ".ans", ".dat", ".txt", ".inp")

    def recognises(self, content: bytes) -> bool:
        return bool(re.search(rb"^\s*(/prep7|tb\s*,|mp\s*,|mpdata\s*,|et\s*,)", content, re.IGNORECASE | re.MULTILINE))

    def includes(self, content: bytes) -> list[str]:
        names = []
        for _, words in _commands(content):
            if words[0] == "/INPUT" and len(words) > 1 and words[1]:
                name = words[1].strip("'")
                names.append(f"{name}.{words[2]}" if len(words) > 2 and words[2] else name)
        return names

    def materials(self, content: bytes) -> list[DeckMaterial]:
        spans: dict[str, list[tuple[int, int]]] = {}
        refused: dict[str, str] = {}
        in_table = ""
        for line, words in _commands(content):
            command = words[0]
            if command == "TB":
                table, number = _word(words, 1)[:4].upper(), _word(words, 2)
                spans.setdefault(number, [])
                in_table = number if table in ELASTIC_TABLES else ""
                if not in_table and table not in OTHER_TABLES:
                    refused[number] = (
                        f"its table TB,{_word(words, 1)} would be read together with the card of a draw. Take it "
                        "out of the deck."
                    )
            elif command == "MP" and _word(words, 1).upper() in ELASTIC_CONSTANTS:
                in_table = ""
                spans.setdefault(_word(words, 2), []).append((line.start, line.end))
                continue
            elif command == "MPDATA":
                constant, number = _mpdata(words)
                spans.setdefault(number, [])
                if constant in ELASTIC_CONSTANTS:
                    spans[number].append((line.start, line.end))
                continue
            elif command not in DATA:
                in_table = ""
            if in_table:
                spans[in_table].append((line.start, line.end))
        for name, number in _parameters(content, {name for name in spans if not name.isdecimal()}):
            refused[number] = f"commands call it '{name}', too: write its number in the place of that parameter."
        return [
            DeckMaterial("", number, tuple(lines), (), refused.get(number, "" if number.isdecimal() else NOT_A_NUMBER))
            for number, lines in spans.items()
            if lines
        ]

    def node_sets(self, files: Sequence[bytes]) -> dict[str, set[int]]:
        """Return the components of nodes (``CMBLOCK``); in their lists a negative number ends a range."""
        sets: dict[str, set[int]] = {}
        for content in files:
            for head in COMPONENT.finditer(content):
                name, count = decoded(head["name"]).strip().upper(), int(head["count"])
                sets[name] = _component(name, content[head.end() : head.end() + 99 + LONGEST * count], count)
        return sets

    def set_names(self, files: Sequence[bytes], *, of_elements: bool) -> set[str]:
        """Return the components; none where the deck makes some by ``CM``, or has none: they may be in the results."""
        makes_others = any(words[0] in GROUPING for content in files for _, words in _commands(content))
        return set() if makes_others else set(self.node_sets(files))

    def fragment(self, material: DeckMaterial, block: str) -> str:
        return block


def _commands(content: bytes) -> list[tuple[Line, list[str]]]:
    """Return the lines with commands, and the words of each, the command in capitals; comments follow a ``!``."""
    commands = []
    for number, line in enumerate(lines_of(content), start=1):
        text = line.text.partition("!")[0]
        if "$" in text and not text.strip().upper().startswith(REMARKS):
            raise InputError(f"line {number} of the ANSYS deck has several commands ($): write each in a line.")
        words = [word.strip() for word in text.split(",")]
        if words[0]:
            commands.append((line, [words[0].upper(), *words[1:]]))
    return commands


def _parameters(content: bytes, names: Collection[str]) -> list[tuple[str, str]]:
    """Return the parameters of some names that a file sets to whole numbers, and these."""
    by_name = {name.upper(): name for name in names}
    values = []
    for _, words in _commands(content) if by_name else ():
        key, _, value = words[0].partition("=") if words[0] != "*SET" else (_word(words, 1), "", _word(words, 2))
        if key.strip().upper() in by_name and value.strip().isdecimal():
            values.append((by_name[key.strip().upper()], value.strip()))
    return values


def _component(name: str, body: bytes, count: int) -> set[int]:
    """Return the members of a component from what stands below its head: their format, and a number of entries."""
    lines = (line.text.rstrip() for line in lines_of(body))
    form = re.search(r"i(\d+)", next(lines, ""), re.IGNORECASE)
    if form is None:
        raise InputError(f"the component '{name}' of the deck (CMBLOCK) lacks the format of its numbers, as (8i10).")
    width, entries = int(form[1]), list[int]()
    try:
        while len(entries) < count:
            line = next(lines)
            entries += [int(line[start : start + width]) for start in range(0, len(line), width)]
    except (StopIteration, ValueError) as error:
        raise InputError(f"the component '{name}' of the deck (CMBLOCK) is cut short or damaged.") from error
    members: set[int] = set()
    for previous, entry in zip([0, *entries], entries, strict=False):
        members |= {entry} if entry > 0 else set(range(previous, -entry + 1))
    return members


def _word(words: list[str], index: int) -> str:
    return words[index] if len(words) > index else ""


def _mpdata(words: list[str]) -> tuple[str, str]:
    """Return the constant and the number of the material of ``MPDATA``, with or without the ``R5.0, 1`` of .cdb."""
    start = 3 if _word(words, 1).upper().startswith("R") and "." in _word(words, 1) else 1
    return _word(words, start).upper(), _word(words, start + 1)


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
