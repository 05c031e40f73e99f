"""The files of a user's model: those that go with the deck, and copies of all in another folder."""

from __future__ import annotations

import filecmp
import json
import os
import shutil
from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path

from tissuq.decks.deck import Deck
from tissuq.errors import InputError

MODEL = "model"
"""Folder with copies of the files of the model."""
OUTSIDE = "outside.json"
"""Digests of the files with absolute names that the deck includes, which are not copied."""


def copy_model(deck: Deck, also: Sequence[str], beside: Path, folder: Path, *, is_replaced: bool = False) -> None:
    """Copy the files of a model into the folder of an ensemble, or see that they are those that lie there.

    Others that lie there are replaced only if ``is_replaced``.

    Raises
    ------
    InputError
        When the folder holds another model.
    """
    stored, extra = folder / MODEL, extra_files(deck, also, beside)
    digests = json.dumps({name: _digest(Path(name)) for name in deck.outside}, indent=2) + "\n"
    if stored.is_dir():
        stored_files = {name: (stored / name).read_bytes() for name in deck.files if (stored / name).is_file()}
        outside = folder / OUTSIDE
        stored_digests = outside.read_text(encoding="utf-8") if outside.is_file() else "{}\n"
        is_same = (stored_files, stored_digests) == (deck.files, digests) and all(
            (stored / name).is_file() and filecmp.cmp(stored / name, file, False) for name, file in extra.items()
        )
        if is_same:
            return
        if not is_replaced:
            raise InputError(f"'{folder}' holds runs of another model; choose another folder.")
        shutil.rmtree(stored)
    scratch = folder / f"{MODEL}.new"
    shutil.rmtree(scratch, ignore_errors=True)
    for name, content in deck.files.items():
        (scratch / name).parent.mkdir(parents=True, exist_ok=True)
        (scratch / name).write_bytes(content)
    for name, file in extra.items():
        shutil.copyfile(file, scratch / name)
    if deck.outside:
        (folder / OUTSIDE).write_text(digests, encoding="utf-8")
    scratch.rename(stored)


def deck_folder(deck: Deck) -> str:
    """Return the folder of the deck's main file within its root, with a slash at the end unless it is the root."""
    return deck.main[: deck.main.rfind("/") + 1]


def extra_files(deck: Deck, also: Sequence[str], beside: Path) -> dict[str, Path]:
    """Return the files that go with the deck and that it does not include, by their places in its root.

    Of the same file in several folders one is taken: decks that are run together may have a copy each.

    Raises
    ------
    InputError
        When one is not there, or would take the place of another.
    """
    extra: dict[str, Path] = {}
    for file in (beside / name for name in also):
        path = deck_folder(deck) + file.name
        if not os.path.isfile(file):
            raise InputError(f"there is no file '{file}' to go with the model (--also).")
        if included_place(deck, file) is not None:
            continue
        if path in deck.files and deck.files[path] != file.read_bytes():
            raise InputError(f"'{file}' would take the place of a file of the model (--also).")
        if path in extra and not filecmp.cmp(extra[path], file, False):
            raise InputError(f"two files called '{file.name}' are to go with the model (--also): rename one.")
        if path not in deck.files:
            extra[path] = file
    return extra


def stored_place(deck: Deck, file: Path) -> str:
    """Return where a file that goes with the deck is in the folder of an ensemble, or its absolute name."""
    path = included_place(deck, file)
    if path is None:
        path = deck_folder(deck) + file.name
    return path if os.path.isabs(path) else f"{MODEL}/{path}"


def included_place(deck: Deck, file: Path) -> str | None:
    """Return the place of a file that the deck includes: in its root, or its absolute name; None of any other."""
    absolute = Path(os.path.abspath(file))
    if any(Path(os.path.abspath(name)) == absolute for name in deck.outside):
        return str(absolute)
    path = absolute.relative_to(deck.root).as_posix() if absolute.is_relative_to(deck.root) else ""
    return path if path in deck.files else None


def _digest(file: Path) -> str:
    try:
        return sha256(file.read_bytes()).hexdigest()
    except (OSError, ValueError) as error:
        raise InputError(f"the file '{file}' that the model includes cannot be read.") from error
