"""Decks: the named material is replaced, and every other byte stays."""

from __future__ import annotations

import re
from difflib import SequenceMatcher, unified_diff
from pathlib import Path

import pytest

import tissuq as tq
from tissuq.decks import Deck, deck_formats
from tissuq.export import CardSettings, card_format

ABAQUS = (
    b'** caf\xe9\n*HEADING\n*Material , name = "Fat"\n*ELASTIC\n1., 0.3\n*MATERIAL,\nNAME=Tissue\n*DENSITY\n1e-9\n'
    b"** what follows goes\n*HyperElastic,\n yeoh\n0.5, 0.1, 0.,\n1., 1., 1.\n** what follows stays\n\n"
    b"*SOLID SECTION, MATERIAL=TISSUE, ELSET=E\n*STEP\n*STATIC\n0.1, 1.\n*END STEP\n"
)
FEBIO = (
    b'<?xml version="1.0" encoding="UTF-8"?>\n<febio_spec version="4.0">\n <Globals/>\n <Material>\n'
    b'  <material id="1" name="Fat" type="neo-Hookean">\n   <E>1</E>\n  </material>\n  <!-- <material id="9"/> -->\n'
    b'  <material id="2" name=\'My Tissue\' type="Ogden">\n   <density>1.5e-9</density>\n   <c1>1</c1>\n  </material>\n'
    b" </Material>\n <Step><material>7</material></Step>\n</febio_spec>\n"
)
LS_DYNA = (
    b"*KEYWORD\n*MAT_ELASTIC\n$      mid        ro\n         3  7.85e-9   210000.       0.3\n*MAT_OGDEN_RUBBER_TITLE\n"
    b"My tissue, soft\n$#     mid        ro        pr\n        12   1.1e-9     0.499\n       1.0       2.0\n$ stays\n"
    b"*PART\n        12\n*MAT_ADD_EROSION\n        12\n*END\n"
)
ANSYS = (
    b"/PREP7\nMP,EX,1,210000 ! steel\nMP,NUXY,1,0.3\nMP,DENS,2,1e-9\nTB,HYPER,2,1,2,MOONEY ! tissue\n"
    b"TBDATA,1,0.5,0.1,0.01\n! stays\nMPDATA,R5.0, 1,EX  ,       2, 1,  1.0    ,\nTB,ELASTIC,1\n"
    b"TBDATA,1,2e5,0.3\n/SOLU\n"
)
DECKS = {
    "abaqus": ("model.inp", ABAQUS, "tissue", ["Fat", "Tissue"]),
    "febio": ("model.feb", FEBIO, "my tissue", ["Fat", "My Tissue"]),
    "ls-dyna": ("model.k", LS_DYNA, "12", ["3", "My tissue, soft"]),
    "ansys": ("model.cdb", ANSYS, "2", ["1", "2"]),
}
GONE = {
    "abaqus": [b"*HyperElastic,\n yeoh\n0.5, 0.1, 0.,\n1., 1., 1.\n"],
    "febio": [FEBIO[FEBIO.index(b'<material id="2"') : FEBIO.index(b"</material>\n </Mat") + len(b"</material>")]],
    "ls-dyna": [LS_DYNA[LS_DYNA.index(b"*MAT_OGDEN") : LS_DYNA.index(b"$ stays")]],
    "ansys": [
        b"TB,HYPER,2,1,2,MOONEY ! tissue\nTBDATA,1,0.5,0.1,0.01\n",
        b"MPDATA,R5.0, 1,EX  ,       2, 1,  1.0    ,\n",
    ],
}
"""What belongs to the elasticity of the material, and nothing else."""


@pytest.fixture(scope="module")
def block():
    """Return the function that gives the block of a card of a Yeoh material in a format."""
    stretch = [0.8, 0.9, 1.1, 1.2, 1.3, 1.4]
    data = tq.simulate("yeoh", {"C10": 0.5, "C20": 0.1, "C30": 0.0}, stretch, noise_sd=0.02, seed=1)
    draws = tq.fit(data, material="yeoh", discrepancy="none", noise_sd=0.02).ensemble(1)

    def of(code, number=1):
        return card_format(code).cards(draws, CardSettings(number=number)).blocks[0]

    return of


def written(folder, code, content=None):
    name, own, *_ = DECKS[code]
    (folder / name).write_bytes(own if content is None else content)
    return Deck.read(folder / name)


def test_every_format_is_here():
    assert set(DECKS) == set(deck_formats())


@pytest.mark.parametrize("code", DECKS)
def test_a_deck_is_recognised_and_its_materials_are_listed(tmp_path, code):
    deck = written(tmp_path, code)
    assert deck.format.name == code
    assert [material.label for _, material in deck.materials()] == DECKS[code][3]


@pytest.mark.parametrize("end", [b"\n", b"\r\n"], ids=["lf", "crlf"])
@pytest.mark.parametrize("code", DECKS)
def test_everything_outside_the_material_stays_byte_for_byte(tmp_path, block, code, end):
    _, content, wanted, _ = DECKS[code]
    content = content.replace(b"\n", end)
    deck = written(tmp_path, code, content)
    (after,) = deck.with_materials({wanted: block(deck.format.card_format, 2)}).values()
    gone = [part.replace(b"\n", end) for part in GONE[code]]
    start, last = content.index(gone[0]), content.index(gone[-1]) + len(gone[-1])
    assert after.startswith(content[:start])
    assert after.endswith(content[last:])
    new = after[start : len(after) - len(content[last:])]
    kept_between = content[start + len(gone[0]) : last - len(gone[-1])] if len(gone) > 1 else b""
    assert new.endswith(kept_between)
    assert all(part not in after for part in gone)
    assert b"\n" not in after.replace(b"\r\n", b"") or end == b"\n"


def test_the_diff_shows_the_material_alone(tmp_path, block):
    deck = written(tmp_path, "abaqus")
    diff = deck.diff(deck.with_materials({"Tissue": block("calculix")})).splitlines()
    gone = [line[1:] for line in diff[3:] if line.startswith("-")]
    new = [line[1:] for line in diff[3:] if line.startswith("+")]
    assert gone == ["*HyperElastic,", " yeoh", "0.5, 0.1, 0.,", "1., 1., 1."]
    assert new == block("calculix").splitlines()[1:]


def test_what_a_format_keeps_of_the_material(tmp_path, block):
    """The density, the name and the number of the user's; the constants of the card."""
    texts = {}
    for code, (_, _, wanted, _) in DECKS.items():
        folder = tmp_path / code
        folder.mkdir()
        deck = written(folder, code)
        (after,) = deck.with_materials(
            {wanted: block(deck.format.card_format, int(wanted) if wanted.isdigit() else 2)}
        ).values()
        texts[code] = after.decode("latin-1")
        again = written(folder, code, after)
        assert [material.label for _, material in again.materials()] == DECKS[code][3]
    assert "NAME=Tissue\n*DENSITY\n1e-9\n** what follows goes\n*HYPERELASTIC, YEOH\n" in texts["abaqus"]
    assert '<material id="2" name=\'My Tissue\' type="Yeoh">' in texts["febio"]
    assert re.findall(r"<density>.*?</density>", texts["febio"]) == ["<density>1.5e-9</density>"]
    titled = texts["ls-dyna"].split("*MAT_HYPERELASTIC_RUBBER_TITLE +\n")[1].splitlines()
    assert titled[0] == "My tissue, soft"
    assert (titled[2][:20].strip(), titled[2][20:40].strip()) == ("12", "1.1e-9")
    assert texts["ansys"].count("TB,HYPER,2,1,3,YEOH") == 1
    assert "MP,DENS,2,1e-9" in texts["ansys"]


def test_a_material_in_an_included_file_is_found_there_and_that_file_alone_changes(tmp_path, block):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "tissue.inp").write_bytes(ABAQUS)
    (tmp_path / "mesh.inp").write_bytes(b"*NODE\n1, 0., 0., 0.\n")
    (tmp_path / "run").mkdir()
    main = b"*INCLUDE, INPUT=../mesh.inp\n*include,input=../parts/tissue.inp\n"
    (tmp_path / "run" / "model.inp").write_bytes(main)
    deck = Deck.read(tmp_path / "run" / "model.inp")
    assert set(deck.files) == {"run/model.inp", "mesh.inp", "parts/tissue.inp"}
    assert deck.main == "run/model.inp"
    assert set(deck.with_materials({"Tissue": block("abaqus")})) == {"parts/tissue.inp"}


@pytest.mark.parametrize(
    ("code", "main", "included"),
    [
        ("febio", b'<febio_spec version="4.0"><Material from="part.txt"/></febio_spec>', FEBIO),
        ("febio", b'<febio_spec version="4.0"><Include>part.txt</Include></febio_spec>', FEBIO),
        ("ls-dyna", b"*KEYWORD\n*INCLUDE\n$ a comment\npart.txt\n*END\n", LS_DYNA),
        ("ls-dyna", b"*KEYWORD\n*INCLUDE\npa +\nrt.txt\n*END\n", LS_DYNA),
        ("ansys", b"/PREP7\n/INPUT,part,txt\n", ANSYS),
    ],
)
def test_other_formats_include_files_in_their_way(tmp_path, code, main, included):
    (tmp_path / "part.txt").write_bytes(included)
    deck = written(tmp_path, code, main)
    assert deck.material(DECKS[code][2])
    assert set(deck.files) == {DECKS[code][0], "part.txt"}


def test_two_materials_are_replaced_at_once(tmp_path, block):
    deck = written(tmp_path, "febio")
    (after,) = deck.with_materials({"1": block("febio", 1), "My Tissue": block("febio", 2)}).values()
    assert after.count(b'type="Yeoh"') == 2
    matches = SequenceMatcher(None, FEBIO.splitlines(), after.splitlines(), autojunk=False).get_matching_blocks()
    assert sum(match.size for match in matches) >= len(FEBIO.splitlines()) - 7


@pytest.mark.parametrize(
    ("code", "content", "wanted", "words"),
    [
        ("abaqus", ABAQUS, "Muscle", ["no material 'Muscle'", "Fat, Tissue"]),
        (
            "abaqus",
            ABAQUS.replace(b"*DENSITY", b"*VISCOELASTIC, TIME=PRONY"),
            "Tissue",
            ["*VISCOELASTIC", "out of the deck"],
        ),
        ("abaqus", ABAQUS + ABAQUS, "Tissue", ["2 materials 'Tissue'"]),
        ("abaqus", b"*INCLUDE, INPUT=/no/such.inp\n", "Tissue", ["no material", "/no/such.inp"]),
        (
            "ansys",
            ANSYS.replace(b"/SOLU", b"TB,PRONY,2,1,1,SHEAR\nTBDATA,1,0.1,1\n"),
            "2",
            ["TB,PRONY", "out of the deck"],
        ),
        ("febio", FEBIO.replace(b'"Ogden"', b'"rigid body"'), "2", ["rigid body"]),
        ("febio", FEBIO.replace(b'"Ogden"', b'"biphasic"'), "2", ["'biphasic'", "would be lost"]),
        ("febio", FEBIO.replace(b'"Ogden"', b'"uncoupled viscoelastic"'), "2", ["viscoelastic"]),
        ("ls-dyna", LS_DYNA.replace(b"*MAT_OGDEN_RUBBER", b"*MAT_VISCOELASTIC"), "12", ["depends on time"]),
        ("ls-dyna", LS_DYNA.replace(b"*MAT_OGDEN_RUBBER", b"*MAT_006"), "12", ["depends on time"]),
        ("ansys", ANSYS.replace(b"TB,HYPER,2", b"TB,HYPER,fat"), "fat", ["number in digits"]),
        ("ansys", ANSYS + b"fat = 2\nMP,EX,FAT,5\n", "2", ["'FAT', too"]),
        ("ansys", ANSYS + b"*SET,fat,2\nMP,EX,FAT,5\n", "2", ["'FAT', too"]),
        ("ansys", ANSYS.replace(b"TBDATA,1,0.5", b"$TBDATA,1,0.5"), "2", ["line 6", "several commands"]),
        ("abaqus", ABAQUS.replace(b"1e-9\n", b"1e-9\n*SOLUBILITY\n1.\n*VISCOELASTIC\n"), "Tissue", ["*VISCOELASTIC"]),
    ],
)
def test_what_cannot_be_replaced_is_refused(tmp_path, code, content, wanted, words):
    with pytest.raises(tq.InputError) as said:
        written(tmp_path, code, content).material(wanted)
    assert all(word in str(said.value) for word in words), said.value


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("model.inp", b"*INCLUDE, INPUT=mesh.inp\n", "that 'model.inp' includes"),
        ("model.feb", b"<febio_spec><Material></febio_spec>", "no XML"),
        ("model.inp", b"*INCLUDE, INPUT=a\0b\n", r"a\\x00b' cannot be read"),
        ("model.inp", b"*INCLUDE, INPUT=" + b"a" * 5000 + b"\n", "cannot be read"),
        ("model.xyz", b"hello\n", "--deck"),
        ("model.inp", b"hello\n", "--deck"),
    ],
)
def test_what_cannot_be_read_is_refused(tmp_path, name, content, words):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(tq.InputError, match=words):
        Deck.read(tmp_path / name)


def test_an_ansys_deck_with_the_suffix_of_abaqus_is_told_from_it(tmp_path):
    (tmp_path / "model.inp").write_bytes(ANSYS)
    assert Deck.read(tmp_path / "model.inp").format.name == "ansys"
    assert Deck.read(tmp_path / "model.inp", "abaqus").format.name == "abaqus"


def test_a_material_without_elasticity_gets_the_card_below_its_name(tmp_path, block):
    content = b"*MATERIAL, NAME=T\n*DENSITY\n1.\n*STEP\n"
    (after,) = written(tmp_path, "abaqus", content).with_materials({"t": block("calculix")}).values()
    assert after == b"*MATERIAL, NAME=T\n" + block("calculix").partition("\n")[2].encode() + content.partition(b"\n")[2]


def test_the_diff_is_that_of_the_whole_files(tmp_path, block):
    """Against difflib on all lines, with the material at the start, in the middle and at the end."""
    block_of = block("calculix")
    lines = [f"** line {number}\n" for number in range(40)]
    for at in (0, 1, 20, 39, 40):
        text = "".join([*lines[:at], "*MATERIAL, NAME=T\n*ELASTIC\n1., 0.3\n", *lines[at:]]).encode()
        deck = written(tmp_path, "abaqus", text)
        changed = deck.with_materials({"T": block_of})
        before, after = (content.decode().splitlines() for content in (text, changed["model.inp"]))
        wanted = unified_diff(before, after, "model.inp (the model)", "model.inp (a draw)", lineterm="")
        assert deck.diff(changed).splitlines() == list(wanted)


def test_an_option_between_those_of_a_material_does_not_hide_its_elasticity(tmp_path, block):
    content = ABAQUS.replace(b"1e-9\n", b"1e-9\n*SOLUBILITY\n1.\n")
    (after,) = written(tmp_path, "abaqus", content).with_materials({"Tissue": block("calculix")}).values()
    assert b"*HyperElastic" not in after
    assert after.count(b"*HYPERELASTIC") == 1
    assert b"1e-9\n*SOLUBILITY\n1.\n** what follows goes\n*HYPERELASTIC" in after


def test_a_density_in_a_comment_is_none(tmp_path, block):
    density = b"<density>1.5e-9</density>"
    content = FEBIO.replace(density, b"<!-- <density>7</density> --><density >1.5e-9</density>")
    (after,) = written(tmp_path, "febio", content).with_materials({"2": block("febio", 2)}).values()
    assert re.findall(rb"<density.*?</density>", after) == [b"<density >1.5e-9</density>"]
    (after,) = (
        written(tmp_path, "febio", FEBIO.replace(density, b"<!-- <density>7</density> -->"))
        .with_materials({"2": block("febio", 2)})
        .values()
    )
    assert b"<density>7" not in after


def test_only_files_that_are_allowed_are_included_from_outside(tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "mesh.inp").write_bytes(b"*NODE\n1, 0., 0., 0.\n")
    file = tmp_path / "run" / "model.inp"
    for name in ("../mesh.inp", str(tmp_path / "mesh.inp")):
        file.write_text(f"*INCLUDE, INPUT={name}\n*MATERIAL, NAME=T\n")
        with pytest.raises(tq.InputError, match="--also"):
            Deck.read(file, allowed=())
        assert Deck.read(file, allowed=[tmp_path / "mesh.inp"]).material("T")


def test_what_a_file_outside_includes_is_outside_too(tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "far").mkdir()
    names = [str(tmp_path / "far" / name) for name in ("a.inp", "b.inp")]
    Path(names[0]).write_text("*INCLUDE, INPUT=b.inp\n*INCLUDE, INPUT=c.inp\n")
    Path(names[1]).write_text("** nothing\n")
    (tmp_path / "run" / "c.inp").write_text("** nothing\n")
    file = tmp_path / "run" / "model.inp"
    file.write_text(f"*INCLUDE, INPUT={names[0]}\n")
    deck = Deck.read(file)
    assert (deck.outside, set(deck.files)) == (tuple(names), {"model.inp", "c.inp"})
    with pytest.raises(tq.InputError, match=r"'a\.inp' includes .*b\.inp"):
        Deck.read(file, allowed=[Path(names[0])])
