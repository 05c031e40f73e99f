"""Files that a person drops on the page: their names made harmless, their sizes limited."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import AsyncIterator
from pathlib import Path

from tissuq.errors import InputError

__all__ = ["MAX_FILE", "MAX_FILES", "MAX_TOTAL", "free_name", "harmless_name", "store"]

MEGABYTE = 1_000_000
MAX_FILE, MAX_TOTAL, MAX_FILES = 50 * MEGABYTE, 200 * MEGABYTE, 60
"""Bytes of one file, bytes of all files of a session, and their number."""
MAX_LETTERS = 100
RESERVED = re.compile(r"(?i)(runs|cards|con|prn|aux|nul|com\d|lpt\d)(\.|$)")
"""Names that Windows or this page has another use for."""


def harmless_name(name: str) -> str:
    """Return the name of a file without folders, signs that shells or messages give a meaning, and excess length.

    Examples
    --------
    >>> harmless_name("../../etc/pass;wd.csv"), harmless_name("/data/Test 1 (kPa).xlsx")
    ('pass_wd.csv', 'Test 1 (kPa).xlsx')
    """
    last = unicodedata.normalize("NFC", name).replace("\\", "/").rpartition("/")[2]
    plain = re.sub(r"[^\w .,()+=\[\]-]", "_", last).strip().lstrip(".-").strip() or "file"
    stem, dot, ending = plain.rpartition(".") if "." in plain else (plain, "", "")
    short = stem[: MAX_LETTERS - len(dot + ending[:10])].strip() + dot + ending[:10]
    return f"_{short}" if RESERVED.match(short) else short


def free_name(name: str, folder: Path) -> str:
    """Return a name that no file in a folder has, also not in other letters (``A.csv``, ``a.csv``)."""
    taken = {path.name.casefold() for path in folder.iterdir()}
    stem, dot, ending = name.rpartition(".") if "." in name else (name, "", "")
    number, free = 1, name
    while free.casefold() in taken:
        number += 1
        free = f"{stem}-{number}{dot}{ending}"
    return free


async def store(chunks: AsyncIterator[bytes], name: str, folder: Path) -> str:
    """Write what arrives into a file of a folder; return its name there.

    Raises
    ------
    InputError
        When it is empty, too large, or there are too many; nothing of it is then left.
    """
    sizes = [path.stat().st_size for path in folder.iterdir() if path.is_file()]
    if len(sizes) >= MAX_FILES:
        raise InputError(f"there are {MAX_FILES} files already: remove some, or use 'tissuq fit' for so many.")
    target = folder / free_name(harmless_name(name), folder)
    size = 0
    try:
        with target.open("xb") as file:
            async for chunk in chunks:
                size += len(chunk)
                if size > MAX_FILE or size + sum(sizes) > MAX_TOTAL:
                    limit = f"{MAX_FILE // MEGABYTE} MB" if size > MAX_FILE else f"all {MAX_TOTAL // MEGABYTE} MB"
                    raise InputError(
                        f"'{target.name}' is too large for this page ({limit} at most). Take fewer rows, or use the "
                        f"command line, which has no limit: tissuq fit '{target.name}'."
                    )
                file.write(chunk)
        if not size:
            raise InputError(f"'{target.name}' is empty: was it saved before it was dropped here?")
    except BaseException:
        target.unlink(missing_ok=True)
        raise
    return target.name
