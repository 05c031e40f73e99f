"""Decks of LS-DYNA: ``*MAT_...`` keywords by their number or title, and included files."""

from __future__ import annotations

import re
from itertools import pairwise

from tissuq.decks.deck import MORE_THAN_ELASTIC, DeckFormat, DeckMaterial
from tissuq.finite_elements.deck_keywords import Line, lines_of

NOT_ELASTIC = ("*MAT_ADD", "*MAT_THERMAL", "*MAT_NONLOCAL")
"""Keywords that belong to another one, or to the temperature."""
VISCOELASTIC = re.compile(r"VISCO|CREEP|_0?(06|61|76|92|134|164|175|176)(?!\d)")
"""Names, and numbers, of viscoelastic materials."""
WIDTH, LONG = 10, 20
"""Columns of a field, and in the long format."""


class LSDynaDeck(DeckFormat):
    """``*MAT_...`` up to the next keyword: all of it is replaced but its number, its title and its density."""

    name = "ls-dyna"
    card_format = "ls-dyna"
    suffixes = (".k", ".key", ".dyn")

    def recognises(self, content: bytes) -> bool:
        return bool(re.search(rb"^\*KEYWORD", content, re.IGNORECASE | re.MULTILINE))

    def includes(self, content: bytes) -> list[str]:
        names = []
        for keyword, *data in _blocks(content):
            if keyword.text.split()[0].upper() in ("*INCLUDE", "*INCLUDE_TRANSFORM"):
                rows = data if keyword.text.strip().upper() == "*INCLUDE" else data[:1]
                names += re.sub(r"\s\+\n\s*", "", "\n".join(line.text.rstrip() for line in rows)).splitlines()
        return [name.strip() for name in names if name.strip()]

    def materials(self, content: bytes) -> list[DeckMaterial]:
        materials = []
        for keyword, *data in _blocks(content):
            name = keyword.text.split()[0].upper()
            if name.startswith("*MAT_") and not name.startswith(NOT_ELASTIC) and data:
                is_titled = name.endswith("_TITLE")
                title = data[0].text if is_titled else ""
                row = data[1 if is_titled and len(data) > 1 else 0].text
                number, density = _fields(row, LONG if re.search(r"\s\+\s*$", keyword.text) else WIDTH)
                span = keyword.start, data[-1].end
                refused = f"{name} depends on time, {MORE_THAN_ELASTIC}" if VISCOELASTIC.search(name) else ""
                materials.append(DeckMaterial(title.strip(), number, (span,), (title, number, density), refused))
        return materials

    def matches(self, material: DeckMaterial, wanted: str) -> bool:
        same_number = wanted.isdigit() and material.number.isdigit() and int(wanted) == int(material.number)
        return same_number or super().matches(material, wanted)

    def fragment(self, material: DeckMaterial, block: str) -> str:
        title, number, density = material.remains
        keyword, name, names, row, *more_rows = block.splitlines()
        numbered = f"{number:>{LONG}}{density:>{LONG}}{row[2 * LONG :]}"
        return "\n".join([keyword, title or name, names, numbered, *more_rows, ""])


def _blocks(content: bytes) -> list[list[Line]]:
    """Return every keyword with the lines of its data, without comments."""
    lines = [line for line in lines_of(content) if not line.text.startswith("$")]
    starts = [index for index, line in enumerate(lines) if line.text.startswith("*")]
    return [_trimmed(lines[start:end]) for start, end in pairwise([*starts, len(lines)])]


def _trimmed(block: list[Line]) -> list[Line]:
    while len(block) > 1 and not block[-1].text.strip():
        block = block[:-1]
    return block


def _fields(row: str, width: int) -> tuple[str, str]:
    """Return the first two fields of a row: a material's number and its density."""
    words = row.split(",") if "," in row else [row[:width], row[width : 2 * width]]
    return words[0].strip(), words[1].strip() if len(words) > 1 else ""
