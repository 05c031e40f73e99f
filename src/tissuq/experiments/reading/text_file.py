"""A text file as lines, whatever its encoding."""

from __future__ import annotations

import os
import re
from difflib import get_close_matches
from pathlib import Path

from tissuq.errors import InputError

__all__ = ["read_lines"]

BYTE_ORDER_MARKS = {b"\xef\xbb\xbf": "utf-8-sig", b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}
NOT_TEXT = {
    b"%PDF": "a PDF document",
    b"\x89HDF": "an HDF5 file",
}
JAPANESE = "cp932"
"""Windows' form of Shift-JIS."""
JAPANESE_WORD = re.compile(r"[\u3040-\u30fa\u30fc\u4e00-\u9fff]{2,}")
JAPANESE_SHARE = 0.25
"""Bytes that begin characters of Shift-JIS, and characters in words of it, over the bytes beyond ASCII, at least."""
LONGEST_LINE = 100_000
"""Characters of a line of text."""


def read_lines(path: str | os.PathLike[str]) -> list[str]:
    """Return the lines of a text file, numbered as an editor shows them, without their ends.

    UTF-8 (with or without byte order mark), UTF-16, Shift-JIS and Windows/Latin-1 are told apart by their bytes.

    Raises
    ------
    InputError
        When there is no such file, it cannot be read, is empty, or is not text.
    """
    text = _decoded(path, _content(Path(path)))
    lines = text.replace("\u2212", "-").replace("\r\n", "\n").replace("\r", "\n").split("\n")
    if len(max(lines, key=len)) > LONGEST_LINE:
        raise InputError(f"{path}: a line is longer than {LONGEST_LINE} characters; this is not a table in text form.")
    return lines


def _content(path: Path) -> bytes:
    if path.is_dir():
        raise InputError(f"{path} is a folder; give one of the files in it.")
    try:
        content = path.read_bytes()
    except FileNotFoundError as error:
        raise InputError(f"{path}: there is no such file.{_close_file(path)}") from error
    except PermissionError as error:
        raise InputError(f"{path} cannot be opened: you have no permission to read it.") from error
    except (OSError, ValueError) as error:
        raise InputError(f"{path} cannot be read: {error}.") from error
    if not content.strip():
        raise InputError(f"{path} is empty; expected a table with a column of stretches and one of stresses.")
    return content


def _close_file(path: Path) -> str:
    neighbours = [file.name for file in path.parent.iterdir()] if path.parent.is_dir() else []
    close = get_close_matches(path.name, neighbours, n=1)
    return f" Did you mean '{path.parent / close[0]}'?" if close else " Check the name and the folder."


def _decoded(path: str | os.PathLike[str], content: bytes) -> str:
    for signature, kind in NOT_TEXT.items():
        if content.startswith(signature):
            raise InputError(f"{path} is {kind}, not text; save it as .xlsx or CSV and give that file.")
    for encoding in _encodings(content):
        try:
            text = content.decode(encoding)
        except UnicodeDecodeError:
            continue
        text = re.sub("\0(?=\r?\n)", "", text)  # some machines (WinTest) end their first line with a NUL
        if "\0" not in text:
            return text
    raise InputError(f"{path} is a binary file, not text; export the table as CSV and give that file.")


def _encodings(content: bytes) -> list[str]:
    for mark, encoding in BYTE_ORDER_MARKS.items():
        if content.startswith(mark):
            return [encoding]
    if b"\0" in content[:2]:
        return ["utf-16-be" if content[0] == 0 else "utf-16-le"]
    return ["utf-8", *([JAPANESE] if _may_be_japanese(content) else []), "cp1252", "latin-1"]


def _may_be_japanese(content: bytes) -> bool:
    """Tell whether bytes are words of Shift-JIS: bytes that begin its characters are no letters in Western Europe."""
    non_ascii = content.translate(None, bytes(range(0x80)))
    beyond_ascii, leading = len(non_ascii), len(non_ascii.translate(None, bytes([0x80, *range(0xA0, 0x100)])))
    if leading <= JAPANESE_SHARE * beyond_ascii:
        return False
    words = JAPANESE_WORD.findall(content.decode(JAPANESE, errors="replace"))
    return sum(map(len, words)) > JAPANESE_SHARE * beyond_ascii
