"""The mesh in a deck of Abaqus or CalculiX: points, cells and sets of a model, or of the instances of its parts."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.errors import InputError
from tissuq.finite_elements.deck_keywords import Keyword, encoded, generated, joined, keywords_of

IN_A_FILE = re.compile(
    r"^(?P<keyword>\*(?:INCLUDE|NODE|ELEMENT|NSET|ELSET)\b(?:\s*,[^\n]*?)?)\s*,\s*INPUT\s*=\s*(?P<file>[^,\n]+)(?P<rest>[^\n]*)$",
    re.IGNORECASE | re.MULTILINE,
)
"""A keyword whose data, or with ``*INCLUDE`` a part of the deck, stand in another file."""
GENERATING = ("NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "SYSTEM")
"""Keywords that make or place points and cells by rules that are not followed here."""
ELEMENT = re.compile(
    r"C3D(?P<solid>\d+)|(?:CAX|CPE|CPS|M3D|SFM3D|R3D|S)(?P<surface>\d+)|T[23]D(?P<truss>[23])|B[23](?P<beam>[12])"
)
"""Types of elements, with the numbers of their nodes; of beams, with one less."""
KINDS = {
    "solid": {4: "tetra", 5: "pyramid", 6: "wedge", 8: "hexahedron", 10: "tetra10", 15: "wedge15", 20: "hexahedron20"},
    "surface": {3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8"},
    "line": {2: "line", 3: "line3"},
}
"""What meshio calls elements of so many nodes."""
WITHOUT_CELLS = ("MASS", "SPRING", "CONN", "ROTARY", "DASHPOT", "DCOUP")
"""Beginnings of the types of elements that are no cells and no faces or edges of any."""
Key: TypeAlias = tuple[str, int]
"""A node or an element: the part or instance of which it is, nothing in a deck without parts, and its number."""
Members: TypeAlias = dict[tuple[str, str], list[Key]]
"""Sets by the part or instance of which they are, and their names in capitals."""


def deck_text(path: Path, depth: int = 0) -> str:
    """Return a deck with the files that it includes."""
    if depth > 10:
        raise ValueError("files include each other")
    text = path.read_text(encoding="utf-8", errors="replace").replace("\r\n", "\n")

    def inserted(match: re.Match[str]) -> str:
        keyword, file = match["keyword"], path.parent / match["file"].strip().strip('"')
        head = "" if joined(keyword) == "*INCLUDE" else f"{keyword}{match['rest']}\n"
        return head + deck_text(file, depth + 1).rstrip("\n")

    return IN_A_FILE.sub(inserted, text)


def mesh_of_deck(path: Path) -> Any:
    """Return the mesh of a deck as meshio's, with the points of its sets.

    Sets of nodes and elements of one name are that of the nodes. Those of a part have the name of the instance and a
    point before theirs, where there are several instances.

    Raises
    ------
    InputError
        When nodes or elements are made or placed by keywords that are not followed here, or are of unknown types.
    """
    import meshio

    deck = _Deck(path)
    for keyword in keywords_of(encoded(deck_text(path))):
        deck.take(keyword)
    scopes = deck.scopes
    numbers = {key: number for number, key in enumerate(key for key in deck.points if key[0] in scopes)}
    cells: dict[str, list[list[int]]] = {}
    for (scope, _), (kind, nodes) in deck.cells.items():
        if scope in scopes:
            cells.setdefault(kind, []).append([_number_of(node, numbers) for node in nodes])
    of_elements = {
        name: [node for element in members for node in deck.cells[element][1]]
        for name, members in deck.element_sets.items()
    }
    sets: dict[str, list[int]] = {}
    for (scope, name), members in (of_elements | deck.node_sets).items():
        if scope in scopes:
            shown = deck.spelled[name] if len(scopes) < 3 or not scope else f"{scope}.{deck.spelled[name]}"
            sets.setdefault(shown, []).extend(_number_of(node, numbers) for node in members)
    return meshio.Mesh(
        np.array([deck.points[key] for key in numbers]).reshape(-1, 3),
        [(kind, np.array(rows)) for kind, rows in cells.items()],
        point_sets={name: np.unique(np.array(members, dtype=np.intp)) for name, members in sets.items()},
    )


class _Deck:
    """What has been read of a deck."""

    def __init__(self, path: Path) -> None:
        self.path, self.scope = path, ""
        self.points: dict[Key, list[float]] = {}
        self.cells: dict[Key, tuple[str, list[Key]]] = {}
        self.node_sets: Members = {}
        self.element_sets: Members = {}
        self.spelled: dict[str, str] = {}
        self._parts: list[str] = []
        self._instances: list[str] = []

    @property
    def scopes(self) -> set[str]:
        """The instances, or the part of a deck that has no assembly, and what is in none."""
        if len(self._parts) > 1 and not self._instances:
            raise InputError(f"the deck '{self.path}' has several parts and no *INSTANCE that says where they are.")
        return {"", *(self._instances or self._parts)}

    def take(self, keyword: Keyword) -> None:
        """Take what a keyword says of the mesh."""
        name, given = keyword.name, keyword.parameters
        data = [[word.strip().strip('"') for word in row.rstrip(",").split(",")] for row in keyword.data]
        if name in GENERATING or (name == "NODE" and given.get("SYSTEM", "R").upper() != "R"):
            which = "*NODE with SYSTEM=" + given["SYSTEM"] if name == "NODE" else f"*{name}"
            raise InputError(
                f"the deck '{self.path}' makes or places nodes or elements by {which}, which is not followed: write it "
                "again with all nodes in x, y, z and all elements, from the program that reads it."
            )
        if name == "PART":
            self.scope = given["NAME"].upper()
            self._parts.append(self.scope)
        elif name == "INSTANCE":
            self.scope = given["NAME"].upper()
            self._instances.append(self.scope)
            self._place(given["PART"].upper(), data)
        elif name in ("ENDPART", "ENDINSTANCE"):
            self.scope = ""
        elif name == "NODE":
            self._take_nodes(given, data)
        elif name == "ELEMENT":
            self._take_elements(given, data)
        elif name in ("NSET", "ELSET"):
            self._take_set(name, given, data)

    def _take_nodes(self, given: Mapping[str, str], data: Sequence[Sequence[str]]) -> None:
        keys = []
        for number, *words in data:
            keys.append((self.scope, int(number)))
            numbers = [float(word or 0) for word in words[:3]]
            self.points[keys[-1]] = [*numbers, *[0.0] * (3 - len(numbers))]
        self._add(self.node_sets, self.scope, given.get("NSET", ""), keys)

    def _take_elements(self, given: Mapping[str, str], data: Sequence[Sequence[str]]) -> None:
        kind = joined(given["TYPE"])
        if kind.startswith(WITHOUT_CELLS):
            return
        count, meant = _form(kind)
        if not meant:
            raise InputError(
                f"'{self.path}' cannot be read as a mesh: its elements '{kind}' are not known. Write it again with the "
                "program that made it, with elements such as C3D8."
            )
        numbers = [int(word) for row in data for word in row if word]
        if len(numbers) % (count + 1):
            raise ValueError("an element lacks nodes")
        keys = []
        for element, *nodes in np.reshape(numbers, (-1, count + 1)).tolist():
            keys.append((self.scope, element))
            self.cells[keys[-1]] = meant, [(self.scope, node) for node in nodes]
        self._add(self.element_sets, self.scope, given.get("ELSET", ""), keys)

    def _take_set(self, kind: str, given: Mapping[str, str], data: Sequence[Sequence[str]]) -> None:
        is_of_nodes, scope = kind == "NSET", given.get("INSTANCE", self.scope).upper()
        sets = self.node_sets if is_of_nodes else self.element_sets
        if "GENERATE" in given:
            keys = [(scope, number) for number in generated(data)]
        else:
            keys = [key for row in data for word in row if word for key in self._members(sets, scope, word)]
        if is_of_nodes and "ELSET" in given:
            elements = self._members(self.element_sets, scope, given["ELSET"])
            keys += [node for element in elements for node in self.cells[element][1]]
        self._add(sets, self.scope, given[kind], keys if is_of_nodes else [key for key in keys if key in self.cells])

    def _members(self, sets: Members, scope: str, word: str) -> list[Key]:
        """Return what a number or the name of a set stands for, with an instance and a point before it or not."""
        instance, point, rest = word.rpartition(".")
        scope, word = (instance.upper(), rest) if point and instance.upper() in self._instances else (scope, word)
        if word.lstrip("-").isdigit():
            return [(scope, int(word))]
        if (scope, word.upper()) not in sets:
            raise InputError(f"the deck '{self.path}' names the set '{word}' in another one before it has been made.")
        return sets[scope, word.upper()]

    def _add(self, sets: Members, scope: str, name: str, keys: list[Key]) -> None:
        if name:
            self.spelled.setdefault(name.upper(), name)
            sets.setdefault((scope, name.upper()), []).extend(keys)

    def _place(self, part: str, placing: Sequence[Sequence[str]]) -> None:
        """Copy a part to the instance that begins: moved, and then turned around an axis, as its data say."""
        numbers = [[float(word) for word in row if word] for row in placing]
        nodes = {number: point for (scope, number), point in self.points.items() if scope == part}
        points = np.array([*nodes.values()]).reshape(-1, 3) + (numbers[0] if numbers else 0.0)
        if len(numbers) > 1:
            points = _turned(points, np.array(numbers[1]))
        self.points |= {(self.scope, number): point for number, point in zip(nodes, points.tolist(), strict=True)}
        self.cells |= {
            (self.scope, number): (kind, self._here(corners))
            for (scope, number), (kind, corners) in self.cells.items()
            if scope == part
        }
        for sets in (self.node_sets, self.element_sets):
            sets |= {(self.scope, name): self._here(keys) for (scope, name), keys in sets.items() if scope == part}

    def _here(self, keys: Sequence[Key]) -> list[Key]:
        """Return the nodes or elements of these numbers in the instance."""
        return [(self.scope, number) for _, number in keys]


def _form(kind: str) -> tuple[int, str]:
    """Return the number of nodes of elements of a type, and what meshio calls them: nothing for unknown ones."""
    match = ELEMENT.match(kind)
    form = match.lastgroup if match else None
    if not match or not form:
        return 0, ""
    count = int(match[form]) + (form == "beam")
    return count, KINDS["line" if form in ("truss", "beam") else form].get(count, "")


def _turned(points: FloatArray, turn: FloatArray) -> FloatArray:
    """Return points (n, 3) turned by an angle (degrees, last) around the axis through two points (3 + 3)."""
    start, axis, angle = turn[:3], turn[3:6] - turn[:3], np.radians(turn[6])
    axis = axis / np.linalg.norm(axis)
    arms = points - start
    along = (arms @ axis)[:, None] * axis
    return np.asarray(start + along + np.cos(angle) * (arms - along) + np.sin(angle) * np.cross(axis, arms))


def _number_of(node: Key, numbers: Mapping[Key, int]) -> int:
    if node not in numbers:
        raise KeyError(node[1])
    return numbers[node]
