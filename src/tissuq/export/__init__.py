"""Material cards: draws of a posterior as complete materials for finite-element codes."""

from tissuq.export.cards import CardFormat, Cards, CardSettings, card_format, card_formats
from tissuq.export.code import Card, FECode
from tissuq.export.fibres import check_fibres
from tissuq.export.formats import Abaqus, Ansys, CalculiX, FEBio, LSDyna
from tissuq.export.table import Table

__all__ = [
    "Abaqus",
    "Ansys",
    "CalculiX",
    "Card",
    "CardFormat",
    "CardSettings",
    "Cards",
    "FEBio",
    "FECode",
    "LSDyna",
    "Table",
    "card_format",
    "card_formats",
    "check_fibres",
]
