"""The plot file of FEBio 3 and 4 (``.xplt``): its tree of chunks, its mesh with its sets, and its fields."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tissuq.arrays import FloatArray
from tissuq.decks.result_file import AS_TENSOR, ResultFile, Values
from tissuq.errors import InputError

# The facts of the format are those of FEBio's source, github.com/febiosoftware/FEBio at 0e8b7db: tags and what is
# written below them in FEBioPlot/FEBioPlotFile.h and .cpp, chunks and their compression in FEBioPlot/PltArchive.h and
# .cpp, types and storage in FECore/fecore_enum.h, the order of a tensor in FECore/FEDataStream.h.
MAGIC = 0x00464542
ROOT, HEADER, VERSION, DICTIONARY = 0x01000000, 0x01010000, 0x01010001, 0x01020000
NODAL, DOMAIN_WISE, ITEM_FORMAT, ITEM_NAME = 0x01023000, 0x01024000, 0x01020003, 0x01020004
MESH, NODE_SECTION, COORDINATES = 0x01040000, 0x01041000, 0x01041200
DOMAINS, ELEMENTS = 0x01042000, 0x01042200
NODE_SETS, NODE_SET_HEADER, NODE_SET_NAME, NODE_LIST = (
    0x01044000, 0x01044101, 0x01044103, 0x01044200,
)  # fmt: skip
FACET_SETS, FACET_SET_HEADER, FACET_SET_NAME, FACETS = (
    0x01047000, 0x01047101, 0x01047103, 0x01047200,
)  # fmt: skip
STATE, STATE_HEADER, TIME, STATUS = 0x02000000, 0x02010000, 0x02010002, 0x02010003
STATE_DATA, VARIABLE_NUMBER, VARIABLE_DATA = 0x02020000, 0x02020002, 0x02020003
NODE_DATA, ELEMENT_DATA = 0x02020300, 0x02020400
PER_ELEMENT, PER_NODE_OF_ELEMENT = 1, 2
"""Storage of a field of a domain: FMT_ITEM and FMT_MULT."""
FIRST_VERSION = 0x0030
"""That of FEBio 3."""
FIELDS = {
    "U": ("displacement",),
    "RF": ("reaction forces",),
    "S": ("nodal stress", "stress"),
    "E": ("Lagrange strain",),
}
"""Variables that hold a field, the one at nodes first."""


class Chunk(NamedTuple):
    """A chunk: its tag, and what is in it."""

    tag: int
    content: memoryview


def chunks(content: memoryview) -> Iterator[Chunk]:
    """Return the chunks that follow each other, up to one that is cut short."""
    offset = 0
    while offset + 8 <= len(content):
        tag, size = struct.unpack_from("<II", content, offset)
        if offset + 8 + size > len(content):
            return
        yield Chunk(tag, content[offset + 8 : offset + 8 + size])
        offset += 8 + size


def child(content: memoryview, *tags: int) -> memoryview:
    """Return what is in the first chunk under each tag after the other; nothing where there is none."""
    for tag in tags:
        content = next((chunk.content for chunk in chunks(content) if chunk.tag == tag), memoryview(b""))
    return content


def _top(content: bytes) -> Iterator[Chunk]:
    """Return the chunks at the top, of which each may be a stream of zlib of its own."""
    unread = memoryview(content)[4:]
    while len(unread) >= 8:
        if unread[0]:  # the tags at the top end in a zero, the first byte of a stream is 0x78
            stream = zlib.decompressobj()
            unpacked = memoryview(stream.decompress(unread))
            if not stream.eof:
                return
            yield from chunks(unpacked)
            unread = unread[len(unread) - len(stream.unused_data) :]
            continue
        chunk = next(chunks(unread), None)
        if chunk is None:
            return
        yield chunk
        unread = unread[8 + len(chunk.content) :]


@dataclass(frozen=True)
class PlotFile:
    """The content of a plot file.

    Attributes
    ----------
    points : (n, 3) array
    domains : tuple of (e, k) int array
        Places of the nodes of their elements.
    node_sets : mapping of str to int array
        Places of nodes by the names of node sets and surfaces, in capitals.
    variables : mapping of str to (int, int, int)
        By name: the tag of its section, its number there, and how it is stored.
    states : list of (float, memoryview)
        Time and data of every state that converged.
    """

    points: FloatArray
    domains: tuple[NDArray[np.int64], ...]
    node_sets: Mapping[str, NDArray[np.int64]]
    variables: Mapping[str, tuple[int, int, int]]
    states: list[tuple[float, memoryview]] = field(default_factory=list)


def read_plot_file(path: Path) -> PlotFile:
    """Return mesh and states of a plot file of FEBio 3 or 4.

    Raises
    ------
    InputError
        When it is none, is damaged, or has a mesh that changes.
    """
    content = path.read_bytes()
    try:
        return _read(content, path.name)
    except (struct.error, ValueError, LookupError, zlib.error) as error:
        raise InputError(f"'{path.name}' cannot be read: it is no plot file of FEBio 3 or 4, or is damaged.") from error


def _read(content: bytes, name: str) -> PlotFile:
    if struct.unpack_from("<I", content)[0] != MAGIC:
        raise ValueError("no plot file")
    plot: PlotFile | None = None
    variables: dict[str, tuple[int, int, int]] = {}
    for tag, inner in _top(content):
        if tag == ROOT:
            if _integers(child(inner, HEADER, VERSION))[0] < FIRST_VERSION:
                raise ValueError("written by FEBio 2")
            variables = _variables(child(inner, DICTIONARY))
        elif tag == MESH and plot is not None:
            raise InputError(f"'{name}' has a mesh that changes during the run, of which sets and nodes are not known.")
        elif tag == MESH:
            plot = _mesh(inner, variables)
        elif tag == STATE and plot is not None:
            head = child(inner, STATE_HEADER)
            if not any(_integers(child(head, STATUS))):
                plot.states.append((float(struct.unpack_from("<f", child(head, TIME))[0]), child(inner, STATE_DATA)))
    if plot is None:
        raise ValueError("no mesh")
    return plot


def _integers(content: memoryview) -> NDArray[np.int64]:
    return np.frombuffer(content, dtype="<i4").astype(np.int64)


def _text(content: memoryview) -> str:
    return bytes(content).partition(b"\0")[0].decode("utf-8", "replace")


def _variables(dictionary: memoryview) -> dict[str, tuple[int, int, int]]:
    variables = {}
    for section, data in ((NODAL, NODE_DATA), (DOMAIN_WISE, ELEMENT_DATA)):
        for number, (_, item) in enumerate(chunks(child(dictionary, section)), start=1):
            storage = int(_integers(child(item, ITEM_FORMAT))[0])
            variables[_text(child(item, ITEM_NAME))] = data, number, storage
    return variables


def _mesh(mesh: memoryview, variables: Mapping[str, tuple[int, int, int]]) -> PlotFile:
    rows = np.frombuffer(child(mesh, NODE_SECTION, COORDINATES), dtype="<f4").reshape(-1, 4)
    domains = [
        np.array([_integers(element)[1:] for _, element in chunks(child(domain, ELEMENTS))], dtype=np.int64)
        for _, domain in chunks(child(mesh, DOMAINS))
    ]
    sets = {}
    for _, inner in chunks(child(mesh, FACET_SETS)):
        facets = [_integers(facet) for _, facet in chunks(child(inner, FACETS))]
        members = [facet[2 : 2 + facet[1]] for facet in facets] or [np.zeros(0, dtype=np.int64)]
        sets[_name(child(inner, FACET_SET_HEADER, FACET_SET_NAME))] = np.unique(np.concatenate(members))
    for _, inner in chunks(child(mesh, NODE_SETS)):
        sets[_name(child(inner, NODE_SET_HEADER, NODE_SET_NAME))] = _integers(child(inner, NODE_LIST))
    return PlotFile(rows[:, 1:].astype(np.float64), tuple(domains), sets, variables)


def _name(content: memoryview) -> str:
    """Return a name in capitals, before which its length stands."""
    return _text(content[4 : 4 + struct.unpack_from("<I", content)[0]]).strip().upper()


class FEBioResults(ResultFile):
    """FEBio's plot file; what is written for elements is averaged at the nodes, over all elements that meet there."""

    name = "febio"
    suffixes = (".xplt",)
    requests = {  # noqa: RUF012  (as in the base class)
        kind: f'<plotfile type="febio"><var type="{names[-1]}"/></plotfile>' for kind, names in FIELDS.items()
    }

    @cached_property
    def content(self) -> PlotFile:
        """Mesh and states."""
        return read_plot_file(self.path)

    @property
    def nodes(self) -> NDArray[np.int64]:
        return np.arange(len(self.content.points))

    @property
    def node_sets(self) -> Mapping[str, NDArray[np.int64]]:
        return self.content.node_sets

    def field(self, kind: str) -> Values | None:
        written_names = [name for name in FIELDS[kind] if name in self.content.variables]
        if not written_names:
            return None
        section, number, storage = self.content.variables[written_names[0]]
        times, rows = [], []
        for time, data in self.content.states:
            if self.results.reach(time):
                regions = {
                    tag: np.frombuffer(values, "<f4") for tag, values in chunks(_variable(data, section, number))
                }
                if regions:
                    times.append(time)
                    rows.append(regions[0].reshape(-1, 3) if section == NODE_DATA else self._at_nodes(regions, storage))
        return Values(np.array(times), np.array(rows, dtype=np.float64)) if rows else None

    def _at_nodes(self, regions: Mapping[int, NDArray[np.float32]], storage: int) -> FloatArray:
        """Return a tensor (n, 6) at the nodes, not a number where no element with it is."""
        if storage not in (PER_ELEMENT, PER_NODE_OF_ELEMENT):
            raise ValueError("stored in another way")
        count = len(self.content.points)
        sums, counts = np.zeros((count, 6)), np.zeros((count, 1))
        for tag, values_of_region in regions.items():
            members = self.content.domains[tag - 1]
            values = values_of_region.astype(np.float64).reshape(-1, 6)
            if storage == PER_ELEMENT:
                values = values.repeat(members.shape[1], axis=0)
            np.add.at(sums, members.ravel(), values)
            np.add.at(counts, members.ravel(), 1.0)
        with np.errstate(invalid="ignore"):
            return np.asarray((sums / counts)[:, AS_TENSOR])


def _variable(data: memoryview, section: int, number: int) -> memoryview:
    """Return the data of a variable of a state."""
    for _, inner in chunks(child(data, section)):
        if _integers(child(inner, VARIABLE_NUMBER))[0] == number:
            return child(inner, VARIABLE_DATA)
    raise LookupError(number)
