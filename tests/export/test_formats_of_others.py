"""What a format of cards of one's own does wrong is said in words, with its name."""

from __future__ import annotations

import pytest

import tissuq as tq
from tissuq.export import CardFormat
from tissuq.export.cards import Cards, CardSettings

ONE_ROW = Cards({"draw-1.txt": "MU = 1"}, ({"draw": 1},), ())


def failing(ensemble):
    raise KeyError("mu")


@pytest.mark.parametrize(
    ("cards", "words"),
    [
        (lambda ensemble: ["MU = 1"], "must return tissuq.export.cards.Cards, not list"),
        (lambda ensemble: ONE_ROW, "returns 1 rows of the index for 2 draws"),
        (failing, "cannot write the draws: KeyError: 'mu'"),
    ],
)
def test_what_it_does_wrong_is_said(cards, words):
    class Wrong(CardFormat):
        """Its name is not kept."""

        name = property(lambda self: "wrong")
        description = "of a test"

        def cards(self, ensemble, settings):
            return cards(ensemble)

    with pytest.raises(tq.InputError, match=rf"the format of cards 'wrong' \(.*Wrong\) {words}"):
        Wrong().checked_cards([None, None], CardSettings(unit="kPa"))
