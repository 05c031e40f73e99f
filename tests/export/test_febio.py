"""FEBio cards, and decks with them, against the rules of FEBio's own reader."""

from __future__ import annotations

import pytest

import tissuq as tq
from febio_grammar import refusals
from tissuq.decks import Deck
from tissuq.export import CardSettings, card_format

LAWS = {
    "Mooney-Rivlin": ("mooney-rivlin", [0.3, 0.2]),
    "Yeoh": ("yeoh", [0.5, -0.05, 0.03]),
    "Ogden": ("ogden-2", [0.9, 0.2, 3.0, -4.0]),
    "Gent": ("gent", [0.9, 30.0]),
    "Veronda-Westmann": ("veronda-westmann", [0.9, 0.4]),
}
FORMER = """<febio_spec version="4.0"><Material><material id="1" name="T" type="uncoupled solid mixture">
<solid type="Yeoh"><c1>1</c1><k>100</k></solid></material></Material></febio_spec>"""
"""What tissuq wrote once: the bulk moduli with the solids."""
MODEL = """<?xml version="1.0"?>
<febio_spec version="4.0">
 <Material>
  <material id="1" name="Fat" type="Mooney-Rivlin"><c1>1</c1><c2>0</c2><k>100</k></material>
  <material id="2" name="Tissue" type="neo-Hookean"><E>1</E><v>0.49</v></material>
 </Material>
</febio_spec>
"""


def card(ensemble, **settings):
    cards = card_format("febio").cards(ensemble, CardSettings(**settings))
    return next(iter(cards.files.values())), cards.blocks[0]


@pytest.mark.parametrize("kind", LAWS)
def test_febio_takes_a_card_of_every_type(given, kind):
    text, _ = card(given([LAWS[kind]]))
    assert f'type="{kind}"' in text
    assert refusals(text) == []


@pytest.mark.slow
def test_febio_takes_the_mixture_of_a_free_energy(auto):
    text, _ = card(auto, law="mixture")
    assert 'type="uncoupled solid mixture"' in text
    assert refusals(text) == []
    assert refusals(card(auto)[0]) == []  # the nearest of its laws


def test_what_the_rules_refuse(given):
    """That they can fail: on the mixture as it was once, on a number that is not its place, and on a coupled law."""
    assert refusals(FORMER) == [
        "Yeoh: K should only be defined at the top level",
        "uncoupled solid mixture: K must be a positive number",
    ]
    text, _ = card(given([LAWS["Yeoh"]]), number=2)
    assert refusals(text) == ["id 2 of material 1"]
    assert refusals(MODEL) == ["unknown type neo-Hookean"]


@pytest.mark.parametrize("kind", ["Yeoh", "Ogden"])
def test_febio_takes_a_deck_with_a_draw_as_its_second_material(given, tmp_path, kind):
    (tmp_path / "model.feb").write_text(MODEL, encoding="utf-8")
    deck = Deck.read(tmp_path / "model.feb")
    _, block = card(given([LAWS[kind]]), number=2)
    (after,) = deck.with_materials({"Tissue": block}).values()
    assert refusals(after.decode()) == []
    with pytest.raises(tq.InputError, match="no material 'Muscle'"):
        deck.with_materials({"Muscle": block})
