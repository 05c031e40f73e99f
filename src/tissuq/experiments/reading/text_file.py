"""A text file as lines, whatever its encoding."""

from __future__ import annotations

import os
import re
from difflib import get_close_matches
from pathlib import Path

from tissuq.errors import InputError
from tissuq.experiments.numbers import without_marks
from tissuq.experiments.reading.vocabulary import DIMENSION_NAMES, ROLES

DATA_SETS = Path(__file__).parents[1] / "data"
"""Folder of the measured curves that come with the package."""
BYTE_ORDER_MARKS = {b"\xef\xbb\xbf": "utf-8-sig", b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}
NOT_TEXT = {
    b"%PDF": "a PDF document",
    b"\x89HDF": "an HDF5 file",
    b"<?xml": "an XML document",
}
CHINESE_WORD = re.compile(r"[\u4e00-\u9fff]{2,}")
KOREAN_WORD = re.compile(
    f"[{bytes(byte for a in range(0xB0, 0xC9) for b in range(0xA1, 0xFF) for byte in (a, b)).decode('euc_kr')}]{{2,}}"
)
"""Of the syllables that are in use."""
POLISH_WORD = re.compile(r"(?<!\w)(?=[^\W\d_]{3,})[^\W\d_]*(?:[łżźąŁŻ]|[śŚ](?=[cćlmnrw]))[a-ząćęłńóśźż]+(?!\w)")
"""One with a letter of its own before others: the power of cm³ ends a word, and œ is before others in French."""
JAPANESE_WORD = re.compile(r"[\u3040-\u30fa\u30fc\u4e00-\u9fff]{2,}")
RUSSIAN_WORD = re.compile(r"(?<!\w)(?:[А-ЯЁ]?[а-яё]{2,}|[А-ЯЁ]{2,}|[кмМГ]?(?:Н|Па))(?!\w)")
"""One in capitals, in small letters, or with a capital first, as letters of another alphabet hardly make one."""
LANGUAGES = {
    "cp1250": (POLISH_WORD, "łśżźąćęńóŁŚŻĆÓ".encode("cp1250")),
    "cp932": (JAPANESE_WORD, range(0x81, 0x99)),
    "cp949": (KOREAN_WORD, range(0xB0, 0xC9)),
    "gb18030": (CHINESE_WORD, range(0xB0, 0xD8)),
    "big5": (CHINESE_WORD, range(0xA4, 0xC7)),
    "cp1251": (RUSSIAN_WORD, range(0xA8, 0x100)),
    "cp866": (RUSSIAN_WORD, range(0x80, 0xF2)),
    "koi8-r": (RUSSIAN_WORD, range(0xA3, 0x100)),
}
"""Encodings of other alphabets than Western Europe's: their words, and the first bytes of their usual characters.

Of those that fit alike the first one is taken: Chinese texts hardly keep to the bytes of Korean ones.
"""
SHARE_OF_WORDS = 0.25
"""Usual characters in such words over those beyond ASCII, at least."""
WESTERN = "cp1252"
"""The encoding where nothing speaks for another one."""
NAMES = frozenset().union(*ROLES.values(), *DIMENSION_NAMES.values())
"""Of columns and sizes: whichever encoding makes most of them is taken before shares of words."""
BETWEEN_NAMES = re.compile(r"""[,;:=|"()\[\]/\s]+""")
LINES_FOR_ENCODING = 200
"""Lines with bytes beyond ASCII that show an encoding."""
FORTRAN_EXPONENT = re.compile(r"(\d\.\d*|\.\d+)[dD]([+-]\d{2,3})\b")
"""As in ``1.234D+02``."""
LINE_END = re.compile(r"(?<!\r)\r+\n")
"""Of Windows, also where a program has made it twice (``\\r\\r\\n``): no line is between."""
RETURN_IN_LINE = re.compile(r"\r(?=[,;\t])")
"""A return that a program left at the end of a cell."""
NO_ROW = re.compile(r"\s*(?:<(?:END [^<>]*|divider)>|(?=.*\|)[\s|:+]*-{2,}[-\s|:+]*)\s*")
"""A line that ends a table, as of Mach-1 (``<END DATA>``), and one that rules it, as of Markdown (``|---|---:|``)."""
FRAMED = re.compile(r"^\s*\|(.*)\|\s*$")
"""A row between vertical bars."""
LONGEST_LINE = 100_000
"""Characters of a line of text."""


def read_lines(path: str | os.PathLike[str]) -> list[str]:
    """Return the lines of a text file, numbered as an editor shows them, without their ends.

    UTF-8 (with or without byte order mark), UTF-16, Shift-JIS, EUC-KR, GB18030, Big5, Cyrillic, Windows/Latin-1 and
    Polish Windows are told apart by their bytes.

    Raises
    ------
    InputError
        When there is no such file, it cannot be read, is empty, or is not text.
    """
    text = _decoded(path, _content(Path(path)))
    text = FORTRAN_EXPONENT.sub(r"\1e\2", text) if any(sign in text for sign in ("D+", "D-", "d+", "d-")) else text
    text = without_marks(text.replace("\u2212", "-"))
    if "\r" in text:
        text = LINE_END.sub("\n", text)
        if "\n" in text:  # without one, a return ends a line
            text = RETURN_IN_LINE.sub("", text)
        text = text.replace("\r", "\n")
    lines = text.split("\n")
    if "|" in text or "<" in text:
        lines = ["" if NO_ROW.fullmatch(line) else FRAMED.sub(r"\1", line) for line in lines]
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
        raise InputError(
            f"{path} is empty; expected a table with two columns of numbers or more, such as stretches and stresses."
        )
    return content


def _close_file(path: Path) -> str:
    if (DATA_SETS / f"{path}.csv").is_file():
        return f" The data set of that name, which comes with tissuq, is tissuq.datasets.load('{path}')."
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
        text = re.sub("\0(?=\r*\n)", "", text)  # some machines (WinTest) end their first line with a NUL
        if "\0" not in text:
            return text
    raise InputError(f"{path} is a binary file, not text; export the table as CSV and give that file.")


def _encodings(content: bytes) -> list[str]:
    for mark, encoding in BYTE_ORDER_MARKS.items():
        if content.startswith(mark):
            return [encoding]
    if b"\0" in content[:2]:
        return ["utf-16-be" if content[0] == 0 else "utf-16-le"]
    if content.isascii():
        return ["utf-8"]
    lines = [line for line in content.splitlines() if not line.isascii()]
    sample = b"\n".join(lines[:LINES_FOR_ENCODING])
    shares = {WESTERN: SHARE_OF_WORDS} | {encoding: _share_of_words(sample, encoding) for encoding in LANGUAGES}
    names = {encoding: _names_of_columns(sample, encoding) for encoding in shares}
    likely = max(shares, key=lambda encoding: (names[encoding], shares[encoding]))
    return ["utf-8", likely, WESTERN, "latin-1"]


def _names_of_columns(content: bytes, encoding: str) -> int:
    """Return how many known names of columns and sizes with letters beyond ASCII a text has; they may be very short."""
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError:
        return 0
    return sum(not word.isascii() and word.strip().lower() in NAMES for word in BETWEEN_NAMES.split(text))


def _share_of_words(content: bytes, encoding: str) -> float:
    """Return the usual characters of an encoding in words of its languages, over those beyond ASCII.

    Bytes that begin these characters are no letters in Western Europe, or hardly stand there beside one another.
    """
    words, first_bytes = LANGUAGES[encoding]
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError:
        return 0.0
    characters = "".join(words.findall(text))
    count = sum(letter.encode(encoding)[0] in first_bytes for letter in characters)
    return count / max(1, sum(not letter.isascii() for letter in text))
