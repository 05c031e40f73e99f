"""A deck with its included files as bytes: its materials found, replaced, and nothing else touched."""

from __future__ import annotations

import os
import re
import shlex
from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from difflib import unified_diff
from hashlib import sha256
from pathlib import Path, PurePosixPath
from typing import ClassVar, NamedTuple

from tissuq.errors import InputError
from tissuq.finite_elements.deck_keywords import encoded, lines_of
from tissuq.registry import find, variants

CONTEXT = 3
"""Lines around a difference that are shown."""
HUNK = re.compile(r"( [-+])(\d+)")
"""The number of a line where a difference starts."""


MORE_THAN_ELASTIC = (
    "which would be lost with it. Name an elastic material, or write an elastic one in its place where that is meant."
)
"""End of the reason why a material with more than an elasticity is refused."""


@dataclass(frozen=True)
class DeckMaterial:
    """A material in a file of a deck.

    Attributes
    ----------
    name, number : str
        What it is called, and its number in the model; empty where the format has no such thing.
    spans : tuple of (int, int)
        The bytes that a card replaces: it stands in the place of the first, the others vanish.
    remains : tuple of str
        What the new text needs of the old one; every format has its meaning for them.
    refused : str
        What stands in the way of another card, in words.
    """

    name: str
    number: str
    spans: tuple[tuple[int, int], ...]
    remains: tuple[str, ...] = ()
    refused: str = ""

    @property
    def label(self) -> str:
        """The name, else the number."""
        return self.name or self.number


class MeshSize(NamedTuple):
    """The number of elements of most dimensions, and these dimensions."""

    elements: int
    dimensions: int


class DeckFormat(ABC):
    """The input of a finite-element program; a new one is one subclass in one file."""

    entry_point_group: ClassVar[str] = "tissuq.deck_formats"
    name: ClassVar[str]
    card_format: ClassVar[str]
    """The format of cards that goes into it."""
    suffixes: ClassVar[tuple[str, ...]]

    @abstractmethod
    def recognises(self, content: bytes) -> bool:
        """Return whether a file whose suffix several formats have is of this one."""

    @abstractmethod
    def includes(self, content: bytes) -> list[str]:
        """Return the names of the files that a file includes, as they stand there."""

    @abstractmethod
    def materials(self, content: bytes) -> list[DeckMaterial]:
        """Return the materials in a file."""

    @abstractmethod
    def fragment(self, material: DeckMaterial, block: str) -> str:
        """Return the text that replaces a material, from the block of a card with its number."""

    def node_sets(self, files: Sequence[bytes]) -> dict[str, set[int]]:
        """Return the sets of nodes that files define, by their names in capitals, where they are known.

        Raises
        ------
        InputError
            When they are not understood.
        """
        return {}

    def set_names(self, files: Sequence[bytes], *, of_elements: bool) -> set[str]:
        """Return the names, in capitals, of all sets that a result file can have; none where these are not known.

        With ``of_elements`` also those of elements, whose stresses some programs write.
        """
        return set()

    def printed_elements(self, files: Sequence[bytes]) -> set[tuple[str, str]]:
        """Return which fields (``S``, ``E``) of which sets of elements files have printed, where that is known."""
        return set()

    def mesh_size(self, files: Sequence[bytes]) -> MeshSize | None:
        """Return the number of elements of most dimensions, and these; None where they are not known."""
        return None

    def is_axisymmetric(self, files: Sequence[bytes]) -> bool:
        """Return whether files have elements of an axisymmetric body, where that is known."""
        return False

    def matches(self, material: DeckMaterial, wanted: str) -> bool:
        """Return whether a material is the one that is wanted: by its name, whatever its case, or its number."""
        return wanted.strip().casefold() in (material.name.strip().casefold(), material.number.casefold())


def deck_formats() -> dict[str, type[DeckFormat]]:
    """Return the formats by name."""
    return variants(DeckFormat)


@dataclass(frozen=True, eq=False)
class Deck:
    """A deck and all the files that it includes.

    Attributes
    ----------
    format : DeckFormat
    main : str
        The file that the program is given, relative to ``root`` as all are.
    files : mapping of str to bytes
    root : Path
        The folder that holds all of them.
    outside : tuple of str
        Included files with absolute names, and those that these include, which stay where they are.
    """

    format: DeckFormat
    main: str
    files: Mapping[str, bytes]
    root: Path
    outside: tuple[str, ...] = ()

    @classmethod
    def read(cls, path: str | Path, format: str | None = None, allowed: Collection[Path] | None = None) -> Deck:
        r"""Return the deck in a file.

        Parameters
        ----------
        path : str or Path
        format : str, optional
            ``"abaqus"`` (CalculiX, too), ``"febio"``, ``"ls-dyna"`` or ``"ansys"``; unless given, what the file looks
            like.
        allowed : collection of Path, optional
            Files outside of the folder of the deck that it may include, absolute; unless given, all.

        Raises
        ------
        InputError
            When a file is missing, is of no known format, or may not be included.

        Examples
        --------
        >>> import tempfile
        >>> from pathlib import Path
        >>> from tissuq.decks import Deck
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     file = Path(folder) / "bar.inp"
        ...     _ = file.write_text("*MATERIAL, NAME=Fat\n*ELASTIC\n1., 0.3\n*STEP\n")
        ...     deck = Deck.read(file)
        >>> deck.format.name, [material.name for _, material in deck.materials()]
        ('abaqus', ['Fat'])
        """
        main = Path(os.path.abspath(path))
        content = _content(main, "model")
        deck_format = (
            find(DeckFormat, "format of decks", format, InputError)() if format else _recognised(main, content)
        )
        files, outside, waiting = {main: content}, dict[Path, bytes](), [main]
        while waiting:
            file = waiting.pop()
            for name in deck_format.includes(files[file] if file in files else outside[file]):
                beside = [Path(os.path.abspath(folder / name)) for folder in (main.parent, file.parent)]
                included = next((candidate for candidate in beside if os.path.isfile(candidate)), beside[0])
                is_below = included.is_relative_to(main.parent)
                if os.path.isabs(name) or not is_below:
                    _check_allowed(included, file, allowed)
                if included in files or included in outside:
                    continue
                if not os.path.isabs(name) and (is_below or file in files):
                    files[included] = _content(included, f"file that '{file.name}' includes")
                    waiting.append(included)
                elif os.path.isfile(included):
                    outside[included] = _content(included, f"file that '{file.name}' includes")
                    waiting.append(included)
                else:
                    outside[included] = b""
        root = Path(os.path.commonpath([file.parent for file in files]))
        relative = {file.relative_to(root).as_posix(): text for file, text in files.items()}
        return cls(deck_format, main.relative_to(root).as_posix(), relative, root, tuple(map(str, outside)))

    @property
    def job(self) -> str:
        """The name of the main file without folder and suffix."""
        return PurePosixPath(self.main).stem

    @property
    def digest(self) -> str:
        """A text that changes with the files, other than those outside."""
        return sha256(repr(sorted(self.files.items())).encode()).hexdigest()[:24]

    def materials(self) -> list[tuple[str, DeckMaterial]]:
        """Return the files with materials in them, each with its material."""
        return [(file, material) for file, content in self.files.items() for material in self.format.materials(content)]

    def material(self, wanted: str) -> DeckMaterial:
        """Return the material of a name or number.

        Raises
        ------
        InputError
            When there is none, or more than one, or a card cannot replace it.
        """
        return self._placed(wanted)[1]

    def with_materials(self, blocks: Mapping[str, str]) -> dict[str, bytes]:
        """Return the files that change, where the blocks of cards replace the materials of these names or numbers.

        Raises
        ------
        InputError
            As `material`.
        """
        edits: dict[str, list[tuple[int, int, bytes]]] = {}
        for wanted, block in blocks.items():
            file, material = self._placed(wanted)
            end_of_line = b"\r\n" if b"\r\n" in self.files[file] else b"\n"
            text = encoded(self.format.fragment(material, block)).replace(b"\n", end_of_line)
            main_span, *more_spans = material.spans
            edits.setdefault(file, []).append((*main_span, text))
            edits[file] += [(*span, b"") for span in more_spans]
        return {file: _edited(self.files[file], sorted(file_edits)) for file, file_edits in edits.items()}

    def diff(self, changed: Mapping[str, bytes]) -> str:
        """Return the difference of the files that change, as ``diff -u`` shows it."""
        lines: list[str] = []
        for file, content in changed.items():
            lines += _difference(
                file, *([line.text for line in lines_of(text)] for text in (self.files[file], content))
            )
        return "\n".join(lines)

    def _placed(self, wanted: str) -> tuple[str, DeckMaterial]:
        matching = [(file, material) for file, material in self.materials() if self.format.matches(material, wanted)]
        if len(matching) == 1:
            if matching[0][1].refused:
                raise InputError(f"material '{wanted}' in '{matching[0][0]}': {matching[0][1].refused}")
            return matching[0]
        if matching:
            file_names = ", ".join(f"'{file}'" for file, _ in matching)
            raise InputError(f"the model '{self.main}' has {len(matching)} materials '{wanted}' (in {file_names}).")
        names = ", ".join(material.label for _, material in self.materials()) or "none that is known"
        outside = f" Files with absolute names were not looked at: {', '.join(self.outside)}." if self.outside else ""
        raise InputError(f"the model '{self.main}' has no material '{wanted}'; its materials are {names}.{outside}")


def _content(file: Path, what: str) -> bytes:
    try:
        return file.read_bytes()
    except (OSError, ValueError) as error:  # the latter of a NUL in its name
        reason, readable = getattr(error, "strerror", None) or error, repr(str(file))[1:-1]
        raise InputError(f"the {what} '{readable}' cannot be read: {reason}.") from error


def _check_allowed(included: Path, file: Path, allowed: Collection[Path] | None) -> None:
    """Refuse a file outside of the folder of a deck unless it is one of those that may be included."""
    if allowed is not None and included not in allowed:
        raise InputError(
            f"'{file.name}' includes '{included}', outside of the folder of the model: if that is meant, add "
            f"--also {shlex.quote(str(included))}."
        )


def _recognised(file: Path, content: bytes) -> DeckFormat:
    kinds = [kind() for kind in deck_formats().values() if file.suffix.lower() in kind.suffixes]
    if len(kinds) == 1:
        return kinds[0]
    for kind in kinds or [kind() for kind in deck_formats().values()]:
        if kind.recognises(content):
            return kind
    raise InputError(f"'{file.name}' looks like no known deck: say which it is with --deck {'|'.join(deck_formats())}.")


def _difference(file: str, old_lines: list[str], new_lines: list[str]) -> list[str]:
    """Return the difference of the lines of a file, of which the equal ones at its start and end are not compared."""
    pairs = enumerate(zip(old_lines, new_lines, strict=False))
    equal = next((index for index, (old, new) in pairs if old != new), min(len(old_lines), len(new_lines)))
    backwards = enumerate(zip(old_lines[:equal:-1], new_lines[:equal:-1], strict=False))
    tail = next((index for index, (old, new) in backwards if old != new), min(len(old_lines), len(new_lines)) - equal)
    start, end = max(0, equal - CONTEXT), max(0, tail - CONTEXT)
    excerpts = old_lines[start : len(old_lines) - end], new_lines[start : len(new_lines) - end]
    difference = unified_diff(*excerpts, f"{file} (the model)", f"{file} (a draw)", n=CONTEXT, lineterm="")
    return [
        HUNK.sub(lambda match: f"{match[1]}{int(match[2]) + start}", line) if line[:2] == "@@" else line
        for line in difference
    ]


def _edited(content: bytes, edits: list[tuple[int, int, bytes]]) -> bytes:
    pieces, position = [], 0
    for start, end, text in edits:
        pieces += [content[position:start], text]
        position = end
    return b"".join([*pieces, content[position:]])
