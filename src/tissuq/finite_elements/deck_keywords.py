"""The lines of a deck, and the keywords of those of Abaqus and CalculiX with the data below them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass


def decoded(content: bytes) -> str:
    """Return the text of a part of a deck; bytes that are no UTF-8 are kept for `encoded`."""
    return content.decode("utf-8", "surrogateescape")


def encoded(text: str) -> bytes:
    """Return the bytes of a text of `decoded`."""
    return text.encode("utf-8", "surrogateescape")


@dataclass(frozen=True)
class Line:
    """A line of a file: where it starts and ends (bytes, its end of line included), and its text without that."""

    start: int
    end: int
    text: str


def lines_of(content: bytes) -> Iterator[Line]:
    """Return the lines of a file."""
    start = 0
    for line in content.splitlines(keepends=True):
        yield Line(start, start + len(line), decoded(line).rstrip("\r\n"))
        start += len(line)


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
        parameters = {joined(key): value.strip().strip('"') for key, _, value in pairs if key.strip()}
        end = body[-1].end if body else head[-1].end
        data = tuple(line.text.strip() for line in body)
        yield Keyword(joined(name), parameters, head[0].start, end, data)


def joined(word: str) -> str:
    """Return a keyword as the programs compare it: without blanks, in capitals."""
    return re.sub(r"\s", "", word).upper()


def generated(rows: Iterable[Sequence[str]]) -> Iterator[int]:
    """Yield the numbers that rows of a set with ``GENERATE`` stand for: the first, the last and the step, or one."""
    for row in rows:
        first, last, step = (*map(int, row), 1)[:3]
        yield from range(first, last + 1, step)
