"""The user's model in an input deck: its material replaced, the solver run, and what it gives read."""

from tissuq.decks.abaqus import AbaqusDeck, AbaqusResults
from tissuq.decks.ansys import AnsysDeck, AnsysResults
from tissuq.decks.calculix_results import CalculiXResults
from tissuq.decks.deck import Deck, DeckFormat, DeckMaterial, deck_formats
from tissuq.decks.febio import FEBioDeck
from tissuq.decks.febio_plot_file import FEBioResults
from tissuq.decks.ls_dyna import LSDynaDeck
from tissuq.decks.model_ensemble import ModelEnsemble
from tissuq.decks.quantity import FunctionQuantity, Quantity, parse_quantity
from tissuq.decks.result_file import ResultFile
from tissuq.decks.solver import CalculiXSolver, CommandSolver, FEBioSolver, Solver, solver_for

__all__ = [
    "AbaqusDeck",
    "AbaqusResults",
    "AnsysDeck",
    "AnsysResults",
    "CalculiXResults",
    "CalculiXSolver",
    "CommandSolver",
    "Deck",
    "DeckFormat",
    "DeckMaterial",
    "FEBioDeck",
    "FEBioResults",
    "FEBioSolver",
    "FunctionQuantity",
    "LSDynaDeck",
    "ModelEnsemble",
    "Quantity",
    "ResultFile",
    "Solver",
    "deck_formats",
    "parse_quantity",
    "solver_for",
]
