"""Decks of Abaqus and CalculiX: ``*MATERIAL`` blocks, included files, and sets of nodes."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from tissuq.decks.deck import DeckFormat, DeckMaterial, Line, MeshSize, lines_of
from tissuq.errors import InputError

__all__ = ["AbaqusDeck", "Keyword", "keywords_of"]

ELASTICITY = {"ELASTIC", "HYPERELASTIC", "HYPERFOAM", "ANISOTROPICHYPERELASTIC", "USERMATERIAL", "DEPVAR"}
"""Options of a material that a card replaces."""
DEPENDENT = {
    "VISCOELASTIC", "PLASTIC", "MULLINSEFFECT", "CREEP", "HYSTERESIS", "CYCLICHARDENING", "RATEDEPENDENT",
    "DEFORMATIONPLASTICITY", "NOCOMPRESSION", "NOTENSION", "LOWDENSITYFOAM", "DAMAGEINITIATION", "DAMAGEEVOLUTION",
    "UNIAXIALTESTDATA", "BIAXIALTESTDATA", "PLANARTESTDATA", "VOLUMETRICTESTDATA", "SIMPLESHEARTESTDATA",
}  # fmt: skip
"""Options of a material that change its stress, or would be read together with another card."""
ENDS = {
    "MATERIAL", "STEP", "PART", "ENDPART", "ASSEMBLY", "ENDASSEMBLY", "INSTANCE", "ENDINSTANCE", "NODE", "ELEMENT",
    "NSET", "ELSET", "SURFACE", "SURFACEINTERACTION", "CONNECTORBEHAVIOR", "BOUNDARY", "AMPLITUDE", "INITIALCONDITIONS",
}  # fmt: skip
"""Keywords below which no option of a material stands, as well as those of sections."""

ELEMENT = re.compile(r"((?P<solid>C3D)|CAX|CGAX|CPE|CPS|M3D|MAX|S)(?P<nodes>3|4|5|6|8|9|1[05]|2[07])(?!\d)")
"""Types of elements, and their nodes."""
NAMES_OF_SETS, NAMES_OF_ELEMENT_SETS = ("NSET", "NEWSET"), ("ELSET",)
"""Parameters by which keywords name the sets that they make."""
USERS = {
    "NODEPRINT", "NODEFILE", "NODEOUTPUT", "ELPRINT", "ELFILE", "ELEMENTOUTPUT", "CONTACTFILE", "CONTACTPRINT",
    "MONITOR",
}  # fmt: skip
"""Keywords that ask for what happens in a set, which another one makes."""


@dataclass(frozen=True)
class Keyword:
    """A keyword line, its continuations included, and the end of the data below it (bytes)."""

    name: str
    parameters: dict[str, str]
    start: int
    end: int
    data: tuple[str, ...]


def keywords_of(content: bytes) -> Iterator[Keyword]:
    """Return the keywords of a file; comments and blank lines below the data of one belong to none."""
    heads: list[list[Line]] = []
    bodies: list[list[Line]] = []
    is_continued = False
    for line in lines_of(content):
        text = line.text.strip()
        if text.startswith("**"):
            continue
        if is_continued:
            heads[-1].append(line)
        elif text.startswith("*"):
            heads.append([line])
            bodies.append([])
        elif text and bodies:
            bodies[-1].append(line)
            continue
        else:
            continue
        is_continued = text.endswith(",")
    for head, body in zip(heads, bodies, strict=True):
        name, *words = ",".join(line.text.strip().rstrip(",") for line in head).lstrip("*").split(",")
        pairs = (word.partition("=") for word in words)
        parameters = {_joined(key): value.strip().strip('"') for key, _, value in pairs if key.strip()}
        end = body[-1].end if body else head[-1].end
        data = tuple(line.text.strip() for line in body)
        yield Keyword(_joined(name), parameters, head[0].start, end, data)


def _joined(word: str) -> str:
    """Return a keyword as the programs compare it: without blanks, in capitals."""
    return re.sub(r"\s", "", word).upper()


class AbaqusDeck(DeckFormat):
    """``*MATERIAL, NAME=...`` in any case: of its options those that say its elasticity are replaced.

    The line with its name stays, and so do density, damping and other options that are not known to change its
    stress.
    """

    name = "abaqus"
    card_format = "abaqus"
    suffixes = (".inp",)

    def recognises(self, content: bytes) -> bool:
        return bool(
            re.search(rb"^\s*\*\s*(node|heading|material|include|part)\b", content, re.IGNORECASE | re.MULTILINE)
        )

    def includes(self, content: bytes) -> list[str]:
        return [keyword.parameters.get("INPUT", "") for keyword in keywords_of(content) if keyword.name == "INCLUDE"]

    def materials(self, content: bytes) -> list[DeckMaterial]:
        keywords, materials = list(keywords_of(content)), []
        for index, keyword in enumerate(keywords):
            if keyword.name == "MATERIAL":
                materials.append(_material(keyword, keywords[index + 1 :]))
        return materials

    def fragment(self, material: DeckMaterial, block: str) -> str:
        return block.partition("\n")[2]

    def node_sets(self, files: Sequence[bytes]) -> dict[str, set[int]]:
        """Return the sets of nodes that decks define, by their names in capitals, in whatever order they stand.

        Raises
        ------
        InputError
            When a set names one that no file defines, or its numbers are not understood.
        """
        sets: dict[str, set[int]] = {}
        references: dict[str, set[str]] = {}
        for content in files:
            for keyword in keywords_of(content):
                name = keyword.parameters.get("NSET", "").upper()
                if keyword.name not in ("NSET", "NODE") or not name:
                    continue
                members, names = sets.setdefault(name, set()), references.setdefault(name, set())
                try:
                    numbers, referenced = _members(keyword)
                except (ValueError, TypeError) as error:
                    raise InputError(
                        f"the numbers of the set of nodes '{name}' are not understood ({error})."
                    ) from error
                members |= numbers
                names |= referenced
        gone = _of_instances(references)
        for name in gone:
            del sets[name], references[name]
        for name, referenced in references.items():
            for unknown in sorted(referenced - set(sets)):
                raise InputError(f"the set of nodes '{name}' has '{unknown}', which no file of the deck defines.")
        while any(
            not sets[reference] <= sets[name] for name, referenced in references.items() for reference in referenced
        ):
            for name, referenced in references.items():
                sets[name].update(*(sets[reference] for reference in referenced))
        return sets

    def set_names(self, files: Sequence[bytes], *, of_elements: bool) -> set[str]:
        wanted = NAMES_OF_SETS + NAMES_OF_ELEMENT_SETS * of_elements
        keywords = [keyword for content in files for keyword in keywords_of(content) if keyword.name not in USERS]
        return {
            keyword.parameters[name].upper() for keyword in keywords for name in wanted if name in keyword.parameters
        }

    def printed_elements(self, files: Sequence[bytes]) -> set[tuple[str, str]]:
        printing = [keyword for content in files for keyword in keywords_of(content) if keyword.name == "ELPRINT"]
        return {
            (word.strip().upper(), keyword.parameters.get("ELSET", "").upper())
            for keyword in printing
            for line in keyword.data
            for word in line.split(",")
        }

    def mesh_size(self, files: Sequence[bytes]) -> MeshSize | None:
        counts: dict[int, int] = {}
        for keyword in (keyword for content in files for keyword in keywords_of(content)):
            if keyword.name == "ELGEN":
                return None
            kind = ELEMENT.match(_joined(keyword.parameters.get("TYPE", ""))) if keyword.name == "ELEMENT" else None
            if kind is not None:
                dimensions, row = 3 if kind["solid"] else 2, 1 + int(kind["nodes"])
                numbers = sum(bool(word.strip()) for line in keyword.data for word in line.split(","))
                counts[dimensions] = counts.get(dimensions, 0) + numbers // row
        return MeshSize(counts[max(counts)], max(counts)) if counts else None

    def is_axisymmetric(self, files: Sequence[bytes]) -> bool:
        types = (
            _joined(keyword.parameters.get("TYPE", ""))
            for content in files
            for keyword in keywords_of(content)
            if keyword.name == "ELEMENT"
        )
        return any(kind.startswith("CAX") for kind in types)


def _material(head: Keyword, following: Sequence[Keyword]) -> DeckMaterial:
    spans, refused = [], ""
    for option in following:
        if option.name in ELASTICITY:
            spans.append((option.start, option.end))
        elif option.name in DEPENDENT:
            refused = (
                f"*{option.name} belongs to the elasticity that the deck has, and would be read with that of the "
                "draws. Take it out of the deck, or give its effect to the material that is fitted."
            )
        elif option.name in ENDS or option.name.endswith("SECTION"):
            break
    return DeckMaterial(head.parameters.get("NAME", ""), "", tuple(spans or [(head.end, head.end)]), refused=refused)


def _of_instances(references: Mapping[str, set[str]]) -> set[str]:
    """Return the sets with sets of instances in them, as PART-1-1.TOP, whose numbers only a result file tells."""
    unresolved: set[str] = set()
    while (
        more := {
            name
            for name, referenced in references.items()
            if any("." in reference or reference in unresolved for reference in referenced)
        }
        - unresolved
    ):
        unresolved |= more
    return unresolved


def _members(keyword: Keyword) -> tuple[set[int], set[str]]:
    """Return the numbers of nodes below a keyword, and the names of sets, in capitals."""
    rows = [[word.strip() for word in row.split(",") if word.strip()] for row in keyword.data]
    if keyword.name == "NODE":
        return {int(row[0]) for row in rows if row}, set()
    words = [word for row in rows for word in row]
    if "GENERATE" not in keyword.parameters:
        return {int(word) for word in words if word.isdecimal()}, {
            word.upper() for word in words if not word.isdecimal()
        }
    numbers: set[int] = set()
    for row in rows:
        start, stop, step = (*map(int, row), 1)[:3]
        numbers |= set(range(start, stop + 1, step))
    return numbers, set()
