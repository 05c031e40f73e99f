"""The folder of cards."""

from __future__ import annotations

import csv

import pytest

import tissuq as tq
from tissuq.export import CardSettings, card_format


@pytest.fixture(scope="module")
def draws():
    stretch = [0.8, 0.9, 0.95, 1.05, 1.1, 1.2, 1.4]
    data = tq.simulate("neo-hookean", {"C10": 0.5}, stretch, noise_sd=0.02, seed=1)
    return tq.fit(data, discrepancy="yeoh", noise_sd=0.02).ensemble(3)


def test_the_folder_holds_what_cards_are(draws, tmp_path):
    cards = tq.write_cards(draws, tmp_path / "cards", "febio", unit="kPa", name="SKIN")
    wanted = card_format("febio").cards(draws, CardSettings(unit="kPa", name="SKIN"))
    assert (cards.files, cards.warnings) == (wanted.files, wanted.warnings)
    assert [{name: row[name] for name in row if name != "from_median"} for row in cards.index] == list(wanted.index)
    found = {path.name: path.read_text(encoding="utf-8") for path in (tmp_path / "cards").iterdir()}
    assert set(found) == {*cards.files, "index.csv", "contents.txt"}
    assert all(found[name] == text for name, text in cards.files.items())
    rows = list(csv.DictReader(found["index.csv"].splitlines()))
    assert [float(row["C10"]) for row in rows] == [1e3 * draw.values["C10"] for draw in draws]
    assert [float(row["card_c2"]) for row in rows] == pytest.approx([1e3 * draw.parts[1][1][1] for draw in draws])


def test_nothing_is_overwritten_unasked_and_nothing_half_written(draws, tmp_path):
    place = tmp_path / "cards"
    with pytest.raises(tq.InputError, match="no law 'gent'"):
        tq.write_cards(draws, place, "febio", law="gent")
    assert not list(tmp_path.iterdir())
    tq.write_cards(draws, place)
    with pytest.raises(tq.InputError, match="exists"):
        tq.write_cards(draws, place)
    tq.write_cards(draws, place, "ansys", force=True)
    assert "TB,HYPER" in (place / "draw-1.inp").read_text()
    (place / "mine.inp").write_text("a model")
    with pytest.raises(tq.InputError, match=r"mine\.inp"):
        tq.write_cards(draws, place, force=True)
