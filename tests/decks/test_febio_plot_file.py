"""FEBio's plot file: files written in the steps of FEBio's writer, FEBioPlotFile.cpp and PltArchive.h at 0e8b7db."""

from __future__ import annotations

import struct
import zlib

import numpy as np
import pytest

from tissuq.decks import CommandSolver, parse_quantity
from tissuq.decks.model_run import ModelRun, carried_out
from tissuq.decks.result_file import Results
from tissuq.errors import InputError

POINTS = np.array([[x, y, z] for x in (0.0, 1.0, 3.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
FIRST, SECOND = [0, 4, 6, 2, 1, 5, 7, 3], [4, 8, 10, 6, 5, 9, 11, 7]
STRESSES = np.array([[1, 2, 3, 4, 5, 6], [3, 0, 0, 0, 5, 0]], dtype=float)
"""Of both elements, in the order of a mat3ds: xx, yy, zz, xy, yz, xz."""
VEC3F, MAT3FS = 1, 2
NODE, ITEM, MULT = 0, 1, 2


class Branch:
    """OBranch: a tag, the size of what follows, and its children."""

    def __init__(self, tag, *children):
        self.tag, self.children = tag, children

    def bytes(self):
        inner = b"".join(child.bytes() for child in self.children)
        return struct.pack("<II", self.tag, len(inner)) + inner


class Leaf:
    """OLeaf of numbers."""

    def __init__(self, tag, data):
        self.tag, self.data = tag, data

    def bytes(self):
        return struct.pack("<II", self.tag, len(self.data)) + self.data


def integers(tag, *values):
    return Leaf(tag, struct.pack(f"<{len(values)}i", *values))


def floats(tag, values):
    return Leaf(tag, np.asarray(values, dtype="<f4").tobytes())


def string(tag, text):
    """OLeaf<const char*>: the length without the zero at the end, and the characters."""
    return Leaf(tag, struct.pack("<i", len(text)) + text.encode())


def fixed(tag, text):
    """An array of STR_SIZE characters."""
    return Leaf(tag, text.encode().ljust(64, b"\0"))


def item(name, kind, storage):
    """WriteDictionaryItem."""
    return Branch(
        0x01020001,
        integers(0x01020002, kind),
        integers(0x01020003, storage),
        integers(0x01020005, 0),
        fixed(0x01020004, name),
    )


def root(nodal, domains, version=0x0032, compression=0):
    """WriteRoot."""
    return Branch(
        0x01000000,
        Branch(
            0x01010000,
            integers(0x01010001, version),
            integers(0x01010004, compression),
            string(0x01010006, "FEBio 4.0.0"),
        ),
        Branch(0x01020000, Branch(0x01023000, *nodal), *([Branch(0x01024000, *domains)] if domains else [])),
    )


def mesh():
    """WriteMeshSection of two hexahedra, each a domain, and an empty one, with a set of nodes and one of facets."""
    coordinates = b"".join(struct.pack("<i3f", index, *point) for index, point in enumerate(POINTS))
    domains = [
        Branch(
            0x01042100,
            Branch(
                0x01042101,
                integers(0x01042102, 0),
                integers(0x01042103, number),
                integers(0x01032104, 1),
                string(0x01032105, f"Part{number}"),
            ),
            Branch(0x01042200, integers(0x01042201, number, *element)),
        )
        for number, element in enumerate((FIRST, SECOND), start=1)
    ]
    domains.append(Branch(0x01042100, Branch(0x01042101, integers(0x01032104, 0)), Branch(0x01042200)))  # is empty
    node_set = Branch(
        0x01044100,
        Branch(0x01044101, integers(0x01044102, 1), integers(0x01044104, 4), string(0x01044103, "Fixed")),
        integers(0x01044200, 0, 1, 2, 3),
    )
    facets = Branch(
        0x01047100,
        Branch(
            0x01047101,
            integers(0x01047102, 1),
            integers(0x01047104, 2),
            string(0x01047103, "Loaded"),
            integers(0x01047105, 10),
        ),
        Branch(
            0x01047200,
            integers(0x01047201, 1, 4, 8, 9, 11, 10, *[-1] * 6),
            integers(0x01047201, 2, 3, 11, 7, 10, *[-1] * 7),
        ),
    )
    return Branch(
        0x01040000,
        Branch(
            0x01041000,
            Branch(0x01041100, integers(0x01041101, len(POINTS)), integers(0x01041102, 3)),
            Leaf(0x01041200, coordinates),
        ),
        Branch(0x01042000, *domains),
        Branch(0x01044000, node_set),
        Branch(0x01047000, facets),
        Branch(0x01045000, Branch(0x01045100, integers(0x01045101, 1), fixed(0x01045102, "Tissue"))),
    )


def variable(number, *parts):
    return Branch(0x02020001, integers(0x02020002, number), Branch(0x02020003, *parts))


def state(time, nodal, domains, status=0):
    """Write: data of nodes under the tag 0, those of domains under their numbers from 1."""
    return Branch(
        0x02000000,
        Branch(0x02010000, floats(0x02010002, [time]), integers(0x02010003, status)),
        Branch(0x02030000, integers(0x02030001, 1, 1)),
        Branch(
            0x02020000,
            Branch(0x02020300, *(variable(n, floats(0, values)) for n, values in enumerate(nodal, start=1))),
            Branch(
                0x02020400,
                *(
                    variable(n, *(floats(tag, part) for tag, part in enumerate(parts, start=1)))
                    for n, parts in enumerate(domains, start=1)
                ),
            ),
        ),
    )


def pull(time):
    """Displacements and reaction forces at a time."""
    displacement = np.stack([time * POINTS[:, 0], -0.2 * time * POINTS[:, 1], 0 * POINTS[:, 2]], axis=1)
    force = np.zeros_like(POINTS)
    force[:4, 0], force[8:, 0] = -time, time
    return displacement, force


def per_node(stresses):
    """WriteData of FMT_MULT: every node of an element, in its order; here the stress of the element times its place."""
    return [np.arange(1, 9)[:, None] * stress for stress in stresses]


NODAL = item("displacement", VEC3F, NODE), item("reaction forces", VEC3F, NODE)
STRESS, STRAIN = item("stress", MAT3FS, ITEM), item("Lagrange strain", MAT3FS, ITEM)


def packed(top, compression):
    """PltArchive::Flush: the states are compressed, each chunk at the top by itself; root and first mesh are not."""
    content = struct.pack("<I", 0x00464542)
    for place, chunk in enumerate(top):
        content += zlib.compress(chunk.bytes()) if compression and place > 1 else chunk.bytes()
    return content


def written(folder, compression=0, extra=(), domains=(STRESS, STRAIN), data=None):
    times = (0.0, 0.5, 1.0)
    data = data or (lambda time: [list(time * STRESSES), list(0.1 * time * STRESSES)])
    states = [state(time, pull(time), data(time)) for time in times]
    top = [root(NODAL, domains, compression=compression), mesh(), *states, *extra]
    content = packed(top, compression)
    (folder / "job.xplt").write_bytes(content)
    return content


def read(folder, text):
    return parse_quantity("q", text).read(Results(folder, "job"))


@pytest.mark.parametrize("compression", [0, 1])
@pytest.mark.parametrize(
    ("text", "last"),
    [
        ("RF1@LOADED", 4.0),
        ("RF1@Fixed", -4.0),
        ("RF@FIXED", 4.0),
        ("U1@LOADED:max", 3.0),
        ("U1@LOADED", (4 * 3.0 + 1.0) / 5),
        ("U2:min", -0.2),
        ("S11@FIXED", 1.0),
        ("S13@FIXED", 6.0),
        ("S23@FIXED", 5.0),
        ("S11:max", 3.0),
        ("S11@LOADED", (4 * 3.0 + 2.0) / 5),
        ("E12@FIXED:max", 0.4),
        ("MISES@FIXED", np.sqrt(3 + 3 * (16 + 25 + 36))),
    ],
)
def test_a_quantity_of_a_plot_file(tmp_path, compression, text, last):
    written(tmp_path, compression)
    curve = read(tmp_path, text)
    assert curve.times.tolist() == [0.0, 0.5, 1.0]
    np.testing.assert_allclose(curve.values, last * curve.times, rtol=1e-6, atol=1e-7)


def test_stresses_that_were_projected_to_the_nodes_are_read_before_those_of_elements(tmp_path):
    both = (STRESS, item("nodal stress", MAT3FS, MULT))
    written(tmp_path, domains=both, data=lambda time: [list(0 * STRESSES), per_node(time * STRESSES)])
    at_four = (2 * STRESSES[0, 0] + 1 * STRESSES[1, 0]) / 2  # the second node of the first, the first of the second
    assert read(tmp_path, "S11:max").values[-1] == pytest.approx(7 * 3.0)
    shared = [(FIRST.index(node) + 1) * 1.0 + (SECOND.index(node) + 1) * 3.0 for node in (4, 5, 6, 7)]
    assert min(shared) / 2 == at_four
    assert read(tmp_path, "S11@FIXED:sum").values[-1] == pytest.approx(sum(FIRST.index(n) + 1 for n in range(4)))


def test_a_state_that_did_not_converge_is_left_out(tmp_path):
    failed = state(1.2, pull(9.0), [list(STRESSES), list(STRESSES)], status=1)
    written(tmp_path, extra=[failed])
    assert read(tmp_path, "U1:max").times.tolist() == [0.0, 0.5, 1.0]


@pytest.mark.parametrize("compression", [0, 1])
def test_of_a_file_that_is_cut_short_the_whole_states_are_read(tmp_path, compression):
    content = written(tmp_path, compression)
    (tmp_path / "job.xplt").write_bytes(content[:-20])
    assert read(tmp_path, "U1:max").values.tolist() == [0.0, 1.5]


def test_nodes_without_elements_that_have_a_field_are_told(tmp_path):
    written(tmp_path, data=lambda time: [list(time * STRESSES[:1]), list(STRESSES)])
    assert read(tmp_path, "S11@FIXED").values[-1] == 1.0
    with pytest.raises(InputError, match=r"no number at some nodes of the set 'LOADED'"):
        read(tmp_path, "S11@LOADED")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("E11@FIXED", r"E11@FIXED:mean is not in 'job.xplt'.*<plotfile type=\"febio\"><var type=\"Lagrange strain\"/>"),
        ("U1@TOP", r"no set of nodes 'TOP'; its sets are FIXED, LOADED"),
    ],
)
def test_what_is_not_there_is_told_in_the_words_of_febio(tmp_path, text, words):
    written(tmp_path, domains=(STRESS,))
    with pytest.raises(InputError, match=words):
        read(tmp_path, text)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "no plot file of FEBio 3 or 4"),
        (b"BEF\0", "no plot file of FEBio 3 or 4"),
        (struct.pack("<I", 0x00464542) + root(NODAL, (), version=5).bytes(), "no plot file of FEBio 3 or 4"),
        (packed([root(NODAL, ()), mesh(), mesh()], 0), "a mesh that changes"),
    ],
)
def test_a_file_that_cannot_be_read_is_refused(tmp_path, content, words):
    (tmp_path / "job.xplt").write_bytes(content)
    with pytest.raises(InputError, match=words):
        read(tmp_path, "U1")


def test_a_draw_in_a_deck_of_febio_gives_the_curve_of_its_plot_file(tmp_path):
    """The solver is a stand-in that leaves the plot file; sets of the deck are those in it."""
    written(tmp_path)
    model = tmp_path / "model"
    model.mkdir()
    (model / "punch.feb").write_text(
        '<febio_spec version="4.0"><Material><material id="1" name="Fat" type="neo-Hookean"><E>1</E><v>0.3</v>'
        "</material></Material></febio_spec>"
    )
    card = '<material id="1" name="Fat" type="neo-Hookean">\n<E>2</E>\n<v>0.3</v>\n</material>\n'
    task = ModelRun(
        "complete", 0, model, "punch.feb", "febio", (("Fat", card),),
        CommandSolver(f"cp {tmp_path}/job.xplt {{job}}.xplt"),
        (parse_quantity("force", "RF1@Loaded"),), (), tmp_path / "draws" / "one",
    )  # fmt: skip
    result = carried_out(task)
    assert (result["problem"], result["misread"]) == ("", "")
    assert result["curves"]["force"] == [[0.0, 0.5, 1.0], [0.0, 2.0, 4.0]]
