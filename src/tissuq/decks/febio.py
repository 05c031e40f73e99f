"""Decks of FEBio: ``<material>`` elements, and files that sections come from."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from xml.parsers.expat import ExpatError, ParserCreate

from tissuq.decks.deck import MORE_THAN_ELASTIC, DeckFormat, DeckMaterial, MeshSize
from tissuq.errors import InputError
from tissuq.finite_elements.deck_keywords import decoded

TYPE = re.compile(r"""(\stype\s*=\s*)("[^"]*"|'[^']*')""")
DENSITY = re.compile(r"<density\b[^>]*>[^<]*</density>")
SHARED = "rigid body"
NOT_ELASTIC_ALONE = re.compile(
    "visco|phasic|reactive|relax|damage|plastic|growth|remodel|osmo|perfusion|active|prestrain"
)
"""Types of materials that have fluid, time or history besides elasticity."""

KEPT = ("density", "mat_axis")
"""What stays of a material; its axes where the card has fibres."""
SETS = ("Nodes", "NodeSet", "Surface")
"""Elements whose names are those of sets in the plot file."""
SOLIDS = ("hex", "HEX", "tet", "TET", "penta", "PENTA", "pyra", "PYRA")
"""What the types of elements of a volume begin with."""
FIBRES = "Holzapfel-Gasser-Ogden"
"""The type of fibres."""


class FEBioDeck(DeckFormat):
    """``<material id= name= type=>`` below ``<Material>``: its type and what is in it are replaced.

    Its id, its name and its density stay. FEBio wants the ids of materials in their order, from 1 on.
    """

    name = "febio"
    card_format = "febio"
    suffixes = (".feb",)

    def recognises(self, content: bytes) -> bool:
        return b"<febio_spec" in content[:2000]

    def includes(self, content: bytes) -> list[str]:
        return _Parsed(content).includes

    def materials(self, content: bytes) -> list[DeckMaterial]:
        return _Parsed(content).materials

    def set_names(self, files: Sequence[bytes], *, of_elements: bool) -> set[str]:
        return set().union(*(_Parsed(content).sets for content in files))

    def mesh_size(self, files: Sequence[bytes]) -> MeshSize | None:
        counts = Counter[int]()
        for content in files:
            counts.update(_Parsed(content).elements)
        return MeshSize(counts[max(counts)], max(counts)) if counts else None

    def fragment(self, material: DeckMaterial, block: str) -> str:
        head, density, axes = material.remains
        kind = TYPE.search(block.partition(">")[0])
        assert kind is not None  # noqa: S101 (the writer's)
        start = TYPE.sub(lambda match: match[1] + kind[2], head, count=1)
        lines = block.partition("\n")[2].rstrip().splitlines()
        lines = [DENSITY.sub(lambda match: density, line) for line in lines]
        if axes and FIBRES in block:
            lines.insert(-1, axes)
        return "\n".join([start, *(line for line in lines if line.strip())])


class _Parsed:
    """The materials of a file and where they stand, as the parser of XML tells."""

    def __init__(self, content: bytes) -> None:
        self.content = content
        self.materials: list[DeckMaterial] = []
        self.includes: list[str] = []
        self.sets: set[str] = set()
        self.elements = Counter[int]()
        self._dimensions = 0
        self._stack: list[str] = []
        self._start = 0
        self._attributes: dict[str, str] = {}
        self._words = ""
        self._kept = dict.fromkeys(KEPT, (0, 0))
        self._parser = ParserCreate()
        self._parser.StartElementHandler = self._open
        self._parser.EndElementHandler = self._close
        self._parser.CharacterDataHandler = self._read
        try:
            self._parser.Parse(content, True)
        except ExpatError as error:
            raise InputError(f"the FEBio deck is no XML: {error}.") from error

    def _open(self, name: str, attributes: dict[str, str]) -> None:
        if "from" in attributes:
            self.includes.append(attributes["from"])
        if name == "Elements":
            self._dimensions = 3 if attributes.get("type", "").startswith(SOLIDS) else 2
        if name in ("elem", "e") and self._stack[-1:] == ["Elements"]:
            self.elements[self._dimensions] += 1
        if name in SETS and "name" in attributes:
            self.sets.add(attributes["name"].strip().upper())
        if name == "material" and self._stack[-1:] == ["Material"]:
            self._start, self._attributes = self._parser.CurrentByteIndex, attributes
            self._kept = dict.fromkeys(KEPT, (0, 0))
        if name in KEPT and self._stack[-2:] == ["Material", "material"]:
            self._kept[name] = (self._parser.CurrentByteIndex, 0)
        self._stack.append(name)
        self._words = ""

    def _read(self, words: str) -> None:
        self._words += words

    def _close(self, name: str) -> None:
        self._stack.pop()
        if name == "Include":
            self.includes.append(self._words.strip())
        if name in KEPT and self._stack[-2:] == ["Material", "material"]:
            self._kept[name] = (self._kept[name][0], self._end())
        if name == "material" and self._stack[-1:] == ["Material"]:
            end = self._end()
            text, *elements = (
                decoded(self.content[slice(*span)]) for span in ((self._start, end), *self._kept.values())
            )
            self.materials.append(_material(text, elements, self._attributes, (self._start, end)))

    def _end(self) -> int:
        """Return where the element ends that is being closed: its closing tag, or one that closes itself."""
        return self.content.index(b">", self._parser.CurrentByteIndex) + 1


def _material(text: str, elements: list[str], attributes: dict[str, str], span: tuple[int, int]) -> DeckMaterial:
    head = text[: text.index(">") + 1]
    if head.endswith("/>"):
        head = head[:-2].rstrip() + ">"
    kind = attributes.get("type", "")
    refused = "it is a rigid body." if kind == SHARED else ""
    if NOT_ELASTIC_ALONE.search(kind):
        refused = f"type '{kind}' does more than an elastic material, {MORE_THAN_ELASTIC}"
    return DeckMaterial(
        attributes.get("name", ""), attributes.get("id", ""), (span,), (head, *elements), refused,
    )  # fmt: skip
