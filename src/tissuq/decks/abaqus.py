"""Abaqus: its decks, which CalculiX reads, too, and its result file (``.odb``), which only its own Python opens."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tissuq.decks.deck import DeckFormat, DeckMaterial, MeshSize
from tissuq.decks.result_file import ALL, TENSOR, ResultFile, Values, unknown_set
from tissuq.errors import InputError
from tissuq.finite_elements.deck_keywords import Keyword, generated, joined, keywords_of

ELASTICITY = {"ELASTIC", "HYPERELASTIC", "HYPERFOAM", "ANISOTROPICHYPERELASTIC", "USERMATERIAL", "DEPVAR"}
"""Options of a material that a card replaces."""
DEPENDENT = {
    "VISCOELASTIC", "PLASTIC", "MULLINSEFFECT", "CREEP", "HYSTERESIS", "CYCLICHARDENING", "RATEDEPENDENT",
    "DEFORMATIONPLASTICITY", "NOCOMPRESSION", "NOTENSION", "LOWDENSITYFOAM", "DAMAGEINITIATION", "DAMAGEEVOLUTION",
    "UNIAXIALTESTDATA", "BIAXIALTESTDATA", "PLANARTESTDATA", "VOLUMETRICTESTDATA", "SIMPLESHEARTESTDATA",
}  # fmt: skip
"""Options of a material that change its stress, or would be read together with another card."""
ENDS = {
    "MATERIAL", "STEP", "PART", "ENDPART", "ASSEMBLY", "ENDASSEMBLY", "INSTANCE", "ENDINSTANCE", "NODE", "ELEMENT",
    "NSET", "ELSET", "SURFACE", "SURFACEINTERACTION", "CONNECTORBEHAVIOR", "BOUNDARY", "AMPLITUDE", "INITIALCONDITIONS",
}  # fmt: skip
"""Keywords below which no option of a material stands, as well as those of sections."""

ELEMENT = re.compile(r"((?P<solid>C3D)|CAX|CGAX|CPE|CPS|M3D|MAX|S)(?P<nodes>3|4|5|6|8|9|1[05]|2[07])(?!\d)")
"""Types of elements, and their nodes."""
NAMES_OF_SETS, NAMES_OF_ELEMENT_SETS = ("NSET", "NEWSET"), ("ELSET",)
"""Parameters by which keywords name the sets that they make."""
USERS = {
    "NODEPRINT", "NODEFILE", "NODEOUTPUT", "ELPRINT", "ELFILE", "ELEMENTOUTPUT", "CONTACTFILE", "CONTACTPRINT",
    "MONITOR",
}  # fmt: skip
"""Keywords that ask for what happens in a set, which another one makes."""


def _keywords_in(files: Sequence[bytes]) -> Iterator[Keyword]:
    """Return the keywords of several files, one after the other."""
    return chain.from_iterable(map(keywords_of, files))


class AbaqusDeck(DeckFormat):
    """``*MATERIAL, NAME=...`` in any case: of its options those that say its elasticity are replaced.

    The line with its name stays, and so do density, damping and other options that are not known to change its
    stress.
    """

    name = "abaqus"
    card_format = "abaqus"
    suffixes = (".inp",)

    def recognises(self, content: bytes) -> bool:
        return bool(
            re.search(rb"^\s*\*\s*(node|heading|material|include|part)\b", content, re.IGNORECASE | re.MULTILINE)
        )

    def includes(self, content: bytes) -> list[str]:
        return [keyword.parameters.get("INPUT", "") for keyword in keywords_of(content) if keyword.name == "INCLUDE"]

    def materials(self, content: bytes) -> list[DeckMaterial]:
        keywords, materials = list(keywords_of(content)), []
        for index, keyword in enumerate(keywords):
            if keyword.name == "MATERIAL":
                materials.append(_material(keyword, keywords[index + 1 :]))
        return materials

    def fragment(self, material: DeckMaterial, block: str) -> str:
        return block.partition("\n")[2]

    def node_sets(self, files: Sequence[bytes]) -> dict[str, set[int]]:
        """Return the sets of nodes that decks define, by their names in capitals, in whatever order they stand.

        Raises
        ------
        InputError
            When a set names one that no file defines, or its numbers are not understood.
        """
        sets: dict[str, set[int]] = {}
        references: dict[str, set[str]] = {}
        for keyword in _keywords_in(files):
            name = keyword.parameters.get("NSET", "").upper()
            if keyword.name not in ("NSET", "NODE") or not name:
                continue
            members, names = sets.setdefault(name, set()), references.setdefault(name, set())
            try:
                numbers, referenced = _members(keyword)
            except (ValueError, TypeError) as error:
                raise InputError(f"the numbers of the set of nodes '{name}' are not understood ({error}).") from error
            members |= numbers
            names |= referenced
        gone = _of_instances(references)
        for name in gone:
            del sets[name], references[name]
        for name, referenced in references.items():
            for unknown in sorted(referenced - set(sets)):
                raise InputError(f"the set of nodes '{name}' has '{unknown}', which no file of the deck defines.")
        while any(
            not sets[reference] <= sets[name] for name, referenced in references.items() for reference in referenced
        ):
            for name, referenced in references.items():
                sets[name].update(*(sets[reference] for reference in referenced))
        return sets

    def set_names(self, files: Sequence[bytes], *, of_elements: bool) -> set[str]:
        wanted = NAMES_OF_SETS + NAMES_OF_ELEMENT_SETS * of_elements
        keywords = [keyword for keyword in _keywords_in(files) if keyword.name not in USERS]
        return {
            keyword.parameters[name].upper() for keyword in keywords for name in wanted if name in keyword.parameters
        }

    def printed_elements(self, files: Sequence[bytes]) -> set[tuple[str, str]]:
        printing = [keyword for keyword in _keywords_in(files) if keyword.name == "ELPRINT"]
        return {
            (word.strip().upper(), keyword.parameters.get("ELSET", "").upper())
            for keyword in printing
            for line in keyword.data
            for word in line.split(",")
        }

    def mesh_size(self, files: Sequence[bytes]) -> MeshSize | None:
        counts: dict[int, int] = {}
        for keyword in _keywords_in(files):
            if keyword.name == "ELGEN":
                return None
            kind = ELEMENT.match(joined(keyword.parameters.get("TYPE", ""))) if keyword.name == "ELEMENT" else None
            if kind is not None:
                dimensions, row = 3 if kind["solid"] else 2, 1 + int(kind["nodes"])
                numbers = sum(bool(word.strip()) for line in keyword.data for word in line.split(","))
                counts[dimensions] = counts.get(dimensions, 0) + numbers // row
        return MeshSize(counts[max(counts)], max(counts)) if counts else None

    def is_axisymmetric(self, files: Sequence[bytes]) -> bool:
        elements = (keyword for keyword in _keywords_in(files) if keyword.name == "ELEMENT")
        return any(joined(keyword.parameters.get("TYPE", "")).startswith("CAX") for keyword in elements)


def _material(head: Keyword, following: Sequence[Keyword]) -> DeckMaterial:
    spans, refused = [], ""
    for option in following:
        if option.name in ELASTICITY:
            spans.append((option.start, option.end))
        elif option.name in DEPENDENT:
            refused = (
                f"*{option.name} belongs to the elasticity that the deck has, and would be read with that of the "
                "draws. Take it out of the deck, or give its effect to the material that is fitted."
            )
        elif option.name in ENDS or option.name.endswith("SECTION"):
            break
    return DeckMaterial(head.parameters.get("NAME", ""), "", tuple(spans or [(head.end, head.end)]), refused=refused)


def _of_instances(references: Mapping[str, set[str]]) -> set[str]:
    """Return the sets with sets of instances in them, as PART-1-1.TOP, whose numbers only a result file tells."""
    unresolved: set[str] = set()
    while (
        more := {
            name
            for name, referenced in references.items()
            if any("." in reference or reference in unresolved for reference in referenced)
        }
        - unresolved
    ):
        unresolved |= more
    return unresolved


def _members(keyword: Keyword) -> tuple[set[int], set[str]]:
    """Return the numbers of nodes below a keyword, and the names of sets, in capitals."""
    rows = [[word.strip() for word in row.split(",") if word.strip()] for row in keyword.data]
    if keyword.name == "NODE":
        return {int(row[0]) for row in rows if row}, set()
    words = [word for row in rows for word in row]
    if "GENERATE" not in keyword.parameters:
        return {int(word) for word in words if word.isdecimal()}, {
            word.upper() for word in words if not word.isdecimal()
        }
    return set(generated(rows)), set()


SCRIPT = Path(__file__).with_name("odb_table.py")
SUFFIX = ".tissuq.json"
"""What the name of the table ends in."""
LAST_LINES = 5
"""Lines of what Abaqus said that a message shows."""


class AbaqusResults(ResultFile):
    """Abaqus's output database; stresses are those extrapolated to nodes, averaged over the elements that meet there.

    Its strains are logarithmic ones, not Green's. Sets are those in the file, also of an instance
    (``PART-1-1.TOP``).
    """

    name = "abaqus"
    suffixes = (".odb",)
    requests = {  # noqa: RUF012  (as in the base class)
        "U": r"*OUTPUT, FIELD\n*NODE OUTPUT, NSET={set}\n U",
        "RF": r"*OUTPUT, FIELD\n*NODE OUTPUT, NSET={set}\n RF",
        "S": r"*OUTPUT, FIELD\n*ELEMENT OUTPUT\n S",
    }

    @property
    def nodes(self) -> NDArray[np.int64]:
        return np.zeros(0, dtype=np.int64)

    @cached_property
    def node_sets(self) -> Mapping[str, Collection[int]]:
        """The names of the sets in the file, of which the members stay in it."""
        return dict.fromkeys(self._table(())["sets"], ())

    def field(self, kind: str) -> Values | None:
        return self.of_set(kind, ALL, "")

    def of_set(self, kind: str, set_name: str, how: str) -> Values | None:
        if kind not in self.requests:
            return None
        request = f"{kind}@{set_name}"
        fields = self._table((request,))["fields"]
        if request not in fields:
            raise InputError(unknown_set(set_name, self.node_sets))
        field = fields[request]
        if field is None:
            return None
        width = len(TENSOR) if kind == "S" else 3
        is_within = self.results.reach(np.array(field["times"]))
        rows = [[row or [np.nan] * width for row in rows] for rows in field["rows"]]
        return Values(np.array(field["times"])[is_within], np.array(rows, dtype=np.float64)[is_within])

    def _table(self, requests: tuple[str, ...]) -> Mapping[str, Any]:
        """Return the table, written anew where it lacks a request."""
        target = self.path.with_name(self.path.name + SUFFIX)
        stored = _stored(target)
        if stored is None or not set(requests) <= set(stored["asked"]):
            all_requests = sorted({*requests, *(f"{kind}@{name}" for kind, name in self.results.asked)})
            self._write(target, all_requests)
            written = _stored(target) or {"sets": [], "fields": {}}
            stored = {**written, "asked": all_requests}
            target.write_text(json.dumps(stored), encoding="utf-8")
        return stored

    def _write(self, target: Path, requests: list[str]) -> None:
        program, *words = shlex.split(self.results.program) or ["abaqus"]
        command = [
            shutil.which(program) or program,
            *words,
            "python",
            str(SCRIPT),
            self.path.name,
            target.name,
            *requests,
        ]
        advice = "Name the program that opens it with --abaqus 'abaqus', or give the quantity by a function of yours."
        try:
            done = subprocess.run(  # noqa: S603  (the user's program, without a shell)
                command, cwd=self.path.parent, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL
            )
        except OSError as error:
            raise InputError(
                f"{self.label} cannot be opened: there is no program '{program}' to run. {advice}"
            ) from error
        if done.returncode or not target.is_file():
            lines = f"{done.stdout}\n{done.stderr}".strip().splitlines()[-LAST_LINES:]
            said = "".join(f"\n    {line}" for line in lines)
            said = f"It said:{said}" if said else f"It said nothing (exit status {done.returncode})."
            raise InputError(f"{self.label} cannot be opened by '{program} python'. {advice} {said}")


def _stored(target: Path) -> dict[str, Any] | None:
    """Return what is in a table; None where there is none, or it was cut short."""
    try:
        table = json.loads(target.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return {"asked": (), **table} if isinstance(table, dict) and "fields" in table else None
