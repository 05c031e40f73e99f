"""Quantities of interest: their texts, what they are of a set, and functions of the user's."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

from tissuq.decks import Deck, parse_quantity
from tissuq.decks.abaqus import AbaqusDeck
from tissuq.decks.calculix_results import CalculiXResults, Frd
from tissuq.decks.deck import deck_formats
from tissuq.decks.model_run import check_sets
from tissuq.decks.result_file import Results
from tissuq.decks.solver import solver_for
from tissuq.errors import InputError

TABLES = """
 displacements (vx,vy,vz) for set TOP and time  0.5000000E+00

         3  3.0 4.0 0.0
         4  1.0 0.0 0.0

 forces (fx,fy,fz) for set TOP and time  0.5000000E+00

         3  1.0 2.0 0.0
         4  2.0 2.0 0.0

 stresses (elem, integ.pnt.,sxx,syy,szz,sxy,sxz,syz) for set EALL and time  0.5000000E+00

         1   1  10.0  0.0  0.0  0.0  0.0  2.0
         1   2  0.0  0.0  0.0  0.0  5.0  0.0
"""


@pytest.fixture
def results(tmp_path):
    (tmp_path / "job.dat").write_text(TABLES)
    return Results(tmp_path, "job")


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("U1@TOP", 2.0),
        ("u1@top:max", 3.0),
        ("U@TOP:max", 5.0),
        ("U@TOP", 3.0),
        ("RF2@TOP", 4.0),
        ("RF@TOP", 5.0),
        ("RF1@TOP:min", 1.0),
        ("S11@EALL:max", 10.0),
        ("S13@EALL:max", 5.0),
        ("S23@EALL", 1.0),
        ("MISES@EALL:min", np.sqrt(3) * 5.0),
        ("MISES@EALL:max", np.sqrt(100 + 3 * 4)),
    ],
)
def test_a_quantity_of_a_set(results, text, value):
    curve = parse_quantity("q", text).read(results)
    assert curve.times.tolist() == [0.5]
    assert curve.values.tolist() == pytest.approx([value], rel=1e-12)


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("q", "RF4@TOP", "is not a quantity"),
        ("q", "S14@TOP", "is not a quantity"),
        ("q", "S@TOP", "is not a quantity"),
        ("q", "MISES1@TOP", "is not a quantity"),
        ("q", "T@TOP", "is not a quantity"),
        ("q", "RF3@TOP:median", "is not a quantity"),
        ("q q", "RF3@TOP", "cannot name"),
    ],
)
def test_what_is_no_quantity_is_refused(name, text, words):
    with pytest.raises(InputError, match=words):
        parse_quantity(name, text)


def test_what_the_deck_did_not_ask_for_is_told_with_what_to_write(results):
    with pytest.raises(InputError, match=r"RF3@BASE:sum is not in the results.*\*NODE PRINT, NSET=BASE, TOTALS=ONLY"):
        parse_quantity("q", "RF3@BASE").read(results)


@pytest.mark.parametrize(
    ("body", "times", "values"),
    [
        ("3", [1.0], [3.0]),
        ("[0.0, 1.0], [2, 4]", [0.0, 1.0], [2.0, 4.0]),
        ("(folder / 'job.dat').stat().st_size * 0 + 7", [1.0], [7.0]),
    ],
)
def test_a_function_of_the_folder_gives_a_number_or_a_curve(results, tmp_path, body, times, values):
    (tmp_path / "mine.py").write_text(f"def get(folder):\n    return {body}\n")
    quantity = parse_quantity("q", f"{tmp_path}/mine.py:get")
    quantity.check()
    curve = quantity.read(results)
    assert (curve.times.tolist(), curve.values.tolist()) == (times, values)
    before = quantity.identity
    (tmp_path / "mine.py").write_text("def get(folder):\n    return 5\n")
    assert quantity.identity != before


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("1 / 0", "ZeroDivisionError"),
        ("'a'", "ValueError"),
        ("[1.0, 2.0], [1.0]", "of one length"),
        ("float('nan')", "finite"),
    ],
)
def test_a_function_that_fails_is_named(results, tmp_path, body, words):
    (tmp_path / "mine.py").write_text(f"def get(folder):\n    return {body}\n")
    with pytest.raises(InputError, match=words):
        parse_quantity("q", f"{tmp_path}/mine.py:get").read(results)
    with pytest.raises(InputError, match="no function named 'other'"):
        parse_quantity("q", f"{tmp_path}/mine.py:other").check()
    with pytest.raises(InputError, match="no file"):
        parse_quantity("q", f"{tmp_path}/yours.py:get").check()


@pytest.mark.parametrize(
    ("name", "text", "of_nodes", "of_elements"),
    [
        ("abaqus", "*NODE, NSET=all nodes\n1, 0.\n*NGEN, NSET=Edge\n1, 2\n*ELSET, ELSET=Disc\n1\n*NODE PRINT, NSET=X\n",
         {"ALL NODES", "EDGE"}, {"ALL NODES", "EDGE", "DISC"}),
        ("febio", '<febio_spec><Mesh><Nodes name="body"/><NodeSet name="top">1</NodeSet><Surface name="In"/></Mesh>'
         "</febio_spec>", {"BODY", "TOP", "IN"}, {"BODY", "TOP", "IN"}),
        ("ansys", "/PREP7\nCMBLOCK,TOP     ,NODE,       2\n(8i10)\n         1         2\n", {"TOP"}, {"TOP"}),
        ("ansys", "/PREP7\nCMBLOCK,TOP     ,NODE,       1\n(8i10)\n         1\nCM,REST,NODE\n", set(), set()),
        ("ls-dyna", "*KEYWORD\n*SET_NODE_LIST\n1\n", set(), set()),
    ],
)  # fmt: skip
def test_the_sets_that_results_can_have_are_known_from_the_deck_or_none_are(name, text, of_nodes, of_elements):
    kind = deck_formats()[name]()
    assert kind.set_names([text.encode()], of_elements=False) == of_nodes
    assert kind.set_names([text.encode()], of_elements=True) == of_elements


@pytest.mark.parametrize(
    ("wanted", "is_known"),
    [("RF2@TOP", True), ("U@PART-1.TOP", True), ("U@ALL", True), ("U", True), ("S11@BODY", True), ("U@BODY", False),
     ("MISES@TOPP:max", False)],
)  # fmt: skip
def test_a_set_that_a_deck_with_its_included_files_does_not_have_is_refused_before_a_run(tmp_path, wanted, is_known):
    (tmp_path / "mesh.inp").write_text("*NODE, NSET=TOP\n1, 0.\n*ELEMENT, TYPE=C3D4, ELSET=BODY\n1, 1, 1, 1, 1\n")
    (tmp_path / "model.inp").write_text("*INCLUDE, INPUT=mesh.inp\n*MATERIAL, NAME=A\n")
    deck, quantities = Deck.read(tmp_path / "model.inp"), [parse_quantity("q", wanted)]
    with nullcontext() if is_known else pytest.raises(InputError, match="no set of nodes"):
        check_sets(deck, quantities)
    check_sets(replace(deck, outside=("/elsewhere.inp",)), quantities)


@pytest.mark.parametrize(
    ("name", "text", "size"),
    [
        ("abaqus", "*ELEMENT, TYPE=C3D10\n1, 1,2,3,4,5,6,7\n, 8,9,10\n*ELEMENT, type=s4\n2, 1, 2, 3, 4\n", (1, 3)),
        ("abaqus", "*ELEMENT, TYPE=CAX4R\n1, 1,2,3,4\n2, 1,2,3,4\n*ELEMENT, TYPE=SPRING1\n3, 1\n", (2, 2)),
        ("abaqus", "*ELEMENT, TYPE=C3D8\n1, 1,2,3,4,5,6,7,8\n*ELGEN\n1, 10\n", None),
        ("abaqus", "*NODE\n1, 0.\n", None),
        ("febio", '<febio_spec><Mesh><Elements type="tet10"><elem id="1">1</elem><elem id="2">1</elem></Elements>'
         '<Elements type="quad4"><elem id="3">1</elem></Elements></Mesh></febio_spec>', (2, 3)),
        ("ansys", "/PREP7\n", None),
    ],
)  # fmt: skip
def test_the_number_of_elements_and_their_dimensions_are_known_from_the_deck_or_not(name, text, size):
    assert deck_formats()[name]().mesh_size([text.encode()]) == size


def test_sets_of_nodes_are_those_of_the_manual():
    deck = b"*NODE, NSET=All\n1, 0., 0., 0.\n2, 0., 0., 0.\n*NSET, NSET=Some\n1,\n*nset, nset=Row, generate\n2, 8, 3\n"
    deck += b"*NSET, NSET=BOTH\nSome, 9\nrow\n"
    assert AbaqusDeck().node_sets([deck]) == {"ALL": {1, 2}, "SOME": {1}, "ROW": {2, 5, 8}, "BOTH": {1, 2, 5, 8, 9}}


def test_sets_may_name_those_of_later_files_and_one_another():
    files = [b"*NSET, NSET=A\nB, 1\n*NSET, NSET=C\nA\n", b"*NSET, NSET=B\n2\n"]
    assert AbaqusDeck().node_sets(files) == {"A": {1, 2}, "B": {2}, "C": {1, 2}}
    assert AbaqusDeck().node_sets([b"*NSET, NSET=A\nB, 1\n*NSET, NSET=B\nA, 2\n"]) == {"A": {1, 2}, "B": {1, 2}}


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"*NSET, NSET=A\nNONE, 1\n", "'A' has 'NONE'"),
        (b"*NSET, NSET=A, GENERATE\n1, 5, 0\n", "'A' are not understood"),
        (b"*NSET, NSET=A, GENERATE\n1, five\n", "'A' are not understood"),
        (b"*NSET, NSET=A, GENERATE\n1\n", "'A' are not understood"),
        (b"*NODE, NSET=A\none, 0., 0., 0.\n", "'A' are not understood"),
    ],
)
def test_sets_that_are_not_understood_are_named(content, words):
    with pytest.raises(InputError, match=words):
        AbaqusDeck().node_sets([content])


@pytest.mark.parametrize("text", ["U1@TOP", "U@TOP", "S11@EALL"])
def test_a_table_without_its_last_columns_is_damaged(tmp_path, text):
    cut = "\n".join(line if "(" in line else line.rpartition(" ")[0] for line in TABLES.splitlines())
    (tmp_path / "job.dat").write_text(cut)
    with pytest.raises(InputError, match="cut short"):
        parse_quantity("q", text).read(Results(tmp_path, "job"))


def test_nodes_without_a_number_are_told_with_their_set(tmp_path):
    values = np.array([1.0, np.nan])
    frd = Frd(np.array([1, 2]), np.zeros((2, 3)), {}, {}, {"DISP": [(1.0, {f"D{axis}": values for axis in (1, 2, 3)})]})
    results = Results(tmp_path, "job", node_sets={"ONE": {1}})
    file = CalculiXResults(tmp_path / "job.frd", results)
    file.__dict__["frd"] = frd
    results.__dict__["file"] = file
    with pytest.raises(InputError, match=r"U1@ALL:mean.*'ALL'"):
        parse_quantity("q", "U1@ALL").read(results)
    assert parse_quantity("q", "U1@ONE").read(results).values.tolist() == [1.0]


PRINTED = "*EL PRINT, ELSET=body\nS\n"


@pytest.mark.parametrize(
    ("printed", "wanted", "is_written"),
    [(PRINTED, "S11@BODY", True), (PRINTED, "E11@BODY", False), ("", "S11@BODY", False), ("", "S11@TOP", True)],
)
def test_a_set_of_elements_is_refused_where_calculix_is_not_asked_to_print_it(tmp_path, printed, wanted, is_written):
    mesh = "*NODE, NSET=TOP\n1, 0.\n*ELEMENT, TYPE=C3D4, ELSET=BODY\n1, 1, 1, 1, 1\n"
    (tmp_path / "model.inp").write_text(f"{mesh}*MATERIAL, NAME=A\n*STEP\n{printed}*END STEP\n")
    deck, quantities = Deck.read(tmp_path / "model.inp"), [parse_quantity("q", wanted)]
    with nullcontext() if is_written else pytest.raises(InputError, match="'BODY' is a set of elements"):
        check_sets(deck, quantities, solver_for("abaqus", "ccx"))
    check_sets(deck, quantities)
