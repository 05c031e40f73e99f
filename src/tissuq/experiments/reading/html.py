"""Tables of a web page, as machines and databases export them, often in files that are named as workbooks."""

from __future__ import annotations

import os
from html.parser import HTMLParser

from tissuq.experiments.reading.file_format import FileFormat, line_of
from tissuq.experiments.reading.text_file import read_lines

BEGINNINGS = (b"<html", b"<!doctype html", b"<table", b"<meta", b"<head", b"<body", b"<!--")
BYTE_ORDER_MARKS = b"\xef\xbb\xbf\xff\xfe"
"""Their bytes."""
UNSEEN = frozenset(["script", "style", "title"])
"""Elements whose text a browser does not show on the page."""
CELLS = frozenset(["td", "th"])
MOST_SPANNED = 100
"""Columns that a cell spans at most."""
LINES = frozenset(["tr", "p", "div", "br", "li", "table", "h1", "h2", "h3", "h4", "caption"])
"""Elements that begin a line."""


class Html(FileFormat):
    """A page with tables: a line for each of their rows, and for the text between them."""

    name = "html"
    signature = b"<html"

    @classmethod
    def recognises(cls, path: str | os.PathLike[str], start: bytes) -> bool:
        text = start.lstrip(BYTE_ORDER_MARKS).replace(b"\0", b"").lstrip().lower()
        return text.startswith(BEGINNINGS) or (text.startswith(b"<?xml") and b"html" in text)

    def sheets(self, path: str | os.PathLike[str]) -> dict[str, list[str]]:
        page = _Page()
        page.feed("\n".join(read_lines(path)))
        page.close()
        return {"page": [line_of(cells) for cells in page.rows if cells]}


class _Page(HTMLParser):
    """The rows of cells of a page."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.rows: list[list[str]] = [[]]
        self._is_in_cell = False
        self._unseen, self._empty_after = 0, 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag in UNSEEN:
            self._unseen += 1
        elif tag in CELLS:
            self._end_cell()
            self._is_in_cell = True
            self.rows[-1].append("")
            span = dict(attrs).get("colspan") or ""
            self._empty_after = min(int(span), MOST_SPANNED) - 1 if span.isdecimal() and int(span) else 0
        else:
            self._begin_line(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag in UNSEEN:
            self._unseen = max(0, self._unseen - 1)
        elif tag in CELLS:
            self._end_cell()
        else:
            self._begin_line(tag)

    def handle_data(self, data: str) -> None:
        text = " ".join(data.split())
        if not text or self._unseen:
            return
        row = self.rows[-1]
        if row:
            row[-1] = f"{row[-1]} {text}".strip()
        else:
            row.append(text)

    def _begin_line(self, tag: str) -> None:
        """Begin a line where a tag does, after a blank one where a table begins or ends."""
        if tag in ("tr", "table") or (tag in LINES and not self._is_in_cell):
            self._end_cell()
            self.rows += [[""], []] if tag == "table" else [[]]

    def _end_cell(self) -> None:
        """Add the empty cells that the last one spans."""
        self.rows[-1] += [""] * self._empty_after
        self._is_in_cell, self._empty_after = False, 0
