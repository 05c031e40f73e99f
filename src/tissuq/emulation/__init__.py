"""Expensive forward models: a design, an emulator with its own error, and the posterior of the parameters."""

from tissuq.emulation.calibration import Calibration
from tissuq.emulation.deck_forward import DeckForward
from tissuq.emulation.emulator import Emulator, emulate
from tissuq.emulation.forward import FileForward, Forward, SeveralModels, UmbridgeForward
from tissuq.emulation.runs import ForwardRuns, gathered

__all__ = [
    "Calibration",
    "DeckForward",
    "Emulator",
    "FileForward",
    "Forward",
    "ForwardRuns",
    "SeveralModels",
    "UmbridgeForward",
    "emulate",
    "gathered",
]
