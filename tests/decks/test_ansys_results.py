"""ANSYS's result file: the one that ships with ansys-mapdl-reader (a beam of hexahedra), and its deck's components."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from tissuq.decks import AnsysDeck, parse_quantity
from tissuq.decks.ansys import AnsysResults
from tissuq.decks.result_file import Results
from tissuq.errors import InputError


@pytest.fixture
def beam():
    """The library, its example's result file and deck."""
    pytest.importorskip("ansys.mapdl.reader")
    from ansys.mapdl import reader
    from ansys.mapdl.reader import examples

    return SimpleNamespace(reader=reader, rst=Path(examples.rstfile), cdb=Path(examples.hexarchivefile))


def results_of(beam):
    sets = AnsysDeck().node_sets([beam.cdb.read_bytes()])
    return Results(beam.rst.parent, beam.rst.stem, node_sets=sets)


def test_the_components_of_a_deck_are_those_that_the_library_finds_in_it(beam):
    found = AnsysDeck().node_sets([beam.cdb.read_bytes()])
    wanted = beam.reader.Archive(str(beam.cdb)).node_components
    assert set(found) == set(wanted) == {"NCOMP2", "NODE_SELECTION"}
    for name, members in wanted.items():
        assert found[name] == {int(node) for node in members}


@pytest.mark.parametrize("text", ["U1@NCOMP2", "U3@NODE_SELECTION:max", "U@NCOMP2:max", "U2:min"])
def test_displacements_are_those_of_the_file(beam, text):
    curve = parse_quantity("q", text).read(results_of(beam))
    content = beam.reader.read_binary(str(beam.rst))
    assert curve.times.tolist() == content.time_values.tolist()
    for place, value in enumerate(curve.values):
        numbers, displacement = content.nodal_displacement(place)
        name = text.partition("@")[2].partition(":")[0]
        members = results_of(beam).node_sets.get(name, set(numbers.tolist()))
        rows = displacement[np.isin(numbers, sorted(members))]
        wanted = {
            "U1@NCOMP2": rows[:, 0].mean(),
            "U3@NODE_SELECTION:max": rows[:, 2].max(),
            "U@NCOMP2:max": np.linalg.norm(rows, axis=1).max(),
            "U2:min": rows[:, 1].min(),
        }[text]
        assert value == pytest.approx(wanted, rel=1e-12)


def test_stresses_are_those_of_the_file_in_our_order(beam):
    """Von Mises of the library, which sees the order of shears; and S13 at a node whose three shears differ."""
    content = beam.reader.read_binary(str(beam.rst))
    _, principal = content.principal_nodal_stress(0)
    curve = parse_quantity("q", "MISES:max").read(results_of(beam))
    assert curve.values[0] == pytest.approx(np.nanmax(principal[:, -1]), rel=1e-5)
    _, stress = content.nodal_stress(0)
    assert np.isnan(stress).any()  # between corners
    for text, column in (("S12:max", 3), ("S23:max", 4), ("S13:max", 5)):
        value = parse_quantity("q", text).read(results_of(beam)).values[0]
        assert value == pytest.approx(np.nanmax(stress[:, column]), rel=1e-12)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("RF1@NCOMP2", r"RF1@NCOMP2:sum is not in 'file.rst': ask for it in the deck, as by 'OUTRES,RSOL,ALL'"),
        ("E11", r"E11@ALL:mean is not in 'file.rst': this program has none; give it by a function"),
        ("U1@TOP", r"no set of nodes 'TOP'; its sets are NCOMP2, NODE_SELECTION"),
    ],
)
def test_what_is_not_there_is_told_in_the_words_of_ansys(beam, text, words):
    with pytest.raises(InputError, match=words):
        parse_quantity("q", text).read(results_of(beam))


def content_with_reactions():
    """Three states of three nodes, of which two are held; the first has no forces, the last was given up."""
    forces = np.array([5.0, -2.0, 7.0, 1e3]), np.array([30, 10, 30, 30]), np.array([1, 2, 1, 4])
    return SimpleNamespace(
        mesh=SimpleNamespace(nnum=np.array([10, 30, 20])),
        node_components={"Clamp": np.array([10, 30])},
        time_values=np.array([0.5, 1.0, 1.5]),
        available_results={"RF": True, "NSL": True, "ENS": False},
        _resultheader={"ls_table": np.array([[1, 1, 1], [1, 2, 2], [1, 999999, 3]])},
        _solution_header=lambda place: {"ptrRF": 100 * place, "ptrNSL": 50},
        nodal_reaction_forces=lambda place: forces,
        nodal_displacement=lambda place: (np.array([10, 20, 30]), np.array([[0, 0], [3.0, 4.0], [0, 0]])),
    )


def test_reactions_are_summed_by_node_and_direction_up_to_the_last_state_that_converged(tmp_path):
    """In the plane, where displacements have two components; no example of the library has reactions in it."""
    (tmp_path / "file.rst").write_bytes(b"")
    results = Results(tmp_path, "job", node_sets={"CLAMP": {10}, "FREE": {20}})
    assert isinstance(results.file, AnsysResults)
    assert results.file.path.name == "file.rst"
    results.file.__dict__["content"] = content_with_reactions()
    values = {text: parse_quantity("q", text).read(results) for text in ("RF1@CLAMP", "RF2@CLAMP", "RF@FREE", "U@FREE")}
    assert {text: curve.values.tolist() for text, curve in values.items()} == {
        "RF1@CLAMP": [12.0],
        "RF2@CLAMP": [-2.0],
        "RF@FREE": [0.0],
        "U@FREE": [5.0, 5.0],
    }
    assert values["U@FREE"].times.tolist() == [0.5, 1.0]
    assert values["RF1@CLAMP"].times.tolist() == [1.0]


def test_without_the_library_its_extra_is_named(tmp_path, monkeypatch):
    (tmp_path / "job.rst").write_bytes(b"")
    monkeypatch.setitem(sys.modules, "ansys.mapdl", None)
    with pytest.raises(InputError, match=r"'job.rst', install tissuq with its extra 'ansys'.*file.py:function"):
        parse_quantity("q", "U1").read(Results(tmp_path, "job"))


def test_a_file_that_is_none_is_refused(beam, tmp_path):
    (tmp_path / "job.rst").write_bytes(b"no result file" * 100)
    with pytest.raises(InputError, match=r"'job.rst' cannot be read"):
        parse_quantity("q", "U1").read(Results(tmp_path, "job"))


@pytest.mark.parametrize(
    ("below", "words"),
    [
        ("         1\n", "lacks the format"),
        ("(8i10)\n         1\n\n", "is cut short"),
        ("(8i10)\n    a    b\n", "or damaged"),
    ],
)
def test_a_component_that_is_damaged_is_refused(below, words):
    with pytest.raises(InputError, match=words):
        AnsysDeck().node_sets([f"CMBLOCK,TOP     ,NODE,       2\n{below}".encode()])
