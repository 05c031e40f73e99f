"""Decks of ANSYS (APDL text and .cdb files): ``TB`` and ``MP`` commands by the number of a material."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence

from tissuq.decks.deck import DeckFormat, DeckMaterial, Line, decoded, lines_of
from tissuq.errors import InputError

__all__ = ["AnsysDeck"]

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
