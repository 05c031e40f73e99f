"""Abaqus's output database, opened by a stand-in for its Python: a module ``odbAccess`` of the names that are used."""

from __future__ import annotations

import ast
import json
import sys
from pathlib import Path

import numpy as np
import pytest

from tissuq.decks import AbaqusDeck, CommandSolver, parse_quantity
from tissuq.decks.abaqus import SCRIPT
from tissuq.decks.deck import Deck
from tissuq.decks.model_run import ModelRun, SolverRun, carried_out
from tissuq.decks.result_file import Results
from tissuq.errors import InputError

ODB_ACCESS = """
import json
from types import SimpleNamespace

import numpy as np


class Repository(dict):
    pass


class Field:
    def __init__(self, labels, blocks, position):
        self.componentLabels, self.position = labels, position
        self.bulkDataBlocks = [
            SimpleNamespace(instance=name and SimpleNamespace(name=name), nodeLabels=np.array(of), data=np.array(data))
            for name, of, data in blocks
        ] if position != "INTEGRATION_POINT" else None
        self.extrapolated = blocks

    def getSubset(self, position):
        return Field(self.componentLabels, self.extrapolated, position)


def openOdb(path, readOnly):
    assert readOnly
    with open(path) as file:
        stored = json.load(file)
    with open("opened.txt", "a") as file:
        file.write("once\\n")

    def node(instance, label):
        return SimpleNamespace(instanceName=instance, label=label)

    def nested(sets):
        return Repository({
            name: SimpleNamespace(nodes=[[node(part, label) for label in labels] for part, labels in parts.items()])
            for name, parts in sets.items()
        })

    instances = Repository({
        name: SimpleNamespace(name=name, nodeSets=Repository({
            key: SimpleNamespace(nodes=[node(name, label) for label in labels]) for key, labels in sets.items()
        }))
        for name, sets in stored["instances"].items()
    })
    steps = Repository()
    for number, step in enumerate(stored["steps"]):
        frames = []
        for frame in step["frames"]:
            fields = Repository({
                kind: Field(labels, blocks, "INTEGRATION_POINT" if kind == "S" else "NODAL")
                for kind, (labels, blocks) in frame["fields"].items()
            })
            frames.append(SimpleNamespace(frameValue=frame["value"], fieldOutputs=fields))
        steps["Step-%d" % number] = SimpleNamespace(totalTime=step["total"], frames=frames)
    assembly = SimpleNamespace(nodeSets=nested(stored["sets"]), instances=instances)
    return SimpleNamespace(rootAssembly=assembly, steps=steps, close=lambda: None)
"""


def frame(value, load):
    """Two instances with a node 1 each: displacements of the plane, forces, and stresses at the corners of elements."""
    displacement = [["PART-1", [1, 2], [[load, 0.0], [2 * load, -load]]], ["PART-2", [1], [[7 * load, 0.0]]]]
    force = [["PART-1", [1, 2], [[0, 0, load], [0, 0, 3 * load]]], [None, [5], [[0, 0, -4 * load]]]]
    stress = [["PART-1", [1, 2, 2], [[load, 0, 0, 2 * load], [load, 0, 0, 0.0], [3 * load, 0, 0, 0.0]]]]
    fields = {
        "U": [["U1", "U2"], displacement],
        "RF": [["RF1", "RF2", "RF3"], force],
        "S": [["S11", "S22", "S33", "S12"], stress],
    }
    return {"value": value, "fields": fields}


ODB = {
    "sets": {"TOP": {"PART-1": [2], "PART-2": [1]}, "PUNCH": {"ASSEMBLY": [5]}, "BOTH": {"PART-1": [1, 2]}},
    "instances": {"PART-1": {"Edge": [1], "TOP": [1]}, "PART-2": {"EDGE": [1]}},
    "steps": [
        {"total": 0.0, "frames": [frame(0.0, 0.0), frame(0.5, 1.0), frame(1.0, 2.0)]},
        {"total": 1.0, "frames": [frame(0.0, 2.0), frame(1.0, 3.0)]},
    ],
}
LOADS = [0.0, 1.0, 2.0, 3.0]


@pytest.fixture
def abaqus(tmp_path):
    """The stand-in, a program: after the word python it runs a script, else it solves, leaving an .odb file."""
    modules = tmp_path / "modules"
    modules.mkdir()
    (modules / "odbAccess.py").write_text(ODB_ACCESS)
    (modules / "abaqusConstants.py").write_text("ELEMENT_NODAL = 'ELEMENT_NODAL'\n")
    (modules / "solved.odb").write_text(json.dumps(ODB))
    program = tmp_path / "abaqus"
    program.write_text(
        f'#!/bin/sh\nif [ "$1" != python ]; then exec cp {modules}/solved.odb plate.odb; fi\nshift\n'
        f'PYTHONPATH={modules} exec {sys.executable} "$@"\n'
    )
    program.chmod(0o755)
    return program


def results_in(folder, program, *asked):
    (folder / "job.odb").write_text(json.dumps(ODB))
    return Results(folder, "job", asked=asked, program=str(program))


@pytest.mark.parametrize(
    ("text", "per_load"),
    [
        ("U1@TOP:max", 7.0),
        ("U1@TOP", 4.5),
        ("U2@BOTH:min", -1.0),
        ("U@BOTH:max", np.sqrt(5.0)),
        ("U1@EDGE:sum", 8.0),
        ("U1@PART-2.EDGE", 7.0),
        ("U3@TOP:max", 0.0),
        ("RF3@BOTH", 4.0),
        ("RF3@PUNCH", -4.0),
        ("S11@BOTH", 1.5),
        ("S12@BOTH:max", 2.0),
        ("MISES@BOTH:max", np.sqrt(1.0 + 3 * 4.0)),
        ("S11:max", 2.0),
    ],
)
def test_a_quantity_of_an_output_database(abaqus, tmp_path, text, per_load):
    curve = parse_quantity("q", text).read(results_in(tmp_path, abaqus))
    assert curve.times.tolist() == [0.0, 0.5, 1.0, 2.0]
    np.testing.assert_allclose(curve.values, np.multiply(per_load, LOADS), rtol=1e-12)


def test_it_is_opened_once_for_all_that_is_asked_for(abaqus, tmp_path):
    results = results_in(tmp_path, abaqus, ("U", "TOP"), ("RF", "PUNCH"))
    for text in ("U1@TOP", "RF3@PUNCH", "U2@TOP:max"):
        parse_quantity("q", text).read(results)
    assert (tmp_path / "opened.txt").read_text() == "once\n"
    parse_quantity("q", "S11@BOTH").read(results)
    assert (tmp_path / "opened.txt").read_text() == "once\nonce\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("RF1@TOP", r"no number at some nodes of the set 'TOP'"),
        ("E11@TOP", r"E11@TOP:mean is not in 'job.odb': this program has none; give it by a function"),
        (
            "U1@SIDE",
            r"no set of nodes 'SIDE'; its sets are BOTH, EDGE, PART-1.EDGE, PART-1.TOP, PART-2.EDGE, PUNCH, TOP",
        ),
    ],
)
def test_what_is_not_there_is_told(abaqus, tmp_path, text, words):
    with pytest.raises(InputError, match=words):
        parse_quantity("q", text).read(results_in(tmp_path, abaqus))


def test_a_field_that_was_not_written_is_told_in_the_words_of_abaqus(abaqus, tmp_path, monkeypatch):
    monkeypatch.setitem(ODB, "steps", [{"total": 0.0, "frames": [{"value": 1.0, "fields": {}}]}])
    with pytest.raises(InputError, match=r"as by '\*OUTPUT, FIELD\\n\*NODE OUTPUT, NSET=TOP\\n RF'"):
        parse_quantity("q", "RF1@TOP").read(results_in(tmp_path, abaqus))


@pytest.mark.parametrize(
    ("program", "words"),
    [
        ("no-such-program", "there is no program 'no-such-program' to run.*--abaqus"),
        ("false", r"cannot be opened by 'false python'.* It said nothing \(exit status 1\)"),
    ],
)
def test_a_program_that_cannot_open_it_is_named(tmp_path, program, words):
    with pytest.raises(InputError, match=words):
        parse_quantity("q", "U1").read(results_in(tmp_path, program))


@pytest.mark.parametrize("named", [True, False])
def test_the_program_is_the_first_word_of_the_command_unless_it_is_named(abaqus, tmp_path, named):
    model = tmp_path / "model"
    model.mkdir()
    (model / "plate.inp").write_text("*MATERIAL, NAME=FAT\n*ELASTIC\n1., 0.3\n*NSET, NSET=TOP, INSTANCE=PART-1\n2\n")
    solve = f"cp {tmp_path}/modules/solved.odb {{job}}.odb" if named else f"{abaqus} job={{job}}"
    task = ModelRun(
        "complete", 0, model, "plate.inp", "abaqus", (("FAT", "*MATERIAL, NAME=FAT\n*ELASTIC\n2., 0.3\n"),),
        CommandSolver(solve), (parse_quantity("pull", "U1@TOP"),), (), tmp_path / "draws" / "one",
        SolverRun(abaqus=str(abaqus) if named else ""),
    )  # fmt: skip
    result = carried_out(task)
    assert (result["problem"], result["misread"]) == ("", "")
    assert result["curves"]["pull"] == [[0.0, 0.5, 1.0, 2.0], [4.5 * load for load in LOADS]]


def test_sets_of_sets_of_instances_are_left_to_the_result_file(tmp_path):
    """A deck of Abaqus with parts is not refused for them."""
    text = "*MATERIAL, NAME=A\n*NSET, NSET=ONE\n3\n*NSET, NSET=TOP\nPART-1.EDGE\n*NSET, NSET=MORE\nTOP, ONE\n"
    (tmp_path / "job.inp").write_text(text)
    deck = Deck.read(tmp_path / "job.inp", "abaqus")
    assert AbaqusDeck().node_sets(list(deck.files.values())) == {"ONE": {3}}


def test_the_script_runs_in_python_2_as_well():
    """As far as this shows without it: no annotations, no f-strings, no keyword-only arguments, only ASCII."""
    text = Path(SCRIPT).read_bytes().decode("ascii")
    nodes = list(ast.walk(ast.parse(text)))
    assert not [node for node in nodes if isinstance(node, (ast.JoinedStr, ast.AnnAssign, ast.NamedExpr, ast.Starred))]
    functions = [node for node in nodes if isinstance(node, ast.FunctionDef)]
    assert functions
    assert not [node for node in functions if node.returns or node.args.kwonlyargs]
